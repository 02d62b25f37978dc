#pragma once
// How long a worker may render one unit.

namespace lightloom {

/// A unit that takes longer is taken away from its worker. The factor leaves room for units that are much harder than those before;
/// the least time for hosts that stand still for a while.
struct TimeBounds {
    double factor = 20;                  ///< A unit may take so many times as long as its worker's pace says,
    double least_seconds = 60;           ///< but always as long as that,
    double seconds_without_pace = 3600;  ///< and where nothing was measured so long.
};

}  // namespace lightloom
