#pragma once
// The service as plain C++: the data that its parts exchange, and the two ports (interfaces) of the coordinator. Each
// port has two implementations, one over gRPC and one in process, so that a job runs through the same code in both
// forms.

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "common/core/digest.h"
#include "common/core/result.h"
#include "common/film/noise_estimate.h"
#include "common/film/partial.h"
#include "common/work/asset.h"
#include "common/work/job.h"

namespace lightloom {

/// The identity that must be equal on all hosts, so that the bytes of an image do not depend on the host.
struct BuildIdentity {
    std::string build_id;      ///< Version and digest of the sources that compute light.
    std::string math_profile;  ///< Compiler, instruction set, ray tracer.
    Digest golden_digest;      ///< Digest of what golden units render to on this host.
    friend bool operator==(const BuildIdentity&, const BuildIdentity&) = default;
};

struct WorkerHello {
    BuildIdentity identity;
    uint32_t thread_count = 1;
    std::string host;
    uint64_t process_id = 0;
};

struct WorkerGrant {
    std::string worker_id;
    double heartbeat_seconds = 1;
    double lease_seconds = 10;
};

struct UnitReference {
    std::string job_id;
    UnitKey key;
    friend auto operator<=>(const UnitReference&, const UnitReference&) = default;
};

/// Content-addressed bytes; size 0 means none.
struct AssetReference {
    Digest digest;
    uint64_t size_bytes = 0;
};

struct UnitLease {
    std::string job_id;
    JobSpec spec;
    WorkUnit unit;
    AssetReference tables;  ///< Tables that the unit reads; none where the algorithm needs none.
    UnitReference reference() const { return {job_id, unit.key}; }
};

struct RunningUnit {
    UnitReference unit;
    bool rendering = false;  ///< False while its scene is fetched or built, or while it waits for its turn.
};

enum class SubmitOutcome { kAccepted, kDuplicateSame, kDuplicateDifferent, kStale, kRejected };

struct SubmitAck {
    SubmitOutcome outcome = SubmitOutcome::kAccepted;
    std::string reason;
};

enum class JobState { kPreparing, kRunning, kFinishing, kSucceeded, kFailed, kCancelled };
bool is_terminal(JobState state);
/// What a job in kPreparing is doing.
enum class PreparePhase { kReadingScene, kProbing, kTracing, kLearning, kWaitingForTables };
/// Text for people, for example "tracing training paths".
std::string_view to_string(PreparePhase phase);

/// The tables that a job renders with, and what making them cost; see the message TablesSummary.
struct TablesInfo {
    AssetReference asset;  ///< None before they exist, and where the algorithm needs none.
    uint32_t light_subspaces = 0, eye_subspaces = 0;
    uint64_t training_samples = 0;
    bool capped_by_time_limit = false;
    bool from_cache = false;
    double trace_seconds = 0, classifier_seconds = 0, energy_seconds = 0, gamma_seconds = 0;
    double uniform_loss = 0, loss = 0, prior_strength = 0;
    std::string note;
    Digest cache_key;

