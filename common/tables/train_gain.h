#pragma once
// Learns the gain table of Russian roulette from the visits of training.
//
// A camera sub-path with the throughput alpha at a place x, in a pixel of brightness I, should go on as
//     n = tau (alpha / I) sqrt( E[g^2] / E[c] )
// sub-paths, where g is what one that goes on finds for each unit of throughput, c what that costs, and tau^2 cost over
// relative variance of whole samples: then another unit of cost buys the same everywhere [Rath et al. 2022, section 4]. Where n
// is above 1, the variance of g stands for its second moment, because what all of its continuations find alike does not get
// any better by splitting.

#include <stop_token>

#include "common/tables/gain_table.h"
#include "common/tables/training_data.h"

namespace lightloom {

/// `brightness` is that of the blocks (block_brightness()). Nothing (GainData::learned()) if there are no visits, or none of
/// them found light. After a stop request it returns soon, with a table of no use.
GainData train_gain(const TrainingData& data, const std::vector<double>& brightness, const std::stop_token& stop);

}  // namespace lightloom
