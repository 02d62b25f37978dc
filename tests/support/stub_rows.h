#pragma once
// Three algorithms that the product does not have, one for each shape of unit, as rows of the catalog: they show that
// merging over the whole frame, pairing within a unit, and units that only splat pass through plan, coordinator,
// workers and sums without any code of their own there. They are slow on purpose and never part of the product.

namespace lightloom::testing {

/// Vertex merging with the photons of an iteration: units of the whole frame, photons anew for each iteration, and a
/// radius that shrinks from group to group, so that the weights depend on the unit.
inline constexpr char kStubMerging[] = "stub-merging";
/// Connects every camera sub-path of a unit to a light sub-path of the same unit, in loops of its own.
inline constexpr char kStubPairing[] = "stub-pairing";
/// Light tracing without camera samples; what the camera sees directly is missing.
inline constexpr char kStubSplats[] = "stub-splats";

/// Adds the three to the catalog; true, so that a test can call it before main().
bool add_stub_rows();

}  // namespace lightloom::testing
