#include "server/reducer.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <string>
#include <thread>
#include <utility>

namespace lightloom {
namespace {

constexpr int kDevelopAttempts = 4;

}  // namespace

double mean_luminance(const RgbImage& image) {
    double sum = 0;
    const std::vector<float>& pixels = image.pixels;
    for (size_t i = 0; i + 2 < pixels.size(); i += 3) sum += double(Rgb(pixels[i], pixels[i + 1], pixels[i + 2]).luminance());
    return pixels.empty() ? 0 : 3 * sum / double(pixels.size());
}

Reducer::Reducer(const FrameLayout& frame, uint32_t tile_count, const FilmResponse& response, double noise_target)
    : frame_(frame),
      tile_count_(tile_count),
      response_(response),
      noise_target_(noise_target) {}

Result<std::optional<Status>> Reducer::add(const WorkUnit& unit, const Partial& partial) {
    const std::lock_guard lock(mutex_);
    try {
        return add_locked(unit, partial);
    } catch (const std::bad_alloc&) {
        return Status(StatusCode::kResourceExhausted,
                      "the coordinator has too little memory for the sums of " + std::to_string(frame_.crop.area()) + " pixels");
    }
}

Result<std::optional<Status>> Reducer::add_locked(const WorkUnit& unit, const Partial& partial) {
    using Answer = std::optional<Status>;
    if (frozen_) return Status(StatusCode::kCancelled, "the image is being finished");
    if (noise_ && noise_->reached) return Answer();
    if (unit.key.group < group_count()) return Answer(internal_error("the unit was merged twice"));
    if (partial.tile != unit.render.tile || partial.samples_per_pixel != unit.render.samples_per_pixel() ||
        partial.light_paths != unit.render.light_path_count)
        return Answer(data_loss("the partial is of another unit"));
    if (!complete_) complete_.emplace(frame_, response_);
    OpenGroup& group = open(unit);
    if (const Status added = group.sum.add(partial); !added.ok()) return Answer(added);
    group.iterations = unit.render.iteration_count;
    group.counters += partial.counters;
    ++group.units;
    if (unit.key == UnitKey{}) rare_light_ = partial.rare_light;
    for (const DroppedSample& sample : partial.dropped)
        if (group.dropped.size() < kMaxDropped) group.dropped.push_back({unit.key, sample});
    // Complete later groups may have waited only for this one.
    while (!open_.empty() && open_.begin()->first == group_count() && open_.begin()->second.units == tile_count_)
        LL_RETURN_IF_ERROR(fold());
    return Answer();
}

Reducer::OpenGroup& Reducer::open(const WorkUnit& unit) {
    if (const auto known = open_.find(unit.key.group); known != open_.end()) return known->second;
    OpenGroup group{spare_ ? *std::exchange(spare_, std::nullopt) : GroupSum(frame_), 0, 0, {}, {}};
    return open_.emplace(unit.key.group, std::move(group)).first->second;
}

Status Reducer::fold() {
    auto lowest = open_.extract(open_.begin());
    OpenGroup& group = lowest.mapped();
    LL_RETURN_IF_ERROR(complete_->fold(group.sum, group.iterations));
    counters_ += group.counters;
    for (const Dropped& sample : group.dropped)
        if (dropped_.size() < kMaxDropped) dropped_.push_back(sample);
    if (!spare_) {
        group.sum.clear();
        spare_ = std::move(group.sum);
    }
    if (!NoiseEstimate::is_due(group_count(), complete_->iterations(), noise_ ? noise_->estimate.iterations : 0)) return {};
    noise_ = estimate_noise();
    if (noise_->reached) drop_open_groups();
    return {};
}

void Reducer::drop_open_groups() {
    open_.clear();
    spare_.reset();
}

std::optional<NoiseReport> Reducer::estimate_noise() const {
    const auto estimate = complete_ ? complete_->noise() : std::nullopt;
    if (!estimate) return std::nullopt;
    NoiseReport report{*estimate};
    if (!(noise_target_ > 0) || !estimate->reaches(noise_target_)) return report;
    // The groups agree also as long as none of them has found anything, or nothing of what only chance finds.
    const double mean = mean_luminance(complete_->develop());
    const double rare_error = rare_light_of(mean).mean_error;
    report.light_missing = !(mean > 0) || rare_error * rare_error > noise_target_;
    report.reached = !report.light_missing;
    return report;
}

std::optional<NoiseReport> Reducer::noise() const {
    const std::lock_guard lock(mutex_);
    return noise_;
}

std::optional<NoiseReport> Reducer::final_noise() const {
    const std::lock_guard lock(mutex_);
    return noise_ && noise_->estimate.groups == group_count() ? noise_ : estimate_noise();
}

void Reducer::freeze() {
    const std::lock_guard lock(mutex_);
    frozen_ = true;
    drop_open_groups();
}

uint32_t Reducer::folded_groups() const {
    const std::lock_guard lock(mutex_);
    return group_count();
}

uint64_t Reducer::iterations() const {
    const std::lock_guard lock(mutex_);
    return complete_ ? complete_->iterations() : 0;
}

UnitCounters Reducer::counters() const {
    const std::lock_guard lock(mutex_);
    return counters_;
}

uint64_t Reducer::dropped() const {
    const std::lock_guard lock(mutex_);
    return complete_ ? complete_->dropped() : 0;
}

std::vector<Reducer::Dropped> Reducer::first_dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
}

