// What a worker keeps on disk, and what other processes do to that directory meanwhile.

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <future>

#include "common/film/atomic_file.h"
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

TEST(SceneFetcher, AFileListThatAnotherProcessDidNotFinishIsStoredAfterAll) {
    FakeService service;
    const std::string source = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/furnace-sphere.pbrt";  // which includes no file
    const auto text = read_file(source);
    ASSERT_TRUE(text.ok()) << text.status().message();
    const AssetManifest manifest{"scene.pbrt", {{"scene.pbrt", sha256(*text), text->size()}}};
    AssetStore& assets = service.coordinator->assets();
    ASSERT_TRUE(assets.put(sha256(*text), *text).ok());
    ASSERT_TRUE(assets.put(manifest.root(), manifest.canonical_text()).ok());
    JobSpec spec;
    spec.scene_root = manifest.root();
    spec.width = spec.height = 16;

    const TempDirectory directory;
    LocalWorkerPort port(*service.coordinator);
    SceneFetcher fetcher(port, directory.path);
    std::optional<Storing> other(std::in_place, directory.path / "assets", manifest.root());
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

}  // namespace
}  // namespace lightloom
