#pragma once
// A rendering that a benchmark watches on a service: a job like anybody's, looked at through its previews.

#include <memory>
#include <string>

#include "client/bench/measured_render.h"
#include "common/work/service.h"

namespace lightloom::client {

/// Its seconds are those of the service, from the first unit to the last; at a checkpoint before the end they are up to a preview's
/// transfer late.
class ServiceRender final : public MeasuredRender {
  public:
    /// Submits the job, whose scene the service has, and waits until it renders; after a stop request it is cancelled. It bounds
    /// itself: `spec` has samples or a time.
    static Result<std::unique_ptr<MeasuredRender>> start(JobPort& port, const JobSpec& spec, const std::string& name,
                                                         std::stop_token stop);
    /// Cancels a job that has not ended.
    ~ServiceRender() override;
    Status advance(uint64_t iteration_limit, std::stop_token stop) override;
    bool ended() const override { return is_terminal(job_.state); }
    RenderCost cost() const override;
    RgbImage image() const override { return image_; }
    std::optional<NoiseEstimate> noise() const override;
    std::optional<RareLightReport> rare_light(double image_mean) const override;

  private:
    ServiceRender(JobPort& port, JobInfo job) : port_(port), job_(std::move(job)) {}
    Status take(const std::string& exr, uint64_t iterations);

    JobPort& port_;
    JobInfo job_;
    RgbImage image_;
    uint64_t iterations_ = 0;
};

}  // namespace lightloom::client
