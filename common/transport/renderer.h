#pragma once
// Renderer: scene + algorithm + settings -> partials of units. The one door between the service and light transport; one
// virtual call per unit is made behind it.

#include <cstdint>
#include <memory>
#include <stop_token>

#include "common/core/result.h"
#include "common/film/partial.h"
#include "common/scene/scene.h"
#include "common/tables/subspace_tables.h"
#include "common/transport/catalog.h"

namespace lightloom {

struct RenderSettings {
    std::string algorithm = "path";
    std::map<std::string, std::string> parameters;
    uint64_t seed = 0;
    int max_depth = 5;  ///< Bounces; paths have at most max_depth + 1 edges.
};

/// The part of a unit that light transport needs (common/work's WorkUnit adds the scheduling key).
struct UnitWork {
    uint64_t first_iteration = 0;
    uint32_t iteration_count = 0;
    /// First iteration of the whole group: keys its light paths. Differs from first_iteration only when a part of a unit is
    /// rendered again (replay).
    uint64_t group_first_iteration = 0;
    Rect tile;
    uint64_t first_light_path = 0;
    uint64_t light_path_count = 0;
    /// The whole unit's tile where `tile` is a part of it (replay of one sample): keys the unit's light-vertex cache.
    /// Empty: `tile`.
    Rect owner_tile;

    const Rect& owner() const { return owner_tile.empty() ? tile : owner_tile; }
};

class Renderer {
  public:
    virtual ~Renderer() = default;

    /// `scene` must already have the resolution and crop of the job (Scene::build options).
    /// `tables` belong to this scene and these settings; only algorithms whose catalog row says so need them.
    static Result<std::unique_ptr<Renderer>> create(std::shared_ptr<const Scene> scene, const RenderSettings& settings,
                                                    std::shared_ptr<const SubspaceTables> tables = nullptr);

    /// Renders one unit on the calling thread's TBB arena; the result does not depend on how many threads that has.
    /// A stop request makes it return kCancelled soon.
    virtual Result<Partial> render(const UnitWork& work, std::stop_token stop) const = 0;
};

}  // namespace lightloom
