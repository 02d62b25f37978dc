#pragma once
// Whether an image can serve as the reference of a benchmark.

#include <optional>
#include <string>
#include <vector>

#include "client/progressive_render.h"
#include "common/film/exr_io.h"

namespace lightloom::client {

/// What the runs will be.
struct BenchSubject {
    FrameLayout frame;
    int max_depth = 0;
    std::string scene_digest;
    std::vector<AlgorithmChoice> algorithms;
    double threshold = 12;  ///< MAPE in percent.
};

/// Refuses a reference that the runs cannot converge to (other frame, other path lengths, not finite), and a threshold that
/// a black image would meet, because then an algorithm that finds no light wins. Returns warnings about what may hide or
/// distort an error: a tested algorithm made the reference, it is too noisy for the threshold or nobody knows how noisy, other
/// scene files. `name` is for messages.
Result<std::vector<std::string>> check_reference(const std::string& name, const ExrImage& reference, const BenchSubject& subject);

/// MAPE in percent that a perfect image would show against a reference with this variance layer: what its own noise adds.
/// Nothing if it has none, as one of a single group of samples or of another renderer.
std::optional<double> noise_mape(const ExrImage& reference);

}  // namespace lightloom::client
