// lightloom bench: error against time, of a suite or of one scene.

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>

#include "client/bench/suite_run.h"
#include "client/bench/suite_table.h"
#include "client/bench/verdicts.h"
#include "client/commands.h"
#include "client/grpc_job_port.h"
#include "client/run_job.h"
#include "common/cli/numbers.h"
#include "common/work/channel.h"

namespace lightloom::client {
namespace {

constexpr const char* kFooter = R"(Examples:
  lightloom bench tests/bench/suites/failures.json -o failures.jsonl --budget 40m -t 2
  lightloom bench tests/bench/suites/failures.json -o failures.jsonl --budget 40m -t 2 --resume      after a kill
  lightloom bench --stability tests/bench/suites/quick.json -o stability.jsonl
  lightloom bench room.pbrt --reference room-ref.exr --algorithms path,bdpt:heuristic=power --time 60 -o room.jsonl
  lightloom report failures.jsonl -o failures.html

A suite is a JSON file that names scenes, algorithms, seeds and budgets; a single scene with options is the short form. FILE gets
one JSON line per checkpoint (iterations 1, 2, 3, 4, 5, 7, 9, 12, ... at the ends of groups) and one when a run has ended; README.md
in client/ describes both files. The scenes come one after the other; of a scene one seed after the other; of a seed all algorithms
in turns of two seconds. After a kill --resume measures the runs again that have not ended, and nothing else.

`seconds` is light transport alone, `preparation_seconds` what an algorithm computes before its first sample; a time bounds both
together. Learned tables are made anew for every run ("made"), or once for all seeds of an algorithm where a suite says so
("shared"); with --table-cache DIR they may be found there ("cached").

--budget bounds the whole suite, over all of its processes: runs are shortened, and seeds left out if that is not enough; what was
cut is said and recorded. Exit code 1 if one of the suite's expectations does not hold.

A reference that one of the tested algorithms made hides that algorithm's bias: `lightloom reference` stores who made it.)";

struct BenchOptions {
    SuiteOptions suite;
    std::string input, reference, budget;
    bool stability = false;
    JobOptions scene;
    std::vector<std::string> algorithms;
    uint32_t seeds = 3;
    double time = 0, threshold = 12, stop_after = -1;
    uint64_t spp = 0;
};

Result<std::vector<AlgorithmChoice>> parse_choices(const std::vector<std::string>& texts) {
    std::vector<AlgorithmChoice> choices;
    for (const std::string& list : texts)
        for (const std::string& text : split_algorithms(list)) {
            auto choice = parse_algorithm(text);
            if (!choice.ok()) return choice.status();
            for (const AlgorithmChoice& other : choices) {
                if (other.settings == choice->settings) return invalid_argument("--algorithms names " + text + " twice");
            }
            choices.push_back(std::move(choice).value());
        }
    return choices;
}

/// A suite of the command line's one scene.
Result<Suite> single_scene(const BenchOptions& options) {
    if (options.reference.empty()) return invalid_argument("--reference is needed to measure a scene (a suite names its own)");
    if (options.algorithms.empty()) return invalid_argument("--algorithms is needed to measure a scene (a suite names its own)");
    if (options.time == 0 && options.spp == 0) return invalid_argument("--time or --spp is needed to measure a scene");
    auto choices = parse_choices(options.algorithms);
    if (!choices.ok()) return choices.status();
    SuiteScene scene;
    scene.name = std::filesystem::path(options.input).stem().string();
    scene.job = options.scene;
    scene.job.scene = options.input;
    scene.reference = options.reference;
    scene.algorithms = *std::move(choices);
    // With both bounds the one that is reached first counts; with one it alone does.
    scene.budgets = {{.seconds = options.time, .samples = options.spp}};
    scene.seeds = options.stability ? std::max(options.seeds, kStabilitySeeds) : options.seeds;
    Suite suite;
    suite.threshold = options.stability ? 0 : options.threshold;
    suite.stop_after = options.stop_after;
    suite.stability = options.stability;
    suite.shared_tables = options.stability;
    suite.scenes.push_back(std::move(scene));
    return suite;
}

/// Prints what was found; false if an expectation does not hold.
Result<bool> report(const Suite& suite, const SuiteResults& results) {
    if (suite.stability) {
        const auto judged = judge_results(results.lines);
        if (!judged.ok()) return judged.status();
        std::fputs(verdict_table(*judged).c_str(), stdout);
    } else if (suite.name.empty()) {
        std::vector<std::string> labels;
        for (const AlgorithmChoice& choice : suite.scenes.front().algorithms) labels.push_back(choice.label);
        std::vector<Json> done;
        for (const Json& line : results.lines) {
            if (line.value("type", std::string()) == "run") done.push_back(line);
        }
        std::fputs(threshold_table(labels, done, suite.threshold).c_str(), stdout);
    } else {
        std::fputs(suite_table(results.lines).c_str(), stdout);
    }
    std::set<std::string> said;  // several processes may have cut the same
    for (const Json& line : results.lines) {
        if (line.value("type", std::string()) != "cut" || !said.insert(line_text(line)).second) continue;
        std::printf("cut by --budget: %s: %s\n", line.value("scene", std::string()).c_str(),
                    line.value("what", std::string()).c_str());
    }
    for (const std::string& name : results.skipped) std::printf("skipped: %s\n", name.c_str());
    const auto outcomes = judge_expectations(suite, results.lines);
    if (!outcomes.ok()) return outcomes.status();
    bool all = true;
    for (const Outcome& o : *outcomes) {
        const bool skipped = std::find(results.skipped.begin(), results.skipped.end(), o.scene) != results.skipped.end();
        if (skipped) continue;
        all &= o.kind == Outcome::Kind::kHolds;
        const char* word = o.kind == Outcome::Kind::kHolds ? "holds" : o.kind == Outcome::Kind::kFails ? "FAILS" : "NOT JUDGED";
        std::printf("%s: %s: %s (%s)\n", word, o.scene.c_str(), o.text.c_str(), o.found.c_str());
    }
    return all;
}

int bench(BenchOptions& options) {
    const std::stop_token stop = interrupt_token();
    const bool is_suite = options.input.ends_with(".json");
    options.suite.budget = options.budget.empty() ? 0 : duration_seconds(options.budget);
    const auto suite = is_suite ? read_suite(options.input, options.stability) : single_scene(options);
    if (!suite.ok()) return report_error(suite.status());
    std::optional<GrpcJobPort> service;
    if (!options.suite.server.empty()) {
        service.emplace(open_channel(options.suite.server), GrpcJobPortOptions{.stop = stop});
        options.suite.service = &*service;
    }
    try {
        const auto results = run_suite(*suite, options.suite, stop);
        if (service && results.status().code() == StatusCode::kUnavailable) {
            return report_error({StatusCode::kUnavailable, "no answer from " + options.suite.server + " (" +
                                                               results.status().message() +
                                                               "); is lightloom-server running there?"});
        }
        if (!results.ok()) return report_error(results.status());
        const auto good = report(*suite, *results);
        if (!good.ok()) return report_error(good.status());
        return *good ? kSuccess : kFailure;
    } catch (const Json::exception& error) {  // of lines that somebody has edited
        return report_error(invalid_argument(options.suite.out + ": a line has a field of another kind (" + error.what() + ")"));
    }
}

/// Options that speak of one scene; a suite says these things itself.
std::vector<cli::Option> add_single_scene_options(cli::App command, BenchOptions& options) {
    std::vector<cli::Option> own;
    own.push_back(
        command->add_option("--reference", options.reference, "EXR that the runs are compared with; they render its crop window")
            ->type_name("FILE"));
    own.push_back(command
                      ->add_option("--algorithms", options.algorithms,
                                   "What is measured, with commas between them; the first is what the others' ratios refer to")
                      ->type_name("NAME[:KEY=VALUE]..."));
    own.push_back(command->add_option("--time", options.time, "Seconds that a run may take; --time or --spp is needed")
                      ->type_name("SECONDS")
                      ->check(number_between(0.001, 30 * 86400.0)));
    own.push_back(command->add_option("--spp", options.spp, "Samples per pixel (iterations) that a run may take")
                      ->type_name("N")
                      ->check(whole_number_between(1, JobSpec::kMaxSamplesPerPixel)));
    own.push_back(command->add_option("--seeds", options.seeds, "Runs of each algorithm, with as many seeds")
                      ->type_name("N")
                      ->capture_default_str()
                      ->check(whole_number_between(1, 1000)));
    own.push_back(command
                      ->add_option("--seed", options.scene.seed,
                                   "Seed of the first run; the others have the next ones. None may be the reference's")
                      ->type_name("N")
                      ->capture_default_str()
                      ->check(whole_number()));
    own.push_back(command->add_option("--threshold", options.threshold, "MAPE in percent at which time is taken")
                      ->type_name("PERCENT")
                      ->capture_default_str()
                      ->check(number_between(1e-6, 1e6)));
    own.push_back(
        command
            ->add_option(
                "--stop-at-threshold", options.stop_after,
                "End a run at the first checkpoint at or below the threshold after SECONDS (default: runs use their time up)")
            ->type_name("SECONDS")
            ->check(number_between(0, 30 * 86400.0)));
    own.push_back(command
                      ->add_option("--resolution", options.scene.resolution,
                                   "Pixels of the whole frame, for example 640x360 (default: the reference's)")
                      ->type_name("WxH"));
    own.push_back(
        command
            ->add_option("--max-depth", options.scene.max_depth, "Bounces; paths have up to this + 1 edges (default: the scene's)")
            ->type_name("N")
            ->check(whole_number_between(0, kMaxEdges - 1)));
    return own;
}

}  // namespace

void add_bench_command(cli::App app, int* exit_code) {
    auto options = std::make_shared<BenchOptions>();
    options->scene.seed = 1;  // that of a reference is 0, and both must not have the same random numbers
    SuiteOptions& suite = options->suite;
    const cli::App command = app.add_subcommand("bench", "Measure error against time, of a suite or a scene, and judge stability");
    command->footer(kFooter);
    command->add_option("SUITE", options->input, "Suite (.json), or a pbrt-v4 scene file with the options below")
        ->type_name("FILE")
        ->required();
    command->add_option("-o,--output,--out", suite.out, "JSON lines to write")->required()->type_name("FILE");
    command->add_flag("--resume", suite.resume, "Skip the runs that FILE holds to the end; start the others again");
    command->add_flag("--stability", options->stability,
                      "Judge how reliable algorithms are: at least 20 seeds at a small budget, and a verdict for each");
    command
        ->add_option("--budget", options->budget, "Time for all, for example 40m; runs are shortened and seeds left out to keep it")
        ->type_name("TIME")
        ->check(duration_between(1, 30 * 86400.0));
    command
        ->add_option("--references", suite.references,
                     "Directory of the references that have to be made (default: FILE without .jsonl, with .references)")
        ->type_name("DIR");
    command->add_option("--server", suite.server,
                        "HOST:PORT of a coordinator whose workers render the runs, one job after the other");
    add_threads_option(*command, suite.threads);
    add_measured_table_cache_options(*command, suite.cache);
    command->add_option("--slice", suite.slice, "Seconds that a run gets before the next one's turn")
        ->type_name("SECONDS")
        ->capture_default_str()
        ->check(number_between(0.001, 86400.0));
    command->add_flag("-q,--quiet", suite.quiet, "Print the table and errors only");
    add_scene_options(*command, options->scene.reading);
    std::vector<cli::Option> own = add_single_scene_options(*command, *options);
    command->callback([options, own, exit_code] {
        if (options->input.ends_with(".json")) {
            for (const cli::Option& option : own) {
                if (option.count() == 0) continue;
                *exit_code = report_error(
                    invalid_argument(option.name() + " is for a single scene; " + options->input + " says that itself"));
                return;
            }
        }
        *exit_code = bench(*options);
    });
}

}  // namespace lightloom::client
