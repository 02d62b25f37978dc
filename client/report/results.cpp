#include "client/report/results.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>

#include "client/bench/results_file.h"
#include "common/core/atomic_file.h"

namespace lightloom::client::report {
namespace {

constexpr const char* kFormat = "lightloom-bench 2";

std::string shortest(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.4g", value);
    return text;
}

/// Fields of one line. The first that is missing or wrong is remembered, so that a reader may ask for all of them and look once.
class Fields {
  public:
    Fields(const Json& json, std::string what) : json_(json), what_(std::move(what)) {}

    bool has(const char* key) const { return json_.contains(key); }
    double number(const char* key, double least = 0) {
        const auto found = json_.find(key);
        if (found == json_.end()) return missing(key), least;
        if (!found->is_number() || !std::isfinite(found->get<double>()) || found->get<double>() < least) {
            wrong(key, "a number of at least " + shortest(least));
            return least;
        }
        return found->get<double>();
    }
    std::optional<double> maybe(const char* key, double least = 0) {
        if (!has(key)) return std::nullopt;
        return number(key, least);
    }
    std::string text(const char* key) {
        const auto found = json_.find(key);
        if (found == json_.end()) return missing(key), "";
        if (!found->is_string()) return wrong(key, "a text"), "";
        return found->get<std::string>();
    }
    std::string maybe_text(const char* key) { return has(key) ? text(key) : ""; }
    bool flag(const char* key) {
        if (!has(key)) return false;
        const Json& value = json_.at(key);
        if (!value.is_boolean()) wrong(key, "true or false");
        return value.is_boolean() && value.get<bool>();
    }
    /// An object or a list; an empty one if it is not there.
    const Json& inside(const char* key, bool list) {
        static const Json kNothing = Json::object(), kEmpty = Json::array();
        const auto found = json_.find(key);
        if (found == json_.end()) return missing(key), list ? kEmpty : kNothing;
        if (list ? found->is_array() : found->is_object()) return *found;
        wrong(key, list ? "a list" : "an object");
        return list ? kEmpty : kNothing;
    }
    void refuse(const std::string& message) {
        if (fault_.empty()) fault_ = message;
    }
    const std::string& fault() const { return fault_; }

