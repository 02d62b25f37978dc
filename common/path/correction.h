#pragma once
// Which of a technique's n samples count in the weights, where they share a sub-path. [common/path/README.md, "The weight"]

#include <cstdint>

namespace lightloom {

/// What a weight makes of the number n of a technique's samples that share a camera sub-path. All of them are functions of the
/// path and of frozen tables, so that weights with them sum to one.
enum class Correction : uint8_t {
    kUncorrected,     ///< All n count.
    kOne,             ///< They count as one [Popov et al. 2015].
    kCorrelation,     ///< As far as they are independent [Grittmann, Georgiev and Slusallek 2021]; correlation.h.
    kFootprint,       ///< Merges by the footprints of both sub-paths [Jendersie 2019]; merge_shares.h.
    kPhotons,         ///< Merges over the photons that a disc holds [Jendersie and Grosch 2018, eq. 6]; merge_shares.h.
    kPhotonsBalanced  ///< The same, as many merges of a path in total as uncorrected [eq. 7].
};

}  // namespace lightloom
