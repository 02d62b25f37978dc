#include "common/import/import.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <new>

#include "common/import/features.h"
#include "common/import/foreign.h"
#include "common/import/importer.h"
#include "common/import/parser.h"

namespace lightloom {
namespace import {
namespace {

/// Calls visit(colour, image) for the strength of every light; the image, or kNone, multiplies the colour.
template <typename Visit>
void for_each_strength(SceneDescription* scene, Visit&& visit) {
    for (AreaEmission& e : scene->emissions) visit(e.radiance, e.image);
    for (PointLight& l : scene->point_lights) visit(l.intensity, kNone);
    for (SpotLight& l : scene->spot_lights) visit(l.intensity, kNone);
    for (ImageLight& l : scene->image_lights) visit(l.intensity, l.image);
    for (DistantLight& l : scene->distant_lights) visit(l.irradiance, kNone);
    for (InfiniteLight& l : scene->infinite_lights) visit(l.radiance, l.image);
}

/// Sums of samples are kept in steps of 2^-44, and throughputs in single precision: if the light as a whole is very
/// weak or strong, it is scaled to about 1, and the film's exposure reverses that. The factor is a power of two, so
/// that nothing is rounded.
void bring_strength_into_range(Context* context) {
    SceneDescription* scene = &context->scene;
    float strongest = 0;
    for_each_strength(scene, [&](const Rgb& colour, int32_t image) {
        const Rgb c = image == kNone ? colour : colour * context->image_mean(image);
        strongest = std::max({strongest, c.r, c.g, c.b});
    });
    constexpr float kWeak = 0x1p-16f, kStrong = 0x1p40f;
    if (!(strongest > 0) || !std::isfinite(strongest) || (strongest >= kWeak && strongest <= kStrong)) return;
    const int exponent = std::ilogb(strongest);
    for_each_strength(scene, [&](Rgb& c, int32_t) {
        c = {std::ldexp(c.r, -exponent), std::ldexp(c.g, -exponent), std::ldexp(c.b, -exponent)};
    });
    scene->strength_scale = std::ldexp(1.0, -exponent);
    scene->film.response.exposure = std::ldexp(scene->film.response.exposure, exponent);
}

/// Fills the context's scene, which is complete unless faults are collected.
void read_scene(Context* context, const std::string& name) {
    const Location main{context->intern_file_name(name), 0};
    if (const Status s = check_scene_features(context->options.without); !s.ok()) throw ImportFailure{main, s.message(), {}};
    Parser(context).parse_main(name);
    context->diagnostics.guard([&] {
        if (!context->has_pixel_filter)
            context->diagnostics.warn(main,
                                      "there is no PixelFilter, so pbrt would use a gaussian; a box of radius 0.5 is used, "
                                      "the picture is a little sharper");
    });
    resolve_shapes(context);
    context->diagnostics.guard([&] {
        const float exposure = context->film_exposure_time.value_or(context->exposure_time) * context->iso / 100;
        if (!(exposure >= 0 && exposure <= kMaxCoordinate))
            fail(main, "iso and the exposure time multiply the picture by more than 1e15; lower them");
        context->scene.film.response = {double(exposure), context->film_colour};
        bring_strength_into_range(context);
    });
}

/// The message for a file in an older syntax, which replaces the errors that follow from it.
std::string old_syntax(const Context& context) {
    return context.old_syntax->where.text() + ": " + context.old_syntax->what + ": " + kUpgrade;
}

std::string out_of_memory(const std::string& name) { return name + ": the scene does not fit into memory"; }

}  // namespace

Result<ImportedScene> import_from(FileSource* files, const std::string& name, const ImportOptions& options) try {
    Context context(files, options);
    try {
        read_scene(&context, name);
    } catch (const ImportFailure& failure) {
        if (context.old_syntax) return invalid_argument(old_syntax(context));
        return failure.status();
    }
    LL_RETURN_IF_ERROR(validate(context.scene));
    context.scene.warnings = context.diagnostics.messages();
    ImportedScene out{std::move(context.scene), {}, files->files(), {}};
    for (auto& [feature, left_out] : context.left_out) out.left_out.push_back(std::move(left_out));
    return out;
} catch (const std::bad_alloc&) {
    return Status(StatusCode::kResourceExhausted, out_of_memory(name));
}

std::vector<std::string> faults_from(FileSource* files, const std::string& name, const ImportOptions& options) try {
    Context context(files, options, true);
    try {
        read_scene(&context, name);
    } catch (const ImportFailure& failure) {
        context.diagnostics.fault(failure);
    }
    std::vector<std::string> faults = context.diagnostics.faults();
    if (context.old_syntax && !faults.empty()) return {old_syntax(context)};
    if (faults.empty())
        if (const Status s = validate(context.scene); !s.ok()) faults.push_back(s.message());
    return faults;
} catch (const std::bad_alloc&) {
    return {out_of_memory(name)};
}

}  // namespace import

namespace {

namespace fs = std::filesystem;

/// A scene file on disk: its directory as given, its name, and the names of the directories from there up to the one
/// below the root.
struct ScenePlace {
    std::string directory, name;
    std::vector<std::string> above;
};

/// How many directories `inner` lies below `outer`; negative if it does not.
int levels_below(const fs::path& inner, const fs::path& outer) {
    const auto [rest, end] = std::mismatch(inner.begin(), inner.end(), outer.begin(), outer.end());
    return end == outer.end() ? int(std::distance(rest, inner.end())) : -1;
}

Result<ScenePlace> place_of(const std::string& path, const ImportOptions& options) {
    constexpr int kLevels = 3;
    ScenePlace place;
    const size_t slash = path.rfind('/');
    place.directory = slash == std::string::npos ? "" : slash == 0 ? "/" : path.substr(0, slash);
    place.name = slash == std::string::npos ? path : path.substr(slash + 1);
    if (place.name.empty()) return invalid_argument("the scene path \"" + path + "\" names a directory; give the .pbrt file");
    std::error_code error;
    fs::path directory = fs::canonical(place.directory.empty() ? "." : place.directory, error);
    if (error) return not_found(path + ": no such file");
    int levels = 0;
    if (!options.root.empty()) {
        const fs::path root = fs::canonical(options.root, error);
        levels = error ? -1 : levels_below(directory, root);
        if (levels < 0) return invalid_argument(path + " does not lie below the root directory \"" + options.root + "\"");
    } else {
        levels = std::max(kLevels, levels_below(directory, fs::current_path(error)));
        levels = std::min(levels, levels_below(directory, "/") - 1);
    }
    for (; levels > 0; --levels, directory = directory.parent_path()) place.above.push_back(directory.filename().string());
    return place;
}

/// The directory `levels` above the given one.
std::string parent_of(const std::string& directory, size_t levels) {
    if (levels == 0) return directory;
    std::error_code error;
    fs::path path = fs::canonical(directory.empty() ? "." : directory, error);
    for (size_t i = 0; i < levels; ++i) path = path.parent_path();
    return path.string();
}

}  // namespace

Result<ImportedScene> import_pbrt(const std::string& path, const ImportOptions& options) {
    const auto place = place_of(path, options);
    if (!place.ok()) return place.status();
    import::DirectorySource files(place->directory, place->above, options.max_file_bytes);
    auto scene = import::import_from(&files, place->name, options);
    if (scene.ok()) scene->directory = parent_of(place->directory, files.levels());
    return scene;
}

std::vector<std::string> import_faults(const std::string& path, const ImportOptions& options) {
    const auto place = place_of(path, options);
    if (!place.ok()) return {place.status().message()};
    import::DirectorySource files(place->directory, place->above, options.max_file_bytes);
    return import::faults_from(&files, place->name, options);
}

}  // namespace lightloom
