#pragma once
// Three algorithms that the product does not have, one for each shape of unit, as rows of the catalog: they show that merging over
// the whole frame, pairing within a unit, and units that only splat pass through plan, coordinator, workers and sums without any
// code of their own there. Slow on purpose; never part of the product.

namespace lightloom::testing {

/// Vertex merging with the photons of an iteration: units of the whole frame, photons anew for each iteration, and a radius that
/// shrinks from group to group, so that the weights are the unit's own.
inline constexpr char kStubMerging[] = "stub-merging";
/// Every camera sub-path of a unit connected to a light sub-path of the same unit, in loops of its own.
inline constexpr char kStubPairing[] = "stub-pairing";
/// Light tracing alone: no camera samples, and what the camera sees directly is left out.
inline constexpr char kStubSplats[] = "stub-splats";

/// Adds the three to the catalog; true, so that a test can call it before main().
bool add_stub_rows();

}  // namespace lightloom::testing
