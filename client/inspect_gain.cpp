#include "client/inspect_gain.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

namespace lightloom::client {
namespace {

struct Spread {
    double p10 = 0, median = 0, p90 = 0;
};

Spread spread_of(const GainData& d, float GainData::Gain::*number) {
    std::vector<float> sorted;
    for (const GainData::Gain& g : d.gains) sorted.push_back(g.*number);
    std::sort(sorted.begin(), sorted.end());
    const auto at = [&](double q) { return double(sorted[size_t(q * double(sorted.size() - 1) + 0.5)]); };
    return {at(0.1), at(0.5), at(0.9)};
}

nlohmann::ordered_json json_of(const Spread& s) { return {{"p10", s.p10}, {"median", s.median}, {"p90", s.p90}}; }

}  // namespace

nlohmann::ordered_json describe_gain(const GainData& d) {
    if (!d.learned()) return {{"places", 0}};
    return {{"places", d.gains.size()},
            {"blocks", {d.blocks_x, d.blocks_y}},
            {"keep", json_of(spread_of(d, &GainData::Gain::keep))},
            {"split", json_of(spread_of(d, &GainData::Gain::split))}};
}

void print_gain(const GainData& d) {
    if (!d.learned()) {
        std::printf("  gain       nothing was learned; roulette goes by throughput\n");
        return;
    }
    const Spread keep = spread_of(d, &GainData::Gain::keep), split = spread_of(d, &GainData::Gain::split);
    std::printf(
        "  gain       %zu places, %d x %d blocks of the frame; sub-paths that should go on, at a throughput of the pixel's\n"
        "             brightness: roulette 10 %% %.3g, median %.3g, 90 %% %.3g; splitting %.3g, %.3g, %.3g\n",
        d.gains.size(), d.blocks_x, d.blocks_y, keep.p10, keep.median, keep.p90, split.p10, split.median, split.p90);
}

}  // namespace lightloom::client
