#include "common/import/foreign.h"

#include <algorithm>
#include <array>
#include <utility>

#include "common/import/file_source.h"

namespace lightloom::import {
namespace {

using std::string_view;
using namespace std::string_view_literals;

constexpr const char* kByAssimp = "; convert it to pbrt-v4 first, for example with `assimp export FILE scene.pbrt`";
constexpr const char* kByBlender = "; open it in Blender and export it with a pbrt-v4 exporter";
constexpr const char* kAsTexture = "; give a .pbrt file, in which a texture or an infinite light names the image";

struct Magic {
    string_view bytes;
    const char* what;
    const char* advice;
};

constexpr Magic kMagics[] = {
    {"glTF"sv, "a glTF scene (binary, GLB)", kByAssimp},
    {"PXR-USDC"sv, "a USD scene (binary, USDC)", kByBlender},
    {"#usda"sv, "a USD scene (text, USDA)", kByBlender},
    {"BLENDER"sv, "a Blender file", kByBlender},
    {"Kaydara FBX Binary"sv, "an FBX scene", kByAssimp},
    {"Ogawa"sv, "an Alembic scene", kByBlender},
    {"\x89HDF"sv, "an HDF5 file", ""},
    {"ply\n"sv, "a PLY mesh", "; give a .pbrt file with a Shape \"plymesh\" that names it"},
    {"ply\r"sv, "a PLY mesh", "; give a .pbrt file with a Shape \"plymesh\" that names it"},
    {"\x89PNG"sv, "a PNG image", kAsTexture},
    {"\xff\xd8\xff"sv, "a JPEG image", kAsTexture},
    {"\x76\x2f\x31\x01"sv, "an OpenEXR image", kAsTexture},
    {"#?RADIANCE"sv, "an HDR image", kAsTexture},
    {"#?RGBE"sv, "an HDR image", kAsTexture},
    {"PF\n"sv, "a PFM image", kAsTexture},
    {"Pf\n"sv, "a PFM image", kAsTexture},
    {"II*\0"sv, "a TIFF image", kAsTexture},
    {"MM\0*"sv, "a TIFF image", kAsTexture},
    {"GIF8"sv, "a GIF image", kAsTexture},
    {"%PDF"sv, "a PDF document", ""},
    {"\x7f"
     "ELF"sv,
     "a program", ""},
    {"##RenderMan"sv, "a RenderMan RIB scene", "; convert it to pbrt-v4 first"},
    {"\xff\xfe"sv, "text in UTF-16", "; save it as UTF-8"},
    {"\xfe\xff"sv, "text in UTF-16", "; save it as UTF-8"},
};

std::string message(const char* what, const char* advice) {
    return "this is " + std::string(what) + ", not a pbrt-v4 scene" + advice;
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/// The rest of `text` from its first word outside of comments ('#' to the end of the line).
string_view first_word_on(string_view text) {
    size_t i = 0;
    while (i < text.size() && (is_space(text[i]) || text[i] == '#')) {
        if (text[i] == '#')
            while (i < text.size() && text[i] != '\n' && text[i] != '\r') ++i;
        else
            ++i;
    }
    return text.substr(i);
}

string_view first_word(string_view text) {
    size_t i = 0;
    while (i < text.size() && !is_space(text[i])) ++i;
    return text.substr(0, i);
}

std::optional<std::string> zip_archive(string_view name) {
    if (lower_extension(name) == "usdz") return message("a USD scene (archive, USDZ)", kByBlender);
    return message("a ZIP archive", "; unpack it and give the .pbrt file");
}

/// The XML format of text that begins with '<'.
std::string xml(string_view text) {
    const string_view head = text.substr(0, 4096);
    const auto has = [&](string_view part) { return head.find(part) != string_view::npos; };
    if (has("<scene")) return message("a Mitsuba scene (XML)", "; convert it to pbrt-v4 first, with a converter or by hand");
    if (has("<COLLADA")) return message("a COLLADA scene", kByAssimp);
    if (has("<html") || has("<HTML") || has("<!DOCTYPE html") || has("<!doctype html"))
        return message("an HTML page", "; download the file itself");
    return message("an XML file", "; convert it to pbrt-v4 first");
}

}  // namespace

bool is_lfs_pointer(string_view bytes) { return bytes.starts_with("version https://git-lfs.github.com/spec/"); }

std::optional<std::string> foreign_scene(string_view name, string_view bytes) {
    for (const Magic& magic : kMagics)
        if (bytes.starts_with(magic.bytes)) return message(magic.what, magic.advice);
    if (bytes.starts_with("PK\x03\x04")) return zip_archive(name);
    if (bytes.starts_with("\x28\xb5\x2f\xfd"))
        return lower_extension(name) == "blend" ? message("a Blender file (compressed)", kByBlender)
                                                : message("compressed by Zstandard", "; decompress it");
    const string_view text = first_word_on(bytes);
    if (text.starts_with('<')) return xml(text);
    if (text.starts_with('{'))
        return text.substr(0, size_t(1) << 20).find("\"asset\"") != string_view::npos ? message("a glTF scene (JSON)", kByAssimp)
                                                                                      : message("a JSON file", "");
    const string_view word = first_word(text);
    constexpr std::array kObjWords{"v"sv, "vn"sv, "vt"sv, "f"sv, "g"sv, "o"sv, "s"sv, "mtllib"sv, "usemtl"sv};
    if (std::find(kObjWords.begin(), kObjWords.end(), word) != kObjWords.end()) return message("a Wavefront OBJ mesh", kByAssimp);
    if (word == "newmtl") return message("a Wavefront material library", "");
    if (word == "solid" && lower_extension(name) == "stl") return message("an STL mesh", kByAssimp);
    if (bytes.find('\0') != string_view::npos) return message("a binary file of an unknown kind", "; give a .pbrt file");
    return std::nullopt;
}

bool is_old_directive(string_view word, string_view kind) {
    constexpr std::array kWords{"SurfaceIntegrator"sv, "VolumeIntegrator"sv, "Renderer"sv, "Volume"sv, "WorldEnd"sv};
    if (std::find(kWords.begin(), kWords.end(), word) != kWords.end()) return true;
    constexpr std::pair<string_view, string_view> kKinds[] = {
        {"Material", "matte"},
        {"Material", "plastic"},
        {"Material", "uber"},
        {"Material", "substrate"},
        {"Material", "metal"},
        {"Material", "mirror"},
        {"Material", "glass"},
        {"Material", "translucent"},
        {"Material", "disney"},
        {"Material", "fourier"},
        {"Material", "kdsubsurface"},
        {"Material", "shinymetal"},
        {"Film", "image"},
        {"Sampler", "02sequence"},
        {"Sampler", "lowdiscrepancy"},
        {"Sampler", "maxmindist"},
        {"Sampler", "random"},
        {"Sampler", "bestcandidate"},
        {"Sampler", "adaptive"},
        {"Integrator", "directlighting"},
        {"Integrator", "whitted"},
        {"Camera", "environment"},
        {"Shape", "cone"},
        {"Shape", "heightfield"},
        {"Shape", "hyperboloid"},
        {"Shape", "nurbs"},
        {"Shape", "paraboloid"},
        {"Texture", "color"},
        {"AreaLightSource", "area"},
        {"Accelerator", "grid"},
    };
    return std::find(std::begin(kKinds), std::end(kKinds), std::pair(word, kind)) != std::end(kKinds);
}

bool has_old_parameter(string_view word, const ParameterList& parameters) {
    constexpr std::pair<string_view, string_view> kNames[] = {
        {"LightSource", "mapname"},
        {"LightSource", "nsamples"},
        {"AreaLightSource", "nsamples"},
        {"Integrator", "rrthreshold"},
        {"Camera", "halffov"},
        {"Material", "bumpmap"},
        {"Material", "Kd"},
        {"Material", "Ks"},
        {"Material", "Kr"},
        {"Material", "Kt"},
        {"Material", "index"},
    };
    return std::any_of(std::begin(kNames), std::end(kNames),
                       [&](const auto& old) { return old.first == word && parameters.peek(old.second); });
}

}  // namespace lightloom::import
