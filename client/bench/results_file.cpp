#include "client/bench/results_file.h"

#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <vector>

#include "common/core/atomic_file.h"

namespace lightloom::client {
namespace {

/// Whether a line of a benchmark begins like this, however little of it was written.
bool begins_a_line(std::string_view text) {
    constexpr std::string_view kBegin = "{\"type\":\"";
    const size_t common = std::min(text.size(), kBegin.size());
    return text.substr(0, common) == kBegin.substr(0, common);
}

Status cannot_be_written(const std::string& path, int error) {
    return invalid_argument(path + ": cannot be written: " + std::generic_category().message(error));
}

/// Whether a failed lock says that the file system has none, as some network file systems.
bool has_no_locks(int error) { return error == ENOSYS || error == EOPNOTSUPP || error == ENOLCK; }

}  // namespace

Result<BenchHistory> parse_history(std::string_view text, const std::string& file_name) {
    struct Line {
        std::string run;  ///< Key; empty for a line that belongs to none.
        int before = 0;   ///< Last lines of that key before this one.
        std::string_view text;
    };
    BenchHistory history;
    std::vector<Line> lines;
    std::map<std::string, int> ends;            ///< Last lines by key.
    std::map<std::string, std::string> key_of;  ///< Key of the last run that has ended, by its name.
    for (size_t begin = 0, number = 1; begin < text.size(); ++number) {
        const size_t newline = text.find('\n', begin);
        const bool whole = newline != std::string_view::npos;
        const std::string_view line = text.substr(begin, whole ? newline - begin : std::string_view::npos);
        begin += line.size() + (whole ? 1 : 0);
        if (line.empty()) continue;
        const auto bad = [&](const char* what) {
            return invalid_argument(file_name + ":" + std::to_string(number) + ": " + what +
                                    "; repair the file or give another name");
        };
        Json json = Json::parse(line, nullptr, false);
        if (!json.is_object() || !json.contains("type") || !json["type"].is_string()) {
            if (!whole && json.is_discarded() && begins_a_line(line)) {  // what a killed benchmark was writing
                history.torn = true;
                break;
            }
            return bad("not a line of a benchmark");
        }
        const std::string type = json["type"];
        const auto text_of = [&](const char* key) {
            const auto value = json.find(key);
            return value != json.end() && value->is_string() ? value->get<std::string>() : std::string();
        };
        if (const auto spent = json.find("suite_seconds"); spent != json.end() && spent->is_number())
            history.suite_seconds = std::max(history.suite_seconds, spent->get<double>());
        if (type == "start") {
            if (text_of("format") != kResultsFormat) return bad("written by another version of lightloom");
            history.started = true;
            history.suite = text_of("suite");
        }
        if (type == "techniques") history.shares.insert(text_of("scene") + "\n" + text_of("label"));
        std::string key;
        if (type == "run" || type == "checkpoint") {
            key = text_of("run");
            if (key.empty()) return bad("a run without a name");
        }
        lines.push_back({key, ends[key], line});
        if (type != "run") continue;
        ++ends[key];
        key_of[name_of_run(json)] = key;
        history.done[key] = std::move(json);
    }
    std::erase_if(history.done, [&](const auto& run) { return key_of[name_of_run(run.second)] != run.first; });
    for (const Line& line : lines) {
        const bool last = history.done.contains(line.run) && line.before == ends[line.run] - 1;
        if (line.run.empty() || last) history.kept.append(line.text) += '\n';
    }
    return history;
}

std::string name_of_run(const Json& line) {
    Json name = Json::array();
    for (const char* key : {"scene", "label", "seed", "budget"}) name.push_back(line.contains(key) ? line[key] : Json());
    return line_text(name);
}

std::string line_text(const Json& line) { return line.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"; }

Status exists_already(const std::string& path) {
    return invalid_argument(path + " exists; go on with it by --resume or give another name");
}

Result<BenchWriter> BenchWriter::open(const std::string& path, bool resume) {
    for (;;) {
        File file(std::fopen(path.c_str(), resume ? "a" : "ax"));
        if (!file && errno == EEXIST) return exists_already(path);
        if (!file) return cannot_be_written(path, errno);
        struct stat ours {
        }, named{};
        if (::fstat(::fileno(file.get()), &ours) != 0) return cannot_be_written(path, errno);
        if (!S_ISREG(ours.st_mode)) return BenchWriter(path, std::move(file));  // a pipe or a device, which anybody may use
        if (::flock(::fileno(file.get()), LOCK_EX | LOCK_NB) != 0) {
            if (errno == EWOULDBLOCK)
                return failed_precondition(path + ": another bench is writing to it; wait for that one or give another name");
            if (!has_no_locks(errno)) return cannot_be_written(path, errno);
            std::fprintf(stderr, "lightloom: warning: %s cannot be locked there; let no other bench write to it meanwhile\n",
                         path.c_str());
        }
        // Who had it may have replaced it between our opening and our locking it.
        if (::stat(path.c_str(), &named) == 0 && named.st_ino == ours.st_ino && named.st_dev == ours.st_dev)
            return BenchWriter(path, std::move(file));
    }
}

Result<std::string> BenchWriter::text() const {
    std::error_code ignored;
    return std::filesystem::is_regular_file(path_, ignored) ? read_file(path_) : std::string();
}

Status BenchWriter::replace(std::string_view content) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path_, error)) return {};  // nothing was read from it either
    const std::string target = std::filesystem::canonical(path_, error).string();
    if (error) return cannot_be_written(path_, error.value());
    // The new file is locked before it has the name, so that at no time anybody can lock what has it.
    const std::string fresh = target + ".new-" + std::to_string(::getpid());
    Status status = write_file_atomically(fresh, content);
    File file(status.ok() ? std::fopen(fresh.c_str(), "a") : nullptr);
    const auto locked = [&] { return ::flock(::fileno(file.get()), LOCK_EX | LOCK_NB) == 0 || has_no_locks(errno); };
    if (status.ok() && (!file || !locked() || std::rename(fresh.c_str(), target.c_str()) != 0))
        status = cannot_be_written(path_, errno);
    if (!status.ok()) {
        std::filesystem::remove(fresh, error);
        return status;
    }
    file_ = std::move(file);
    return {};
}

Status BenchWriter::append(const Json& line) {
    const std::string text = line_text(line);
    if (std::fwrite(text.data(), 1, text.size(), file_.get()) == text.size() && std::fflush(file_.get()) == 0) return {};
    return {StatusCode::kResourceExhausted, cannot_be_written(path_, errno).message()};
}

}  // namespace lightloom::client
