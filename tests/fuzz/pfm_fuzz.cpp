// The PFM reader on arbitrary bytes; accepted pixels must be as many as the header says.

#include <cstddef>
#include <cstdint>

#include "common/import/pfm_image.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    std::string warning;
    const auto image = lightloom::import::read_pfm({reinterpret_cast<const char*>(data), size}, &warning);
    if (!image.ok()) {
        if (image.status().message().empty() || image.status().message().find('\n') != std::string::npos) __builtin_trap();
        return 0;
    }
    if (image->width < 1 || image->height < 1 || (image->channels != 1 && image->channels != 3)) __builtin_trap();
    if (image->values.size() != size_t(image->width) * size_t(image->height) * size_t(image->channels)) __builtin_trap();
    if (image->values.size() * sizeof(float) > size) __builtin_trap();
    return 0;
}
