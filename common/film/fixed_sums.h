#pragma once
// An array of exact sums: 128-bit integers in steps of 2^-44, range about 1e25.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "common/core/state_bytes.h"

namespace lightloom {

using Int128 = __int128;

/// The lower words of all sums lie in one array, which is made with the first addition. The upper word of a sum differs from zero
/// only if the sum is negative or above 2^20, which hardly any sum of radiance is, and so upper words exist in blocks where they
/// are needed: that halves the memory, and what an addition touches, which limits its speed.
class FixedSums {
  public:
    /// |sum| stays below 2^127 steps.
    static constexpr double kRange = 0x1p83;

    explicit FixedSums(size_t count) : count_(count) {}

    size_t size() const { return count_; }
    /// True before the first addition: all sums are zero and take no memory.
    bool empty() const { return low_.empty(); }
    /// Makes the sums' memory, so that what is added next allocates only for the largest sums (std::bad_alloc).
    void allocate() {
        if (!empty()) return;
        low_.resize(count_);
        high_.resize((count_ + kBlock - 1) / kBlock);
    }
    /// Sets all sums to zero and keeps their memory.
    void clear() {
        std::fill(low_.begin(), low_.end(), 0);
        for (auto& block : high_) block.reset();
    }

    Int128 steps(size_t i) const { return empty() ? 0 : Int128(high(i)) << 64 | low_[i]; }
    /// The sum, correctly rounded.
    double value(size_t i) const {
        if (empty()) return 0;
        const int64_t upper = high(i);
        // Conversions of 64 bits take a fraction of the time.
        return (upper == 0 ? double(low_[i]) : double(Int128(upper) << 64 | low_[i])) * (1 / kStepsPerUnit);
    }

    /// Adds `count` values, each rounded to the nearest step (ties to even), from sum `first` on. No magnitude exceeds
    /// `largest`, which is finite and below kRange, and no sum may leave the range.
    void add(size_t first, const double* values, size_t count, double largest) {
        allocate();
        if (largest < kFastLimit) {  // This is nearly always so.
            for (size_t i = 0; i < count; ++i) {
                const int64_t steps = std::llrint(values[i] * kStepsPerUnit);
                const uint64_t sum = low_[first + i] + uint64_t(steps);
                const int64_t carry = int64_t(sum < uint64_t(steps)) + (steps >> 63);
                low_[first + i] = sum;
                if (carry != 0) add_high(first + i, carry);
            }
        } else {
            for (size_t i = 0; i < count; ++i) set(first + i, steps(first + i) + to_steps(values[i]));
        }
    }
    /// Adds the sums [first, first + count) of another array of the same size, sum by sum.
    void add(const FixedSums& other, size_t first, size_t count) {
        if (other.empty()) return;
        allocate();
        for (size_t i = first; i < first + count; ++i) {
            const uint64_t sum = low_[i] + other.low_[i];
            const int64_t upper = other.high(i) + int64_t(sum < low_[i]);
            low_[i] = sum;
            if (upper != 0) add_high(i, upper);
        }
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

    /// Everything but the number of sums.
    void write_state(StateWriter& out) const {
        out.put(uint8_t(!empty()));
        if (empty()) return;
        out.put_array(low_.data(), low_.size());
        out.put(uint64_t(std::count_if(high_.begin(), high_.end(), [](const auto& block) { return block != nullptr; })));
        for (size_t i = 0; i < high_.size(); ++i) {
            if (!high_[i]) continue;
            out.put(uint64_t(i));
            out.put_array(high_[i]->data(), kBlock);
        }
    }
    /// Reads what sums of the same number wrote, into sums that are empty; the reader tells whether it could.
    void read_state(StateReader& in) {
        if (in.get<uint8_t>() == 0 || !in.ok()) return;
        in.get_vector(low_, count_);
        const uint64_t blocks = in.get<uint64_t>();
        if (in.ok()) high_.resize((count_ + kBlock - 1) / kBlock);
        for (uint64_t n = 0; n < blocks && in.ok(); ++n) {
            const uint64_t i = in.get<uint64_t>();
            if (i >= high_.size() || high_[i]) return in.fail();
            high_[i] = std::make_unique<Block>();
            in.get_array(high_[i]->data(), kBlock);
        }
    }

  private:
    static constexpr double kStepsPerUnit = 0x1p44;
    static constexpr double kFastLimit = 0x1p18;  // Values below it make steps of at most 62 bits.
    static constexpr size_t kBlock = 1024;        // sums that share a block of upper words
    using Block = std::array<int64_t, kBlock>;

    static bool overflows(Int128 a, Int128 b) {
        Int128 sum;
        return __builtin_add_overflow(a, b, &sum);
    }
    int64_t high(size_t i) const {
        const Block* block = high_[i / kBlock].get();
        return block ? (*block)[i % kBlock] : 0;
    }
    void add_high(size_t i, int64_t carry) {
        std::unique_ptr<Block>& block = high_[i / kBlock];
        if (!block) block = std::make_unique<Block>();
        (*block)[i % kBlock] += carry;
    }
    void set(size_t i, Int128 steps) {
        low_[i] = uint64_t(steps);
        if (const int64_t change = int64_t(steps >> 64) - high(i); change != 0) add_high(i, change);
    }

    size_t count_;
    std::vector<uint64_t> low_;
    std::vector<std::unique_ptr<Block>> high_;
};

}  // namespace lightloom
