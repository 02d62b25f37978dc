#pragma once
// Coordinator: accepts jobs, leases their units to workers, merges each result exactly once, and writes the image. For
// algorithms that need tables it first lets workers trace the training set, and learns the tables itself. It does not render, and
// gRPC is kept to its callers (grpc_services.h); leases and measured durations follow an injected clock. Safe for any number of
// threads. What it does is done by its desks, which share an office; here is only who calls which.

#include <limits>

#include "server/admission.h"
#include "server/dispatch.h"
#include "server/end_early.h"
#include "server/gallery.h"
#include "server/intake.h"
#include "server/office.h"

namespace lightloom {

class Coordinator {
  public:
    /// Without a store nothing outlives the process; with one, the jobs that are in it go on. Throws no errors of the store: see
    /// restored().
    explicit Coordinator(CoordinatorOptions options, std::unique_ptr<JobStore> store = nullptr);
    ~Coordinator();
    /// Whether the jobs of the store could be read.
    const Status& restored() const { return restored_; }

    /// The files of tables that jobs need.
    std::set<Digest> pinned_tables() const;
    /// Whether there is room on the disk; while there is not, nobody gets units.
    Status room() const;
    AssetStore& assets() { return office_.assets; }

    // Jobs; see admission.h, end_early.h and gallery.h.
    Result<JobInfo> submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label = {},
                               Reuse reuse = Reuse::kAnew) {
        return admission_.submit(request_id, spec, label, reuse);
    }
    Result<JobInfo> get_job(const std::string& job_id) const { return admission_.get(job_id); }
    std::vector<JobInfo> list_jobs() const { return admission_.list(); }
    Result<JobInfo> cancel_job(const std::string& job_id, OnCancel what = OnCancel::kThrowAway) {
        return end_early_.cancel(job_id, what);
    }
    Result<JobInfo> finish_job(const std::string& job_id) { return end_early_.finish(job_id); }
    Result<JobInfo> wait_job(const std::string& job_id, uint64_t after, double timeout_seconds) const {
        return admission_.wait(job_id, after, timeout_seconds);
    }
    Status wait_job_end(const std::string& job_id, double timeout_seconds) const {
        return admission_.wait_end(job_id, timeout_seconds);
    }
    Result<std::string> image(const std::string& job_id, ImageKind kind) const { return gallery_.image(job_id, kind); }
    Result<Preview> preview(const std::string& job_id, PreviewFormat format, double exposure = 0) const {
        return gallery_.preview(job_id, format, exposure);
    }
    Result<std::string> manifest(const std::string& job_id, ManifestKind kind = ManifestKind::kFinal) const {
        return gallery_.manifest(job_id, kind);
    }

    // Workers; see dispatch.h.
    Result<WorkerGrant> register_worker(const WorkerHello& hello) { return dispatch_.register_worker(hello); }
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds,
                                               const std::function<bool()>& cancelled) {
        return dispatch_.lease(worker_id, wait_seconds, cancelled);
    }
    void wake_leases() { dispatch_.wake(); }
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) {
        return dispatch_.heartbeat(worker_id, running);
    }
    Status release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) {
        return dispatch_.release(worker_id, unit, why);
    }
    Status goodbye(const std::string& worker_id) { return dispatch_.goodbye(worker_id); }
    std::vector<WorkerStatus> workers(double gone_within_seconds = std::numeric_limits<double>::infinity()) const {
        return dispatch_.workers(gone_within_seconds);
    }

    // Results; see intake.h.
    Result<PartialExpectation> expected_partial(const UnitReference& unit) const { return intake_.expected_partial(unit); }
    Result<SubmitAck> submit_payload(const std::string& worker_id, const UnitReference& unit, const PartialDescriptor& descriptor,
                                     std::string_view payload, double render_seconds = 0) {
        return intake_.submit_payload(worker_id, unit, descriptor, payload, render_seconds);
    }
    Result<SubmitAck> submit_partial(const std::string& worker_id, const UnitReference& unit, const EncodedPartial& encoded,
                                     Partial partial, double render_seconds = 0) {
        return intake_.submit_partial(worker_id, unit, encoded, std::move(partial), render_seconds);
    }
    Result<uint64_t> expected_training_bytes(const UnitReference& unit) const { return intake_.expected_training_bytes(unit); }
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitReference& unit, const Digest& digest,
                                      std::string_view payload, double trace_seconds) {
        return intake_.submit_training(worker_id, unit, digest, payload, trace_seconds);
    }

  private:
    /// Wakes up whenever a job is due.
    void keep_time(std::stop_token stop);
    /// Stops giving out units where the disk is full, and goes on where it is not any more.
    void look_for_room(OpenBook& book);

    mutable Office office_;
    Status restored_;
    Admission admission_;
    EndEarly end_early_;
    Gallery gallery_;
    Dispatch dispatch_;
    Intake intake_;
    TimePoint room_checked_;  ///< For the ticker alone.
    std::jthread ticker_;     // last, so that it stops before anything that it uses is destroyed
};

}  // namespace lightloom
