// A client's calls over gRPC when others are in the way, slow, or gone.

#include <grpcpp/create_channel.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>

#include "client/grpc_job_port.h"
#include "common/core/atomic_file.h"
#include "common/work/channel.h"
#include "common/work/wire.h"
#include "server/grpc_services.h"
#include "tests/service/fake.h"
#include "tests/service/process.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::TempDirectory;
using Clock = std::chrono::steady_clock;

std::shared_ptr<grpc::Channel> channel_to(int port) {
    return grpc::CreateChannel("127.0.0.1:" + std::to_string(port), grpc::InsecureChannelCredentials());
}

/// What a client of another build may send: our own cannot make such a spec.
TEST(Submission, OfAnAlgorithmOrParameterThatDoesNotExistIsRefusedClearly) {
    FakeService service;
    const auto server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    const auto stub = v1::JobService::NewStub(channel_to(server->port()));
    int requests = 0;
    const auto submit = [&](const std::function<void(v1::JobSpec&)>& change) {
        v1::SubmitJobRequest request;
        request.set_request_id("raw-" + std::to_string(++requests));
        wire::put(service.spec(4), request.mutable_spec());
        change(*request.mutable_spec());
        grpc::ClientContext context;
        context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
        v1::Job job;
        return stub->SubmitJob(&context, request, &job);
    };
    const auto refuses = [&](const std::function<void(v1::JobSpec&)>& change, const std::string& reason) {
        const grpc::Status status = submit(change);
        EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << status.error_message();
        EXPECT_NE(status.error_message().find(reason), std::string::npos) << status.error_message();
    };
    refuses([](v1::JobSpec& s) { s.set_algorithm("no-such"); }, "no algorithm named 'no-such'; choose one of: path, ");
    refuses([](v1::JobSpec& s) { s.set_algorithm(""); }, "no algorithm named ''");
    refuses([](v1::JobSpec& s) { (*s.mutable_parameters())["light-subspaces"] = "40"; },
            "algorithm 'bdpt' has no parameter 'light-subspaces'; `lightloom algorithms bdpt` lists them");
    refuses([](v1::JobSpec& s) { (*s.mutable_parameters())["rr-min"] = "nan"; },
            "parameter rr-min=nan of 'bdpt' must be a number from 0.01 to 1");
    refuses([](v1::JobSpec& s) { (*s.mutable_parameters())["heuristic"] = "1.5"; },
            "must be balance, power, maximum, popov or correlation-aware");
    const auto refuses_time = [&](double seconds, const char* reason) {
        refuses([&](v1::JobSpec& s) { s.clear_samples_per_pixel(), s.set_time_limit_seconds(seconds); }, reason);
    };
    for (const double seconds : {1e-300, 1e-4, 31 * 86400.0, -1.0}) refuses_time(seconds, "is not from 0.001 s to 30 days");
    for (const double seconds : {double(INFINITY), double(NAN)}) refuses_time(seconds, "time_limit_seconds is not a finite number");
    EXPECT_TRUE(service.coordinator->list_jobs().empty());
    EXPECT_TRUE(submit([](v1::JobSpec& s) { (*s.mutable_parameters())["heuristic"] = "power"; }).ok()) << "a name of a choice";
    ASSERT_EQ(service.coordinator->list_jobs().size(), 1u);
    EXPECT_EQ(service.coordinator->list_jobs()[0].spec.algorithm.text().at("heuristic"), "1");
}

/// A file that somebody else has begun to upload.
struct Upload : ::testing::Test {
    FakeService service;
    std::unique_ptr<GrpcServer> server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    const std::string bytes = std::string(1 << 20, 'x') + "y";
    const Digest digest = sha256(bytes);
    std::optional<AssetStore::Upload> other{std::move(service.coordinator->assets().begin_upload(digest, bytes.size())).value()};
};

TEST_F(Upload, WaitsForAnotherOneOfTheSameFileAndGoesOnWhereThatBreaksOff) {
    GrpcJobPort jobs(channel_to(server->port()), {.upload_silence_seconds = 10});
    std::atomic<bool> broken_off{false};
    std::jthread thread([&] {
        for (int i = 0; i < 10; ++i) {  // in all far longer than a few attempts take
            EXPECT_TRUE(other->append(std::string(100, 'x')).ok());
            std::this_thread::sleep_for(std::chrono::milliseconds(400));
        }
        broken_off = true;
        other.reset();
    });
    const Status status = jobs.upload_bytes(digest, bytes);
    EXPECT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(broken_off);
    const auto stored = service.coordinator->assets().read(digest);
    EXPECT_TRUE(stored.ok()) << stored.status().message();
}

