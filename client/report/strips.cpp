#include "client/report/strips.h"

#include <algorithm>
#include <cmath>

#include "client/html.h"
#include "client/thumbnail.h"
#include "common/film/exr_io.h"
#include "common/film/png.h"
#include "common/metrics/metrics.h"

namespace lightloom::client::report {
namespace {

constexpr int kWidth = 400;  ///< Pixels; wider images are shrunk, so that a page of many scenes stays small.

Result<RgbImage> read(const std::string& path) {
    Result<ExrImage> image = read_exr(path);
    if (!image.ok()) return image.status();
    for (const float value : image->color.pixels)
        if (!std::isfinite(value)) return invalid_argument(path + ": a pixel is not finite");
    return std::move(image->color);
}

/// The run of the smallest seed that has an image.
const Run* shown_run(const Series& series) {
    const auto found = std::find_if(series.runs.begin(), series.runs.end(), [](const Run* run) { return !run->image.empty(); });
    return found == series.runs.end() ? nullptr : *found;
}

Result<std::string> source(const RgbImage& image, int stops) {
    const Result<std::string> png = encode_png(thumbnail(image, kWidth), stops);
    if (!png.ok()) return png.status();
    return data_url("image/png", *png);
}

Result<std::string> error_source(const RgbImage& image, const RgbImage& reference) {
    const RgbImage a = thumbnail(image, kWidth), b = thumbnail(reference, kWidth);
    const Result<std::string> png = encode_png8(a.width, a.height, signed_error_picture(a, b));
    if (!png.ok()) return png.status();
    return data_url("image/png", *png);
}

/// Adds the picture of a run.
Status add(const Series& series, const Run& run, const SceneInfo& scene, const RgbImage* reference, Strip* strip) {
    const Result<RgbImage> image = read(run.image);
    if (!image.ok()) return image.status();
    if (reference && (image->width != reference->width || image->height != reference->height)) {
        return invalid_argument(run.image + ": it is not of the reference's size");
    }
    if (!reference && strip->pictures.empty()) strip->stops = stops_for(mean_luminance(*image));
    strip->shrunk = std::max(strip->shrunk, (image->width + kWidth - 1) / kWidth);
    Picture picture{&series, "", "", run.seed, shown_error(run.end(), scene), run.end().seconds + run.end().preparation};
    Result<std::string> shown = source(*image, strip->stops);
    if (!shown.ok()) return shown.status();
    picture.image = *std::move(shown);
    if (reference) {
        Result<std::string> error = error_source(*image, *reference);
        if (!error.ok()) return error.status();
        picture.error = *std::move(error);
    }
    strip->pictures.push_back(std::move(picture));
    return Status::ok_status();
}

}  // namespace

Strip make_strip(const Panel& panel) {
    Strip strip;
    RgbImage reference;
    bool known = false;
    int left_out = 0;
    std::string why;
    const auto note = [&](const Status& status) {
        if (++left_out == 1) why = status.message();
    };
    if (!panel.scene->reference_image.empty()) {
        Result<RgbImage> image = read(panel.scene->reference_image);
        if (image.ok()) {
            reference = *std::move(image);
            strip.stops = stops_for(mean_luminance(reference));
            Result<std::string> shown = source(reference, strip.stops);
            known = shown.ok();
            if (known) strip.pictures.push_back({nullptr, *std::move(shown), "", 0, 0, 0});
            if (!known) note(shown.status());
        } else {
            note(image.status());
        }
    }
    for (const Series& series : panel.series) {
        const Run* run = shown_run(series);
        if (!run) continue;
        const Status added = add(series, *run, *panel.scene, known ? &reference : nullptr, &strip);
        if (!added.ok()) note(added);
    }
    if (left_out > 0) {
        const std::string count = left_out == 1 ? "a picture is" : std::to_string(left_out) + " pictures are";
        strip.notes.push_back(panel.title + ": " + count + " left out: " + why + (left_out > 1 ? "; and so on" : ""));
    }
    return strip;
}

}  // namespace lightloom::client::report
