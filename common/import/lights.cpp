// Light sources. In pbrt-v4 a light's strength is its colour times `scale`; `power` (or `illuminance`) then replaces
// the magnitude: it is the luminous flux (illuminance) that the light has for a colour of luminance 1, so an rgb colour
// still multiplies it.

#include <cmath>

#include "common/core/math.h"
#include "common/import/context.h"
#include "common/import/exr_image.h"
#include "common/import/file_source.h"
#include "common/import/tessellate.h"
#include "common/scene/sampling.h"

namespace lightloom::import {
namespace {

/// The colour parameter of a light; white of luminance 1 if absent.
Rgb light_colour(Context* context, const ParameterList& p, std::string_view name) {
    Rgb colour(1.0f);
    bool clipped = false;
    const Parameter* given = nullptr;
    if ((given = p.find("rgb", name))) {
        if (given->numbers.size() != 3) fail(given->where, p.what() + ": " + quoted(given->name) + " needs three numbers");
        colour = {float(given->numbers[0]), float(given->numbers[1]), float(given->numbers[2])};
    } else if ((given = p.find("blackbody", name))) {
        colour = blackbody_rgb(kelvin_of(*given, p.what()), &clipped);
    } else if ((given = p.find("spectrum", name))) {
        std::optional<Rgb> reduced;
        if (given->strings.size() == 1) reduced = named_illuminant_rgb(given->strings[0], &clipped);
        if (!reduced) reduced = illuminant_rgb(*spectrum_parameter(context, p, name), &clipped);
        if (!reduced)
            fail(given->where, p.what() + ": the spectrum " + quoted(given->name) + " has no luminance between 380 and 780 nm");
        colour = *reduced;
    }
    if (given && (colour.r < 0 || colour.g < 0 || colour.b < 0))
        fail(given->where, p.what() + ": " + quoted(given->name) + " is negative");
    if (clipped)
        context->diagnostics.warn(given->where,
                                  p.what() + ": the colour of " + quoted(given->name) +
                                      " lies outside the RGB gamut; its negative component became 0 at equal luminance");
    return colour;
}

float light_scale(const ParameterList& p) {
    const float scale = p.one_float("scale", 1);
    if (!(scale >= 0)) fail(p.where(), p.what() + ": the scale is negative");
    return scale;
}

/// The value of "power" or "illuminance" if it is used (pbrt: if it is positive); 0 otherwise.
double magnitude(const ParameterList& p, std::string_view name) { return double(std::fmax(p.one_float(name, -1), 0.0f)); }

Rgb checked(const ParameterList& p, const Rgb& colour, double factor) {
    const Rgb out = colour * float(factor);
    if (!is_finite(out)) fail(p.where(), p.what() + ": the light's strength is not a finite number");
    return out;
}

Vec3 unit_vector(const ParameterList& p, const Mat4& m, const Vec3& from, const Vec3& to) {
    const double d[3] = {double(to.x) - from.x, double(to.y) - from.y, double(to.z) - from.z};
    double w[3], len = 0;
    for (int i = 0; i < 3; ++i) {
        w[i] = m.m[i][0] * d[0] + m.m[i][1] * d[1] + m.m[i][2] * d[2];
        len += w[i] * w[i];
    }
    len = std::sqrt(len);
    if (!(len > 0) || !std::isfinite(len)) fail(p.where(), p.what() + ": from and to are the same point");
    return {float(w[0] / len), float(w[1] / len), float(w[2] / len)};
}

Vec3 light_position(const ParameterList& p, const Mat4& m, const Vec3& from) {
    const Vec3 position = m.point(from);
    if (!is_finite(position)) fail(p.where(), p.what() + ": its position is not finite");
    if (!within_bounds(position))
        fail(p.where(), p.what() + ": its position lies beyond 1e15; scale the scene down or use a distant light");
    return position;
}

void point_light(Context* context, const ParameterList& p, const Mat4& m) {
    double scale = light_scale(p);
    if (const double power = magnitude(p, "power"); power > 0) scale *= power / (4 * kPiD);
    const Vec3 from = p.one_point3("from").value_or(Vec3{0, 0, 0});
    context->scene.point_lights.push_back(
        {light_position(p, m, from), checked(p, light_colour(context, p, "I"), scale), p.where().text()});
}

void spot_light(Context* context, const ParameterList& p, const Mat4& m) {
    const float cone = p.one_float("coneangle", 30), delta = p.one_float("conedeltaangle", 5);
    // Below this, single precision cannot tell directions of the axis and of the rim apart.
    constexpr float kNarrowest = 0.01f;
    if (!(cone >= kNarrowest) || !(cone <= 180) || !(delta >= 0) || !(delta <= cone))
        fail(p.where(), p.what() + ": coneangle must lie in [0.01, 180] degrees and conedeltaangle between 0 and it");
    if (!similarity_scale(m))
        fail(p.where(), p.what() +
                            ": its transformation is not a similarity, so the cone would not be round; remove the "
                            "uneven scale or shear");
    const auto height = [](double degrees) {  // 1 - cosine
        const double s = math::sin(degrees * kPiD / 360);
        return 2 * s * s;
    };
    const double total_height = height(cone), falloff_height = height(double(cone) - delta);
    double scale = light_scale(p);
    // The flux of unit intensity on the axis: the smoothstep's mean over its band is one half.
    if (const double power = magnitude(p, "power"); power > 0) scale *= power / (kPiD * (falloff_height + total_height));
    const Vec3 from = p.one_point3("from").value_or(Vec3{0, 0, 0}), to = p.one_point3("to").value_or(Vec3{0, 0, 1});
    SpotLight light;
    light.position = light_position(p, m, from);
    light.axes = Frame(unit_vector(p, m, from, to));
    light.intensity = checked(p, light_colour(context, p, "I"), scale);
    light.total_height = float(total_height);
    light.falloff_height = float(falloff_height);
    light.source = p.where().text();
    context->scene.spot_lights.push_back(light);
}

/// The common part of the lights whose intensity an image gives.
ImageLight image_light(Context* context, const ParameterList& p, const Mat4& m) {
    if (!similarity_scale(m)) fail(p.where(), p.what() + ": its transformation must be a rotation, reflection or uniform scale");
    const std::string reference = p.one_string("filename", "");
    if (reference.empty()) fail(p.where(), p.what() + " has no \"string filename\"");
    ImageLight light;
    light.position = light_position(p, m, {0, 0, 0});
    light.light_to_world = m;
    light.image = context->load_image(p.where(), reference, ImageRequest{});
    light.source = p.where().text();
    return light;
}

/// The factor that gives a light of this flux its "power", if it has one.
double power_factor(const ParameterList& p, double flux) {
    const double power = magnitude(p, "power");
    if (!(power > 0)) return 1;
    if (!(flux > 0)) fail(p.where(), p.what() + ": the image is black, so power cannot scale it");
    return power / flux;
}

void projection_light(Context* context, const ParameterList& p, const Mat4& m) {
    ImageLight light = image_light(context, p, m);
    const Image& image = context->scene.images[size_t(light.image)];
    const float fov = p.one_float("fov", 90);
    if (!(fov >= 0.01f) || !(fov <= 179)) fail(p.where(), p.what() + ": fov must lie between 0.01 and 179 degrees");
    // fov is the angle of the shorter side.
    const double half = math::tan(double(fov) * (kPiD / 360)), shorter = std::min(image.width, image.height);
    const double half_width = half * image.width / shorter, half_height = half * image.height / shorter;
    light.half_width = float(half_width), light.half_height = float(half_height);
    const std::vector<double> solid_angles = projected_solid_angles(image.width, image.height, half_width, half_height);
    double flux = 0;
    for (size_t i = 0; i < solid_angles.size(); ++i) {
        const size_t width = size_t(image.width);
        flux += double(image.texel(int(i % width), int(i / width)).luminance()) * solid_angles[i];
    }
    light.intensity = checked(p, Rgb(1.0f), light_scale(p) * power_factor(p, flux));
    if (flux > 0) context->scene.image_lights.push_back(light);
}

void goniometric_light(Context* context, const ParameterList& p, const Mat4& m) {
    ImageLight light = image_light(context, p, m);
    light.kind = ImageLight::Kind::kGoniometric;
    const Image& image = context->scene.images[size_t(light.image)];
    if (image.width != image.height)
        fail(p.where(), quoted(image.name) + ": a goniometric light needs a square equal-area octahedral image, not " +
                            std::to_string(image.width) + " x " + std::to_string(image.height) +
                            "; convert it with \"imgtool makeequiarea\"");
    const double flux = 4 * kPiD * double(context->image_mean(light.image).average());
    light.intensity = checked(p, light_colour(context, p, "I"), light_scale(p) * power_factor(p, flux));
    if (flux > 0) context->scene.image_lights.push_back(light);
}

void distant_light(Context* context, const ParameterList& p, const Mat4& m) {
    double scale = light_scale(p);
    if (const double illuminance = magnitude(p, "illuminance"); illuminance > 0) scale *= illuminance;
    const Vec3 from = p.one_point3("from").value_or(Vec3{0, 0, 0}), to = p.one_point3("to").value_or(Vec3{0, 0, 1});
    context->scene.distant_lights.push_back(
        {unit_vector(p, m, from, to), checked(p, light_colour(context, p, "L"), scale), p.where().text()});
}

/// The illuminance that "illuminance" normalises: on the light's own xy plane, lit by the upper half of the map.
/// pbrt-v4 counts every pixel with 2 pi / n, half of its true solid angle, and weighs the first three channels of an
/// EXR file as red, green and blue, although by name they are B, G, R or A, B, G. We do the same, because otherwise a
/// scene would be half as bright here or have another exposure.
template <typename Luminance>
double illuminance_of(int width, int height, Luminance luminance) {
    double sum = 0;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const Vec3 w = equal_area_square_to_sphere({(float(x) + 0.5f) / float(width), (float(y) + 0.5f) / float(height)});
            if (w.z > 0) sum += double(luminance(x, y)) * w.z;
        }
    return sum * 2 * kPiD / (double(width) * height);
}

double illuminance_of(Context* context, const Location& where, const std::string& reference, const Image& image) {
    if (lower_extension(image.name) != "exr" || image.channels != 3)
        return illuminance_of(image.width, image.height, [&](int x, int y) { return image.texel(x, y).luminance(); });
    const Result<ExrPixels> raw = read_exr(context->read_file(where, reference), ExrChannels::kFirstThree);
    if (!raw.ok()) fail(where, quoted(reference) + ": " + raw.status().message());
    const Rgb weights = luminance_weights(raw->primaries);
    return illuminance_of(raw->width, raw->height, [&](int x, int y) {
        const float* p = &raw->values[3 * (size_t(y) * size_t(raw->width) + size_t(x))];
        return weights.r * p[0] + weights.g * p[1] + weights.b * p[2];
    });
}

void infinite_light(Context* context, const ParameterList& p, const Mat4& m) {
    p.refuse("portal", "portals restrict the light to an opening; remove the parameter, the light is the same without");
    InfiniteLight light;
    light.light_to_world = m;
    light.source = p.where().text();
    if (!similarity_scale(m)) fail(p.where(), p.what() + ": its transformation must be a rotation, reflection or uniform scale");
    double scale = light_scale(p);
    const double illuminance = magnitude(p, "illuminance");
    const std::string reference = p.one_string("filename", "");
    if (reference.empty()) {
        if (illuminance > 0) scale *= illuminance / kPiD;
        light.radiance = checked(p, light_colour(context, p, "L"), scale);
    } else {
        if (p.find_any("L")) fail(p.where(), p.what() + ": give either L or filename, not both");
        light.image = context->load_image(p.where(), reference, ImageRequest{});
        const Image& image = context->scene.images[size_t(light.image)];
        if (image.width != image.height)
            fail(p.where(), quoted(reference) + ": an environment map must be a square equal-area octahedral image, not " +
                                std::to_string(image.width) + " x " + std::to_string(image.height) +
                                "; convert it with \"imgtool makeequiarea\"");
        if (illuminance > 0) {
            const double own = illuminance_of(context, p.where(), reference, image);
            if (!(own > 0))
                fail(p.where(), quoted(reference) + ": the map is black above its horizon, so illuminance cannot scale it");
            scale *= illuminance / own;
        }
        light.radiance = checked(p, Rgb(1.0f), scale);
    }
    context->scene.infinite_lights.push_back(light);
}

}  // namespace

