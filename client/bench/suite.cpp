#include "client/bench/suite.h"

#include <cmath>
#include <filesystem>
#include <set>
#include <span>

#include "client/bench/numbers.h"
#include "common/core/atomic_file.h"
#include "common/core/digest.h"
#include "common/core/nearest.h"

namespace lightloom::client {
namespace {

/// An object of the file, which names itself in errors and refuses what nobody reads.
class Reader {
  public:
    Reader(const Json& json, std::string where, Status& status) : json_(json), where_(std::move(where)), status_(status) {
        if (!json.is_object()) fail("", "has to be an object, {...}");
    }

    /// The member, or nothing; known from now on.
    const Json* find(const char* key) {
        known_.push_back(key);
        if (!json_.is_object()) return nullptr;
        const auto found = json_.find(key);
        return found == json_.end() ? nullptr : &*found;
    }
    void read(const char* key, std::string& out) {
        const Json* value = find(key);
        if (!value) return;
        value->is_string() ? out = value->get<std::string>() : (fail(key, "has to be a text"), out);
    }
    void read(const char* key, bool& out) {
        const Json* value = find(key);
        if (!value) return;
        value->is_boolean() ? out = value->get<bool>() : (fail(key, "has to be true or false"), out);
    }
    void read(const char* key, double& out, double low, double high) {
        const Json* value = find(key);
        if (!value) return;
        if (!value->is_number() || !(value->get<double>() >= low && value->get<double>() <= high))
            return fail(key, "has to be a number from " + formatted("%.4g", low) + " to " + formatted("%.4g", high));
        out = value->get<double>();
    }
    template <class Integer>
    void read_whole(const char* key, Integer& out, uint64_t low, uint64_t high) {
        const Json* value = find(key);
        if (!value) return;
        if (!value->is_number_unsigned() || value->get<uint64_t>() < low || value->get<uint64_t>() > high)
            return fail(key, "has to be a whole number from " + std::to_string(low) + " to " + std::to_string(high));
        out = Integer(value->get<uint64_t>());
    }
    /// The member as a list; a single object or text stands for a list of one.
    std::vector<const Json*> list(const char* key) {
        std::vector<const Json*> items;
        const Json* value = find(key);
        if (!value) return items;
        if (!value->is_array()) return {value};
        for (const Json& item : *value) items.push_back(&item);
        if (items.empty()) fail(key, "is an empty list");
        return items;
    }
    void fail(const std::string& key, const std::string& what) {
        if (!status_.ok()) return;
        status_ = invalid_argument(where_ + (key.empty() ? " " : ": \"" + key + "\" ") + what);
    }
    /// Refuses members that nobody asked for.
    void done() {
        if (!json_.is_object()) return;
        for (const auto& [key, value] : json_.items()) {
            if (std::find(known_.begin(), known_.end(), key) == known_.end())
                fail(key, "is not known here" + did_you_mean(key, known_));
        }
    }
    const std::string& where() const { return where_; }
    Status& status() { return status_; }

