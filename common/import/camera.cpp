// Camera, film, and the directives for pbrt's sampling: Sampler, PixelFilter, Integrator.

#include <algorithm>
#include <array>
#include <cmath>

#include "common/core/math.h"
#include "common/film/frame.h"
#include "common/import/context.h"

namespace lightloom::import {
namespace {

/// Refuses a camera whose rays or their densities are beyond single precision.
void check_camera(const ParameterList& p, const CameraDescription& camera) {
    const auto& m = camera.camera_to_world.m;
    if (!within_bounds({float(m[0][3]), float(m[1][3]), float(m[2][3])}))
        fail(p.where(), p.what() + ": its position lies beyond 1e15; scale the scene down");
    constexpr double kLongest = 1.001 * double(kMaxCoordinate), kShortest = 1 / kLongest;  // with room for rounding
    const auto usable = [](double length) { return length >= kShortest && length <= kLongest; };
    double scale = 0;
    for (int j = 0; j < 3; ++j) {
        scale = std::sqrt(m[0][j] * m[0][j] + m[1][j] * m[1][j] + m[2][j] * m[2][j]);
        if (!usable(scale))
            fail(p.where(), p.what() + ": its transformation scales by less than 1e-15 or more than 1e15; remove the scale");
    }
    if (!keeps_angles(camera.camera_to_world))
        fail(p.where(), p.what() + ": its transformation shears or scales axes differently; use fov or screenwindow instead");
    if (camera.kind == CameraKind::kEqualArea || camera.kind == CameraKind::kEquirectangular) return;
    // Steeper rays than this come from no pixel of a usable picture, and the renderer would treat them as sideways
    // ones.
    constexpr double kSteepest = 1e6;
    if (camera.lens_radius > 0) {
        const double radius = camera.lens_radius * scale, focus = camera.focal_distance * scale;
        if (!usable(radius) || !usable(focus) || radius > kSteepest * focus)
            fail(p.where(), p.what() +
                                ": lensradius and focaldistance must lie between 1e-15 and 1e15, and lensradius must not "
                                "exceed a million times focaldistance; set lensradius to 0 for a pinhole");
    }
    // The image on a plane at distance 1; the film is square unless the following says otherwise.
    double x[2] = {-1, 1}, y[2] = {-1, 1};
    const double aspect = camera.frame_aspect_ratio;
    if (camera.has_screen_window)
        for (int i = 0; i < 2; ++i) x[i] = camera.screen_window[i], y[i] = camera.screen_window[2 + i];
    else if (aspect > 1)
        x[0] = -aspect, x[1] = aspect;
    else if (aspect > 0)
        y[0] = -1 / aspect, y[1] = 1 / aspect;
    if (camera.kind == CameraKind::kOrthographic) {
        constexpr double kLeast = 1e-9;  // a pixel of this size still has an area in single precision
        for (const double* side : {x, y})
            if (!(std::fmax(std::fabs(side[0]), std::fabs(side[1])) * scale <= kLongest) ||
                !((side[1] - side[0]) * scale >= kLeast))
                fail(p.where(), p.what() +
                                    ": screenwindow, frameaspectratio and the transformation give a picture that is wider "
                                    "than 1e15 or narrower than 1e-9; correct them");
        return;
    }
    const double half = math::tan(double(camera.fov_degrees) * (kPiD / 360));
    constexpr double kNarrowest = 1e-9;
    for (const double* side : {x, y})
        if (!(std::fmax(std::fabs(side[0]), std::fabs(side[1])) * half <= kSteepest) || !((side[1] - side[0]) * half >= kNarrowest))
            fail(p.where(), p.what() +
                                ": fov, screenwindow and frameaspectratio give a picture that is wider than a million "
                                "times or narrower than 1e-9 times its distance; correct them");
}

/// Reads "pixelbounds" or "cropwindow"; false if there is neither. pbrt-v4 swaps inverted ranges and cuts off what lies
/// outside; here both are errors.
bool read_crop(const ParameterList& p, FilmDescription* film) {
    const Parameter *bounds = p.find("integer", "pixelbounds"), *window = p.find("float", "cropwindow");
    if (!bounds && !window) return false;
    if (bounds && window) fail(bounds->where, p.what() + ": give either pixelbounds or cropwindow, not both");
    const Parameter& crop = bounds ? *bounds : *window;
    const auto refuse = [&](const std::string& why) { fail(crop.where, p.what() + ": " + crop.name + " " + why); };
    if (crop.numbers.size() != 4) refuse("needs four numbers: x0 x1 y0 y1");
    for (size_t i = 0; i < 4; ++i) {
        const int size = i < 2 ? film->width : film->height;
        const std::string side = i < 2 ? "wide" : "high";
        const double given = crop.numbers[i];
        if (window && !(given >= 0 && given <= 1)) refuse("must lie in [0, 1], as parts of the width and height");
        if (bounds && !(given >= 0 && given <= size))
            refuse("lie outside of the image, which is " + std::to_string(size) + " pixels " + side);
        // pbrt rounds both ends of a crop window up.
        film->crop[i] = int(bounds ? given : std::ceil(double(float(size) * float(given))));
    }
    for (size_t i = 0; i < 4; i += 2) {
        const std::string axis = i == 0 ? "x" : "y";
        if (crop.numbers[i] > crop.numbers[i + 1]) refuse("has " + axis + "0 above " + axis + "1; its order is x0 x1 y0 y1");
        if (film->crop[i] == film->crop[i + 1]) refuse("is empty: no pixel lies between " + axis + "0 and " + axis + "1");
    }
    return true;
}

/// Reads the screen window of cameras that have one in a plane.
void read_window(const ParameterList& p, CameraDescription* camera) {
    camera->frame_aspect_ratio = p.one_float("frameaspectratio", 0);
    if (p.find("float", "frameaspectratio") && !(camera->frame_aspect_ratio > 0))
        fail(p.where(), p.what() + ": frameaspectratio must be positive");
    if (const std::vector<double>* window = p.numbers("float", "screenwindow", 4)) {
        if (window->size() != 4) fail(p.where(), p.what() + ": screenwindow needs four numbers");
        camera->has_screen_window = true;
        for (size_t i = 0; i < 4; ++i) camera->screen_window[i] = float((*window)[i]);
        if (!(camera->screen_window[0] < camera->screen_window[1]) || !(camera->screen_window[2] < camera->screen_window[3]))
            fail(p.where(), p.what() + ": screenwindow must be x0 < x1, y0 < y1");
    }
}

void read_perspective(const ParameterList& p, CameraDescription* camera) {
    camera->fov_degrees = p.one_float("fov", 90);
    if (!(camera->fov_degrees > 0) || !(camera->fov_degrees < 180))
        fail(p.where(), p.what() + ": fov must lie between 0 and 180 degrees");
    camera->lens_radius = p.one_float("lensradius", 0);
    camera->focal_distance = p.one_float("focaldistance", 1e6f);
    if (!(camera->lens_radius >= 0) || !(camera->focal_distance > 0))
        fail(p.where(), p.what() + ": lensradius must not be negative and focaldistance must be positive");
    read_window(p, camera);
}

void read_orthographic(const ParameterList& p, CameraDescription* camera) {
    camera->kind = CameraKind::kOrthographic;
    if (p.one_float("lensradius", 0) != 0)
        fail(p.where(), p.what() + ": a lens is not supported here; remove lensradius, or use a far \"perspective\" camera");
    p.accept("float", "focaldistance");  // It has no effect without a lens.
    read_window(p, camera);
}

void read_spherical(Context* context, const ParameterList& p, CameraDescription* camera) {
    const std::string mapping = p.one_choice("mapping", "equalarea", {"equalarea", "equirectangular"});
    camera->kind = mapping == "equalarea" ? CameraKind::kEqualArea : CameraKind::kEquirectangular;
    for (const std::string_view name : {"lensradius", "focaldistance", "frameaspectratio", "screenwindow"})
        p.ignore(&context->diagnostics, name, "a camera that sees in all directions does not use it, as in pbrt");
}

}  // namespace

void set_camera(Context* context, const std::string& kind, const ParameterList& p, const Mat4& camera_to_world) {
    CameraDescription camera;
    camera.camera_to_world = camera_to_world;
    if (kind == "perspective")
        read_perspective(p, &camera);
    else if (kind == "orthographic")
        read_orthographic(p, &camera);
    else if (kind == "spherical")
        read_spherical(context, p, &camera);
    else
        fail(p.where(), p.what() + " is not supported; use \"perspective\", \"orthographic\" or \"spherical\"");
    check_camera(p, camera);
    // Nothing moves, so the shutter matters only as the exposure time.
    const float open = p.one_float("shutteropen", 0), close = p.one_float("shutterclose", 1);
    if (!(close > open)) fail(p.where(), p.what() + ": shutterclose must come after shutteropen");
    context->exposure_time = close - open;
    context->scene.camera = camera;
}

void set_film(Context* context, const std::string& kind, const ParameterList& p) {
    if (kind == "gbuffer") {
        p.accept("string", "coordinatesystem");
        context->diagnostics.warn(p.where(), p.what() +
                                                 " becomes \"rgb\": of its further channels, the option --layers writes "
                                                 "albedo, normal and depth of the first hit");
    } else if (kind != "rgb") {
        fail(p.where(), p.what() + " is not supported; use \"rgb\" or \"gbuffer\"");
    }
    FilmDescription film;
    film.width = p.one_int("xresolution", 1280);
    film.height = p.one_int("yresolution", 720);
    if (film.width < 1 || film.height < 1 || film.width > kMaxFrameSide || film.height > kMaxFrameSide)
        fail(p.where(), p.what() + ": the resolution must lie between 1 and " + std::to_string(kMaxFrameSide) + " pixels a side");
    film.file_name = p.one_string("filename", "");
    const bool cropped = read_crop(p, &film);
    const int64_t pixels =
        cropped ? int64_t(film.crop[1] - film.crop[0]) * (film.crop[3] - film.crop[2]) : int64_t(film.width) * film.height;
    if (pixels > kMaxPartialPixels)
        fail(p.where(), p.what() + ": the picture has " + pixels_and_memory(pixels) + "; the limit is " +
                            std::to_string(kMaxPartialPixels) + ", so lower the resolution or give a cropwindow");
    p.ignore(&context->diagnostics, "maxcomponentvalue", "samples are not clamped, because that changes the mean");
    context->iso = p.one_float("iso", 100);
    if (!(context->iso > 0)) fail(p.where(), p.what() + ": iso must be positive");
    if (p.find("float", "exposuretime")) {
        context->film_exposure_time = p.one_float("exposuretime", 1);
        if (!(*context->film_exposure_time > 0)) fail(p.where(), p.what() + ": exposuretime must be positive");
    }
    context->film_colour = sensor_colour(context, p);
    p.ignore(&context->diagnostics, "diagonal", "it matters only for cameras with real lenses");
    p.ignore(&context->diagnostics, "savefp16", "the command line selects the output's precision");
    context->scene.film = film;
}

void set_pixel_filter(Context* context, const std::string& kind, const ParameterList& p) {
    constexpr std::array<std::string_view, 5> kKinds{"box", "gaussian", "mitchell", "sinc", "triangle"};
    if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) fail(p.where(), p.what() + " is unknown; use \"box\"");
    context->has_pixel_filter = true;
    if (kind == "box") {
        const float x = p.one_float("xradius", 0.5f), y = p.one_float("yradius", 0.5f);
        if (x != 0.5f || y != 0.5f)
            context->diagnostics.warn(p.where(),
                                      p.what() + ": a radius other than 0.5 is ignored; the picture is a little sharper");
        return;
    }
    for (const std::string_view name : {"xradius", "yradius"}) p.accept("float", name);
    if (kind == "gaussian") p.accept("float", "sigma");
    if (kind == "sinc") p.accept("float", "tau");
    if (kind == "mitchell")
        for (const std::string_view name : {"B", "C"}) p.accept("float", name);
    context->diagnostics.warn(p.where(), p.what() + " is replaced by a box of radius 0.5; the picture is a little sharper");
}

