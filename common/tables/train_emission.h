#pragma once
// Learns the emission table from full paths: light should leave where and in the directions from which it contributes to
// the picture, relative to the picture's brightness there.
//
// Cells of places: a k-d tree over x_0, split at the weighted median while the places are so far apart that directions to
// the same x_1 differ. Each cell has a directional quadtree, which is refined where at least half a hundredth of the cell's
// weight lies [Müller, Gross and Novák 2017, section 3.2, with fixed data in place of rounds]. Shares are smoothed by the
// effective number of paths behind them, so that few paths teach little. Emitters are chosen by what their groups, halves
// of a k-d tree over them, contribute; within the last group that the data tell apart, by power.

#include <cstdint>
#include <stop_token>
#include <vector>

#include "common/scene/emission_table.h"
#include "common/scene/emitter.h"
#include "common/tables/training_data.h"

namespace lightloom {

/// `brightness` is that of the blocks (block_brightness()). After a stop request it returns soon, with a table of no use.
/// A table that has learned nothing (EmissionData::learned()) where no path teaches anything.
EmissionData train_emission(const TrainingData& data, const std::vector<double>& brightness, const EmitterSet& emitters,
                            std::stop_token stop);

}  // namespace lightloom