  private:
    const Json& json_;
    std::string where_;
    Status& status_;
    std::vector<std::string_view> known_;
};

constexpr double kMaxSeconds = 30 * 86400.0;

RunBudget read_budget(const Json& json, const std::string& where, Status& status) {
    Reader reader(json, where, status);
    RunBudget budget;
    reader.read("seconds", budget.seconds, 0.001, kMaxSeconds);
    reader.read_whole("samples", budget.samples, 1, JobSpec::kMaxSamplesPerPixel);
    reader.done();
    if ((budget.seconds > 0) == (budget.samples > 0)) reader.fail("", "needs either \"seconds\" or \"samples\"");
    return budget;
}

AlgorithmChoice read_algorithm(const std::string& word, const std::string& where, Status& status) {
    const auto choice = parse_algorithm(word);
    if (choice.ok()) return *choice;
    if (status.ok()) status = invalid_argument(where + ": " + choice.status().message());
    return {};
}

std::optional<ReferenceRecipe> read_recipe(const Json& json, const std::string& where, Status& status) {
    Reader reader(json, where, status);
    ReferenceRecipe recipe;
    std::string word;
    reader.read("algorithm", word);
    reader.read("seconds", recipe.budget.seconds, 0.001, kMaxSeconds);
    reader.read_whole("samples", recipe.budget.samples, 1, JobSpec::kMaxSamplesPerPixel);
    reader.read_whole("seed", recipe.seed, 0, ~uint64_t(0));
    reader.done();
    if (word.empty()) reader.fail("", "needs \"algorithm\"");
    if ((recipe.budget.seconds > 0) == (recipe.budget.samples > 0)) reader.fail("", "needs either \"seconds\" or \"samples\"");
    if (!status.ok()) return std::nullopt;
    recipe.algorithm = read_algorithm(word, where, status);
    return recipe;
}

/// What scenes inherit from the suite and may say themselves.
struct Common {
    std::string resolution;
    int max_depth = -1;
    uint64_t seed = 1;
    uint32_t seeds = 3;
    std::vector<AlgorithmChoice> algorithms;
    std::vector<RunBudget> budgets;
    std::optional<ReferenceRecipe> recipe;
};

void read_common(Reader& reader, Common& common) {
    reader.read("resolution", common.resolution);
    reader.read_whole("max_depth", common.max_depth, 0, kMaxEdges - 1);
    reader.read_whole("first_seed", common.seed, 0, ~uint64_t(0) - 1000);
    reader.read_whole("seeds", common.seeds, 1, 1000);
    const auto budgets = reader.list("budgets");
    if (!budgets.empty()) common.budgets.clear();
    for (const Json* item : budgets)
        common.budgets.push_back(read_budget(*item, reader.where() + ": \"budgets\"", reader.status()));
    const auto algorithms = reader.list("algorithms");
    if (!algorithms.empty()) common.algorithms.clear();
    for (const Json* item : algorithms) {
        if (!item->is_string()) return reader.fail("algorithms", "has to be a list of texts like \"bdpt:heuristic=power\"");
        AlgorithmChoice choice = read_algorithm(*item, reader.where(), reader.status());
        for (const AlgorithmChoice& other : common.algorithms) {
            if (reader.status().ok() && other.settings == choice.settings)
                reader.fail("algorithms", "names " + choice.label + " twice");
        }
        common.algorithms.push_back(std::move(choice));
    }
}

/// Words that the judge of stability may be expected to say.
constexpr std::string_view kVerdictWords[] = {"sound",      "biased", "misses-light", "finds-nothing",
                                              "heavy-tail", "stalls", "fireflies",    "no-better-than-black"};

Expectation read_expectation(const Json& json, const SuiteScene& scene, const std::string& where, Status& status) {
    Reader reader(json, where, status);
    Expectation e;
    std::string error, mean, verdict;
    reader.read("error", error);
    reader.read("over", e.other);
    reader.read("mean_ratio", mean);
    reader.read("verdict", verdict);
    reader.read("is", e.word);
    std::string is_not;
    reader.read("is_not", is_not);
    double low = -HUGE_VAL, high = HUGE_VAL;
    reader.read("at_least", low, -1e30, 1e30);
    reader.read("at_most", high, -1e30, 1e30);
    reader.done();
    if (int(!error.empty()) + int(!mean.empty()) + int(!verdict.empty()) != 1)
        reader.fail("", "needs one of \"error\", \"mean_ratio\" and \"verdict\", each the name of an algorithm");
    e.algorithm = error + mean + verdict;
    e.low = low, e.high = high;
    if (!verdict.empty()) {
        e.kind = Expectation::Kind::kVerdict;
        if (e.word.empty() == is_not.empty()) reader.fail("", "needs either \"is\" or \"is_not\"");
        if (!is_not.empty()) e.word = is_not, e.negated = true;
        if (std::find(std::begin(kVerdictWords), std::end(kVerdictWords), e.word) == std::end(kVerdictWords))
            reader.fail("is",
                        "has to be one of sound, biased, misses-light, finds-nothing, heavy-tail, stalls, fireflies and "
                        "no-better-than-black");
    } else {
        e.kind = !mean.empty()     ? Expectation::Kind::kMeanRatio
                 : e.other.empty() ? Expectation::Kind::kError
                                   : Expectation::Kind::kErrorRatio;
        if (low == -HUGE_VAL && high == HUGE_VAL) reader.fail("", "needs \"at_least\" or \"at_most\"");
    }
    for (const std::string& label : {e.algorithm, e.other}) {
        const auto named = [&](const AlgorithmChoice& choice) { return choice.label == label; };
        if (!label.empty() && std::none_of(scene.algorithms.begin(), scene.algorithms.end(), named))
            reader.fail("", "speaks of " + label + ", which is not among the scene's algorithms");
    }
    return e;
}

SuiteScene read_scene(const Json& json, const Common& inherited, const std::filesystem::path& directory, const std::string& where,
                      Status& status) {
    Reader reader(json, where, status);
    SuiteScene scene;
    Common common = inherited;
    const auto resolved = [&](const std::string& file) {
        return file.empty() ? file : (directory / file).lexically_normal().string();
    };
    std::string file;
    reader.read("file", file);
    if (file.empty()) reader.fail("", "needs \"file\"");
    scene.job.scene = resolved(file);
    scene.name = std::filesystem::path(file).stem().string();
    reader.read("name", scene.name);
    if (scene.name.empty() || scene.name.find_first_of("/\\\n\t") != std::string::npos || scene.name.front() == '.')
        reader.fail("name", "is a part of file names: no slashes or line breaks, and no dot at its beginning");
    reader.read("claim", scene.claim);
    reader.read("optional", scene.optional);
    reader.read("root", scene.job.reading.root);
    scene.job.reading.root = resolved(scene.job.reading.root);
    for (const Json* item : reader.list("without")) {
        if (item->is_string())
            scene.job.reading.without.push_back(*item);
        else
            reader.fail("without", "has to be a list of texts");
    }
    if (const Json* reference = reader.find("reference")) {
        if (reference->is_string())
            scene.reference = resolved(*reference);
        else
            common.recipe = read_recipe(*reference, where + ": \"reference\"", status);
    }
    read_common(reader, common);
    scene.job.resolution = common.resolution;
    scene.job.max_depth = common.max_depth;
    scene.job.seed = common.seed;
    scene.seeds = common.seeds;
    scene.recipe = common.recipe;
    scene.algorithms = common.algorithms;
    scene.budgets = common.budgets;
    for (const Json* item : reader.list("expect"))
        scene.expectations.push_back(read_expectation(*item, scene, where + ": \"expect\"", status));
    reader.done();
    if (scene.algorithms.empty()) reader.fail("", "has no \"algorithms\", nor has the suite");
    if (scene.budgets.empty()) reader.fail("", "has no \"budgets\", nor has the suite");
    return scene;
}

}  // namespace

Json RunBudget::json() const {
    Json json = Json::object();
    if (seconds > 0) json["seconds"] = seconds;
    if (samples > 0) json["samples"] = samples;
    return json;
}

std::string RunBudget::text() const {
    std::string text = samples > 0 ? std::to_string(samples) + " spp" : "";
    if (seconds > 0) text.append(text.empty() ? "" : ", ").append(formatted("%.4g", seconds)).append(" s");
    return text;
}

std::string Expectation::text() const {
    if (kind == Kind::kVerdict) return "verdict of " + algorithm + (negated ? " is not \"" : " is \"") + word + "\"";
    std::string text = kind == Kind::kMeanRatio ? "mean of " + algorithm + " over the reference's"
                                                : "relMSE of " + algorithm + (other.empty() ? "" : " over that of " + other);
    if (low > -HUGE_VAL) text += " is at least " + formatted("%.4g", low);
    if (high < HUGE_VAL) text += (low > -HUGE_VAL ? " and at most " : " is at most ") + formatted("%.4g", high);
    return text;
}

Result<Suite> parse_suite(const std::string& text, const std::string& file_name, bool stability) {
    Json json;
    try {
        json = Json::parse(text, nullptr, true, true);
    } catch (const Json::parse_error& error) {
        // The library's text begins with its own name and number in brackets.
        const std::string what = error.what();
        const size_t end = what.find("] ");
        return invalid_argument(file_name + ": not JSON: " + (end == std::string::npos ? what : what.substr(end + 2)));
    }
    Suite suite;
    suite.digest = sha256(text).hex();
    suite.stability = stability;
    Status status;
    Reader reader(json, file_name, status);
    Common common;
    reader.read("suite", suite.name);
    if (suite.name.empty()) reader.fail("", "needs \"suite\", a name");
    reader.read("description", suite.description);
    reader.read("threshold_percent", suite.threshold, 1e-6, 1e6);
    uint32_t shares = 2;
    reader.read_whole("share_iterations", shares, 0, 1000);
    if (!stability) suite.share_iterations = shares;
    std::string tables = "made";
    reader.read("tables", tables);
    if (tables != "made" && tables != "shared") reader.fail("tables", "has to be \"made\" or \"shared\"");
    suite.shared_tables = tables == "shared";
    if (const Json* reference = reader.find("reference"))
        common.recipe = read_recipe(*reference, file_name + ": \"reference\"", status);
    read_common(reader, common);
    uint32_t seeds = kStabilitySeeds;
    RunBudget budget{.samples = 16};
    if (const Json* block = reader.find("stability")) {
        Reader inner(*block, file_name + ": \"stability\"", status);
        inner.read_whole("seeds", seeds, kStabilitySeeds, 1000);
        if (const Json* given = inner.find("budget"))
            budget = read_budget(*given, file_name + ": \"stability\": \"budget\"", status);
        inner.done();
    }
    const std::filesystem::path directory = std::filesystem::path(file_name).parent_path();
    std::set<std::string> names;
    for (const Json* item : reader.list("scenes")) {
        suite.scenes.push_back(
            read_scene(*item, common, directory, file_name + ": scene " + std::to_string(suite.scenes.size() + 1), status));
        if (!names.insert(suite.scenes.back().name).second)
            reader.fail("scenes", "has two of the name " + suite.scenes.back().name + "; give one a \"name\"");
    }
    if (suite.scenes.empty()) reader.fail("", "needs \"scenes\"");
    reader.done();
    LL_RETURN_IF_ERROR(status);
    for (SuiteScene& scene : suite.scenes) {
        // Verdicts need many seeds, errors need runs that come near the end: each kind of expectation belongs to one kind of run.
        std::erase_if(scene.expectations,
                      [&](const Expectation& e) { return (e.kind == Expectation::Kind::kVerdict) != stability; });
        if (!stability) continue;
        scene.seeds = seeds;
        scene.budgets = {budget};
    }
    if (stability) suite.shared_tables = true;
    return suite;
}

Result<Suite> read_suite(const std::string& path, bool stability) {
    const auto text = read_file(path);
    if (!text.ok()) return text.status();
    return parse_suite(*text, path, stability);
}

}  // namespace lightloom::client
