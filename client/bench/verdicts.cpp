#include "client/bench/verdicts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "client/bench/numbers.h"
#include "client/bench/results_file.h"
#include "client/text_table.h"

namespace lightloom::client {
namespace {

/// A field that is missing or wrong. Reading a line throws it, and judge_results() alone catches it.
struct BadField {
    std::string what;
};

const Json& field(const Json& object, const std::string& name) {
    const auto found = object.find(name);
    if (found == object.end()) throw BadField{"\"" + name + "\" is missing"};
    return *found;
}
std::string text(const Json& object, const std::string& name) {
    const Json& value = field(object, name);
    if (!value.is_string()) throw BadField{"\"" + name + "\" is not a text"};
    return value;
}
double number(const Json& object, const std::string& name) {
    const Json& value = field(object, name);
    if (!value.is_number()) throw BadField{"\"" + name + "\" is not a number"};
    return value;
}
uint64_t count(const Json& object, const std::string& name) {
    const Json& value = field(object, name);
    if (!value.is_number_unsigned() && !(value.is_number_integer() && value.get<int64_t>() >= 0))
        throw BadField{"\"" + name + "\" is not a count"};
    return value;
}
std::optional<double> number_if_there(const Json& object, const std::string& name) {
    if (!object.contains(name)) return {};
    return number(object, name);
}
const Json& array(const Json& object, const std::string& name) {
    const Json& value = field(object, name);
    if (!value.is_array()) throw BadField{"\"" + name + "\" is not a list"};
    return value;
}
const Json& nested(const Json& object, const std::string& name) {
    const Json& value = field(object, name);
    if (!value.is_object()) throw BadField{"\"" + name + "\" is not an object"};
    return value;
}

StabilityReference reference_of(const Json& line) {
    StabilityReference reference{.regions = {}, .floor = number_if_there(line, "reference_relmse")};
    for (const Json& region : array(line, "reference_regions")) {
        if (!region.is_object()) throw BadField{"\"reference_regions\" is not a list of objects"};
        reference.regions.push_back({number(region, "mean"), number_if_there(region, "variance").value_or(HUGE_VAL)});
    }
    return reference;
}

StabilityCheckpoint checkpoint_of(const Json& line) {
    StabilityCheckpoint checkpoint{number(line, "iterations"), number(line, "relmse"), number(line, "relmse_trimmed"), {}};
    // The ratio to a black reference is infinite, which JSON has no number for.
    if (const auto ratio = line.find("mean_ratio"); ratio != line.end() && !ratio->is_null()) {
        const double value = number(line, "mean_ratio");
        if (std::isfinite(value)) checkpoint.mean_ratio = value;
    }
    return checkpoint;
}

/// All of a run but its checkpoints.
StabilityRun run_of(const Json& line) {
    StabilityRun run{.seed = count(line, "seed"), .checkpoints = {}, .region_means = {}, .fireflies = {}, .chance = {}};
    for (const Json& mean : array(line, "region_means")) {
        if (!mean.is_number()) throw BadField{"\"region_means\" is not a list of numbers"};
        run.region_means.push_back(mean);
    }
    const Json& fireflies = nested(line, "fireflies");
    run.fireflies = {count(fireflies, "count"), number(fireflies, "energy")};
    if (line.contains("rare_light")) {
        const Json& rare = nested(line, "rare_light");
        run.chance = {number(rare, "share"), number(rare, "unreachable_share"), number(rare, "expected_hits")};
    }
    return run;
}

/// A run by its key.
struct RunLines {
    std::vector<StabilityCheckpoint> checkpoints;
    std::optional<StabilityRun> end;
    size_t row = 0;
    bool cut = false;

    /// A run that was killed begins again, and its last line repeats the last checkpoint.
    void add(const StabilityCheckpoint& checkpoint) {
        if (!checkpoints.empty() && checkpoints.back().iterations > checkpoint.iterations) checkpoints.clear();
        if (!checkpoints.empty() && checkpoints.back().iterations == checkpoint.iterations) checkpoints.pop_back();
        checkpoints.push_back(checkpoint);
    }
};

/// What lines add up to.
struct Results {
    std::map<std::string, StabilityReference> references;  ///< By scene.
    std::map<std::string, RunLines> runs;                  ///< By key.
    std::vector<std::string> order;                        ///< Keys of finished runs.
    std::vector<Judged> rows;
    std::map<std::string, size_t> row_of;  ///< By scene, label and budget.

    void read_line(const Json& line) {
        if (!line.is_object()) throw BadField{"not an object"};
        const std::string type = text(line, "type");
        if (type == "scene") references[text(line, "scene")] = reference_of(line);
        if (type != "checkpoint" && type != "run") return;
        const std::string key = text(line, "run");
        RunLines& run = runs[key];
        run.add(checkpoint_of(line));
        if (type != "run") return;
        if (!run.end) order.push_back(key);
        run.end = run_of(line);
        run.row = row_for(line);
        run.cut = line.contains("cut");
    }

