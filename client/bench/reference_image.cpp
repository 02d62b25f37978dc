#include "client/bench/reference_image.h"

#include <cmath>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>

#include "client/bench/numbers.h"
#include "common/core/atomic_file.h"
#include "common/core/digest.h"
#include "common/metrics/metrics.h"

namespace lightloom::client {
namespace {

std::string percent(double value) { return formatted("%.3g %%", value); }

/// The variance layer where there is one that fits.
const std::vector<float>* variance_of(const ExrImage& reference) {
    const ImageLayer* variance = reference.layer("variance");
    return variance && variance->pixels.size() == reference.color.pixels.size() ? &variance->pixels : nullptr;
}

/// Mean luminances with the variances of their pixels, which are taken for independent.
std::vector<Estimate> region_estimates(const ExrImage& reference) {
    const std::vector<double> means = luminance_means(reference.color, kRegionColumns, kRegionRows);
    std::vector<Estimate> regions;
    for (const double mean : means) regions.push_back({mean, std::numeric_limits<double>::infinity()});
    const std::vector<float>* variance = variance_of(reference);
    if (!variance) return regions;
    // A luminance is a weighted sum of the channels, which a path carries together: their errors are taken to be in step, which
    // makes the variance of the sum no smaller than it is.
    RgbImage deviation = reference.color;
    for (size_t i = 0; i < variance->size(); ++i) deviation.pixels[i] = float(std::sqrt(double((*variance)[i])));
    RgbImage squared = deviation;
    for (size_t i = 0; i + 2 < squared.pixels.size(); i += 3) {
        const Rgb d(deviation.pixels[i], deviation.pixels[i + 1], deviation.pixels[i + 2]);
        const float luminance = d.luminance();
        squared.pixels[i] = squared.pixels[i + 1] = squared.pixels[i + 2] = luminance * luminance;
    }
    const std::vector<double> variances = luminance_means(squared, kRegionColumns, kRegionRows);
    const double pixels = double(reference.color.width) * reference.color.height;
    for (size_t i = 0; i < regions.size(); ++i) {
        const double count = i == 0 ? pixels : pixels / (kRegionColumns * kRegionRows);
        regions[i].variance = variances[i] / count;
    }
    return regions;
}

/// Takes the region means of a description over, whose errors come from independent groups.
Status read_description(const std::string& path, Reference& reference) try {
    const auto text = read_file(path);
    if (text.status().code() == StatusCode::kNotFound) return {};
    if (!text.ok()) return text.status();
    const auto json = nlohmann::ordered_json::parse(*text, nullptr, false);
    if (!json.is_object() || json.value("format", std::string()) != "lightloom-reference 1") return {};  // of something else
    if (json.value("sha256", std::string()) != reference.digest)
        return invalid_argument(path + " describes another image than " + reference.path +
                                "; make both again by `lightloom reference`");
    const auto regions = json.find("regions");
    if (regions == json.end() || !regions->is_array() || regions->size() != reference.regions.size()) return {};
    for (size_t i = 0; i < regions->size(); ++i) {
        const auto& region = (*regions)[i];
        const double error = region.value("standard_error", -1.0);
        if (error >= 0) reference.regions[i] = {region.value("mean", reference.regions[i].mean), error * error};
    }
    return {};
} catch (const nlohmann::json::exception&) {
    return invalid_argument(path + " is damaged; make it and its image again by `lightloom reference`");
}

}  // namespace

Result<Reference> read_reference(const std::string& path) {
    const auto bytes = read_file(path);
    if (!bytes.ok()) return bytes.status();
    auto image = decode_exr(*bytes, path);
    if (!image.ok()) return image.status();
    Reference reference{path, sha256(*bytes).hex(), *std::move(image), {}, {}, {}};
    if (reference.image.color.width < kRegionColumns || reference.image.color.height < kRegionRows)
        return invalid_argument(path + ": a reference has at least 3 x 3 pixels");
    reference.noise_mape = noise_mape(reference.image);
    reference.noise_relmse = noise_relmse(reference.image);
    reference.regions = region_estimates(reference.image);
    std::filesystem::path description = path;
    description.replace_extension(".json");
    LL_RETURN_IF_ERROR(read_description(description.string(), reference));
    return reference;
}

std::optional<double> noise_relmse(const ExrImage& reference) {
    const std::vector<float>* variance = variance_of(reference);
    if (!variance) return std::nullopt;
    double sum = 0;
    for (size_t i = 0; i < variance->size(); ++i) {
        const double r = reference.color.pixels[i];
        sum += double((*variance)[i]) / (r * r + 0.01);
    }
    return sum / double(variance->size());
}

std::filesystem::path find_reference(const std::filesystem::path& scene_file, int width, int height) {
    const std::filesystem::path directory = scene_file.parent_path();
    const std::string stem = scene_file.stem().string();
    std::string sized = stem;
    sized.append("-").append(std::to_string(width)).append("x").append(std::to_string(height)).append(".exr");
    std::error_code ignored;
    for (const std::filesystem::path& path : {directory / "references" / sized, directory / (stem + "-ref.exr")}) {
        if (std::filesystem::exists(path, ignored)) return path;
    }
    return {};
}

std::optional<double> noise_mape(const ExrImage& reference) {
    const std::vector<float>* variance = variance_of(reference);
    if (!variance) return std::nullopt;
    // The mean absolute value of a normal error is sqrt(2 / pi) standard deviations.
    const double factor = std::sqrt(2 / 3.14159265358979323846);
    double sum = 0;
    for (size_t i = 0; i < variance->size(); ++i)
        sum += factor * std::sqrt(double((*variance)[i])) / (std::fabs(reference.color.pixels[i]) + 0.01);
    return 100 * sum / double(variance->size());
}

Result<std::vector<std::string>> check_reference(const std::string& name, const ExrImage& reference, const BenchSubject& subject) {
    if (Status s = check_comparable({.frame = subject.frame}, reference); !s.ok())
        return Status(s.code(), name + ": " + s.message());
    RgbImage black = reference.color;
    black.pixels.assign(black.pixels.size(), 0.0f);
    const auto dark = compute_pixel_metrics(black, reference.color);
    if (!dark.ok()) return invalid_argument(name + ": " + dark.status().message());
    const std::string depth = reference.attribute(exr_attribute::kMaxDepth);
    if (!depth.empty() && depth != std::to_string(subject.max_depth)) {
        return invalid_argument(name + " was rendered with --max-depth " + depth + ", the runs have " +
                                std::to_string(subject.max_depth) + "; give the same");
    }
    if (subject.threshold > 0 && dark->mape <= subject.threshold) {
        return invalid_argument("a black image has MAPE " + percent(dark->mape) + " against " + name + ": the threshold of " +
                                percent(subject.threshold) + " shows nothing; give a lower --threshold");
    }
    std::vector<std::string> warnings;
    const std::string digest = reference.attribute(exr_attribute::kScene), maker = reference.attribute(exr_attribute::kAlgorithm);
    if (!digest.empty() && digest != subject.scene_digest) {
        if (subject.found) {
            return invalid_argument(name +
                                    " was made from another version of the scene's files; make it again, or name it to use "
                                    "it all the same");
        }
        warnings.push_back(name + " was made from another version of the scene's files");
    }
    for (const AlgorithmChoice& algorithm : subject.algorithms) {
        if (algorithm.settings.info().name != maker) continue;
        warnings.push_back(name + " was made by \"" + maker + "\", which is also tested: a bias that it has does not show");
        break;
    }
    const std::optional<double> noise = noise_mape(reference);
    if (!noise) {
        warnings.push_back(name + " has no variance layer, so its own noise is unknown");
    } else if (subject.threshold > 0 && *noise > subject.threshold / 4) {
        warnings.push_back(name + " is noisy: it alone adds MAPE of about " + percent(*noise) + " to a perfect image (threshold " +
                           percent(subject.threshold) + ")");
    }
    return warnings;
}

}  // namespace lightloom::client