  private:
    static std::string in_quotes(const char* key) { return std::string("\"").append(key).append("\""); }
    void missing(const char* key) { refuse(in_quotes(key) + " is missing in " + what_); }
    void wrong(const char* key, const std::string& wanted) { refuse(in_quotes(key) + " of " + what_ + " must be " + wanted); }
    const Json& json_;
    std::string what_, fault_;
};

Budget budget_of(const Json& json, Fields* line) {
    Fields fields(json, "\"budget\"");
    Budget budget{fields.maybe("seconds").value_or(0), fields.maybe("samples").value_or(0)};
    if (budget.seconds <= 0 && budget.samples <= 0) fields.refuse("a budget has \"seconds\" or \"samples\"");
    if (!fields.fault().empty()) line->refuse(fields.fault());
    return budget;
}

Start start_of(Fields& fields) {
    Start start;
    if (const std::string format = fields.text("format"); format != kFormat) {
        fields.refuse("the format is \"" + format + "\", and this program reads \"" + kFormat +
                      "\": measure again, or report with the program that measured");
    }
    start.suite = fields.maybe_text("suite");
    start.suite_digest = fields.maybe_text("suite_digest");
    start.utc = fields.maybe_text("utc");
    start.build = fields.maybe_text("build");
    start.server = fields.maybe_text("server");
    start.threads = fields.maybe("threads").value_or(0);
    start.stability = fields.flag("stability");
    start.budget_seconds = fields.maybe("budget_seconds");
    if (fields.has("machine")) {
        Fields machine(fields.inside("machine", false), "\"machine\"");
        start.processor = machine.maybe_text("processor");
        start.system = machine.maybe_text("system");
        start.logical_processors = machine.maybe("logical_processors").value_or(0);
        start.memory_bytes = machine.maybe("memory_bytes").value_or(0);
        if (!machine.fault().empty()) fields.refuse(machine.fault());
    }
    return start;
}

SceneInfo scene_of(Fields& fields) {
    SceneInfo scene;
    scene.name = fields.text("scene");
    scene.file = fields.maybe_text("file");
    scene.digest = fields.maybe_text("scene_digest");
    scene.claim = fields.maybe_text("claim");
    scene.width = int(fields.number("width", 1));
    scene.height = int(fields.number("height", 1));
    scene.max_depth = int(fields.maybe("max_depth").value_or(0));
    scene.reference = fields.maybe_text("reference");
    scene.reference_digest = fields.maybe_text("reference_digest");
    scene.reference_algorithm = fields.maybe_text("reference_algorithm");
    scene.reference_samples = fields.maybe("reference_samples_per_pixel");
    scene.floor = fields.maybe("reference_relmse");
    scene.reference_image = fields.maybe_text("reference_image");
    return scene;
}

Checkpoint checkpoint_of(Fields& fields) {
    Checkpoint point;
    point.iterations = fields.number("iterations", 1);
    point.seconds = std::max(fields.number("seconds"), 1e-6);  // Charts are logarithmic.
    point.preparation = fields.maybe("preparation_seconds").value_or(0);
    point.mape_percent = fields.maybe("mape_percent").value_or(0);
    point.relmse = fields.number("relmse");
    point.relmse_own = fields.maybe("relmse_own", -1e300);
    point.estimated = fields.maybe("estimated_relmse");
    point.near_floor = fields.flag("near_floor");
    return point;
}

Run run_of(Fields& fields) {
    Run run;
    run.id = fields.text("run");
    run.scene = fields.text("scene");
    run.label = fields.text("label");
    run.seed = uint64_t(fields.number("seed"));
    run.budget = budget_of(fields.inside("budget", false), &fields);
    run.threshold = fields.maybe("threshold_percent");
    run.capped = fields.flag("capped");
    run.cached_tables = fields.maybe_text("tables") == "cached";
    run.dropped_samples = fields.maybe("dropped_samples").value_or(0);
    run.image = fields.maybe_text("image");
    if (fields.has("fireflies")) run.fireflies = Fields(fields.inside("fireflies", false), "\"fireflies\"").maybe("count");
    if (fields.has("rare_light")) run.rare_share = Fields(fields.inside("rare_light", false), "\"rare_light\"").maybe("share");
    if (fields.has("cut")) {
        Fields cut(fields.inside("cut", false), "\"cut\"");
        run.given_seconds = cut.maybe("given_seconds");
        // Runs of one budget stay together, whatever a cut left of it.
        if (cut.has("asked")) run.budget = budget_of(cut.inside("asked", false), &fields);
        if (!cut.fault().empty()) fields.refuse(cut.fault());
    }
    return run;
}

Techniques techniques_of(Fields& fields) {
    Techniques techniques{fields.text("scene"), fields.text("label"), {}};
    for (const Json& json : fields.inside("classes", true)) {
        if (!json.is_object()) {
            fields.refuse("\"classes\" must hold objects");
            continue;
        }
        Fields entry(json, "a class of techniques");
        techniques.classes.push_back({entry.text("name"), entry.number("light", -1e300), entry.maybe("noise", -1e300)});
        if (!entry.fault().empty()) fields.refuse(entry.fault());
    }
    return techniques;
}

/// Reads the lines of one file after another into Results.
class Reader {
  public:
    Reader(const std::string& name, Results* results) : name_(name), results_(results) {
        for (const Run& run : results->runs) earlier_.insert(run.id);
        for (const Json& line : results->lines) {
            if (line.value("type", std::string()) == "run") label_names_.insert(name_of_run(line));
        }
        const std::filesystem::path path(name);
        images_ = path.extension() == ".jsonl" ? std::filesystem::path(path).replace_extension() : path;
        images_ += ".images";
    }

