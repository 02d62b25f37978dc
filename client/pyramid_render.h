#pragma once
// lightloom render --pyramid: the units of the job that `render` would run, rendered here so that every contribution is seen.

#include "client/table_options.h"
#include "common/cli/command_line.h"

namespace lightloom::client {

struct PyramidOptions {
    bool wanted = false;
    std::string directory;  ///< After settle_pyramid_options() not empty where one is wanted.
    int depth = 8;          ///< Longest paths with pictures of their own.
};

/// Samples per pixel where --spp is not given: to show a pyramid takes every contribution on one thread per unit.
inline constexpr uint32_t kPyramidSamples = 16;

/// --pyramid and --pyramid-depth, which take the place of the other outputs.
void add_pyramid_options(cli::App command, PyramidOptions& options);
/// Takes the folder from -o where --pyramid names none. kInvalidArgument where both name one, or neither.
Status settle_pyramid_options(JobOptions& job, PyramidOptions& pyramid);
/// Renders and writes the directory. The exit code.
int render_pyramid(JobOptions options, const PyramidOptions& pyramid, uint32_t threads, const TableCacheOptions& cache);

}  // namespace lightloom::client
