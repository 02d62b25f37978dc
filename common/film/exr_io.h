#pragma once
// The final image as EXR. It is written with fixed settings: the same image gives the same bytes with any number of
// threads, as long as the versions of OpenEXR and its compressor are the same. Images are read from our own files and
// from other flat EXR files; see decode_exr() for what is refused.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/result.h"
#include "common/film/accumulation.h"
#include "common/film/frame.h"

namespace lightloom {

/// A named set of 32-bit float planes beside the colour: "variance", "albedo", "normal", "depth".
struct ImageLayer {
    std::string name;
    std::string channels;       ///< One letter each, for example "RGB", "XYZ" or "Z"; the EXR channel is name.letter.
    std::vector<float> pixels;  ///< channels.size() * width * height of the data window, row-major, interleaved.
};

/// Names of the attributes that our images carry, so that writers and readers agree.
namespace exr_attribute {
inline constexpr const char* kAlgorithm = "lightloom.algorithm";
inline constexpr const char* kParameters = "lightloom.parameters";
inline constexpr const char* kSeed = "lightloom.seed";
inline constexpr const char* kSamples = "lightloom.samplesPerPixel";
inline constexpr const char* kMaxDepth = "lightloom.maxDepth";
inline constexpr const char* kScene = "lightloom.sceneDigest";
}  // namespace exr_attribute

struct ExrImage {
    FrameLayout frame;  ///< Display window = full frame from (0, 0), data window = crop.
    RgbImage color;     ///< Linear radiance, Rec.709 primaries: channels R, G, B.
    std::vector<ImageLayer> layers;
    std::vector<std::pair<std::string, std::string>> attributes;  ///< Name and text; sorted by name in the file.

    /// Value of the attribute, or empty.
    std::string attribute(std::string_view name) const;
    const ImageLayer* layer(std::string_view name) const;
};

/// Storage of the colour channels. Layers are always float: half has no room for a variance or a depth.
enum class ExrPixelType { kFloat, kHalf };

/// Returns the file's bytes: scanlines with ZIP compression of a fixed level. kInvalidArgument for a size that does not
/// fit the frame, for a colour beyond half's 65504 where half was asked for (it is not clamped, which would change the
/// mean), and for an attribute name that EXR uses itself; kDataLoss for a NaN or infinite value. The message is one
/// line.
Result<std::string> encode_exr(const ExrImage& image, ExrPixelType type = ExrPixelType::kFloat);
/// Writes encode_exr()'s bytes to a file that appears whole or not at all.
Status write_exr(const std::string& path, const ExrImage& image, ExrPixelType type = ExrPixelType::kFloat);

/// Reads a flat scanline or tiled EXR (its first part) with channels R, G, B of half, float or uint, or with Y alone,
/// which is repeated. Other channels become layers: the layer's name is the part before the last dot, or the whole name
/// where there is no dot; of the channel's name its last letter is kept. NaN and infinities are passed on. `name` is
/// for messages. kInvalidArgument for deep images, subsampled channels, luminance with chroma (RY, BY), and files that
/// have neither R, G, B nor Y.
Result<ExrImage> decode_exr(std::string_view bytes, const std::string& name);
Result<ExrImage> read_exr(const std::string& path);

}  // namespace lightloom
