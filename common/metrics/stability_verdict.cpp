#include "common/metrics/stability_verdict.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace lightloom {

namespace {

/// An estimate of rare light comes from 16 or more pairs of sub-paths: its error may be that large.
constexpr double kRareLightError = 1.5;
/// Deviates within which the number of chance hits is expected to lie.
constexpr double kChanceDeviates = 4;
/// Of energies with the density x^(-1 - 3/2), the part that lies beyond the largest one of N is, up to a probability of 0.1 %, less
/// than 7 N^(-1/3) times what was found.
constexpr double kMissingFireflies = 7;

/// Light that an algorithm may lack without being wrong, as shares of the image's light.
struct Shortfall {
    double unreachable = 0, chance = 0, fireflies = 0;
    double chance_share = 0, expected_hits = 0;

    double sum() const { return unreachable + chance + fireflies; }
};

Shortfall shortfall_of(std::span<const StabilityRun> runs, const Stability& result) {
    Shortfall s;
    double known = 0, unreachable_share = 0;
    for (const StabilityRun& run : runs) {
        if (!run.chance) continue;
        ++known;
        s.chance_share += run.chance->share;
        unreachable_share += run.chance->unreachable_share;
        s.expected_hits += run.chance->expected_hits;
    }
    if (known > 0) {
        s.chance_share /= known;
        s.unreachable = kRareLightError * unreachable_share / known;
        const double lack = s.expected_hits > 0 ? std::min(1.0, kChanceDeviates / std::sqrt(s.expected_hits)) : 1;
        s.chance = kRareLightError * s.chance_share * lack;
    }
    const double count = result.firefly_count.mean * result.seeds;
    if (count > 0) s.fireflies = result.firefly_energy.mean * kMissingFireflies / std::cbrt(count);
    return s;
}

/// Share of the whole image's light in a region, all of which are of nearly equal size.
double light_share(size_t region, const StabilityReference& reference) {
    if (region == 0) return 1;
    return reference.regions[region].mean / (reference.regions[0].mean * double(reference.regions.size() - 1));
}

bool too_bright(const RatioInterval& i) { return i.low > 1; }
bool too_dark(const RatioInterval& i) { return i.high < 1; }
bool explained(size_t region, const Stability& result, const StabilityReference& reference, const Shortfall& shortfall) {
    const RatioInterval& i = result.regions[region];
    return too_dark(i) && (1 - i.high) * light_share(region, reference) <= shortfall.sum();
}

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
    char text[256];
    va_list arguments;
    va_start(arguments, pattern);
    const int length = std::vsnprintf(text, sizeof text, pattern, arguments);
    va_end(arguments);
    return std::string(text, size_t(std::clamp(length, 0, int(sizeof text) - 1)));
}

/// Two digits, or all before the point.
std::string number(double value) {
    const double size = std::fabs(value);
    if (size >= 9.95 && size < 1e6) return format("%.0f", value);
    return format("%.2g", value);
}

std::string percent(double share) { return number(100 * share) + " %"; }

/// "7 % too bright in the lower left [5, 9]".
std::string deviation(size_t region, const Stability& result) {
    const RatioInterval& i = result.regions[region];
    const std::string where = " in " + region_name(region, result.regions.size());
    if (!std::isfinite(i.ratio)) return "light" + where + ", where the reference has none";
    const bool bright = i.ratio > 1;
    const double least = bright ? i.low - 1 : 1 - i.high, most = bright ? i.high - 1 : 1 - i.low;
    return percent(std::fabs(i.ratio - 1)) + (bright ? " too bright" : " too dark") + where + " [" + number(100 * least) + ", " +
           number(100 * most) + "]";
}

/// The region that deviates most surely among those for which `wanted` holds; worst_region if that is one of them.
template <class Wanted>
size_t worst_of(const Stability& result, Wanted wanted) {
    if (wanted(result.worst_region)) return result.worst_region;
    size_t worst = result.regions.size();
    double most = -1;
    for (size_t r = 0; r < result.regions.size(); ++r) {
        const RatioInterval& i = result.regions[r];
        const double surely = std::isfinite(i.ratio) ? std::max(i.low - 1, 1 - i.high) / (i.high - i.low) : HUGE_VAL;
        if (wanted(r) && surely > most) worst = r, most = surely;
    }
    return worst;
}

/// "because 12 % of the light is never found".
std::string reasons(const Shortfall& s, const Stability& result) {
    std::string text;
    const auto add = [&](const std::string& reason) { text += (text.empty() ? "because " : " and ") + reason; };
    if (s.unreachable > 0) add(percent(s.unreachable / kRareLightError) + " of the light is never found");
    if (s.chance > 0)
        add(percent(s.chance_share) + " of the light is found by chance hits alone, of which " + number(s.expected_hits) +
            " are expected in all seeds together");
    if (!text.empty()) return text;
    return "perhaps because fireflies, which have " + percent(result.firefly_energy.mean) + " of the light, are still to come";
}

std::string slope_words(const Stability& result) { return format("error falls as n^%.2f", result.slope->mean); }

