#pragma once
// RareLight: what a job's own samples cannot say about its error. Light that an algorithm finds only where a camera sub-path
// happens to hit a small lamp lies in so few samples that, as long as none of them was drawn, the image looks finished and is too
// dark.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/core/vec.h"

namespace lightloom {

/// Estimated apart from the image (common/transport/rare_light.h); radiance before the film's response, means over the frame.
struct RareLight {
    Rgb by_chance;             ///< Mean of the light that only hitting an emitter finds.
    Rgb unreachable;           ///< Mean of the light that nothing finds: the same paths from lights that cannot be hit.
    double second_moment = 0;  ///< Of the luminance that one camera sample brings of `by_chance`.
    uint32_t merges = 0;       ///< Pairs of sub-paths that the estimate consists of.

    /// Below that many the estimate itself is noise.
    static constexpr uint32_t kLeastMerges = 16;
    bool known() const { return merges >= kLeastMerges; }
    bool is_valid() const {
        const auto fine = [](double v) { return v >= 0 && v < HUGE_VAL; };
        const auto all = [&](const Rgb& c) { return fine(c.r) && fine(c.g) && fine(c.b); };
        return all(by_chance) && all(unreachable) && fine(second_moment);
    }
    friend bool operator==(const RareLight&, const RareLight&) = default;
};

/// What RareLight means for an image.
struct RareLightReport {
    double share = 0;              ///< Of the image's light, that only chance finds; [0, 1].
    double unreachable_share = 0;  ///< Of the image's light, that cannot be found; [0, 1].
    double expected_hits = 0;      ///< How many samples may be expected to have found it (effective number).
    double mean_error = 0;         ///< Relative standard error of the image's mean that follows.

    /// `image_mean`: of the image's luminance; `exposure`: what the film makes of a unit of luminance.
    static RareLightReport of(const RareLight& light, double camera_samples, double image_mean, double exposure) {
        RareLightReport report;
        if (!light.known() || !(camera_samples > 0)) return report;
        const double chance = double(light.by_chance.luminance()) * exposure;
        const double lost = double(light.unreachable.luminance()) * exposure;
        const double moment = light.second_moment * exposure * exposure;
        if (moment > 0) report.expected_hits = camera_samples * chance * chance / moment;
        // As long as it has not been found it is not in the image's mean either.
        const double whole = image_mean + chance * std::exp(-report.expected_hits) + lost;
        if (!(whole > 0)) return report;
        report.share = std::min(1.0, chance / whole);
        report.unreachable_share = lost / whole;
        report.mean_error = std::sqrt(moment / camera_samples) / whole;
        return report;
    }
    friend bool operator==(const RareLightReport&, const RareLightReport&) = default;
    /// What is worth a word to the user.
    static constexpr double kNotableError = 0.05, kNotableShare = 0.02;
};

}  // namespace lightloom
