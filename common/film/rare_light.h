#pragma once
// RareLight: the error of a job that its own samples cannot show. Light that an algorithm finds only where a camera
// sub-path happens to hit a small lamp lies in very few samples. As long as none of them has been drawn, the image
// looks finished but is too dark.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/core/vec.h"

namespace lightloom {

/// An estimate that is made separately from the image (common/transport/rare_light.h): radiance before the film's
/// response, as means over the frame.
struct RareLight {
    Rgb by_chance;             ///< Mean of the light that is found only by hitting an emitter.
    Rgb unreachable;           ///< Mean of the light that is never found: such paths from lights that cannot be hit.
    double second_moment = 0;  ///< Of the luminance of `by_chance` in one camera sample.
    uint32_t merges = 0;       ///< Number of pairs of sub-paths in the estimate.

    /// With fewer pairs the estimate itself is noise.
    static constexpr uint32_t kLeastMerges = 16;
    bool known() const { return merges >= kLeastMerges; }
    bool is_valid() const {
        const auto fine = [](double v) { return v >= 0 && v < HUGE_VAL; };
        const auto all = [&](const Rgb& c) { return fine(c.r) && fine(c.g) && fine(c.b); };
        return all(by_chance) && all(unreachable) && fine(second_moment);
    }
    friend bool operator==(const RareLight&, const RareLight&) = default;
};

/// The consequences of RareLight for an image.
struct RareLightReport {
    double share = 0;              ///< Share of the image's light that only chance finds; [0, 1].
    double unreachable_share = 0;  ///< Share of the image's light that cannot be found; [0, 1].
    double expected_hits = 0;      ///< Effective number of samples that are expected to have found it.
    double mean_error = 0;         ///< Relative standard error of the image's mean that results.

    /// `image_mean` is that of the image's luminance; `exposure` is the pixel value of a unit of luminance.
    static RareLightReport of(const RareLight& light, double camera_samples, double image_mean, double exposure) {
        RareLightReport report;
        if (!light.known() || !(camera_samples > 0)) return report;
        const double chance = double(light.by_chance.luminance()) * exposure;
        const double lost = double(light.unreachable.luminance()) * exposure;
        const double moment = light.second_moment * exposure * exposure;
        if (moment > 0) report.expected_hits = camera_samples * chance * chance / moment;
        // Until the light has been found, it is not in the image's mean either.
        const double whole = image_mean + chance * std::exp(-report.expected_hits) + lost;
        if (!(whole > 0)) return report;
        report.share = std::min(1.0, chance / whole);
        report.unreachable_share = lost / whole;
        report.mean_error = std::sqrt(moment / camera_samples) / whole;
        return report;
    }
    friend bool operator==(const RareLightReport&, const RareLightReport&) = default;
    /// Above these the user is told.
    static constexpr double kNotableError = 0.05, kNotableShare = 0.02;
};

}  // namespace lightloom
