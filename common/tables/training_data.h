#pragma once
// What training units return: full paths (the dataset D), light sub-paths (for Q), and the brightness of the frame by
// blocks. Everything is a plain array, so that parts from many units are simply joined in the order of their sample
// numbers.
//
// A path X of technique `own` with density p_own (as traced, roulette included) and weight w_own:
//     estimate = L(w_own f / p_own)                a sample of the image, in expectation
//     square   = L(f / p_own)^2 w_own              E[square / (F / p_own)] is the loss [common/path/README.md, "Training set"]
//     densities: n p / p_own of each technique, as the render's weights will count it (typical survival of roulette,
//                corrections) but without the factor that is to be learned, N Gamma / Q; 0 where it is impossible.
//                vertices[s].density is that of hitting the emitter (s = 0) and of connecting x_{s-1} with x_s
//                (1 <= s <= k-1); next_event that of choosing x_0 afresh from x_1, as often as the render will; lens
//                that of a light sub-path that reached the lens and, where the render merges, of one that merged
// A camera sample keeps at most two paths of each length: with two, three, four, and more camera vertices (the lens
// counts). The paths that it found are dealt to the two places in turn. A light sub-path that reached the lens keeps
// one path. Each is chosen in proportion to its estimate; estimate and square are divided by the probability of that
// choice, so that sums over D stay unbiased.
//
// Visits tell roulette where camera sub-paths still have something to gain (train_gain.h).

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/packed_normal.h"
#include "common/core/result.h"
#include "common/core/vec.h"
#include "common/tables/frame_blocks.h"

namespace lightloom {

/// There are some fifty of them per camera sample, which is nearly all of the data: hence 20 bytes.
struct TrainingVertex {
    Vec3 position;
    PackedNormal normal;  ///< Geometric; x_0 of an infinite light: direction of travel. The lens has none.
    float density = 0;    ///< Paths: see above. Light sub-paths: scalar throughput; 0 where not connectible.
};

/// Lengths of camera sub-paths that are told apart, and paths that a camera sample keeps of each.
inline constexpr int kTrainingLengths = 4, kTrainingPathsPerLength = 2;

/// Most paths that a camera sample keeps; they are neighbours in TrainingData::paths.
inline constexpr size_t kTrainingPathsPerSample = size_t(kTrainingLengths) * kTrainingPathsPerLength;

struct TrainingPath {
    uint32_t first_vertex = 0;
    uint32_t vertex_count = 0;  ///< k + 1, x_0 ... x_k; light sub-paths: y_0 ... y_{n-1}.
    uint32_t block = 0;         ///< Index of the pixel's block in the frame. Light sub-paths: 0.
    uint32_t emitter = 0;       ///< Of x_0.
    float estimate = 0, square = 0;
    float next_event = 0, lens = 0;  ///< Densities; see above. Light sub-paths: 0.
};

/// A vertex of a camera sub-path that could have scattered, and what came of it.
struct TrainingVisit {
    Vec3 position;
    PackedNormal normal;  ///< Geometric, on the side from which the sub-path came.
    float gain = 0;       ///< Estimates that the sub-path's later vertices found, over its throughput here.
    float vertices = 0;   ///< How many later vertices there were.
};

struct TrainingData {
    int32_t blocks_x = 0, blocks_y = 0;
    std::vector<double> block_sum;  ///< Sums of all estimates, kept or not; blocks_x * blocks_y.
    /// Sums of squares of what each camera sample found; as many, or none if nobody asked for visits.
    std::vector<double> block_square;
    uint64_t samples = 0;        ///< D: camera samples traced, uniform over the frame.
    uint64_t light_samples = 0;  ///< M': light sub-paths traced to measure Q, those included that left nothing to keep.
    std::vector<TrainingPath> paths;
    std::vector<TrainingPath> light_paths;
    std::vector<uint32_t> part_ends;  ///< Ends in `paths` of the parts that append() has joined; not serialized.
    std::vector<TrainingVertex> vertices;
    std::vector<TrainingVisit> visits;  ///< Of all camera sub-paths; none if nobody asked for them.

    static constexpr uint64_t kMaxVertices = UINT32_MAX;  ///< TrainingPath::first_vertex has 32 bits.

    /// Appends another unit's data of the same frame; kInvalidArgument for data of another frame, kResourceExhausted
    /// above `max_vertices`.
    Status append(const TrainingData& other, uint64_t max_vertices = kMaxVertices);
    /// Makes room for as much as all of `parts` hold, so that appending them copies nothing twice. Until it is filled the
    /// room takes addresses, but no memory.
    void reserve_for(const std::vector<const TrainingData*>& parts);
    /// Checks everything that training relies on. Estimates, squares, densities and sums may exceed the range of their
    /// type in an extreme scene; see in_range().
    Status validate(size_t emitter_count) const;
    /// Whether all numbers of a path from which tables are learned are finite. Training leaves other paths out.
    bool in_range(const TrainingPath& path) const;
};

std::string serialize(const TrainingData& data);
/// kDataLoss when the bytes are no training data.
Result<TrainingData> parse_training_data(std::string_view bytes);

}  // namespace lightloom
