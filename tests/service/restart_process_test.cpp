// A coordinator that is killed and started again: how soon workers and clients are back.

#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>

#include "common/core/crash_point.h"
#include "common/work/channel.h"
#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::Process;
using testing::Service;
using testing::wait_until;
using Clock = std::chrono::steady_clock;

/// Far above the second that it should take, and below what polling takes.
constexpr double kBackSeconds = 5;

/// Kills the coordinator, leaves its port closed for a while, and starts another one there. When its port opened.
Clock::time_point restart(Service& service, double closed_seconds) {
    service.server->signal(SIGKILL);
    service.server->wait();
    std::this_thread::sleep_for(std::chrono::duration<double>(closed_seconds));
    std::filesystem::remove(service.path("ports"));
    service.server = std::make_unique<Process>(
        "lightloom-server",
        std::vector<std::string>{"--listen", service.address(), "--status", "off", "--data", service.path("data"), "--port-file",
                                 service.path("ports"), "--lease", "1"},
        service.path("server.log"));
    EXPECT_TRUE(wait_until(60, [&] { return std::filesystem::exists(service.path("ports")); })) << service.log("server");
    return Clock::now();
}

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

TEST(Restart, WorkersAreBackAsSoonAsThePortOpens) {
    Service service;
    const auto worker = service.worker("worker", 1);
    ASSERT_TRUE(wait_until(60, [&] { return service.log("worker").find("registered as") != std::string::npos; }))
        << service.log("worker");
    double longest = 0;
    for (const double closed : {0.5, 3.0, 8.0}) {
        const auto open = restart(service, closed);
        GrpcJobPort jobs(open_channel(service.address()));
        ASSERT_TRUE(wait_until(60, [&] {
            const auto workers = jobs.list_workers(0);
            return workers.ok() && !workers->empty();
        })) << service.log("worker");
        const double back = seconds_since(open);
        std::printf("port closed for %.1f s; the worker was back %.2f s after it opened\n", closed, back);
        longest = std::max(longest, back);
    }
    EXPECT_LT(longest, kBackSeconds);
}

TEST(Restart, AnAttachedClientIsBackAsSoonAsThePortOpens) {
    Service service;
    const auto submitted = service.submit("image", {"--spp", "2", "--resolution", "16x12"});
    ASSERT_TRUE(wait_until(60, [&] {
        const auto list = service.jobs().list_jobs();
        return list.ok() && !list->empty() && list->front().state == JobState::kRunning;
    })) << service.log("image");
    const auto open = restart(service, 7);
    // Either the job is known, and this worker renders it, or the client says clearly that it is not.
    const auto worker = service.worker("worker", 1);
    ASSERT_TRUE(wait_until(60, [&] { return submitted->ended(); })) << service.log("image");
    std::printf("the client ended %.2f s after the port opened\n", seconds_since(open));
    const int code = submitted->wait();
    if (code != 0) {
        EXPECT_EQ(code, 1) << service.log("image");
        EXPECT_NE(service.log("image").find("is not known any more: the coordinator was restarted without it"), std::string::npos)
            << service.log("image");
        EXPECT_LT(seconds_since(open), kBackSeconds);
    }
    EXPECT_NE(service.log("image").find("waiting for it to come back"), std::string::npos) << service.log("image");
}

/// The coordinator dies when the samples of the image are decided and the image is not written yet.
TEST(Restart, ATimeLimitThatIsOverStaysOver) {
    ::setenv(kCrashVariable, "server.image-encoded", 1);
    Service service;
    ::unsetenv(kCrashVariable);
    const auto submitted = service.submit("image", {"--time", "1", "--resolution", "16x12", "--algorithm", "path"});
    auto worker = service.worker("worker", 1);
    ASSERT_TRUE(wait_until(60, [&] { return service.server->ended(); })) << service.log("server");
    worker.reset();
    restart(service, 0);
    ASSERT_TRUE(wait_until(60, [&] { return submitted->ended(); })) << "nobody is there who could render: " << service.log("image");
    EXPECT_EQ(submitted->wait(), 0) << service.log("image");
    EXPECT_GT(service.manifest("image")["image"]["samples_per_pixel"].get<uint64_t>(), 0u);
}

}  // namespace
}  // namespace lightloom
