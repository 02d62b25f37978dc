#include "common/core/utf8.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>

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

uint32_t code_point(std::string_view character) {
    const uint8_t lead = uint8_t(character[0]);
    uint32_t code = character.size() == 1 ? lead : lead & (0x7fu >> character.size());
    for (const char byte : character.substr(1)) code = code << 6 | (uint8_t(byte) & 0x3f);
    return code;
}

bool breaks_the_line(uint32_t code) {
    const bool control = code < 0x20 || (code >= 0x7f && code < 0xa0);
    const bool separator = code == 0x2028 || code == 0x2029;
    const bool direction = code == 0x200e || code == 0x200f || code == 0x61c || (code >= 0x202a && code <= 0x202e) ||
                           (code >= 0x2066 && code <= 0x2069);
    return control || separator || direction;
}

bool begins_a_character(char byte) { return (uint8_t(byte) & 0xc0) != 0x80; }

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

bool is_one_line(std::string_view text) {
    while (!text.empty()) {
        const size_t size = character_size(text);
        if (size == 0 || breaks_the_line(code_point(text.substr(0, size)))) return false;
        text.remove_prefix(size);
    }
    return true;
}

std::string one_line(std::string_view text) {
    std::string out;
    while (!text.empty()) {
        const size_t size = character_size(text);
        const std::string_view character = size > 0 ? text.substr(0, size) : "\xef\xbf\xbd";
        if (const uint32_t code = code_point(character); breaks_the_line(code)) {
            char escape[16];
            std::snprintf(escape, sizeof escape, code < 0x100 ? "\\x%02x" : "\\u%04x", code);
            out += escape;
        } else {
            out += character;
        }
        text.remove_prefix(size > 0 ? size : 1);
    }
    return out;
}

size_t character_count(std::string_view text) { return size_t(std::count_if(text.begin(), text.end(), begins_a_character)); }

std::string_view first_characters(std::string_view text, size_t count) {
    size_t end = 0;
    for (; end < text.size(); ++end) {
        if (begins_a_character(text[end]) && count-- == 0) break;
    }
    return text.substr(0, end);
}

std::string_view last_characters(std::string_view text, size_t count) {
    const size_t all = character_count(text);
    return all <= count ? text : text.substr(first_characters(text, all - count).size());
}

}  // namespace lightloom
