#include "common/film/partial.h"

#include <algorithm>
#include <bit>
#include <string>

namespace lightloom {

namespace {

constexpr int64_t kMagnitude = 0x7fffffffffffffffll;
constexpr int64_t kInfinity = 0x7ff0000000000000ll;

/// Magnitudes compare as their bit patterns do, and NaN and infinity come out above every finite number, so that one
/// vectorised pass of integer maxima finds both the bound and corruption.
inline int64_t magnitude_bits(double value) { return std::bit_cast<int64_t>(value) & kMagnitude; }

int64_t largest_magnitude_bits(const double* values, size_t count) {
    int64_t largest = 0;
    for (size_t i = 0; i < count; ++i) largest = std::max(largest, magnitude_bits(values[i]));
    return largest;
}

std::string describe(const Rect& r) {
    std::string text = "[";
    text += std::to_string(r.x0) + "," + std::to_string(r.x1) + ") x [" + std::to_string(r.y0) + "," + std::to_string(r.y1);
    return text + ")";
}

}  // namespace

Result<PartialBounds> check_partial(const Partial& partial, const FrameLayout& frame) {
    const Rect& tile = partial.tile;
    const Rect& crop = frame.crop;
    if (tile.empty() || tile.x0 < crop.x0 || tile.y0 < crop.y0 || tile.x1 > crop.x1 || tile.y1 > crop.y1) {
        return data_loss("partial: tile " + describe(tile) + " does not lie inside the crop " + describe(crop));
    }
    if (partial.camera.size() != size_t(tile.area()) * 3) {
        return data_loss("partial: " + std::to_string(partial.camera.size()) + " camera sums for a tile of " +
                         std::to_string(tile.area()) + " pixels; three per pixel expected");
    }
    const int64_t camera_bits = largest_magnitude_bits(partial.camera.data(), partial.camera.size());
    if (camera_bits >= kInfinity) {
        return data_loss("partial: a camera sum is NaN or infinite; the partial is corrupt");
    }
    if (partial.samples_per_pixel == 0 && camera_bits != 0)
        return data_loss("partial: camera sums without camera samples; nothing could be divided by their number");
    const uint64_t crop_area = uint64_t(crop.area());
    uint64_t next = 0;
    int64_t splat_bits = 0;
    for (const SplatSum& splat : partial.splats) {
        if (splat.pixel < next || splat.pixel >= crop_area) {
            return data_loss("partial: splat pixel " + std::to_string(splat.pixel) + " is out of order or outside the crop of " +
                             std::to_string(crop_area) + " pixels");
        }
        next = uint64_t(splat.pixel) + 1;
        const int64_t bits = largest_magnitude_bits(splat.rgb.data(), 3);
        if (bits >= kInfinity) {
            return data_loss("partial: the splat sum of pixel " + std::to_string(splat.pixel) +
                             " is NaN or infinite; the partial is corrupt");
        }
        splat_bits = std::max(splat_bits, bits);
    }
    if (!partial.splats.empty() && partial.light_paths == 0) {
        return data_loss("partial: it holds splats but counts no light path that could have made them");
    }
    if (partial.dropped.size() > Partial::kMaxDroppedRecords || partial.dropped.size() > partial.dropped_count) {
        return data_loss("partial: " + std::to_string(partial.dropped.size()) + " records of dropped samples for " +
                         std::to_string(partial.dropped_count) + " dropped; at most " +
                         std::to_string(Partial::kMaxDroppedRecords) + " are kept");
    }
    for (const DroppedSample& dropped : partial.dropped) {
        if (dropped.pixel >= crop_area) {
            return data_loss("partial: dropped sample in pixel " + std::to_string(dropped.pixel) + " outside the crop");
        }
    }
    if (!partial.rare_light.is_valid()) return data_loss("partial: its estimate of rare light is negative or not finite");
    return PartialBounds{std::bit_cast<double>(camera_bits), std::bit_cast<double>(splat_bits)};
}

}  // namespace lightloom
