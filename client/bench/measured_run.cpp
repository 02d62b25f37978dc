#include "client/bench/measured_run.h"

namespace lightloom::client {

bool MeasuredRun::within_bounds() const {
    const RenderCost cost = render_->cost();
    if (render_->ended()) return false;
    const RunBudget& budget = run_.budget;
    return (budget.samples == 0 || cost.iterations < budget.samples) && (budget.seconds <= 0 || cost.together() < budget.seconds);
}

bool MeasuredRun::may_stop() const {
    return run_.stop_after >= 0 && render_->cost().together() >= run_.stop_after && !curve_.empty() &&
           curve_.back().error <= run_.threshold;
}

Status MeasuredRun::checkpoint(const Turn& turn) {
    const auto metrics = compute_pixel_metrics(render_->image(), reference_.image.color);
    if (!metrics.ok()) return metrics.status();
    const RenderCost cost = render_->cost();
    curve_.push_back({double(cost.iterations), cost.seconds, metrics->mape});
    last_checkpoint_ = checkpoint_line(run_, *render_, *metrics, reference_, turn.suite_seconds());
    next_ = next_checkpoint(double(cost.iterations));
    return turn.append(last_checkpoint_);
}

Status MeasuredRun::advance(const Turn& turn) {
    const uint64_t limit = run_.budget.samples > 0 ? run_.budget.samples : std::numeric_limits<uint64_t>::max();
    while (!ended_ && render_->cost().seconds < turn.seconds) {
        LL_RETURN_IF_ERROR(render_->advance(limit, turn.stop));
        const RenderCost cost = render_->cost();
        const bool bound = !within_bounds();
        cut_ = !bound && (cost.together() >= turn.cap || turn.out_of_time());
        if (bound || cut_ || double(cost.iterations) >= next_) LL_RETURN_IF_ERROR(checkpoint(turn));
        ended_ = bound || cut_ || may_stop();
    }
    return {};
}

Json MeasuredRun::last_line(const std::string& image_file) const {
    const RgbImage image = render_->image();
    const std::vector<double> mean = luminance_means(image, 1, 1);
    std::optional<double> given;
    if (cut_) given = render_->cost().together();
    return run_line(last_checkpoint_, run_,
                    {image, reference_.image.color, curve_, image_file, given, render_->rare_light(mean.front())});
}

}  // namespace lightloom::client
