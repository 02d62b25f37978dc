#include "common/metrics/metrics.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "common/core/vec.h"
#include "common/metrics/flip.h"

namespace lightloom {

namespace {

constexpr double kEpsilon = 0.01;
constexpr double kMapeClamp = 10;

Status check_images(const RgbImage& image, const RgbImage& reference) {
    const auto size_of = [](const RgbImage& i) { return std::to_string(i.width) + " x " + std::to_string(i.height); };
    if (image.width != reference.width || image.height != reference.height) {
        return invalid_argument("metrics: the image is " + size_of(image) + " pixels, the reference " + size_of(reference));
    }
    const size_t values = size_t(image.width) * size_t(image.height) * 3;
    if (values == 0 || image.pixels.size() != values || reference.pixels.size() != values) {
        return invalid_argument("metrics: an image is empty or its size does not fit its pixels");
    }
    for (const RgbImage* which : {&image, &reference}) {
        for (size_t i = 0; i < values; ++i) {
            if (std::isfinite(which->pixels[i])) continue;
            const size_t p = i / 3;
            return invalid_argument(std::string("metrics: the ") + (which == &image ? "image" : "reference") +
                                    " is NaN or infinite at pixel (" + std::to_string(p % size_t(image.width)) + ", " +
                                    std::to_string(p / size_t(image.width)) + ")");
        }
    }
    return Status::ok_status();
}

double ratio_of(double image, double reference) { return image == reference ? 1 : image / reference; }

/// Mean of the terms that remain after the largest `count * percent / 100` were dropped.
double trimmed_mean(std::vector<double>& terms, double percent) {
    const size_t dropped = std::min(terms.size() - 1, size_t(double(terms.size()) * percent / 100));
    if (dropped > 0) {
        std::nth_element(terms.begin(), terms.begin() + ptrdiff_t(dropped - 1), terms.end(), std::greater<>());
    }
    double sum = 0;
    for (size_t i = dropped; i < terms.size(); ++i) sum += terms[i];
    return sum / double(terms.size() - dropped);
}

double mean_of(const std::vector<float>& map) {
    double sum = 0;
    for (float v : map) sum += v;
    return sum / double(map.size());
}

float luminance_at(const RgbImage& image, size_t pixel) {
    const float* p = image.pixels.data() + pixel * 3;
    return Rgb(p[0], p[1], p[2]).luminance();
}

}  // namespace

Result<Metrics> compute_pixel_metrics(const RgbImage& image, const RgbImage& reference, double trim_percent) {
    LL_RETURN_IF_ERROR(check_images(image, reference));
    if (!(trim_percent >= 0 && trim_percent < 100)) {
        return invalid_argument("metrics: the share of trimmed terms must lie in [0, 100) percent");
    }
    Metrics m;
    m.trim_percent = trim_percent;
    const size_t values = image.pixels.size();
    std::vector<double> terms(values);
    double mape = 0, mape_unclamped = 0, square = 0, symmetric = 0, relative = 0;
    for (size_t p = 0; p < values / 3; ++p) {
        double e = 0;
        for (size_t c = 0; c < 3; ++c) {
            const double x = image.pixels[p * 3 + c], r = reference.pixels[p * 3 + c], d = x - r;
            e += std::fabs(d) / (std::fabs(r) + kEpsilon);
            terms[p * 3 + c] = d * d / (r * r + kEpsilon);
            relative += terms[p * 3 + c];
            square += d * d;
            const double symmetric_relative = d == 0 ? 0 : d / ((std::fabs(x) + std::fabs(r)) / 2);
            symmetric += symmetric_relative * symmetric_relative;
            m.mean_image[c] += x;
            m.mean_reference[c] += r;
        }
        mape_unclamped += e / 3;
        mape += std::min(e / 3, kMapeClamp);
    }
    const double count = double(values), pixels = count / 3;
    m.mape = 100 * mape / pixels;
    m.mape_unclamped = 100 * mape_unclamped / pixels;
    m.relmse = relative / count;
    m.relmse_trimmed = trimmed_mean(terms, trim_percent);
    m.rmse = std::sqrt(square / count);
    m.srrmse = std::sqrt(symmetric / count);
    m.mean_ratio = ratio_of(m.mean_image[0] + m.mean_image[1] + m.mean_image[2],
                            m.mean_reference[0] + m.mean_reference[1] + m.mean_reference[2]);
    for (size_t c = 0; c < 3; ++c) m.mean_image[c] /= pixels, m.mean_reference[c] /= pixels;
    return m;
}

Result<Metrics> compute_metrics(const RgbImage& image, const RgbImage& reference, double trim_percent) {
    Result<Metrics> metrics = compute_pixel_metrics(image, reference, trim_percent);
    if (!metrics.ok()) return metrics;
    Metrics& m = *metrics;
    m.ssim = ssim(image, reference);
    m.flip = mean_of(ldr_flip(image, reference));
    m.hdr_flip = mean_of(hdr_flip(image, reference).map);
    return metrics;
}

Result<std::vector<RegionRatio>> region_ratios(const RgbImage& image, const RgbImage& reference, int columns, int rows) {
    LL_RETURN_IF_ERROR(check_images(image, reference));
    if (columns < 1 || rows < 1 || columns > image.width || rows > image.height) {
        return invalid_argument("metrics: a grid of " + std::to_string(columns) + " x " + std::to_string(rows) +
                                " regions does not fit an image of " + std::to_string(image.width) + " x " +
                                std::to_string(image.height) + " pixels");
    }
    std::vector<RegionRatio> regions;
    const auto edge = [](int i, int n, int size) { return int(int64_t(i) * size / n); };
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            RegionRatio region;
            region.rect = {edge(i, columns, image.width), edge(j, rows, image.height), edge(i + 1, columns, image.width),
                           edge(j + 1, rows, image.height)};
            for (int y = region.rect.y0; y < region.rect.y1; ++y) {
                const size_t begin = (size_t(y) * size_t(image.width) + size_t(region.rect.x0)) * 3;
                for (size_t k = begin; k < begin + size_t(region.rect.width()) * 3; ++k) {
                    region.mean_image += image.pixels[k];
                    region.mean_reference += reference.pixels[k];
                }
            }
            region.ratio = ratio_of(region.mean_image, region.mean_reference);
            region.mean_image /= double(region.rect.area()) * 3;
            region.mean_reference /= double(region.rect.area()) * 3;
            regions.push_back(region);
        }
    }
    return regions;
}

