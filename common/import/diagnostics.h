#pragma once
// Places in scene files, and the importer's messages about them. Inside common/import an error is thrown as an
// ImportFailure (a parser that is thirty calls deep could only pass it on); import_pbrt() turns it into a Status, so
// that no exception leaves the module.

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

/// `text` in double quotes, made fit for one line of a message: shortened, control characters escaped.
std::string quoted(const std::string& text);

/// A list of messages in which repetitions are counted instead of repeated.
class MessageList {
  public:
    /// Messages of one `key` count as repetitions of the first.
    void add(const Location& where, const std::string& what, const std::string& key);
    /// Lines "first file:line: message" in order of first occurrence, each with the number of its repetitions.
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

/// Collects warnings and, if asked to, faults. A fault would end the import; where it is collected, the import goes on
/// as if there were none.
class Diagnostics {
  public:
    explicit Diagnostics(bool strict, bool collects_faults = false) : strict_(strict), collects_faults_(collects_faults) {}

    /// Adds a warning; in a strict import it is a fault instead.
    void warn(const Location& where, const std::string& what);
    std::vector<std::string> messages() const { return warnings_.text(); }

    bool collects_faults() const { return collects_faults_; }
    /// Ends the import, or collects the fault. Faults of one feature and key count as one.
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
