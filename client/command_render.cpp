// lightloom render: coordinator and workers in this process.

#include <tbb/global_control.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "client/commands.h"
#include "client/local_scene.h"
#include "client/pyramid_render.h"
#include "client/run_job.h"
#include "client/table_options.h"
#include "common/cli/numbers.h"
#include "common/cli/start.h"
#include "server/known_identity.h"
#include "server/local_ports.h"
#include "server/scene_reader.h"
#include "worker/scene_cache.h"

namespace lightloom::client {
namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom render room.pbrt                                  the scene's own Integrator and samples per pixel, to room.exr
  lightloom render room.pbrt -o out.exr --png out.png --algorithm bdpt --spp 64
  lightloom render room.pbrt --time 60                        stop after a minute of learning and rendering
  lightloom render room.pbrt --noise 0.01                     stop when the estimated relMSE is 0.01
  lightloom render room.pbrt --spp 4 --resolution 320x180     a quick look
  lightloom render room.pbrt --pyramid -o room-techniques --resolution 320x180   which technique gives what

The same job submitted to a service (`lightloom submit`) gives a file with the same SHA-256.)";

/// A directory that goes with the object.
struct ScratchDirectory {
    std::filesystem::path path;
    ScratchDirectory() {
        std::string name = (std::filesystem::temp_directory_path() / "lightloom-XXXXXX").string();
        if (::mkdtemp(name.data())) path = name;
    }
    ~ScratchDirectory() {
        std::error_code ignored;
        if (!path.empty()) std::filesystem::remove_all(path, ignored);
    }
};

int render(const JobOptions& options, uint32_t threads, uint32_t worker_count, const TableCacheOptions& cache) {
    (void)interrupt_token();
    auto local = read_job(options, [&](const LocalScene& scene) {
        return check_outputs(options, beside_image(options, AfterFetch::kImageGoes), &scene);
    });
    if (!local.ok()) return report_error(local.status());
    LocalScene& scene = local->scene;
    const JobSpec& spec = local->spec;
    if (Status s = check_bound(options, spec); !s.ok()) return report_error(s);
    const auto facts = scene_facts(scene.imported.description, spec);
    if (!facts.ok()) return report_error(facts.status());
    const ScratchDirectory scratch;
    if (scratch.path.empty()) return report_error(internal_error("no directory for temporary files can be made"));

    const tbb::global_control parallelism(tbb::global_control::max_allowed_parallelism, threads * worker_count);
    const auto identity = known_identity(cache.path());
    if (!identity.ok()) return report_error(identity.status());
    CoordinatorOptions coordinator_options;
    coordinator_options.directory = scratch.path;
    coordinator_options.identity = *identity;
    coordinator_options.scene_files_needed = false;
    coordinator_options.no_other_workers = true;
    // Everybody in this process shares the one scene; it is built when somebody asks for it. A build takes the description
    // over, so its failure is final: a second attempt would build and render an empty scene.
    std::mutex build_mutex;
    std::optional<Result<std::shared_ptr<const Scene>>> built_scene;
    const auto build_scene = [&]() -> Result<std::shared_ptr<const Scene>> {
        const std::lock_guard only_one(build_mutex);
        if (!built_scene) {
            auto built = Scene::build(std::move(scene.imported.description), scene_options(spec));
            if (built.ok()) {
                built_scene = std::shared_ptr<const Scene>(std::move(built).value());
            } else {
                built_scene = built.status();
            }
        }
        return *built_scene;
    };
    coordinator_options.read_scene = [&](const AssetStore&, const JobSpec&, std::stop_token) {
        auto answer = facts;
        answer->build_scene = build_scene;
        return answer;
    };
    coordinator_options.table_cache = cache.path();
    coordinator_options.table_cache_bytes = cache.bytes();
    // A worker of this process cannot get lost, but its machine may be suspended.
    coordinator_options.lease_seconds = 3600;
    Coordinator coordinator(std::move(coordinator_options));
    LocalJobPort jobs(coordinator);
    LocalWorkerPort work(coordinator);
    if (Status s = jobs.upload_bytes(spec.scene_root, scene.manifest.canonical_text()); !s.ok()) return report_error(s);

    RendererCache renderers([&](const JobSpec&, std::stop_token) { return build_scene(); }, direct_tables(work));
    std::vector<std::unique_ptr<Worker>> workers;
    std::vector<std::jthread> running;
    for (uint32_t i = 0; i < worker_count; ++i) {
        workers.push_back(std::make_unique<Worker>(
            work,
            WorkerOptions{.identity = *identity, .thread_count = threads, .host = "embedded", .process_id = uint64_t(::getpid())},
            renderers.renderer_source(), renderers.tracer_source()));
        running.emplace_back([worker = workers.back().get()](std::stop_token stop) { (void)worker->run(stop); });
    }
    ClientTimes times{.import_seconds = scene.import_seconds, .digest_seconds = scene.digest_seconds};
    const auto begin = std::chrono::steady_clock::now();
    const auto job = submit(jobs, spec);
    if (!job.ok()) return report_error(job.status());
    const auto ended = watch(jobs, job->job_id, options.quiet, true);
    times.wait_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    for (std::jthread& thread : running) thread.request_stop();
    running.clear();
    if (!ended.ok()) return report_error(ended.status());
    return fetch(jobs, *ended, options, times, AfterFetch::kImageGoes);
}

}  // namespace

void add_render_command(cli::App app, int* exit_code) {
    struct Options {
        JobOptions job;
        uint32_t threads = 0, workers = 1;
        TableCacheOptions cache;
        PyramidOptions pyramid;
    };
    auto options = std::make_shared<Options>();
    const cli::App command = app.add_subcommand("render", "Render a scene on this machine");
    command->footer(kFooter);
    add_render_settings(*command, options->job);
    add_output_settings(*command, options->job);
    command->add_option("-t,--threads", options->threads, "Threads of each worker (default: all processors, shared out)")
        ->type_name("N")
        ->check(whole_number_between(1, 1024));
    command->add_option("--workers", options->workers, "Workers in this process; the image's bytes do not depend on it")
        ->type_name("N")
        ->check(whole_number_between(1, 256))
        ->capture_default_str();
    add_table_cache_options(*command, options->cache);
    add_pyramid_options(*command, options->pyramid);
    command->callback([options, exit_code, pyramid = command->get_option("--pyramid")] {
        options->pyramid.wanted = pyramid->count() > 0;
        if (const Status s = settle_pyramid_options(options->job, options->pyramid); !s.ok()) {
            *exit_code = report_error(s);
            return;
        }
        uint32_t threads = options->threads;
        if (threads == 0) threads = std::max(1u, processor_count() / options->workers);
        *exit_code = options->pyramid.wanted ? render_pyramid(options->job, options->pyramid, threads, options->cache)
                                             : render(options->job, threads, options->workers, options->cache);
    });
}

}  // namespace lightloom::client
