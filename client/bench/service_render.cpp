#include "client/bench/service_render.h"

#include <chrono>
#include <thread>

#include "client/run_job.h"
#include "common/core/utf8.h"
#include "common/film/exr_io.h"

namespace lightloom::client {
namespace {

/// Between two looks at a job.
constexpr auto kPause = std::chrono::milliseconds(50);

}  // namespace

Result<std::unique_ptr<MeasuredRender>> ServiceRender::start(JobPort& port, const JobSpec& spec, const std::string& name,
                                                             std::stop_token stop) {
    auto submitted = submit(port, spec, {.name = std::string(clipped_utf8(name, JobLabel::kMaxBytes)), .owner = {}});
    if (!submitted.ok()) return submitted.status();
    std::unique_ptr<ServiceRender> render(new ServiceRender(port, *std::move(submitted)));
    for (; render->job_.state == JobState::kPreparing; std::this_thread::sleep_for(kPause)) {
        if (stop.stop_requested()) return Status(StatusCode::kCancelled, "interrupted");
        auto job = port.get_job(render->job_.job_id);
        if (!job.ok()) return job.status();
        render->job_ = *std::move(job);
    }
    return std::unique_ptr<MeasuredRender>(std::move(render));
}

ServiceRender::~ServiceRender() {
    if (!ended()) (void)port_.cancel_job(job_.job_id);  // nobody is left who could be told of a failure
}

Status ServiceRender::take(const std::string& exr, uint64_t iterations) {
    auto image = decode_exr(exr, job_.job_id);
    if (!image.ok()) return image.status();
    image_ = std::move(image->color);
    iterations_ = iterations;
    return {};
}

Status ServiceRender::advance(uint64_t /*iteration_limit*/, std::stop_token stop) {
    for (;; std::this_thread::sleep_for(kPause)) {
        if (stop.stop_requested()) return {StatusCode::kCancelled, "interrupted"};
        auto job = port_.get_job(job_.job_id);
        if (!job.ok()) return job.status();
        job_ = *std::move(job);
        if (job_.state == JobState::kSucceeded) {
            const auto exr = port_.image(job_.job_id, ImageKind::kFinal);
            return exr.ok() ? take(*exr, job_.samples_per_pixel_done) : exr.status();
        }
        if (ended())
            return {StatusCode::kAborted, job_.job_id + " has " + std::string(to_string(job_.state)) + ": " + job_.message};
        if (job_.samples_per_pixel_done <= iterations_) continue;
        const auto preview = port_.preview(job_.job_id, PreviewFormat::kExr, 0);
        // The job may have ended meanwhile, which the next round sees.
        if (preview.status().code() == StatusCode::kFailedPrecondition) continue;
        if (!preview.ok()) return preview.status();
        if (preview->samples_per_pixel <= iterations_) continue;
        if (auto now = port_.get_job(job_.job_id); now.ok()) job_ = *std::move(now);
        if (!ended()) return take(preview->bytes, preview->samples_per_pixel);
    }
}

RenderCost ServiceRender::cost() const {
    RenderCost cost;
    cost.iterations = iterations_;
    cost.seconds = job_.render_seconds;
    cost.preparation_seconds = job_.prepare_seconds;
    cost.camera_samples = job_.camera_samples;
    cost.light_paths = job_.light_paths;
    cost.rays = job_.rays;
    cost.dropped = job_.dropped_samples;
    return cost;
}

std::optional<NoiseEstimate> ServiceRender::noise() const {
    return job_.noise ? std::optional(job_.noise->estimate) : std::nullopt;
}

std::optional<RareLightReport> ServiceRender::rare_light(double /*image_mean*/) const {
    if (job_.rare_light == RareLightReport{}) return std::nullopt;
    return job_.rare_light;
}

}  // namespace lightloom::client
