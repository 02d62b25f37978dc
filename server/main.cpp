// lightloom-server: the coordinator as a process.

#include <tbb/global_control.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <thread>

#include "common/cli/command_line.h"
#include "common/cli/completion.h"
#include "common/cli/log.h"
#include "common/cli/log_line.h"
#include "common/cli/numbers.h"
#include "common/cli/start.h"
#include "common/core/atomic_file.h"
#include "common/core/large_blocks.h"
#include "common/work/identity.h"
#include "server/collection.h"
#include "server/data_lock.h"
#include "server/grpc_services.h"
#include "server/health.h"
#include "server/host_port.h"
#include "server/local_ports.h"
#include "server/scene_reader.h"
#include "server/status_http.h"
#include "worker/fetching_worker.h"

namespace lightloom {
namespace {

constexpr const char* kFooter = R"(Start a coordinator, then workers that point to it, then submit:

  lightloom-server --data /var/lib/lightloom
  lightloom-worker --server 127.0.0.1:50051
  lightloom submit scene.pbrt --server 127.0.0.1:50051 -o scene.exr

With --threads it also works itself, so that it learns tables and renders without anybody else.

Connections are plain text without authentication, so other than loopback addresses need --allow-plaintext: use it only
in a network in which everybody may render.

Exit codes: 0 stopped as asked, 1 failed to start, 2 bad command line.)";

/// A worker inside the coordinator's process. It ends with its owner, after the unit that it renders.
class OwnWorker {
  public:
    OwnWorker(Coordinator& coordinator, const BuildIdentity& identity, uint32_t threads, const std::filesystem::path& cache)
        : parallelism_(tbb::global_control::max_allowed_parallelism, threads),
          port_(coordinator),
          worker_(port_, cache,
                  {.identity = identity, .thread_count = threads, .host = "coordinator", .process_id = uint64_t(::getpid())}),
          thread_([this](std::stop_token stop) {
              if (const Status s = worker_.run(stop); !s.ok()) log_error("the coordinator's own worker: {}", s.message());
          }) {}

