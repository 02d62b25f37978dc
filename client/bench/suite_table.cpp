#include "client/bench/suite_table.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "client/bench/numbers.h"
#include "client/bench/verdicts.h"
#include "client/text_table.h"

namespace lightloom::client {
namespace {

/// Values of a field over the runs of (scene, label, budget), in the order in which these appear.
struct Runs {
    std::string scene, label;
    RunBudget budget;
    std::vector<const Json*> lines;

    std::vector<double> of(const char* field) const {
        std::vector<double> values;
        for (const Json* line : lines) {
            if (const auto found = line->find(field); found != line->end() && found->is_number()) values.push_back(*found);
        }
        return values;
    }
    bool any(const char* field) const {
        return std::any_of(lines.begin(), lines.end(), [&](const Json* line) { return line->contains(field); });
    }
};

std::vector<Runs> group(std::span<const Json> lines) {
    std::vector<Runs> groups;
    for (const Json& line : lines) {
        if (line.value("type", std::string()) != "run") continue;
        RunBudget budget;
        if (const auto found = line.find("budget"); found != line.end())
            budget = {found->value("seconds", 0.0), found->value("samples", uint64_t(0))};
        const std::string scene = line.value("scene", std::string()), label = line.value("label", std::string());
        const auto same = std::find_if(groups.begin(), groups.end(), [&](const Runs& runs) {
            return runs.scene == scene && runs.label == label && runs.budget == budget;
        });
        if (same != groups.end())
            same->lines.push_back(&line);
        else
            groups.push_back({scene, label, budget, {&line}});
    }
    for (Runs& runs : groups) {
        double longest = 0;
        for (const double iterations : runs.of("iterations")) longest = std::max(longest, iterations);
        std::erase_if(runs.lines, [&](const Json* line) { return much_shorter(line->value("iterations", 0.0), longest); });
    }
    return groups;
}

/// Standard error of the mean; NaN for one value.
double standard_error(const std::vector<double>& values) {
    double mean = 0, square = 0;
    for (const double v : values) mean += v / double(values.size());
    for (const double v : values) square += (v - mean) * (v - mean);
    return values.size() < 2 ? std::nan("") : std::sqrt(square / double(values.size() - 1) / double(values.size()));
}

/// The error of the runs themselves where the reference's own noise is known.
std::vector<double> errors_of(const Runs& runs) {
    const std::vector<double> own = runs.of("relmse_own");
    return own.size() == runs.lines.size() ? own : runs.of("relmse");
}

bool has_flag(const Stability& stability, const std::string& word) {
    if (word == "sound") return stability.sound();
    const std::vector<std::string> flags = stability.flags();
    return std::find(flags.begin(), flags.end(), word) != flags.end();
}

Outcome judge(const Expectation& e, const std::string& scene, const std::vector<Runs>& groups, std::span<const Judged> judged) {
    Outcome outcome{Outcome::Kind::kNotJudged, scene, e.text(), "no finished runs"};
    if (e.kind == Expectation::Kind::kVerdict) {
        for (const Judged& j : judged) {
            if (j.scene != scene || j.label != e.algorithm) continue;
            const bool holds = has_flag(j.stability, e.word) != e.negated;
            outcome.kind = holds ? Outcome::Kind::kHolds : Outcome::Kind::kFails;
            outcome.found = j.stability.verdict;
        }
        return outcome;
    }
    double value = 1;
    for (const std::string& label : {e.algorithm, e.other}) {
        if (label.empty()) continue;
        const Runs* last = nullptr;
        for (const Runs& runs : groups) {
            if (runs.scene == scene && runs.label == label) last = &runs;
        }
        if (!last) return outcome;
        if (e.kind == Expectation::Kind::kMeanRatio) {
            const std::vector<double> ratios = last->of("mean_ratio");
            value = std::accumulate(ratios.begin(), ratios.end(), 0.0) / double(ratios.size());
            continue;
        }
        const double error = median(errors_of(*last));
        // What is left of such an error without the reference's own is as uncertain as that, and may be negative.
        if (last->any("near_floor") || !(error > 0)) {
            outcome.found = label + " is too near the reference's own error";
            return outcome;
        }
        value = label == e.algorithm ? error : value / error;
    }
    if (!std::isfinite(value)) return outcome;
    outcome.kind = value >= e.low && value <= e.high ? Outcome::Kind::kHolds : Outcome::Kind::kFails;
    outcome.found = formatted("%.4g", value);
    return outcome;
}

}  // namespace

std::string suite_table(std::span<const Json> lines) {
    std::vector<std::vector<std::string>> rows{
        {"scene", "algorithm", "budget", "runs", "spp", "render s", "prepare s", "relMSE", "+-", ""}};
    for (const Runs& runs : group(lines)) {
        const std::vector<double> errors = errors_of(runs);
        // Near the reference's own error what is left of the runs' is anybody's guess: only a bound is known.
        const bool near = runs.any("near_floor");
        const std::string error = near ? "< " + formatted("%.3g", median(runs.of("relmse"))) : formatted("%.4g", median(errors));
        std::string note;
        if (near) note = "as small as the reference's own error";
        if (runs.any("cut")) note.append(note.empty() ? "" : "; ").append("cut by --budget");
        rows.push_back({runs.scene, runs.label, runs.budget.text(), std::to_string(runs.lines.size()),
                        formatted("%.0f", median(runs.of("iterations"))), formatted("%.2f", median(runs.of("seconds"))),
                        formatted("%.2f", median(runs.of("preparation_seconds"))), error,
                        errors.size() < 2 || near ? "" : formatted("%.2g", standard_error(errors)), note});
    }
    return text_table(rows);
}

Result<std::vector<Outcome>> judge_expectations(const Suite& suite, std::span<const Json> lines) {
    const std::vector<Runs> groups = group(lines);
    std::vector<Judged> judged;
    if (suite.stability) {
        auto judgement = judge_results(lines);
        if (!judgement.ok()) return judgement.status();
        judged = *std::move(judgement);
    }
    std::vector<Outcome> outcomes;
    for (const SuiteScene& scene : suite.scenes) {
        for (const Expectation& e : scene.expectations) outcomes.push_back(judge(e, scene.name, groups, judged));
    }
    return outcomes;
}

}  // namespace lightloom::client