Result<DevelopedImage> Reducer::developed(bool with_variance, const std::function<void()>& between) const {
    const size_t pixels = size_t(frame_.crop.area());
    const auto blank = [&] { return RgbImage{frame_.crop.width(), frame_.crop.height(), std::vector<float>(3 * pixels)}; };
    for (int attempt = 1;; ++attempt) {
        const uint32_t groups = folded_groups();
        if (groups == 0) return failed_precondition("no group of iterations is complete yet; ask again later");
        DevelopedImage image{blank(), with_variance && groups > 1 ? blank() : RgbImage(), 0, groups};
        std::unique_lock lock(mutex_);
        for (size_t first = 0; group_count() == groups;) {
            const size_t count = std::min(kPixelsAtATime, pixels - first);
            complete_->develop(first, count, &image.color.pixels[3 * first]);
            if (!image.variance.pixels.empty()) complete_->variance(first, count, &image.variance.pixels[3 * first]);
            image.iterations = complete_->iterations();
            first += count;
            if (first == pixels) return image;
            if (attempt >= kDevelopAttempts) continue;
            lock.unlock();
            if (between) between();
            // Mutexes are not fair: without a pause, this thread would have it again before those that wait for it.
            std::this_thread::sleep_for(std::chrono::microseconds(100));
            lock.lock();
        }
    }
}

Result<Reducer::Saved> Reducer::serialize() const {
    Saved saved;
    {
        const std::lock_guard lock(mutex_);
        saved.groups = group_count();
        if (saved.groups == 0) return failed_precondition("no group of iterations is complete yet; there is nothing to save");
        saved.bytes = encode_reducer_state({tile_count_, noise_target_, counters_, dropped_, rare_light_, noise_}, *complete_);
    }
    seal_state(saved.bytes);
    return saved;
}

Status Reducer::restore(std::string_view bytes) {
    Accumulation complete(frame_, response_);
    auto state = decode_reducer_state(bytes, complete);
    if (!state.ok()) return state.status();
    if (state->tile_count != tile_count_ || state->noise_target != noise_target_)
        return failed_precondition("the saved sums are those of another job");
    const std::lock_guard lock(mutex_);
    if (complete_ || frozen_) return failed_precondition("sums can be restored only before the first partial");
    complete_ = std::move(complete);
    counters_ = state->counters;
    dropped_ = std::move(state->dropped);
    rare_light_ = state->rare_light;
    noise_ = state->noise;
    return {};
}

RareLightReport Reducer::rare_light_report(double image_mean) const {
    const std::lock_guard lock(mutex_);
    return rare_light_of(image_mean);
}

RareLightReport Reducer::rare_light_of(double image_mean) const {
    const FilmResponse::Triple grey = response_.of(Rgb(1.0f));
    const double exposure = double(Rgb(float(grey[0]), float(grey[1]), float(grey[2])).luminance());
    return RareLightReport::of(rare_light_, double(counters_.camera_samples), image_mean, exposure);
}

}  // namespace lightloom
