#include "common/import/diagnostics.h"

#include <cstdio>

namespace lightloom::import {

std::string Location::text() const {
    const std::string name = file ? *file : std::string("scene");
    return line > 0 ? name + ":" + std::to_string(line) : name;
}

void fail(const Location& where, const std::string& what) { throw ImportFailure{where, what, {}}; }

std::string quoted(const std::string& text) {
    constexpr size_t kLongest = 80;
    std::string out = "\"";
    for (size_t i = 0; i < text.size(); ++i) {
        if (i == kLongest) {
            out += "...";
            break;
        }
        const unsigned char c = static_cast<unsigned char>(text[i]);
        if (c < 0x20 || c == 0x7f) {
            char escaped[8];
            std::snprintf(escaped, sizeof escaped, "\\x%02x", c);
            out += escaped;
        } else {
            out += text[i];
        }
    }
    return out + "\"";
}

void MessageList::add(const Location& where, const std::string& what, const std::string& key) {
    const auto [it, inserted] = index_.try_emplace(key, entries_.size());
    if (inserted) entries_.push_back({where.text(), what, 0});
    ++entries_[it->second].count;
}

std::vector<std::string> MessageList::text() const {
    std::vector<std::string> out;
    for (const Entry& e : entries_) {
        std::string line = e.where + ": " + e.what;
        if (e.count > 1) line += " (and " + std::to_string(e.count - 1) + " more)";
        out.push_back(std::move(line));
    }
    return out;
}

void Diagnostics::warn(const Location& where, const std::string& what) {
    if (strict_)
        fault({where, what + " (an error because of --strict)", {}});
    else
        warnings_.add(where, what, what);
}

void Diagnostics::fault(const ImportFailure& failure) {
    if (!collects_faults_) throw failure;
    faults_.add(failure.where, failure.what, failure.feature.empty() ? failure.what : "--without " + failure.feature);
}

}  // namespace lightloom::import
