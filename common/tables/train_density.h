#pragma once
// Learns the density map of photons from the light sub-paths of training.

#include <span>

#include "common/tables/density_map.h"
#include "common/tables/training_data.h"

namespace lightloom {

/// Fewest photons of a cell whose density counts, and most that a cell has before it is divided.
inline constexpr uint32_t kLeastCellPhotons = 8, kMostCellPhotons = 32;

/// The map of photons that `light_paths` light sub-paths left. Nothing (DensityData::learned()) where there are none.
DensityData build_density_map(std::span<const Vec3> photons, uint64_t light_paths);
/// Of the set's light sub-paths: all vertices but the first that a camera sub-path of two edges could merge with. With
/// merge-first=on the last vertex of a path of the greatest depth is a photon, too, and not counted.
DensityData train_density(const TrainingData& data);

}  // namespace lightloom
