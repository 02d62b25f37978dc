#pragma once
// CRC-32C (Castagnoli) by the processor's own instruction, which every host of this program has.

#include <nmmintrin.h>

#include <cstdint>
#include <cstring>
#include <string_view>

namespace lightloom {

/// Of the bytes before, whose sum is `before`, and `bytes` after them; 0 for none.
inline uint32_t crc32c(std::string_view bytes, uint32_t before = 0) {
    uint64_t sum = ~before;
    const char* at = bytes.data();
    size_t left = bytes.size();
    for (; left >= 8; left -= 8, at += 8) {
        uint64_t word;
        std::memcpy(&word, at, 8);
        sum = _mm_crc32_u64(sum, word);
    }
    uint32_t rest = uint32_t(sum);
    for (; left > 0; --left, ++at) rest = _mm_crc32_u8(rest, uint8_t(*at));
    return ~rest;
}

}  // namespace lightloom
