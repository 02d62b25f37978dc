#pragma once
// One run of a benchmark: a rendering with its error curve, whose lines go to the results file.

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "client/bench/run_lines.h"

namespace lightloom::client {

class MeasuredRun {
  public:
    MeasuredRun(BenchRun run, std::unique_ptr<MeasuredRender> render, const Reference& reference)
        : run_(std::move(run)),
          render_(std::move(render)),
          reference_(reference) {}

    using Append = std::function<Status(const Json&)>;
    using SuiteSeconds = std::function<double()>;
    /// Renders until the rendering has had `seconds` in all or the run has ended by its own bounds, `cap` (in seconds with
    /// preparation) or a stop of the suite (`out_of_time`); at least one group. A checkpoint line for each point of the curve.
    struct Turn {
        double seconds = 0, cap = 0;
        const Append& append;
        const SuiteSeconds& suite_seconds;
        const std::function<bool()>& out_of_time;
        std::stop_token stop;
    };
    Status advance(const Turn& turn);
    bool ended() const { return ended_; }
    /// Whether the suite ended it, and not its own bounds.
    bool was_cut() const { return cut_; }

    const BenchRun& run() const { return run_; }
    RenderCost cost() const { return render_->cost(); }
    RgbImage image() const { return render_->image(); }
    /// Its last line. `image_file`: where its image was put; empty: nowhere.
    Json last_line(const std::string& image_file) const;

  private:
    bool within_bounds() const;
    bool may_stop() const;
    Status checkpoint(const Turn& turn);

    BenchRun run_;
    std::unique_ptr<MeasuredRender> render_;
    const Reference& reference_;
    std::vector<CurvePoint> curve_;
    Json last_checkpoint_;
    double next_ = 1;  ///< Iterations at which the next checkpoint is due.
    bool ended_ = false, cut_ = false;
};

}  // namespace lightloom::client
