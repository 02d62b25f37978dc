#pragma once
// Scene: immutable once built, safe to read from any number of threads.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/core/result.h"
#include "common/scene/description.h"

namespace lightloom {

struct SceneOptions {
    int width = 0, height = 0;  ///< Override of the film's resolution; 0 keeps the scene's.
};

/// What `lightloom inspect` prints.
struct SceneSummary {
    uint64_t triangle_count = 0;           ///< As stored (an instanced object counts once).
    uint64_t instanced_triangle_count = 0; ///< As seen (every instance counts).
    uint64_t sphere_count = 0, instance_count = 0, emissive_triangle_count = 0;
    uint64_t texture_count = 0, image_bytes = 0, geometry_bytes = 0, acceleration_bytes = 0;
    double build_seconds = 0;
    struct Light {
        std::string kind;      ///< area, point, spot, distant, infinite
        std::string where;     ///< file:line where known
        double power = 0;      ///< Luminance-weighted flux estimate, W; what light selection uses.
        uint64_t primitives = 0;
    };
    std::vector<Light> lights;
};

class Scene {
  public:
    ~Scene();
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;

    /// Takes the description over. Fails with one clear line (and the shape's source) on anything inconsistent.
    static Result<std::unique_ptr<Scene>> build(SceneDescription description, const SceneOptions& options = {});

    SceneSummary summary() const;

  private:
    Scene();
};

}  // namespace lightloom
