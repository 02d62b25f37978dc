#include "client/local_scene.h"

#include "common/cli/numbers.h"
#include "common/cli/start.h"

namespace lightloom::client {

Result<LocalJob> read_job(const JobOptions& options, const SceneCheck& check) {
    auto scene = load_scene(options);
    if (!scene.ok()) return scene.status();
    if (check) LL_RETURN_IF_ERROR(check(*scene));
    auto spec = make_spec(options, *scene);
    if (!spec.ok()) return spec.status();
    return LocalJob{*std::move(scene), *std::move(spec)};
}

Result<BuiltJob> build_job(const JobOptions& options, uint32_t threads, const SceneCheck& check) {
    auto job = read_job(options, check);
    if (!job.ok()) return job.status();
    SceneDescription& description = job->scene.imported.description;
    BuiltJob built{.spec = std::move(job->spec), .response = description.film.response};
    if (built.spec.max_depth < 0) built.spec.max_depth = description.max_depth;
    built.thread_limit = std::make_unique<const tbb::global_control>(tbb::global_control::max_allowed_parallelism, threads);
    auto scene = Scene::build(std::move(description), scene_options(built.spec));
    if (!scene.ok()) return scene.status();
    built.scene = std::move(scene).value();
    built.spec.frame = built.scene->frame();
    built.files = std::move(job->scene);
    return built;
}

void add_threads_option(cli::App command, uint32_t& threads) {
    threads = processor_count();
    command.add_option("-t,--threads", threads, "Threads to render with (default: all processors)")
        ->type_name("N")
        ->check(whole_number_between(1, 1024));
}

}  // namespace lightloom::client
