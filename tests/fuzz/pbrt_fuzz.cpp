// The pbrt importer on arbitrary text. Other files that the text may name exist in memory, so that the readers behind
// Include, plymesh, imagemap and spectrum files run too; "self.pbrt" is the input itself. The text is read three times: as it is,
// for all of its faults, and without what can be left out.

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/import/features.h"
#include "common/import/importer.h"

namespace {

const char kPly[] =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
// An uncompressed TGA of 1 x 1 pixel.
const char kTga[] = "\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\30\0\1\2\3";
const char kPfm[] = "Pf 1 1 -1\n\0\0\0\77";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::string text(reinterpret_cast<const char*>(data), size);
    const std::map<std::string, std::string> contents{{"scene.pbrt", text},
                                                      {"self.pbrt", text},
                                                      {"self.png", text},
                                                      {"self.hdr", text},
                                                      {"self.exr", text},
                                                      {"self.gz", text},
                                                      {"a.ply", kPly},
                                                      {"a.tga", std::string(kTga, sizeof kTga - 1)},
                                                      {"a.pfm", std::string(kPfm, sizeof kPfm - 1)},
                                                      {"a.spd", "400 1\n700 0.5\n"},
                                                      {"../b.pbrt", "ReverseOrientation\n"}};
    const auto source = [&] { return lightloom::import::MemorySource(contents, {"room", "scenes"}); };
    const auto is_line = [](const std::string& line) { return !line.empty() && line.find('\n') == std::string::npos; };
    lightloom::ImportOptions options;
    options.max_file_bytes = 16 << 20;
    options.max_subdivided_triangles = 1 << 14;
    auto files = source();
    const auto scene = lightloom::import::import_from(&files, "scene.pbrt", options);
    // An error is one line that names the file.
    if (!scene.ok() && !is_line(scene.status().message())) __builtin_trap();
    auto again = source();
    const auto faults = lightloom::import::faults_from(&again, "scene.pbrt", options);
    if (scene.ok() != faults.empty()) __builtin_trap();
    for (const std::string& fault : faults)
        if (!is_line(fault)) __builtin_trap();
    for (const lightloom::SceneFeature& feature : lightloom::scene_features()) options.without.emplace_back(feature.name);
    auto rest = source();
    (void)lightloom::import::import_from(&rest, "scene.pbrt", options);
    return 0;
}