TEST_F(Upload, TakesOverFromOneThatStandsStill) {
    ASSERT_TRUE(other->append(std::string(100, 'x')).ok());
    GrpcJobPort jobs(channel_to(server->port()));
    const auto begin = Clock::now();
    const Status status = jobs.upload_bytes(digest, bytes);
    EXPECT_TRUE(status.ok()) << status.message();
    EXPECT_GT(Clock::now() - begin, std::chrono::seconds(9)) << "the other one may only be slow";
    EXPECT_TRUE(service.coordinator->assets().read(digest).ok());
    EXPECT_EQ(other->append("x").code(), StatusCode::kAborted) << "it is too late";
}

TEST_F(Upload, GivesUpWhenTheOtherOneStandsStill) {
    const TempDirectory directory;
    const std::string path = (directory.path / "a.ply").string();
    ASSERT_TRUE(write_file_atomically(path, bytes).ok());
    GrpcJobPort jobs(channel_to(server->port()), {.upload_silence_seconds = 1});
    const Status status = jobs.upload(digest, path);
    EXPECT_EQ(status.code(), StatusCode::kAborted);
    EXPECT_EQ(status.message().rfind(path + ": another client is sending this file", 0), 0u) << status.message();
    EXPECT_NE(status.message().find("for 1 s; try again later"), std::string::npos) << status.message();
}

TEST_F(Upload, CanBeInterruptedWhileItWaits) {
    std::stop_source stop;
    GrpcJobPort jobs(channel_to(server->port()), {.stop = stop.get_token()});
    std::jthread thread([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(300));
        stop.request_stop();
    });
    const auto begin = Clock::now();
    EXPECT_EQ(jobs.upload_bytes(digest, bytes).code(), StatusCode::kCancelled);
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(20));
}

/// Sends `chunks` bytes one by one, and then, if it stalls, nothing more.
struct SlowImages final : v1::JobService::Service {
    grpc::Status GetImage(grpc::ServerContext* context, const v1::GetImageRequest*,
                          grpc::ServerWriter<v1::Chunk>* writer) override {
        for (int i = 0; i < chunks; ++i) {
            v1::Chunk chunk;
            chunk.set_offset_bytes(uint64_t(i));
            chunk.set_data("x");
            writer->Write(chunk);
            std::this_thread::sleep_for(std::chrono::milliseconds(400));
        }
        while (stalls && !context->IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
        return grpc::Status::OK;
    }
    std::atomic<int> chunks{10};
    std::atomic<bool> stalls{false};
};

struct Images : ::testing::Test {
    Images() {
        grpc::ServerBuilder builder;
        builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &number);
        builder.RegisterService(&images);
        server = builder.BuildAndStart();
    }
    SlowImages images;
    int number = 0;
    std::unique_ptr<grpc::Server> server;
};

TEST_F(Images, CanBeInterruptedUnlessThatIsOver) {
    std::stop_source stop;
    GrpcJobPort jobs(channel_to(number), {.stop = stop.get_token(), .silence_seconds = 10});
    images.chunks = 1;
    images.stalls = true;
    std::jthread thread([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(600));
        stop.request_stop();
    });
    const auto begin = Clock::now();
    const Status interrupted = jobs.image("job-1", ImageKind::kFinal).status();
    EXPECT_EQ(interrupted.code(), StatusCode::kCancelled);
    EXPECT_EQ(interrupted.message().rfind("interrupted; nothing is lost", 0), 0u) << interrupted.message();
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(20));
    images.stalls = false;
    const auto image = jobs.image("job-1", ImageKind::kFinal);
    EXPECT_TRUE(image.ok()) << image.status().message();
}

TEST_F(Images, MayTakeAnyTimeAsLongAsSomethingComes) {
    GrpcJobPort jobs(channel_to(number), {.silence_seconds = 2});
    const auto image = jobs.image("job-1", ImageKind::kFinal);
    ASSERT_TRUE(image.ok()) << image.status().message();
    EXPECT_EQ(*image, "xxxxxxxxxx");
    images.stalls = true;
    const Status silence = jobs.image("job-1", ImageKind::kFinal).status();
    EXPECT_EQ(silence.code(), StatusCode::kDeadlineExceeded);
    EXPECT_NE(silence.message().find("nothing more has come from the coordinator for 2 s"), std::string::npos) << silence.message();
    server->Shutdown();
    const Status gone = jobs.image("job-1", ImageKind::kFinal).status();
    EXPECT_EQ(gone.code(), StatusCode::kUnavailable);
    EXPECT_NE(gone.message().find("`lightloom fetch` tries again"), std::string::npos) << gone.message();
}

