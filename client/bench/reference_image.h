#pragma once
// The image that a benchmark measures by: whether it can serve, how noisy it is itself, where it is found, and how one is made.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/progressive_render.h"
#include "common/film/exr_io.h"
#include "common/metrics/region_means.h"

namespace lightloom::client {

/// Regions of an image whose means are compared: whole image, then so many columns and rows.
inline constexpr int kRegionColumns = 3, kRegionRows = 3;

struct Reference {
    std::string path;
    std::string digest;  ///< SHA-256 of the file.
    ExrImage image;
    /// What its own noise adds to every error: MAPE in percent, relMSE. Absent where nobody knows, as of another renderer's image.
    std::optional<double> noise_mape, noise_relmse;
    /// Mean luminances. Variances come from its description (PATH with .json), where groups of iterations gave them, or else from
    /// the variance layer as if pixels were independent; infinite where neither is there.
    std::vector<Estimate> regions;

    bool made_by(const std::string& algorithm) const { return image.attribute(exr_attribute::kAlgorithm) == algorithm; }
};

/// Reads the EXR, and its description if one lies beside it. kInvalidArgument for a description that does not belong to it.
Result<Reference> read_reference(const std::string& path);

/// What the runs will be.
struct BenchSubject {
    FrameLayout frame;
    int max_depth = 0;
    std::string scene_digest;
    std::vector<AlgorithmChoice> algorithms;
    double threshold = 0;  ///< MAPE in percent; 0: none.
    bool found = false;    ///< Nobody has named the reference: it lay beside the scene.
};

/// Refuses a reference that the runs cannot converge to (other frame, other path lengths, not finite), and a threshold that
/// a black image would meet, because then an algorithm that finds no light wins. Returns warnings about what may hide or
/// distort an error: a tested algorithm made the reference, it is too noisy for the threshold or nobody knows how noisy, other
/// scene files. `name` is for messages.
Result<std::vector<std::string>> check_reference(const std::string& name, const ExrImage& reference, const BenchSubject& subject);

/// MAPE in percent that a perfect image would show against a reference with this variance layer: what its own noise adds.
/// Nothing if it has none, as one of a single group of samples or of another renderer.
std::optional<double> noise_mape(const ExrImage& reference);
/// The same as relMSE.
std::optional<double> noise_relmse(const ExrImage& reference);

/// The file with which `scene_file` is measured at this size if nobody names one: references/STEM-WxH.exr beside it, or
/// STEM-ref.exr. Empty if there is none.
std::filesystem::path find_reference(const std::filesystem::path& scene_file, int width, int height);

}  // namespace lightloom::client
