#pragma once
// Memory of the algorithms that merge: what a map of an iteration's photons will need, before any is traced, and what it took.

#include <cstdint>

#include "common/transport/renderer.h"

namespace lightloom {

/// Bytes of an iteration's light sub-paths and of the map of their photons.
struct PhotonMemory {
    uint64_t paths = 0, map = 0;
    uint64_t total() const { return paths + map; }
};

/// Remembers the largest total of this process, for its statistics.
void note_photon_memory(const PhotonMemory& memory);
/// The largest that was noted; zeros if none was.
PhotonMemory most_photon_memory();

/// What `path_count` light sub-paths of the request's settings will need, by a few hundred that are traced for this alone.
PhotonMemory expected_photon_memory(const RendererRequest& request, uint64_t path_count);
/// kResourceExhausted, with what to do, if an iteration's photons do not fit into `machine_bytes`. Another machine may have more.
Status check_photon_memory(const RendererRequest& request, uint64_t path_count, uint64_t machine_bytes);

}  // namespace lightloom
