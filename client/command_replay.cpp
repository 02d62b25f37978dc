// lightloom replay: one camera sample of one iteration, or one whole unit, rendered again exactly as a job rendered it.

#include <algorithm>
#include <array>
#include <cstdarg>
#include <cstdio>
#include <memory>
#include <vector>

#include "client/commands.h"
#include "client/local_scene.h"
#include "client/output_files.h"
#include "client/path_report.h"
#include "client/run_job.h"
#include "client/table_options.h"
#include "common/cli/numbers.h"
#include "common/core/atomic_file.h"
#include "common/transport/renderer.h"
#include "common/work/job.h"

namespace lightloom::client {
namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom replay room.pbrt --algorithm bdpt --iteration 17 --pixel 120,64
  lightloom replay room.pbrt --algorithm bdpt --unit 3,0
  lightloom replay room.pbrt --algorithm bdpt --iteration 17 --pixel 120,64 --paths

A manifest lists these commands for the samples that were dropped. --algorithm, --set, --seed, --max-depth, --resolution
and --crop must be those of the job. The printed value is the sample's camera part, at the film's exposure, as in the EXR; what its light
path splats elsewhere is listed behind it. Tables come from the cache that `lightloom render` keeps, or are made and put there.

--paths shows every contribution to the sample: technique, vertices, densities, labels, throughput, value and weight.
)";

struct ReplayOptions {
    JobOptions job;
    uint64_t iteration = 0;
    std::vector<int> pixel;      ///< X, Y, or empty.
    std::vector<uint32_t> unit;  ///< Group, tile, or empty.
    uint64_t spp = 0;
    uint32_t threads = 0;
    TableCacheOptions cache;
    bool paths = false, json = false, splats = false;
};

/// A job's last group may be cut short, and what a unit traces depends on how long its group is.
Group group_of_job(const Plan& plan, uint32_t index, uint64_t spp) {
    Group group = plan.group(index);
    if (spp > group.first_iteration)
        group.iteration_count = uint32_t(std::min<uint64_t>(group.iteration_count, spp - group.first_iteration));
    return group;
}

Result<WorkUnit> find_unit(const ReplayOptions& options, const Plan& plan, uint64_t iteration, int x, int y) {
    if (!options.unit.empty()) {
        const uint32_t group = options.unit[0], tile = options.unit[1];
        if (tile >= plan.tile_count())
            return invalid_argument("--unit takes GROUP,TILE with a tile below " + std::to_string(plan.tile_count()));
        // Groups grow: a job of the largest size has fewer of them than iterations.
        const uint64_t iterations = options.spp > 0 ? options.spp : JobSpec::kMaxSamplesPerPixel;
        if (group >= iterations || plan.group(group).first_iteration >= iterations)
            return invalid_argument("--unit " + std::to_string(group) + "," + std::to_string(tile) + ": a job of " +
                                    std::to_string(iterations) + " samples per pixel has no such group");
        return plan.units(group_of_job(plan, group, options.spp))[tile];
    }
    if (options.spp > 0 && iteration >= options.spp)
        return invalid_argument("--iteration " + std::to_string(iteration) + ": a job of " + std::to_string(options.spp) +
                                " samples per pixel has iterations 0 to " + std::to_string(options.spp - 1));
    for (uint32_t g = 0;; ++g) {
        const Group group = group_of_job(plan, g, options.spp);
        if (iteration >= group.first_iteration + group.iteration_count) continue;
        for (const WorkUnit& unit : plan.units(group)) {
            if (unit.render.tile.contains(x, y)) return unit;
        }
        return invalid_argument("the pixel lies outside of the rendered window");
    }
}

/// A line, or several, as std::printf() would print them.
[[gnu::format(printf, 1, 2)]] std::string line(const char* format, ...) {
    char text[256];
    std::va_list values;
    va_start(values, format);
    std::vsnprintf(text, sizeof text, format, values);
    va_end(values);
    return text;
}

/// What the film makes of the camera part of a unit.
FilmResponse::Triple camera_sum(const Partial& partial, const FilmResponse& response) {
    FilmResponse::Triple sum{};
    for (size_t i = 0; i + 2 < partial.camera.size(); i += 3) {
        const FilmResponse::Triple value = response({partial.camera[i], partial.camera[i + 1], partial.camera[i + 2]});
        for (size_t c = 0; c < 3; ++c) sum[c] += value[c];
    }
    return sum;
}