    Status read(std::string_view text) {
        for (size_t begin = 0; begin < text.size();) {
            ++line_;
            const size_t end = text.find('\n', begin);
            const std::string_view line = text.substr(begin, end == std::string_view::npos ? end : end - begin);
            begin = end == std::string_view::npos ? text.size() : end + 1;
            if (line.find_first_not_of(" \t\r") == std::string_view::npos) continue;
            Json json = Json::parse(line, nullptr, false);
            if (json.is_discarded() && end == std::string_view::npos) {
                note(std::to_string(line_) + ": the beginning of a line, which a killed bench left behind, is ignored");
                break;
            }
            if (json.is_discarded() || !json.is_object()) return refuse("this is no line of JSON: remove it, or measure again");
            tell_apart(json);
            LL_RETURN_IF_ERROR(add(json));
            results_->lines.push_back(std::move(json));
        }
        if (line_ == 0 || !started_) return refuse("no results of lightloom bench are here");
        for (const auto& [id, words] : unfinished_) note(" " + words + " did not end and is left out");
        return Status::ok_status();
    }

  private:
    Status refuse(const std::string& what) const {
        return invalid_argument(name_ + ":" + std::to_string(std::max(line_, 1)) + ": " + what);
    }
    void note(const std::string& what) { results_->notes.push_back(name_ + ":" + what); }
    std::string image(const std::string& file) const { return file.empty() ? "" : (images_ / file).string(); }

    /// Two suites may measure a scene of one name by different references. The later one's has the suite's name behind it then.
    void tell_apart(Json& json) {
        const auto text = [&](const char* key) {
            const auto found = json.find(key);
            return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
        };
        if (text("type") == "start") suite_ = text("suite");
        const std::string scene = text("scene");
        if (scene.empty()) return;
        if (text("type") == "scene" && !here_.contains(scene) && !renamed_.contains(scene)) {
            const SceneInfo* known = results_->scene(scene);
            const bool same =
                !known || (known->digest == text("scene_digest") && known->reference_digest == text("reference_digest"));
            if (!same && !suite_.empty()) renamed_[scene] = scene + " (" + suite_ + ")";
        }
        if (const auto found = renamed_.find(scene); found != renamed_.end()) json["scene"] = found->second;
        // Runs of one name and seed in two files, as of two days or numbers of threads, are two rows.
        const std::string label = text("label");
        if (const std::string name = name_of_run(json);
            text("type") != "scene" && label_names_.contains(name) && !earlier_.contains(text("run")))
            relabelled_[label] = label + " (" + std::filesystem::path(name_).stem().string() + ")";
        if (const auto found = relabelled_.find(label); found != relabelled_.end()) json["label"] = found->second;
    }

    Status add(const Json& json) {
        Fields fields(json, "this line");
        const std::string type = fields.text("type");
        if (!fields.fault().empty()) return refuse(fields.fault());
        if (type == "start") {
            open_.clear();  // The runs of a process that was killed begin again.
            started_ = true;
            Start start = start_of(fields);
            if (fields.fault().empty()) results_->starts.push_back(std::move(start));
        } else if (!started_) {
            return refuse("a file of results begins with a line of type \"start\"");
        } else if (type == "scene") {
            SceneInfo scene = scene_of(fields);
            scene.reference_image = image(scene.reference_image);
            if (fields.fault().empty()) LL_RETURN_IF_ERROR(add_scene(std::move(scene)));
        } else if (type == "checkpoint" || type == "run") {
            Run run = run_of(fields);
            const Checkpoint point = checkpoint_of(fields);
            if (fields.fault().empty()) LL_RETURN_IF_ERROR(add_point(std::move(run), point, type == "run"));
        } else if (type == "techniques") {
            Techniques techniques = techniques_of(fields);
            std::erase_if(results_->techniques, [&](const Techniques& other) {
                return other.scene == techniques.scene && other.label == techniques.label;
            });
            results_->techniques.push_back(std::move(techniques));
        } else if (type == "cut") {
            Cut cut{fields.maybe_text("scene"), fields.text("what")};
            // A process that goes on with a suite cuts the same again by another amount, which holds for what was left to do.
            const auto thing = [](const Cut& of) { return of.scene + "\n" + of.what.substr(0, of.what.find("->")); };
            std::erase_if(results_->cuts, [&](const Cut& other) { return thing(other) == thing(cut); });
            results_->cuts.push_back(std::move(cut));
        }  // Types that a later program adds do not change what these say.
        return fields.fault().empty() ? Status::ok_status() : refuse(fields.fault());
    }

