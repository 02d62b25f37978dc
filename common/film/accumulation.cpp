#include "common/film/accumulation.h"

#include <algorithm>
#include <string>

namespace lightloom {

namespace {

constexpr double kRange = FixedSums::kRange;
/// Values that share one brightness in the spread between groups: that of 16 pixels in a row is known sooner than that of one.
constexpr size_t kSpreadBlock = 3 * 16;

/// Rounds a bound up a little, so that sums of bounds stay bounds.
double loosened(double bound) { return bound * (1 + 0x1p-40) + 0x1p-44; }

Status out_of_range() { return data_loss("the light in a pixel adds up to more than 1e25 radiance units; scale the lights down"); }

/// Value of one channel, of a group or of all groups: camera mean plus splats per light path.
inline double pixel_value(double camera, uint64_t count, double splat, uint64_t light_paths) {
    double value = 0;
    if (count != 0) value += camera / double(count);
    if (light_paths != 0) value += splat / double(light_paths);
    return value;
}

}  // namespace

GroupSum::GroupSum(const FrameLayout& frame)
    : frame_(frame),
      camera_(size_t(frame.crop.area()) * 3),
      splat_(size_t(frame.crop.area()) * 3),
      camera_count_(size_t(frame.crop.area())) {}

Status GroupSum::add(const Partial& partial) {
    const Result<PartialBounds> bounds = check_partial(partial, frame_);
    if (!bounds.ok()) return bounds.status();

    const Rect& tile = partial.tile;
    const double camera_largest = loosened(bounds->camera), splat_largest = loosened(bounds->splat);
    if (camera_largest >= kRange || splat_largest >= kRange) return out_of_range();
    const size_t row_values = size_t(tile.width()) * 3;
    const auto row_of = [&](int y) { return size_t(frame_.crop.index(tile.x0, y)); };

    // The bounds settle nearly every case; the sums are checked one by one only where a bound may be reached.
    if (camera_bound_ + camera_largest >= kRange) {
        const double* source = partial.camera.data();
        for (int y = tile.y0; y < tile.y1; ++y, source += row_values) {
            for (size_t i = 0; i < row_values; ++i) {
                if (camera_.would_overflow(row_of(y) * 3 + i, source[i])) return out_of_range();
            }
        }
    }
    if (splat_bound_ + splat_largest >= kRange) {
        for (const SplatSum& splat : partial.splats) {
            for (size_t c = 0; c < 3; ++c) {
                if (splat_.would_overflow(size_t(splat.pixel) * 3 + c, splat.rgb[c])) return out_of_range();
            }
        }
    }

    const double* source = partial.camera.data();
    for (int y = tile.y0; y < tile.y1; ++y, source += row_values) {
        camera_.add(row_of(y) * 3, source, row_values, bounds->camera);
        uint64_t* counts = camera_count_.data() + row_of(y);
        for (int x = 0; x < tile.width(); ++x) counts[x] += partial.samples_per_pixel;
    }
    for (const SplatSum& splat : partial.splats) {
        splat_.add(size_t(splat.pixel) * 3, splat.rgb.data(), 3, bounds->splat);
    }
    camera_bound_ += camera_largest;
    splat_bound_ += splat_largest;
    light_paths_ += partial.light_paths;
    dropped_ += partial.dropped_count;
    return Status::ok_status();
}

Accumulation::Accumulation(const FrameLayout& frame, const FilmResponse& response)
    : frame_(frame),
      response_(response),
      camera_(size_t(frame.crop.area()) * 3),
      splat_(size_t(frame.crop.area()) * 3),
      camera_count_(size_t(frame.crop.area())),
      mean_(size_t(frame.crop.area()) * 3),
      moment_(size_t(frame.crop.area()) * 3) {}

Status Accumulation::fold(const GroupSum& group, uint32_t iterations) {
    if (!(group.frame_ == frame_)) return failed_precondition("accumulation: the group belongs to another frame");
    if (iterations == 0) return failed_precondition("accumulation: a group of no iterations cannot be folded");
    const bool splats_only = group.camera_count_.empty() || group.camera_count_[0] == 0;
    const uint64_t expected = splats_only ? 0 : iterations;
    if (splats_only && group.light_paths_ == 0) return failed_precondition("accumulation: the group is empty");
    for (size_t p = 0; p < group.camera_count_.size(); ++p) {
        if (group.camera_count_[p] != expected) {
            return failed_precondition("accumulation: pixel " + std::to_string(p) + " of the group has " +
                                       std::to_string(group.camera_count_[p]) + " camera samples, not " + std::to_string(expected) +
                                       "; only complete groups may be folded");
        }
    }
    if (camera_bound_ + group.camera_bound_ >= kRange || splat_bound_ + group.splat_bound_ >= kRange) {
        for (size_t i = 0; i < camera_.size(); ++i) {
            if (camera_.would_overflow(i, group.camera_) || splat_.would_overflow(i, group.splat_)) return out_of_range();
        }
    }

    camera_.add(group.camera_);
    splat_.add(group.splat_);
    const double weight = iterations;
    const double total = double(iterations_) + weight;
    double relative = 0;
    for (size_t block = 0; block < camera_.size(); block += kSpreadBlock) {
        const size_t end = std::min(camera_.size(), block + kSpreadBlock);
        double level = 0, squares = 0;
        for (size_t first = block; first < end; first += 3) {
            FilmResponse::Triple x;
            for (size_t c = 0; c < 3; ++c)
                x[c] = pixel_value(group.camera_.value(first + c), expected, group.splat_.value(first + c), group.light_paths_);
            x = response_.balanced(x);
            for (size_t c = 0; c < 3; ++c) {
                const size_t i = first + c;
                const double delta = x[c] - mean_[i];
                level += mean_[i];
                mean_[i] += delta * (weight / total);
                const double square = weight * delta * (x[c] - mean_[i]);
                moment_[i] += square;
                squares += square;
            }
        }
        level /= double(end - block);
        relative += squares / (level * level + epsilon());
    }
    if (group_count_ > 0) spread_.add(relative / double(camera_.size()));
    for (size_t p = 0; p < camera_count_.size(); ++p) camera_count_[p] += group.camera_count_[p];
    camera_bound_ += group.camera_bound_;
    splat_bound_ += group.splat_bound_;
    light_paths_ += group.light_paths_;
    dropped_ += group.dropped_;
    iterations_ += iterations;
    group_count_ += 1;
    return Status::ok_status();
}

RgbImage Accumulation::develop() const {
    RgbImage image{frame_.crop.width(), frame_.crop.height(), std::vector<float>(camera_.size())};
    develop(0, camera_count_.size(), image.pixels.data());
    return image;
}

RgbImage Accumulation::variance() const {
    if (group_count_ < 2) return {};
    RgbImage image{frame_.crop.width(), frame_.crop.height(), std::vector<float>(camera_.size())};
    variance(0, camera_count_.size(), image.pixels.data());
    return image;
}

std::optional<NoiseEstimate> Accumulation::noise() const {
    if (group_count_ < 2) return std::nullopt;
    const double factor = 1 / (double(group_count_ - 1) * double(iterations_));
    const double relmse =
        relative_variance(mean_.data(), moment_.data(), frame_.crop.width(), frame_.crop.height(), factor, epsilon());
    return NoiseEstimate{relmse, relmse * spread_.relative_error(), group_count_, iterations_};
}

void Accumulation::develop(size_t first, size_t count, float* values) const {
    for (size_t p = first; p < first + count; ++p) {
        FilmResponse::Triple value;
        for (size_t c = 0; c < 3; ++c)
            value[c] = pixel_value(camera_.value(3 * p + c), camera_count_[p], splat_.value(3 * p + c), light_paths_);
        value = response_(value);
        for (const double v : value) *values++ = float(v);
    }
}

void Accumulation::variance(size_t first, size_t count, float* values) const {
    const double factor = response_.exposure * response_.exposure / (double(group_count_ - 1) * double(iterations_));
    for (size_t i = 3 * first; i < 3 * (first + count); ++i) *values++ = float(moment_[i] * factor);
}

}  // namespace lightloom
