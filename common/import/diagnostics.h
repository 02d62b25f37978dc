#pragma once
// Where something was said in a scene file, and what the importer has to say about it. Inside common/import an error is
// thrown as an ImportFailure (a parser that is thirty calls deep has nothing else to do with it); import_pbrt() turns
// it into a Status, so no exception leaves the module.

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/core/result.h"

namespace lightloom::import {

/// A line of a source file. `file` points into storage that outlives the import.
struct Location {
    const std::string* file = nullptr;
    int line = 0;

    /// "file:line", or "file" when no line is known.
    std::string text() const;
};

struct ImportFailure {
    Status status;
};

/// Ends the import: "file:line: what".
[[noreturn]] void fail(const Location& where, const std::string& what);

/// `text` in double quotes, fit for one line of a message: shortened, control characters escaped.
std::string quoted(const std::string& text);

/// Collects named warnings. Repetitions of the same message are counted, not repeated.
class Diagnostics {
  public:
    explicit Diagnostics(bool strict) : strict_(strict) {}

    /// Fails instead when the import is strict.
    void warn(const Location& where, const std::string& what);
    /// "first file:line: message", in order of first occurrence, with the number of further ones.
    std::vector<std::string> messages() const;

  private:
    struct Entry {
        std::string where, what;
        int count = 0;
    };
    bool strict_;
    std::vector<Entry> entries_;
    std::map<std::string, size_t> index_;
};

}  // namespace lightloom::import
