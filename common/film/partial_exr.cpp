#include "common/film/partial_exr.h"

#include <bit>
#include <cstring>
#include <optional>

namespace lightloom {

namespace {

static_assert(std::endian::native == std::endian::little, "EXR is little endian and is written here as memory");

constexpr const char* kSumChannels[] = {"hi.B", "hi.G", "hi.R", "lo.B", "lo.G", "lo.R"};  // EXR sorts channels by name.
constexpr size_t kPlanes = 6;
constexpr size_t kChunkPrefix = 12;  // part number, y, bytes of pixel data

enum class SplatLayout { kNone, kDense, kSparse };

SplatLayout splat_layout(const FrameLayout& frame, uint64_t splat_count) {
    if (splat_count == 0) return SplatLayout::kNone;
    const uint64_t dense = uint64_t(frame.crop.area()) * kPlanes * 4;
    const uint64_t sparse = splat_count * (kPlanes + 1) * 4;
    // A sparse part is a single line, and so a single chunk, whose size EXR stores in 31 bits.
    return sparse < dense && sparse <= uint64_t(INT32_MAX) ? SplatLayout::kSparse : SplatLayout::kDense;
}

/// One part of the file: its header values and how its scanlines are laid out.
struct Part {
    const char* name;
    int x0, y0, width, height;  // data window
    size_t planes;              // channels, 4 bytes a pixel each
    size_t line_bytes() const { return planes * 4 * size_t(width); }
    size_t chunk_bytes() const { return kChunkPrefix + line_bytes(); }
    size_t total_chunk_bytes() const { return chunk_bytes() * size_t(height); }
};

struct Layout {
    std::vector<Part> parts;
    std::optional<size_t> camera, splat;  // Their places in `parts`.
    std::string prologue;                 // Everything before the first chunk: headers and offset tables.
    std::vector<size_t> first_chunk;      // Per part: offset of its first chunk; the others follow at chunk_bytes().
    size_t size = 0;                      // Bytes of the whole file.
};

template <typename T>
void put(std::string& out, T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    out.append(bytes, sizeof(T));
}

void put_text(std::string& out, std::string_view text) { out.append(text).push_back('\0'); }

void put_attribute(std::string& out, std::string_view name, std::string_view type, std::string_view value) {
    put_text(out, name);
    put_text(out, type);
    put(out, int32_t(value.size()));
    out.append(value);
}

template <typename... T>
std::string packed(T... values) {
    std::string out;
    (put(out, values), ...);
    return out;
}

/// Attributes in alphabetical order, as OpenEXR itself writes them.
void put_header(std::string& out, const Part& part, const FrameLayout& frame) {
    std::string channels;
    for (size_t i = 0; i < part.planes; ++i) {
        put_text(channels, i < kPlanes ? kSumChannels[i] : "pixel");
        // Pixel type UINT; not perceptually linear and three reserved bytes; sampling 1 x 1.
        channels += packed(int32_t(0), int32_t(0), int32_t(1), int32_t(1));
    }
    channels.push_back('\0');
    const auto box = [](int x0, int y0, int width, int height) {
        return packed(int32_t(x0), int32_t(y0), int32_t(x0 + width - 1), int32_t(y0 + height - 1));
    };
    put_attribute(out, "channels", "chlist", channels);
    put_attribute(out, "chunkCount", "int", packed(int32_t(part.height)));
    put_attribute(out, "compression", "compression", packed(uint8_t(0)));
    put_attribute(out, "dataWindow", "box2i", box(part.x0, part.y0, part.width, part.height));
    put_attribute(out, "displayWindow", "box2i", box(0, 0, frame.width, frame.height));
    put_attribute(out, "lineOrder", "lineOrder", packed(uint8_t(0)));
    put_attribute(out, "name", "string", part.name);
    put_attribute(out, "pixelAspectRatio", "float", packed(1.0f));
    put_attribute(out, "screenWindowCenter", "v2f", packed(0.0f, 0.0f));
    put_attribute(out, "screenWindowWidth", "float", packed(1.0f));
    put_attribute(out, "type", "string", "scanlineimage");
    out.push_back('\0');
}

/// The only possible file layout for this unit and number of splat sums.
Layout make_layout(const FrameLayout& frame, const Rect& tile, uint32_t samples_per_pixel, uint64_t splat_count) {
    Layout layout;
    const auto add = [&](const Part& part) {
        layout.parts.push_back(part);
        return layout.parts.size() - 1;
    };
    const Rect& crop = frame.crop;
    // A file needs a part.
    if (samples_per_pixel > 0 || splat_count == 0)
        layout.camera = add({"camera", tile.x0, tile.y0, tile.width(), tile.height(), kPlanes});
    switch (splat_layout(frame, splat_count)) {
        case SplatLayout::kNone: break;
        case SplatLayout::kDense: layout.splat = add({"splat", crop.x0, crop.y0, crop.width(), crop.height(), kPlanes}); break;
        case SplatLayout::kSparse: layout.splat = add({"splat", 0, 0, int(splat_count), 1, kPlanes + 1}); break;
    }
    std::string& out = layout.prologue;
    put(out, uint32_t(20000630));    // Magic number.
    put(out, uint32_t(2 | 0x1000));  // Version 2, multi-part.
    for (const Part& part : layout.parts) put_header(out, part, frame);
    out.push_back('\0');  // End of the list of headers.

    size_t offset = out.size();
    for (const Part& part : layout.parts) offset += size_t(part.height) * 8;
    for (const Part& part : layout.parts) {
        layout.first_chunk.push_back(offset);
        for (int line = 0; line < part.height; ++line, offset += part.chunk_bytes()) put(out, uint64_t(offset));
    }
    layout.size = offset;
    return layout;
}

void make_chunk_prefix(char* out, size_t part_index, const Part& part, int line) {
    const int32_t values[3] = {int32_t(part_index), part.y0 + line, int32_t(part.line_bytes())};
    std::memcpy(out, values, sizeof values);
}

inline uint32_t load(const char* from) {
    uint32_t value;
    std::memcpy(&value, from, 4);
    return value;
}
inline void store(char* to, uint32_t value) { std::memcpy(to, &value, 4); }

/// Splits `count` interleaved RGB doubles into six planes of `count` UINTs.
void split_line(const double* rgb, size_t count, char* line) {
    for (size_t c = 0; c < 3; ++c) {
        char* hi = line + (2 - c) * count * 4;
        char* lo = line + (5 - c) * count * 4;
        for (size_t i = 0; i < count; ++i) {
            const uint64_t bits = std::bit_cast<uint64_t>(rgb[i * 3 + c]);
            store(hi + i * 4, uint32_t(bits >> 32));
            store(lo + i * 4, uint32_t(bits));
        }
    }
}

void join_line(const char* line, size_t count, double* rgb) {
    for (size_t c = 0; c < 3; ++c) {
        const char* hi = line + (2 - c) * count * 4;
        const char* lo = line + (5 - c) * count * 4;
        for (size_t i = 0; i < count; ++i) {
            rgb[i * 3 + c] = std::bit_cast<double>(uint64_t(load(hi + i * 4)) << 32 | load(lo + i * 4));
        }
    }
}

bool is_zero(const std::array<double, 3>& rgb) { return rgb[0] == 0 && rgb[1] == 0 && rgb[2] == 0; }

Status check_frame(const FrameLayout& frame, const Rect& tile) {
    const Rect& crop = frame.crop;
    constexpr int64_t kMaxPixels = kMaxPartialPixels;  // keeps all sizes below in range
    if (crop.empty() || crop.x0 < 0 || crop.y0 < 0 || crop.x1 > frame.width || crop.y1 > frame.height || crop.area() > kMaxPixels) {
        return invalid_argument("partial: the crop window is empty, outside the frame or larger than " +
                                std::to_string(kMaxPixels) + " pixels");
    }
    if (tile.empty() || tile.x0 < crop.x0 || tile.y0 < crop.y0 || tile.x1 > crop.x1 || tile.y1 > crop.y1) {
        return invalid_argument("partial: the tile does not lie inside the crop window");
    }
    return Status::ok_status();
}

}  // namespace

uint64_t partial_payload_size(const PartialExpectation& expected, uint64_t splat_count) {
    return make_layout(expected.frame, expected.tile, expected.samples_per_pixel, splat_count).size;
}

Result<EncodedPartial> encode_partial(const Partial& partial, const FrameLayout& frame) {
    LL_RETURN_IF_ERROR(check_frame(frame, partial.tile));
    if (const Result<PartialBounds> checked = check_partial(partial, frame); !checked.ok()) return checked.status();

    uint64_t splat_count = 0;
    for (const SplatSum& splat : partial.splats) splat_count += !is_zero(splat.rgb);
    const Layout layout = make_layout(frame, partial.tile, partial.samples_per_pixel, splat_count);

    EncodedPartial encoded;
    std::string& bytes = encoded.payload;
    bytes.resize(layout.size);
    std::memcpy(bytes.data(), layout.prologue.data(), layout.prologue.size());
    for (size_t p = 0; p < layout.parts.size(); ++p) {
        const Part& part = layout.parts[p];
        for (int line = 0; line < part.height; ++line) {
            make_chunk_prefix(bytes.data() + layout.first_chunk[p] + size_t(line) * part.chunk_bytes(), p, part, line);
        }
    }

    if (layout.camera) {
        const Part& camera = layout.parts[*layout.camera];
        const size_t width = size_t(camera.width);
        for (int line = 0; line < camera.height; ++line) {
            char* to = bytes.data() + layout.first_chunk[*layout.camera] + size_t(line) * camera.chunk_bytes() + kChunkPrefix;
            split_line(partial.camera.data() + size_t(line) * width * 3, width, to);
        }
    }

    const SplatLayout how = splat_layout(frame, splat_count);
    if (layout.splat) {
        const Part& part = layout.parts[*layout.splat];
        const size_t count = size_t(part.width);
        size_t next = 0;
        for (const SplatSum& splat : partial.splats) {
            if (is_zero(splat.rgb)) continue;
            size_t line = 0, column = next++;
            if (how == SplatLayout::kDense) line = splat.pixel / count, column = splat.pixel % count;
            char* to = bytes.data() + layout.first_chunk[*layout.splat] + line * part.chunk_bytes() + kChunkPrefix;
            for (size_t c = 0; c < 3; ++c) {
                const uint64_t bits = std::bit_cast<uint64_t>(splat.rgb[c]);
                store(to + ((2 - c) * count + column) * 4, uint32_t(bits >> 32));
                store(to + ((5 - c) * count + column) * 4, uint32_t(bits));
            }
            if (how == SplatLayout::kSparse) store(to + (kPlanes * count + column) * 4, splat.pixel);
        }
    }

    PartialDescriptor& d = encoded.descriptor;
    d.splat_count = splat_count;
    d.samples_per_pixel = partial.samples_per_pixel;
    d.light_paths = partial.light_paths;
    d.dropped_count = partial.dropped_count;
    d.dropped = partial.dropped;
    d.counters = partial.counters;
    d.rare_light = partial.rare_light;
    d.payload_size = bytes.size();
    d.payload_digest = sha256(bytes);
    return encoded;
}

Result<Partial> decode_partial(const PartialExpectation& expected, const PartialDescriptor& d, std::string_view payload) {
    LL_RETURN_IF_ERROR(check_frame(expected.frame, expected.tile));
    const uint64_t crop_area = uint64_t(expected.frame.crop.area());
    if (d.samples_per_pixel != expected.samples_per_pixel || d.light_paths != expected.light_paths) {
        return data_loss("partial: declares " + std::to_string(d.samples_per_pixel) + " samples per pixel and " +
                         std::to_string(d.light_paths) + " light paths; the unit has " +
                         std::to_string(expected.samples_per_pixel) + " and " + std::to_string(expected.light_paths));
    }
    if (d.splat_count > crop_area) {
        return data_loss("partial: declares " + std::to_string(d.splat_count) + " splat sums for " + std::to_string(crop_area) +
                         " pixels");
    }
    const Layout layout = make_layout(expected.frame, expected.tile, d.samples_per_pixel, d.splat_count);
    if (payload.size() != layout.size || d.payload_size != layout.size) {
        return data_loss("partial: payload of " + std::to_string(payload.size()) + " bytes, declared " +
                         std::to_string(d.payload_size) + ", expected " + std::to_string(layout.size));
    }
    if (std::memcmp(payload.data(), layout.prologue.data(), layout.prologue.size()) != 0) {
        return data_loss("partial: the EXR header or offset table is not the one that this unit must have");
    }
    for (size_t p = 0; p < layout.parts.size(); ++p) {
        const Part& part = layout.parts[p];
        for (int line = 0; line < part.height; ++line) {
            char prefix[kChunkPrefix];
            make_chunk_prefix(prefix, p, part, line);
            const char* found = payload.data() + layout.first_chunk[p] + size_t(line) * part.chunk_bytes();
            if (std::memcmp(found, prefix, kChunkPrefix) != 0) {
                return data_loss("partial: the prefix of scanline " + std::to_string(line) + " of part \"" +
                                 std::string(part.name) + "\" is not the one that this unit must have");
            }
        }
    }
    if (sha256(payload) != d.payload_digest) {
        return data_loss("partial: the payload does not have the declared SHA-256; it was damaged on its way");
    }

    Partial partial;
    partial.tile = expected.tile;
    partial.samples_per_pixel = d.samples_per_pixel;
    partial.light_paths = d.light_paths;
    partial.dropped_count = d.dropped_count;
    partial.dropped = d.dropped;
    partial.counters = d.counters;
    partial.rare_light = d.rare_light;
    partial.camera.resize(size_t(expected.tile.area()) * 3);
    if (layout.camera) {
        const Part& camera = layout.parts[*layout.camera];
        const size_t width = size_t(camera.width);
        for (int line = 0; line < camera.height; ++line) {
            const char* from =
                payload.data() + layout.first_chunk[*layout.camera] + size_t(line) * camera.chunk_bytes() + kChunkPrefix;
            join_line(from, width, partial.camera.data() + size_t(line) * width * 3);
        }
    }

    const SplatLayout how = splat_layout(expected.frame, d.splat_count);
    if (layout.splat) {
        const Part& part = layout.parts[*layout.splat];
        const size_t count = size_t(part.width);
        partial.splats.reserve(size_t(d.splat_count));
        std::vector<double> rgb(count * 3);
        for (int line = 0; line < part.height; ++line) {
            const char* from =
                payload.data() + layout.first_chunk[*layout.splat] + size_t(line) * part.chunk_bytes() + kChunkPrefix;
            join_line(from, count, rgb.data());
            for (size_t i = 0; i < count; ++i) {
                const std::array<double, 3> value{rgb[i * 3], rgb[i * 3 + 1], rgb[i * 3 + 2]};
                const bool zero = is_zero(value);
                if (how == SplatLayout::kSparse && zero) return data_loss("partial: a sparse splat sum is zero");
                if (zero) continue;
                if (partial.splats.size() == d.splat_count) {
                    return data_loss("partial: more splat sums than the declared " + std::to_string(d.splat_count));
                }
                const uint32_t pixel =
                    how == SplatLayout::kSparse ? load(from + (kPlanes * count + i) * 4) : uint32_t(size_t(line) * count + i);
                partial.splats.push_back({pixel, value});
            }
        }
        if (partial.splats.size() != d.splat_count) {
            return data_loss("partial: " + std::to_string(partial.splats.size()) + " splat sums, declared " +
                             std::to_string(d.splat_count));
        }
    }
    if (const auto checked = check_partial(partial, expected.frame); !checked.ok()) return checked.status();
    return partial;
}

}  // namespace lightloom
