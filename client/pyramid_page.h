#pragma once
// The page of a pyramid (client/pyramid.h): one HTML file without anything from elsewhere but the pictures beside it.

#include <cstdint>
#include <string>
#include <vector>

#include "common/path/technique.h"

namespace lightloom::client {

struct PyramidPicture {
    TechniqueKind kind = TechniqueKind::kHit;
    int s = 0;            ///< Of the technique.
    std::string name;     ///< Files are weighted-NAME.exr, unweighted-NAME.png and so on.
    double weighted = 0;  ///< Mean luminances.
    double unweighted = 0;
    double light_share = 0;  ///< Of the image's mean luminance.
    double row_share = 0;    ///< Unweighted over the row's weighted luminance: how much of this light the technique can find.
    double noise_share = 0;  ///< Of the noise of all pictures; NaN: not known.
};

/// Paths of one length.
struct PyramidRow {
    int k = 0;  ///< Edges; 0: all that are longer than the rows before.
    /// By which its PNG files are brighter than the EXR: the brightest weighted picture of the row, and the whole light of the row,
    /// which every unweighted picture may have found, are as bright as the whole image.
    int weighted_stops = 0, unweighted_stops = 0;
    double mean = 0;  ///< Luminance of its weighted pictures together.
    double light_share = 0;
    std::vector<PyramidPicture> pictures;  ///< From the light's end of the path to the camera's.
};

struct PyramidPage {
    std::string scene, algorithm, build;
    std::vector<std::pair<std::string, std::string>> parameters;
    uint64_t samples_per_pixel = 0, seed = 0;
    int width = 0, height = 0, max_depth = 0;
    int depth = 0;                 ///< Longest paths with a row of their own.
    int stops = 0;                 ///< Of image.png.
    double mean = 0;               ///< Luminance of the image.
    uint64_t not_finite = 0;       ///< Contributions that are in no picture.
    std::vector<PyramidRow> rows;  ///< By length.
};

std::string pyramid_html(const PyramidPage& page);
/// The same for programs.
std::string pyramid_json(const PyramidPage& page);

/// What pyramid.json begins with; a directory is known for a pyramid by it.
inline constexpr const char* kPyramidMark = "{\n \"lightloom_pyramid\": 1";

}  // namespace lightloom::client
