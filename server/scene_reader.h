#pragma once
// Reads the facts about a job's scene from the asset store.

#include <filesystem>

#include "common/import/import.h"
#include "server/scene_facts.h"

namespace lightloom {

/// The facts of an imported scene at the resolution of `spec`, without build_scene.
Result<SceneFacts> scene_facts(const SceneDescription& description, const JobSpec& spec);

/// A reader that lays the scene's files out below `scratch` and imports them, so that a scene with an error fails its
/// job before any worker sees it; only a few are read at a time. The facts keep nothing of the scene; their
/// build_scene() reads the asset store again.
SceneReader make_scene_reader(std::filesystem::path scratch);

}  // namespace lightloom
