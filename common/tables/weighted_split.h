#pragma once
// One step of building a k-d tree: a set is divided at the weighted median of its longest axis.

#include <algorithm>
#include <cmath>
#include <span>

#include "common/core/vec.h"

namespace lightloom {

/// Sorts `items` along the axis on which position(item) varies most and returns how many of them lie below `*threshold`,
/// about half of the weight; 0 or all if they lie in one place. Items below the threshold on `*axis` come first.
template <class Item, class Position, class Weight>
size_t split_at_median(std::span<Item> items, Position&& position, Weight&& weight, int* axis = nullptr,
                       float* threshold = nullptr) {
    double total = 0, mean[3] = {}, square[3] = {};
    for (const Item& item : items) {
        const double w = weight(item);
        const Vec3 p = position(item);
        total += w;
        for (int i = 0; i < 3; ++i) mean[i] += w * double(p[i]), square[i] += w * double(p[i]) * double(p[i]);
    }
    int longest = 0;
    double most = -1;
    for (int i = 0; i < 3; ++i) {
        const double variance = total > 0 ? square[i] / total - (mean[i] / total) * (mean[i] / total) : 0;
        if (variance > most) most = variance, longest = i;
    }
    std::stable_sort(items.begin(), items.end(),
                     [&](const Item& a, const Item& b) { return position(a)[longest] < position(b)[longest]; });
    double below = 0;
    size_t half = 0;
    while (half < items.size() && below < total / 2) below += weight(items[half++]);
    // Items at the same coordinate stay together, on the side of the threshold where they are looked up.
    half = std::clamp(half, size_t(1), items.size() - 1);
    const float at = position(items[half])[longest];
    while (half > 0 && position(items[half - 1])[longest] >= at) --half;
    if (half == 0) {  // the lower half is one coordinate: it is divided from what lies above
        while (half < items.size() && position(items[half])[longest] <= at) ++half;
    }
    if (axis) *axis = longest;
    if (threshold) *threshold = half < items.size() ? position(items[half])[longest] : at;
    return half;
}

}  // namespace lightloom
