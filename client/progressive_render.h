#pragma once
// One rendering in this process that grows by full-frame groups, for measuring: its seconds are those of light transport,
// without import, scene build, merging, metrics or services. Its groups, units and sums are those of a job, so its image has
// the bytes that `lightloom render` writes for as many samples and training paths.

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "common/film/grouped_sum.h"
#include "common/transport/renderer.h"
#include "common/transport/training.h"
#include "common/work/job.h"

namespace lightloom::client {

/// An algorithm with all of its parameters, from one word of a command line: "bdpt:heuristic=power:rr-start=6".
struct AlgorithmChoice {
    AlgorithmSettings settings;
    std::string label;  ///< The word.
};

/// The words of a list with commas between them. A comma before a digit is none of these: it stands in a value
/// ("spcbpt:connections=5,2"), because no algorithm's name begins with a digit.
std::vector<std::string> split_algorithms(const std::string& list);
/// "NAME[:KEY=VALUE]...", checked against the catalog.
Result<AlgorithmChoice> parse_algorithm(const std::string& text);

/// What an algorithm computes before its first sample.
struct Preparation {
    Tables tables;  ///< Empty for algorithms that need none.
    double seconds = 0;
    std::string note;  ///< One line where the tables are simpler than asked; empty otherwise.
    /// They were made before, by whatever threads and processes there were: the seconds are those that were recorded then.
    bool cached = false;
};

/// Trains the tables of an algorithm that needs some, on the threads of the calling arena. kCancelled after a stop request.
Result<Preparation> prepare(const Scene& scene, const RenderSettings& settings, std::stop_token stop,
                            TrainingReport* report = nullptr);

class ProgressiveRender {
  public:
    /// Renderings may share the scene, and also a preparation: tables of longer paths serve shorter ones.
    static Result<ProgressiveRender> start(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                           const Preparation& preparation);
    /// `preparation_seconds` were spent on `renderer`; `plan` and `response` are those of a job on `frame`.
    ProgressiveRender(std::unique_ptr<const Renderer> renderer, const FrameLayout& frame, const Plan& plan,
                      const FilmResponse& response, double preparation_seconds);

    /// Renders the next group on the threads of the calling arena, cut short where it would go beyond `iteration_limit`; no
    /// group follows one that was cut. kCancelled after a stop request; then the rendering is as it was.
    Status advance(uint64_t iteration_limit = std::numeric_limits<uint64_t>::max(), std::stop_token stop = {});

    RgbImage image() const { return sums_.complete().develop(); }
    RgbImage variance() const { return sums_.complete().variance(); }
    /// The image's error as its groups show it; nothing before the second.
    std::optional<NoiseEstimate> noise() const { return sums_.complete().noise(); }
    /// The last group alone: with the other groups, independent images of the same mean.
    Result<RgbImage> last_group_image() const;
    uint32_t last_group_iterations() const { return last_iterations_; }

    uint64_t iterations() const { return sums_.complete().iterations(); }
    uint32_t groups() const { return sums_.complete().group_count(); }
    uint64_t dropped() const { return sums_.complete().dropped(); }
    const UnitCounters& counters() const { return sums_.counters(); }
    double seconds() const { return seconds_; }          ///< Wall-clock time of the units.
    double cpu_seconds() const { return cpu_seconds_; }  ///< The same in processor time of all threads of this process.
    double preparation_seconds() const { return preparation_seconds_; }

  private:
    std::unique_ptr<const Renderer> renderer_;
    FrameLayout frame_;
    Plan plan_;
    FilmResponse response_;
    double preparation_seconds_, seconds_ = 0, cpu_seconds_ = 0;
    GroupedSum sums_;
    GroupSum last_;
    uint32_t last_iterations_ = 0;
    bool cut_short_ = false;
};

}  // namespace lightloom::client