void set_sampler(Context* context, const std::string& kind, const ParameterList& p) {
    constexpr std::array<std::string_view, 7> kKinds{"halton",     "sobol",       "paddedsobol", "zsobol",
                                                     "stratified", "independent", "pmj02bn"};
    if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) fail(p.where(), p.what() + " is unknown; use \"halton\"");
    int64_t samples = 0;
    if (kind == "stratified") {
        const int x = p.one_int("xsamples", 4), y = p.one_int("ysamples", 4);
        if (x > 0 && y > 0) samples = int64_t(x) * y;
        p.accept("bool", "jitter");
    } else {
        samples = p.one_int("pixelsamples", 16);
    }
    if (samples < 1 || samples > (int64_t(1) << 30))
        fail(p.where(), p.what() + ": the number of samples must be positive and at most 2^30");
    p.ignore(&context->diagnostics, "seed", "the command line's --seed selects the random numbers");
    p.ignore(&context->diagnostics, "randomization", "the renderer has its own random numbers");
    context->scene.samples_per_pixel = int(samples);
}

void set_integrator(Context* context, const std::string& kind, const ParameterList& p) {
    constexpr std::array<std::string_view, 9> kKinds{"path",      "volpath",    "bdpt",          "mlt",       "sppm",
                                                     "lightpath", "simplepath", "simplevolpath", "randomwalk"};
    if (kind == "ambientocclusion" || kind == "function")
        fail(p.where(), p.what() + " is not supported: it does not compute light transport; use \"path\"");
    if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end())
        fail(p.where(), p.what() + " is unknown; correct its name or use \"path\"");
    context->scene.integrator = kind;
    const int depth = p.one_int("maxdepth", 5);
    if (depth < 0) fail(p.where(), p.what() + ": maxdepth must not be negative");
    if (depth > kMaxDepth)
        context->diagnostics.warn(p.where(), p.what() + ": a maxdepth above " + std::to_string(kMaxDepth) + " becomes that");
    context->scene.max_depth = std::min(depth, kMaxDepth);
    if (p.one_bool("regularize", false))
        context->diagnostics.warn(p.where(), p.what() + ": regularize is ignored, it would blur the picture's glossy light");
    const std::string reason = "the parameters of an algorithm come from the command line";
    for (const std::string_view name :
         {"lightsampler", "samplelights", "samplebsdf", "visualizestrategies", "visualizeweights", "bootstrapsamples", "chains",
          "mutationsperpixel", "largestepprobability", "sigma", "photonsperiteration", "radius", "seed"})
        p.ignore(&context->diagnostics, name, reason);
}

}  // namespace lightloom::import
