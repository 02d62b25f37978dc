#pragma once
// What the commands that render in this process do before they render: read the scene, settle the job, build the scene.

#include <tbb/global_control.h>

#include <functional>
#include <memory>

#include "client/job_options.h"
#include "common/cli/command_line.h"
#include "common/scene/scene.h"

namespace lightloom::client {

/// Looks at the scene as soon as it was read: whether an output would overwrite one of its files, for example.
using SceneCheck = std::function<Status(const LocalScene&)>;

/// A scene that was read, and the job that the options ask for.
struct LocalJob {
    LocalScene scene;
    JobSpec spec;
};
Result<LocalJob> read_job(const JobOptions& options, const SceneCheck& check = {});

/// The same with the scene built.
struct BuiltJob {
    /// Of this process as long as the object lives. Declared first, so that it outlives the scene.
    std::unique_ptr<const tbb::global_control> thread_limit;
    std::shared_ptr<const Scene> scene;
    JobSpec spec;      ///< With the frame, and with the scene's depth where the options leave it open.
    LocalScene files;  ///< Of the scene, for those who send it; its description has become the scene.
    FilmResponse response;
};
Result<BuiltJob> build_job(const JobOptions& options, uint32_t threads, const SceneCheck& check = {});

/// -t, --threads of such a command; all processors by default.
void add_threads_option(cli::App command, uint32_t& threads);

}  // namespace lightloom::client
