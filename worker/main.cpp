// lightloom-worker: renders units for a coordinator.

#include <tbb/global_control.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <stop_token>

#include "common/cli/command_line.h"
#include "common/cli/completion.h"
#include "common/cli/log.h"
#include "common/cli/log_line.h"
#include "common/cli/numbers.h"
#include "common/cli/start.h"
#include "common/work/channel.h"
#include "common/work/identity.h"
#include "worker/fetching_worker.h"
#include "worker/grpc_worker_port.h"

namespace {

std::filesystem::path default_cache() {
    if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache) return std::filesystem::path(cache) / "lightloom";
    if (const char* home = std::getenv("HOME"); home && *home) return std::filesystem::path(home) / ".cache" / "lightloom";
    return std::filesystem::temp_directory_path() / "lightloom-cache";
}

std::string host_name() {
    char name[256] = {};
    return ::gethostname(name, sizeof name - 1) == 0 ? name : "unknown";
}

constexpr const char* kFooter = R"(A worker calls its coordinator and listens on no port, so start as many as you like,
wherever you like:

  lightloom-worker --server render1:50051
  lightloom-worker --server render1:50051 --threads 8

It must be the same build as the coordinator's; a worker that would render other bytes is refused and says why. SIGTERM
or Ctrl-C finishes the unit in work, then leaves.

Exit codes: 0 stopped as asked, 1 refused by the coordinator or failed, 2 bad command line.)";

}  // namespace

int main(int argc, char** argv) {
    using namespace lightloom;
    cli::Program app{"Renders work units for a Lightloom coordinator.", "lightloom-worker"};
    app.footer(kFooter);
    std::string server = "127.0.0.1:50051", level = "info", golden_override;
    std::string cache = default_cache().string();
    uint32_t threads = processor_count();
    uint64_t cache_mib = 0;
    app.add_option("--server", server, "The coordinator")->type_name("HOST:PORT")->capture_default_str();
    app.add_option("-t,--threads", threads, "Threads to render with (default: all processors)")
        ->type_name("N")
        ->check(whole_number_between(1, 1024));
    app.add_option("--cache", cache,
                   "Directory for scene files, and for tables up to 1 GiB; may be shared by the workers of a host "
                   "(default: lightloom in $XDG_CACHE_HOME or ~/.cache)")
        ->type_name("DIR");
    app.add_option("--cache-limit", cache_mib,
                   "MiB of scene files in it, above which those used least recently are removed; 0 is no limit")
        ->type_name("MIB")
        ->check(whole_number_between(0, uint64_t(1) << 40))
        ->capture_default_str();
    add_log_option(app, level);
    add_completion_option(app);
    add_version_option(app, kBuildId);
    app.add_option("--pretend-golden-digest", golden_override, "")->group("");  // for tests of the refusal
    if (const auto ended = parse_and_log(app, argc, argv, level)) return *ended;
    std::stop_source stop;
    const auto leave = [stop]() mutable {
        log_info("stopping: no new units, the running one is finished");
        stop.request_stop();
    };
    StopSignals().on_stop(leave, kFailedToRun);

    const tbb::global_control parallelism(tbb::global_control::max_allowed_parallelism, threads);
    auto identity = build_identity();
    if (!identity.ok()) return report_failure(identity.status(), kNoIdentity);
    if (!golden_override.empty()) {
        const auto digest = Digest::from_hex(golden_override);
        if (!digest.ok()) {
            print_error("--pretend-golden-digest: " + digest.status().message());
            return kBadCommandLine;
        }
        identity->golden_digest = *digest;
    }
    GrpcWorkerPort port(open_channel(server));
    FetchingWorker worker(port, cache,
                          {.identity = *identity, .thread_count = threads, .host = host_name(), .process_id = uint64_t(::getpid())},
                          {.scenes = cache_mib << 20});
    if (const Status usable = worker.check_directory(); !usable.ok()) return report_failure(usable, "--cache ");
    const Status status = worker.run(stop.get_token());
    return status.ok() ? kStopped : report_failure(status);
}