  private:
    tbb::global_control parallelism_;
    LocalWorkerPort port_;
    FetchingWorker worker_;
    std::jthread thread_;
};

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
    using namespace lightloom;
    give_back_large_blocks();
    cli::Program app{"The coordinator of Lightloom: accepts jobs, leases their units to workers and merges the results.",
                     "lightloom-server"};
    app.footer(kFooter);
    std::string listen = "127.0.0.1:50051", data = "lightloom-data", status = "127.0.0.1:9464", level = "info", port_file;
    double lease = 10, keep_days = 0;
    uint32_t threads = 0;
    uint64_t table_cache_mib = 4096, disk_limit_mib = 0;
    bool plaintext = false, reflection = false;
    std::optional<uint64_t> shuffle, checkpoint_mib;
    app.add_option("--listen", listen, "Where clients and workers connect; port 0 picks a free one; unix:PATH is a socket file")
        ->type_name("HOST:PORT")
        ->capture_default_str();
    app.add_option("--data", data,
                   "Directory for jobs and the results of their units (store/), scene files, images, the tables that running jobs "
                   "read (assets/, removed with the last such job) and the table cache (tables/)")
        ->type_name("DIR")
        ->capture_default_str();
    app.add_option("--status", status, "Where the status page is (/healthz, /readyz, /api/v1/status), or off")
        ->type_name("HOST:PORT")
        ->capture_default_str();
    app.add_option("--lease", lease, "Seconds without a heartbeat after which a unit goes to another worker")
        ->type_name("SECONDS")
        ->check(number_between(0.2, 3600))
        ->capture_default_str();
    app.add_option("-t,--threads", threads,
                   "Threads with which the coordinator itself traces and renders; 0 leaves that to workers")
        ->type_name("N")
        ->check(whole_number_between(0, 1024))
        ->capture_default_str();
    app.add_option("--table-cache-size", table_cache_mib,
                   "MiB of the table cache: learned tables that later jobs find again, also after a restart; those used "
                   "least recently go first; 0 keeps none")
        ->type_name("MIB")
        ->check(whole_number_between(0, uint64_t(1) << 30))
        ->capture_default_str();
    app.add_option("--keep-days", keep_days,
                   "Remove images of jobs, and scene files, that have not been used for so many days; 0 keeps them")
        ->type_name("DAYS")
        ->check(number_between(0, 36500))
        ->capture_default_str();
    app.add_option("--disk-limit", disk_limit_mib,
                   "MiB of images and scene files, above which those used longest ago are removed; what a job needs, or what is "
                   "younger than an hour, stays; 0 is no limit")
        ->type_name("MIB")
        ->check(whole_number_between(0, uint64_t(1) << 40))
        ->capture_default_str();
    app.add_option("--port-file", port_file,
                   "File for \"GRPC_PORT STATUS_PORT\", written once both listen (a unix: socket has port 0)")
        ->type_name("FILE");
    app.add_flag("--allow-plaintext", plaintext, "Let --listen and --status name other than loopback addresses");
    app.add_flag("--reflection", reflection, "Let grpcurl and its like list the calls");
    add_log_option(app, level);
    add_completion_option(app);
    add_version_option(app, kBuildId);
    app.add_option("--shuffle-leases", shuffle, "")->group("")->check(whole_number());  // tests: lease units in a random order
    // Tests: more checkpoints than there would be.
    app.add_option("--checkpoint-after", checkpoint_mib, "")->group("")->check(whole_number_between(0, uint64_t(1) << 30));
    if (const auto ended = parse_and_log(app, argc, argv, level)) return *ended;
    for (const auto& [option, address] : {std::pair{"--listen", &listen}, {"--status", &status}}) {
        if ((address == &status && status == "off") || (address == &listen && listen.starts_with("unix:"))) continue;
        const auto parsed = parse_host_port(*address, option);
        if (!parsed.ok()) {
            print_error(parsed.status().message());
            return kBadCommandLine;
        }
        if (!plaintext && !is_loopback(*parsed)) {
            print_error("refusing to listen beyond loopback without --allow-plaintext: connections have no protection");
            return kBadCommandLine;
        }
    }
    const StopSignals signals;
    const auto identity = build_identity();
    if (!identity.ok()) return report_failure(identity.status(), kNoIdentity);
    CoordinatorOptions options;
    options.directory = data;
    options.identity = *identity;
    options.read_scene = make_scene_reader(std::filesystem::path(data) / "scratch");
    options.lease_seconds = lease;
    options.heartbeat_seconds = std::min(1.0, lease / 4);
    options.shuffle_seed = shuffle;
    if (checkpoint_mib) options.checkpoint_bytes = *checkpoint_mib << 20;
    if (table_cache_mib > 0) options.table_cache = std::filesystem::path(data) / "tables";
    options.table_cache_bytes = table_cache_mib << 20;
    std::error_code error;
    std::filesystem::create_directories(data, error);
    if (error) return report_failure(internal_error(error.message()), data + ": ");
    const auto lock = DataLock::take(data);
    if (!lock.ok()) return report_failure(lock.status());
    auto store = JobStore::open({.directory = std::filesystem::path(data) / "store"});
    if (!store.ok()) return report_failure(store.status());
    Heartbeat heart;
    options.beat = [&heart] { heart.beat(); };
    Coordinator coordinator(std::move(options), *std::move(store));
    if (!coordinator.restored().ok()) return report_failure(coordinator.restored(), data + ": ");
    HealthChecks health = make_health_checks(heart, data);
    health.ready = [&coordinator, disk = health.ready]() -> Status {
        LL_RETURN_IF_ERROR(disk());
        return coordinator.room();
    };
    auto server = GrpcServer::start(coordinator, listen, {.reflection = reflection, .ready = health.ready});
    if (!server.ok()) return report_failure(server.status());
    std::unique_ptr<StatusHttp> http;
    if (status != "off") {
        auto started = StatusHttp::start(coordinator, status, health);
        if (!started.ok()) {
            const int failed = report_failure(started.status());
            return started.status().code() == StatusCode::kInvalidArgument ? kBadCommandLine : failed;
        }
        http = std::move(started).value();
    }
    const auto in_use = [&coordinator] {
        InUse used;
        std::set<Digest> scenes;
        for (const JobInfo& job : coordinator.list_jobs()) {
            if (is_terminal(job.state)) continue;
            used.jobs.insert(job.job_id);
            scenes.insert(job.spec.scene_root);
        }
        used.assets.merge(coordinator.pinned_tables());
        used.assets.merge(files_of_scenes(coordinator.assets(), scenes));
        return used;
    };
    const Collector collector(data, {.keep_days = keep_days, .disk_limit = disk_limit_mib << 20}, in_use);
    std::optional<OwnWorker> own;
    if (threads > 0) own.emplace(coordinator, *identity, threads, std::filesystem::path(data) / "worker");
    const bool tcp = !listen.starts_with("unix:");
    log_info("build {}, listening on {}, status on port {}", identity->build_id,
             tcp ? "port " + std::to_string((*server)->port()) : listen, http ? http->port() : 0);
    if (!port_file.empty()) {
        const std::string ports =
            std::to_string(tcp ? (*server)->port() : 0) + " " + std::to_string(http ? http->port() : 0) + "\n";
        if (const Status written = write_file_atomically(port_file, ports); !written.ok()) return report_failure(written);
    }
    signals.wait();
    log_info("stopping");
    return kStopped;
}
