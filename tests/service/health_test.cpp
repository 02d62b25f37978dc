// What probes are told, over HTTP and over gRPC; and what a coordinator tells of its calls.

#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <future>
#include <limits>

#include "server/grpc_services.h"
#include "server/status_http.h"
#include "tests/service/fake.h"
#include "tests/service/http.h"
#include "tests/service/process.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::http;
using testing::TempDirectory;
using testing::wait_until;

std::string get(const StatusHttp& status, const std::string& path) {
    return http(status.port(), "GET " + path + " HTTP/1.1\r\nHost: x\r\n\r\n");
}

/// Calls a method of which this test has no proto file, with an empty request.
std::pair<grpc::Status, std::string> call(const GrpcServer& server, const std::string& method) {
    grpc::GenericStub stub(grpc::CreateChannel("127.0.0.1:" + std::to_string(server.port()), grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    grpc::Slice nothing;
    grpc::ByteBuffer request(&nothing, 1), response;
    std::promise<grpc::Status> done;
    stub.UnaryCall(&context, method, {}, &request, &response, [&](grpc::Status status) { done.set_value(std::move(status)); });
    const grpc::Status status = done.get_future().get();
    std::string bytes;
    std::vector<grpc::Slice> slices;
    if (status.ok() && response.Dump(&slices).ok())
        for (const grpc::Slice& slice : slices) bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
    return {status, bytes};
}

/// A HealthCheckResponse with status SERVING, and one with NOT_SERVING.
const std::string kServing = "\x08\x01", kNotServing = "\x08\x02";

TEST(Health, IsThatOfTheHeart) {
    const TempDirectory directory;
    Heartbeat heart;
    const HealthChecks checks = make_health_checks(heart, directory.path, {.silent_seconds = 0.2, .free_bytes = 0});
    heart.beat();
    EXPECT_TRUE(checks.live().ok());
    EXPECT_TRUE(checks.ready().ok());
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    EXPECT_NE(checks.live().message().find("has stood still for"), std::string::npos) << checks.live().message();
    EXPECT_EQ(checks.ready().code(), checks.live().code());
    heart.beat();
    EXPECT_TRUE(checks.live().ok()) << "it goes on";
}

TEST(Health, APulseStopsWithWhatItAsks) {
    Heartbeat heart;
    std::promise<void> gate;
    std::atomic<int> asked{0};
    {
        const Pulse pulse(heart, [&, open = gate.get_future().share()] {
            if (++asked == 2) open.wait();
        });
        ASSERT_TRUE(wait_until(60, [&] { return asked == 2; }));
        const double before = heart.silent_seconds();
        std::this_thread::sleep_for(std::chrono::milliseconds(700));
        EXPECT_GE(heart.silent_seconds(), before + 0.7);
        gate.set_value();
        EXPECT_TRUE(wait_until(60, [&] { return asked >= 3; }));
    }
}

TEST(Health, ADiskWithoutRoomIsNotReady) {
    const TempDirectory directory;
    const Heartbeat heart;
    const HealthChecks full = make_health_checks(heart, directory.path, {.free_bytes = std::numeric_limits<uint64_t>::max()});
    EXPECT_TRUE(full.live().ok()) << "a restart would not help";
    EXPECT_EQ(full.ready().code(), StatusCode::kResourceExhausted);
    EXPECT_NE(full.ready().message().find(directory.path.string()), std::string::npos) << full.ready().message();
    EXPECT_EQ(make_health_checks(heart, directory.path / "gone").ready().code(), StatusCode::kInternal);
}

TEST(Health, IsToldOverHttp) {
    FakeService service;
    std::atomic<bool> live{true}, ready{true};
    const auto status = std::move(StatusHttp::start(*service.coordinator, "127.0.0.1:0",
                                                    {[&] { return live ? Status() : internal_error("stands still"); },
                                                     [&] { return ready ? Status() : internal_error("no room"); }}))
                            .value();
    EXPECT_NE(get(*status, "/healthz").find("200 OK"), std::string::npos);
    EXPECT_NE(get(*status, "/readyz").find("200 OK"), std::string::npos);
    ready = false;
    EXPECT_NE(get(*status, "/healthz").find("200 OK"), std::string::npos);
    EXPECT_NE(get(*status, "/readyz").find("503 Service Unavailable"), std::string::npos);
    EXPECT_NE(get(*status, "/readyz").find("no room\n"), std::string::npos);
    live = false;
    EXPECT_NE(get(*status, "/healthz").find("503 Service Unavailable"), std::string::npos);
    EXPECT_NE(get(*status, "/healthz").find("stands still\n"), std::string::npos);
}

TEST(Health, IsToldOverGrpc) {
    FakeService service;
    std::atomic<bool> ready{true};
    const auto server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0", {.ready = [&] {
                            return ready ? Status() : internal_error("no room");
                        }})).value();
    const auto answer = [&] { return call(*server, "/grpc.health.v1.Health/Check").second; };
    EXPECT_TRUE(wait_until(60, [&] { return answer() == kServing; }));
    ready = false;
    EXPECT_TRUE(wait_until(60, [&] { return answer() == kNotServing; }));
    ready = true;
    EXPECT_TRUE(wait_until(60, [&] { return answer() == kServing; }));
}

TEST(Reflection, IsThereOnRequestOnly) {
    FakeService service;
    for (const bool wanted : {false, true, false}) {
        const auto server =
            std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0", {.reflection = wanted, .ready = {}})).value();
        const grpc::Status status = call(*server, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo").first;
        EXPECT_EQ(status.error_code() == grpc::StatusCode::UNIMPLEMENTED, !wanted) << status.error_message();
    }
}

}  // namespace
}  // namespace lightloom
