#include "client/pyramid.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "client/output_files.h"
#include "client/thumbnail.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"

namespace lightloom::client {
namespace {

namespace fs = std::filesystem;

constexpr size_t kSums = 6;
constexpr int kThumbnailWidth = 480;
constexpr const char *kPage = "index.html", *kDescription = "pyramid.json", *kImage = "image";

bool finite(const Rgb& c) { return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b); }

double luminance(const FilmResponse::Triple& rgb) { return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; }
double luminance(const RgbImage& image, size_t pixel) {
    return luminance({double(image.pixels[3 * pixel]), double(image.pixels[3 * pixel + 1]), double(image.pixels[3 * pixel + 2])});
}

/// Whether write_pyramid() may have made the file.
bool is_ours(const std::string& name) {
    if (name == kPage || name == kDescription) return true;
    const bool picture = name.starts_with("weighted-") || name.starts_with("unweighted-") || name == std::string(kImage) + ".exr" ||
                         name == std::string(kImage) + ".png";
    return picture && (name.ends_with(".exr") || name.ends_with(".png"));
}

}  // namespace

std::string PyramidKey::name() const {
    std::string word(to_string(kind));
    std::replace(word.begin(), word.end(), ' ', '-');
    if (k == kLonger) return "longer-" + word;
    std::string name(1, 'k');
    name += std::to_string(k) + "-s" + std::to_string(s);
    return name + '-' + word;
}

void UnitPictures::add(const SeenContribution& seen) {
    ++contributions_;
    const Rgb unweighted = seen.found.value, weighted = unweighted * float(seen.weight);
    if (!finite(unweighted) || !finite(weighted)) {
        ++not_finite_;
        return;
    }
    const PyramidKey key = PyramidKey::of(seen, depth_);
    if (seen.found.technique.splats()) {
        splats_[key].push_back({seen.pixel, weighted, unweighted});
        return;
    }
    std::vector<double>& sums = camera_[key];
    if (sums.empty()) sums.resize(kSums * size_t(tile_.area()));
    const int x = crop_.x0 + int(seen.pixel % uint32_t(crop_.width())), y = crop_.y0 + int(seen.pixel / uint32_t(crop_.width()));
    double* sum = &sums[kSums * size_t(tile_.index(x, y))];
    for (int c = 0; c < 3; ++c) sum[c] += double(weighted[c]), sum[3 + c] += double(unweighted[c]);
}

Pyramid::Pyramid(const FrameLayout& frame, int depth, const FilmResponse& response, uint64_t max_bytes)
    : frame_(frame),
      depth_(depth),
      response_(response),
      max_bytes_(max_bytes) {}

void Pyramid::begin_group(uint32_t iterations, uint64_t light_paths) {
    group_iterations_ = iterations;
    group_light_paths_ = light_paths;
}

Status Pyramid::find(const PyramidKey& key, Picture** picture) {
    const size_t pixels = size_t(frame_.crop.area());
    const auto [entry, added] = pictures_.try_emplace(key);
    *picture = &entry->second;
    if (!added) return {};
    const uint64_t bytes = pictures_.size() * pixels * (kSums + 2) * sizeof(double);
    if (bytes > max_bytes_)
        return {StatusCode::kResourceExhausted, "the pictures of " + std::to_string(pictures_.size()) +
                                                    " techniques need more than " + std::to_string(max_bytes_ >> 20) +
                                                    " MiB; choose a smaller --resolution or --pyramid-depth"};
    entry->second = {std::vector<double>(kSums * pixels), std::vector<double>(pixels), std::vector<double>(pixels)};
    return {};
}

Status Pyramid::add(const UnitPictures& unit) {
    contributions_ += unit.contributions_;
    not_finite_ += unit.not_finite_;
    Picture* picture = nullptr;
    for (const auto& [key, sums] : unit.camera_) {
        LL_RETURN_IF_ERROR(find(key, &picture));
        for (int y = unit.tile_.y0; y < unit.tile_.y1; ++y) {
            for (int x = unit.tile_.x0; x < unit.tile_.x1; ++x) {
                const double* from = &sums[kSums * size_t(unit.tile_.index(x, y))];
                const size_t pixel = size_t(frame_.crop.index(x, y));
                for (size_t c = 0; c < kSums; ++c) picture->sums[kSums * pixel + c] += from[c];
                picture->group[pixel] += luminance(response_.balanced({from[0], from[1], from[2]})) / group_iterations_;
            }
        }
    }
    // The image divides splats by the number of light paths and camera samples by that of iterations.
    const double per_path = 1 / double(std::max<uint64_t>(1, group_light_paths_));
    for (const auto& [key, splats] : unit.splats_) {
        LL_RETURN_IF_ERROR(find(key, &picture));
        for (const auto& splat : splats) {
            double* to = &picture->sums[kSums * splat.pixel];
            for (int c = 0; c < 3; ++c) {
                to[c] += double(splat.weighted[c]) * per_path * group_iterations_;
                to[3 + c] += double(splat.unweighted[c]) * per_path * group_iterations_;
            }
            picture->group[splat.pixel] += luminance(response_.balanced(FilmResponse::triple(splat.weighted))) * per_path;
        }
    }
    return {};
}

void Pyramid::end_group() {
    for (auto& [key, picture] : pictures_) {
        for (size_t i = 0; i < picture.group.size(); ++i) {
            picture.squares[i] += group_iterations_ * picture.group[i] * picture.group[i];
            picture.group[i] = 0;
        }
    }
    iterations_ += group_iterations_;
    ++groups_;
}

std::vector<PyramidKey> Pyramid::keys() const {
    std::vector<PyramidKey> keys;
    for (const auto& [key, picture] : pictures_) keys.push_back(key);
    return keys;
}

