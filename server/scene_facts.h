#pragma once
// What must be known of a job's scene before its units can be planned.

#include <functional>
#include <memory>
#include <stop_token>
#include <vector>

#include "common/core/result.h"
#include "common/film/exr_io.h"
#include "common/film/frame.h"
#include "common/film/response.h"
#include "common/scene/scene.h"
#include "common/work/service.h"

namespace lightloom {

struct SceneFacts {
    FrameLayout frame;               ///< The frame at the job's resolution.
    FilmResponse response;           ///< The response of the scene's film.
    int max_depth = 5;               ///< Bounces, if the job leaves them to the scene.
    std::vector<ImageLayer> layers;  ///< First-hit layers, if the job asks for them.
    /// Builds the scene, whose lights learning needs. It is called only for a job whose tables have to be made, and
    /// holds no scene itself.
    std::function<Result<std::shared_ptr<const Scene>>()> build_scene;
};

using SceneReader = std::function<Result<SceneFacts>(const AssetStore& assets, const JobSpec& spec, std::stop_token stop)>;

}  // namespace lightloom