    Status add_scene(SceneInfo scene) {
        for (SceneInfo& known : results_->scenes) {
            if (known.name != scene.name) continue;
            const bool other_file = !here_.contains(scene.name);
            if (other_file && (known.digest != scene.digest || known.reference_digest != scene.reference_digest ||
                               known.width != scene.width || known.height != scene.height)) {
                return refuse("scene \"" + scene.name +
                              "\" or its reference is another one than in the files before: report them apart");
            }
            here_.insert(scene.name);
            known = std::move(scene);
            return Status::ok_status();
        }
        here_.insert(scene.name);
        results_->scenes.push_back(std::move(scene));
        return Status::ok_status();
    }

    Status add_point(Run run, const Checkpoint& point, bool last) {
        if (!results_->scene(run.scene)) return refuse("no line of type \"scene\" stands before this one of \"" + run.scene + "\"");
        if (earlier_.contains(run.id)) {
            return refuse("run " + run.id + " is in the lines before already: give each file once");
        }
        std::vector<Checkpoint>& curve = open_[run.id];
        if (!last) {
            if (!curve.empty() && point.iterations <= curve.back().iterations) curve.clear();  // It began again.
            curve.push_back(point);
            unfinished_[run.id] = run.scene + ", " + run.label + ", seed " + std::to_string(run.seed);
            return Status::ok_status();
        }
        while (!curve.empty() && curve.back().iterations >= point.iterations) curve.pop_back();
        curve.push_back(point);
        run.curve = std::move(curve);
        run.image = image(run.image);
        open_.erase(run.id);
        unfinished_.erase(run.id);
        earlier_.insert(run.id);
        results_->runs.push_back(std::move(run));
        return Status::ok_status();
    }

    const std::string& name_;
    Results* results_;
    std::filesystem::path images_;
    int line_ = 0;
    bool started_ = false;
    std::set<std::string> earlier_, here_;  ///< Finished runs; scenes of this file.
    std::map<std::string, std::vector<Checkpoint>> open_;
    std::map<std::string, std::string> unfinished_;
    std::string suite_;                                        ///< Of the last "start" line.
    std::map<std::string, std::string> renamed_, relabelled_;  ///< Scenes and labels of this file, see tell_apart().
    std::set<std::string> label_names_;                        ///< Names of the runs of the files before, see name_of_run().
};

}  // namespace

std::string Budget::text() const {
    const std::string time = shortest(seconds) + " s";
    if (samples <= 0) return time;
    const std::string count = shortest(samples) + (samples == 1 ? " sample per pixel" : " samples per pixel");
    return seconds > 0 ? time + " or " + count : count;
}

const SceneInfo* Results::scene(std::string_view name) const {
    const auto found = std::find_if(scenes.begin(), scenes.end(), [&](const SceneInfo& scene) { return scene.name == name; });
    return found == scenes.end() ? nullptr : &*found;
}

Status add_results(std::string_view text, const std::string& name, Results* results) { return Reader(name, results).read(text); }

Result<Results> read_results(std::span<const std::string> paths) {
    Results results;
    for (const std::string& path : paths) {
        const Result<std::string> text = read_file(path);
        if (!text.ok()) return text.status();
        LL_RETURN_IF_ERROR(add_results(*text, path, &results));
    }
    return results;
}

}  // namespace lightloom::client::report
