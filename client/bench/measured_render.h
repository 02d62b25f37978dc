#pragma once
// A rendering that a benchmark watches while it grows: in this process, or as a job of a service.

#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "client/progressive_render.h"
#include "common/film/rare_light.h"

namespace lightloom::client {

/// What a rendering has cost so far. What is not known is absent.
struct RenderCost {
    uint64_t iterations = 0;
    double seconds = 0;              ///< Of rendering.
    double preparation_seconds = 0;  ///< Of learning and the like before it.
    std::optional<uint32_t> groups;
    std::optional<double> cpu_seconds;
    std::optional<uint64_t> vertices, connections;
    std::string tables;  ///< "made", "shared" or "cached"; empty where there are none, or nobody knows.
    uint64_t camera_samples = 0, light_paths = 0, rays = 0, dropped = 0;

    double together() const { return seconds + preparation_seconds; }
};

class MeasuredRender {
  public:
    virtual ~MeasuredRender() = default;
    /// Goes on until there are more iterations than before, at most `iteration_limit` of them. kCancelled after a stop request.
    virtual Status advance(uint64_t iteration_limit, std::stop_token stop) = 0;
    /// Whether it cannot go on, because its own bound is reached.
    virtual bool ended() const = 0;
    virtual RenderCost cost() const = 0;
    /// Of all iterations so far.
    virtual RgbImage image() const = 0;
    /// What its own groups say of that image's error; nothing where they are too few. Takes a pass over the image.
    virtual std::optional<NoiseEstimate> noise() const = 0;
    /// Of that image; nothing where no light depends on chance or nothing is known.
    virtual std::optional<RareLightReport> rare_light(double image_mean) const = 0;
};

/// One in this process. `tables`: RenderCost::tables; `rare`: RareLight of its scene and settings; `exposure`: pixel value of a
/// unit of luminance.
class LocalRender final : public MeasuredRender {
  public:
    LocalRender(ProgressiveRender render, std::string tables, const RareLight& rare, double exposure)
        : render_(std::move(render)),
          tables_(std::move(tables)),
          rare_(rare),
          exposure_(exposure) {}
    Status advance(uint64_t iteration_limit, std::stop_token stop) override { return render_.advance(iteration_limit, stop); }
    bool ended() const override { return false; }
    RenderCost cost() const override;
    RgbImage image() const override { return render_.image(); }
    std::optional<NoiseEstimate> noise() const override { return render_.noise(); }
    std::optional<RareLightReport> rare_light(double image_mean) const override;

  private:
    ProgressiveRender render_;
    std::string tables_;
    RareLight rare_;
    double exposure_;
};

}  // namespace lightloom::client