std::string not_judged(const Stability& result, const StabilityReference& reference) {
    if (result.seeds < kSeedsForBias)
        return "bias not judged: that takes " + std::to_string(kSeedsForBias) + " seeds, not " + std::to_string(result.seeds);
    if (std::isinf(reference.regions[0].variance)) return "bias not judged: nobody knows the reference's own error";
    if (!result.bias_bound) return "bias not judged: the reference is black";
    return "bias not judged: " + std::to_string(result.seeds) + " seeds tell the mean only within " + percent(*result.bias_bound);
}

/// "no bias seen (within 0.8 %, in regions within 3 %)".
std::string no_bias(const Stability& result) {
    double worst = 0;
    for (size_t r = 1; r < result.regions.size(); ++r) {
        const double bound = std::max(1 - result.regions[r].low, result.regions[r].high - 1);
        if (std::isfinite(bound)) worst = std::max(worst, bound);
    }
    std::string text = "no bias seen (within " + percent(*result.bias_bound);
    if (worst > 0) text += ", in regions within " + percent(worst);
    return text + ")";
}

}  // namespace

void explain_bias(std::span<const StabilityRun> runs, const StabilityReference& reference, Stability* result) {
    const Shortfall shortfall = shortfall_of(runs, *result);
    for (size_t r = 0; r < result->regions.size(); ++r) {
        const RatioInterval& i = result->regions[r];
        if (!too_bright(i) && !too_dark(i)) continue;
        if (explained(r, *result, reference, shortfall))
            result->misses_light = true;
        else
            result->biased = true;
    }
    result->finds_nothing = result->regions[0].high < 0.5;
}

std::string verdict_of(const Stability& result, std::span<const StabilityRun> runs, const StabilityReference& reference) {
    std::vector<std::string> clauses;
    const Shortfall shortfall = shortfall_of(runs, result);
    const auto is_explained = [&](size_t r) { return explained(r, result, reference, shortfall); };
    const auto is_bias = [&](size_t r) {
        return (too_bright(result.regions[r]) || too_dark(result.regions[r])) && !is_explained(r);
    };
    if (result.finds_nothing) {
        const RatioInterval& whole = result.regions[0];
        clauses.push_back("finds almost nothing: " + percent(whole.ratio) + " of the light [" +
                          number(100 * std::max(0.0, whole.low)) + ", " + number(100 * whole.high) + "]");
    }
    if (result.biased) clauses.push_back("biased: " + deviation(worst_of(result, is_bias), result));
    if (result.misses_light)
        clauses.push_back("misses light: " + deviation(worst_of(result, is_explained), result) + ", " + reasons(shortfall, result));
    if (result.heavy_tail) {
        std::string why = "errors of seeds vary by " + percent(result.variation);
        if (result.worst_seed_share > 0.5)
            why =
                "seed " + std::to_string(result.worst_seed) + " has " + percent(result.worst_seed_share) + " of all squared error";
        if (result.slope) why += ", " + slope_words(result);
        clauses.push_back("heavy tail: " + why);
    }
    if (result.stalls) clauses.push_back("stalls: " + slope_words(result) + " although there are no outliers");
    if (result.no_better_than_black) clauses.push_back("no better than a black image: relMSE " + number(result.error.mean));
    if (result.has_fireflies)
        clauses.push_back("fireflies: " + number(result.firefly_count.mean) + " pixels of an image with " +
                          percent(result.firefly_energy.mean) + " of the light");
    const bool sound = clauses.empty();
    if (!result.judged) {
        clauses.push_back(not_judged(result, reference));
    } else if (sound) {
        clauses.push_back("sound: " + (result.slope ? slope_words(result) + ", " : std::string()) + no_bias(result));
    } else if (!result.biased && !result.misses_light) {
        clauses.push_back(no_bias(result));
    }
    std::string verdict;
    for (const std::string& clause : clauses) verdict += (verdict.empty() ? "" : "; ") + clause;
    return verdict;
}

bool Stability::sound() const { return flags().empty(); }

std::vector<std::string> Stability::flags() const {
    const std::pair<bool, const char*> all[] = {
        {finds_nothing, "finds-nothing"}, {biased, "biased"},     {misses_light, "misses-light"},
        {heavy_tail, "heavy-tail"},       {stalls, "stalls"},     {no_better_than_black, "no-better-than-black"},
        {has_fireflies, "fireflies"},     {!judged, "not-judged"}};
    std::vector<std::string> names;
    for (const auto& [holds, name] : all)
        if (holds) names.emplace_back(name);
    return names;
}

std::string region_name(size_t index, size_t count) {
    if (index == 0) return "the whole image";
    constexpr std::array<const char*, 9> kNames{"the upper left", "the top",    "the upper right",
                                                "the left",       "the middle", "the right",
                                                "the lower left", "the bottom", "the lower right"};
    if (count == kNames.size() + 1) return kNames[index - 1];
    return "region " + std::to_string(index);
}

}  // namespace lightloom
