// lightloom bench: how soon algorithms come near a reference. Runs are interleaved, so that what the machine does meanwhile
// meets all of them alike, and time is the time of light transport alone.

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "client/bench/reference_image.h"
#include "client/bench/results_file.h"
#include "client/commands.h"
#include "client/local_scene.h"
#include "client/output_files.h"
#include "client/run_job.h"
#include "client/table_options.h"
#include "common/cli/numbers.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/path/path_view.h"
#include "common/work/identity.h"

namespace lightloom::client {
namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom bench room.pbrt --reference room-ref.exr --algorithms path,bdpt --time 60 -o room.jsonl
  lightloom bench room.pbrt --reference room-ref.exr --algorithms bdpt,bdpt:heuristic=power --time 900 --threshold 12 \
      --stop-at-threshold 10 -t 2 -o room.jsonl --resume

FILE gets one JSON line per checkpoint (iterations 1, 2, 3, 4, 5, 7, 9, 12, ... at the ends of groups) with MAPE, relMSE,
seconds and rays, and a last line per run with "done": true: where the MAPE fell to the threshold for good (a straight
line between checkpoints in log-log coordinates), or, for a run that ended above it, an extrapolation. The table at the end
shows medians over the seeds. `seconds` is light transport alone, `preparation_seconds` what an algorithm computes before its
first sample; both count towards --time. Learned tables are made anew for every run, on its threads, and "tables" is "made".
With --table-cache DIR a run may find its tables there: then "tables" is "cached", and preparation_seconds has the seconds that
were recorded when they were made, perhaps by other threads or by several workers. The table marks such rows with *.

A reference that one of the tested algorithms made hides that algorithm's bias: `lightloom reference` stores who made it.)";

struct BenchOptions {
    JobOptions scene;
    std::string reference, out;
    std::vector<std::string> algorithms;
    uint32_t seeds = 3, threads = 0;
    double time = 0, threshold = 12, slice = 2, stop_after = -1;
    uint64_t spp = 0;
    bool resume = false;
    TableCacheOptions cache;
};

/// A run that is being rendered.
struct LiveRun {
    std::string label;
    Json line;  ///< What all of its lines begin with.
    BenchRun run;
    ProgressiveRender render;
    std::vector<CurvePoint> curve;
    Json last_checkpoint;
    double next = 1;  ///< Iterations at which the next checkpoint is due.

