// Workers against a coordinator in process and over gRPC on loopback, with fake light.

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include "client/grpc_job_port.h"
#include "server/grpc_services.h"
#include "server/host_port.h"
#include "server/status_http.h"
#include "tests/service/fake.h"
#include "tests/service/forwarding_port.h"
#include "tests/service/http.h"
#include "worker/grpc_worker_port.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::http;

/// Workers that run until the object goes.
class Crew {
  public:
    void add(WorkerPort& port, const BuildIdentity& identity, uint32_t threads, double seconds_per_unit) {
        workers_.push_back(std::make_unique<Worker>(
            port, WorkerOptions{.identity = identity, .thread_count = threads, .host = "h", .process_id = workers_.size()},
            testing::fake_renderers(seconds_per_unit), testing::no_tracers()));
        threads_.emplace_back([w = workers_.back().get()](std::stop_token stop) { EXPECT_TRUE(w->run(stop).ok()); });
    }
    ~Crew() {
        for (std::jthread& t : threads_) t.request_stop();
    }

  private:
    std::vector<std::unique_ptr<Worker>> workers_;
    std::vector<std::jthread> threads_;
};

Digest run(uint32_t workers, uint32_t threads, bool over_grpc, std::optional<uint64_t> shuffle) {
    FakeService service({40, 30, {0, 0, 40, 30}}, shuffle);
    std::unique_ptr<GrpcServer> server;
    std::vector<std::unique_ptr<WorkerPort>> ports;
    Crew crew;
    if (over_grpc) server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    for (uint32_t i = 0; i < workers; ++i) {
        if (over_grpc) {
            ports.push_back(std::make_unique<GrpcWorkerPort>(
                grpc::CreateChannel("127.0.0.1:" + std::to_string(server->port()), grpc::InsecureChannelCredentials())));
        } else {
            ports.push_back(std::make_unique<LocalWorkerPort>(*service.coordinator));
        }
        crew.add(*ports.back(), service.identity, threads, 0.001);
    }
    const std::string id = service.submit(service.spec(60));
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    return info.image_digest;
}

TEST(Workers, BytesDoNotDependOnWhoRendersWhatAndHow) {
    const Digest reference = run(1, 1, false, std::nullopt);
    for (const uint32_t workers : {1u, 2u, 3u, 8u}) {
        EXPECT_EQ(run(workers, 2, false, std::nullopt), reference) << workers;
        EXPECT_EQ(run(workers, 1, true, workers), reference) << workers << " over gRPC, shuffled";
    }
}

/// The coordinator refuses a result, and before the worker hears of it, its heartbeat takes the unit back.
class RefusingPort final : public testing::ForwardingPort {
  public:
    using ForwardingPort::ForwardingPort;
    Result<SubmitAck> submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                    double seconds) override {
        if (++results % 4 != 1) return port_.submit_result(worker_id, lease, std::move(partial), seconds);
        EXPECT_TRUE(port_.release_unit(worker_id, lease.reference(), {StatusCode::kDataLoss, "nonsense"}).ok());
        EXPECT_TRUE(port_.heartbeat(worker_id, {{lease.reference(), true}}).ok());
        return SubmitAck{SubmitOutcome::kRejected, "nonsense"};
    }
    std::atomic<int> results{0};
};

TEST(Workers, AUnitWhoseResultWasRefusedIsNotKept) {
    FakeService service;  // its clock stands still: a unit that somebody keeps is never leased again
    LocalWorkerPort local(*service.coordinator);
    RefusingPort port(local);
    Crew crew;
    crew.add(port, service.identity, 1, 0.001);
    const JobInfo info = service.wait_end(service.submit(service.spec(12)));
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_GT(port.results.load(), 4);
}

