#include "client/bench/suite_run.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "client/bench/measured_run.h"
#include "client/bench/numbers.h"
#include "client/bench/results_book.h"
#include "client/bench/suite_clock.h"
#include "client/bench/timed_stop.h"
#include "client/progress.h"
#include "common/work/identity.h"

namespace lightloom::client {
namespace {

namespace fs = std::filesystem;

/// Of a scene's share of the budget: what a reference may take that has to be made, and what rendering gets beside merging, errors,
/// files and shares of techniques.
constexpr double kReferenceShare = 0.3, kRenderShare = 0.85;
/// Stands for the seconds of a run that is bounded by samples.
constexpr double kTypicalSeconds = 10;

bool is_missing(const std::string& path) {
    std::error_code ignored;
    return !fs::exists(path, ignored);
}

/// A message for `scene`, as one line.
Status of_scene(const SuiteScene& scene, const Status& status) {
    if (status.ok()) return status;
    return {status.code(), "scene " + scene.name + ": " + status.message()};
}

class SuiteRun {
  public:
    SuiteRun(const Suite& suite, const SuiteOptions& options, ResultsBook book, std::stop_token stop);

    Status run_scene(const SuiteScene& scene, double later_weight);
    /// What is left to do of a scene, in seconds as they were asked for; weighs scenes against one another.
    double weight_of(const SuiteScene& scene) const;
    SuiteResults results() && { return {book_.lines(), std::move(skipped_)}; }

  private:
    /// What one seed of a scene may take, by the wall clock and by each run's own.
    struct Deadline {
        double wall = 0;  ///< SuiteClock::elapsed().
        double cap = 0;   ///< Seconds of a run with preparation.
    };
    Status run_seed(SceneBench& bench, uint64_t seed, const RunBudget& budget, const Deadline& deadline);
    /// Algorithms whose run with this seed and budget has not ended.
    size_t unfinished(const SuiteScene& scene, uint64_t seed, const RunBudget& budget) const;
    /// Seconds that seeds from number `first` up to `end` still need, the first one from budget number `first_budget` on.
    double seconds_left(const SuiteScene& scene, uint32_t first, uint32_t end, size_t first_budget) const;
    /// Within `end` of the suite's clock.
    Deadline deadline_of(const SuiteScene& scene, uint32_t seeds, uint32_t seed, size_t budget, double end) const;
    Status finish(SceneBench& bench, MeasuredRun& run);
    Result<std::string> keep_image(const std::string& name, const RgbImage& image);
    Result<std::string> keep_reference(const SceneBench& bench);
    Status measure_shares(SceneBench& bench, double end);
    /// Says once for each scene and `thing` what was cut.
    Status say_cut(const std::string& scene, const std::string& thing, const std::string& what);
    void report(const MeasuredRun& run) const;

