// What workers that have nothing to do cost the coordinator: its processor time while so many of them wait for a unit.
//
//   idle_workers PORT PID [WORKERS [SECONDS]]       a coordinator on 127.0.0.1:PORT, whose process is PID; default: 1000, 20

#include <grpcpp/create_channel.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/cli/log.h"
#include "common/work/identity.h"
#include "worker/grpc_worker_port.h"
#include "worker/worker.h"

namespace {

using namespace lightloom;

/// Seconds of processor time, of all threads.
double processor_seconds(const std::string& process) {
    std::ifstream in("/proc/" + process + "/stat");
    std::string text((std::istreambuf_iterator<char>(in)), {});
    // Fields 14 and 15; the name in field 2 may hold spaces.
    const size_t name_end = text.rfind(')');
    unsigned long user = 0, system = 0;
    if (name_end == std::string::npos ||
        std::sscanf(text.c_str() + name_end + 2, "%*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", &user, &system) != 2) {
        std::fprintf(stderr, "idle_workers: there is no process %s\n", process.c_str());
        std::exit(1);
    }
    return double(user + system) / double(::sysconf(_SC_CLK_TCK));
}

/// A worker with a connection of its own, as on a host of its own.
struct IdleWorker {
    IdleWorker(const std::string& server, const BuildIdentity& identity, uint64_t number)
        : port([&] {
              grpc::ChannelArguments arguments;
              arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
              return grpc::CreateCustomChannel(server, grpc::InsecureChannelCredentials(), arguments);
          }()),
          worker(
              port, {.identity = identity, .thread_count = 1, .host = "idle", .process_id = number},
              [](const UnitLease&, std::stop_token) -> Result<std::shared_ptr<const Renderer>> { return internal_error("idle"); },
              [](const UnitLease&, std::stop_token) -> Result<TrainingTracer> { return internal_error("idle"); }),
          thread([this](std::stop_token stop) { (void)worker.run(stop); }) {}

    GrpcWorkerPort port;
    Worker worker;
    std::jthread thread;
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        std::fprintf(stderr, "usage: idle_workers PORT PID [WORKERS [SECONDS]]\n");
        return 2;
    }
    const std::string server = std::string("127.0.0.1:").append(argv[1]), process = argv[2];
    const int count = argc > 3 ? std::atoi(argv[3]) : 1000, seconds = argc > 4 ? std::atoi(argv[4]) : 20;
    set_up_logging("idle_workers", "error");
    const auto identity = build_identity();
    if (!identity.ok()) {
        std::fprintf(stderr, "idle_workers: %s\n", identity.status().message().c_str());
        return 1;
    }
    std::vector<std::unique_ptr<IdleWorker>> workers;
    for (int i = 0; i < count; ++i) workers.push_back(std::make_unique<IdleWorker>(server, *identity, uint64_t(i)));
    std::this_thread::sleep_for(std::chrono::seconds(10));  // until all have registered
    const double before = processor_seconds(process);
    std::this_thread::sleep_for(std::chrono::seconds(seconds));
    const double share = (processor_seconds(process) - before) / seconds;
    std::printf("%d idle workers: the coordinator takes %.1f %% of a processor\n", count, 100 * share);
    for (auto& worker : workers) worker->thread.request_stop();
}
