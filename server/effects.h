#pragma once
// Effects: what a change of a job asks for, beyond the change itself. Whoever changes a job holds the lock of the book and only
// notes them; they are carried out once the lock is given back, so that nobody waits for a log, a disk or a large destructor.

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/cli/log_line.h"
#include "common/core/digest.h"

namespace lightloom {

struct Effects {
    bool changed = false;  ///< Those who watch the job are to look.
    bool units = false;    ///< Units may be leased that could not be before.
    bool ended = false;    ///< The job has its last state.
    bool keep = false;     ///< With `ended`: its complete groups are to be written before they are thrown away.
    /// Freed without the lock, because it is large.
    std::vector<std::shared_ptr<void>> discard;
    struct Line {
        LogLevel level = LogLevel::kInfo;
        std::string text;
    };
    std::vector<Line> log;

    template <class T>
    void throw_away(T&& large) {
        discard.push_back(std::make_shared<std::decay_t<T>>(std::forward<T>(large)));
    }
    void info(std::string text) { log.push_back({LogLevel::kInfo, std::move(text)}); }
    void warn(std::string text) { log.push_back({LogLevel::kWarn, std::move(text)}); }
    void error(std::string text) { log.push_back({LogLevel::kError, std::move(text)}); }

    Effects& operator+=(Effects&& other) {
        changed |= other.changed;
        units |= other.units;
        ended |= other.ended;
        keep |= other.keep;
        std::move(other.discard.begin(), other.discard.end(), std::back_inserter(discard));
        std::move(other.log.begin(), other.log.end(), std::back_inserter(log));
        other = {};
        return *this;
    }
};

}  // namespace lightloom
