#include "client/report/panel.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace lightloom::client::report {
namespace {

constexpr double kNearFloor = 4;  ///< As the bench marks checkpoints: relMSE below so many times the reference's noise.
constexpr double kTracked = 1.5, kOctaves = 3;

Curve curve_of(const Run& run, const SceneInfo& scene, bool time) {
    Curve curve;
    for (const Checkpoint& point : run.curve) {
        const double x = time ? point.seconds + point.preparation : point.iterations;
        if (!curve.x.empty() && x <= curve.x.back()) continue;
        curve.x.push_back(x);
        curve.y.push_back(shown_error(point, scene));
    }
    return curve;
}

/// Where both are known and the reference's noise does not decide.
std::optional<double> estimate_ratio(const Checkpoint& point, const SceneInfo& scene) {
    if (!point.estimated || !(*point.estimated > 0) || point.near_floor) return std::nullopt;
    const double error = shown_error(point, scene);
    if (error < least_certain_error(scene)) return std::nullopt;
    return *point.estimated / error;
}

Curve ratio_curve(const Run& run, const SceneInfo& scene) {
    Curve curve;
    for (const Checkpoint& point : run.curve) {
        if (const auto ratio = estimate_ratio(point, scene)) {
            curve.x.push_back(point.iterations);
            curve.y.push_back(*ratio);
        }
    }
    return curve;
}

Tracking tracking_of(const std::vector<const Run*>& runs, const SceneInfo& scene) {
    Tracking tracking;
    for (const Run* run : runs) {
        for (const Checkpoint& point : run->curve) {
            if (point.iterations * std::exp2(kOctaves) < run->end().iterations) continue;
            const auto ratio = estimate_ratio(point, scene);
            if (!ratio) continue;
            ++tracking.checkpoints;
            tracking.within += *ratio <= kTracked && *ratio >= 1 / kTracked;
        }
    }
    return tracking;
}

std::vector<TimedRun> timed(const Series& series, const SceneInfo& scene) {
    std::vector<TimedRun> out;
    for (const Run* run : series.runs) {
        TimedRun timed_run{{}, run->end().preparation};
        for (const Checkpoint& point : run->curve)
            timed_run.points.push_back({point.iterations, point.seconds, shown_error(point, scene)});
        out.push_back(std::move(timed_run));
    }
    return out;
}

template <typename Get>
double median_of(const std::vector<const Run*>& runs, const Get& get) {
    std::vector<double> values;
    for (const Run* run : runs) values.push_back(get(*run));
    return median(std::move(values));
}

std::string of_all(size_t count, size_t all) {
    return count == all ? "" : " (" + std::to_string(count) + " of " + std::to_string(all) + ")";
}

std::vector<std::string> marks_of(const Series& series) {
    std::vector<std::string> marks;
    const std::vector<const Run*>& runs = series.runs;
    const auto count = [&](const auto& has) {
        return size_t(std::count_if(runs.begin(), runs.end(), [&](const Run* run) { return has(*run); }));
    };
    if (const size_t cut = count([](const Run& run) { return run.given_seconds.has_value(); }); cut > 0) {
        std::vector<double> given;
        for (const Run* run : runs)
            if (run->given_seconds) given.push_back(*run->given_seconds);
        marks.push_back("cut to " + formatted("%.3g s", median(std::move(given))) + of_all(cut, runs.size()));
    }
    if (const size_t capped = count([](const Run& run) { return run.capped; }); capped > 0)
        marks.push_back(formatted("%g %% MAPE not reached", runs.front()->threshold.value_or(0)) + of_all(capped, runs.size()));
    if (series.near_floor) marks.emplace_back("near the reference’s noise");
    if (count([](const Run& run) { return run.cached_tables; }) > 0) marks.emplace_back("tables from a cache");
    double dropped = 0;
    for (const Run* run : runs) dropped += run->dropped_samples;
    if (dropped > 0) marks.push_back(formatted("%.0f", dropped) + " samples dropped");
    const double rare = median_of(runs, [](const Run& run) { return run.rare_share.value_or(0); });
    if (rare >= 0.001) marks.push_back(formatted("%.2g %%", 100 * rare) + " of the light by chance hits");
    return marks;
}

void fill(Series* series, const SceneInfo& scene) {
    std::vector<Curve> time, samples, ratios;
    std::vector<double> errors;
    for (const Run* run : series->runs) {
        time.push_back(curve_of(*run, scene, true));
        samples.push_back(curve_of(*run, scene, false));
        ratios.push_back(ratio_curve(*run, scene));
        errors.push_back(shown_error(run->end(), scene));
    }
    series->by_time = seed_band(time);
    series->by_samples = seed_band(samples);
    series->ratio = seed_band(ratios);
    series->tracking = tracking_of(series->runs, scene);
    series->error = median(errors);
    series->error_uncertainty = median_error(errors);
    series->seconds = median_of(series->runs, [](const Run& run) { return run.end().seconds + run.end().preparation; });
    series->preparation = median_of(series->runs, [](const Run& run) { return run.end().preparation; });
    series->samples = median_of(series->runs, [](const Run& run) { return run.end().iterations; });
    series->near_floor = series->error < least_certain_error(scene);
    series->marks = marks_of(*series);
}

void fill(Panel* panel, const std::string& first) {
    const SceneInfo& scene = *panel->scene;
    std::vector<Curve> medians;
    for (Series& series : panel->series) {
        fill(&series, scene);
        medians.push_back({series.by_time.x, series.by_time.middle});
    }
    panel->front = pareto_front(medians);
    if (panel->series.front().label != first) return;
    panel->level = std::max(panel->series.front().error, least_certain_error(scene));
    const std::vector<TimedRun> base = timed(panel->series.front(), scene);
    for (Series& series : panel->series) {
        series.speed_up = &series == &panel->series.front() ? SpeedUp{} : speed_up(base, timed(series, scene), panel->level);
    }
}

}  // namespace

