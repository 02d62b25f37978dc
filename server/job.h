#pragma once
// Job: one job from its acceptance to its end. Its transitions change the state and return what has to follow (effects.h); they
// touch no lock, clock, disk or thread, and know no other job and no worker but by number.

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/effects.h"
#include "server/preparation.h"
#include "server/reducer.h"
#include "server/time_point.h"
#include "server/unit_table.h"

namespace lightloom {

class Job {
  public:
    /// What a job is from its first moment on.
    struct Submission {
        std::string id, request_id;
        JobSpec submitted;  ///< As submitted, to recognise a repeated submission.
        JobLabel label;
        std::string scene;                ///< Path of the scene file in its file list.
        std::string created_at;           ///< UTC, for the manifest only.
        std::filesystem::path directory;  ///< Where its image will be.
    };
    /// What an earlier coordinator did for the job.
    struct Past {
        double age_seconds = 0;        ///< Since the submission.
        double rendering_seconds = 0;  ///< Time that was taken of the time limit, beside that of Preparation.
        uint64_t revision = 1;         ///< Above any that somebody has seen.
    };
    /// `canonical` is the spec with nothing left to defaults but what the scene decides.
    Job(Submission submission, JobSpec canonical, TimePoint now, const Past& past);
    Job(Submission submission, JobSpec canonical, TimePoint now) : Job(std::move(submission), std::move(canonical), now, Past()) {}
    /// A job that has ended before this coordinator began; `last` is what was told of it then.
    Job(Submission submission, const JobInfo& last, TimePoint now, const Past& past);

    const Submission& submission() const { return submission_; }
    const std::string& id() const { return submission_.id; }
    const JobSpec& spec() const { return spec_; }
    JobState state() const { return state_; }
    bool ended() const { return is_terminal(state_); }
    const std::string& message() const { return message_; }
    /// Grows with every change that a watcher may see.
    uint64_t revision() const { return revision_; }
    void touch() { ++revision_; }
    const TablesInfo& tables() const { return tables_; }

    /// The job whose tables this one waits for.
    struct WaitsFor {
        std::string id;
        double eta_seconds = -1;
    };
    JobInfo info(TimePoint now, const std::optional<WaitsFor>& waits_for = {}) const;
    /// What is left of the time limit; only for a job that has one. Neither reading the scene nor waiting, for workers or for
    /// the tables of another job, takes any of it.
    double seconds_left(TimePoint now) const;

    /// In kPreparing: how far the scene and the tables are.
    Preparation& preparation() { return preparation_; }
    const Preparation& preparation() const { return preparation_; }
    /// The spec as far as the scene or a time limit has completed it. In kPreparing.
    void complete_spec(JobSpec spec) { spec_ = std::move(spec); }
    /// Opens a round of training units. In kPreparing.
    Effects open_round(UnitKind kind, uint32_t number, const TrainingWork& work, std::optional<uint64_t> shuffle_seed);
    /// Closes it because another job makes the same tables. In kPreparing.
    Effects wait_for_tables();

    /// What rendering needs.
    struct RenderPlan {
        JobSpec spec;  ///< Complete.
        std::vector<ImageLayer> layers;
        UnitTable units;
        std::shared_ptr<Reducer> reducer;
        TablesInfo tables;
        /// Of results that an earlier coordinator has taken, which `units` and `reducer` hold.
        UnitCounters counters;
        uint64_t dropped = 0;
        std::set<uint32_t> workers;
    };
    /// kPreparing -> kRunning; nothing in any other state.
    Effects begin_rendering(RenderPlan plan, TimePoint now);

    /// The units that can be leased now, or null.
    UnitTable* open_units();
    const UnitTable* open_units() const { return const_cast<Job*>(this)->open_units(); }
    /// The same if the unit is of their kind and round, otherwise null: a late result of one round does not belong to
    /// the next.
    UnitTable* open_units(const UnitKey& unit);
    /// Where the open round waits, for workers or for the scene, the time limit does not run.
    void stop_idle_clock(TimePoint now) {
        if (state_ == JobState::kPreparing && preparation_.waits()) preparation_.stop_clock(now);
    }
    /// A worker says that it renders a unit of the image: from the first time on the time limit runs.
    Effects rendering_begins(TimePoint now);