    double total_seconds() const { return render.seconds() + render.preparation_seconds(); }
    bool at_limit() const {
        return (run.time_limit > 0 && total_seconds() >= run.time_limit) ||
               (run.iteration_limit > 0 && render.iterations() >= run.iteration_limit);
    }
    bool may_stop() const {
        return run.stop_after >= 0 && total_seconds() >= run.stop_after && !curve.empty() && curve.back().error <= run.threshold;
    }
};

Status checkpoint(LiveRun& live, const RgbImage& reference, BenchWriter& writer) {
    const auto metrics = compute_pixel_metrics(live.render.image(), reference);
    if (!metrics.ok()) return metrics.status();
    live.curve.push_back({double(live.render.iterations()), live.render.seconds(), metrics->mape});
    live.last_checkpoint = checkpoint_line(live.line, live.render, *metrics);
    live.next = next_checkpoint(double(live.render.iterations()));
    return writer.append(live.last_checkpoint);
}

/// Renders until the run has had `seconds` in all or ends; true when it ended.
Result<bool> advance(LiveRun& live, double seconds, const RgbImage& reference, BenchWriter& writer) {
    const uint64_t limit = live.run.iteration_limit > 0 ? live.run.iteration_limit : std::numeric_limits<uint64_t>::max();
    while (live.render.seconds() < seconds) {
        LL_RETURN_IF_ERROR(live.render.advance(limit, interrupt_token()));
        const bool last = live.at_limit();
        if (!last && double(live.render.iterations()) < live.next) continue;
        LL_RETURN_IF_ERROR(checkpoint(live, reference, writer));
        if (last || live.may_stop()) return true;
    }
    return false;
}

void report(const LiveRun& live, const Json& done) {
    std::fprintf(stderr, "%s seed %llu: %llu iterations in %.1f s, MAPE %.2f %%%s\n", live.label.c_str(),
                 static_cast<unsigned long long>(live.run.seed), static_cast<unsigned long long>(live.render.iterations()),
                 live.render.seconds(), live.curve.back().error, done.contains("reached") ? "" : ", threshold not reached");
}

/// All runs in turn, a slice each, until every one has ended; their last lines are added to `done`.
Status render_all(std::vector<std::unique_ptr<LiveRun>> alive, const BenchOptions& options, const RgbImage& reference,
                  BenchWriter& writer, std::vector<Json>& done) {
    // Goals and not amounts: a run that overshot its slice by a long group waits until the others have caught up.
    for (double goal = options.slice; !alive.empty(); goal += options.slice) {
        for (std::unique_ptr<LiveRun>& live : alive) {
            const auto ended = advance(*live, goal, reference, writer);
            if (ended.status().code() == StatusCode::kCancelled)
                return {StatusCode::kCancelled, "interrupted; finished runs are in " + options.out + ", --resume does the others"};
            if (!ended.ok()) return {ended.status().code(), live->label + ": " + ended.status().message()};
            if (!*ended) continue;
            done.push_back(done_line(live->last_checkpoint, live->curve, live->run.threshold));
            LL_RETURN_IF_ERROR(writer.append(done.back()));
            if (!options.scene.quiet) report(*live, done.back());
            live.reset();
        }
        std::erase(alive, nullptr);
    }
    return {};
}

Result<std::vector<AlgorithmChoice>> parse_choices(const std::vector<std::string>& texts) {
    std::vector<AlgorithmChoice> choices;
    for (const std::string& text : texts) {
        auto choice = parse_algorithm(text);
        if (!choice.ok()) return choice.status();
        for (const AlgorithmChoice& other : choices) {
            if (other.settings == choice->settings) return invalid_argument("--algorithms names " + text + " twice");
        }
        choices.push_back(std::move(choice).value());
    }
    return choices;
}

int bench(BenchOptions& options) {
    (void)interrupt_token();
    const auto choices = parse_choices(options.algorithms);
    if (!choices.ok()) return report_error(choices.status());
    std::error_code ignored;
    if (!options.resume && std::filesystem::exists(options.out, ignored)) return report_error(exists_already(options.out));
    const auto reference_bytes = read_file(options.reference);
    if (!reference_bytes.ok()) return report_error(reference_bytes.status());
    const auto reference = decode_exr(*reference_bytes, options.reference);
    if (!reference.ok()) return report_error(reference.status());
    if (options.scene.resolution.empty()) {
        options.scene.resolution = std::to_string(reference->frame.width) + "x" + std::to_string(reference->frame.height);
    }
    if (const Rect& c = reference->frame.crop; c != Rect{0, 0, reference->frame.width, reference->frame.height}) {
        options.scene.crop =
            std::to_string(c.x0) + "," + std::to_string(c.x1) + "," + std::to_string(c.y0) + "," + std::to_string(c.y1);
    }
    options.scene.algorithm = choices->front().settings.name();  // Runs name their own: the scene is not asked for one.
    const auto built = build_job(options.scene, options.threads, [&](const LocalScene& local) {
        std::vector<std::filesystem::path> inputs = files_of(local);
        inputs.push_back(options.reference);
        return check_output_files(inputs, std::array{options.out});
    });
    if (!built.ok()) return report_error(built.status());
    const std::shared_ptr<const Scene>& scene = built->scene;
    const std::string scene_digest = built->spec.scene_root.hex();
    const FrameLayout& frame = built->spec.frame;
    const int max_depth = built->spec.max_depth;
    const auto warnings =
        check_reference(options.reference, *reference, {frame, max_depth, scene_digest, *choices, options.threshold});
    if (!warnings.ok()) return report_error(warnings.status());
    for (const std::string& warning : *warnings) std::fprintf(stderr, "lightloom: warning: %s\n", warning.c_str());

    std::vector<BenchRun> runs;
    std::set<std::string> keys;
    for (uint32_t seed = 0; seed < options.seeds; ++seed) {
        for (const AlgorithmChoice& choice : *choices) {
            runs.push_back({scene_digest, sha256(*reference_bytes).hex(), choice, frame.width, frame.height, max_depth,
                            options.scene.seed + seed, options.threads, options.time, options.spp, options.threshold,
                            options.stop_after, kBuildId});
            keys.insert(runs.back().key());
        }
    }
    auto writer = BenchWriter::open(options.out, options.resume);
    if (!writer.ok()) return report_error(writer.status());
    const auto text = writer->text();
    if (!text.ok()) return report_error(text.status());
    const auto history = parse_history(*text, options.out, keys);
    if (!history.ok()) return report_error(history.status());
    if (Status s = writer->replace(history->kept); !s.ok()) return report_error(s);

    std::vector<Json> done;
    std::vector<std::unique_ptr<LiveRun>> alive;
    for (const BenchRun& run : runs) {
        if (const auto old = history->done.find(run.key()); old != history->done.end()) {
            done.push_back(old->second);
            done.back()["label"] = run.algorithm.label;  // The same run may have been written differently.
            continue;
        }
        const RenderSettings settings{run.algorithm.settings, run.seed, max_depth};
        JobSpec job = built->spec;
        job.algorithm = run.algorithm.settings;
        job.seed = run.seed;
        const bool silent = options.scene.quiet || options.cache.path().empty();
        const auto preparation = cached_preparation(*scene, job, options.cache, silent, interrupt_token());
        if (!preparation.ok()) return report_error(preparation.status());
        if (!preparation->note.empty())
            std::fprintf(stderr, "lightloom: warning: %s: %s\n", run.algorithm.label.c_str(), preparation->note.c_str());
        auto render = ProgressiveRender::start(scene, settings, *preparation);
        if (!render.ok()) return report_error(render.status());
        Json line{{"run", run.key()},
                  {"label", run.algorithm.label},
                  {"scene", options.scene.scene},
                  {"reference", options.reference},
                  {"reference_algorithm", reference->attribute(exr_attribute::kAlgorithm)}};
        line.update(run.json());
        if (run.algorithm.settings.info().learning) line["tables"] = preparation->cached ? "cached" : "made";
        alive.push_back(
            std::make_unique<LiveRun>(LiveRun{run.algorithm.label, std::move(line), run, std::move(render).value(), {}, {}, 1}));
    }
    if (!done.empty() && !options.scene.quiet)
        std::fprintf(stderr, "%zu of %zu runs are in %s already\n", done.size(), runs.size(), options.out.c_str());
    if (Status s = render_all(std::move(alive), options, reference->color, *writer, done); !s.ok()) return report_error(s);

    std::vector<std::string> labels;
    for (const AlgorithmChoice& choice : *choices) labels.push_back(choice.label);
    std::fputs(bench_table(labels, done, options.threshold).c_str(), stdout);
    return kSuccess;
}

}  // namespace