/// Also when there is nothing new to say for longer than it would wait for a connection.
TEST(Watch, GoesOnWhenTheCoordinatorIsBackInTime) {
    FakeService service;
    const std::string id = service.submit(service.spec(4));
    auto server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    const std::string address = "127.0.0.1:" + std::to_string(server->port());
    GrpcJobPort jobs(open_channel(address));
    std::atomic<int> changes{0};
    Status ended;
    std::jthread watch([&] { ended = jobs.watch_job(id, [&](const JobInfo&) { ++changes; }, {}); });
    EXPECT_TRUE(testing::wait_until(60, [&] { return changes > 0; }));
    server.reset();
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    auto again = GrpcServer::start(*service.coordinator, address);
    ASSERT_TRUE(again.ok()) << again.status().message();
    std::this_thread::sleep_for(std::chrono::seconds(5));  // by then it would have given up
    EXPECT_TRUE(service.coordinator->cancel_job(id).ok());
    watch.join();
    EXPECT_TRUE(ended.ok()) << ended.message();
    EXPECT_GT(changes, 1);
}

TEST(Watch, TellsThatARestartedCoordinatorDoesNotKnowTheJob) {
    FakeService before, after;
    const std::string id = before.submit(before.spec(4));
    auto server = std::move(GrpcServer::start(*before.coordinator, "127.0.0.1:0")).value();
    const std::string address = "127.0.0.1:" + std::to_string(server->port());
    std::atomic<int> lost{0}, changes{0};
    GrpcJobPort jobs(open_channel(address), {.on_lost = [&] { ++lost; }});
    Status ended;
    std::jthread watch([&] { ended = jobs.watch_job(id, [&](const JobInfo&) { ++changes; }, {}); });
    EXPECT_TRUE(testing::wait_until(60, [&] { return changes > 0; }));
    server.reset();
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    const auto again = GrpcServer::start(*after.coordinator, address);
    ASSERT_TRUE(again.ok()) << again.status().message();
    watch.join();
    EXPECT_EQ(ended.code(), StatusCode::kNotFound);
    EXPECT_NE(ended.message().find(id + " is not known any more"), std::string::npos) << ended.message();
    EXPECT_EQ(lost, 1);
}

TEST(Calls, GoOnOverARestartOfACoordinatorThatHasAnswered) {
    FakeService service;
    auto server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    const std::string address = "127.0.0.1:" + std::to_string(server->port());
    GrpcJobPort jobs(open_channel(address)), stranger(open_channel(address), {.reconnect_seconds = 60});
    ASSERT_TRUE(jobs.list_jobs().ok());
    server.reset();
    const auto begin = Clock::now();
    EXPECT_EQ(stranger.list_jobs().status().code(), StatusCode::kUnavailable);
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(10)) << "nobody says that there ever was one";
    std::jthread restart([&] {
        std::this_thread::sleep_for(std::chrono::seconds(1));
        server = std::move(GrpcServer::start(*service.coordinator, address)).value();
    });
    const auto submitted = jobs.submit_job("request", service.spec(4), {});
    EXPECT_TRUE(submitted.ok()) << submitted.status().message();
}

/// What stands before a coordinator that is gone.
struct Proxy final : v1::JobService::Service {
    grpc::Status WatchJob(grpc::ServerContext*, const v1::WatchJobRequest*, grpc::ServerWriter<v1::Job>*) override {
        ++calls;
        return {grpc::StatusCode::UNAVAILABLE, "no upstream"};
    }
    std::atomic<int> calls{0};
};

TEST(Watch, EndsWhenThereIsNothingButAConnection) {
    Proxy proxy;
    grpc::ServerBuilder builder;
    int number = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &number);
    builder.RegisterService(&proxy);
    const auto server = builder.BuildAndStart();
    GrpcJobPort jobs(channel_to(number), {.reconnect_seconds = 1});
    std::stop_source stop;
    std::atomic<bool> done{false};
    Status ended;
    std::jthread watch([&] {
        ended = jobs.watch_job(
            "job-1", [](const JobInfo&) {}, stop.get_token());
        done = true;
    });
    testing::wait_until(20, [&] { return done.load(); });
    stop.request_stop();
    watch.join();
    EXPECT_EQ(ended.code(), StatusCode::kUnavailable);
    EXPECT_NE(ended.message().find("no upstream"), std::string::npos) << ended.message();
    EXPECT_GT(proxy.calls, 1);
    EXPECT_LT(proxy.calls, 6);  // with a pause of 0.25 s before each but the first
}

}  // namespace
}  // namespace lightloom
