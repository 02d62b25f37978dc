#include "common/work/wire.h"

#include <cmath>

#include "common/core/utf8.h"
#include "common/work/wire_parts.h"

namespace lightloom::wire {
namespace {

// Enumerations cross the wire by casts. If one side has another value or another order, this must not compile.
template <typename Ours, typename Theirs>
constexpr bool one_below(Ours ours, Theirs theirs) {
    return int(ours) + 1 == int(theirs);
}
static_assert(one_below(UnitKind::kRender, v1::UNIT_KIND_RENDER) && one_below(UnitKind::kTraining, v1::UNIT_KIND_TRAINING) &&
              one_below(UnitKind::kProbe, v1::UNIT_KIND_PROBE) && one_below(UnitKind::kProbe, v1::UnitKind_MAX));
static_assert(one_below(JobState::kPreparing, v1::JOB_STATE_PREPARING) && one_below(JobState::kRunning, v1::JOB_STATE_RUNNING) &&
              one_below(JobState::kFinishing, v1::JOB_STATE_FINISHING) &&
              one_below(JobState::kSucceeded, v1::JOB_STATE_SUCCEEDED) && one_below(JobState::kFailed, v1::JOB_STATE_FAILED) &&
              one_below(JobState::kCancelled, v1::JOB_STATE_CANCELLED) && one_below(JobState::kCancelled, v1::JobState_MAX));
static_assert(one_below(PreparePhase::kReadingScene, v1::PREPARE_PHASE_READING_SCENE) &&
              one_below(PreparePhase::kProbing, v1::PREPARE_PHASE_PROBING) &&
              one_below(PreparePhase::kTracing, v1::PREPARE_PHASE_TRACING) &&
              one_below(PreparePhase::kLearning, v1::PREPARE_PHASE_LEARNING) &&
              one_below(PreparePhase::kWaitingForTables, v1::PREPARE_PHASE_WAITING_FOR_TABLES) &&
              one_below(PreparePhase::kWaitingForTables, v1::PreparePhase_MAX));
static_assert(one_below(WorkerState::kBusy, v1::WORKER_STATE_BUSY) && one_below(WorkerState::kIdle, v1::WORKER_STATE_IDLE) &&
              one_below(WorkerState::kResting, v1::WORKER_STATE_RESTING) && one_below(WorkerState::kGone, v1::WORKER_STATE_GONE) &&
              one_below(WorkerState::kRefused, v1::WORKER_STATE_REFUSED) && one_below(WorkerState::kRefused, v1::WorkerState_MAX));
static_assert(one_below(SubmitOutcome::kAccepted, v1::SUBMIT_OUTCOME_ACCEPTED) &&
              one_below(SubmitOutcome::kDuplicateSame, v1::SUBMIT_OUTCOME_DUPLICATE_SAME) &&
              one_below(SubmitOutcome::kDuplicateDifferent, v1::SUBMIT_OUTCOME_DUPLICATE_DIFFERENT) &&
              one_below(SubmitOutcome::kStale, v1::SUBMIT_OUTCOME_STALE) &&
              one_below(SubmitOutcome::kRejected, v1::SUBMIT_OUTCOME_REJECTED) &&
              one_below(SubmitOutcome::kRejected, v1::SubmitOutcome_MAX));

constexpr bool equal(StatusCode ours, grpc::StatusCode theirs) { return int(ours) == int(theirs); }
static_assert(equal(StatusCode::kOk, grpc::OK) && equal(StatusCode::kCancelled, grpc::CANCELLED) &&
              equal(StatusCode::kUnknown, grpc::UNKNOWN) && equal(StatusCode::kInvalidArgument, grpc::INVALID_ARGUMENT) &&
              equal(StatusCode::kDeadlineExceeded, grpc::DEADLINE_EXCEEDED) && equal(StatusCode::kNotFound, grpc::NOT_FOUND) &&
              equal(StatusCode::kAlreadyExists, grpc::ALREADY_EXISTS) &&
              equal(StatusCode::kPermissionDenied, grpc::PERMISSION_DENIED) &&
              equal(StatusCode::kResourceExhausted, grpc::RESOURCE_EXHAUSTED) &&
              equal(StatusCode::kFailedPrecondition, grpc::FAILED_PRECONDITION) && equal(StatusCode::kAborted, grpc::ABORTED) &&
              equal(StatusCode::kOutOfRange, grpc::OUT_OF_RANGE) && equal(StatusCode::kUnimplemented, grpc::UNIMPLEMENTED) &&
              equal(StatusCode::kInternal, grpc::INTERNAL) && equal(StatusCode::kUnavailable, grpc::UNAVAILABLE) &&
              equal(StatusCode::kDataLoss, grpc::DATA_LOSS));

void put_tables(const TablesInfo& in, v1::TablesSummary* out) {
    put_asset(in.asset, out->mutable_asset());
    out->set_light_subspace_count(in.light_subspaces);
    out->set_eye_subspace_count(in.eye_subspaces);
    out->set_training_sample_count(in.training_samples);
    out->set_capped_by_time_limit(in.capped_by_time_limit);
    out->set_from_cache(in.from_cache);
    out->set_trace_seconds(in.trace_seconds);
    out->set_classifier_seconds(in.classifier_seconds);
    out->set_energy_seconds(in.energy_seconds);
    out->set_gamma_seconds(in.gamma_seconds);
    out->set_uniform_loss(in.uniform_loss);
    out->set_loss(in.loss);
    out->set_prior_strength(in.prior_strength);
    out->set_note(clipped_utf8(in.note, kMaxMessageBytes));
    put(in.cache_key, out->mutable_cache_key());
}

Result<TablesInfo> get_tables(const v1::TablesSummary& in) {
    const auto asset = get_asset(in.asset());
    if (!asset.ok()) return asset.status();
    const auto key = get(in.cache_key());
    if (!key.ok()) return key.status();
    return TablesInfo{.asset = *asset,
                      .light_subspaces = in.light_subspace_count(),
                      .eye_subspaces = in.eye_subspace_count(),
                      .training_samples = in.training_sample_count(),
                      .capped_by_time_limit = in.capped_by_time_limit(),
                      .from_cache = in.from_cache(),
                      .trace_seconds = in.trace_seconds(),
                      .classifier_seconds = in.classifier_seconds(),
                      .energy_seconds = in.energy_seconds(),
                      .gamma_seconds = in.gamma_seconds(),
                      .uniform_loss = in.uniform_loss(),
                      .loss = in.loss(),
                      .prior_strength = in.prior_strength(),
                      .note = in.note(),
                      .cache_key = *key};
}

}  // namespace

grpc::Status to_grpc(const Status& status) {
    if (status.ok()) return grpc::Status::OK;
    return {grpc::StatusCode(int(status.code())), status.message()};
}

Status from_grpc(const grpc::Status& status) {
    if (status.ok()) return {};
    return {StatusCode(int(status.error_code())), status.error_message()};
}

void put(const Digest& in, v1::Digest* out) { out->set_sha256(in.bytes.data(), in.bytes.size()); }

Result<Digest> get(const v1::Digest& in) {
    Digest digest;
    if (in.sha256().size() != digest.bytes.size())
        return invalid_argument("a digest has " + std::to_string(in.sha256().size()) + " bytes instead of 32");
    std::copy(in.sha256().begin(), in.sha256().end(), digest.bytes.begin());
    return digest;
}

void put(const JobSpec& in, v1::JobSpec* out) {
    out->set_algorithm(in.algorithm.name());
    for (const auto& [key, value] : in.algorithm.chosen_text()) (*out->mutable_parameters())[key] = value;
    out->set_seed(in.seed);
    out->set_samples_per_pixel(in.samples_per_pixel);
    out->set_time_limit_seconds(in.time_limit_seconds);
    out->set_noise_target(in.noise_target);
    out->set_max_depth(in.max_depth);
    out->set_width(in.width);
    out->set_height(in.height);
    if (in.crop != Rect{}) put_rect(in.crop, out->mutable_crop());
    put(in.scene_root, out->mutable_scene_root());
    out->mutable_frame()->set_width(in.frame.width);
    out->mutable_frame()->set_height(in.frame.height);
    put_rect(in.frame.crop, out->mutable_frame()->mutable_crop());
    out->set_first_hit_layers(in.first_hit_layers);
}

namespace {

/// Reads all fields but the algorithm.
Result<JobSpec> get_rest(const v1::JobSpec& in) {
    JobSpec spec;
    spec.seed = in.seed();
    spec.samples_per_pixel = in.samples_per_pixel();
    spec.time_limit_seconds = in.time_limit_seconds();
    if (!std::isfinite(spec.time_limit_seconds)) return invalid_argument("time_limit_seconds is not a finite number");
    spec.noise_target = in.noise_target();
    if (!std::isfinite(spec.noise_target)) return invalid_argument("noise_target is not a finite number");
    spec.max_depth = in.max_depth();
    spec.width = in.width();
    spec.height = in.height();
    spec.crop = get_rect(in.crop());
    auto root = get(in.scene_root());
    if (!root.ok()) return root.status();
    spec.scene_root = *root;
    spec.frame = {in.frame().width(), in.frame().height(), get_rect(in.frame().crop())};
    spec.first_hit_layers = in.first_hit_layers();
    return spec;
}

}  // namespace

Result<JobSpec> get(const v1::JobSpec& in) {
    auto algorithm = AlgorithmSettings::parse(in.algorithm(), {in.parameters().begin(), in.parameters().end()});
    if (!algorithm.ok()) return algorithm.status();
    auto spec = get_rest(in);
    if (spec.ok()) spec->algorithm = *std::move(algorithm);
    return spec;
}

void put(const JobInfo& in, v1::Job* out) {
    out->set_job_id(in.job_id);
    out->set_state(v1::JobState(int(in.state) + 1));
    put(in.spec, out->mutable_spec());
    out->set_message(clipped_utf8(in.message, kMaxMessageBytes));
    out->set_revision(in.revision);
    out->set_unit_total_count(in.unit_total);
    out->set_unit_done_count(in.unit_done);
    out->set_unit_leased_count(in.unit_leased);
    out->set_samples_per_pixel_done(in.samples_per_pixel_done);
    out->set_render_seconds(in.render_seconds);
    out->set_eta_seconds(in.eta_seconds);
    out->set_dropped_sample_count(in.dropped_samples);
    out->set_camera_sample_count(in.camera_samples);
    out->set_light_path_count(in.light_paths);
    out->set_ray_count(in.rays);
    out->set_worker_count(in.worker_count);
    if (in.state == JobState::kSucceeded || in.image_size_bytes > 0) put(in.image_digest, out->mutable_image_digest());
    out->set_image_size_bytes(in.image_size_bytes);
    out->set_duplicate_same_count(in.duplicates_same);
    out->set_duplicate_different_count(in.duplicates_different);
    out->set_prepare_seconds(in.prepare_seconds);
    out->set_finish_seconds(in.finish_seconds);
    if (in.state == JobState::kPreparing) out->set_phase(v1::PreparePhase(int(in.phase) + 1));
    out->set_phase_done_count(in.phase_done);
    out->set_phase_total_count(in.phase_total);
    out->set_waits_for(in.waits_for);
    if (in.tables.asset.size_bytes > 0) put_tables(in.tables, out->mutable_tables());
    if (in.rare_light != RareLightReport{}) {
        v1::RareLightSummary* rare = out->mutable_rare_light();
        rare->set_share(in.rare_light.share);
        rare->set_unreachable_share(in.rare_light.unreachable_share);
        rare->set_expected_hit_count(in.rare_light.expected_hits);
        rare->set_mean_error(in.rare_light.mean_error);
    }
    if (in.noise) {
        v1::NoiseSummary* noise = out->mutable_noise();
        noise->set_relmse(in.noise->estimate.relmse);
        noise->set_standard_error(in.noise->estimate.error);
        noise->set_group_count(in.noise->estimate.groups);
        noise->set_samples_per_pixel(in.noise->estimate.iterations);
        noise->set_target_reached(in.noise->reached);
        noise->set_light_missing(in.noise->light_missing);
    }
    put(in.label, out->mutable_label());
    out->set_scene(clipped_utf8(in.scene, kMaxMessageBytes));
    out->set_age_seconds(in.age_seconds);
    out->set_reused(in.reused);
}

void put(const JobLabel& in, v1::JobLabel* out) {
    out->set_name(clipped_utf8(in.name, JobLabel::kMaxBytes));
    out->set_owner(clipped_utf8(in.owner, JobLabel::kMaxBytes));
}

JobLabel get(const v1::JobLabel& in) { return {in.name(), in.owner()}; }

Result<JobInfo> get(const v1::Job& in) {
    JobInfo info;
    info.job_id = in.job_id();
    if (in.state() < v1::JOB_STATE_PREPARING || in.state() > v1::JOB_STATE_CANCELLED)
        return invalid_argument("job " + in.job_id() + " has an unknown state; is the coordinator newer than this client?");
    info.state = JobState(int(in.state()) - 1);
    // A coordinator may know algorithms and parameters that this client does not; its jobs are shown all the same.
    auto spec = get(in.spec());
    if (!spec.ok()) spec = get_rest(in.spec());
    if (!spec.ok()) return spec.status();
    info.spec = *std::move(spec);
    info.algorithm = in.spec().algorithm();
    info.message = in.message();
    info.revision = in.revision();
    info.unit_total = in.unit_total_count();
    info.unit_done = in.unit_done_count();
    info.unit_leased = in.unit_leased_count();
    info.samples_per_pixel_done = in.samples_per_pixel_done();
    info.render_seconds = in.render_seconds();
    info.eta_seconds = in.eta_seconds();
    info.dropped_samples = in.dropped_sample_count();
    info.camera_samples = in.camera_sample_count();
    info.light_paths = in.light_path_count();
    info.rays = in.ray_count();
    info.rare_light = {.share = in.rare_light().share(),
                       .unreachable_share = in.rare_light().unreachable_share(),
                       .expected_hits = in.rare_light().expected_hit_count(),
                       .mean_error = in.rare_light().mean_error()};
    if (in.has_noise()) {
        const v1::NoiseSummary& noise = in.noise();
        info.noise = NoiseReport{{noise.relmse(), noise.standard_error(), noise.group_count(), noise.samples_per_pixel()},
                                 noise.target_reached(),
                                 noise.light_missing()};
    }
    info.worker_count = in.worker_count();
    if (info.state == JobState::kSucceeded || in.has_image_digest()) {
        auto digest = get(in.image_digest());
        if (!digest.ok()) return digest.status();
        info.image_digest = *digest;
    }
    info.image_size_bytes = in.image_size_bytes();
    info.duplicates_same = in.duplicate_same_count();
    info.duplicates_different = in.duplicate_different_count();
    info.prepare_seconds = in.prepare_seconds();
    info.finish_seconds = in.finish_seconds();
    if (in.phase() >= v1::PREPARE_PHASE_READING_SCENE && in.phase() <= v1::PREPARE_PHASE_WAITING_FOR_TABLES)
        info.phase = PreparePhase(int(in.phase()) - 1);
    info.phase_done = in.phase_done_count();
    info.phase_total = in.phase_total_count();
    info.waits_for = in.waits_for();
    if (in.has_tables()) {
        auto tables = get_tables(in.tables());
        if (!tables.ok()) return tables.status();
        info.tables = *std::move(tables);
    }
    info.label = get(in.label());
    info.scene = in.scene();
    info.age_seconds = in.age_seconds();
    info.reused = in.reused();
    return info;
}

void put(const WorkerStatus& in, v1::Worker* out) {
    out->set_worker_id(in.worker_id);
    out->set_host(in.host);
    out->set_process_id(in.process_id);
    out->set_thread_count(in.thread_count);
    out->set_state(v1::WorkerState(int(in.state) + 1));
    out->set_note(clipped_utf8(in.note, kMaxMessageBytes));
    if (in.in_work) {
        put_key(in.in_work->key, out->mutable_unit());
        out->set_job_id(in.in_work->job_id);
    }
    out->set_unit_held_count(in.units_held);
    out->set_unit_merged_count(in.units_merged);
    out->set_samples_per_second(in.samples_per_second);
    out->set_silent_seconds(in.seconds_since_heard);
}

Result<WorkerStatus> get(const v1::Worker& in) {
    WorkerStatus out{.worker_id = in.worker_id(),
                     .host = in.host(),
                     .process_id = in.process_id(),
                     .thread_count = in.thread_count(),
                     .note = in.note(),
                     .units_merged = in.unit_merged_count(),
                     .units_held = in.unit_held_count(),
                     .samples_per_second = in.samples_per_second(),
                     .seconds_since_heard = in.silent_seconds()};
    if (in.state() < v1::WORKER_STATE_BUSY || in.state() > v1::WORKER_STATE_REFUSED)
        return invalid_argument("worker " + in.worker_id() + " has an unknown state; is the coordinator newer than this client?");
    out.state = WorkerState(int(in.state()) - 1);
    if (!in.has_unit()) return out;
    const auto key = get_key(in.unit());
    if (!key.ok()) return key.status();
    out.in_work = UnitReference{in.job_id(), *key};
    return out;
}

}  // namespace lightloom::wire
