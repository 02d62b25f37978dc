// A coordinator that is told to remove what is old.

#include <gtest/gtest.h>

#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::Process;
using testing::TempDirectory;
using testing::wait_until;
namespace fs = std::filesystem;

/// A file that nobody has used for so many hours.
void write_old(const fs::path& path, int hours) {
    fs::create_directories(path.parent_path());
    std::ofstream(path) << "old";
    for (const fs::path& aged : {path, path.parent_path()})
        fs::last_write_time(aged, fs::file_time_type::clock::now() - std::chrono::hours(hours));
}

TEST(CollectionProcess, RemovesOldImagesAndLeftoversAtTheStart) {
    const TempDirectory directory;
    const fs::path data = directory.path / "data";
    const std::string log = (directory.path / "server.log").string();
    write_old(data / "jobs/job-old/image.exr", 50);
    write_old(data / "jobs/job-young/image.exr", 40);
    write_old(data / "scratch/scene-left/scene.pbrt", 2);
    const Process server("lightloom-server",
                         {"--listen", "127.0.0.1:0", "--status", "off", "--data", data.string(), "--keep-days", "2"}, log);
    EXPECT_TRUE(wait_until(60, [&] { return !fs::exists(data / "jobs/job-old") && !fs::exists(data / "scratch/scene-left"); }))
        << *read_file(log);
    EXPECT_TRUE(fs::exists(data / "jobs/job-young/image.exr"));
    EXPECT_TRUE(wait_until(60, [&] { return read_file(log)->find("collected 1 job(s)") != std::string::npos; })) << *read_file(log);
}

}  // namespace
}  // namespace lightloom
