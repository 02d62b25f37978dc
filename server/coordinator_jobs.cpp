// The life of a job between acceptance and end: reading the scene, planning, finishing.

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <system_error>

#include "common/cli/log_line.h"
#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "server/coordinator.h"
#include "server/job_record.h"
#include "server/results.h"

namespace lightloom {
namespace {

constexpr uint64_t kMaxWindow = 256;

/// How many groups of a job may be open at a time: the one that is completed next, and those later ones whose sums fit into
/// `waiting_bytes`.
uint32_t open_groups(const JobSpec& spec, uint64_t waiting_bytes) {
    const uint64_t area = uint64_t(spec.frame.crop.area());
    const bool splats = spec.algorithm.light_paths_per_iteration(spec.frame.crop.area()) > 0;
    return uint32_t(std::min(1 + waiting_bytes / (Reducer::open_group_bytes(splats) * area), kMaxWindow));
}

}  // namespace

bool Coordinator::start_task(JobRecord& job, std::jthread* thread, const char* purpose,
                             std::function<Status(std::stop_token)> task) {
    ++job.running_tasks;
    try {
        *thread = std::jthread([this, &job, purpose, run = std::move(task)](std::stop_token stop) {
            run_task(job, purpose, [&] { return run(stop); });
        });
        return true;
    } catch (const std::exception& e) {  // no thread, or no memory for one
        --job.running_tasks;
        fail_job(job, {StatusCode::kResourceExhausted,
                       std::string("the coordinator cannot start a thread ") + purpose + ": " + e.what()});
        return false;
    }
}

void Coordinator::run_task(JobRecord& job, const char* purpose, const std::function<Status()>& task) {
    const auto no_memory = [&] {
        return Status(StatusCode::kResourceExhausted, std::string("the coordinator has too little memory ") + purpose);
    };
    Status status;
    try {
        status = task();
    } catch (const std::bad_alloc&) {  // one job that is too large must not end the coordinator and all other jobs
        status = no_memory();
    } catch (const std::length_error&) {
        status = no_memory();
    }
    const std::lock_guard lock(mutex_);
    if (!status.ok() && !closing_) fail_job(job, status);
    --job.running_tasks;
}

Status Coordinator::prepare(JobRecord& job, std::stop_token stop) {
    JobSpec spec;
    {
        const std::lock_guard lock(mutex_);
        spec = job.spec;
    }
    auto facts = options_.read_scene(assets_, spec, stop);
    if (!facts.ok()) return facts.status();
    crash_point("server.scene-read");
    const Rect& crop = facts->frame.crop;
    if (crop.empty() || crop.area() > kMaxPartialPixels)
        return invalid_argument("the crop window must hold between 1 and " + std::to_string(kMaxPartialPixels) + " pixels");
    // This is checked before hours of rendering, because the system may hand out memory that it does not have and kill
    // the process that uses it.
    const int64_t memory =
        options_.memory_bytes > 0 ? options_.memory_bytes : int64_t(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGESIZE);
    if (memory > 0 && crop.area() > memory / kFrameBytesPerPixel)
        return Status(StatusCode::kResourceExhausted, "the frame has " + pixels_and_memory(crop.area()) +
                                                          "; the coordinator's host has " + std::to_string(memory / 1000000000) +
                                                          " GB, so lower the resolution or give a crop window");
    spec.frame = facts->frame;
    if (spec.max_depth < 0) spec.max_depth = facts->max_depth;
    if (spec.algorithm.learning()) return prepare_tables(job, std::move(spec), *std::move(facts), true);
    plan_units(job, std::move(spec), *std::move(facts), {});
    return {};
}

void Coordinator::plan_units(JobRecord& job, JobSpec spec, SceneFacts facts, TablesInfo tables) {
    const FrameLayout frame = facts.frame;
    const Plan plan(frame, spec.algorithm);
    std::optional<UnitTable> units;
    // A noise target alone may be out of reach.
    const uint64_t iterations = only_noise_bounds(spec) ? JobSpec::kMaxSamplesPerPixel : spec.samples_per_pixel;
    units.emplace(plan, iterations, open_groups(spec, options_.waiting_bytes), options_.shuffle_seed);
    auto reducer = std::make_shared<Reducer>(frame, plan.tile_count(), facts.response, spec.noise_target);

    const std::lock_guard lock(mutex_);
    if (job.state != JobState::kPreparing) return;
    job.prepared = options_.clock();
    job.stop_clock(job.prepared);
    job.spec = std::move(spec);
    job.layers = std::move(facts.layers);
    job.units = std::move(units);
    job.reducer = std::move(reducer);
    job.tables = std::move(tables);
    discard_training(job);
    job.state = JobState::kRunning;
    log_info("{}: {}x{}, {} tile(s), {} unit(s)", job.id, frame.crop.width(), frame.crop.height(), job.units->tile_count(),
             job.units->unit_total());
    crash_point("server.units-planned");
    changed(job);
    work_changed_.notify_all();
}

void Coordinator::finish_if_complete(JobRecord& job) {
    if (job.state != JobState::kRunning) return;
    const uint32_t merged = job.merged_groups;
    if (job.closed && merged == 0) job.units->limit_groups(1);  // an image needs at least one group
    const bool all = job.units->group_total() > 0 && merged == job.units->group_total();
    if (!all && !(job.closed && merged > 0)) return;
    job.state = JobState::kFinishing;
    job.finishing = options_.clock();
    job.units->close();
    changed(job);
    start_task(job, &job.finish_task, "to write the image of this job",
               [this, &job](std::stop_token) { return write_results(job); });
}

Status Coordinator::write_results(JobRecord& job) {
    std::shared_ptr<Reducer> reducer;
    JobSpec spec;
    std::vector<ImageLayer> layers;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kFinishing) return {};
        reducer = job.reducer;
        layers = std::move(job.layers);
        spec = job.spec;
    }
    reducer->freeze();
    auto developed = reducer->developed(true);
    if (!developed.ok()) return developed.status();
    const std::optional<NoiseReport> noise = reducer->final_noise();
    const RareLightReport rare_light_report = reducer->rare_light_report(mean_luminance(developed->color));
    const auto image = encode_image(spec, *std::move(developed), std::move(layers));
    if (!image.ok()) return image.status();
    const Digest digest = sha256(*image);

    Manifest manifest;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kFinishing) return {};  // it was cancelled meanwhile
        job.image_digest = digest;
        job.image_size = image->size();
        job.merged_groups = reducer->folded_groups();
        job.merged_iterations = reducer->iterations();
        // Results of groups that are not in the image do not count; what was summed just before freeze() does.
        job.units->advance(job.merged_groups);
        manifest.units = job.units->merged();
        for (const UnitTable::Merged& unit : manifest.units) job.workers.insert(unit.worker);
        job.counters = reducer->counters();
        job.dropped = reducer->dropped();
        job.rare_light_report = rare_light_report;
        job.noise = noise;
        manifest.job = job.info(options_.clock());
        manifest.identity = options_.identity;
        manifest.created_at = job.created_at;
        manifest.finished_at = utc_now();
        manifest.groups = job.merged_groups;
        manifest.iterations = job.merged_iterations;
        for (const uint32_t index : job.workers) {
            const WorkerRecord& w = workers_.at(index);
            manifest.workers.push_back({index, w.id, w.hello.host, w.hello.process_id, w.hello.thread_count});
        }
        manifest.dropped = reducer->first_dropped();
        manifest.expired_leases = job.expired_leases;
        manifest.rejected_results = job.rejected;
    }
    if (const auto text = assets_.read(spec.scene_root); text.ok()) {
        if (const auto list = AssetManifest::parse(*text); list.ok())
            manifest.scene_main = list->main, manifest.without = list->without;
    }
    std::error_code error;
    std::filesystem::create_directories(job.directory, error);
    crash_point("server.image-encoded");
    Status status = write_file_atomically((job.directory / "image.exr").string(), *image);
    crash_point("server.image-written");
    if (status.ok()) status = write_file_atomically((job.directory / "manifest.json").string(), to_json(manifest));
    LL_RETURN_IF_ERROR(status);
    crash_point("server.manifest-written");

    const std::lock_guard lock(mutex_);
    if (job.state == JobState::kFinishing) end_job(job, JobState::kSucceeded);
    return {};
}

}  // namespace lightloom