double shown_error(const Checkpoint& point, const SceneInfo& scene) {
    constexpr double kLeast = 1e-12;  // A logarithm needs one.
    if (!scene.floor) return std::max(point.relmse, kLeast);
    return std::max({point.relmse_own.value_or(point.relmse - *scene.floor), *scene.floor / 10, kLeast});
}

double least_certain_error(const SceneInfo& scene) { return (kNearFloor - 1) * scene.floor.value_or(0); }

Comparison compare_results(const Results& results) {
    Comparison out;
    for (const Run& run : results.runs)
        if (std::find(out.labels.begin(), out.labels.end(), run.label) == out.labels.end()) out.labels.push_back(run.label);
    for (const SceneInfo& scene : results.scenes) {
        const size_t begin = out.panels.size();
        for (const Run& run : results.runs) {
            if (run.scene != scene.name) continue;
            const bool known = std::any_of(out.panels.begin() + ptrdiff_t(begin), out.panels.end(),
                                           [&](const Panel& panel) { return panel.budget == run.budget; });
            if (!known) out.panels.push_back({&scene, run.budget, scene.name, {}, 0, {}});
        }
        for (size_t i = begin; i < out.panels.size(); ++i) {
            Panel& panel = out.panels[i];
            if (out.panels.size() > begin + 1) panel.title += ", " + panel.budget.text();
            for (size_t style = 0; style < out.labels.size(); ++style) {
                Series series;
                series.label = out.labels[style];
                series.style = style;
                for (const Run& run : results.runs)
                    if (run.scene == scene.name && run.budget == panel.budget && run.label == series.label)
                        series.runs.push_back(&run);
                std::sort(series.runs.begin(), series.runs.end(), [](const Run* a, const Run* b) { return a->seed < b->seed; });
                if (!series.runs.empty()) panel.series.push_back(std::move(series));
            }
            fill(&panel, out.labels.front());
        }
    }
    for (const std::string& label : out.labels) {
        std::vector<SpeedUp> factors;
        for (const Panel& panel : out.panels)
            for (const Series& series : panel.series)
                if (series.label == label && series.speed_up) factors.push_back(*series.speed_up);
        out.means.push_back(geometric_mean(factors));
        out.mean_counts.push_back(int(factors.size()));
    }
    return out;
}

}  // namespace lightloom::client::report
