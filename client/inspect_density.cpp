#include "client/inspect_density.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace lightloom::client {
namespace {

/// The densities' quantile q, 0 <= q <= 1.
double quantile(const DensityData& d, double q) {
    std::vector<float> sorted = d.densities;
    std::sort(sorted.begin(), sorted.end());
    return double(sorted[size_t(q * double(sorted.size() - 1) + 0.5)]);
}

}  // namespace

nlohmann::ordered_json describe_density(const DensityData& d) {
    if (!d.learned()) return {{"cells", 0}};
    return {{"cells", d.densities.size()}, {"p10", quantile(d, 0.1)}, {"median", quantile(d, 0.5)}, {"p90", quantile(d, 0.9)}};
}

void print_density(const DensityData& d) {
    if (!d.learned()) return;
    std::printf("  photons    %zu cells; per light sub-path and square metre 10 %% %.3g, median %.3g, 90 %% %.3g\n",
                d.densities.size(), quantile(d, 0.1), quantile(d, 0.5), quantile(d, 0.9));
}

}  // namespace lightloom::client
