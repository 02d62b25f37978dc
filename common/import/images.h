#pragma once
// Image files to Image: PNG, JPEG, TGA and HDR through stb_image, EXR through OpenEXR.

#include <string>

#include "common/core/result.h"
#include "common/scene/image.h"

namespace lightloom::import {

/// What of a file's channels is wanted.
enum class ImageChannels {
    kColour,  ///< Three channels (one for a grey file); alpha is dropped.
    kScalar,  ///< One channel: alpha where the file has a fourth channel that is not all opaque, else the mean of R, G,
              ///< B.
};

struct ImageRequest {
    ImageChannels channels = ImageChannels::kColour;
    /// How 8- and 16-bit codes become linear values: "sRGB", "linear" or a gamma exponent. Ignored for float files.
    bool srgb = true;
    float gamma = 1;  ///< Used when `srgb` is false; 1 is linear.
};

/// Decodes `bytes` of the file `name` (its extension selects the format). Dimensions are checked against the size of
/// the data before anything of their size is allocated. Values that are not finite are an error. The message does not
/// name the file.
Result<Image> read_image(const std::string& name, const std::string& bytes, const ImageRequest& request);

}  // namespace lightloom::import
