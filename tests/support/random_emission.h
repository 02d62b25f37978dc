#pragma once
// Emission tables without any knowledge: random emitters, places, directions and crossings. No image's mean may depend
// on them.

#include "common/core/rng.h"
#include "common/scene/emitter.h"
#include "common/scene/scene.h"

namespace lightloom::testing {

inline uint32_t random_square(Rng& rng, EmissionData* data, int depth = 0) {
    const uint32_t index = uint32_t(data->squares.size());
    data->squares.emplace_back();
    double shares[4], sum = 0;
    for (double& s : shares) sum += s = 0.05 + rng.uniform_double();
    for (int q = 0; q < 4; ++q) {
        data->squares[index].share[q] = float(shares[q] / sum);
        if (depth < 4 && rng.uniform() < 0.5f) {
            const uint32_t child = random_square(rng, data, depth + 1);
            data->squares[index].child[q] = child;
        }
    }
    return index;
}

/// A tree whose thresholds lie between -1 and 1 on every axis, with cells of its own.
inline std::vector<EmissionData::Node> random_places(Rng& rng, const Vec3& centre, float radius, EmissionData* data) {
    std::vector<EmissionData::Node> nodes(1);
    for (uint32_t i = 0; i < nodes.size(); ++i) {
        if (nodes.size() < 12) {
            const uint32_t left = uint32_t(nodes.size());
            nodes[i] = EmissionData::make_inner(rng.below(3), 2 * rng.uniform() - 1, left);
            nodes.resize(nodes.size() + 2);
        } else {
            nodes[i] = EmissionData::make_leaf(uint32_t(data->cells.size()));
            EmissionData::Cell cell;
            if (rng.uniform() < 0.8f) cell.root = random_square(rng, data);
            const auto offset = [&] { return radius * (rng.uniform() - 0.5f); };
            cell.pivot = centre + Vec3{offset(), offset(), offset()};
            cell.half = radius * (0.2f + rng.uniform());
            data->cells.push_back(cell);
        }
    }
    return nodes;
}

/// A valid table for the emitters of a scene within this ball.
inline EmissionData random_emission(const EmitterSet& emitters, uint64_t seed, const Vec3& centre, float radius) {
    Rng rng({seed, Stage::kTraining, 78, 0});
    EmissionData data;
    data.power_share = kLeastPowerShare + 0.3f * rng.uniform();
    data.power_places = 0.5f * rng.uniform(), data.power_directions = 0.5f * rng.uniform();
    double sum = 0;
    std::vector<double> weights;
    for (size_t e = 0; e < emitters.all().size(); ++e) sum += weights.emplace_back(rng.uniform() < 0.2f ? 0 : rng.uniform_double());
    for (const double w : weights) {
        data.emitters.push_back(float(sum > 0 ? w / sum : 1.0 / double(weights.size())));
        data.places.push_back(rng.uniform() < 0.7f ? random_square(rng, &data) : kUniformSquare);
    }
    data.finite = random_places(rng, centre, radius, &data);
    data.infinite = random_places(rng, centre, radius, &data);
    return data;
}

/// The scene with light that leaves by such a table.
inline std::shared_ptr<const Scene> randomly_lit(const std::shared_ptr<const Scene>& scene, uint64_t seed) {
    auto table = std::make_shared<const EmissionTable>(random_emission(scene->emitters(), seed, {0, 1, 0}, 3.5f));
    return {scene->with_emission(std::move(table)).release(), [scene](const Scene* s) { delete s; }};
}

}  // namespace lightloom::testing
