#include "client/bench/suite_run.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "client/bench/measured_run.h"
#include "client/bench/suite_clock.h"
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

/// What makes two lines speak of the same run of a suite, whatever else decides it.
std::string name_of(const std::string& scene, const std::string& label, uint64_t seed, const Json& budget) {
    return Json{scene, label, seed, budget}.dump();
}

class SuiteRun {
  public:
    SuiteRun(const Suite& suite, const SuiteOptions& options, BenchWriter writer, BenchHistory history, std::stop_token stop)
        : suite_(suite),
          options_(options),
          writer_(std::move(writer)),
          history_(std::move(history)),
          stop_(std::move(stop)),
          clock_(history_.suite_seconds, options.budget) {}

    Status begin();
    Status run_scene(const SuiteScene& scene, double later_weight);
    /// What is left to do of a scene, in seconds as they were asked for; weighs scenes against one another.
    double weight_of(const SuiteScene& scene) const;
    /// Without the runs that the file holds of something else.
    SuiteResults results() && {
        std::erase_if(results_.lines, [&](const Json& line) {
            const auto key = line.find("run");
            return key != line.end() && !keys_.contains(key->get<std::string>());
        });
        return std::move(results_);
    }

  private:
    /// What one seed of a scene may take, by the wall clock and by each run's own.
    struct Deadline {
        double wall = 0;  ///< SuiteClock::elapsed().
        double cap = 0;   ///< Seconds of a run with preparation.
    };
    Status append(const Json& line);
    /// Appends a line that says what follows: only once something follows, so that a file without work to do stays as it is.
    void announce(Json line) { announced_.push_back(std::move(line)); }
    /// kFailedPrecondition where the file holds a run of the same name that something else decided.
    Status check_history(const BenchRun& run) const;
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
    Status measure_shares(SceneBench& bench);
    void report(const MeasuredRun& run) const;

    const Suite& suite_;
    const SuiteOptions& options_;
    BenchWriter writer_;
    BenchHistory history_;
    std::stop_token stop_;
    SuiteClock clock_;
    SuiteResults results_;
    std::optional<Json> start_;  ///< The line of this process, before anything else is appended.
    std::vector<Json> announced_;
    std::set<std::string> keys_;      ///< Of all runs that the suite asks for.
    std::set<std::string> finished_;  ///< Names of the runs that the file held at first,
    std::set<std::string> begun_;     ///< and of their scenes.
    size_t runs_total_ = 0, runs_done_ = 0;
};

Status SuiteRun::begin() {
    LL_RETURN_IF_ERROR(writer_.replace(history_.kept));
    for (size_t begin = 0; begin < history_.kept.size();) {
        const size_t end = history_.kept.find('\n', begin);
        results_.lines.push_back(Json::parse(std::string_view(history_.kept).substr(begin, end - begin)));
        begin = end + 1;
    }
    for (const auto& [key, line] : history_.done) {
        const std::string scene = line.value("scene", std::string());
        begun_.insert(scene);
        finished_.insert(name_of(scene, line.value("label", std::string()), line.value("seed", uint64_t(0)),
                                 line.value("budget", Json::object())));
    }
    for (const SuiteScene& scene : suite_.scenes) runs_total_ += scene.seeds * scene.algorithms.size() * scene.budgets.size();
    start_ = start_line(suite_, {history_.suite_seconds, options_.budget, options_.threads, options_.server, kBuildId});
    return {};
}

Status SuiteRun::append(const Json& line) {
    std::vector<Json> lines;
    if (start_) lines.push_back(*std::exchange(start_, std::nullopt));
    for (Json& before : std::exchange(announced_, {})) lines.push_back(std::move(before));
    lines.push_back(line);
    for (const Json& next : lines) {
        results_.lines.push_back(next);
        LL_RETURN_IF_ERROR(writer_.append(next));
    }
    return {};
}

