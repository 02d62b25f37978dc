#include "common/core/nearest.h"

#include <algorithm>
#include <vector>

namespace lightloom {
namespace {

/// What a user types is compared, and nobody types a novel: longer words are no names.
constexpr size_t kLongestName = 64;

char small(char c) { return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c; }

}  // namespace

size_t spelling_mistakes(std::string_view a, std::string_view b) {
    // Rows of the usual table: distances of the prefixes of `b` from the current prefix of `a`, and from the two before it.
    std::vector<size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
    for (size_t j = 0; j <= b.size(); ++j) last[j] = j;
    for (size_t i = 1; i <= a.size(); ++i) {
        row[0] = i;
        for (size_t j = 1; j <= b.size(); ++j) {
            const bool same = small(a[i - 1]) == small(b[j - 1]);
            row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (same ? 0 : 1)});
            const bool exchanged = i > 1 && j > 1 && small(a[i - 1]) == small(b[j - 2]) && small(a[i - 2]) == small(b[j - 1]);
            if (exchanged) row[j] = std::min(row[j], before[j - 2] + 1);
        }
        before = last;
        last = row;
    }
    return last[b.size()];
}

std::string_view nearest(std::string_view word, std::span<const std::string_view> known) {
    std::string_view best;
    if (word.empty() || word.size() > kLongestName) return best;
    size_t fewest = kLongestName;
    for (const std::string_view name : known) {
        size_t mistakes = spelling_mistakes(word, name);
        if (word.size() >= 3 && name.starts_with(word)) mistakes = std::min<size_t>(mistakes, 1);
        if (mistakes >= fewest || mistakes > std::max(word.size(), name.size()) / 3) continue;
        fewest = mistakes;
        best = name;
    }
    return best;
}

std::string did_you_mean(std::string_view word, std::span<const std::string_view> known) {
    const std::string_view name = nearest(word, known);
    return name.empty() ? std::string() : " (did you mean '" + std::string(name) + "'?)";
}

}  // namespace lightloom
