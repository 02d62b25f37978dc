#pragma once
// Renderer: scene + algorithm + settings -> partials of units. The one door between the service and light transport; one
// virtual call per unit is made behind it.

#include <functional>
#include <memory>
#include <stop_token>

#include "common/core/result.h"
#include "common/film/partial.h"
#include "common/path/mask.h"
#include "common/scene/scene.h"
#include "common/tables/tables.h"
#include "common/transport/contribution.h"
#include "common/transport/settings.h"
#include "common/transport/unit.h"

namespace lightloom {

/// What a row of the catalog makes a renderer from: checked, and complete.
struct RendererRequest {
    std::shared_ptr<const Scene> scene;
    const RenderSettings& settings;
    const Tables& tables;       ///< The parts that the row asks for.
    const TechniqueMask* mask;  ///< Null: all techniques.

    uint64_t light_paths_per_iteration() const { return settings.algorithm.light_paths_per_iteration(scene->frame().crop.area()); }
};

/// A contribution as it enters the image, for people and tests.
struct SeenContribution {
    const PathContribution& found;
    const PathView& view;
    double weight;       ///< The image gets found.value * weight.
    uint32_t pixel;      ///< Row-major in the crop, where it lands.
    uint64_t iteration;  ///< Of the camera sample; of a light path that no camera sample owns, the unit's first.
    bool labelled;       ///< Whether the view's subspace labels are filled in.
};

/// The weights of an algorithm on paths that somebody else has made, for tests: whatever made a path, all of its techniques must
/// agree about it.
class PathWeights {
  public:
    virtual ~PathWeights() = default;
    /// Labels and whatever else the algorithm adds to sub-paths and to the view of a complete path; see cached.h.
    virtual void label_light_path(const Scene& scene, PathVertex* y, int n) const = 0;
    virtual void label_camera_vertex(const Scene& scene, PathVertex* v) const = 0;
    virtual void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards,
                          PathView* view) const = 0;
    /// sigma and weight of a technique that can make the path; sigma 0: the algorithm has no such technique.
    virtual double sigma(const PathView& view, Technique t) const = 0;
    virtual double weight(const PathView& view, Technique own) const = 0;
};

class Renderer {
  public:
    virtual ~Renderer() = default;

    /// `scene` must already have the resolution and crop of the job (Scene::build options). `tables` must belong to this scene and
    /// these settings: kFailedPrecondition when they are missing or another algorithm's, kDataLoss when they do not fit the scene.
    /// `mask` leaves techniques out.
    static Result<std::unique_ptr<Renderer>> create(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                    const Tables& tables = {}, const TechniqueMask* mask = nullptr);

    /// Renders one unit on the calling thread's TBB arena; the result does not depend on how many threads that has.
    /// kInvalidArgument for a unit of a shape that the algorithm does not have. A stop request makes it return kCancelled soon.
    virtual Result<Partial> render(const RenderUnit& work, std::stop_token stop) const = 0;

    /// The same on one thread, calling `see` for every contribution in a fixed order. An algorithm that does its own loops shows
    /// none.
    virtual Result<Partial> watch(const RenderUnit& work, const std::function<void(const SeenContribution&)>& see,
                                  std::stop_token stop) const = 0;

    /// Of the job as a whole; see estimate_rare_light().
    virtual RareLight rare_light(std::stop_token stop) const = 0;

    /// Null for an algorithm whose weights cannot be asked about single paths (its own loops, weights of the unit's own).
    virtual std::unique_ptr<PathWeights> weights() const = 0;
};

}  // namespace lightloom
