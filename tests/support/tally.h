#pragma once
// Counts deviations of numbers that should be equal except for rounding.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/support/path_rebuild.h"

namespace lightloom::testing {

/// Weights come from float densities, recomputed along directions that differ in the last bits; grazing events and
/// refraction near the critical angle amplify that. 1e-4 must hold for all but 0.2 % of the paths (`loose_share`), and
/// 1e-2 for all but 0.02 %. A Dirac event leaves from a point beside the surface (offset_origin(), 3e-5 of a
/// coordinate), so that seen from its neighbours it is a mirror only up to that over their distance: 1e-3.
/// With learned emission, light that leaves at a grazing angle is common, and its cosine does not cancel; and a
/// direction may fall into another leaf of a density as seen from the other end of the edge: kLooseLit and kGrossLit.
inline constexpr double kLooseLit = 6e-2, kGrossLit = 2e-3;

/// What was traced against what is rebuilt: directions that were sampled, and throughput accumulated along the other sub-path, so
/// that narrow lobes and total reflection amplify the last bits more often than between two rebuilt views. The tail of that falls
/// as one over the deviation; a wrong factor would show up in a good part of the paths.
inline constexpr double kLooseTraced = 6e-3;

struct Tally {
    uint64_t count = 0, loose = 0, gross = 0;

    void add(double deviation, const FullPath& path) {
        const bool dirac = std::any_of(path.x.begin(), path.x.end(), [](const PathVertex& v) { return v.delta; });
        ++count;
        loose += !(std::fabs(deviation) <= (dirac ? 1e-3 : 1e-4));
        gross += !(std::fabs(deviation) <= 1e-2);
    }
    Tally& operator+=(const Tally& other) {
        count += other.count, loose += other.loose, gross += other.gross;
        return *this;
    }
    void check(const std::string& what, double loose_share = 2e-3, double gross_share = 2e-4) const {
        EXPECT_GE(count, 500u) << what;
        EXPECT_LT(double(loose), loose_share * double(count))
            << what << ": " << loose << " of " << count << " deviate by over 1e-4";
        EXPECT_LE(double(gross), gross_share * double(count))
            << what << ": " << gross << " of " << count << " deviate by over 1e-2";
    }
};

}  // namespace lightloom::testing