Status check_comparable(const ExrImage& image, const ExrImage& reference) {
    if (image.frame == reference.frame) return Status::ok_status();
    const auto describe = [](const FrameLayout& f) {
        return std::to_string(f.width) + " x " + std::to_string(f.height) + " pixels with window [" + std::to_string(f.crop.x0) +
               "," + std::to_string(f.crop.x1) + ") x [" + std::to_string(f.crop.y0) + "," + std::to_string(f.crop.y1) + ")";
    };
    return invalid_argument("the images do not match: " + describe(image.frame) + ", but the reference has " +
                            describe(reference.frame));
}

std::vector<uint8_t> signed_error_picture(const RgbImage& image, const RgbImage& reference, double range) {
    std::vector<uint8_t> picture(image.pixels.size());
    for (size_t p = 0; p < picture.size() / 3; ++p) {
        const double x = luminance_at(image, p), r = luminance_at(reference, p);
        const double e = (x - r) / (std::fabs(r) + kEpsilon) / range;
        const uint8_t fade = uint8_t(255 * (1 - std::min(1.0, std::fabs(e))) + 0.5);
        picture[p * 3] = e < 0 ? fade : 255;
        picture[p * 3 + 1] = fade;
        picture[p * 3 + 2] = e > 0 ? fade : 255;
    }
    return picture;
}

}  // namespace lightloom
