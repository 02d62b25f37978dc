#pragma once
// Many discrete distributions over the same outcomes, drawn by inversion of the distribution function with cutpoints
// [Chen and Asau 1974]. Neighbouring numbers give neighbouring outcomes, so that points stratified over [0, 1) are
// stratified over the outcomes; an alias table would scatter them.

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/huge_pages.h"

namespace lightloom {

class InverseCdfTable {
  public:
    struct Draw {
        uint32_t outcome;
        float probability;  ///< The outcome's exact probability in the table, a multiple of 2^-31.
        double rest;        ///< Relative position of the number in the outcome's interval: uniform in [0, 1).
    };

    class Column {
      public:
        static constexpr int kMaxStrata = 64;

        Draw draw(double u) const {
            Draw draw;
            draw_strata(u, 1, &draw);
            return draw;
        }
        /// Draws with the numbers (u + n) / count, n = 0 .. count - 1, count <= kMaxStrata. A large table lies in main
        /// memory; the draws prefetch from it first, so that they wait for it together.
        void draw_strata(double u, int count, Draw* out) const {
            double scaled[kMaxStrata];
            uint32_t cut[kMaxStrata];
            for (int n = 0; n < count; ++n) {
                scaled[n] = std::min((u + n) / count * kOne, kOne - 0x1p-21);  // u may have been rounded to 1
                cut[n] = cutpoints_[uint32_t(scaled[n]) >> kCutShift];
                __builtin_prefetch(&first_[cut[n] + 1]);
            }
            for (int n = 0; n < count; ++n) {
                uint32_t i = cut[n];
                while (first_[i + 1] <= uint32_t(scaled[n])) ++i;
                const double width = double(first_[i + 1] - first_[i]);
                out[n] = {i, float(width * (1 / kOne)), (scaled[n] - double(first_[i])) / width};
            }
        }

      private:
        friend class InverseCdfTable;
        Column(const uint32_t* first, const uint16_t* cutpoints) : first_(first), cutpoints_(cutpoints) {}
        const uint32_t* first_;
        const uint16_t* cutpoints_;
    };

    static constexpr uint32_t kMaxOutcomes = 65536;

    /// `outcomes` is at most kMaxOutcomes.
    InverseCdfTable(uint32_t outcomes, uint32_t columns)
        : outcomes_(outcomes),
          first_(size_t(outcomes + 1) * columns),
          cutpoints_(size_t(kCuts) * columns) {}

    /// The weights are finite and non-negative, and their sum is positive. Each positive one gets a probability of at
    /// least 2^-31.
    void set(uint32_t column, std::span<const float> weights) {
        uint32_t* first = &first_[size_t(column) * (outcomes_ + 1)];
        double total = 0, sum = 0;
        for (const float w : weights) total += double(w);
        first[0] = 0;
        for (uint32_t i = 0; i < outcomes_; ++i) {
            sum += double(weights[i]);
            first[i + 1] = std::max(uint32_t(sum / total * kOne + 0.5), first[i] + (weights[i] > 0 ? 1 : 0));
        }
        first[outcomes_] = uint32_t(kOne);
        for (uint32_t i = outcomes_; i-- > 1;) first[i] = std::min(first[i], first[i + 1] - (weights[i] > 0 ? 1 : 0));
        uint32_t i = 0;
        for (uint32_t c = 0; c < kCuts; ++c) {
            while (first[i + 1] <= c << kCutShift) ++i;
            cutpoints_[size_t(column) * kCuts + c] = uint16_t(i);
        }
    }
    Column column(uint32_t c) const { return {&first_[size_t(c) * (outcomes_ + 1)], &cutpoints_[size_t(c) * kCuts]}; }

  private:
    static constexpr double kOne = 0x1p31;
    static constexpr uint32_t kCuts = 256, kCutShift = 31 - 8;

    uint32_t outcomes_;
    /// For each column: where its outcomes' intervals begin, in units of 2^-31, and where the last one ends.
    std::vector<uint32_t, HugePageAllocator<uint32_t>> first_;
    /// For each column: the outcomes at the multiples of 1/256.
    std::vector<uint16_t, HugePageAllocator<uint16_t>> cutpoints_;
};

}  // namespace lightloom