RgbImage Pyramid::develop(const PyramidKey& key, size_t first) const {
    const Picture& picture = pictures_.at(key);
    RgbImage image{frame_.crop.width(), frame_.crop.height(), {}};
    image.pixels.resize(picture.sums.size() / kSums * 3);
    for (size_t pixel = 0; 3 * pixel < image.pixels.size(); ++pixel) {
        const double* sums = &picture.sums[pixel * kSums + first];
        const FilmResponse::Triple value = response_({sums[0], sums[1], sums[2]});
        for (size_t c = 0; c < 3; ++c) image.pixels[3 * pixel + c] = float(value[c] / double(iterations_));
    }
    return image;
}

double Pyramid::noise(const PyramidKey& key, const RgbImage& image) const {
    if (groups_ < 2) return std::numeric_limits<double>::quiet_NaN();
    const Picture& picture = pictures_.at(key);
    const double n = double(iterations_), square = response_.exposure * response_.exposure;
    double sum = 0;
    for (size_t i = 0; i < picture.squares.size(); ++i) {
        const double* sums = &picture.sums[kSums * i];
        const double mean = luminance(response_.balanced({sums[0], sums[1], sums[2]})) / n, whole = luminance(image, i);
        const double variance = std::max(0.0, picture.squares[i] - n * mean * mean) / ((groups_ - 1) * n);
        sum += square * variance / (whole * whole + 0.01);
    }
    return sum / double(picture.squares.size());
}

Status open_pyramid_directory(const std::string& directory) {
    std::error_code error;
    const fs::path path(directory);
    if (fs::exists(path, error) && !fs::is_directory(path, error))
        return invalid_argument(directory + ": is a file; --pyramid takes a directory");
    fs::create_directories(path, error);
    if (error) return invalid_argument(directory + ": cannot be made: " + error.message());
    if (!fs::is_empty(path, error) || error) {
        const auto description = read_file((path / kDescription).string());
        if (error || !description.ok() || !description->starts_with(kPyramidMark))
            return invalid_argument(directory + ": is not empty and holds no pyramid; give another directory");
    }
    const std::vector<std::string> outputs{(path / kPage).string()};
    const Status written = check_output_files({}, outputs);
    return written.ok() ? written : invalid_argument(written.message());
}

Status write_pyramid(const std::string& directory, const Pyramid& pyramid, const FrameLayout& frame, const RgbImage& image,
                     PyramidPage page) {
    page.depth = pyramid.depth();
    page.not_finite = pyramid.not_finite();
    page.mean = mean_luminance(image);
    page.stops = stops_for(page.mean);
    std::vector<PyramidKey> keys = pyramid.keys();  // in the order of rows and columns
    double noise = 0;
    for (const PyramidKey& key : keys) {
        const int k = key.k == PyramidKey::kLonger ? 0 : key.k;
        if (page.rows.empty() || page.rows.back().k != k) page.rows.push_back({.k = k});
        PyramidPicture picture{.kind = key.kind, .s = key.s, .name = key.name()};
        picture.weighted = mean_luminance(pyramid.weighted(key));
        picture.unweighted = mean_luminance(pyramid.unweighted(key));
        picture.noise_share = pyramid.noise(key, image);
        noise += picture.noise_share;
        page.rows.back().mean += picture.weighted;
        page.rows.back().pictures.push_back(std::move(picture));
    }
    const auto share = [](double part, double whole) { return whole > 0 ? part / whole : 0; };
    for (PyramidRow& row : page.rows) {
        row.light_share = share(row.mean, page.mean);
        double brightest = 0;
        for (const PyramidPicture& picture : row.pictures) brightest = std::max(brightest, picture.weighted);
        row.weighted_stops = stops_for(brightest);
        row.unweighted_stops = stops_for(row.mean);
        for (PyramidPicture& picture : row.pictures) {
            picture.light_share = share(picture.weighted, page.mean);
            picture.row_share = share(picture.unweighted, row.mean);
            if (!std::isnan(noise)) picture.noise_share = share(picture.noise_share, noise);
        }
    }

    // What is left of an earlier pyramid has other pictures. The description comes first: whatever happens afterwards, the
    // directory is known for one.
    const fs::path path(directory);
    LL_RETURN_IF_ERROR(write_file_atomically((path / kDescription).string(), pyramid_json(page)));
    std::error_code ignored;
    std::vector<fs::path> old;
    for (const auto& entry : fs::directory_iterator(path, ignored)) {
        const std::string name = entry.path().filename().string();
        if (name != kDescription && entry.is_regular_file(ignored) && is_ours(name)) old.push_back(entry.path());
    }
    for (const fs::path& file : old) fs::remove(file, ignored);
    const auto write = [&](const std::string& name, const RgbImage& picture, int stops) -> Status {
        LL_RETURN_IF_ERROR(
            write_exr((path / (name + ".exr")).string(), {.frame = frame, .color = picture, .layers = {}, .attributes = {}}));
        return write_png((path / (name + ".png")).string(), thumbnail(picture, kThumbnailWidth), stops);
    };
    LL_RETURN_IF_ERROR(write(kImage, image, page.stops));
    auto key = keys.begin();
    for (const PyramidRow& row : page.rows) {
        for (const PyramidPicture& picture : row.pictures) {
            LL_RETURN_IF_ERROR(write("weighted-" + picture.name, pyramid.weighted(*key), row.weighted_stops));
            LL_RETURN_IF_ERROR(write("unweighted-" + picture.name, pyramid.unweighted(*key), row.unweighted_stops));
            ++key;
        }
    }
    return write_file_atomically((path / kPage).string(), pyramid_html(page));
}

}  // namespace lightloom::client
