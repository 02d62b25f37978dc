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

/// Values of one channel before the film's response, camera mean plus splats per light path, of sums [first, first + count).
struct Means {
    const FixedSums &camera, &splat;
    double per_sample, per_path;

    Means(const FixedSums& camera_sums, const FixedSums& splat_sums, uint64_t samples, uint64_t light_paths)
        : camera(camera_sums),
          splat(splat_sums),
          per_sample(samples > 0 ? 1 / double(samples) : 0),
          per_path(light_paths > 0 ? 1 / double(light_paths) : 0) {}
    /// With the white balance of `response`.
    void write(size_t first, size_t count, const FilmResponse& response, double* values) const {
        for (size_t i = 0; i < count; ++i) values[i] = camera.value(first + i) * per_sample + splat.value(first + i) * per_path;
        if (response.is_neutral()) return;
        for (size_t i = 0; i + 2 < count; i += 3) {
            const FilmResponse::Triple balanced = response.balanced({values[i], values[i + 1], values[i + 2]});
            std::copy(balanced.begin(), balanced.end(), values + i);
        }
    }
};

}  // namespace

GroupSum::GroupSum(const FrameLayout& frame)
    : frame_(frame),
      camera_(size_t(frame.crop.area()) * 3),
      splat_(size_t(frame.crop.area()) * 3) {}

