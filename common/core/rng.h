#pragma once
// Keyed, counter-based random numbers. The n-th number of a stream is a pure function of its key, so any worker can
// reproduce any sample, and nothing depends on threads or on order. [Salmon et al. 2011 for the idea of counter-based
// generators; the mixing function is the SplitMix64 finaliser of Steele et al. 2014, keyed a second time halfway.]

#include <cstdint>

#include "common/core/vec.h"

namespace lightloom {

constexpr uint64_t mix64(uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
}

/// Which part of the computation a stream of random numbers belongs to. Images depend on these values: never renumber
/// them.
enum class Stage : uint32_t {
    kCamera = 1,
    kLight = 2,
    kConnect = 3,
    kPixelScramble = 4,
    kPairing = 5,
    kTraining = 6,
    kLightPool = 7,
    kLightScramble = 8,
};

/// The identity of one stream: (job seed, stage, iteration, index of pixel or path).
struct RngKey {
    uint64_t seed = 0;
    Stage stage = Stage::kCamera;
    uint64_t iteration = 0;
    uint64_t index = 0;
};

class Rng {
  public:
    explicit constexpr Rng(const RngKey& key)
        : key_(mix64(mix64(key.seed + 0x9e3779b97f4a7c15ull) ^ (uint64_t(key.stage) << 56) ^ mix64(key.iteration))),
          counter_(mix64(key_ ^ mix64(key.index * 0xd1342543de82ef95ull + 0x2545f4914f6cdd1dull))) {}

    constexpr uint64_t next_u64() {
        counter_ += 0x9e3779b97f4a7c15ull;
        uint64_t z = counter_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
        z = ((z ^ (z >> 27)) + key_) * 0x94d049bb133111ebull;
        return z ^ (z >> 31);
    }
    /// Uniform in [0, 1), 24 bits: never 1 in float.
    constexpr float uniform() { return float(next_u64() >> 40) * 0x1p-24f; }
    /// Two uniforms in [0, 1)^2 for one mixing step.
    constexpr Vec2 uniform2() {
        const uint64_t bits = next_u64();
        return {float(bits >> 40) * 0x1p-24f, float(bits & 0xffffffu) * 0x1p-24f};
    }
    /// Uniform in [0, 1), 53 bits.
    constexpr double uniform_double() { return double(next_u64() >> 11) * 0x1p-53; }
    /// Uniform integer in [0, n), n > 0 (Lemire's multiply-shift; bias below 2^-32 n is accepted for n < 2^24).
    constexpr uint32_t below(uint32_t n) { return uint32_t((uint64_t(uint32_t(next_u64() >> 32)) * n) >> 32); }

  private:
    uint64_t key_;
    uint64_t counter_;
};

}  // namespace lightloom
