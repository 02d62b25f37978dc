// The pbrt importer on arbitrary text. Other files that the text may name exist in memory, so that the readers behind
// Include, plymesh, imagemap and spectrum files run too; "self.pbrt" is the input itself.

#include <cstddef>
#include <cstdint>
#include <string>

#include "common/import/importer.h"

namespace {

const char kPly[] =
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
// An uncompressed TGA of 1 x 1 pixel.
const char kTga[] = "\0\0\2\0\0\0\0\0\0\0\0\0\1\0\1\0\30\0\1\2\3";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const std::string text(reinterpret_cast<const char*>(data), size);
    lightloom::import::MemorySource files(std::map<std::string, std::string>{{"scene.pbrt", text},
                                                                             {"self.pbrt", text},
                                                                             {"self.png", text},
                                                                             {"self.hdr", text},
                                                                             {"self.exr", text},
                                                                             {"self.gz", text},
                                                                             {"a.ply", kPly},
                                                                             {"a.tga", std::string(kTga, sizeof kTga - 1)},
                                                                             {"a.spd", "400 1\n700 0.5\n"}});
    lightloom::ImportOptions options;
    options.max_file_bytes = 16 << 20;
    options.max_subdivided_triangles = 1 << 14;
    const auto scene = lightloom::import::import_from(&files, "scene.pbrt", options);
    // An error is one line that names the file.
    if (!scene.ok() && (scene.status().message().empty() || scene.status().message().find('\n') != std::string::npos))
        __builtin_trap();
    return 0;
}