    /// Text for people: "tables of 800 x 1000 subspaces", or "tables" of an algorithm that has none.
    std::string what() const;
};

/// The state as a lower-case word.
std::string_view to_string(JobState state);

/// The name of a job, and who claims to own it, which nobody checks. A label decides nothing of the image.
struct JobLabel {
    static constexpr size_t kMaxBytes = 128;  ///< Of each of the two.
    std::string name, owner;
};
/// kInvalidArgument for a text that is too long, or that a terminal does not show as one line.
Status check_label(const JobLabel& label);

/// Shortest and longest time limit of a job, in seconds.
inline constexpr double kMinTimeLimit = 0.001, kMaxTimeLimit = 30 * 86400.0;
/// Of a job's time limit in seconds, where 0 stands for none: kInvalidArgument for any other number that is not from kMinTimeLimit
/// to kMaxTimeLimit, or is none at all.
Status check_time_limit(double seconds);

/// The estimated error of a job's image, and what it decides; see the message NoiseSummary.
struct NoiseReport {
    NoiseEstimate estimate;
    bool reached = false, light_missing = false;
    friend bool operator==(const NoiseReport&, const NoiseReport&) = default;
};

/// A snapshot of a job; see the message Job in proto/lightloom/v1/job_service.proto for units and meaning.
struct JobInfo {
    std::string job_id;
    JobState state = JobState::kPreparing;
    JobSpec spec;           ///< It has the catalog's first algorithm where the client does not know the job's.
    std::string algorithm;  ///< Name of the job's algorithm, also where it is unknown here.
    std::string message;
    uint64_t revision = 0;
    uint64_t unit_total = 0, unit_done = 0, unit_leased = 0;
    uint64_t samples_per_pixel_done = 0;
    double render_seconds = 0;
    double eta_seconds = -1;
    uint64_t dropped_samples = 0;
    uint64_t camera_samples = 0, light_paths = 0, rays = 0;
    uint32_t worker_count = 0;
    Digest image_digest;
    uint64_t image_size_bytes = 0;
    uint64_t duplicates_same = 0, duplicates_different = 0;
    double prepare_seconds = 0, finish_seconds = 0;
    PreparePhase phase = PreparePhase::kReadingScene;  ///< Valid in kPreparing.
    uint64_t phase_done = 0, phase_total = 0;          ///< In training samples; thousandths of the work in kLearning.
    std::string waits_for;                             ///< The job that makes the tables, in kWaitingForTables.
    TablesInfo tables;
    RareLightReport rare_light;  ///< Set for a finished job.
    std::optional<NoiseReport> noise;
    JobLabel label;
    std::string scene;       ///< Path of the scene file in its file list.
    double age_seconds = 0;  ///< Time since the submission.
    bool reused = false;     ///< In the answer to a submission: it is an earlier job of the same spec.
};
/// Share of the image that is rendered, from 0 to 1: the share of its samples, of its time limit, or of the samples with which its
/// noise target will be reached, whichever is largest.
double rendered_share(const JobInfo& job);
/// Share of the samples of a job with a number of samples per pixel that lie in the units that have arrived (units differ in
/// length); 0 for any other job.
double sample_share(const JobInfo& job);
/// Share of the samples with which the job's noise target will be reached, as the present estimate promises; nothing where it
/// promises nothing.
std::optional<double> noise_share(const JobInfo& job);
/// Text for people, for example "waiting for the tables of job-0123".
std::string phase_text(const JobInfo& job);

enum class WorkerState { kBusy, kIdle, kResting, kGone, kRefused };
/// Lower-case word.
std::string_view to_string(WorkerState state);

/// A snapshot of a worker; see the message Worker.
struct WorkerStatus {
    std::string worker_id, host;
    uint64_t process_id = 0;
    uint32_t thread_count = 0;
    WorkerState state = WorkerState::kIdle;
    std::string note;
    std::optional<UnitReference> in_work;
    uint64_t units_merged = 0, units_held = 0;
    double samples_per_second = 0;
    double seconds_since_heard = 0;
};

/// Behind the word "unit", for people.
std::string unit_name(const UnitKey& key);

/// kPartial is the EXR of the complete groups, without first-hit layers.
enum class ImageKind { kFinal, kPreview, kPartial };
/// Of the manifest of an image: of a finished one, or also of one whose job ended early and kept its complete groups.
enum class ManifestKind { kFinal, kPartial };
/// Whether the answer to a submission may be an earlier job of the same spec.
enum class Reuse { kAnew, kAllowed };
/// What becomes of the complete groups of a job that is cancelled.
enum class OnCancel { kThrowAway, kKeep };

enum class PreviewFormat { kPng, kExr };
/// The image of a job as far as it is merged.
struct Preview {
    std::string bytes;
    uint64_t samples_per_pixel = 0;  ///< Samples that every pixel of it has.
};

/// A coordinator's interface to clients. Errors are those of JobService and AssetService.
class JobPort {
  public:
    virtual ~JobPort() = default;
    virtual Result<JobInfo> submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label,
                                       Reuse reuse = Reuse::kAnew) = 0;
    virtual Result<JobInfo> get_job(const std::string& job_id) = 0;
    virtual Result<std::vector<JobInfo>> list_jobs() = 0;
    /// Without those that are gone, or were refused, for longer; all of them for 0.
    virtual Result<std::vector<WorkerStatus>> list_workers(double gone_within_seconds) = 0;
    virtual Result<JobInfo> cancel_job(const std::string& job_id, OnCancel what = OnCancel::kThrowAway) = 0;
    virtual Result<JobInfo> finish_job(const std::string& job_id) = 0;
    /// Calls `on_change` with the present state and then on changes until a terminal state was passed; kCancelled soon after a
    /// stop request.
    virtual Status watch_job(const std::string& job_id, const std::function<void(const JobInfo&)>& on_change,
                             std::stop_token stop) = 0;
    virtual Result<std::string> image(const std::string& job_id, ImageKind kind) = 0;
    /// `exposure` in stops, of a PNG.
    virtual Result<Preview> preview(const std::string& job_id, PreviewFormat format, double exposure) = 0;
    virtual Result<std::string> manifest(const std::string& job_id, ManifestKind kind = ManifestKind::kFinal) = 0;
    virtual Result<std::vector<Digest>> find_missing(const std::vector<Digest>& digests) = 0;
    /// Sends the file `path`, resuming where an earlier attempt broke off; does nothing if the asset is already
    /// complete there.
    virtual Status upload(const Digest& digest, const std::filesystem::path& path) = 0;
    virtual Status upload_bytes(const Digest& digest, std::string_view bytes) = 0;
};

/// A coordinator's interface to workers. Errors are those of WorkerService and AssetService.
class WorkerPort {
  public:
    virtual ~WorkerPort() = default;
    virtual Result<WorkerGrant> register_worker(const WorkerHello& hello) = 0;
    /// Returns at most one unit; none after `wait_seconds` without work, or soon after a stop request.
    virtual Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds, std::stop_token stop) = 0;
    /// Returns the units whose results are not wanted any more.
    virtual Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) = 0;
    virtual Result<SubmitAck> submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                            double render_seconds) = 0;
    /// Submits the serialized training data of a unit of any kind but kRender.
    virtual Result<SubmitAck> submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                              double trace_seconds) = 0;
    virtual Status release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) = 0;
    virtual Status goodbye(const std::string& worker_id) = 0;
    /// Streams the asset from `offset` to its end into `sink`; stops with the sink's error.
    virtual Status read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) = 0;
    /// Waits until there is a connection, `seconds` at most; whether there is one. What is reached without a connection always is.
    virtual bool wait_connected(double seconds) {
        (void)seconds;
        return true;
    }
};

}  // namespace lightloom
