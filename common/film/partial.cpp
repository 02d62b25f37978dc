#include "common/film/partial.h"

#include <bit>
#include <string>

namespace lightloom {

namespace {

/// True if any of the values is NaN or infinite. One OR-able integer test per value, so that the loop vectorises.
bool any_non_finite(const double* values, size_t count) {
    constexpr uint64_t kExponent = 0x7ff0000000000000ull;
    uint64_t found = 0;
    for (size_t i = 0; i < count; ++i) found |= uint64_t((std::bit_cast<uint64_t>(values[i]) & kExponent) == kExponent);
    return found != 0;
}

std::string describe(const Rect& r) {
    std::string text = "[";
    text += std::to_string(r.x0) + "," + std::to_string(r.x1) + ") x [" + std::to_string(r.y0) + "," + std::to_string(r.y1);
    return text + ")";
}

}  // namespace

Status check_partial(const Partial& partial, const FrameLayout& frame) {
    const Rect& tile = partial.tile;
    const Rect& crop = frame.crop;
    if (tile.empty() || tile.x0 < crop.x0 || tile.y0 < crop.y0 || tile.x1 > crop.x1 || tile.y1 > crop.y1) {
        return data_loss("partial: tile " + describe(tile) + " does not lie inside the crop " + describe(crop));
    }
    if (partial.camera.size() != size_t(tile.area()) * 3) {
        return data_loss("partial: " + std::to_string(partial.camera.size()) + " camera sums for a tile of " +
                         std::to_string(tile.area()) + " pixels; three per pixel expected");
    }
    if (any_non_finite(partial.camera.data(), partial.camera.size())) {
        return data_loss("partial: a camera sum is NaN or infinite; the partial is corrupt");
    }
    const uint64_t crop_area = uint64_t(crop.area());
    uint64_t next = 0;
    for (const SplatSum& splat : partial.splats) {
        if (splat.pixel < next || splat.pixel >= crop_area) {
            return data_loss("partial: splat pixel " + std::to_string(splat.pixel) +
                             " is out of order or outside the crop of " + std::to_string(crop_area) + " pixels");
        }
        next = uint64_t(splat.pixel) + 1;
        if (any_non_finite(splat.rgb.data(), 3)) {
            return data_loss("partial: the splat sum of pixel " + std::to_string(splat.pixel) +
                             " is NaN or infinite; the partial is corrupt");
        }
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
    return Status::ok_status();
}

}  // namespace lightloom