/// To standard output, or to the file that the options name.
Status write_text(const ReplayOptions& options, const std::string& text) {
    if (!options.job.output.empty()) return write_file_atomically(options.job.output, text);
    std::fputs(text.c_str(), stdout);
    return {};
}

/// Prints what the sample is made of: `work`, of which `renderer` shows every contribution.
int show_paths(const ReplayOptions& options, const BuiltJob& job, const Renderer& renderer, const WorkUnit& unit,
               const RenderUnit& work, bool shares_light_paths) {
    SampleReport report{.algorithm = job.spec.algorithm.name(),
                        .iteration = options.iteration,
                        .x = options.pixel[0],
                        .y = options.pixel[1],
                        .group = unit.key.group,
                        .tile = unit.key.tile,
                        .response = job.response,
                        .splats_of_unit = shares_light_paths,
                        .splats_left_out = shares_light_paths && !options.splats};
    const uint32_t pixel = uint32_t(job.scene->frame().crop.index(report.x, report.y));
    bool shown = false;
    const auto partial = renderer.watch(
        work,
        [&](const SeenContribution& seen) {
            shown = true;
            if (!seen.found.technique.splats())
                report.paths.push_back(report_path(*job.scene, seen));
            else if (!shares_light_paths || (options.splats && seen.pixel == pixel))
                report.splats.push_back(report_path(*job.scene, seen));
        },
        interrupt_token());
    if (!partial.ok()) return report_error(partial.status());
    report.camera = camera_sum(*partial, job.response);
    report.dropped = partial->dropped_count;
    const bool black = partial->splats.empty() && report.camera == std::array<double, 3>{};
    if (!shown && !black)
        return report_error(invalid_argument("algorithm '" + report.algorithm +
                                             "' does its own loops and shows no single contributions; leave out --paths"));
    if (Status s = write_text(options, options.json ? to_json(report) : to_text(report)); !s.ok()) return report_error(s);
    return partial->dropped_count > 0 && options.job.strict ? kDroppedSamples : kSuccess;
}

int replay(const ReplayOptions& options) {
    (void)interrupt_token();
    const auto built = build_job(options.job, options.threads, [&](const LocalScene& local) {
        return check_output_files(files_of(local), std::array{options.job.output});
    });
    if (!built.ok()) return report_error(built.status());
    const JobSpec& spec = built->spec;
    const std::shared_ptr<const Scene>& scene = built->scene;
    const FilmResponse& response = built->response;
    const Plan plan(scene->frame(), spec.algorithm);
    // Light sub-paths of a sample's own are replayed with it; those of a cache are the whole unit's.
    const bool shares_light_paths = spec.algorithm.info().shares_light_paths;

    const int x = options.pixel.empty() ? 0 : options.pixel[0], y = options.pixel.empty() ? 0 : options.pixel[1];
    const auto unit = find_unit(options, plan, options.iteration, x, y);
    if (!unit.ok()) return report_error(unit.status());
    const auto tables = cached_tables(*scene, spec, options.cache, false, interrupt_token());
    if (!tables.ok()) return report_error(tables.status());
    const auto renderer = Renderer::create(scene, render_settings(spec), *tables);
    if (!renderer.ok()) return report_error(renderer.status());
    RenderUnit whole = unit->render;
    RenderUnit work = whole;
    if (options.unit.empty()) {
        const uint32_t place_in_unit = uint32_t(options.iteration - whole.first_iteration);
        whole = whole.batch(place_in_unit - place_in_unit % whole.batch_iterations());
        work = whole;
        // The light path of a camera sample is numbered by its place in the batch.
        const uint64_t place =
            (options.iteration - whole.first_iteration) * uint64_t(whole.tile.area()) + uint64_t(whole.tile.index(x, y));
        work.first_iteration = options.iteration;
        work.iteration_count = 1;
        work.tile = {x, y, x + 1, y + 1};
        if (shares_light_paths) {
            work.owner_tile = whole.tile;   // the sample looks at the whole batch's cache
            if (spec.algorithm.merges()) {  // or at the photons of its iteration
                work.light_path_count = whole.light_path_count / whole.iteration_count;
                work.first_light_path =
                    whole.first_light_path + (options.iteration - whole.first_iteration) * work.light_path_count;
            }
        } else {
            work.first_light_path = whole.first_light_path + place;
            work.light_path_count = whole.light_path_count > 0 ? 1 : 0;
        }
    }
    if (options.paths) return show_paths(options, *built, **renderer, *unit, work, shares_light_paths);
    const auto partial = (*renderer)->render(work, interrupt_token());
    if (!partial.ok()) return report_error(partial.status());
    const FilmResponse::Triple sum = camera_sum(*partial, response);
    std::string text = line("unit %u,%u  camera %.9g %.9g %.9g\n", unit->key.group, unit->key.tile, sum[0], sum[1], sum[2]);
    const int width = scene->frame().crop.width();
    // With a cache, the splats are the unit's, not this sample's.
    if (options.unit.empty() && !shares_light_paths) {
        for (const SplatSum& splat : partial->splats) {
            const FilmResponse::Triple value = response(splat.rgb);
            text += line("splat at %d,%d  %.9g %.9g %.9g\n", scene->frame().crop.x0 + int(splat.pixel) % width,
                         scene->frame().crop.y0 + int(splat.pixel) / width, value[0], value[1], value[2]);
        }
    }
    text += line("dropped %llu\n", static_cast<unsigned long long>(partial->dropped_count));
    for (const DroppedSample& d : partial->dropped) {
        text += line("  %s of iteration %llu %s pixel %d,%d\n", d.splat ? "splat" : "camera sample",
                     static_cast<unsigned long long>(d.iteration), d.splat ? "onto" : "of",
                     scene->frame().crop.x0 + int(d.pixel) % width, scene->frame().crop.y0 + int(d.pixel) / width);
    }
    if (Status s = write_text(options, text); !s.ok()) return report_error(s);
    return partial->dropped_count > 0 && options.job.strict ? kDroppedSamples : kSuccess;
}

}  // namespace

