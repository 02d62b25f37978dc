#pragma once
// Random numbers of one sub-path: low-discrepancy points over the sub-paths of a sequence for the first decisions, a stream of its
// own for the rest.

#include "common/core/inline.h"
#include "common/core/low_discrepancy.h"
#include "common/path/random_walk.h"

namespace lightloom {

class WalkSampler {
  public:
    /// For the scattering at the last of n vertices: the first one is stratified over the sequence.
    LL_ALWAYS_INLINE ScatterSample scattering(int n) {
        const Vec2 u = rng_.uniform2();
        lobe_rest_ = u.y;
        return {u.x, n == 2 ? point(scattering_) : rng_.uniform2()};
    }
    /// A uniform number that scattering() has left over.
    float roulette() const { return lobe_rest_; }
    Rng& rng() { return rng_; }

  protected:
    /// `scramble` names the sequence and `index` the place in it; `scattering` is the point that scattering() takes.
    WalkSampler(const RngKey& key, uint64_t scramble, uint32_t index, uint64_t scattering)
        : rng_(key),
          scramble_(scramble),
          scattering_(scattering),
          index_(index) {}

    /// Points with different numbers are independent of one another.
    Vec2 point(uint64_t number) const { return low_discrepancy_point(index_, scramble_ + number); }

  private:
    Rng rng_;
    uint64_t scramble_, scattering_;
    uint32_t index_;
    float lobe_rest_ = 0;
};

}  // namespace lightloom
