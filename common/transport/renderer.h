#pragma once
// Renderer makes the partials of units from a scene, an algorithm and settings. The service reaches light transport
// through this interface only, with one virtual call per unit.

#include <functional>
#include <memory>
#include <stop_token>

#include "common/core/result.h"
#include "common/film/partial.h"
#include "common/path/mask.h"
#include "common/scene/scene.h"
#include "common/tables/gain_table.h"
#include "common/tables/tables.h"
#include "common/transport/contribution.h"
#include "common/transport/settings.h"
#include "common/transport/unit.h"

namespace lightloom {

/// The scene with light sub-paths that leave the lights as the tables have learned; the scene itself where they have no
/// such part.
std::shared_ptr<const Scene> lit_scene(std::shared_ptr<const Scene> scene, const Tables& tables);

/// The input from which a row of the catalog makes a renderer; it is checked and complete.
struct RendererRequest {
    std::shared_ptr<const Scene> scene;  ///< With the emission of the tables.
    const RenderSettings& settings;
    const Tables& tables;                   ///< The parts that the row asks for.
    const TechniqueMask* mask;              ///< Null: all techniques.
    std::shared_ptr<const GainTable> gain;  ///< Of the tables; null where they have none.

    uint64_t light_paths_per_iteration() const { return settings.algorithm.light_paths_per_iteration(scene->frame().crop.area()); }
};

/// A contribution as it enters the image, for reports and tests.
struct SeenContribution {
    const PathContribution& found;
    const PathView& view;
    double weight;       ///< The image gets found.value * weight.
    uint32_t pixel;      ///< Where it lands, row-major in the crop.
    uint64_t iteration;  ///< That of the camera sample; the batch's first for a light path that no camera sample owns.
    bool labelled;       ///< Whether the view's subspace labels are filled in.
};

/// An algorithm's weights of paths that were made elsewhere, for tests: whichever technique made a path, all of its
/// techniques must agree about its weights.
class PathWeights {
  public:
    virtual ~PathWeights() = default;
    /// Adds labels, and whatever else the algorithm needs, to sub-paths and to the view of a complete path; see
    /// cached.h.
    virtual void label_light_path(const Scene& scene, PathVertex* y, int n) const = 0;
    virtual void label_camera_vertex(const Scene& scene, PathVertex* v) const = 0;
    virtual void complete(const Scene& scene, const LightSubPath& y, int s, PathVertex* z, int t, const Vec3& towards,
                          PathView* view) const = 0;
    /// sigma and weight of a technique that can make the path; sigma is 0 if the algorithm has no such technique.
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

    /// Renders one unit on the calling thread's TBB arena; the result does not depend on the number of threads.
    /// kInvalidArgument for a unit of a shape that the algorithm does not have. A stop request makes it return
    /// kCancelled soon.
    virtual Result<Partial> render(const RenderUnit& work, std::stop_token stop) const = 0;

    /// Does the same on one thread and calls `see` for every contribution in a fixed order. The contributions of an
    /// algorithm that does its own loops are not shown.
    virtual Result<Partial> watch(const RenderUnit& work, const std::function<void(const SeenContribution&)>& see,
                                  std::stop_token stop) const = 0;

    /// The light of the whole job that only rare hits find; see estimate_rare_light().
    virtual RareLight rare_light(std::stop_token stop) const = 0;

    /// Null for an algorithm that cannot weight single paths, because it does its own loops or its weights depend on
    /// the unit.
    virtual std::unique_ptr<PathWeights> weights() const = 0;
};

}  // namespace lightloom
