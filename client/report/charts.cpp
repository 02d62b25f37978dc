#include "client/report/charts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "client/report/gnuplot.h"
#include "client/report/plot.h"

namespace lightloom::client::report {
namespace {

std::string error_name(const SceneInfo& scene) { return scene.floor ? "relMSE, less the reference's own" : "relMSE"; }

void take(std::vector<double>* values, const std::vector<double>& more) { values->insert(values->end(), more.begin(), more.end()); }

std::string labels_of(const Panel& panel) {
    std::string out;
    for (const Series& series : panel.series) out += (out.empty() ? "" : ", ") + series.label;
    return out;
}

/// The reference's noise, where it is near enough to what is shown.
void floor_line(Plot* plot, const SceneInfo& scene, const Axis& x, const Axis& y) {
    if (!scene.floor || *scene.floor < y.low || *scene.floor > y.high) return;
    plot->add(plot->data({{x.low, *scene.floor}, {x.high, *scene.floor}}) + " using 1:2 with lines lw 1 dt (4,3) lc rgb '" +
              colour::kSoft + "' title 'noise of the reference'");
    plot->label("noise of the reference", "graph 0.015, first " + exact(*scene.floor) + " left offset 0,0.5", colour::kSoft, 9);
}

Axis error_axis(const Panel& panel, bool time) {
    std::vector<double> values;
    for (const Series& series : panel.series) {
        const Band& band = time ? series.by_time : series.by_samples;
        take(&values, band.low);
        take(&values, band.high);
    }
    // The reference's noise belongs to the picture where some curve comes near it.
    if (panel.scene->floor && !values.empty() && *panel.scene->floor * 30 > *std::min_element(values.begin(), values.end()))
        values.push_back(*panel.scene->floor);
    return Axis::around(values);
}

Axis run_axis(const Panel& panel, bool time) {
    std::vector<double> values;
    for (const Series& series : panel.series) take(&values, time ? series.by_time.x : series.by_samples.x);
    return Axis::around(values);
}

constexpr const char* kSeconds = "seconds, preparation included";
constexpr const char* kSamples = "samples per pixel";

ChartScript error_chart(const Panel& panel, bool time) {
    Plot plot(panel.title + (time ? ": error against time" : ": error against samples"));
    const Axis x = run_axis(panel, time), y = error_axis(panel, time);
    plot.log_axis('x', x, time ? kSeconds : kSamples);
    plot.log_axis('y', y, error_name(*panel.scene));
    floor_line(&plot, *panel.scene, x, y);
    std::vector<Plot::Name> names;
    for (const Series& series : panel.series) {
        const Band& band = time ? series.by_time : series.by_samples;
        plot.series(band, series.style, series.label, least_certain_error(*panel.scene));
        names.push_back({y.position(band.middle.back()), series.style, series.label});
    }
    plot.names(std::move(names));
    return {time ? "error-time" : "error-samples",
            panel.title + ": relMSE against " + (time ? "seconds" : "samples per pixel") + " of " + labels_of(panel) +
                ", both axes logarithmic; lines are medians over the seeds, bands reach from the least to the greatest",
            plot.script()};
}

ChartScript front_chart(const Panel& panel) {
    Plot plot(panel.title + ": least error for the time");
    const Axis x = run_axis(panel, true), y = error_axis(panel, true);
    plot.log_axis('x', x, kSeconds);
    plot.log_axis('y', y, error_name(*panel.scene));
    std::vector<Plot::Name> names;
    for (size_t i = 0; i < panel.series.size(); ++i) {
        const Series& series = panel.series[i];
        std::vector<std::vector<double>> rows;
        for (size_t k = 0; k < series.by_time.x.size(); ++k) rows.push_back({series.by_time.x[k], series.by_time.middle[k]});
        plot.add(plot.data(rows) + " using 1:2 with lines lw 0.9 dt " + dash_type(series.style) + " lc rgb '" + colour::kAxis +
                 "' title " + quoted(series.label) + " noenhanced");
        const bool on_front =
            std::any_of(panel.front.begin(), panel.front.end(), [&](const FrontPiece& piece) { return piece.curve == i; });
        names.push_back({y.position(series.by_time.middle.back()), series.style, series.label, !on_front});
    }
    for (const FrontPiece& piece : panel.front) {
        const Series& series = panel.series[piece.curve];
        std::vector<std::vector<double>> rows;
        for (size_t k = 0; k < piece.line.x.size(); ++k) rows.push_back({piece.line.x[k], piece.line.y[k]});
        const std::string paint = " lc rgb '" + colour::series(series.style) + "' title " + quoted(series.label) + " noenhanced";
        plot.add(plot.data(rows) + " using 1:2 with lines lw 3.5" + paint);
        plot.add(plot.data({rows.front()}) + " using 1:2 with points ps 0.8 pt " + point_type(series.style, false) + paint);
    }
    plot.names(std::move(names));
    return {"pareto", panel.title + ": the least error that any of " + labels_of(panel) + " reaches in a given time",
            plot.script()};
}

std::optional<ChartScript> speed_up_chart(const Panel& panel) {
    std::vector<const Series*> rows;
    for (const Series& series : panel.series)
        if (series.speed_up) rows.push_back(&series);
    if (rows.size() < 2) return std::nullopt;
    std::vector<double> values{1};
    for (const Series* row : rows) {
        const SpeedUp& speed_up = *row->speed_up;
        values.push_back(speed_up.factor);
        if (speed_up.low) values.push_back(std::max(*speed_up.low, speed_up.factor / 10));
        if (speed_up.high) values.push_back(std::min(*speed_up.high, speed_up.factor * 10));
    }
    Plot plot(panel.title + ": speed-up to equal error", {0.27, 0.84, 0.17, 0.89});
    const Axis x = Axis::around(values);
    plot.log_axis('x', x, "times as fast as " + shortened(rows[0]->label, 30));
    plot.line("set yrange [0.4:" + exact(double(rows.size()) + 0.6) + "]\nunset ytics\nset border 1");
    plot.line("set arrow 1 from first 1, graph 0 to first 1, graph 1 nohead lw 1 lc rgb '" + std::string(colour::kSoft) + "' back");
    for (size_t i = 0; i < rows.size(); ++i) {
        const Series& row = *rows[i];
        const SpeedUp& speed_up = *row.speed_up;
        const double y = double(rows.size() - i);
        const std::string paint = " lc rgb '" + colour::series(row.style) + "' title " + quoted(row.label) + " noenhanced";
        if (speed_up.low) {
            const double low = std::max(*speed_up.low, x.low), high = std::min(*speed_up.high, x.high);
            plot.add(plot.data({{low, y}, {high, y}}) + " using 1:2 with lines lw 2" + paint);
        }
        const bool open = speed_up.extrapolated || speed_up.at_least || speed_up.at_most;
        plot.add(plot.data({{speed_up.factor, y}}) + " using 1:2 with points lw 1.6 ps 0.9 pt " + point_type(row.style, open) +
                 paint);
        const std::string height = "first " + exact(y);
        plot.name(row.label, "graph -0.03, " + height + " right", colour::series(row.style));
        plot.label(to_text(speed_up), "graph 1.03, " + height + " left", colour::kText);
    }
    return ChartScript{"speed-up", panel.title + ": how many times as fast as " + rows[0]->label + " the others reach its error",
                       plot.script()};
}

std::optional<ChartScript> estimate_chart(const Panel& panel) {
    std::vector<double> xs, ys{0.4, 2.5};
    for (const Series& series : panel.series) {
        take(&xs, series.ratio.x);
        take(&ys, series.ratio.low);
        take(&ys, series.ratio.high);
    }
    if (xs.empty()) return std::nullopt;
    for (double& y : ys) y = std::clamp(y, 0.01, 100.0);  // A first estimate from two groups may be anything.
    Plot plot(panel.title + ": estimated against true error");
    const Axis x = Axis::around(xs), y = Axis::around(ys);
    plot.log_axis('x', x, kSamples);
    plot.log_axis('y', y, "estimated / true relMSE");
    plot.line("set object 1 rectangle from graph 0, first " + exact(1 / 1.5) + " to graph 1, first 1.5 behind fillcolor rgb '" +
              colour::kGrid + "' fillstyle solid 0.6 noborder");
    plot.line("set arrow 1 from graph 0, first 1 to graph 1, first 1 nohead lw 1 lc rgb '" + std::string(colour::kSoft) + "' back");
    plot.label("within a factor of 1.5", "graph 0.985, first 1.5 right offset 0,-0.45", colour::kSoft, 9);
    std::vector<Plot::Name> names;
    for (const Series& series : panel.series) {
        if (series.ratio.x.empty()) continue;
        plot.series(series.ratio, series.style, series.label, 0);
        names.push_back({y.position(series.ratio.middle.back()), series.style, series.label});
    }
    plot.names(std::move(names));
    return ChartScript{"estimate", panel.title + ": relMSE that the runs of " + labels_of(panel) + " estimate over the true one",
                       plot.script()};
}

/// Classes that have at least a thousandth of something.
std::vector<std::string> class_names(const std::vector<const Techniques*>& rows) {
    std::vector<std::string> names;
    for (const Techniques* row : rows) {
        for (const TechniqueClass& entry : row->classes) {
            if (entry.light < 1e-3 && entry.noise.value_or(0) < 1e-3) continue;
            if (std::find(names.begin(), names.end(), entry.name) == names.end()) names.push_back(entry.name);
        }
    }
    return names;
}

void technique_bar(Plot* plot, const Techniques& row, const std::vector<std::string>& names, bool light, double y, double height) {
    double at = 0;
    for (size_t i = 0; i < names.size(); ++i) {
        const auto found = std::find_if(row.classes.begin(), row.classes.end(),
                                        [&](const TechniqueClass& entry) { return entry.name == names[i]; });
        if (found == row.classes.end()) continue;
        const double share = std::max(0.0, light ? found->light : found->noise.value_or(0));
        if (share <= 0) continue;
        plot->add(plot->data({{at + share / 2, y, at, at + share, y - height / 2, y + height / 2}}) +
                  " using 1:2:3:4:5:6 with boxxyerror fillstyle solid 1 border lc rgb '" + colour::kGround +
                  "' lw 1 fillcolor rgb '" + colour::technique(i) + "' title " + quoted(names[i]) + " noenhanced");
        if (share >= 0.1) {
            char text[16];
            std::snprintf(text, sizeof text, "%.0f", 100 * share);
            plot->label(text, "first " + exact(at + share / 2) + ", first " + exact(y) + " center", i < 2 ? "#ffffff" : "#111111",
                        10);
        }
        at += share;
    }
}

std::optional<ChartScript> technique_chart(const Panel& panel, const Results& results) {
    std::vector<const Techniques*> rows;
    for (const Series& series : panel.series)
        for (const Techniques& techniques : results.techniques)
            if (techniques.scene == panel.scene->name && techniques.label == series.label) rows.push_back(&techniques);
    const std::vector<std::string> names = class_names(rows);
    if (names.empty()) return std::nullopt;
    Plot plot(panel.title + ": light and noise by technique", {0.3, 0.97, 0.33, 0.89});
    plot.line("set xrange [0:1.0001]\nset xtics ('0' 0, '25' 0.25, '50' 0.5, '75' 0.75, '100' 1)\nset border 1");
    plot.line("set xlabel 'percent' font ',11' textcolor rgb '" + std::string(colour::kText) + "' offset 0,0.2");
    plot.line("set yrange [0.3:" + exact(double(rows.size()) + 0.7) + "]\nunset ytics");
    for (size_t i = 0; i < rows.size(); ++i) {
        const double y = double(rows.size() - i);
        technique_bar(&plot, *rows[i], names, true, y + 0.2, 0.36);
        technique_bar(&plot, *rows[i], names, false, y - 0.2, 0.36);
        plot.label("light", "graph -0.02, first " + exact(y + 0.2) + " right", colour::kSoft, 10);
        plot.label("noise", "graph -0.02, first " + exact(y - 0.2) + " right", colour::kSoft, 10);
        plot.name(rows[i]->label, "screen 0.012, first " + exact(y) + " left", colour::kText);
    }
    for (size_t i = 0; i < names.size(); ++i) {
        const double x = 0.05 + 0.32 * double(i % 3), y = 0.1 - 0.065 * double(i / 3);
        plot.line("set object " + std::to_string(10 + i) + " rectangle from screen " + exact(x) + ", screen " + exact(y - 0.02) +
                  " to screen " + exact(x + 0.028) + ", screen " + exact(y + 0.02) + " fillcolor rgb '" + colour::technique(i) +
                  "' fillstyle solid 1 border lc rgb '" + colour::kAxis + "' lw 0.5");
        plot.label(shortened(names[i], 18), "screen " + exact(x + 0.04) + ", screen " + exact(y) + " left", colour::kText, 10);
    }
    return ChartScript{"techniques", panel.title + ": shares of light and of noise that each class of techniques has",
                       plot.script()};
}

}  // namespace

std::vector<ChartScript> chart_scripts(const Panel& panel, const Results& results) {
    std::vector<ChartScript> charts{error_chart(panel, true), error_chart(panel, false), front_chart(panel)};
    if (auto chart = speed_up_chart(panel)) charts.push_back(std::move(*chart));
    if (auto chart = estimate_chart(panel)) charts.push_back(std::move(*chart));
    if (auto chart = technique_chart(panel, results)) charts.push_back(std::move(*chart));
    return charts;
}

}  // namespace lightloom::client::report