    const std::shared_ptr<Reducer>& reducer() const { return reducer_; }
    /// What a worker did for a result.
    struct Work {
        uint32_t worker = 0;
        UnitCounters counters;
        uint64_t dropped = 0;
    };
    /// A result was added to the reducer. In kRunning.
    Effects count(const Work& work);
    /// No more groups than are complete now, or the first, are rendered: the time limit has passed. In kRunning.
    void close() { closed_ = true; }
    /// Time that rendering has taken, under earlier coordinators too.
    double rendering_seconds(TimePoint now) const;
    bool time_is_up(TimePoint now) const;
    /// When time_is_up() will be true; nothing for a job without a limit, or that does not render yet.
    std::optional<TimePoint> end_of_time() const;
    /// The job ends with its first `groups` groups, although more were asked for. In kPreparing or kRunning.
    void finish_with(uint32_t groups);
    bool finishes_early() const { return finish_with_.has_value(); }
    /// kRunning -> kFinishing once there is nothing left to render; `*finish` tells.
    Effects finish_if_complete(TimePoint now, bool* finish);

    std::vector<ImageLayer> take_layers() { return std::move(layers_); }
    /// What the image is made of, which is known once the reducer is frozen.
    struct Image {
        Digest digest;
        uint64_t size = 0;
        RareLightReport rare_light;
        std::optional<NoiseReport> noise;
    };
    /// Takes the final counts from the reducer. In kFinishing, or while the job keeps its groups. Returns who rendered what of the
    /// image.
    std::vector<UnitTable::Merged> settle(const Image& image);
    const std::set<uint32_t>& workers() const { return workers_; }
    uint32_t merged_groups() const { return merged_groups_; }
    uint64_t merged_iterations() const { return merged_iterations_; }

    /// Any state -> an end; nothing in a state that is one. With OnCancel::kKeep a job that has complete groups keeps reducer and
    /// units, and asks for their being written (Effects::keep): let_go() ends that.
    Effects end(JobState state, std::string message, TimePoint now, OnCancel groups = OnCancel::kThrowAway);
    Effects fail(const Status& why, TimePoint now) { return end(JobState::kFailed, why.message(), now, OnCancel::kKeep); }
    /// The complete groups of a job that has ended are on disk, or cannot be written.
    Effects let_go(bool written);
    /// Whether a job that ended without its image still has its complete groups, in memory or on disk.
    bool has_partial() const;
    /// Whether the image is all that was asked for: nobody and no limit of time ended the job before.
    bool gave_all() const;

    /// Counts for the manifest and for watchers.
    struct Incidents {
        uint64_t duplicates_same = 0, duplicates_different = 0, expired_leases = 0, rejected = 0;
    };
    Incidents incidents;

  private:
    void tell_rendering(TimePoint now, JobInfo* info) const;

    /// Reducer and units.
    Effects throw_groups_away();
    /// Takes over what is merged by now.
    Effects advance();

    const Submission submission_;
    const Past past_;
    /// What is told of a job that had ended before this coordinator began.
    std::optional<JobInfo> last_;
    JobSpec spec_;
    JobState state_ = JobState::kPreparing;
    std::string message_;
    uint64_t revision_;
    TimePoint created_, prepared_, finishing_, ended_;
    std::optional<TimePoint> first_render_;
    Preparation preparation_;
    TablesInfo tables_;

    bool closed_ = false;  ///< Whether the time limit has passed or the noise target is reached.
    std::optional<uint32_t> finish_with_;
    std::vector<ImageLayer> layers_;  ///< First-hit layers, until the image is written.
    std::optional<UnitTable> units_;  ///< Until the job ends; after that `ended_units_` holds the counts.
    struct UnitCounts {
        uint64_t total = 0, done = 0;
    } ended_units_;
    std::shared_ptr<Reducer> reducer_;  ///< It has its own lock and is used without the book's.
    uint32_t merged_groups_ = 0;        ///< Complete groups merged so far.
    uint64_t merged_iterations_ = 0;    ///< Iterations of these groups.
    std::set<uint32_t> workers_;        ///< Indices of the workers whose units were merged.
    /// Work of all units that arrived; in the end, of those in the image. The same holds for `dropped_`.
    UnitCounters counters_;
    uint64_t dropped_ = 0;
    RareLightReport rare_light_;        ///< About the finished image.
    std::optional<NoiseReport> noise_;  ///< About the groups merged at its time, in the end about the finished image.
    Digest image_digest_;
    uint64_t image_size_ = 0;
};

/// True for a job that neither samples nor time bound: how many units it has turns out while it runs.
inline bool only_noise_bounds(const JobSpec& spec) { return spec.samples_per_pixel == 0 && spec.time_limit_seconds == 0; }

}  // namespace lightloom
