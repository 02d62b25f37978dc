#include "common/import/exr_image.h"

#include <ImfChannelList.h>
#include <ImfChromaticities.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfStandardAttributes.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <optional>

#include "common/film/exr_memory.h"

namespace lightloom::import {
namespace {

/// Chromaticities of primaries and white: red x, red y, ... white y.
struct NamedPrimaries {
    ExrPrimaries primaries;
    float xy[8];
};
constexpr NamedPrimaries kPrimaries[] = {
    {ExrPrimaries::kRec709, {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f}},
    {ExrPrimaries::kDisplayP3, {0.680f, 0.320f, 0.265f, 0.690f, 0.150f, 0.060f, 0.3127f, 0.3290f}},
    {ExrPrimaries::kRec2020, {0.708f, 0.292f, 0.170f, 0.797f, 0.131f, 0.046f, 0.3127f, 0.3290f}},
};

std::optional<ExrPrimaries> primaries_of(const Imf::Header& header) {
    if (!Imf::hasChromaticities(header)) return ExrPrimaries::kRec709;
    const Imf::Chromaticities& c = Imf::chromaticities(header);
    const float xy[8] = {c.red.x, c.red.y, c.green.x, c.green.y, c.blue.x, c.blue.y, c.white.x, c.white.y};
    for (const NamedPrimaries& named : kPrimaries) {
        const auto close = [](float a, float b) { return std::fabs(a - b) < 2e-3f; };
        if (std::equal(xy, xy + 8, named.xy, close)) return named.primaries;
    }
    return std::nullopt;
}

}  // namespace

Rgb luminance_weights(ExrPrimaries primaries) {
    switch (primaries) {
        case ExrPrimaries::kRec709: break;
        case ExrPrimaries::kDisplayP3: return {0.22897f, 0.69174f, 0.07929f};
        case ExrPrimaries::kRec2020: return {0.26270f, 0.67800f, 0.05930f};
    }
    return {0.2126f, 0.7152f, 0.0722f};
}

Status check_image_size(uint64_t width, uint64_t height, uint64_t channels, uint64_t file_bytes, uint64_t values_per_byte) {
    constexpr uint64_t kMaxSide = 16384;
    const std::string claim = std::to_string(width) + " x " + std::to_string(height);
    if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide)
        return invalid_argument("the image claims " + claim + " pixels; sides from 1 to 16384 are supported");
    if (width * height * channels > file_bytes * values_per_byte)
        return data_loss("the image claims " + claim + " pixels, which its " + std::to_string(file_bytes) + " bytes cannot hold");
    return {};
}

Result<ExrPixels> read_exr(const std::string& bytes, ExrChannels channels) try {
    ExrMemoryInput stream("image", bytes);
    Imf::InputFile file(stream, 1);
    const Imath::Box2i window = file.header().dataWindow();
    const int64_t width = int64_t(window.max.x) - window.min.x + 1, height = int64_t(window.max.y) - window.min.y + 1;
    const Imf::ChannelList& list = file.header().channels();
    std::vector<std::string> names;
    if (list.findChannel("R") && list.findChannel("G") && list.findChannel("B")) {
        names = {"R", "G", "B"};
        if (list.findChannel("A")) names.push_back("A");
    } else if (list.findChannel("Y")) {
        names = {"Y"};
    } else if (list.begin() != list.end() && ++list.begin() == list.end()) {
        names = {list.begin().name()};
    } else {
        return invalid_argument("the EXR image has no R, G, B or Y channels");
    }
    for (const std::string& name : names)
        if (list[name.c_str()].xSampling != 1 || list[name.c_str()].ySampling != 1)
            return invalid_argument("the EXR image has sub-sampled channels, which are not supported");
    LL_RETURN_IF_ERROR(check_image_size(uint64_t(std::max<int64_t>(width, 0)), uint64_t(std::max<int64_t>(height, 0)), names.size(),
                                        bytes.size(), kExrValuesPerByte));
    if (channels == ExrChannels::kFirstThree && names.size() >= 3) {
        auto channel = list.begin();
        for (std::string& name : names) name = (channel++).name();
        names.resize(3);
    }
    const std::optional<ExrPrimaries> primaries = primaries_of(file.header());
    if (!primaries && names.size() >= 3)
        return invalid_argument(
            "the EXR image's chromaticities are not those of sRGB, Display P3 or Rec. 2020; convert it to "
            "sRGB's primaries");
    ExrPixels out;
    if (primaries) out.primaries = *primaries;
    out.width = int(width);
    out.height = int(height);
    out.channels = int(names.size());
    out.values.resize(size_t(width) * size_t(height) * names.size());
    const size_t pixel = sizeof(float) * names.size(), row = pixel * size_t(width);
    Imf::FrameBuffer buffer;
    for (size_t c = 0; c < names.size(); ++c)
        buffer.insert(names[c], Imf::Slice::Make(Imf::FLOAT, out.values.data() + c, window, pixel, row));
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return out;
} catch (const std::exception& e) {
    return data_loss("the EXR image cannot be decoded: " + one_line(e.what()));
}

}  // namespace lightloom::import
