// Coordinator and workers whose log nobody reads.

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <array>

#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::kScene;
using testing::Process;
using testing::TempDirectory;
using testing::wait_until;

/// A pipe in the file system that is full to the last byte, and has an end for reading that nobody reads from.
class FullPipe {
  public:
    explicit FullPipe(const std::string& path) {
        EXPECT_EQ(::mkfifo(path.c_str(), 0600), 0);
        end_ = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
        const std::string block(4096, '.');
        while (::write(end_, block.data(), block.size()) > 0) {
        }
        while (::write(end_, block.data(), 1) > 0) {
        }
    }
    ~FullPipe() { ::close(end_); }

  private:
    int end_ = -1;
};

TEST(LogProcess, ABlockedStandardErrorStopsNothing) {
    const TempDirectory directory;
    const auto path = [&](const char* name) { return (directory.path / name).string(); };
    const FullPipe server_log(path("server.pipe")), worker_log(path("worker.pipe"));
    Process server(
        "lightloom-server",
        {"--listen", "127.0.0.1:0", "--status", "off", "--data", path("data"), "--port-file", path("ports"), "--lease", "1"},
        path("server.pipe"));
    ASSERT_TRUE(wait_until(60, [&] { return std::filesystem::exists(path("ports")); })) << "it waits for the reader of its log";
    int port = 0;
    std::ifstream(path("ports")) >> port;
    const std::string address = "127.0.0.1:" + std::to_string(port);
    Process worker("lightloom-worker", {"--server", address, "--threads", "1", "--cache", path("cache"), "--log", "debug"},
                   path("worker.pipe"));
    Process client("lightloom",
                   {"submit", kScene, "--server", address, "-o", path("out.exr"), "-q", "--spp", "2", "--resolution", "16x12"},
                   path("client.log"));
    ASSERT_TRUE(wait_until(60, [&] { return client.ended(); })) << "the job stands still";
    EXPECT_EQ(client.wait(), 0);
    for (Process* program : {&worker, &server}) {
        program->signal(SIGTERM);
        ASSERT_TRUE(wait_until(60, [&] { return program->ended(); })) << "it ends without a reader of its log";
        EXPECT_EQ(program->wait(), 0);
    }
}

TEST(LogProcess, TheLastLinesAreWrittenBeforeAProgramEnds) {
    const TempDirectory directory;
    const std::string log = (directory.path / "server.log").string();
    Process server("lightloom-server", {"--listen", "127.0.0.1:0", "--status", "off", "--data", "/dev/null/nowhere"}, log);
    EXPECT_EQ(server.wait(), 1);
    const auto text = read_file(log);
    ASSERT_TRUE(text.ok());
    EXPECT_NE(text->find("lightloom-server: /dev/null/nowhere: "), std::string::npos) << *text;
}

}  // namespace
}  // namespace lightloom
