#include "client/pyramid_render.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <utility>

#include "client/commands.h"
#include "client/local_scene.h"
#include "client/pyramid.h"
#include "client/run_job.h"
#include "common/cli/command_line.h"
#include "common/cli/numbers.h"
#include "common/core/fork_join.h"
#include "common/film/grouped_sum.h"
#include "common/work/identity.h"

namespace lightloom::client {
namespace {

/// A unit of the plan with what the pyramid must know of its group.
struct PlannedUnit {
    WorkUnit unit;
    uint32_t group_iterations = 0;
    uint64_t group_light_paths = 0;
    bool first = false, last = false;  ///< Of its group.
};

std::vector<PlannedUnit> plan_units(const Plan& plan, uint64_t iterations) {
    std::vector<PlannedUnit> planned;
    for (const Group& group : plan.groups_for(iterations)) {
        const std::vector<WorkUnit> units = plan.units(group);
        uint64_t light_paths = 0;
        for (const WorkUnit& unit : units) light_paths += unit.render.light_path_count;
        for (const WorkUnit& unit : units)
            planned.push_back({unit, group.iteration_count, light_paths, &unit == &units.front(), &unit == &units.back()});
    }
    return planned;
}

/// What comes of watching one unit.
struct Watched {
    UnitPictures pictures;
    std::optional<Result<Partial>> partial;
};

/// How many samples are done, on a terminal.
class ShownProgress {
  public:
    ShownProgress(bool quiet, uint64_t samples) : shown_(!quiet && ::isatty(2)), samples_(samples) {}
    ~ShownProgress() {
        if (shown_) std::fprintf(stderr, "\r\033[K");
    }
    void show(uint64_t done) const {
        if (shown_)
            std::fprintf(stderr, "\r%llu of %llu spp", static_cast<unsigned long long>(done),
                         static_cast<unsigned long long>(samples_));
    }