void add_replay_command(cli::App app, int* exit_code) {
    auto options = std::make_shared<ReplayOptions>();
    const cli::App command = app.add_subcommand("replay", "Render one sample or one unit of a job again and print it");
    command->footer(std::string(kFooter) + kPathSchema);
    add_render_settings(*command, options->job);
    command->add_option("-o,--output", options->job.output, "Write what is printed to FILE instead")->type_name("FILE");
    const auto iteration = command->add_option("--iteration", options->iteration, "Iteration of the sample, counted from 0")
                               ->type_name("N")
                               ->capture_default_str()
                               ->check(whole_number_between(0, JobSpec::kMaxSamplesPerPixel - 1));
    const auto pixel =
        command->add_option("--pixel", options->pixel, "The sample's pixel of the whole frame; 0,0 is at the top left")
            ->type_name("X,Y")
            ->expected(2)
            ->delimiter(',')
            ->check(whole_number_between(0, 65535));
    const auto unit =
        command->add_option("--unit", options->unit, "The whole unit instead of one sample, as a manifest lists units")
            ->type_name("GROUP,TILE")
            ->expected(2)
            ->delimiter(',')
            ->check(whole_number_between(0, UINT32_MAX));
    command->add_option("--spp", options->spp, "Samples per pixel of the job, if it was bounded by them (default: it was not)")
        ->type_name("N")
        ->check(whole_number_between(1, JobSpec::kMaxSamplesPerPixel));
    iteration->needs(pixel);
    pixel->excludes(unit);
    const auto paths =
        command->add_flag("--paths", options->paths, "Print every contribution to the sample that --pixel names")->needs(pixel);
    command->add_flag("--json", options->json, "With --paths: one JSON document instead of text")->needs(paths);
    command
        ->add_flag("--splats", options->splats,
                   "With --paths: also what the unit's light paths splat into the pixel, where it is not the sample's own")
        ->needs(paths);
    add_threads_option(*command, options->threads);
    add_table_cache_options(*command, options->cache);
    command->add_flag("--strict", options->job.strict, "Exit with 3 if the sample, or one of the unit, is not finite");
    command->callback([options, exit_code] {
        if (options->pixel.empty() && options->unit.empty()) cli::throw_required("--pixel or --unit");
        *exit_code = replay(*options);
    });
}

}  // namespace lightloom::client