size_t SuiteRun::unfinished(const SuiteScene& scene, uint64_t seed, const RunBudget& budget) const {
    return size_t(std::count_if(scene.algorithms.begin(), scene.algorithms.end(), [&](const AlgorithmChoice& algorithm) {
        return !finished_.contains(name_of(scene.name, algorithm.label, seed, budget.json()));
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
    const bool makes_reference = scene.recipe && scene.reference.empty() && !begun_.contains(scene.name);
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
        results_.skipped.push_back(scene.name);
        if (!options_.quiet) std::fprintf(stderr, "%s: skipped, %s is not there\n", scene.name.c_str(), scene.job.scene.c_str());
        runs_total_ -= scene.seeds * runs_of_one_seed;
        return {};
    }
    announced_.clear();  // of a scene in which nothing was left to do
    const double weight = weight_of(scene);
    const double share = weight > 0 ? clock_.left() * weight / (weight + later_weight) : 0;
    const double end = clock_.elapsed() + share;
    auto opened = SceneBench::open(scene, suite_, options_, share * kReferenceShare, stop_);
    if (!opened.ok()) return opened.status();
    SceneBench& bench = **opened;
    const auto reference_file = keep_reference(bench);
    if (!reference_file.ok()) return reference_file.status();
    const BenchRun any = bench.run_of(scene.algorithms.front(), scene.job.seed, scene.budgets.front());
    announce(scene_line(scene, any, bench.reference(), *reference_file));
    if (!bench.cut_of_reference().empty()) announce(cut_line(scene.name, bench.cut_of_reference()));

    uint32_t seeds = scene.seeds;
    if (clock_.limited() && weight > 0) {
        const double left = std::max(0.0, end - clock_.elapsed()) * kRenderShare;
        seeds = seeds_within(left, scene.seeds, seconds_left(scene, 0, scene.seeds, 0) / scene.seeds, suite_.stability);
        if (seeds < scene.seeds) {
            runs_total_ -= (scene.seeds - seeds) * runs_of_one_seed;
            announce(cut_line(scene.name, "seeds " + std::to_string(scene.seeds) + " -> " + std::to_string(seeds)));
        }
    }
    bool said = false;
    for (uint32_t i = 0; i < seeds; ++i) {
        for (size_t b = 0; b < scene.budgets.size(); ++b) {
            const RunBudget& budget = scene.budgets[b];
            const Deadline deadline = deadline_of(scene, seeds, i, b, end);
            if (!said && budget.seconds > deadline.cap) {
                char text[96];
                std::snprintf(text, sizeof text, "time of each run %.4g -> %.3g s", budget.seconds, deadline.cap);
                announce(cut_line(scene.name, text));
                said = true;
            }
            LL_RETURN_IF_ERROR(run_seed(bench, scene.job.seed + i, budget, deadline));
        }
    }
    return suite_.share_iterations > 0 && options_.server.empty() ? measure_shares(bench) : Status();
}

Status SuiteRun::check_history(const BenchRun& run) const {
    const Json wanted = run.line("run");
    for (const auto& [key, line] : history_.done) {
        const auto same = [&](const char* field) { return line.contains(field) && line[field] == wanted[field]; };
        if (!same("scene") || !same("label") || !same("seed") || !same("budget")) continue;
        for (const char* field : {"build", "threads", "server", "scene_digest", "reference_digest", "max_depth", "width", "height",
                                  "parameters", "threshold_percent", "stop_after"}) {
            const bool here = wanted.contains(field);
            if (here == line.contains(field) && (!here || same(field))) continue;
            return failed_precondition(options_.out + " holds " + run.algorithm.label + " seed " + std::to_string(run.seed) +
                                       " with another " + field + "; give another name, so that no two kinds are mixed");
        }
    }
    return {};
}

Status SuiteRun::run_seed(SceneBench& bench, uint64_t seed, const RunBudget& budget, const Deadline& deadline) {
    const std::function<bool()> out_of_time = [&] { return clock_.elapsed() >= deadline.wall; };
    const MeasuredRun::Append append_line = [&](const Json& line) { return append(line); };
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
        keys_.insert(run.key());
        if (history_.done.contains(run.key())) {
            ++runs_done_;
            continue;
        }
        LL_RETURN_IF_ERROR(check_history(run));
        auto render = bench.start(run, stop_);
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
    LL_RETURN_IF_ERROR(append(run.last_line(file)));
    ++runs_done_;
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

Status SuiteRun::measure_shares(SceneBench& bench) {
    for (const AlgorithmChoice& algorithm : bench.scene().algorithms) {
        if (history_.shares.contains(bench.scene().name + "\n" + algorithm.label)) continue;
        const auto line = bench.shares(algorithm, stop_);
        // Some algorithms show no contributions, and some find no light in a scene: then there is nothing to show.
        if (line.status().code() == StatusCode::kInvalidArgument || line.status().code() == StatusCode::kFailedPrecondition)
            continue;
        if (!line.ok()) return line.status();
        LL_RETURN_IF_ERROR(append(*line));
    }
    return {};
}

void SuiteRun::report(const MeasuredRun& run) const {
    const RenderCost cost = run.cost();
    const BenchRun& of = run.run();
    // What the suite took so far, for as many runs; coarse, but it follows the machine.
    const double rate =
        (clock_.elapsed() - history_.suite_seconds) / double(runs_done_ - std::min(runs_done_ - 1, history_.done.size()));
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

Result<SuiteResults> measure(const Suite& suite, const SuiteOptions& options, BenchWriter writer, std::stop_token stop) {
    const auto text = writer.text();
    if (!text.ok()) return text.status();
    // Runs that an earlier budget cut are made whole once there is no budget any more.
    auto history = parse_history(*text, options.out, [&](const Json& run) { return options.budget <= 0 && run.contains("cut"); });
    if (!history.ok()) return history.status();
    if (history->started && history->suite != suite.name) {
        return failed_precondition(options.out + " holds results of " +
                                   (history->suite.empty() ? "a single scene" : "the suite " + history->suite) +
                                   "; give another name");
    }
    if (history->torn && !options.quiet)
        std::fprintf(stderr, "%s: the end of its last line is missing; that line's run is measured again\n", options.out.c_str());
    if (!history->done.empty() && !options.quiet)
        std::fprintf(stderr, "%zu run(s) are in %s already\n", history->done.size(), options.out.c_str());
    SuiteRun run(suite, options, std::move(writer), *std::move(history), stop);
    LL_RETURN_IF_ERROR(run.begin());
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
    auto writer = BenchWriter::open(options.out, options.resume);
    if (!writer.ok()) return writer.status();
    auto results = measure(suite, options, *std::move(writer), stop);
    std::error_code ignored;
    // A mistake leaves nothing behind that a second attempt would have to --resume.
    if (!results.ok() && fs::is_regular_file(options.out, ignored) && fs::file_size(options.out, ignored) == 0)
        fs::remove(options.out, ignored);
    return results;
}

}  // namespace lightloom::client
