#pragma once
// Reads image files: PNG, JPEG, TGA and HDR by stb_image, EXR by OpenEXR, PFM by our own reader.

#include <string>

#include "common/core/result.h"
#include "common/scene/image.h"

namespace lightloom::import {

/// Which of a file's channels are wanted.
enum class ImageChannels {
    kColour,  ///< Three channels (one for a grey file); alpha is dropped.
    kScalar,  ///< One channel: alpha where an EXR or RGBA PNG has some that is not opaque, else the mean of R, G, B.
};

struct ImageRequest {
    ImageChannels channels = ImageChannels::kColour;
    /// How 8- and 16-bit codes become linear values: "sRGB", "linear" or a gamma exponent. Ignored for float files, and, as in
    /// pbrt-v4, for JPEG and TGA, which are sRGB; see has_fixed_encoding().
    bool srgb = true;
    float gamma = 1;  ///< Used when `srgb` is false; 1 is linear.
};

/// Whether files of this name's type are always read as sRGB.
bool has_fixed_encoding(const std::string& name);

/// Decodes `bytes` of the file `name` (its extension selects the format). Dimensions are checked against the size of
/// the data before anything of their size is allocated. Values that are not finite are an error. `*warning`, empty
/// before, tells how the picture was changed. Neither it nor the error message names the file.
Result<Image> read_image(const std::string& name, const std::string& bytes, const ImageRequest& request, std::string* warning);

}  // namespace lightloom::import
