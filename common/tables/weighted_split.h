#pragma once
// One step of building a k-d tree: where a set is divided.

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "common/core/vec.h"

namespace lightloom {

/// Where a set is divided: the middle of the widest gap among the coordinates in [low, high] and their next neighbours on either
/// side; nothing if there is no gap. What is looked up in a tree may differ from what it was learned from by rounding (a
/// flat wall's normal) or packing (PackedNormal): a threshold beside such a coordinate would send all that lies there to the
/// other side.
template <class Items, class Coordinate>
std::optional<float> widest_gap(const Items& items, Coordinate&& coordinate, float low, float high) {
    float below = -HUGE_VALF, above = HUGE_VALF;
    std::vector<float> sorted;
    for (const auto& item : items) {
        const float c = coordinate(item);
        if (c < low)
            below = std::max(below, c);
        else if (c > high)
            above = std::min(above, c);
        else
            sorted.push_back(c);
    }
    if (below > -HUGE_VALF) sorted.push_back(below);
    if (above < HUGE_VALF) sorted.push_back(above);
    std::sort(sorted.begin(), sorted.end());
    std::optional<float> threshold;
    float widest = 0;
    for (size_t i = 1; i < sorted.size(); ++i) {
        const float gap = sorted[i] - sorted[i - 1];
        if (!(gap > widest)) continue;
        widest = gap;
        const float middle = sorted[i - 1] + gap / 2;
        threshold = middle > sorted[i - 1] ? middle : sorted[i];
    }
    return threshold;
}

/// Divides `items` along the axis on which position(item) varies most, at the widest gap between two and three fifths of the
/// weight, and returns how many lie below `*threshold` on `*axis`: they come first. 0 if all lie in one place.
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
    const auto coordinate = [&](const Item& item) { return position(item)[longest]; };
    float low = 0, high = 0;
    double below = 0;
    for (const Item& item : items) {
        if (below <= 0.4 * total) low = coordinate(item);
        if (below <= 0.6 * total) high = coordinate(item);
        below += weight(item);
    }
    const std::optional<float> gap = widest_gap(items, coordinate, low, high);
    if (axis) *axis = longest;
    if (threshold) *threshold = gap.value_or(low);
    if (!gap) return 0;
    return size_t(std::find_if(items.begin(), items.end(), [&](const Item& item) { return coordinate(item) >= *gap; }) -
                  items.begin());
}

}  // namespace lightloom
