#pragma once
// An array of exact sums: 128-bit integers in steps of 2^-44, range about 1e25.

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace lightloom {

using Int128 = __int128;

/// The lower and upper words live in separate arrays: the upper word hardly ever changes, and leaving it alone halves
/// the memory that an addition touches, which is what limits its speed.
class FixedSums {
  public:
    /// |sum| stays below 2^127 steps.
    static constexpr double kRange = 0x1p83;

    explicit FixedSums(size_t count) : low_(count), high_(count) {}

    size_t size() const { return low_.size(); }
    Int128 steps(size_t i) const { return Int128(high_[i]) << 64 | low_[i]; }
    /// The sum, correctly rounded.
    double value(size_t i) const { return double(steps(i)) * (1 / kStepsPerUnit); }

    /// Adds `count` values, each rounded to the nearest step (ties to even), from sum `first` on. No magnitude exceeds
    /// `largest`, which is finite and below kRange, and no sum may leave the range.
    void add(size_t first, const double* values, size_t count, double largest) {
        if (largest < kFastLimit) {  // This is nearly always so.
            for (size_t i = 0; i < count; ++i) {
                const int64_t steps = std::llrint(values[i] * kStepsPerUnit);
                const uint64_t sum = low_[first + i] + uint64_t(steps);
                const int64_t carry = int64_t(sum < uint64_t(steps)) + (steps >> 63);
                low_[first + i] = sum;
                if (carry != 0) high_[first + i] += carry;
            }
        } else {
            for (size_t i = 0; i < count; ++i) set(first + i, steps(first + i) + to_steps(values[i]));
        }
    }
    /// Adds another array of the same size, sum by sum.
    void add(const FixedSums& other) {
        for (size_t i = 0; i < size(); ++i) set(i, steps(i) + other.steps(i));
    }

    bool would_overflow(size_t i, double value) const { return overflows(steps(i), to_steps(value)); }
    bool would_overflow(size_t i, const FixedSums& other) const { return overflows(steps(i), other.steps(i)); }

    /// Converts a value to steps; |value| must be below kRange.
    static Int128 to_steps(double value) {
        const double steps = value * kStepsPerUnit;  // Exact: the factor is a power of two and overflow is far away.
        if (std::fabs(value) < kFastLimit) return std::llrint(steps);
        // From 2^53 on every double is an integer, namely its mantissa, shifted.
        const uint64_t bits = std::bit_cast<uint64_t>(steps);
        const int shift = int((bits >> 52) & 0x7ff) - 1075;
        const Int128 magnitude = Int128((bits & 0xfffffffffffffull) | 0x10000000000000ull) << shift;
        return (bits >> 63) ? -magnitude : magnitude;
    }

  private:
    static constexpr double kStepsPerUnit = 0x1p44;
    static constexpr double kFastLimit = 0x1p18;  // Values below it make steps of at most 62 bits.

    static bool overflows(Int128 a, Int128 b) {
        Int128 sum;
        return __builtin_add_overflow(a, b, &sum);
    }
    void set(size_t i, Int128 steps) {
        low_[i] = uint64_t(steps);
        high_[i] = int64_t(steps >> 64);
    }

    std::vector<uint64_t> low_;
    std::vector<int64_t> high_;
};

}  // namespace lightloom