  private:
    bool shown_;
    uint64_t samples_;
};

/// Both the image and its pyramid.
Status watch_units(const BuiltJob& job, const Renderer& renderer, uint32_t threads, bool quiet, Pyramid* pyramid,
                   GroupedSum* image) {
    const FrameLayout& frame = job.spec.frame;
    const std::vector<PlannedUnit> units = plan_units(Plan(frame, job.spec.algorithm), job.spec.samples_per_pixel);
    const ShownProgress progress(quiet, job.spec.samples_per_pixel);
    // Units are added in their order, whoever is done first, so that the files do not depend on the number of threads.
    for (size_t begin = 0; begin < units.size(); begin += threads) {
        const size_t end = std::min(units.size(), begin + threads);
        std::vector<Watched> watched;
        for (size_t i = begin; i < end; ++i)
            watched.push_back({UnitPictures(frame.crop, units[i].unit.render.tile, pyramid->depth()), {}});
        fork_join(end - begin, [&](size_t first, size_t last) {
            for (size_t i = first; i < last; ++i) {
                UnitPictures& pictures = watched[i].pictures;
                watched[i].partial = renderer.watch(
                    units[begin + i].unit.render, [&](const SeenContribution& seen) { pictures.add(seen); }, interrupt_token());
            }
        });
        for (size_t i = begin; i < end; ++i) {
            const PlannedUnit& unit = units[i];
            const Watched& result = watched[i - begin];
            if (!result.partial->ok()) return result.partial->status();
            if (unit.first) pyramid->begin_group(unit.group_iterations, unit.group_light_paths);
            LL_RETURN_IF_ERROR(image->add(**result.partial));
            LL_RETURN_IF_ERROR(pyramid->add(result.pictures));
            if (!unit.last) continue;
            pyramid->end_group();
            LL_RETURN_IF_ERROR(image->fold(unit.group_iterations));
            progress.show(image->complete().iterations());
            const auto dark = [&] {
                const RgbImage so_far = image->complete().develop();
                return std::all_of(so_far.pixels.begin(), so_far.pixels.end(), [](float v) { return v == 0; });
            };
            if (pyramid->contributions() == 0 && !dark())
                return invalid_argument("algorithm '" + job.spec.algorithm.name() +
                                        "' does its own loops and shows no single contributions, of which a pyramid is made");
        }
    }
    return {};
}

}  // namespace

void add_pyramid_options(cli::App command, PyramidOptions& options) {
    const auto pyramid = command
                             .add_option("--pyramid", options.directory,
                                         "Instead of an image: a folder with a weighted and an unweighted picture of every "
                                         "technique, and index.html that shows them; DIR may be given by -o instead (then no word "
                                         "but an option follows --pyramid). At most " +
                                             std::to_string(kPyramidSamples) + " samples per pixel unless --spp is given")
                             ->type_name("[DIR]")
                             ->expected(0, 1);
    command
        .add_option("--pyramid-depth", options.depth,
                    "Edges of the longest paths with pictures of their own; longer ones share some")
        ->type_name("N")
        ->check(whole_number_between(1, 64))
        ->capture_default_str()
        ->needs(pyramid);
    for (const char* other : {"--half", "--png", "--layers", "--time", "--noise", "--json", "--workers"})
        pyramid->excludes(command.get_option(other));
}

Status settle_pyramid_options(JobOptions& job, PyramidOptions& pyramid) {
    if (!pyramid.wanted) return {};
    if (!pyramid.directory.empty() && !job.output.empty())
        return invalid_argument("--pyramid " + pyramid.directory + " and -o " + job.output + " name two folders; give one");
    if (pyramid.directory.empty()) pyramid.directory = std::exchange(job.output, {});
    if (pyramid.directory.empty()) return invalid_argument("--pyramid: name the folder, --pyramid DIR or -o DIR");
    return {};
}

int render_pyramid(JobOptions options, const PyramidOptions& pyramid_options, uint32_t threads, const TableCacheOptions& cache) {
    (void)interrupt_token();
    if (Status s = open_pyramid_directory(pyramid_options.directory); !s.ok()) return report_error(s);
    auto job = build_job(options, threads);
    if (!job.ok()) return report_error(job.status());
    if (options.samples_per_pixel == 0) job->spec.samples_per_pixel = std::min(job->spec.samples_per_pixel, kPyramidSamples);
    const auto tables = cached_tables(*job->scene, job->spec, cache, options.quiet, interrupt_token());
    if (!tables.ok()) return report_error(tables.status());
    const auto renderer = Renderer::create(job->scene, render_settings(job->spec), *tables);
    if (!renderer.ok()) return report_error(renderer.status());

    const FrameLayout& frame = job->spec.frame;
    Pyramid pyramid(frame, pyramid_options.depth, job->response);
    GroupedSum sums(frame, job->response);
    if (Status s = watch_units(*job, **renderer, threads, options.quiet, &pyramid, &sums); !s.ok()) return report_error(s);
    const Accumulation& image = sums.complete();
    PyramidPage page{.scene = std::filesystem::path(options.scene).filename().string(),
                     .algorithm = job->spec.algorithm.name(),
                     .build = kBuildId,
                     .samples_per_pixel = image.iterations(),
                     .seed = job->spec.seed,
                     .width = frame.crop.width(),
                     .height = frame.crop.height(),
                     .max_depth = job->spec.max_depth};
    for (const auto& [key, value] : job->spec.algorithm.chosen_named_text()) page.parameters.emplace_back(key, value);
    const Status written = write_pyramid(pyramid_options.directory, pyramid, frame, image.develop(), std::move(page));
    if (!written.ok()) return report_error(written);
    if (!options.quiet)
        std::printf("%s  %zu techniques, %llu spp\n", (std::filesystem::path(pyramid_options.directory) / "index.html").c_str(),
                    pyramid.keys().size(), static_cast<unsigned long long>(image.iterations()));
    if (image.dropped() > 0) {
        std::fprintf(stderr, "lightloom: %llu samples were not finite and were dropped\n",
                     static_cast<unsigned long long>(image.dropped()));
        if (options.strict) return kDroppedSamples;
    }
    return kSuccess;
}

}  // namespace lightloom::client
