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
    Location where;
    std::string what;
    std::string feature;  ///< One of features.h that would have to be left out, or empty.

    Status status() const { return invalid_argument(where.text() + ": " + what); }
};

/// Ends the import: "file:line: what". Where faults are collected it ends the directive or definition, see Diagnostics::guard().
[[noreturn]] void fail(const Location& where, const std::string& what);

/// `text` in double quotes, fit for one line of a message: shortened, control characters escaped.
std::string quoted(const std::string& text);

/// Messages of which repetitions are counted, not repeated.
class MessageList {
  public:
    /// Messages of one `key` count as repetitions of the first.
    void add(const Location& where, const std::string& what, const std::string& key);
    /// "first file:line: message", in order of first occurrence, with the number of further ones.
    std::vector<std::string> text() const;
    bool empty() const { return entries_.empty(); }

  private:
    struct Entry {
        std::string where, what;
        int count = 0;
    };
    std::vector<Entry> entries_;
    std::map<std::string, size_t> index_;
};

/// Collects named warnings and, if it is asked to, faults: what would end the import, which then goes on as if it had not been.
class Diagnostics {
  public:
    explicit Diagnostics(bool strict, bool collects_faults = false) : strict_(strict), collects_faults_(collects_faults) {}

    /// A fault instead when the import is strict.
    void warn(const Location& where, const std::string& what);
    std::vector<std::string> messages() const { return warnings_.text(); }

    bool collects_faults() const { return collects_faults_; }
    /// Ends the import, or is collected. Faults of one feature and key count as one.
    void fault(const ImportFailure& failure);
    /// Runs `f`; a fault in it is collected. False if there was one.
    template <typename F>
    bool guard(F&& f) {
        if (!collects_faults_) {
            f();
            return true;
        }
        try {
            f();
            return true;
        } catch (const ImportFailure& failure) {
            fault(failure);
            return false;
        }
    }
    std::vector<std::string> faults() const { return faults_.text(); }

  private:
    bool strict_, collects_faults_;
    MessageList warnings_, faults_;
};

}  // namespace lightloom::import