void add_light(Context* context, const std::string& kind, const ParameterList& p, const Mat4& light_to_world) {
    if (kind == "point")
        point_light(context, p, light_to_world);
    else if (kind == "spot")
        spot_light(context, p, light_to_world);
    else if (kind == "projection")
        projection_light(context, p, light_to_world);
    else if (kind == "goniometric")
        goniometric_light(context, p, light_to_world);
    else if (kind == "distant")
        distant_light(context, p, light_to_world);
    else if (kind == "infinite")
        infinite_light(context, p, light_to_world);
    else
        fail(p.where(), p.what() + " is not supported; use point, spot, projection, goniometric, distant or infinite");
}

bool area_light_uses_power(const AreaLightDefinition& definition) { return magnitude(definition.parameters, "power") > 0; }

AreaEmission area_emission(Context* context, const AreaLightDefinition& definition, double area) {
    const ParameterList& p = definition.parameters;
    AreaEmission emission;
    Rgb colour(1.0f);
    double luminance = 1;
    if (const std::string reference = p.one_string("filename", ""); !reference.empty()) {
        if (p.find_any("L")) fail(p.where(), p.what() + ": give either L or filename, not both");
        emission.image = context->load_image(p.where(), reference, ImageRequest{});
        luminance = double(context->image_mean(emission.image).luminance());
    } else {
        colour = light_colour(context, p, "L");
    }
    emission.two_sided = p.one_bool("twosided", false);
    double scale = light_scale(p);
    if (const double power = magnitude(p, "power"); power > 0) {
        if (!(area > 0)) fail(p.where(), p.what() + ": power needs a shape with an area");
        if (!(luminance > 0)) fail(p.where(), p.what() + ": the image is black, so power cannot scale it");
        scale *= power / ((emission.two_sided ? 2 : 1) * kPiD * area * luminance);
    }
    if (luminance == 0) scale = 0;  // A black image gives no light.
    emission.radiance = checked(p, colour, scale);
    p.finish();
    return emission;
}

}  // namespace lightloom::import
