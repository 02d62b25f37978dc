#include "common/tables/training_data.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace lightloom {
namespace {

struct Header {
    char magic[8] = {'L', 'L', 'T', 'R', 'A', 'I', 'N', '5'};
    int32_t blocks_x = 0, blocks_y = 0;
    uint64_t samples = 0, light_samples = 0, path_count = 0, light_path_count = 0, vertex_count = 0, visit_count = 0;
    uint64_t has_squares = 0;
};

template <class T>
void put(std::string& out, const std::vector<T>& values) {
    out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

template <class T>
void take(std::string_view& rest, uint64_t count, std::vector<T>* values) {
    values->resize(count);
    if (count) std::memcpy(values->data(), rest.data(), count * sizeof(T));
    rest.remove_prefix(count * sizeof(T));
}

}  // namespace

Status TrainingData::append(const TrainingData& other, uint64_t max_vertices) {
    if (vertices.size() + other.vertices.size() > max_vertices)
        return {StatusCode::kResourceExhausted, "the training data have more than " + std::to_string(max_vertices) +
                                                    " path vertices; choose fewer training-paths or energy-paths"};
    if (blocks_x == 0) {
        blocks_x = other.blocks_x, blocks_y = other.blocks_y;
        block_sum.assign(other.block_sum.size(), 0.0);
        block_square.assign(other.block_square.size(), 0.0);
    }
    if (blocks_x != other.blocks_x || blocks_y != other.blocks_y || block_sum.size() != other.block_sum.size() ||
        block_square.size() != other.block_square.size())
        return invalid_argument("the training data are those of another frame");
    for (size_t i = 0; i < block_sum.size(); ++i) block_sum[i] += other.block_sum[i];
    for (size_t i = 0; i < block_square.size(); ++i) block_square[i] += other.block_square[i];
    samples += other.samples, light_samples += other.light_samples;
    const uint32_t offset = uint32_t(vertices.size());
    const auto join = [offset](std::vector<TrainingPath>& into, const std::vector<TrainingPath>& from) {
        for (TrainingPath p : from) {
            p.first_vertex += offset;
            into.push_back(p);
        }
    };
    join(paths, other.paths);
    join(light_paths, other.light_paths);
    vertices.insert(vertices.end(), other.vertices.begin(), other.vertices.end());
    visits.insert(visits.end(), other.visits.begin(), other.visits.end());
    part_ends.push_back(uint32_t(paths.size()));
    return {};
}

void TrainingData::reserve_for(const std::vector<const TrainingData*>& parts) {
    size_t more_paths = paths.size(), more_light = light_paths.size(), more_vertices = vertices.size(), more_visits = visits.size();
    for (const TrainingData* part : parts)
        more_paths += part->paths.size(), more_light += part->light_paths.size(), more_vertices += part->vertices.size(),
            more_visits += part->visits.size();
    paths.reserve(more_paths), light_paths.reserve(more_light), vertices.reserve(more_vertices), visits.reserve(more_visits);
}

Status TrainingData::validate(size_t emitter_count) const {
    if (blocks_x < 1 || blocks_y < 1 || block_sum.size() != size_t(blocks_x) * size_t(blocks_y))
        return data_loss("the training data have no frame");
    if (!block_square.empty() && block_square.size() != block_sum.size())
        return data_loss("the training data have squares of another frame");
    if (light_paths.size() > light_samples) return data_loss("the training data have more light sub-paths than were traced");
    for (const std::vector<TrainingPath>* list : {&paths, &light_paths}) {
        for (const TrainingPath& p : *list) {
            if (p.vertex_count < 1 || uint64_t(p.first_vertex) + p.vertex_count > vertices.size() || p.block >= block_sum.size() ||
                p.emitter >= emitter_count)
                return data_loss("the training data have a malformed path");
        }
    }
    // Classifiers sort by positions, so that none may be NaN. Every packed normal is one.
    for (const auto& [p, normal, density] : vertices)
        if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
            return data_loss("the training data have a vertex whose position is not finite");
    for (const TrainingVisit& v : visits)
        if (!std::isfinite(v.position.x) || !std::isfinite(v.position.y) || !std::isfinite(v.position.z))
            return data_loss("the training data have a visit to a place that is not finite");
    return {};
}

bool TrainingData::in_range(const TrainingPath& path) const {
    const TrainingVertex* v = &vertices[path.first_vertex];
    return std::isfinite(path.estimate) && std::isfinite(path.square) && std::isfinite(v->density + path.next_event + path.lens) &&
           std::all_of(v, v + path.vertex_count, [](const TrainingVertex& x) { return std::isfinite(x.density); });
}

std::string serialize(const TrainingData& d) {
    Header header;
    header.blocks_x = d.blocks_x, header.blocks_y = d.blocks_y;
    header.samples = d.samples, header.light_samples = d.light_samples;
    header.path_count = d.paths.size(), header.light_path_count = d.light_paths.size(), header.vertex_count = d.vertices.size();
    header.visit_count = d.visits.size(), header.has_squares = d.block_square.empty() ? 0 : 1;
    std::string out(reinterpret_cast<const char*>(&header), sizeof header);
    put(out, d.block_sum);
    put(out, d.block_square);
    put(out, d.paths);
    put(out, d.light_paths);
    put(out, d.vertices);
    put(out, d.visits);
    return out;
}

Result<TrainingData> parse_training_data(std::string_view bytes) {
    Header header;
    const Header expected;
    if (bytes.size() < sizeof header) return data_loss("the training data are cut short");
    std::memcpy(&header, bytes.data(), sizeof header);
    bytes.remove_prefix(sizeof header);
    if (std::memcmp(header.magic, expected.magic, sizeof header.magic) != 0)
        return data_loss("these are not training data of a known version");
    if (header.blocks_x < 1 || header.blocks_y < 1 || header.blocks_x > 65536 || header.blocks_y > 65536)
        return data_loss("the training data have no frame");
    const uint64_t blocks = uint64_t(header.blocks_x) * uint64_t(header.blocks_y);
    const uint64_t limit = bytes.size();
    if (blocks > limit || header.path_count > limit || header.light_path_count > limit || header.vertex_count > limit ||
        header.visit_count > limit || header.has_squares > 1 ||
        (1 + header.has_squares) * blocks * sizeof(double) + header.visit_count * sizeof(TrainingVisit) +
                (header.path_count + header.light_path_count) * sizeof(TrainingPath) +
                header.vertex_count * sizeof(TrainingVertex) !=
            limit)
        return data_loss("the training data have the wrong size");
    TrainingData d;
    d.blocks_x = header.blocks_x, d.blocks_y = header.blocks_y;
    d.samples = header.samples, d.light_samples = header.light_samples;
    take(bytes, blocks, &d.block_sum);
    take(bytes, header.has_squares * blocks, &d.block_square);
    take(bytes, header.path_count, &d.paths);
    take(bytes, header.light_path_count, &d.light_paths);
    take(bytes, header.vertex_count, &d.vertices);
    take(bytes, header.visit_count, &d.visits);
    return d;
}

}  // namespace lightloom
