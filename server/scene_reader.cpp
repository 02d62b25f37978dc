#include "server/scene_reader.h"

#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <memory>
#include <mutex>

#include "common/scene/scene.h"
#include "common/transport/catalog.h"
#include "common/transport/first_hit.h"
#include "server/store/files.h"

namespace lightloom {
namespace {

/// Lets only a few scenes be read at a time: each takes a processor and perhaps gigabytes, and hundreds of jobs may be
/// submitted at once.
class Turns {
  public:
    /// Waits for a turn. False if a stop was requested first.
    bool take(std::stop_token stop) {
        std::unique_lock lock(mutex_);
        if (!given_back_.wait(lock, stop, [&] { return free_ > 0; })) return false;
        --free_;
        return true;
    }
    void give_back() {
        const std::lock_guard lock(mutex_);
        ++free_;
        given_back_.notify_one();
    }

  private:
    std::mutex mutex_;
    std::condition_variable_any given_back_;
    int free_ = 2;
};

Result<ImportedScene> read_scene(const AssetStore& assets, const Digest& root, const std::filesystem::path& scratch) {
    const auto text = assets.read(root);
    if (!text.ok()) return text.status();
    const auto manifest = AssetManifest::parse(*text);
    if (!manifest.ok()) return manifest.status();
    std::string directory = (scratch / "scene-XXXXXX").string();
    std::error_code error;
    std::filesystem::create_directories(scratch, error);
    if (error) return file_error(scratch, "cannot be made", error.value());
    if (!::mkdtemp(directory.data())) return file_error(scratch, "no directory can be made there", errno);
    const Status status = assets.materialise(*manifest, directory);
    // The scene may not refer to files outside of the directory.
    auto scene = status.ok() ? import_pbrt((std::filesystem::path(directory) / manifest->main).string(),
                                           {.root = directory, .without = manifest->without})
                             : Result<ImportedScene>(status);
    std::filesystem::remove_all(directory, error);
    // Of the importer this says that memory is too small, and waiting for room on the disk would not help.
    if (status.ok() && scene.status().code() == StatusCode::kResourceExhausted) return internal_error(scene.status().message());
    return scene;
}

}  // namespace

Result<SceneFacts> scene_facts(const SceneDescription& description, const JobSpec& spec) {
    const auto frame = frame_layout(description.film, scene_options(spec));
    if (!frame.ok()) return frame.status();
    SceneFacts facts{*frame, description.film.response, description.max_depth, {}, {}};
    if (spec.first_hit_layers) {
        const auto scene = Scene::build(description, scene_options(spec));
        if (!scene.ok()) return scene.status();
        facts.layers = first_hit_layers(**scene, spec.seed);
    }
    return facts;
}

SceneReader make_scene_reader(std::filesystem::path scratch) {
    const auto turns = std::make_shared<Turns>();
    return [scratch = std::move(scratch), turns](const AssetStore& assets, const JobSpec& spec,
                                                 std::stop_token stop) -> Result<SceneFacts> {
        if (!turns->take(stop)) return Status(StatusCode::kCancelled, "the job ended before its scene was read");
        const std::shared_ptr<void> turn(nullptr, [&](void*) { turns->give_back(); });
        const auto scene = read_scene(assets, spec.scene_root, scratch);
        if (!scene.ok()) return scene.status();
        auto facts = scene_facts(scene->description, spec);
        if (!facts.ok()) return facts;
        if (!spec.algorithm.learning()) return facts;
        // The scene is read a second time when it is needed, while workers trace, so that no waiting job holds a scene.
        // This read does not wait for a turn, because workers wait for this job.
        facts->build_scene = [&assets, scratch, root = spec.scene_root,
                              options = scene_options(spec)]() -> Result<std::shared_ptr<const Scene>> {
            auto again = read_scene(assets, root, scratch);
            if (!again.ok()) return again.status();
            auto built = Scene::build(std::move(again->description), options);
            if (!built.ok()) return built.status();
            return std::shared_ptr<const Scene>(std::move(built).value());
        };
        return facts;
    };
}

}  // namespace lightloom