void GroupSum::clear() {
    camera_.clear();
    splat_.clear();
    tiles_.clear();
    light_paths_ = dropped_ = 0;
    camera_bound_ = splat_bound_ = 0;
}

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

    if (partial.samples_per_pixel > 0) camera_.allocate();
    if (!partial.splats.empty()) splat_.allocate();
    tiles_.push_back({tile, partial.samples_per_pixel});
    if (partial.samples_per_pixel > 0) {
        const double* source = partial.camera.data();
        for (int y = tile.y0; y < tile.y1; ++y, source += row_values)
            camera_.add(row_of(y) * 3, source, row_values, bounds->camera);
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

uint64_t GroupSum::camera_count(size_t pixel) const {
    const int width = frame_.crop.width();
    const int x = frame_.crop.x0 + int(pixel % size_t(width)), y = frame_.crop.y0 + int(pixel / size_t(width));
    uint64_t count = 0;
    for (const Tile& tile : tiles_) count += tile.pixels.contains(x, y) ? tile.samples_per_pixel : 0;
    return count;
}

std::optional<GroupSum::WrongCount> GroupSum::find_wrong_count(uint64_t count) const {
    // Nearly always the tiles lie side by side and have the same number of samples.
    bool plain = true;
    int64_t area = 0;
    for (size_t i = 0; i < tiles_.size() && plain; ++i) {
        const Rect& a = tiles_[i].pixels;
        area += a.area();
        plain = tiles_[i].samples_per_pixel == count;
        for (size_t j = 0; j < i && plain; ++j) {
            const Rect& b = tiles_[j].pixels;
            plain = a.x1 <= b.x0 || b.x1 <= a.x0 || a.y1 <= b.y0 || b.y1 <= a.y0;
        }
    }
    if (plain && area == frame_.crop.area()) return std::nullopt;
    for (size_t p = 0; p < size_t(frame_.crop.area()); ++p)
        if (const uint64_t found = camera_count(p); found != count) return WrongCount{p, found};
    return std::nullopt;
}

Accumulation::Accumulation(const FrameLayout& frame, const FilmResponse& response)
    : frame_(frame),
      response_(response),
      camera_(size_t(frame.crop.area()) * 3),
      splat_(size_t(frame.crop.area()) * 3) {}

Status Accumulation::fold(const GroupSum& group, uint32_t iterations) {
    if (!(group.frame_ == frame_)) return failed_precondition("accumulation: the group belongs to another frame");
    if (iterations == 0) return failed_precondition("accumulation: a group of no iterations cannot be folded");
    const bool splats_only = group.camera_count(0) == 0;
    const uint64_t expected = splats_only ? 0 : iterations;
    if (splats_only && group.light_paths_ == 0) return failed_precondition("accumulation: the group is empty");
    if (const auto wrong = group.find_wrong_count(expected)) {
        return failed_precondition("accumulation: pixel " + std::to_string(wrong->pixel) + " of the group has " +
                                   std::to_string(wrong->count) + " camera samples, not " + std::to_string(expected) +
                                   "; only complete groups may be folded");
    }
    if (camera_bound_ + group.camera_bound_ >= kRange || splat_bound_ + group.splat_bound_ >= kRange) {
        for (size_t i = 0; i < camera_.size(); ++i) {
            if (camera_.would_overflow(i, group.camera_) || splat_.would_overflow(i, group.splat_)) return out_of_range();
        }
    }

    if (!group.camera_.empty()) camera_.allocate();
    if (!group.splat_.empty()) splat_.allocate();
    moment_.resize(camera_.size());
    const double weight = iterations;
    const Means own(group.camera_, group.splat_, expected, group.light_paths_);
    const Means before(camera_, splat_, camera_count_, light_paths_);
    const Means after(camera_, splat_, camera_count_ + expected, light_paths_ + group.light_paths_);
    double relative = 0;
    for (size_t block = 0; block < camera_.size(); block += kSpreadBlock) {
        const size_t count = std::min(camera_.size() - block, kSpreadBlock);
        double x[kSpreadBlock], old_mean[kSpreadBlock], mean[kSpreadBlock];
        own.write(block, count, response_, x);
        before.write(block, count, response_, old_mean);
        camera_.add(group.camera_, block, count);
        splat_.add(group.splat_, block, count);
        after.write(block, count, response_, mean);
        double level = 0, squares = 0;
        for (size_t i = 0; i < count; ++i) {
            level += old_mean[i];
            const double square = weight * (x[i] - old_mean[i]) * (x[i] - mean[i]);
            moment_[block + i] += square;
            squares += square;
        }
        level /= double(count);
        relative += squares / (level * level + epsilon());
    }
    if (group_count_ > 0) spread_.add(relative / double(camera_.size()));
    camera_count_ += expected;
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
    develop(0, camera_.size() / 3, image.pixels.data());
    return image;
}

RgbImage Accumulation::variance() const {
    if (group_count_ < 2) return {};
    RgbImage image{frame_.crop.width(), frame_.crop.height(), std::vector<float>(camera_.size())};
    variance(0, camera_.size() / 3, image.pixels.data());
    return image;
}

std::optional<NoiseEstimate> Accumulation::noise() const {
    if (group_count_ < 2) return std::nullopt;
    const double factor = 1 / (double(group_count_ - 1) * double(iterations_));
    const int width = frame_.crop.width();
    const auto mean_of_row = [&](int y, double* values) {
        Means(camera_, splat_, camera_count_, light_paths_)
            .write(3 * size_t(y) * size_t(width), 3 * size_t(width), response_, values);
    };
    const double relmse = relative_variance(mean_of_row, moment_.data(), width, frame_.crop.height(), factor, epsilon());
    return NoiseEstimate{relmse, relmse * spread_.relative_error(), group_count_, iterations_};
}

void Accumulation::develop(size_t first, size_t count, float* values) const {
    for (size_t p = first; p < first + count; ++p) {
        FilmResponse::Triple value{};
        for (size_t c = 0; c < 3; ++c) {
            if (camera_count_ != 0) value[c] += camera_.value(3 * p + c) / double(camera_count_);
            if (light_paths_ != 0) value[c] += splat_.value(3 * p + c) / double(light_paths_);
        }
        for (const double v : response_(value)) *values++ = float(v);
    }
}

void Accumulation::variance(size_t first, size_t count, float* values) const {
    const double factor = response_.exposure * response_.exposure / (double(group_count_ - 1) * double(iterations_));
    for (size_t i = 3 * first; i < 3 * (first + count); ++i) *values++ = float(moment_[i] * factor);
}

void Accumulation::write_state(std::string& out) const {
    StateWriter state(out);
    for (const int n : {frame_.width, frame_.height, frame_.crop.x0, frame_.crop.y0, frame_.crop.x1, frame_.crop.y1}) state.put(n);
    state.put(response_.exposure);
    for (const FilmResponse::Triple& row : response_.colour) state.put_array(row.data(), row.size());
    state.put(camera_count_);
    state.put(light_paths_);
    state.put(dropped_);
    state.put(iterations_);
    state.put(group_count_);
    state.put(camera_bound_);
    state.put(splat_bound_);
    spread_.write_state(state);
    camera_.write_state(state);
    splat_.write_state(state);
    state.put(uint8_t(!moment_.empty()));
    state.put_array(moment_.data(), moment_.size());
}

void Accumulation::read_state(StateReader& in) {
    for (const int n : {frame_.width, frame_.height, frame_.crop.x0, frame_.crop.y0, frame_.crop.x1, frame_.crop.y1})
        if (in.get<int>() != n) return in.fail();
    FilmResponse response;
    response.exposure = in.get<double>();
    for (FilmResponse::Triple& row : response.colour) in.get_array(row.data(), row.size());
    if (response.exposure != response_.exposure || response.colour != response_.colour) return in.fail();
    camera_count_ = in.get<uint64_t>();
    light_paths_ = in.get<uint64_t>();
    dropped_ = in.get<uint64_t>();
    iterations_ = in.get<uint64_t>();
    group_count_ = in.get<uint32_t>();
    camera_bound_ = in.get<double>();
    splat_bound_ = in.get<double>();
    spread_.read_state(in);
    camera_.read_state(in);
    splat_.read_state(in);
    if (in.get<uint8_t>() != 0) in.get_vector(moment_, camera_.size());
    if (moment_.empty() != (group_count_ == 0)) in.fail();
}

}  // namespace lightloom
