#include "client/report/tables.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "client/html.h"
#include "client/report/charts.h"

namespace lightloom::client::report {
namespace {

std::string joined(const std::vector<std::string>& parts, const char* between) {
    std::string out;
    for (const std::string& part : parts) out += (out.empty() ? "" : between) + part;
    return out;
}

std::string cell(const std::string& content, const char* kind = "n") {
    return "<td class=" + std::string(kind) + ">" + content + "</td>";
}

std::string percent(double share) {
    if (share > 0 && share < 0.001) return "&lt; 0.1 %";
    return formatted(share < 0.0995 ? "%.1f %%" : "%.0f %%", 100 * share);
}

std::string factor_text(double factor) {
    if (factor < 0.001) return "&lt; 0.001";
    if (factor >= 1000) return "&gt; 1000";
    return formatted(factor < 99.5 ? "%.2g" : "%.0f", factor);
}

std::string interval_html(const SpeedUp& speed_up) {
    if (!speed_up.low) return "";
    return "<small>" + factor_text(*speed_up.low) + " – " + factor_text(*speed_up.high) + "</small>";
}

/// A cell tinted by how much faster or slower.
std::string factor_cell(const SpeedUp& speed_up, const std::string& below) {
    const double strength = std::min(1.0, std::fabs(std::log2(speed_up.factor)) / 5);
    const bool certain = !speed_up.low || *speed_up.low > 1 || *speed_up.high < 1;
    std::string kind = "n";
    if (certain && strength > 0.01) kind = speed_up.factor > 1 ? "\"n up\"" : "\"n down\"";
    return "<td class=" + kind + " style=\"--a:" + formatted("%.2f", 0.08 + 0.37 * strength) + "\"><b>" + to_text(speed_up) +
           "</b>" + (below.empty() ? "" : "<br>") + below + "</td>";
}

constexpr double kShown = 1e-3;  ///< Seconds of preparation that are worth a column.

struct Chip {
    const char *kind, *symbol, *word;
    bool needs_notice = true;  ///< Also in the summary.
};

/// The gravest finding; the verdict's words have them all.
Chip chip_of(const Stability& s) {
    if (s.biased) return {"bad", "✗", "biased"};
    if (s.finds_nothing) return {"bad", "✗", "finds almost nothing"};
    if (s.no_better_than_black) return {"bad", "✗", "no better than black"};
    if (s.heavy_tail) return {"warn", "▲", "heavy tail"};
    if (s.misses_light) return {"warn", "▲", "misses light"};
    if (s.stalls) return {"warn", "▲", "stalls"};
    if (s.has_fireflies) return {"warn", "▲", "fireflies"};
    if (!s.judged) return {"none", "–", "not judged", false};
    return {"good", "✓", "sound", false};
}

/// False for a few seeds without any finding, of which a scene's table does not speak.
bool says_something(const Stability& stability) { return stability.judged || chip_of(stability).needs_notice; }

std::string chip_html(const Stability& stability) {
    const Chip chip = chip_of(stability);
    return "<span class=\"chip " + std::string(chip.kind) + "\">" + chip.symbol + " " + escaped_html(chip.word) + "</span>";
}

Budget budget_of(const Json& json) {
    const auto value = [&](const char* key) { return json.contains(key) && json[key].is_number() ? json[key].get<double>() : 0.0; };
    return {value("seconds"), value("samples")};
}

const Judged* judged_of(const Report& report, const Panel& panel, const std::string& label) {
    for (const Judged& judged : report.judged)
        if (judged.scene == panel.scene->name && judged.label == label && budget_of(judged.budget) == panel.budget) return &judged;
    return nullptr;
}

size_t style_of(const Report& report, const std::string& label) {
    const auto& labels = report.comparison.labels;
    return size_t(std::find(labels.begin(), labels.end(), label) - labels.begin());
}

std::string seed_mean(const SeedMean& mean, const char* format) {
    if (mean.count == 0) return "";
    return formatted(format, mean.mean) + (mean.count > 1 ? " <small>± " + formatted("%.2g", mean.error) + "</small>" : "");
}

std::string region_html(const Stability& stability) {
    if (stability.worst_region >= stability.regions.size()) return "";
    const RatioInterval& interval = stability.regions[stability.worst_region];
    const auto change = [](double ratio) {
        return std::isfinite(ratio) ? std::string(ratio >= 1 ? "+" : "−") + formatted("%.2g %%", 100 * std::fabs(ratio - 1)) : "?";
    };
    return escaped_html(region_name(stability.worst_region, stability.regions.size())) + "<br>" + change(interval.ratio) +
           " <small>" + change(interval.low) + " … " + change(interval.high) + "</small>";
}

std::string verdict_row(const Report& report, const Judged& judged) {
    const Stability& s = judged.stability;
    std::string out = "<tr><th scope=row>" + label_html(judged.label, style_of(report, judged.label)) + "<br><small>" +
                      budget_of(judged.budget).text() + ", " + std::to_string(s.seeds) + (s.seeds == 1 ? " seed" : " seeds") +
                      "</small></th><td class=words>" + chip_html(s) + "<br>" + escaped_html(s.verdict) + "</td>";
    out += cell(s.slope ? seed_mean(*s.slope, "%.2f") : "");
    out += cell(std::isfinite(s.spread) ? formatted("%.3g", s.spread) + "×" : "∞");
    out += cell(std::to_string(s.worst_seed) + "<br><small>" + percent(s.worst_seed_share) + " of the error</small>");
    out += cell(region_html(s), "t");
    out += cell(seed_mean(s.firefly_count, "%.3g") +
                (s.firefly_energy.mean > 0 ? "<br><small>" + percent(s.firefly_energy.mean) + " of the light</small>" : ""));
    return out + "</tr>\n";
}

}  // namespace

std::string number_html(double value) {
    if (value == std::round(value) && std::fabs(value) < 1e6) return formatted("%.0f", value);
    if ((std::fabs(value) >= 1e-4 && std::fabs(value) < 1e5)) return formatted("%.3g", value);
    const int power = int(std::floor(std::log10(std::fabs(value))));
    const std::string sign = power < 0 ? "−" : "";
    return formatted("%.3g", value / std::pow(10, power)) + " · 10<sup>" + sign + std::to_string(std::abs(power)) + "</sup>";
}

std::string seconds_text(double seconds) {
    if (seconds < 90) return formatted("%.3g s", seconds);
    const int whole = int(std::lround(seconds));
    if (whole < 5400) return std::to_string(whole / 60) + " min" + (whole % 60 ? " " + std::to_string(whole % 60) + " s" : "");
    return std::to_string(whole / 3600) + " h " + std::to_string(whole % 3600 / 60) + " min";
}

std::string label_html(const std::string& label, size_t style) {
    return "<span class=key style=\"color:var(--s" + std::to_string(style % 8) + ")\">" + symbol(style) + "</span>&nbsp;" +
           escaped_html(label);
}

std::string summary_table(const Report& report) {
    const Comparison& comparison = report.comparison;
    std::string out = "<div class=scroll><table>\n<thead><tr><th scope=col>scene</th>";
    for (size_t i = 0; i < comparison.labels.size(); ++i)
        out += "<th scope=col class=n>" + label_html(comparison.labels[i], i) + "</th>";
    out += "</tr></thead>\n<tbody>\n";
    for (size_t p = 0; p < comparison.panels.size(); ++p) {
        const Panel& panel = comparison.panels[p];
        out += "<tr><th scope=row><a href=\"#scene-" + std::to_string(p + 1) + "\">" + escaped_html(panel.title) + "</a></th>";
        for (size_t i = 0; i < comparison.labels.size(); ++i) {
            const auto series =
                std::find_if(panel.series.begin(), panel.series.end(), [&](const Series& s) { return s.style == i; });
            if (series == panel.series.end()) {
                out += cell("–");
                continue;
            }
            std::string below = "<small>" + number_html(series->error) + "</small>";
            if (const Judged* judged = judged_of(report, panel, series->label); judged && chip_of(judged->stability).needs_notice) {
                const Chip chip = chip_of(judged->stability);
                below += " <span class=\"mark " + std::string(chip.kind) + "\" title=\"" + escaped_html(chip.word) + "\">" +
                         chip.symbol + "</span>";
            }
            out += series->speed_up ? factor_cell(*series->speed_up, below) : cell(below);
        }
        out += "</tr>\n";
    }
    out += "</tbody>\n<tfoot><tr><th scope=row>geometric mean</th>";
    for (size_t i = 0; i < comparison.labels.size(); ++i) {
        const auto& mean = comparison.means[i];
        const int count = comparison.mean_counts[i];
        std::string below = mean && i > 0 ? interval_html(*mean) : "";
        if (count != comparison.mean_counts[0])
            below += " <small>" + std::to_string(count) + (count == 1 ? " scene" : " scenes") + "</small>";
        out += mean ? factor_cell(*mean, below) : cell("–");
    }
    return out + "</tr></tfoot></table></div>\n";
}

std::string scene_table(const Report& report, const Panel& panel) {
    bool prepared = false, tracked = false, judged_any = false, marked = false;
    for (const Series& series : panel.series) {
        prepared |= series.preparation >= kShown;
        tracked |= series.tracking.checkpoints > 0;
        const Judged* judged = judged_of(report, panel, series.label);
        judged_any |= judged && says_something(judged->stability);
        marked |= !series.marks.empty();
    }
    std::string out =
        "<div class=scroll><table>\n<thead><tr><th scope=col>algorithm</th><th scope=col class=n>relMSE at the end</th>"
        "<th scope=col class=n>time</th>";
    if (prepared) out += "<th scope=col class=n>of it preparation</th>";
    out += "<th scope=col class=n>samples per pixel</th><th scope=col class=n>speed-up</th><th scope=col class=n>95 %</th>";
    if (tracked) out += "<th scope=col class=n>estimate within 1.5×</th>";
    out += "<th scope=col class=n>seeds</th>";
    if (judged_any) out += "<th scope=col>verdict</th>";
    if (marked) out += "<th scope=col>remarks</th>";
    out += "</tr></thead>\n<tbody>\n";
    for (const Series& series : panel.series) {
        out += "<tr><th scope=row>" + label_html(series.label, series.style) + "</th>";
        out += cell(number_html(series.error) +
                    (series.error_uncertainty
                         ? " <small>± " + number_html(std::stod(formatted("%.2g", *series.error_uncertainty))) + "</small>"
                         : ""));
        out += cell(seconds_text(series.seconds));
        if (prepared) out += cell(series.preparation >= kShown ? seconds_text(series.preparation) : "–");
        out += cell(number_html(std::round(series.samples)));
        out += series.speed_up ? factor_cell(*series.speed_up, "") + cell(interval_html(*series.speed_up)) : cell("–") + cell("");
        if (tracked) {
            const Tracking& t = series.tracking;
            out += cell(t.checkpoints > 0 ? formatted("%.0f %%", 100.0 * t.within / t.checkpoints) + " <small>of " +
                                                std::to_string(t.checkpoints) + "</small>"
                                          : "–");
        }
        out += cell(std::to_string(series.runs.size()));
        if (judged_any) {
            const Judged* judged = judged_of(report, panel, series.label);
            out += cell(judged && says_something(judged->stability) ? chip_html(judged->stability) : "", "t");
        }
        if (marked) out += cell(escaped_html(joined(series.marks, "; ")), "t");
        out += "</tr>\n";
    }
    return out + "</tbody></table></div>\n";
}

std::string verdict_table_html(const Report& report) {
    if (report.judged.empty()) return "";
    std::string out =
        "<div class=scroll><table class=verdicts>\n<thead><tr><th scope=col>algorithm</th><th scope=col>verdict</th>"
        "<th scope=col class=n>slope</th><th scope=col class=n>spread</th><th scope=col class=n>worst seed</th>"
        "<th scope=col>worst region</th><th scope=col class=n>fireflies per run</th></tr></thead>\n";
    for (const SceneInfo& scene : report.results.scenes) {
        std::string rows;
        for (const Judged& judged : report.judged)
            if (judged.scene == scene.name) rows += verdict_row(report, judged);
        if (rows.empty()) continue;
        out += "<tbody><tr class=group><th colspan=7 scope=rowgroup>" + escaped_html(scene.name) +
               (scene.claim.empty() ? "" : " <small>" + escaped_html(scene.claim) + "</small>") + "</th></tr>\n" + rows +
               "</tbody>\n";
    }
    return out + "</table></div>\n";
}

std::string origin_table(const Report& report) {
    std::string out =
        "<div class=scroll><table>\n<thead><tr><th scope=col>begun (UTC)</th><th scope=col>suite</th><th scope=col>build</th>"
        "<th scope=col>machine</th><th scope=col class=n>threads</th></tr></thead>\n<tbody>\n";
    for (const Start& start : report.results.starts) {
        std::vector<std::string> machine;
        if (!start.processor.empty()) machine.push_back(start.processor);
        if (start.logical_processors > 0) machine.push_back(formatted("%.0f logical processors", start.logical_processors));
        if (start.memory_bytes > 0) machine.push_back(formatted("%.1f GB", start.memory_bytes / 1e9));
        if (!start.system.empty()) machine.push_back(start.system);
        if (!start.server.empty()) machine.push_back("service at " + start.server);
        std::string suite = escaped_html(start.suite);
        if (!start.suite_digest.empty())
            suite += " <small><code>" + escaped_html(start.suite_digest.substr(0, 16)) + "</code></small>";
        if (start.stability) suite += " <small>stability</small>";
        if (start.budget_seconds) suite += " <small>budget " + seconds_text(*start.budget_seconds) + "</small>";
        out += "<tr>" + cell(escaped_html(start.utc), "t") + cell(suite, "t") + cell(escaped_html(start.build), "t") +
               cell(escaped_html(joined(machine, ", ")), "t") + cell(start.threads > 0 ? formatted("%.0f", start.threads) : "") +
               "</tr>\n";
    }
    return out + "</tbody></table></div>\n";
}

}  // namespace lightloom::client::report
