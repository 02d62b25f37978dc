#include "common/import/pfm_image.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "common/import/diagnostics.h"
#include "common/import/exr_image.h"
#include "common/import/tokenizer.h"

namespace lightloom::import {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

/// Reads the words of the header. One blank ends a word; `pos` is left on it.
struct Header {
    std::string_view text;
    size_t pos = 0;

    std::string_view word() {
        while (pos < text.size() && (is_blank(text[pos]) || text[pos] == '#')) {
            if (text[pos] == '#')
                while (pos < text.size() && text[pos] != '\n') ++pos;
            else
                ++pos;
        }
        constexpr size_t kLongest = 64;  // Other kinds of files need not have a blank anywhere.
        const size_t begin = pos;
        while (pos < text.size() && pos - begin < kLongest && !is_blank(text[pos]) && text[pos] != '#') ++pos;
        return text.substr(begin, pos - begin);
    }
};

bool parse_side(std::string_view word, uint64_t* out) {
    double number = 0;
    if (!parse_number(word, &number) || !(number >= 0) || number != std::floor(number) || !(number < 1e9)) return false;
    *out = uint64_t(number);
    return true;
}

float float_at(const char* bytes, bool little_endian) {
    uint32_t code = 0;
    std::memcpy(&code, bytes, sizeof code);
    const bool host_is_little = std::endian::native == std::endian::little;
    return std::bit_cast<float>(little_endian == host_is_little ? code : __builtin_bswap32(code));
}

}  // namespace

Result<PfmPixels> read_pfm(const std::string& bytes, std::string* warning) {
    Header header{bytes};
    const std::string_view magic = header.word();
    if (magic != "PF" && magic != "Pf") return invalid_argument("the file does not begin with PF or Pf, so it is not a PFM image");
    const std::string width_word(header.word()), height_word(header.word()), scale_word(header.word());
    uint64_t width = 0, height = 0;
    if (!parse_side(width_word, &width) || !parse_side(height_word, &height))
        return data_loss("the PFM header has " + quoted(width_word) + " and " + quoted(height_word) +
                         " in place of its width and height");
    double scale = 0;
    if (!parse_number(scale_word, &scale) || float(scale) == 0)
        return data_loss("the PFM header has " + quoted(scale_word) +
                         " in place of its scale, a number that is not 0 (negative for little-endian)");
    const uint64_t channels = magic == "PF" ? 3 : 1;
    LL_RETURN_IF_ERROR(check_image_size(width, height, channels, bytes.size()));

    const uint64_t size = width * height * channels * sizeof(float);
    uint64_t begin = header.pos;
    if (begin < bytes.size()) ++begin;
    // A line may end in two characters. The second might also be the first byte of the pixels; the file's size tells
    // which.
    if (begin < bytes.size() && bytes[begin - 1] == '\r' && bytes[begin] == '\n' && bytes.size() - begin > size) ++begin;
    const uint64_t present = bytes.size() - begin;
    if (present < size)
        return data_loss("the PFM image is cut short: " + std::to_string(width) + " x " + std::to_string(height) + " pixels need " +
                         std::to_string(size) + " bytes after the header, and " + std::to_string(present) + " are there");
    if (present > size) *warning = "the last " + std::to_string(present - size) + " bytes, behind the pixels, are ignored";

    PfmPixels out;
    out.width = int(width);
    out.height = int(height);
    out.channels = int(channels);
    out.values.resize(size / sizeof(float));
    const uint64_t row = width * channels;
    const bool little_endian = scale < 0;
    const float magnitude = float(std::fabs(scale));
    for (uint64_t y = 0; y < height; ++y) {
        const char* from = bytes.data() + begin + (height - 1 - y) * row * sizeof(float);
        for (uint64_t i = 0; i < row; ++i) out.values[y * row + i] = float_at(from + i * sizeof(float), little_endian) * magnitude;
    }
    return out;
}

}  // namespace lightloom::import