    size_t row_for(const Json& line) {
        const Json row{text(line, "scene"), text(line, "label"), nested(line, "budget")};
        const auto [found, is_new] = row_of.emplace(line_text(row), rows.size());
        if (is_new) rows.push_back({.scene = row[0], .label = row[1], .budget = row[2]});
        return found->second;
    }
};

Status judge_row(const std::vector<StabilityRun>& runs, const Results& results, Judged* row) {
    const std::string where = "scene \"" + row->scene + "\", " + row->label + ": ";
    const auto reference = results.references.find(row->scene);
    if (reference == results.references.end()) return invalid_argument(where + "there is no line of type \"scene\" for it");
    Result<Stability> stability = judge_stability(runs, reference->second);
    if (!stability.ok()) return invalid_argument(where + stability.status().message());
    row->stability = *std::move(stability);
    return {};
}

std::string share_text(double share) { return formatted("%.3g %%", 100 * share); }

std::string budget_text(const Json& budget) {
    std::string words;
    for (const auto& [unit, amount] : budget.items())
        words += (words.empty() ? "" : ", ") + (amount.is_number() ? formatted("%g", amount) : amount.dump()) + " " + unit;
    return words;
}

void put(Json* json, const char* name, double value) {
    if (std::isfinite(value)) (*json)[name] = value;
}

Json mean_json(const SeedMean& mean) {
    Json json{{"mean", mean.mean}};
    if (mean.count > 1) json["standard_error"] = mean.error;
    return json;
}

}  // namespace

Result<std::vector<Judged>> judge_results(std::span<const Json> lines) {
    Results results;
    for (size_t i = 0; i < lines.size(); ++i) {
        try {
            results.read_line(lines[i]);
        } catch (const BadField& bad) {
            return invalid_argument("line " + std::to_string(i + 1) + " of the results: " + bad.what +
                                    "; this is no file of lightloom bench, or one of another version");
        }
    }
    std::vector<std::vector<StabilityRun>> runs(results.rows.size());
    std::vector<double> longest(results.rows.size());
    for (const std::string& key : results.order) {
        const RunLines& run = results.runs[key];
        longest[run.row] = std::max(longest[run.row], run.checkpoints.back().iterations);
    }
    for (const std::string& key : results.order) {
        RunLines& lines_of_run = results.runs[key];
        Judged& judged = results.rows[lines_of_run.row];
        judged.cut += lines_of_run.cut;
        if (much_shorter(lines_of_run.checkpoints.back().iterations, longest[lines_of_run.row])) {
            ++judged.left_out;
            continue;
        }
        lines_of_run.end->checkpoints = std::move(lines_of_run.checkpoints);
        runs[lines_of_run.row].push_back(*std::move(lines_of_run.end));
    }
    for (size_t row = 0; row < results.rows.size(); ++row) LL_RETURN_IF_ERROR(judge_row(runs[row], results, &results.rows[row]));
    return std::move(results.rows);
}

std::string verdict_table(std::span<const Judged> judged) {
    std::vector<std::vector<std::string>> rows{
        {"SCENE", "ALGORITHM", "BUDGET", "SEEDS", "relMSE", "VARIES", "SLOPE", "RISING", "FIREFLIES", "LIGHT", "VERDICT"}};
    for (const Judged& row : judged) {
        const Stability& s = row.stability;
        const double light = s.regions[0].ratio;
        std::string verdict = s.verdict;
        if (row.left_out > 0)
            verdict.append("; without ").append(std::to_string(row.left_out)).append(" run(s) that a budget cut to less than half");
        const std::string cut = row.cut > 0 ? ", " + std::to_string(row.cut) + " cut" : "";
        rows.push_back({cell(row.scene, 24), cell(row.label, 32), budget_text(row.budget) + cut, std::to_string(s.seeds),
                        formatted("%.3g", s.error.mean), s.seeds > 1 ? share_text(s.variation) : "-",
                        s.slope ? formatted("%.2f", s.slope->mean) : "-", share_text(s.rising),
                        formatted("%.3g", s.firefly_count.mean), std::isfinite(light) ? share_text(light) : "-", verdict});
    }
    return text_table(rows);
}

Json verdict_json(std::span<const Judged> judged) {
    Json all = Json::array();
    for (const Judged& row : judged) {
        const Stability& s = row.stability;
        Json json{{"scene", row.scene}, {"label", row.label},   {"budget", row.budget},         {"seeds", s.seeds},
                  {"flags", s.flags()}, {"verdict", s.verdict}, {"relmse", mean_json(s.error)}, {"variation", s.variation}};
        put(&json, "spread", s.spread);
        if (row.cut > 0) json["cut"] = row.cut;
        if (row.left_out > 0) json["left_out"] = row.left_out;
        json["worst_seed"] = s.worst_seed;
        json["worst_seed_share"] = s.worst_seed_share;
        json["concentration"] = s.concentration;
        if (s.slope) json["slope"] = mean_json(*s.slope);
        json["rising"] = s.rising;
        json["fireflies"] = {{"count", mean_json(s.firefly_count)}, {"energy", mean_json(s.firefly_energy)}};
        json["regions"] = Json::array();
        for (size_t r = 0; r < s.regions.size(); ++r) {
            Json region{{"name", region_name(r, s.regions.size())}};
            put(&region, "ratio", s.regions[r].ratio);
            put(&region, "low", s.regions[r].low);
            put(&region, "high", s.regions[r].high);
            json["regions"].push_back(std::move(region));
        }
        json["worst_region"] = region_name(s.worst_region, s.regions.size());
        if (s.bias_bound) json["bias_bound"] = *s.bias_bound;
        json["tiny"] = {{"iterations", s.tiny.iterations}, {"relmse", mean_json(s.tiny.relmse)}};
        if (s.tiny.mean_ratio.count > 0) {
            json["tiny"]["mean_ratio"] = mean_json(s.tiny.mean_ratio);
            json["tiny"]["least_mean_ratio"] = s.tiny.least_mean_ratio;
        }
        all.push_back(std::move(json));
    }
    return all;
}

}  // namespace lightloom::client