TEST(Workers, JobPortOverGrpcDoesAllThatAClientNeeds) {
    FakeService service;
    const auto server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    const auto channel = grpc::CreateChannel("127.0.0.1:" + std::to_string(server->port()), grpc::InsecureChannelCredentials());
    GrpcJobPort jobs(channel);
    const std::string big(3 << 20, 'x');
    const Digest digest = sha256(big);
    ASSERT_EQ(jobs.find_missing({digest, service.root})->size(), 1u);
    ASSERT_TRUE(jobs.upload_bytes(digest, big).ok());
    ASSERT_TRUE(jobs.upload_bytes(digest, big).ok()) << "a second time is a no-op";
    EXPECT_TRUE(jobs.find_missing({digest})->empty());

    GrpcWorkerPort port(channel);
    std::string back;
    ASSERT_TRUE(port.read_asset(digest, 5, [&](std::string_view b) { return back += b, Status(); }).ok());
    EXPECT_EQ(back.size(), big.size() - 5);
    EXPECT_EQ(port.read_asset(sha256("none"), 0, [](std::string_view) { return Status(); }).code(), StatusCode::kNotFound);

    Crew crew;
    crew.add(port, service.identity, 1, 0.001);
    const auto job = jobs.submit_job("r", service.spec(10), {});
    ASSERT_TRUE(job.ok()) << job.status().message();
    JobInfo last;
    ASSERT_TRUE(jobs.watch_job(job->job_id, [&](const JobInfo& j) { last = j; }, {}).ok());
    EXPECT_EQ(last.state, JobState::kSucceeded);
    const auto image = jobs.image(job->job_id, ImageKind::kFinal);
    ASSERT_TRUE(image.ok());
    EXPECT_EQ(sha256(*image), last.image_digest);
    EXPECT_TRUE(jobs.image(job->job_id, ImageKind::kPreview)->starts_with("\x89PNG"));
    EXPECT_NE(jobs.manifest(job->job_id)->find(last.image_digest.hex()), std::string::npos);
    EXPECT_EQ(jobs.list_jobs()->size(), 1u);
    EXPECT_EQ(jobs.get_job("nope").status().code(), StatusCode::kNotFound);
    std::stop_source stop;
    stop.request_stop();
    EXPECT_EQ(jobs.watch_job(
                      "nope", [](const JobInfo&) {}, stop.get_token())
                  .code(),
              StatusCode::kCancelled);
}

TEST(StatusPage, AnswersGetAndSurvivesNonsense) {
    FakeService service;
    const auto status = std::move(StatusHttp::start(*service.coordinator, "127.0.0.1:0")).value();
    const std::string id = service.submit(service.spec(4));
    service.add_worker();
    const auto get = [&](const std::string& path) { return http(status->port(), "GET " + path + " HTTP/1.1\r\nHost: x\r\n\r\n"); };
    EXPECT_NE(get("/healthz").find("200 OK"), std::string::npos);
    const std::string json = get("/api/v1/status");
    EXPECT_NE(json.find(id), std::string::npos);
    EXPECT_NE(json.find("\"units_total\": 4"), std::string::npos) << json;
    EXPECT_NE(get("/nope").find("404"), std::string::npos);
    EXPECT_NE(http(status->port(), "POST /healthz HTTP/1.1\r\nHost: x\r\n\r\n").find("405"), std::string::npos);
    EXPECT_EQ(http(status->port(), "GET /" + std::string(20000, 'a') + " HTTP/1.1\r\n\r\n").find("200"), std::string::npos);
    EXPECT_EQ(http(status->port(), "\x01\x02nonsense\r\n\r\n").find("200"), std::string::npos);
    EXPECT_NE(get("/healthz").find("200 OK"), std::string::npos);
    EXPECT_EQ(StatusHttp::start(*service.coordinator, "nonsense").status().code(), StatusCode::kInvalidArgument);
}

TEST(Addresses, AreHostsAndPortsAndNothingElse) {
    for (const char* wrong : {"", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:8x", "::1:80",
                              "[127.0.0.1]:80", ":80", "[localhost]:80"})
        EXPECT_FALSE(parse_host_port(wrong, "--x").ok()) << wrong;
    for (const auto& [text, loopback] : {std::pair{"127.0.0.1:0", true},
                                         {"localhost:65535", true},
                                         {"[::1]:80", true},
                                         {"127.1.2.3:80", true},
                                         {"127.example:80", false},
                                         {"host:80", false},
                                         {"0.0.0.0:80", false},
                                         {"[::]:80", false},
                                         {"10.0.0.1:80", false}})
        EXPECT_EQ(is_loopback(*parse_host_port(text, "--x")), loopback) << text;
}

TEST(Workers, AStoppedWorkerFinishesOrReleasesAndOthersGoOn) {
    FakeService service;
    LocalWorkerPort port(*service.coordinator);
    const std::string id = service.submit(service.spec(40));
    {
        Crew first;
        first.add(port, service.identity, 1, 0.02);
        service.wait(id, [](const JobInfo& j) { return j.unit_done > 3; });
    }
    EXPECT_EQ(service.coordinator->get_job(id)->unit_leased, 0u) << "nothing is left behind";
    Crew second;
    second.add(port, service.identity, 1, 0.001);
    EXPECT_EQ(service.wait_end(id).state, JobState::kSucceeded);
}

TEST(Workers, CancellingAJobStopsTheUnitInWork) {
    FakeService service;
    LocalWorkerPort port(*service.coordinator);
    Crew crew;
    crew.add(port, service.identity, 1, 30);
    const std::string id = service.submit(service.spec(4));
    service.wait(id, [](const JobInfo& j) { return j.unit_leased > 0; });
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
    const auto begin = std::chrono::steady_clock::now();
    const std::string next = service.submit(service.spec(4));
    service.wait(next, [](const JobInfo& j) { return j.unit_leased > 0; });
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(4));
    ASSERT_TRUE(service.coordinator->cancel_job(next).ok());
}

}  // namespace
}  // namespace lightloom
