#pragma once
// Records what the vertices of camera sub-paths are followed by, for the gain table of roulette.

#include <algorithm>
#include <array>

#include "common/tables/training_data.h"
#include "common/transport/contribution.h"

namespace lightloom {

/// The visits of one camera sample whose walk neither branches nor ends by roulette: what is told is what a sub-path that goes
/// on finds. Off, it records nothing.
class Visits {
  public:
    explicit Visits(bool on) : on_(on) {}

    /// Adds what a contribution of this camera sample is worth to the image.
    void add(const PathContribution& c, double estimate) {
        if (!on_) return;
        // A sub-path that leaves the scene meets the sky one vertex later.
        const bool escaped = c.technique.s == 0 && c.z[c.t - 1].emitter != int32_t(c.emitter);
        found_[size_t(c.t) + (escaped ? 1 : 0)] += estimate;
    }
    /// Ends a walk z[0 .. t-1] of paths of at most max_edges in a block of the frame.
    void move_to(TrainingData* data, const PathVertex* z, int t, int max_edges, uint32_t block) {
        if (!on_) return;
        double later = found_[size_t(t) + 1];
        for (int n = t; n >= 2; --n) {  // the walk of n vertices
            const PathVertex& v = z[n - 1];
            if (n <= max_edges) {
                const double throughput = double(scalar_of(v.alpha));
                data->visits.push_back(
                    {v.p, face_forward(v.ng, v.wo), float(throughput > 0 ? later / throughput : 0), float(t - n)});
            }
            later += found_[size_t(n)];
        }
        data->block_square[block] += later * later;
    }

  private:
    bool on_;
    std::array<double, kMaxEdges + 4> found_{};  ///< By the number of camera vertices.
};

}  // namespace lightloom
