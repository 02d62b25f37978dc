// The PLY reader on arbitrary bytes; an accepted mesh must be consistent.

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/import/ply.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const auto mesh = lightloom::import::read_ply({reinterpret_cast<const char*>(data), size});
    if (!mesh.ok()) {
        if (mesh.status().message().empty() || mesh.status().message().find('\n') != std::string::npos) __builtin_trap();
        return 0;
    }
    for (const uint32_t index : mesh->indices)
        if (index >= mesh->positions.size()) __builtin_trap();
    for (const lightloom::Vec3& p : mesh->positions)
        if (!lightloom::is_finite(p)) __builtin_trap();
    if (!mesh->normals.empty() && mesh->normals.size() != mesh->positions.size()) __builtin_trap();
    if (!mesh->uvs.empty() && mesh->uvs.size() != mesh->positions.size()) __builtin_trap();
    if (mesh->indices.size() % 3 != 0) __builtin_trap();
    return 0;
}
