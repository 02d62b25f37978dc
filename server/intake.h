#pragma once
// The desk at which results come in: each is checked against its unit, entered once, and added to its image or training set.

#include "common/film/partial_exr.h"
#include "server/office.h"

namespace lightloom {

/// The answer to a result for which expected_partial() or expected_training_bytes() failed: a result that comes too
/// late is stale, any other is rejected.
SubmitAck unexpected_result(const Status& why);

class Intake {
  public:
    explicit Intake(Office& office) : office_(office) {}

    /// What the payload of a unit must be, for limits before bytes are received; kNotFound if the job or unit is not
    /// open.
    Result<PartialExpectation> expected_partial(const UnitReference& unit) const;
    /// Takes a partial that came over the wire; it is checked against the unit before anything reads it.
    Result<SubmitAck> submit_payload(const std::string& worker_id, const UnitReference& unit, const PartialDescriptor& descriptor,
                                     std::string_view payload, double render_seconds);
    /// Takes a partial from this process, and what encode_partial() makes of it; `render_seconds` is the time that it took, or 0 if
    /// nobody has measured that.
    Result<SubmitAck> submit_partial(const std::string& worker_id, const UnitReference& unit, const EncodedPartial& encoded,
                                     Partial partial, double render_seconds);
    /// Most bytes of the training data of a unit; errors as those of expected_partial().
    Result<uint64_t> expected_training_bytes(const UnitReference& unit) const;
    /// Takes serialized training data, which are checked against digest and unit before they count.
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitReference& unit, const Digest& digest,
                                      std::string_view payload, double trace_seconds);

  private:
    /// A result as it is kept: what came over the wire.
    struct Kept {
        const PartialDescriptor& descriptor;
        std::string_view payload;
    };
    Result<SubmitAck> take_partial(const std::string& worker_id, const UnitReference& unit, const Kept& kept, Partial partial,
                                   double render_seconds);
    /// The answer to a result that came before, or to one that is not wanted; nothing if it is to be kept. `*file` and `*worker`
    /// are set then.
    std::optional<Result<SubmitAck>> look_up(const std::string& worker_id, const UnitReference& unit, const Digest& digest,
                                             JobPtr* file, WorkerRecord* worker);
    /// What the worker is told when its result could not be kept.
    Result<SubmitAck> not_kept(const JobPtr& file, const UnitKey& unit, const std::string& worker_id, const Status& why);
    SubmitAck report_difference(OpenBook& book, const JobPtr& file, const UnitKey& unit, const std::string& worker_id);
    /// Now and then writes down what a job has taken of its time limit.
    void note_time(const JobPtr& file);
    /// Starts a checkpoint of the job where enough has come since the last one.
    void checkpoint_if_due(OpenBook& book, const JobPtr& file, uint64_t bytes);
    /// Enters a result into its table. Returns nothing for a first result, which the caller merges, and otherwise the
    /// answer.
    std::optional<SubmitAck> repeated_result(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key,
                                             const WorkerRecord& worker, const Digest& digest);
    /// Counts an invalid result against its worker and its unit, which is rendered again; returns the answer.
    SubmitAck reject_result(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker,
                            const Status& why);

    Office& office_;
};

}  // namespace lightloom
