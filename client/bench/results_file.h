#pragma once
// The file of a benchmark: one JSON object per line, in the order in which things happened (client/README.md has the fields). How
// it is written so that a kill at any moment costs the unfinished runs and nothing else, and how it is gone on with.

#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom::client {

using Json = nlohmann::ordered_json;

/// "format" of every "start" line.
inline constexpr const char* kResultsFormat = "lightloom-bench 2";

/// What a file holds already.
struct BenchHistory {
    std::map<std::string, Json> done;  ///< Last line of each finished run, by key.
    std::set<std::string> shares;      ///< Of the "techniques" lines: scene, a newline, label.
    std::string kept;                  ///< All lines but those of unfinished runs and a torn end.
    std::string suite;                 ///< Name in the last "start" line.
    bool started = false;              ///< There is one.
    double suite_seconds = 0;          ///< Time that earlier processes spent, as far as the lines tell.
    bool torn = false;                 ///< The end was.
};

/// Reads the lines of an earlier, perhaps killed process. Checkpoints of runs that have no last line are left out, because those
/// runs start again. Of a run that is there twice, as a kill may leave one that took another's place, the last one that has ended
/// is kept. The beginning of a line at the end of the file is ignored; any other line that is not one of a benchmark is an error
/// that names it.
Result<BenchHistory> parse_history(std::string_view text, const std::string& file_name);

/// What makes two lines speak of the same run of a suite, whatever else decides it: scene, label, seed and budget.
std::string name_of_run(const Json& line);
/// A line as the file has it, with its end. Text that is not UTF-8, as in a path, has replacement characters.
std::string line_text(const Json& line);

/// The error of a benchmark that would begin a file which is there.
Status exists_already(const std::string& path);

/// The file of a benchmark. No other process can open it as such meanwhile, unless its file system has no locks, of which open()
/// warns; each line is whole before the next begins.
class BenchWriter {
  public:
    /// Makes the file; one that exists is refused unless `resume` is set, and always while another process has it open.
    static Result<BenchWriter> open(const std::string& path, bool resume);
    /// What it holds, for parse_history().
    Result<std::string> text() const;
    /// Replaces what it holds; after an error that is still there.
    Status replace(std::string_view content);
    Status append(const Json& line);

  private:
    struct Close {
        void operator()(std::FILE* file) const { std::fclose(file); }
    };
    using File = std::unique_ptr<std::FILE, Close>;
    BenchWriter(std::string path, File file) : path_(std::move(path)), file_(std::move(file)) {}
    std::string path_;
    File file_;  ///< Locked where that is possible.
};

}  // namespace lightloom::client
