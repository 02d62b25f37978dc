#pragma once
// Two-dimensional low-discrepancy points for the first decisions of a camera sample: a (0,2)-sequence (Sobol') with
// nested uniform (Owen) scrambling by hashing [Laine and Karras 2011; Burley 2020, Practical Hash-based Owen Scrambling].
// A point is a pure function of (index, seed); different seeds give independent scrambles.

#include <cstdint>

#include "common/core/rng.h"
#include "common/core/vec.h"

namespace lightloom {

constexpr uint32_t reverse_bits(uint32_t x) {
    x = (x << 16) | (x >> 16);
    x = ((x & 0x00ff00ffu) << 8) | ((x >> 8) & 0x00ff00ffu);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
    x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
    return ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
}

/// Owen scramble of a bit-reversed value: every bit depends on the bits above it only.
constexpr uint32_t scramble_reversed(uint32_t x, uint32_t seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

/// Second dimension of the Sobol' sequence, bit-reversed. Its generator matrix is Pascal's triangle modulo 2, whose
/// entry (i, j) is odd where the bits of i are among those of j. The product is a sum over supersets, which is computed
/// for one bit of the positions at a time.
constexpr uint32_t sobol_second_reversed(uint32_t index) {
    index ^= (index >> 1) & 0x55555555u;
    index ^= (index >> 2) & 0x33333333u;
    index ^= (index >> 4) & 0x0f0f0f0fu;
    index ^= (index >> 8) & 0x00ff00ffu;
    index ^= (index >> 16) & 0x0000ffffu;
    return index;
}

/// Point `index` of the sequence belonging to `seed`, in [0, 1)^2. Any 2^k consecutive aligned indices are stratified.
constexpr Vec2 low_discrepancy_point(uint32_t index, uint64_t seed) {
    const uint64_t h = mix64(seed), h2 = mix64(seed + 0x9e3779b97f4a7c15ull);
    const uint32_t shuffled = reverse_bits(scramble_reversed(reverse_bits(index), uint32_t(h)));
    // The first dimension is the bit-reversed index, so its scramble needs no reversal on the way in.
    const uint32_t x = reverse_bits(scramble_reversed(shuffled, uint32_t(h >> 32)));
    const uint32_t y = reverse_bits(scramble_reversed(sobol_second_reversed(shuffled), uint32_t(h2)));
    return {float(x >> 8) * 0x1p-24f, float(y >> 8) * 0x1p-24f};
}

}  // namespace lightloom
