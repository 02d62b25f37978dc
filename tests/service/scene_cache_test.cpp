// What a worker keeps on disk, and what other processes do to that directory meanwhile.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <future>

#include "common/core/atomic_file.h"
#include "common/import/import.h"
#include "server/local_ports.h"
#include "tests/service/fake.h"
#include "worker/scene_cache.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::TempDirectory;

/// What a process does that stores a file, up to the point at which it dies.
class Storing {
  public:
    Storing(const std::filesystem::path& store, const Digest& digest)
        : file_(::open((store / "incoming" / digest.hex()).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644)) {
        EXPECT_EQ(::flock(file_, LOCK_EX | LOCK_NB), 0);
    }
    ~Storing() { ::close(file_); }

  private:
    int file_;
};

/// A job on a scene of one file, which the coordinator has.
JobSpec put_scene(FakeService& service) {
    const std::string source = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/furnace-sphere.pbrt";  // which includes no file
    const auto text = read_file(source);
    EXPECT_TRUE(text.ok()) << text.status().message();
    const AssetManifest manifest{"scene.pbrt", {{"scene.pbrt", sha256(*text), text->size()}}};
    AssetStore& assets = service.coordinator->assets();
    EXPECT_TRUE(assets.put(sha256(*text), *text).ok());
    EXPECT_TRUE(assets.put(manifest.root(), manifest.canonical_text()).ok());
    JobSpec spec;
    spec.scene_root = manifest.root();
    spec.width = spec.height = 16;
    return spec;
}

TEST(SceneFetcher, AFileListThatAnotherProcessDidNotFinishIsStoredAfterAll) {
    FakeService service;
    JobSpec spec = put_scene(service);
    AssetStore& assets = service.coordinator->assets();
    const TempDirectory directory;
    LocalWorkerPort port(*service.coordinator);
    SceneFetcher fetcher(port, directory.path);
    std::optional<Storing> other(std::in_place, directory.path / "assets", spec.scene_root);
    std::stop_source stop;
    auto fetched = std::async(std::launch::async, [&] { return fetcher.scene(spec, stop.get_token()); });
    EXPECT_EQ(fetched.wait_for(std::chrono::milliseconds(300)), std::future_status::timeout) << "the other one may finish yet";
    other.reset();
    EXPECT_EQ(fetched.wait_for(std::chrono::seconds(30)), std::future_status::ready);
    stop.request_stop();
    const auto scene = fetched.get();
    EXPECT_TRUE(scene.ok()) << scene.status().message();

    // Whoever waits can be stopped.
    other.emplace(directory.path / "assets", sha256("another list"));
    spec.scene_root = sha256("another list");
    ASSERT_TRUE(assets.put(spec.scene_root, "another list").ok());
    EXPECT_EQ(fetcher.scene(spec, stop.get_token()).status().code(), StatusCode::kCancelled);
}

TEST(SceneFetcher, DamagedFilesAreFetchedAgain) {
    FakeService service;
    const JobSpec spec = put_scene(service);
    const TempDirectory directory;
    LocalWorkerPort port(*service.coordinator);
    const auto fetch = [&] { return SceneFetcher(port, directory.path).scene(spec, {}).status(); };
    ASSERT_TRUE(fetch().ok());
    const AssetStore kept(directory.path / "assets");
    const auto list = AssetManifest::parse(*kept.read(spec.scene_root));
    for (const Digest& digest : {spec.scene_root, list->entries.front().digest}) {
        const std::string bytes = *kept.read(digest), path = kept.path_of(digest).string();
        std::string damaged = bytes;
        damaged[bytes.size() / 2] ^= 1;
        for (const std::string& wrong : {damaged, bytes.substr(1), std::string()}) {
            ASSERT_TRUE(write_file_atomically(path, wrong).ok());
            const Status again = fetch();
            EXPECT_TRUE(again.ok()) << again.message();
            EXPECT_EQ(*kept.read(digest), bytes);
        }
    }
    // Where the coordinator's copy is damaged as well, it is removed there, so that a client is asked for it; and that is said.
    AssetStore& theirs = service.coordinator->assets();
    for (const auto& [digest, name] :
         {std::pair{list->entries.front().digest, "\"scene.pbrt\" of the scene"}, {spec.scene_root, "the scene's file list"}}) {
        std::filesystem::remove(kept.path_of(digest));
        ASSERT_TRUE(write_file_atomically(theirs.path_of(digest).string(), "damaged").ok());
        const Status lost = fetch();
        EXPECT_EQ(lost.code(), StatusCode::kNotFound);
        EXPECT_NE(lost.message().find(std::string(name) + " is lost or damaged in the coordinator's store"), std::string::npos)
            << lost.message();
        EXPECT_FALSE(theirs.contains(digest));
    }
}

