#include "client/bench/reference_image.h"

#include <cmath>
#include <cstdio>

#include "common/metrics/metrics.h"

namespace lightloom::client {
namespace {

std::string percent(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g %%", value);
    return text;
}

}  // namespace

std::optional<double> noise_mape(const ExrImage& reference) {
    const ImageLayer* variance = reference.layer("variance");
    if (!variance || variance->pixels.size() != reference.color.pixels.size()) return std::nullopt;
    // The mean absolute value of a normal error is sqrt(2 / pi) standard deviations.
    const double factor = std::sqrt(2 / 3.14159265358979323846);
    double sum = 0;
    for (size_t i = 0; i < variance->pixels.size(); ++i)
        sum += factor * std::sqrt(double(variance->pixels[i])) / (std::fabs(reference.color.pixels[i]) + 0.01);
    return 100 * sum / double(variance->pixels.size());
}

Result<std::vector<std::string>> check_reference(const std::string& name, const ExrImage& reference, const BenchSubject& subject) {
    LL_RETURN_IF_ERROR(check_comparable({.frame = subject.frame}, reference));
    RgbImage black = reference.color;
    black.pixels.assign(black.pixels.size(), 0.0f);
    const auto dark = compute_pixel_metrics(black, reference.color);
    if (!dark.ok()) return invalid_argument(name + ": " + dark.status().message());
    const std::string depth = reference.attribute(exr_attribute::kMaxDepth);
    if (!depth.empty() && depth != std::to_string(subject.max_depth)) {
        return invalid_argument(name + " was rendered with --max-depth " + depth + ", the runs have " +
                                std::to_string(subject.max_depth) + "; give the same");
    }
    if (dark->mape <= subject.threshold) {
        return invalid_argument("a black image has MAPE " + percent(dark->mape) + " against " + name + ": the threshold of " +
                                percent(subject.threshold) + " shows nothing; give a lower --threshold");
    }
    std::vector<std::string> warnings;
    const std::string digest = reference.attribute(exr_attribute::kScene), maker = reference.attribute(exr_attribute::kAlgorithm);
    if (!digest.empty() && digest != subject.scene_digest)
        warnings.push_back(name + " was made from another version of the scene's files");
    for (const AlgorithmChoice& algorithm : subject.algorithms) {
        if (algorithm.settings.info().name != maker) continue;
        warnings.push_back(name + " was made by \"" + maker + "\", which is also tested: a bias that it has does not show");
        break;
    }
    const std::optional<double> noise = noise_mape(reference);
    if (!noise) {
        warnings.push_back(name + " has no variance layer, so its own noise is unknown");
    } else if (*noise > subject.threshold / 4) {
        warnings.push_back(name + " is noisy: it alone adds MAPE of about " + percent(*noise) + " to a perfect image (threshold " +
                           percent(subject.threshold) + ")");
    }
    return warnings;
}

}  // namespace lightloom::client
