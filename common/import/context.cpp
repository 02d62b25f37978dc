#include "common/import/context.h"

#include <algorithm>
#include <cmath>

#include "common/import/features.h"
#include "common/import/foreign.h"

namespace lightloom::import {

bool within_bounds(const Vec3& position) {
    const float farthest = std::fmax(std::fabs(position.x), std::fmax(std::fabs(position.y), std::fabs(position.z)));
    return is_finite(position) && farthest <= kMaxCoordinate;
}

std::string Context::read_file(const Location& where, const std::string& reference, std::string* normalised) {
    const Result<std::string> name = files->resolve(reference);
    if (!name.ok()) fail(where, name.status().message());
    Result<std::string> bytes = files->read(*name);
    if (!bytes.ok()) fail(where, bytes.status().message());
    if (is_lfs_pointer(*bytes))
        fail(where, quoted(*name) + " is a pointer that Git LFS left in place of the file; fetch the file with `git lfs pull`");
    if (normalised) *normalised = *name;
    return std::move(bytes).value();
}

int32_t Context::load_image(const Location& where, const std::string& reference, const ImageRequest& request) {
    const Result<std::string> name = files->resolve(reference);
    if (!name.ok()) fail(where, name.status().message());
    const std::string key = *name + "|" + (request.srgb ? "sRGB" : std::to_string(request.gamma)) +
                            (request.channels == ImageChannels::kScalar ? "|scalar" : "|colour");
    if (const auto known = image_index.find(key); known != image_index.end()) return known->second;
    std::string warning;
    Result<Image> image = read_image(*name, read_file(where, *name), request, &warning);
    if (!image.ok()) fail(where, quoted(reference) + ": " + image.status().message());
    if (!warning.empty()) diagnostics.warn(where, quoted(reference) + ": " + warning);
    image_index.emplace(key, int32_t(scene.images.size()));
    scene.images.push_back(std::move(image).value());
    return image_index[key];
}

bool Context::leaves_out(const Location& where, std::string_view feature) {
    if (std::find(options.without.begin(), options.without.end(), feature) == options.without.end()) return false;
    LeftOutFeature& entry = left_out[std::string(feature)];
    if (++entry.count == 1) entry = {std::string(feature), 1, where.text()};
    return true;
}

const Rgb& Context::image_mean(int32_t image) {
    const auto [it, inserted] = image_means.try_emplace(image);
    if (inserted) it->second = scene.images[size_t(image)].mean();
    return it->second;
}

void Context::unsupported(const Location& where, const std::string& feature, const std::string& what) {
    if (!leaves_out(where, feature)) diagnostics.fault({where, what + " is not supported" + how_to_leave_out(feature), feature});
}

const std::string* Context::intern_file_name(const std::string& name) { return &*file_names.insert(name).first; }

}  // namespace lightloom::import
