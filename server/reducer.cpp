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

Result<std::vector<Reducer::Refusal>> Reducer::add(const WorkUnit& unit, Partial partial) {
    const std::lock_guard lock(mutex_);
    try {
        return add_locked(unit, std::move(partial));
    } catch (const std::bad_alloc&) {
        return Status(StatusCode::kResourceExhausted,
                      "the coordinator has too little memory for the sums of " + std::to_string(frame_.crop.area()) + " pixels");
    }
}

Result<std::vector<Reducer::Refusal>> Reducer::add_locked(const WorkUnit& unit, Partial partial) {
    if (frozen_) return Status(StatusCode::kCancelled, "the image is being finished");
    if (noise_ && noise_->reached) return std::vector<Refusal>();
    if (!sums_) sums_ = std::make_unique<GroupedSum>(frame_, response_);
    std::vector<Refusal> refused;
    if (unit.key.group < group_count()) {
        refused.push_back({unit.key, internal_error("the unit was merged twice")});
        return refused;
    }
    if (partial.tile != unit.render.tile || partial.samples_per_pixel != unit.render.samples_per_pixel() ||
        partial.light_paths != unit.render.light_path_count) {
        refused.push_back({unit.key, data_loss("the partial is of another unit")});
        return refused;
    }
    if (unit.key.group > group_count()) {
        if (const auto checked = check_partial(partial, frame_); !checked.ok()) {
            refused.push_back({unit.key, checked.status()});
        } else {
            waiting_[unit.key.group].emplace_back(unit, std::move(partial));
        }
        return refused;
    }
    LL_RETURN_IF_ERROR(add_to_current(unit, partial, refused));
    // Complete later groups may have waited only for the group that has just been folded.
    for (auto next = waiting_.find(group_count()); next != waiting_.end(); next = waiting_.find(group_count())) {
        const auto partials = std::move(next->second);
        waiting_.erase(next);
        for (const auto& [waiting_unit, waiting_partial] : partials)
            LL_RETURN_IF_ERROR(add_to_current(waiting_unit, waiting_partial, refused));
    }
    return refused;
}

Status Reducer::add_to_current(const WorkUnit& unit, const Partial& partial, std::vector<Refusal>& refused) {
    if (const Status added = sums_->add(partial); !added.ok()) {
        refused.push_back({unit.key, added});
        return {};
    }
    if (unit.key == UnitKey{}) rare_light_ = partial.rare_light;
    for (const DroppedSample& sample : partial.dropped)
        if (dropped_.size() < kMaxDropped) dropped_.push_back({unit.key, sample});
    if (sums_->current_units() < tile_count_) return {};
    LL_RETURN_IF_ERROR(sums_->fold(unit.render.iteration_count).status());
    if (group_count() < next_noise_groups_) return {};
    next_noise_groups_ = NoiseEstimate::next_groups(group_count());
    noise_ = estimate_noise();
    if (noise_->reached) waiting_.clear();
    return {};
}

std::optional<NoiseReport> Reducer::estimate_noise() const {
    const auto estimate = sums_ ? sums_->complete().noise() : std::nullopt;
    if (!estimate) return std::nullopt;
    NoiseReport report{*estimate};
    if (!(noise_target_ > 0) || !estimate->reaches(noise_target_)) return report;
    // The groups agree also as long as none of them has found anything, or nothing of what only chance finds.
    const double mean = mean_luminance(sums_->complete().develop());
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
    waiting_.clear();
}

uint32_t Reducer::folded_groups() const {
    const std::lock_guard lock(mutex_);
    return group_count();
}

uint64_t Reducer::iterations() const {
    const std::lock_guard lock(mutex_);
    return sums_ ? sums_->complete().iterations() : 0;
}

UnitCounters Reducer::counters() const {
    const std::lock_guard lock(mutex_);
    return sums_ ? sums_->counters() : UnitCounters();
}

uint64_t Reducer::dropped() const {
    const std::lock_guard lock(mutex_);
    return sums_ ? sums_->complete().dropped() : 0;
}

std::vector<Reducer::Dropped> Reducer::first_dropped() const {
    const std::lock_guard lock(mutex_);
    std::vector<Dropped> out = dropped_;
    std::erase_if(out, [&](const Dropped& d) { return d.unit.group >= group_count(); });
    return out;
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
            const Accumulation& complete = sums_->complete();
            complete.develop(first, count, &image.color.pixels[3 * first]);
            if (!image.variance.pixels.empty()) complete.variance(first, count, &image.variance.pixels[3 * first]);
            image.iterations = complete.iterations();
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

RareLightReport Reducer::rare_light_report(double image_mean) const {
    const std::lock_guard lock(mutex_);
    return rare_light_of(image_mean);
}

RareLightReport Reducer::rare_light_of(double image_mean) const {
    if (!sums_) return {};
    const FilmResponse::Triple grey = response_.of(Rgb(1.0f));
    const double exposure = double(Rgb(float(grey[0]), float(grey[1]), float(grey[2])).luminance());
    return RareLightReport::of(rare_light_, double(sums_->counters().camera_samples), image_mean, exposure);
}

}  // namespace lightloom
