#include "common/import/context.h"

#include <cmath>

namespace lightloom::import {

bool within_bounds(const Vec3& position) {
    const float farthest = std::fmax(std::fabs(position.x), std::fmax(std::fabs(position.y), std::fabs(position.z)));
    return is_finite(position) && farthest <= kMaxCoordinate;
}

std::string Context::read_file(const Location& where, const std::string& reference, std::string* normalised) {
    const Result<std::string> name = normalise_reference(reference);
    if (!name.ok()) fail(where, name.status().message());
    Result<std::string> bytes = files->read(*name);
    if (!bytes.ok()) fail(where, bytes.status().message());
    if (normalised) *normalised = *name;
    return std::move(bytes).value();
}

int32_t Context::load_image(const Location& where, const std::string& reference, const ImageRequest& request) {
    const Result<std::string> name = normalise_reference(reference);
    if (!name.ok()) fail(where, name.status().message());
    const std::string key = *name + "|" + (request.srgb ? "sRGB" : std::to_string(request.gamma)) +
                            (request.channels == ImageChannels::kScalar ? "|scalar" : "|colour");
    const auto [it, inserted] = image_index.try_emplace(key, kNone);
    if (inserted) {
        std::string warning;
        Result<Image> image = read_image(*name, read_file(where, *name), request, &warning);
        if (!image.ok()) fail(where, quoted(reference) + ": " + image.status().message());
        if (!warning.empty()) diagnostics.warn(where, quoted(reference) + ": " + warning);
        it->second = int32_t(scene.images.size());
        scene.images.push_back(std::move(image).value());
    }
    return it->second;
}

const Rgb& Context::image_mean(int32_t image) {
    const auto [it, inserted] = image_means.try_emplace(image);
    if (inserted) it->second = scene.images[size_t(image)].mean();
    return it->second;
}

const std::string* Context::intern_file_name(const std::string& name) {
    for (const auto& known : file_names)
        if (*known == name) return known.get();
    file_names.push_back(std::make_unique<std::string>(name));
    return file_names.back().get();
}

}  // namespace lightloom::import