void add_bench_command(cli::App app, int* exit_code) {
    auto options = std::make_shared<BenchOptions>();
    const cli::App command = app.add_subcommand("bench", "Measure how soon algorithms come near a reference image");
    command->footer(kFooter);
    command->add_option("SCENE", options->scene.scene, "pbrt-v4 scene file")->type_name("FILE")->required();
    add_scene_options(*command, options->scene.reading);
    command->add_option("--reference", options->reference, "EXR that the runs are compared with; they render its crop window")
        ->type_name("FILE")
        ->required();
    command
        ->add_option("--algorithms", options->algorithms,
                     "What is measured, with commas between them; the first is what the others' ratios refer to")
        ->type_name("NAME[:KEY=VALUE]...")
        ->delimiter(',')
        ->required();
    command->add_option("-o,--output,--out", options->out, "JSON lines to write")->required()->type_name("FILE");
    command->add_flag("--resume", options->resume, "Skip the runs that FILE holds to the end; start the others again");
    const auto time = command->add_option("--time", options->time, "Seconds that a run may take; --time or --spp is needed")
                          ->type_name("SECONDS")
                          ->check(number_between(0.001, 30 * 86400.0));
    const auto spp = command->add_option("--spp", options->spp, "Samples per pixel (iterations) that a run may take")
                         ->type_name("N")
                         ->check(whole_number_between(1, JobSpec::kMaxSamplesPerPixel));
    command->add_option("--seeds", options->seeds, "Runs of each algorithm, with as many seeds")
        ->type_name("N")
        ->capture_default_str()
        ->check(whole_number_between(1, 1000));
    command->add_option("--seed", options->scene.seed, "Seed of the first run; the others have the next ones")
        ->type_name("N")
        ->capture_default_str()
        ->check(whole_number());
    command->add_option("--threshold", options->threshold, "MAPE in percent at which time is taken")
        ->type_name("PERCENT")
        ->capture_default_str()
        ->check(number_between(1e-6, 1e6));
    command
        ->add_option("--stop-at-threshold", options->stop_after,
                     "End a run at the first checkpoint at or below the threshold after SECONDS (default: runs use their time up)")
        ->type_name("SECONDS")
        ->check(number_between(0, 30 * 86400.0));
    command
        ->add_option("--resolution", options->scene.resolution,
                     "Pixels of the whole frame, for example 640x360 (default: the reference's)")
        ->type_name("WxH");
    command->add_option("--max-depth", options->scene.max_depth, "Bounces; paths have up to this + 1 edges (default: the scene's)")
        ->type_name("N")
        ->check(whole_number_between(0, kMaxEdges - 1));
    add_threads_option(*command, options->threads);
    add_measured_table_cache_options(*command, options->cache);
    command->add_option("--slice", options->slice, "Seconds that a run gets before the next one's turn")
        ->type_name("SECONDS")
        ->capture_default_str()
        ->check(number_between(0.001, 86400.0));
    command->add_flag("-q,--quiet", options->scene.quiet, "Print the table and errors only");
    command->callback([options, time, spp, exit_code] {
        if (time->count() + spp->count() == 0) cli::throw_required("--time or --spp");
        *exit_code = bench(*options);
    });
}

}  // namespace lightloom::client
