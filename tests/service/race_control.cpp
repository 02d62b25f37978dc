// A program that must fail under ThreadSanitizer: two handlers of a gRPC service, or two bodies of a parallel loop, write to
// the same memory without synchronisation. It shows that the suppressions in deploy/tsan.supp, which silence gRPC and TBB
// themselves, do not silence what our code does in their threads. The argument chooses: "plain" stores in handlers, "copy"
// through an intercepted function in handlers, or "bodies" of a loop.

#include <grpcpp/create_channel.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <cstdio>
#include <cstring>
#include <string>
#include <thread>

#include "common/core/fork_join.h"
#include "lightloom/v1/job_service.grpc.pb.h"

namespace lightloom {
namespace {

char racy_bytes[256];
volatile size_t racy_size = sizeof racy_bytes;  // not a constant: the copy must be a call

/// Volatile: a thousand rounds must be as many stores. Two threads that each made a single one at the same instant would both
/// look at the detector's record of it before either had written there, and go unnoticed.
volatile int racy_number = 0;

void racy_plain_store(int round) { racy_number = racy_number + round; }

void racy_copy(int round) {
    char source[sizeof racy_bytes];
    std::memset(source, round, sizeof source);
    std::memcpy(racy_bytes, source, racy_size);
}

class RacyService final : public v1::JobService::Service {
  public:
    explicit RacyService(void (*race)(int)) : race_(race) {}
    grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest*, v1::Job*) override {
        // The handlers meet by relaxed atomics, which order nothing, so that no lock of gRPC comes between the writes.
        arrived_.fetch_add(1, std::memory_order_relaxed);
        while (arrived_.load(std::memory_order_relaxed) < 2) std::this_thread::yield();
        for (int round = 0; round < 1000; ++round) race_(round);
        return grpc::Status::OK;
    }

  private:
    void (*race_)(int);
    std::atomic<int> arrived_{0};
};

bool call(const std::shared_ptr<grpc::Channel>& channel) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::Job response;
    return v1::JobService::NewStub(channel)->GetJob(&context, {}, &response).ok();
}

int run(const std::string& kind) {
    RacyService service(kind == "copy" ? racy_copy : racy_plain_store);
    int port = 0;
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&service);
    const auto server = builder.BuildAndStart();
    if (!server) return 1;
    const auto channel = grpc::CreateChannel("127.0.0.1:" + std::to_string(port), grpc::InsecureChannelCredentials());
    bool first = false, second = false;
    std::thread other([&] { first = call(channel); });
    second = call(channel);
    other.join();
    server->Shutdown();
    std::printf("no report stopped the race; calls answered: %d %d\n", int(first), int(second));
    return 0;
}

/// Bodies of one loop, which meet in the same way; a loop that TBB gave to one thread ends by the clock.
int run_bodies() {
    std::atomic<int> arrived{0};
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    tbb::task_arena arena(2);
    arena.execute([&] {
        fork_join(2, [&](size_t, size_t) {
            arrived.fetch_add(1, std::memory_order_relaxed);
            while (arrived.load(std::memory_order_relaxed) < 2 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
            for (int round = 0; round < 1000; ++round) racy_plain_store(round);
        });
    });
    std::printf("no report stopped the race; bodies run: %d\n", arrived.load());
    return 0;
}

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
    const std::string kind = argc > 1 ? argv[1] : "plain";
    return kind == "bodies" ? lightloom::run_bodies() : lightloom::run(kind);
}
