#pragma once
// The second half of judge_stability(): what a wrong mean comes from, and the verdict's words.

#include "common/metrics/stability.h"

namespace lightloom {

/// From the intervals of `result`: whether a mean is wrong, and whether light that is never found, or only by chance, explains it.
void explain_bias(std::span<const StabilityRun> runs, const StabilityReference& reference, Stability* result);

/// Words for all that `result` holds.
std::string verdict_of(const Stability& result, std::span<const StabilityRun> runs, const StabilityReference& reference);

}  // namespace lightloom
