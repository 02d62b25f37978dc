#include "client/bench/results_book.h"

#include <cstdio>
#include <utility>

namespace lightloom::client {

Result<ResultsBook> ResultsBook::open(const std::string& path, bool resume, const std::string& suite, bool cut_is_done,
                                      bool quiet) {
    auto writer = BenchWriter::open(path, resume);
    if (!writer.ok()) return writer.status();
    const auto text = writer->text();
    if (!text.ok()) return text.status();
    auto history = parse_history(*text, path);
    if (!history.ok()) return history.status();
    if (history->started && history->suite != suite) {
        return failed_precondition(path + " holds results of " +
                                   (history->suite.empty() ? "a single scene" : "the suite " + history->suite) +
                                   "; give another name");
    }
    if (history->torn && !quiet)
        std::fprintf(stderr, "%s: the end of its last line is missing; that line's run is measured again\n", path.c_str());
    if (!history->done.empty() && !quiet)
        std::fprintf(stderr, "%zu run(s) are in %s already\n", history->done.size(), path.c_str());
    LL_RETURN_IF_ERROR(writer->replace(history->kept));
    return ResultsBook(path, *std::move(writer), *std::move(history), cut_is_done);
}

ResultsBook::ResultsBook(std::string path, BenchWriter writer, BenchHistory history, bool cut_is_done)
    : path_(std::move(path)),
      writer_(std::move(writer)),
      history_(std::move(history)),
      cut_is_done_(cut_is_done) {
    for (size_t begin = 0; begin < history_.kept.size();) {
        const size_t end = history_.kept.find('\n', begin);
        lines_.push_back(Json::parse(std::string_view(history_.kept).substr(begin, end - begin)));
        begin = end + 1;
    }
    for (const auto& [key, line] : history_.done) {
        scenes_.insert(line.value("scene", std::string()));
        key_by_name_[name_of_run(line)] = key;
        if (cut_is_done_ || !line.contains("cut")) done_names_.insert(name_of_run(line));
    }
}

bool ResultsBook::has_shares(const std::string& scene, const std::string& label) const {
    return history_.shares.contains(scene + "\n" + label);
}

bool ResultsBook::is_done(const std::string& scene, const std::string& label, uint64_t seed, const RunBudget& budget) const {
    return done_names_.contains(name_of_run({{"scene", scene}, {"label", label}, {"seed", seed}, {"budget", budget.json()}}));
}

Result<bool> ResultsBook::is_done(const BenchRun& run, bool other_reference) {
    keys_.insert(run.key());
    const Json wanted = run.line("run");
    const auto held = key_by_name_.find(name_of_run(wanted));
    if (held == key_by_name_.end()) return false;
    const Json& line = history_.done.at(held->second);
    for (const char* field : {"build", "threads", "server", "scene_digest", "reference_digest", "max_depth", "width", "height",
                              "parameters", "threshold_percent", "stop_after", "table_source"}) {
        const bool same = wanted.contains(field) ? line.contains(field) && line[field] == wanted[field] : !line.contains(field);
        if (same) continue;
        if (other_reference && std::string_view(field) == "reference_digest") return false;
        return failed_precondition(path_ + " holds " + run.algorithm.label + " seed " + std::to_string(run.seed) +
                                   " with another " + field + "; give another name, so that no two kinds are mixed");
    }
    return cut_is_done_ || !line.contains("cut");
}

Status ResultsBook::append(const Json& line) {
    std::vector<Json> lines;
    if (start_) lines.push_back(*std::exchange(start_, std::nullopt));
    for (Json& before : std::exchange(announced_, {})) lines.push_back(std::move(before));
    lines.push_back(line);
    for (const Json& next : lines) {
        lines_.push_back(next);
        LL_RETURN_IF_ERROR(writer_.append(next));
    }
    return {};
}

Status ResultsBook::finish(const BenchRun& run, const Json& line) {
    LL_RETURN_IF_ERROR(append(line));
    const auto held = key_by_name_.find(name_of_run(line));
    if (held == key_by_name_.end()) return {};
    // Of the old run everything up to its own last line; the new one may have the same key.
    const std::string old = held->second;
    key_by_name_.erase(held);
    bool before = true;
    std::erase_if(lines_, [&](const Json& other) {
        if (!before || other.value("run", std::string()) != old) return false;
        before = other.value("type", std::string()) != "run";
        return true;
    });
    keys_.insert(run.key());
    return rewrite();
}

Status ResultsBook::forget_cuts(const std::string& scene) {
    const auto gone = std::erase_if(lines_, [&](const Json& line) {
        return line.value("type", std::string()) == "cut" && line.value("scene", std::string()) == scene;
    });
    return gone > 0 ? rewrite() : Status();
}

Status ResultsBook::rewrite() {
    std::string text;
    for (const Json& line : lines_) text.append(line_text(line));
    return writer_.replace(text);
}

std::vector<Json> ResultsBook::lines() const {
    std::vector<Json> lines;
    for (const Json& line : lines_) {
        const auto key = line.find("run");
        if (key == line.end() || keys_.contains(key->get<std::string>())) lines.push_back(line);
    }
    return lines;
}

}  // namespace lightloom::client
