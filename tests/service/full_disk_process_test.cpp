// A disk that is full at the k-th write of the coordinator and for a while after it, whatever it writes: database, segments,
// checkpoints, scenes, tables, images. The job waits, goes on, and has the bytes of an undisturbed run.

#include <gtest/gtest.h>
#include <stdlib.h>

#include <map>

#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::kScene;
using testing::Process;
using testing::TempDirectory;
using testing::wait_until;

constexpr double kFullSeconds = 0.3;

const std::vector<std::string> kJob{"--algorithm", "lvcbpt", "--resolution", "32x24", "--max-depth",
                                    "4",           "--spp",  "40",           "--set", "training-paths=2000"};

struct Farm {
    std::string path(const std::string& name) const { return (directory.path / name).string(); }
    std::string log(const std::string& name) const {
        const auto text = read_file(path(name));
        return text.ok() ? *text : std::string();
    }
    std::string address() const { return std::string("unix:") + path("socket"); }
    /// Starts a coordinator; false if it has ended by itself.
    bool start_server() {
        std::filesystem::remove(path("ports"));
        server = std::make_unique<Process>(
            "lightloom-server",
            std::vector<std::string>{"--listen", address(), "--status", "off", "--data", path("data"), "--port-file", path("ports"),
                                     "--lease", "1", "--checkpoint-after", "0"},
            path("server.log"));
        EXPECT_TRUE(wait_until(60, [&] { return server->ended() || std::filesystem::exists(path("ports")); }));
        return !server->ended();
    }
    /// One that finds its disk full at its write number `k`, or never if that is 0.
    void start_server(long k) {
        if (k > 0) {
            const std::string plan = std::to_string(k) + ":" + std::to_string(kFullSeconds) + ":" + path("data");
            ::setenv("LIGHTLOOM_FULL_DISK", plan.c_str(), 1);
            ::setenv("LD_PRELOAD", LIGHTLOOM_FULL_DISK_LIBRARY, 1);
        }
        const bool started = start_server();
        ::unsetenv("LD_PRELOAD");
        ::unsetenv("LIGHTLOOM_FULL_DISK");
        if (started) return;
        // Without room it cannot open its store; it says so, and can be started once there is some.
        EXPECT_EQ(server->wait(), 1) << log("server.log");
        const std::string said = log("server.log");
        EXPECT_TRUE(said.find(": No space left on device") != std::string::npos ||
                    said.find(": database or disk is full") != std::string::npos)
            << said;
        EXPECT_TRUE(start_server()) << log("server.log");
    }
    bool was_full() const { return log("server.log").find("the disk is full for a while\n") != std::string::npos; }
    std::unique_ptr<Process> worker() const {
        return std::make_unique<Process>(
            "lightloom-worker",
            std::vector<std::string>{"--server", address(), "--threads", "1", "--cache", path("cache"), "--log", "debug"},
            path("worker.log"));
    }
    int run(const std::string& name, std::vector<std::string> arguments) const {
        arguments.insert(arguments.end(), {"--server", address()});
        return Process("lightloom", arguments, path(name)).wait();
    }
    /// How often the worker was thanked for the same result a second time.
    int asked_again() const {
        std::map<std::string, int> times;
        std::ifstream in(path("worker.log"));
        constexpr std::string_view kAccepted = "result accepted: ";
        int again = 0;
        for (std::string line; std::getline(in, line);)
            if (const size_t at = line.find(kAccepted); at != std::string::npos)
                again += ++times[line.substr(at + kAccepted.size())] > 1;
        return again;
    }

    TempDirectory directory;
    std::unique_ptr<Process> server;
};

/// The SHA-256 of the image of kJob by a farm whose disk is full at write number `k`; `was_full` says whether there were so many.
Digest render(long k, bool* was_full) {
    Farm farm;
    farm.start_server(k);
    const auto worker = farm.worker();
    std::vector<std::string> submit{"submit", kScene, "-q", "-o", farm.path("out.exr")};
    submit.insert(submit.end(), kJob.begin(), kJob.end());
    // A job for which there is no room is refused; one that was accepted goes on by itself.
    int code = -1;
    for (int attempt = 0; attempt < 4 && code != 0; ++attempt) {
        if (attempt > 0) {
            EXPECT_EQ(farm.log("server.log").find(": accepted"), std::string::npos) << farm.log("client.log");
            std::this_thread::sleep_for(std::chrono::duration<double>(kFullSeconds));
        }
        code = farm.run("client.log", submit);
    }
    EXPECT_EQ(code, 0) << farm.log("client.log") << farm.log("server.log");
    EXPECT_EQ(farm.asked_again(), 0);
    *was_full = farm.was_full();
    const auto digest = digest_file(farm.path("out.exr"));
    EXPECT_TRUE(digest.ok()) << "write " << k;
    return digest.ok() ? *digest : Digest();
}

Digest undisturbed() {
    bool was_full = false;
    return render(0, &was_full);
}

TEST(FullDisk, AJobWaitsForRoomAndHasTheSameBytes) {
    const Digest digest = undisturbed();
    for (const long k : {20, 60, 140}) {
        bool was_full = false;
        EXPECT_EQ(render(k, &was_full), digest) << "full at write " << k;
        EXPECT_TRUE(was_full) << k;
    }
}

TEST(FullDiskNightly, AtEveryKthWrite) {
    const Digest digest = undisturbed();
    bool was_full = true;
    long k = 1;
    // Every one of those until the job renders, when each writes something else; then less and less densely.
    for (; was_full; k += k < 80 ? 1 : k / 3) {
        EXPECT_EQ(render(k, &was_full), digest) << "full at write " << k;
        if (HasFailure()) break;
    }
    EXPECT_GT(k, 200) << "a job has more writes than that";
}

/// `cancel --keep` writes the groups that are complete once there is room.
TEST(FullDisk, GroupsThatAreKeptWaitForRoom) {
    for (const long k : {1, 2, 5, 9}) {
        Farm farm;
        std::string id;
        {
            ASSERT_TRUE(farm.start_server());
            const auto worker = farm.worker();
            ASSERT_EQ(farm.run("client.log", {"submit", kScene, "--detach", "-q", "--algorithm", "path", "--resolution", "32x24",
                                              "--spp", "1000000"}),
                      0);
            id = farm.log("client.log");
            id.resize(id.find('\n'));
            ASSERT_TRUE(wait_until(60, [&] { return farm.log("worker.log").find(" unit 5/0") != std::string::npos; }));
        }
        farm.server.reset();
        farm.start_server(k);
        ASSERT_TRUE(wait_until(60, [&] {
            std::filesystem::remove(farm.path("cancel.log"));
            return farm.run("cancel.log", {"cancel", id, "--keep"}) == 0;
        })) << farm.log("cancel.log");
        EXPECT_TRUE(wait_until(30,
                               [&] {
                                   return farm.run("fetch.log", {"fetch", id, "--partial", "-q", "-o", farm.path("kept.exr")}) == 0;
                               }))
            << "full at write " << k << "\n"
            << farm.log("fetch.log") << farm.log("server.log");
        const auto manifest = read_file(farm.path("kept.manifest.json"));
        ASSERT_TRUE(manifest.ok());
        EXPECT_EQ(nlohmann::json::parse(*manifest)["image"]["sha256"], digest_file(farm.path("kept.exr"))->hex());
    }
}

}  // namespace
}  // namespace lightloom