TEST(SceneFetcher, SceneFilesUsedLeastRecentlyAreRemovedAboveTheLimit) {
    FakeService service;
    const JobSpec spec = put_scene(service);
    const TempDirectory directory;
    LocalWorkerPort port(*service.coordinator);
    AssetStore kept(directory.path / "assets");
    const auto fetch = [&](uint64_t limit) {
        const Status status = SceneFetcher(port, directory.path, {.scenes = limit}).scene(spec, {}).status();
        EXPECT_TRUE(status.ok()) << status.message();
    };
    fetch(0);
    const AssetManifest list = *AssetManifest::parse(*kept.read(spec.scene_root));
    const uint64_t size = list.canonical_text().size() + list.entries.front().size_bytes;
    const std::string old(1000, 'o'), older(1000, 'O');
    for (const std::string& bytes : {old, older}) {
        ASSERT_TRUE(kept.put(sha256(bytes), bytes).ok());
        std::filesystem::last_write_time(kept.path_of(sha256(bytes)),
                                         std::filesystem::file_time_type::clock::now() - std::chrono::hours(bytes == old ? 1 : 2));
    }
    fetch(0);
    EXPECT_TRUE(kept.contains(sha256(older))) << "without a limit all stay";
    fetch(size + 1000);
    EXPECT_FALSE(kept.contains(sha256(older)));
    EXPECT_TRUE(kept.contains(sha256(old)));
    fetch(size);
    EXPECT_FALSE(kept.contains(sha256(old)));
    EXPECT_TRUE(kept.contains(spec.scene_root) && kept.contains(list.entries.front().digest)) << "what is in use is the youngest";
    fetch(1);  // and yet it is read
}

/// Jobs on one scene that differ in --crop alone.
TEST(RendererCache, BuildsASceneForEachCropWindow) {
    const FakeService service;
    LocalWorkerPort port(*service.coordinator);
    int built = 0;
    const auto build = [&](const JobSpec& spec, std::stop_token) -> Result<std::shared_ptr<const Scene>> {
        ++built;
        auto imported = import_pbrt(std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/furnace-sphere.pbrt");
        if (!imported.ok()) return imported.status();
        auto scene = Scene::build(std::move(imported->description), scene_options(spec));
        if (!scene.ok()) return scene.status();
        return std::shared_ptr<const Scene>(std::move(scene).value());
    };
    RendererCache cache(build, direct_tables(port));
    const Rect whole{0, 0, 64, 64}, window{8, 4, 24, 12};
    for (const bool cropped : {false, true, true, false}) {
        UnitLease lease;
        lease.spec.max_depth = 3;
        if (cropped) lease.spec.crop = window;
        lease.spec.frame = {64, 64, cropped ? window : whole};
        const auto renderer = cache.renderer(lease, {});
        EXPECT_TRUE(renderer.ok()) << renderer.status().message();
    }
    EXPECT_EQ(built, 2);
}

/// The tables of the coordinator, and what a fetcher of at most 2500 bytes keeps of them.
struct Tables : ::testing::Test {
    AssetReference put(const std::string& name, size_t size) {
        std::string bytes = name;
        bytes.resize(size, 'x');
        EXPECT_TRUE(service.coordinator->assets().put(sha256(bytes), bytes).ok());
        return {sha256(bytes), size};
    }
    bool kept(const AssetReference& tables) const { return AssetStore(directory.path / "worker-tables").contains(tables.digest); }

    FakeService service;
    const TempDirectory directory;
    LocalWorkerPort port{*service.coordinator};
    SceneFetcher fetcher{port, directory.path, {.tables = 2500}};
};

TEST_F(Tables, ThatWereUsedLeastRecentlyAreRemovedAboveTheLimit) {
    const AssetReference a = put("a", 1000), b = put("b", 1000), c = put("c", 1000), large = put("large", 5000);
    AssetStore scene_files(directory.path / "assets");
    const std::string text(10000, 't');
    ASSERT_TRUE(scene_files.put(sha256(text), text).ok());
    for (const AssetReference& tables : {a, b, a, c}) ASSERT_TRUE(fetcher.tables(tables, {}).ok());
    EXPECT_TRUE(kept(a));
    EXPECT_FALSE(kept(b));
    EXPECT_TRUE(kept(c));
    EXPECT_EQ(sha256(*fetcher.tables(b, {})), b.digest) << "they are fetched again";
    EXPECT_FALSE(kept(a));
    ASSERT_TRUE(fetcher.tables(large, {}).ok());
    EXPECT_TRUE(kept(large)) << "what is in use stays";
    EXPECT_FALSE(kept(b) || kept(c));
    EXPECT_TRUE(scene_files.contains(sha256(text))) << "scene files are no tables";
}

TEST_F(Tables, OfWhichAFetchBrokeOffLongAgoAreRemoved) {
    const std::filesystem::path incoming = directory.path / "worker-tables" / "incoming";
    for (const char* name : {"old", "young"}) ASSERT_TRUE(write_file_atomically((incoming / name).string(), "half").ok());
    std::filesystem::last_write_time(incoming / "old", std::filesystem::file_time_type::clock::now() - std::chrono::hours(2));
    ASSERT_TRUE(fetcher.tables(put("a", 1000), {}).ok());
    EXPECT_FALSE(std::filesystem::exists(incoming / "old"));
    EXPECT_TRUE(std::filesystem::exists(incoming / "young"));
}

}  // namespace
}  // namespace lightloom
