// The life of a job between acceptance and end: reading the scene, planning, finishing.

#include <spdlog/spdlog.h>

#include <ctime>
#include <new>

#include "common/film/atomic_file.h"
#include "common/transport/catalog.h"
#include "server/job_record.h"
#include "server/results.h"

namespace lightloom {
namespace {

/// How many groups may be open: what fits into the room for waiting partials, within reason.
uint32_t group_window(const FrameLayout& frame, bool splats, uint64_t waiting_bytes) {
    const uint64_t group_bytes = uint64_t(frame.crop.area()) * (splats ? 56 : 24);
    return uint32_t(std::clamp<uint64_t>(waiting_bytes / std::max<uint64_t>(group_bytes, 1), 4, 256));
}

std::string utc(std::time_t time) {
    std::tm parts{};
    gmtime_r(&time, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
    return text;
}

}  // namespace

void Coordinator::prepare(JobRecord& job, std::stop_token stop) {
    JobSpec spec;
    {
        const std::lock_guard lock(mutex_);
        spec = job.spec;
    }
    auto facts = options_.read_scene(assets_, spec, stop);
    const auto algorithm = find_algorithm(spec.algorithm);
    const auto parameters = parse_parameters(**algorithm, spec.parameters);

    const std::lock_guard lock(mutex_);
    if (job.state != JobState::kPreparing) return;
    job.prepared = options_.clock();
    if (!facts.ok()) return fail_job(job, facts.status());
    const FrameLayout& frame = facts->frame;
    if (frame.crop.empty() || frame.crop.area() > kMaxPartialPixels)
        return fail_job(job, invalid_argument("the crop window must hold between 1 and " + std::to_string(kMaxPartialPixels) +
                                              " pixels"));
    job.spec.frame = frame;
    job.spec.parameters = complete_parameters(**algorithm, *parameters);
    if (job.spec.max_depth < 0) job.spec.max_depth = facts->max_depth;
    job.exposure_scale = facts->exposure_scale;
    job.layers = std::move(facts->layers);
    const double light_paths = light_paths_per_pixel(**algorithm, *parameters);
    const uint32_t window = group_window(frame, light_paths > 0, options_.waiting_bytes);
    job.units.emplace(Plan(frame, light_paths), job.spec.samples_per_pixel, window, options_.shuffle_seed);
    try {
        job.reducer = std::make_shared<Reducer>(frame, job.units->tile_count());
    } catch (const std::bad_alloc&) {  // one job too large must not end the coordinator and all others
        return fail_job(job, {StatusCode::kResourceExhausted, "the coordinator has no memory for the sums of a frame this large"});
    }
    job.state = JobState::kRunning;
    spdlog::info("{}: {}x{}, {} tile(s), {} unit(s)", job.id, frame.crop.width(), frame.crop.height(),
                 job.units->tile_count(), job.units->unit_total());
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
    job.finish_task = std::jthread([this, &job] { finish(job); });
}

void Coordinator::finish(JobRecord& job) {
    std::shared_ptr<Reducer> reducer;
    JobSpec spec;
    float scale = 1;
    std::vector<ImageLayer> layers;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kFinishing) return;
        reducer = job.reducer;
        layers = std::move(job.layers);
        spec = job.spec;
        scale = job.exposure_scale;
    }
    reducer->freeze();
    const auto image = encode_image(spec, *reducer, scale, std::move(layers));
    if (!image.ok()) {
        const std::lock_guard lock(mutex_);
        return fail_job(job, image.status());
    }
    const Digest digest = sha256(*image);

    Manifest manifest;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kFinishing) return;  // cancelled meanwhile
        job.image_digest = digest;
        job.image_size = image->size();
        job.merged_groups = reducer->folded_groups();
        job.merged_iterations = reducer->iterations();
        manifest.job = snapshot(job);
        manifest.identity = options_.identity;
        manifest.created_at = job.created_at;
        manifest.finished_at = utc(std::time(nullptr));
        manifest.groups = job.merged_groups;
        manifest.iterations = job.merged_iterations;
        manifest.units = job.units->merged(job.merged_groups);
        for (const uint32_t index : job.workers) {
            const WorkerRecord& w = *workers_[index];
            manifest.workers.push_back({index, w.id, w.hello.host, w.hello.process_id, w.hello.thread_count});
        }
        for (const JobRecord::Dropped& d : job.dropped_samples) manifest.dropped.push_back({d.unit, d.sample});
        manifest.expired_leases = job.expired_leases;
        manifest.rejected_results = job.rejected;
    }
    if (const auto text = assets_.read(spec.scene_root); text.ok()) {
        if (const auto list = AssetManifest::parse(*text); list.ok()) manifest.scene_main = list->main;
    }
    std::error_code error;
    std::filesystem::create_directories(job.directory, error);
    Status status = write_file_atomically((job.directory / "image.exr").string(), *image);
    if (status.ok()) status = write_file_atomically((job.directory / "manifest.json").string(), to_json(manifest));

    const std::lock_guard lock(mutex_);
    if (job.state != JobState::kFinishing) return;
    if (!status.ok()) return fail_job(job, status);
    job.reducer.reset();
    end_job(job, JobState::kSucceeded);
}

}  // namespace lightloom
