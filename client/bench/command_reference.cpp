// lightloom reference: an image to measure others by, with its variance, who made it, and whether another algorithm agrees.

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/bench/reference_maker.h"
#include "client/commands.h"
#include "client/local_scene.h"
#include "client/progress.h"
#include "client/run_job.h"
#include "client/table_options.h"
#include "common/cli/numbers.h"
#include "common/core/atomic_file.h"

namespace lightloom::client {
namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom reference room.pbrt -o room-ref.exr --algorithm bdpt --time 3600
  lightloom reference room.pbrt -o room-ref.exr --algorithm bdpt --time 3600 --cross-check path --cross-time 1200

The EXR is the one that `lightloom render` makes with as many samples: colour, variance of each pixel, and in its header
algorithm, parameters, seed, samples and scene digest. Beside it REF.json says how it was made, with the standard error of its
mean. --cross-check renders with another algorithm and compares mean luminance: whole image, 3 x 3 regions, and every path
length (by renderings whose --max-depth differs by one). The intervals are 95 % for all rows together (Sidak); a row differs
when even the 99.9 % interval excludes 1. Then the exit code is 1: one of the algorithms is wrong or misses paths.)";

struct ReferenceOptions {
    JobOptions job;
    std::string cross_check;
    double cross_time = 60;
    uint32_t threads = 0;
    TableCacheOptions cache;
};

int reference(ReferenceOptions& options) {
    (void)interrupt_token();
    std::optional<AlgorithmChoice> checker_choice;
    if (!options.cross_check.empty()) {
        auto parsed = parse_algorithm(options.cross_check);
        if (!parsed.ok()) return report_error(parsed.status());
        checker_choice = *std::move(parsed);
    }
    auto built = build_job(options.job, options.threads,
                           [&](const LocalScene& local) { return check_outputs(options.job, {".json"}, &local); });
    if (!built.ok()) return report_error(built.status());
    JobSpec& spec = built->spec;
    const std::shared_ptr<const Scene>& scene = built->scene;
    spec.algorithm = spec.algorithm.completed();
    if (checker_choice && checker_choice->settings.name() == spec.algorithm.name())
        return report_error(
            invalid_argument("--cross-check " + spec.algorithm.name() + " is what makes the reference; name another algorithm"));
    if (spec.frame.crop.width() < kCheckColumns || spec.frame.crop.height() < kCheckRows)
        return report_error(invalid_argument("a reference has at least 3 x 3 pixels"));

    const Plan plan(scene->frame(), spec.algorithm);
    const uint64_t fewest = plan.group(kLeastGroups - 1).first_iteration + 1;
    if (checker_choice && spec.samples_per_pixel > 0 && spec.samples_per_pixel < fewest)
        return report_error(invalid_argument("--cross-check needs --spp " + std::to_string(fewest) + " at least: " +
                                             std::to_string(kLeastGroups) + " groups of iterations, to know the error"));

    const RenderSettings settings = render_settings(spec);
    const PreparationSource tables = [&](const RenderSettings& of) {
        JobSpec job = spec;
        job.algorithm = of.algorithm.completed();
        job.seed = of.seed;
        job.max_depth = of.max_depth;
        return cached_preparation(*scene, job, options.cache, options.job.quiet, interrupt_token());
    };
    auto made = make_reference(scene, spec, options.job.scene, options.threads, tables, options.job.quiet, interrupt_token());
    if (!made.ok()) return report_error(made.status());
    if (!made->note.empty()) std::fprintf(stderr, "lightloom: warning: %s\n", made->note.c_str());
    const ProgressiveRender& render = made->render;
    const std::filesystem::path output = output_path(options.job);
    // Before the cross-check: what took hours is safe whatever comes.
    if (Status s = write_reference(*made, output.string()); !s.ok()) return report_error(s);
    if (!options.job.quiet) {
        std::printf("%s  %s  %llu spp in %s  mean luminance %.6g +- %.2g\n", output.string().c_str(), spec.algorithm.name().c_str(),
                    static_cast<unsigned long long>(render.iterations()), duration_text(render.seconds()).c_str(),
                    made->regions.front().mean, made->regions.front().standard_error());
        std::fflush(stdout);
    }
    if (render.dropped() > 0) {
        std::fprintf(stderr, "lightloom: warning: %llu non-finite sample(s) were dropped\n",
                     static_cast<unsigned long long>(render.dropped()));
    }
    if (!checker_choice) return kSuccess;
    if (render.groups() < kLeastGroups) {
        return report_error(failed_precondition(output.string() + " consists of " + std::to_string(render.groups()) +
                                                " groups of iterations; a cross-check needs " + std::to_string(kLeastGroups) +
                                                " to know its error: render longer"));
    }

    const RenderSettings checker{checker_choice->settings, spec.seed + 1, spec.max_depth};
    const auto check = cross_check(scene, settings, made->regions, checker, options.cross_time, tables, interrupt_token());
    if (!check.ok()) return report_error(check.status());
    nlohmann::ordered_json& json = made->description;
    json["cross_check"] = {
        {"algorithm", checker.algorithm.name()}, {"parameters", checker.algorithm.named_text()}, {"seed", checker.seed}};
    json["cross_check"].update(check->json());
    if (Status s = write_file_atomically(description_path(output.string()), json.dump(1) + "\n"); !s.ok()) return report_error(s);
    std::printf("cross-check by %s, %llu spp\n%s", checker_choice->label.c_str(),
                static_cast<unsigned long long>(check->iterations), check->table().c_str());
    if (check->verdict() != Verdict::kDiffer) return kSuccess;
    std::fflush(stdout);
    std::fprintf(stderr, "lightloom: %s and %s differ; one of them is biased or misses paths\n", spec.algorithm.name().c_str(),
                 checker_choice->settings.name().c_str());
    return kFailure;
}

}  // namespace

void add_reference_command(cli::App app, int* exit_code) {
    auto options = std::make_shared<ReferenceOptions>();
    const cli::App command = app.add_subcommand("reference", "Render an image that others are measured by, and check it");
    command->footer(kFooter);
    add_render_settings(*command, options->job);
    command->add_option("-o,--output", options->job.output, "EXR to write; its description goes beside it as .json")
        ->type_name("FILE")
        ->required();
    const auto spp = command->add_option("--spp", options->job.samples_per_pixel, "Samples per pixel; --spp or --time is needed")
                         ->type_name("N")
                         ->check(whole_number_between(1, JobSpec::kMaxSamplesPerPixel));
    const auto time = command->add_option("--time", options->job.time_seconds, "Stop after so many seconds of rendering")
                          ->type_name("SECONDS")
                          ->check(number_between(0.001, 30 * 86400.0))
                          ->excludes(spp);
    command->add_option("--cross-check", options->cross_check, "Another algorithm that must agree")
        ->type_name("NAME[:KEY=VALUE]...");
    command
        ->add_option("--cross-time", options->cross_time, "Seconds for its image, and as many again for the path lengths of both")
        ->type_name("SECONDS")
        ->capture_default_str()
        ->check(number_between(0.001, 30 * 86400.0));
    add_threads_option(*command, options->threads);
    add_table_cache_options(*command, options->cache);
    command->add_flag("-q,--quiet", options->job.quiet, "Print errors and the cross-check only");
    command->callback([options, spp, time, exit_code] {
        if (spp->count() + time->count() == 0) cli::throw_required("--time or --spp");
        *exit_code = reference(*options);
    });
}

}  // namespace lightloom::client
