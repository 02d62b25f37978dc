#include "common/core/utf8.h"

#include <cstdint>

namespace lightloom {
namespace {

/// Bytes of the character that `text` begins with; 0 if it does not begin with a whole, well-formed one.
size_t character_size(std::string_view text) {
    const uint8_t lead = uint8_t(text[0]);
    if (lead < 0x80) return 1;
    const size_t size = lead >= 0xc2 && lead <= 0xdf ? 2 : (lead & 0xf0) == 0xe0 ? 3 : lead >= 0xf0 && lead <= 0xf4 ? 4 : 0;
    if (size == 0 || text.size() < size) return 0;
    const uint8_t second = uint8_t(text[1]);
    if ((lead == 0xe0 && second < 0xa0) || (lead == 0xed && second > 0x9f) || (lead == 0xf0 && second < 0x90) ||
        (lead == 0xf4 && second > 0x8f))
        return 0;
    for (size_t k = 1; k < size; ++k) {
        if ((uint8_t(text[k]) & 0xc0) != 0x80) return 0;
    }
    return size;
}

}  // namespace

bool is_utf8(std::string_view text) {
    while (!text.empty()) {
        const size_t size = character_size(text);
        if (size == 0) return false;
        text.remove_prefix(size);
    }
    return true;
}

std::string clipped_utf8(std::string_view text, size_t max_bytes) {
    std::string out;
    while (!text.empty()) {
        const size_t size = character_size(text);
        const std::string_view character = size > 0 ? text.substr(0, size) : "\xef\xbf\xbd";
        if (out.size() + character.size() > max_bytes) break;
        out += character;
        text.remove_prefix(size > 0 ? size : 1);
    }
    return out;
}

}  // namespace lightloom
