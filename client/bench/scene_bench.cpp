#include "client/bench/scene_bench.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "client/bench/reference_maker.h"
#include "client/bench/service_render.h"
#include "client/bench/technique_shares.h"
#include "client/output_files.h"
#include "client/run_job.h"
#include "common/core/atomic_file.h"
#include "common/transport/rare_light.h"
#include "common/work/identity.h"

namespace lightloom::client {
namespace {

namespace fs = std::filesystem;

/// Renderings from which the shares of techniques are estimated.
constexpr uint32_t kShareSeeds = 4;

void warn(const std::string& what) { std::fprintf(stderr, "lightloom: warning: %s\n", what.c_str()); }

std::string frame_text(const FrameLayout& frame) { return std::to_string(frame.width) + "x" + std::to_string(frame.height); }

/// Seconds of rendering that a reference took, by its description; 0 where it has none.
double seconds_of(const std::string& exr_path) {
    const auto text = read_file(description_path(exr_path));
    const auto json = text.ok() ? nlohmann::ordered_json::parse(*text, nullptr, false) : nlohmann::ordered_json();
    const auto seconds = json.is_object() ? json.find("seconds") : json.end();
    return json.is_object() && seconds != json.end() && seconds->is_number() ? seconds->get<double>() : 0;
}

/// kInvalidArgument where a run would share its random numbers with the reference: they would agree by more than their means.
Status check_seeds(const SuiteScene& scene, const Reference& reference) {
    const std::string text = reference.image.attribute(exr_attribute::kSeed);
    if (text.empty()) return {};
    const uint64_t seed = std::strtoull(text.c_str(), nullptr, 10);
    if (seed < scene.job.seed || seed - scene.job.seed >= scene.seeds) return {};
    return invalid_argument(
        reference.path + " was rendered with seed " + text +
        ", which a run has, too, so that both would have the same random numbers; give the runs another first seed");
}

/// Pixel value of a unit of luminance.
double exposure_of(const FilmResponse& response) {
    const FilmResponse::Triple grey = response.of(Rgb(1.0f));
    return double(Rgb(float(grey[0]), float(grey[1]), float(grey[2])).luminance());
}

}  // namespace

std::string SuiteOptions::beside_results(const char* ending) const {
    const std::string stem = out.ends_with(".jsonl") ? out.substr(0, out.size() - 6) : out;
    return stem + ending;
}

Result<std::unique_ptr<SceneBench>> SceneBench::open(const SuiteScene& scene, const Suite& suite, const SuiteOptions& options,
                                                     const ReferenceBudget& budget, std::stop_token stop) {
    std::unique_ptr<SceneBench> bench(new SceneBench(scene, suite, options));
    JobOptions job = scene.job;
    job.quiet = true;
    job.algorithm = scene.algorithms.front().settings.name();  // Runs name their own: the scene is not asked for one.
    if (!scene.reference.empty()) {
        auto reference = read_reference(scene.reference);
        if (!reference.ok()) return reference.status();
        const FrameLayout& frame = reference->image.frame;
        if (job.resolution.empty()) job.resolution = frame_text(frame);
        if (const Rect& c = frame.crop; c != Rect{0, 0, frame.width, frame.height}) {
            std::string& crop = job.crop = std::to_string(c.x0);
            for (const int side : {c.x1, c.y0, c.y1}) crop.append(",").append(std::to_string(side));
        }
        bench->reference_ = *std::move(reference);
    }
    auto built = build_job(job, options.threads, [&](const LocalScene& local) {
        std::vector<fs::path> inputs = files_of(local);
        if (!scene.reference.empty()) inputs.push_back(scene.reference);
        return check_output_files(inputs, std::array{options.out});
    });
    if (!built.ok()) return built.status();
    bench->built_ = *std::move(built);
    if (!bench->reference_) LL_RETURN_IF_ERROR(bench->find_or_make_reference(budget, stop));
    LL_RETURN_IF_ERROR(check_seeds(scene, *bench->reference_));
    const JobSpec& spec = bench->built_.spec;
    const auto warnings = check_reference(
        bench->reference_->path, bench->reference_->image,
        {spec.frame, spec.max_depth, spec.scene_root.hex(), scene.algorithms, suite.threshold, scene.reference.empty()});
    if (!warnings.ok()) return warnings.status();
    if (!options.quiet) std::for_each(warnings->begin(), warnings->end(), warn);
    if (options.service) LL_RETURN_IF_ERROR(upload_scene(*options.service, bench->built_.files));
    return bench;
}

Status SceneBench::find_or_make_reference(const ReferenceBudget& budget, std::stop_token stop) {
    const FrameLayout& frame = built_.spec.frame;
    const fs::path found = find_reference(scene_.job.scene, frame.width, frame.height);
    std::string path = found.string();
    if (found.empty()) {
        if (!scene_.recipe) {
            return invalid_argument(scene_.job.scene + ": no reference of " + frame_text(frame) +
                                    " lies beside it; name one, or say how it is made (\"reference\": {\"algorithm\": ..., "
                                    "\"seconds\": ...})");
        }
        const ReferenceRecipe& recipe = *scene_.recipe;
        const Json identity{{"scene_digest", built_.spec.scene_root.hex()},
                            {"max_depth", built_.spec.max_depth},
                            {"algorithm", recipe.algorithm.settings.name()},
                            {"parameters", recipe.algorithm.settings.named_text()},
                            {"budget", recipe.budget.json()},
                            {"seed", recipe.seed}};
        const fs::path directory =
            options_.references.empty() ? fs::path(options_.beside_results(".references")) : fs::path(options_.references);
        std::error_code error;
        fs::create_directories(directory, error);
        if (error) return invalid_argument(directory.string() + ": cannot be made: " + error.message());
        const std::string stem =
            (directory / (scene_.name + "-" + frame_text(frame) + "-" + sha256(line_text(identity)).hex().substr(0, 12))).string();
        const std::string whole = stem + ".exr", cut = stem + "-cut.exr";
        // One that a budget cut serves within a budget, above all the runs that were measured by it. Without a budget it is made
        // anew.
        const bool has_cut = fs::exists(cut, error);
        if (fs::exists(whole, error)) {
            path = whole;
            reference_was_remade_ = has_cut;
        } else if (has_cut && std::isfinite(budget.seconds) && (budget.begun || seconds_of(cut) >= 0.5 * budget.seconds)) {
            path = cut;
        } else {
            auto made = make_missing_reference(stem, budget.seconds, stop);
            if (!made.ok()) return made.status();
            path = *made;
            reference_was_remade_ = has_cut;
        }
    }
    auto reference = read_reference(path);
    if (!reference.ok()) return reference.status();
    reference_ = *std::move(reference);
    return {};
}

Result<std::string> SceneBench::make_missing_reference(const std::string& stem, double seconds, std::stop_token stop) {
    const ReferenceRecipe& recipe = *scene_.recipe;
    JobSpec spec = built_.spec;
    spec.algorithm = recipe.algorithm.settings;
    spec.seed = recipe.seed;
    spec.samples_per_pixel = uint32_t(recipe.budget.samples);
    spec.time_limit_seconds = recipe.budget.seconds;
    // Even where nothing is left of the budget there has to be a bound, and something to measure by.
    const double most = std::max(seconds, 0.2);
    if (std::isfinite(most) && (recipe.budget.seconds <= 0 || recipe.budget.seconds > most)) {
        spec.time_limit_seconds = most;
        char text[96];
        std::snprintf(text, sizeof text, "time of the reference %.4g -> %.3g s", recipe.budget.seconds, most);
        if (recipe.budget.seconds > 0) cut_of_reference_ = text;
    }
    if (!options_.quiet) {
        std::fprintf(stderr, "%s: makes a reference by %s, %s\n", scene_.name.c_str(), recipe.algorithm.label.c_str(),
                     cut_of_reference_.empty() ? recipe.budget.text().c_str() : cut_of_reference_.c_str());
    }
    const PreparationSource tables = [&](const RenderSettings& of) {
        JobSpec job = spec;
        job.algorithm = of.algorithm.completed();
        return cached_preparation(*built_.scene, job, options_.cache, true, stop);
    };
    const auto made = make_reference(built_.scene, spec, scene_.job.scene, options_.threads, tables, true, stop);
    if (!made.ok()) return made.status();
    if (const uint64_t samples = made->render.iterations(); samples < recipe.budget.samples)
        cut_of_reference_ = "samples of the reference " + std::to_string(recipe.budget.samples) + " -> " + std::to_string(samples);
    const std::string path = stem + (cut_of_reference_.empty() ? ".exr" : "-cut.exr");
    if (Status status = write_reference(*made, path); !status.ok()) return status;
    return path;
}

std::string SceneBench::tables_word(const AlgorithmChoice& algorithm) const {
    if (!algorithm.settings.learning() || !options_.server.empty()) return {};
    if (suite_.shared_tables) return "shared";
    return options_.cache.path().empty() ? "made" : "cached";
}

BenchRun SceneBench::run_of(const AlgorithmChoice& algorithm, uint64_t seed, const RunBudget& budget) const {
    const JobSpec& spec = built_.spec;
    return {scene_.name,
            spec.scene_root.hex(),
            reference_->digest,
            algorithm,
            spec.frame.width,
            spec.frame.height,
            spec.max_depth,
            seed,
            options_.threads,
            budget,
            suite_.threshold,
            suite_.stop_after,
            tables_word(algorithm),
            options_.server,
            kBuildId};
}

JobSpec SceneBench::spec_of(const BenchRun& run) const {
    JobSpec spec = built_.spec;
    spec.algorithm = run.algorithm.settings;
    spec.seed = run.seed;
    return spec;
}

Result<Preparation> SceneBench::preparation_of(const BenchRun& run, std::stop_token stop) {
    const std::string& label = run.algorithm.label;
    const bool is_first = suite_.shared_tables || run.seed == scene_.job.seed;
    if (const auto found = first_.find(label); is_first && found != first_.end()) return found->second;
    JobSpec spec = spec_of(run);
    // Tables that several runs share are those of the scene's first seed, whichever run needs them first.
    if (suite_.shared_tables) spec.seed = scene_.job.seed;
    const bool silent = options_.quiet || options_.cache.path().empty();
    auto preparation = cached_preparation(*built_.scene, spec, options_.cache, silent, stop);
    if (!preparation.ok()) return preparation;
    if (!preparation->note.empty()) warn(label + ": " + preparation->note);
    if (is_first) first_.emplace(label, *preparation);
    return preparation;
}

Result<std::unique_ptr<MeasuredRender>> SceneBench::start(const BenchRun& run, std::stop_token stop) {
    if (options_.service) {
        JobSpec spec = spec_of(run);
        // Without samples the time bounds a job; with both, the job has the samples and the run ends at its time.
        spec.samples_per_pixel = uint32_t(run.budget.samples);
        spec.time_limit_seconds = run.budget.samples > 0 ? 0 : run.budget.seconds;
        return ServiceRender::start(*options_.service, spec, "bench " + scene_.name + " " + run.algorithm.label, stop);
    }
    const auto preparation = preparation_of(run, stop);
    if (!preparation.ok()) return preparation.status();
    const RenderSettings settings{run.algorithm.settings, run.seed, run.max_depth};
    auto render = ProgressiveRender::start(built_.scene, settings, *preparation);
    if (!render.ok()) return render.status();
    const std::string tables = run.tables.empty() || suite_.shared_tables ? run.tables : preparation->cached ? "cached" : "made";
    auto rare = rare_.find(run.algorithm.label);
    if (rare == rare_.end()) {
        const RareLight estimate = estimate_rare_light(*built_.scene, settings, stop);
        if (stop.stop_requested()) return Status(StatusCode::kCancelled, "interrupted");
        rare = rare_.emplace(run.algorithm.label, estimate).first;
    }
    return std::unique_ptr<MeasuredRender>(
        std::make_unique<LocalRender>(*std::move(render), tables, rare->second, exposure_of(built_.response)));
}

Result<Json> SceneBench::shares(const AlgorithmChoice& algorithm, std::stop_token stop) {
    const BenchRun run = run_of(algorithm, scene_.job.seed, scene_.budgets.front());
    const auto preparation = preparation_of(run, stop);
    if (!preparation.ok()) return preparation.status();
    const auto shares = technique_shares(built_.scene, {algorithm.settings, run.seed, run.max_depth}, preparation->tables,
                                         suite_.share_iterations, kShareSeeds, stop);
    if (!shares.ok()) return shares.status();
    Json line{{"type", "techniques"},   {"scene", scene_.name},    {"label", algorithm.label}, {"iterations", shares->iterations},
              {"seeds", shares->seeds}, {"classes", Json::array()}};
    for (const TechniqueShare& share : shares->classes)
        line["classes"].push_back({{"name", share.name}, {"light", share.light}, {"noise", share.noise}});
    return line;
}

}  // namespace lightloom::client