    const Suite& suite_;
    const SuiteOptions& options_;
    ResultsBook book_;
    std::stop_token stop_;
    SuiteClock clock_;
    std::vector<std::string> skipped_;
    std::set<std::string> said_;               ///< Of the scene at hand: what was said to be cut.
    std::map<std::string, double> too_short_;  ///< Of the scene at hand: seconds in which an algorithm could not learn, by label.
    size_t runs_total_ = 0, runs_done_ = 0, measured_ = 0;
};

SuiteRun::SuiteRun(const Suite& suite, const SuiteOptions& options, ResultsBook book, std::stop_token stop)
    : suite_(suite),
      options_(options),
      book_(std::move(book)),
      stop_(std::move(stop)),
      clock_(book_.suite_seconds(), options.budget) {
    for (const SuiteScene& scene : suite_.scenes) runs_total_ += scene.seeds * scene.algorithms.size() * scene.budgets.size();
    book_.set_start(start_line(suite_, {book_.suite_seconds(), options_.budget, options_.threads, options_.server, kBuildId}));
}

size_t SuiteRun::unfinished(const SuiteScene& scene, uint64_t seed, const RunBudget& budget) const {
    return size_t(std::count_if(scene.algorithms.begin(), scene.algorithms.end(), [&](const AlgorithmChoice& algorithm) {
        return !book_.is_done(scene.name, algorithm.label, seed, budget);
    }));
}

double SuiteRun::seconds_left(const SuiteScene& scene, uint32_t first, uint32_t end, size_t first_budget) const {
    double sum = 0;
    for (uint32_t i = first; i < end; ++i) {
        for (size_t b = i == first ? first_budget : 0; b < scene.budgets.size(); ++b)
            sum +=
                double(unfinished(scene, scene.job.seed + i, scene.budgets[b])) * asked_seconds(scene.budgets[b], kTypicalSeconds);
    }
    return sum;
}

double SuiteRun::weight_of(const SuiteScene& scene) const {
    if (scene.optional && is_missing(scene.job.scene)) return 0;
    const double runs = seconds_left(scene, 0, scene.seeds, 0);
    // A scene that was begun has its reference.
    const bool makes_reference = scene.recipe && scene.reference.empty() && !book_.has_runs_of(scene.name);
    return runs + (makes_reference ? asked_seconds(scene.recipe->budget, kTypicalSeconds) : 0);
}

SuiteRun::Deadline SuiteRun::deadline_of(const SuiteScene& scene, uint32_t seeds, uint32_t seed, size_t budget, double end) const {
    Deadline deadline{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
    const size_t runs = unfinished(scene, scene.job.seed + seed, scene.budgets[budget]);
    if (!clock_.limited() || runs == 0) return deadline;
    // Each seed gets its part of what is left: what one saves, the next ones have.
    const double asked = asked_seconds(scene.budgets[budget], kTypicalSeconds) * double(runs);
    const double wall = std::max(0.0, end - clock_.elapsed()) * asked / seconds_left(scene, seed, seeds, budget);
    return {clock_.elapsed() + wall, wall * kRenderShare / double(runs)};
}

Status SuiteRun::run_scene(const SuiteScene& scene, double later_weight) {
    const size_t runs_of_one_seed = scene.algorithms.size() * scene.budgets.size();
    if (scene.optional && is_missing(scene.job.scene)) {
        skipped_.push_back(scene.name);
        if (!options_.quiet) std::fprintf(stderr, "%s: skipped, %s is not there\n", scene.name.c_str(), scene.job.scene.c_str());
        runs_total_ -= scene.seeds * runs_of_one_seed;
        return {};
    }
    book_.drop_announced();  // of a scene in which nothing was left to do
    said_.clear();
    too_short_.clear();
    const double weight = weight_of(scene);
    const double share = weight > 0 ? clock_.left() * weight / (weight + later_weight) : 0;
    const double end = clock_.elapsed() + share;
    auto opened = SceneBench::open(scene, suite_, options_, {share * kReferenceShare, book_.has_runs_of(scene.name)}, stop_);
    if (!opened.ok()) return opened.status();
    SceneBench& bench = **opened;
    const auto reference_file = keep_reference(bench);
    if (!reference_file.ok()) return reference_file.status();
    const BenchRun any = bench.run_of(scene.algorithms.front(), scene.job.seed, scene.budgets.front());
    book_.announce(scene_line(scene, any, bench.reference(), *reference_file));
    if (!bench.cut_of_reference().empty()) book_.announce(cut_line(scene.name, bench.cut_of_reference()));

    uint32_t seeds = scene.seeds;
    if (clock_.limited() && weight > 0) {
        const double left = std::max(0.0, end - clock_.elapsed()) * kRenderShare;
        seeds = seeds_within(left, scene.seeds, seconds_left(scene, 0, scene.seeds, 0) / scene.seeds, suite_.stability);
        if (seeds < scene.seeds) {
            runs_total_ -= (scene.seeds - seeds) * runs_of_one_seed;
            book_.announce(cut_line(scene.name, "seeds " + std::to_string(scene.seeds) + " -> " + std::to_string(seeds)));
        }
    }
    for (uint32_t i = 0; i < seeds; ++i) {
        for (size_t b = 0; b < scene.budgets.size(); ++b) {
            const RunBudget& budget = scene.budgets[b];
            const Deadline deadline = deadline_of(scene, seeds, i, b, end);
            if (budget.seconds > deadline.cap && said_.insert("time").second) {
                char text[96];
                std::snprintf(text, sizeof text, "time of each run %.4g -> %.3g s", budget.seconds, deadline.cap);
                book_.announce(cut_line(scene.name, text));
            }
            LL_RETURN_IF_ERROR(run_seed(bench, scene.job.seed + i, budget, deadline));
        }
    }
    if (suite_.share_iterations > 0 && !options_.service) LL_RETURN_IF_ERROR(measure_shares(bench, end));
    return clock_.limited() ? Status() : book_.forget_cuts(scene.name);
}

Status SuiteRun::say_cut(const std::string& scene, const std::string& thing, const std::string& what) {
    return said_.insert(thing).second ? book_.append(cut_line(scene, what)) : Status();
}

Status SuiteRun::run_seed(SceneBench& bench, uint64_t seed, const RunBudget& budget, const Deadline& deadline) {
    const std::function<bool()> out_of_time = [&] { return clock_.elapsed() >= deadline.wall; };
    const MeasuredRun::Append append_line = [&](const Json& line) { return book_.append(line); };
    const MeasuredRun::SuiteSeconds elapsed = [&] { return clock_.elapsed(); };
    const auto of_run = [](const BenchRun& run, const Status& status) {
        return status.ok() ? status : Status(status.code(), run.algorithm.label + ": " + status.message());
    };
    std::vector<std::unique_ptr<MeasuredRun>> alive;
    // Goals and not amounts: a run that overshot its slice by a long group waits until the others have caught up.
    const auto in_turns = [&](double slice) -> Status {
        for (double goal = slice; !alive.empty(); goal += slice) {
            for (std::unique_ptr<MeasuredRun>& run : alive) {
                const MeasuredRun::Turn turn{goal, deadline.cap, append_line, elapsed, out_of_time, stop_};
                LL_RETURN_IF_ERROR(of_run(run->run(), run->advance(turn)));
                if (!run->ended()) continue;
                LL_RETURN_IF_ERROR(finish(bench, *run));
                run.reset();
            }
            std::erase(alive, nullptr);
        }
        return {};
    };
    for (const AlgorithmChoice& algorithm : bench.scene().algorithms) {
        const BenchRun run = bench.run_of(algorithm, seed, budget);
        const auto done = book_.is_done(run, bench.reference_was_remade());
        if (!done.ok()) return done.status();
        if (*done) {
            ++runs_done_;
            continue;
        }
        // Learning has as long as the whole run: what takes longer leaves nothing to measure, and nothing to the others.
        const auto known = too_short_.find(algorithm.label);
        if (known != too_short_.end() && deadline.cap <= known->second) {
            --runs_total_;
            continue;
        }
        const TimedStop limit(stop_, deadline.cap);
        auto render = bench.start(run, limit.token());
        if (!render.ok() && limit.timed_out()) {
            too_short_[algorithm.label] = deadline.cap;
            --runs_total_;
            LL_RETURN_IF_ERROR(say_cut(
                run.scene, algorithm.label,
                algorithm.label + " is not measured: it does not learn its tables within " + formatted("%.3g s", deadline.cap)));
            continue;
        }
        if (!render.ok()) return of_run(run, render.status());
        alive.push_back(std::make_unique<MeasuredRun>(run, *std::move(render), bench.reference()));
        // A service would share its workers between jobs: each has it alone.
        if (options_.service) LL_RETURN_IF_ERROR(in_turns(std::numeric_limits<double>::infinity()));
    }
    return in_turns(options_.slice);
}

Status SuiteRun::finish(SceneBench& bench, MeasuredRun& run) {
    std::string file;
    if (options_.images && run.run().seed == bench.scene().job.seed) {
        const auto kept = keep_image(run.run().scene + "-" + run.run().key() + ".exr", run.image());
        if (!kept.ok()) return kept.status();
        file = *kept;
    }
    const uint64_t asked = run.run().budget.samples;
    if (run.was_cut() && asked > 0) {
        LL_RETURN_IF_ERROR(
            say_cut(run.run().scene, "samples",
                    "samples of each run " + std::to_string(asked) + " -> " + std::to_string(run.cost().iterations) + " or so"));
    }
    LL_RETURN_IF_ERROR(book_.finish(run.run(), run.last_line(file)));
    ++runs_done_;
    ++measured_;
    if (!options_.quiet) report(run);
    return {};
}

Result<std::string> SuiteRun::keep_image(const std::string& name, const RgbImage& image) {
    const fs::path directory = options_.beside_results(".images");
    std::error_code error;
    fs::create_directories(directory, error);
    if (error) return invalid_argument(directory.string() + ": cannot be made: " + error.message());
    ExrImage exr{.frame = {image.width, image.height, {0, 0, image.width, image.height}}, .color = image};
    LL_RETURN_IF_ERROR(write_exr((directory / name).string(), exr));
    return name;
}

Result<std::string> SuiteRun::keep_reference(const SceneBench& bench) {
    if (!options_.images) return std::string();
    return keep_image(bench.scene().name + "-reference.exr", bench.reference().image.color);
}

Status SuiteRun::measure_shares(SceneBench& bench, double end) {
    const std::string& scene = bench.scene().name;
    for (const AlgorithmChoice& algorithm : bench.scene().algorithms) {
        if (book_.has_shares(scene, algorithm.label) || too_short_.contains(algorithm.label)) continue;
        const double left = clock_.limited() ? end - clock_.elapsed() : std::numeric_limits<double>::infinity();
        const TimedStop limit(stop_, std::max(0.0, left));
        const auto line = left > 0 ? bench.shares(algorithm, limit.token()) : Result<Json>(Status(StatusCode::kCancelled, ""));
        if (!line.ok() && (left <= 0 || limit.timed_out()))
            return say_cut(scene, "shares", "shares of techniques are not measured");
        // Some algorithms show no contributions, and some find no light in a scene: then there is nothing to show.
        if (line.status().code() == StatusCode::kInvalidArgument || line.status().code() == StatusCode::kFailedPrecondition)
            continue;
        if (!line.ok()) return line.status();
        LL_RETURN_IF_ERROR(book_.append(*line));
    }
    return {};
}

void SuiteRun::report(const MeasuredRun& run) const {
    const RenderCost cost = run.cost();
    const BenchRun& of = run.run();
    // What the suite took so far, for as many runs; coarse, but it follows the machine.
    const double rate = (clock_.elapsed() - book_.suite_seconds()) / double(measured_);
    const double left = std::min(clock_.left(), rate * double(runs_total_ - std::min(runs_total_, runs_done_)));
    std::fprintf(stderr, "[%zu/%zu] %s%s%s seed %llu: %llu spp, %.1f s + %.1f s, about %s left\n", runs_done_, runs_total_,
                 of.scene.c_str(), of.scene.empty() ? "" : " ", of.algorithm.label.c_str(),
                 static_cast<unsigned long long>(of.seed), static_cast<unsigned long long>(cost.iterations), cost.seconds,
                 cost.preparation_seconds, duration_text(left).c_str());
}

}  // namespace

Status check_files(const Suite& suite) {
    for (const SuiteScene& scene : suite.scenes) {
        if (is_missing(scene.job.scene)) {
            if (scene.optional) continue;
            return of_scene(scene, invalid_argument(scene.job.scene + ": no such file"));
        }
        if (!scene.reference.empty() && is_missing(scene.reference))
            return of_scene(scene,
                            invalid_argument("reference " + scene.reference + ": no such file; make one by `lightloom reference`"));
    }
    return {};
}

namespace {

Result<SuiteResults> measure(const Suite& suite, const SuiteOptions& options, ResultsBook book, std::stop_token stop) {
    SuiteRun run(suite, options, std::move(book), stop);
    double later = 0;
    for (const SuiteScene& scene : suite.scenes) later += run.weight_of(scene);
    for (const SuiteScene& scene : suite.scenes) {
        later -= run.weight_of(scene);
        const Status status = run.run_scene(scene, std::max(0.0, later));
        if (status.code() == StatusCode::kCancelled)
            return Status(StatusCode::kCancelled,
                          "interrupted; finished runs are in " + options.out + ", --resume does the others");
        if (!status.ok()) return suite.name.empty() ? status : of_scene(scene, status);
    }
    return std::move(run).results();
}

}  // namespace

Result<SuiteResults> run_suite(const Suite& suite, const SuiteOptions& options, std::stop_token stop) {
    LL_RETURN_IF_ERROR(check_files(suite));
    // Runs that an earlier budget cut are measured in full once there is no budget any more.
    auto book = ResultsBook::open(options.out, options.resume, suite.name, options.budget > 0, options.quiet);
    if (!book.ok()) return book.status();
    auto results = measure(suite, options, *std::move(book), stop);
    std::error_code ignored;
    // A mistake leaves nothing behind that a second attempt would have to --resume.
    if (!results.ok() && fs::is_regular_file(options.out, ignored) && fs::file_size(options.out, ignored) == 0)
        fs::remove(options.out, ignored);
    return results;
}

}  // namespace lightloom::client
