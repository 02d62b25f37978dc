#include "common/film/exr_io.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <half.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "common/core/atomic_file.h"
#include "common/film/exr_memory.h"

namespace lightloom {

namespace {

constexpr int kZipLevel = 4;
constexpr int64_t kMaxSide = 1 << 17;
constexpr int64_t kMaxPixels = int64_t(1) << 28;

/// Address of pixel (0, 0) of the display for a slice whose memory begins at the data window's corner.
Imf::Slice slice_of(Imf::PixelType type, void* data, size_t pixel_bytes, const Rect& crop) {
    const size_t row_bytes = pixel_bytes * size_t(crop.width());
    char* corner = static_cast<char*>(data);
    char* base = corner - ptrdiff_t(crop.x0) * ptrdiff_t(pixel_bytes) - ptrdiff_t(crop.y0) * ptrdiff_t(row_bytes);
    return Imf::Slice(type, base, pixel_bytes, row_bytes);
}

Status check_values(const std::vector<float>& values, size_t channels, const Rect& crop, const std::string& what, bool half_range) {
    for (size_t i = 0; i < values.size(); ++i) {
        const float v = values[i];
        if (std::isfinite(v) && !(half_range && std::fabs(v) > 65504.0f)) continue;
        const size_t p = i / channels;
        const std::string where = "EXR " + what + ": pixel (" + std::to_string(crop.x0 + int(p % size_t(crop.width()))) + ", " +
                                  std::to_string(crop.y0 + int(p / size_t(crop.width()))) + ")";
        if (!std::isfinite(v)) return data_loss(where + " is NaN or infinite");
        return invalid_argument(where + " is " + std::to_string(v) + ", above 65504, the largest value of half");
    }
    return Status::ok_status();
}

Status check_image(const ExrImage& image, ExrPixelType type) {
    const Rect& crop = image.frame.crop;
    if (crop.empty() || crop.x0 < 0 || crop.y0 < 0 || crop.x1 > image.frame.width || crop.y1 > image.frame.height) {
        return invalid_argument("EXR: the crop window is empty or not inside the frame");
    }
    const size_t area = size_t(crop.area());
    if (image.color.width != crop.width() || image.color.height != crop.height() || image.color.pixels.size() != area * 3) {
        return invalid_argument("EXR: the colour image is not of the size of the crop window");
    }
    LL_RETURN_IF_ERROR(check_values(image.color.pixels, 3, crop, "colour", type == ExrPixelType::kHalf));
    for (const ImageLayer& layer : image.layers) {
        if (layer.name.empty() || layer.channels.empty() || layer.pixels.size() != area * layer.channels.size()) {
            return invalid_argument("EXR: layer \"" + layer.name + "\" is not of the size of the crop window");
        }
        LL_RETURN_IF_ERROR(check_values(layer.pixels, layer.channels.size(), crop, "layer " + layer.name, false));
    }
    return Status::ok_status();
}

}  // namespace

std::string ExrImage::attribute(std::string_view name) const {
    for (const auto& [key, value] : attributes) {
        if (key == name) return value;
    }
    return {};
}

const ImageLayer* ExrImage::layer(std::string_view name) const {
    for (const ImageLayer& candidate : layers) {
        if (candidate.name == name) return &candidate;
    }
    return nullptr;
}

Result<std::string> encode_exr(const ExrImage& image, ExrPixelType type) {
    LL_RETURN_IF_ERROR(check_image(image, type));
    const Rect& crop = image.frame.crop;
    try {
        const Imath::Box2i display({0, 0}, {image.frame.width - 1, image.frame.height - 1});
        const Imath::Box2i data({crop.x0, crop.y0}, {crop.x1 - 1, crop.y1 - 1});
        Imf::Header header(display, data, 1.0f, Imath::V2f(0, 0), 1.0f, Imf::INCREASING_Y, Imf::ZIP_COMPRESSION);
        header.zipCompressionLevel() = kZipLevel;
        for (const auto& [name, value] : image.attributes) {
            if (name.empty() || name.size() > 255 || header.find(name) != header.end() || name == "name" || name == "type" ||
                name == "version" || name == "chunkCount" || name == "tiles") {
                return invalid_argument("EXR: \"" + name + "\" cannot be the name of a string attribute");
            }
            header.insert(name, Imf::StringAttribute(value));
        }

        Imf::FrameBuffer frame_buffer;
        std::vector<half> halves;
        const char* const names[3] = {"R", "G", "B"};
        const bool use_half = type == ExrPixelType::kHalf;
        if (use_half) halves.assign(image.color.pixels.begin(), image.color.pixels.end());
        for (size_t c = 0; c < 3; ++c) {
            header.channels().insert(names[c], Imf::Channel(use_half ? Imf::HALF : Imf::FLOAT));
            if (use_half) {
                frame_buffer.insert(names[c], slice_of(Imf::HALF, halves.data() + c, 3 * sizeof(half), crop));
            } else {
                float* first = const_cast<float*>(image.color.pixels.data()) + c;  // The library only reads it.
                frame_buffer.insert(names[c], slice_of(Imf::FLOAT, first, 3 * sizeof(float), crop));
            }
        }
        for (const ImageLayer& layer : image.layers) {
            for (size_t c = 0; c < layer.channels.size(); ++c) {
                const std::string name = layer.name + "." + layer.channels[c];
                if (header.channels().findChannel(name)) {
                    return invalid_argument("EXR: channel \"" + name + "\" appears twice");
                }
                header.channels().insert(name, Imf::Channel(Imf::FLOAT));
                float* first = const_cast<float*>(layer.pixels.data()) + c;
                frame_buffer.insert(name, slice_of(Imf::FLOAT, first, layer.channels.size() * sizeof(float), crop));
            }
        }

        ExrMemoryOutput stream;
        {
            Imf::OutputFile file(stream, header);
            file.setFrameBuffer(frame_buffer);
            file.writePixels(crop.height());
        }
        return std::move(stream.bytes);
    } catch (const std::exception& error) {
        return internal_error("EXR: the image cannot be encoded: " + one_line(error.what()));
    }
}

Status write_exr(const std::string& path, const ExrImage& image, ExrPixelType type) {
    Result<std::string> bytes = encode_exr(image, type);
    if (!bytes.ok()) return {bytes.status().code(), path + ": " + bytes.status().message()};
    return write_file_atomically(path, *bytes);
}

Result<ExrImage> decode_exr(std::string_view bytes, const std::string& name) {
    const auto refuse = [&](const std::string& why) { return invalid_argument(name + ": " + why); };
    if (bytes.size() < 8 || std::memcmp(bytes.data(), "\x76\x2f\x31\x01", 4) != 0) return refuse("not an EXR file");
    uint32_t version;
    std::memcpy(&version, bytes.data() + 4, 4);
    if (version & 0x800) return refuse("deep EXR images are not supported");
    try {
        ExrMemoryInput stream(name.c_str(), bytes);
        Imf::InputFile file(stream);
        const Imf::Header& header = file.header();
        if (header.hasType() && header.type() != Imf::SCANLINEIMAGE && header.type() != Imf::TILEDIMAGE) {
            return refuse("EXR parts of type \"" + header.type() + "\" are not supported");
        }
        const Imath::Box2i data = header.dataWindow(), display = header.displayWindow();
        const int64_t width = int64_t(data.max.x) - data.min.x + 1, height = int64_t(data.max.y) - data.min.y + 1;
        if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide || width * height > kMaxPixels) {
            return refuse("an EXR data window of " + std::to_string(width) + " x " + std::to_string(height) +
                          " pixels is beyond the limit of " + std::to_string(kMaxPixels));
        }
        // Full-frame coordinates begin at the display window's corner.
        const auto relative = [](int value, int origin) { return int64_t(value) - origin; };
        const int64_t x0 = relative(data.min.x, display.min.x), y0 = relative(data.min.y, display.min.y);
        if (std::max({std::abs(x0), std::abs(y0), relative(display.max.x, display.min.x), relative(display.max.y, display.min.y)}) >
            kMaxSide) {
            return refuse("the EXR display window is out of range");
        }
        ExrImage image;
        image.frame.width = int(relative(display.max.x, display.min.x)) + 1;
        image.frame.height = int(relative(display.max.y, display.min.y)) + 1;
        image.frame.crop = {int(x0), int(y0), int(x0 + width), int(y0 + height)};

        const Imf::ChannelList& channels = header.channels();
        const bool rgb = channels.findChannel("R") && channels.findChannel("G") && channels.findChannel("B");
        const bool luminance = !rgb && channels.findChannel("Y");
        if (luminance && (channels.findChannel("RY") || channels.findChannel("BY"))) {
            return refuse("luminance/chroma EXR images are not supported; convert it to R, G and B");
        }
        if (!rgb && !luminance) return refuse("the EXR file has neither channels R, G and B nor Y");

        const size_t area = size_t(width * height);
        const Rect memory{data.min.x, data.min.y, data.max.x + 1, data.max.y + 1};
        image.color = {int(width), int(height), std::vector<float>(area * 3)};
        Imf::FrameBuffer frame_buffer;
        std::map<std::string, std::vector<std::string>> layers;  // layer -> full channel names
        for (auto it = channels.begin(); it != channels.end(); ++it) {
            const std::string channel = it.name();
            const bool part_of_color = rgb ? channel == "R" || channel == "G" || channel == "B" : channel == "Y";
            if (it.channel().xSampling != 1 || it.channel().ySampling != 1) {
                return refuse("EXR channel \"" + channel + "\" is subsampled, which is not supported");
            }
            if (part_of_color) {
                const size_t c = channel == "G" ? 1 : (channel == "B" ? 2 : 0);
                frame_buffer.insert(channel, slice_of(Imf::FLOAT, image.color.pixels.data() + c, 3 * sizeof(float), memory));
            } else {
                const size_t dot = channel.rfind('.');
                layers[dot == std::string::npos ? channel : channel.substr(0, dot)].push_back(channel);
            }
        }
        image.layers.reserve(layers.size());
        for (auto& [layer_name, names] : layers) {
            // Files list channels alphabetically; colours come back as RGB.
            std::string letters;
            for (const std::string& full : names) letters.push_back(full.back());
            if (letters == "BGR") std::reverse(names.begin(), names.end()), letters = "RGB";
            ImageLayer& layer = image.layers.emplace_back();
            layer = {layer_name, letters, std::vector<float>(area * letters.size())};
            for (size_t c = 0; c < names.size(); ++c) {
                frame_buffer.insert(names[c],
                                    slice_of(Imf::FLOAT, layer.pixels.data() + c, letters.size() * sizeof(float), memory));
            }
        }
        file.setFrameBuffer(frame_buffer);
        file.readPixels(data.min.y, data.max.y);
        if (luminance) {
            for (size_t i = 0; i < area; ++i) {
                image.color.pixels[i * 3 + 1] = image.color.pixels[i * 3 + 2] = image.color.pixels[i * 3];
            }
        }
        for (auto it = header.begin(); it != header.end(); ++it) {
            const auto* text = dynamic_cast<const Imf::StringAttribute*>(&it.attribute());
            if (text && std::strcmp(it.name(), "type") != 0 && std::strcmp(it.name(), "name") != 0) {
                image.attributes.emplace_back(it.name(), text->value());
            }
        }
        return image;
    } catch (const std::exception& error) {
        return refuse("the EXR file cannot be read: " + one_line(error.what()));
    }
}

Result<ExrImage> read_exr(const std::string& path) {
    Result<std::string> bytes = read_file(path);
    if (!bytes.ok()) return bytes.status();
    return decode_exr(*bytes, path);
}

}  // namespace lightloom
