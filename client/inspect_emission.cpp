#include "client/inspect_emission.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

namespace lightloom::client {
namespace {

constexpr size_t kStrongest = 5;
/// Probabilities that differ by less are taken for equal.
constexpr double kSame = 0.01;

struct LightShare {
    uint32_t light = 0;             ///< Index into SceneSummary::lights.
    double learned = 0, power = 0;  ///< Probability that a light sub-path leaves it.
};

struct EmissionStatistics {
    size_t emitters = 0;  ///< Whose probability is not that by power.
    size_t places = 0;    ///< Emitters with a density of places.
    size_t finite_cells = 0, infinite_cells = 0, directional_cells = 0;
    size_t leaves = 0;  ///< Of all densities together.
    std::vector<LightShare> strongest;
};

size_t leaves_of(const std::vector<EmissionData::Node>& nodes) {
    return size_t(std::count_if(nodes.begin(), nodes.end(), [](const EmissionData::Node& n) { return n.axis() == 3; }));
}

EmissionStatistics measure(const EmissionData& d, const Scene& scene) {
    EmissionStatistics s;
    const std::vector<Emitter>& emitters = scene.emitters().all();
    std::vector<LightShare> lights(scene.summary().lights.size());
    for (size_t i = 0; i < lights.size(); ++i) lights[i].light = uint32_t(i);
    for (size_t e = 0; e < emitters.size(); ++e) {
        const double power = double(emitters[e].pmf);
        const double learned = double(d.power_places) * power + (1 - double(d.power_places)) * double(d.emitters[e]);
        const double mixed = double(d.power_share) * power + (1 - double(d.power_share)) * learned;
        s.emitters += std::fabs(mixed - power) > kSame * power;
        s.places += d.places[e] != kUniformSquare;
        LightShare& light = lights[size_t(emitters[e].light)];
        light.learned += mixed, light.power += power;
    }
    s.finite_cells = leaves_of(d.finite), s.infinite_cells = leaves_of(d.infinite);
    for (const EmissionData::Cell& cell : d.cells) s.directional_cells += cell.root != kUniformSquare;
    for (const SquareNode& node : d.squares) s.leaves += size_t(std::count(std::begin(node.child), std::end(node.child), 0u));
    const size_t count = std::min(kStrongest, lights.size());
    std::partial_sort(lights.begin(), lights.begin() + std::ptrdiff_t(count), lights.end(), [](const auto& a, const auto& b) {
        return a.learned != b.learned ? a.learned > b.learned : a.light < b.light;
    });
    s.strongest.assign(lights.begin(), lights.begin() + std::ptrdiff_t(count));
    return s;
}

}  // namespace

nlohmann::ordered_json describe_emission(const EmissionData& d, const Scene& scene) {
    nlohmann::ordered_json out;
    out["learned"] = d.learned();
    if (!d.learned()) return out;
    const EmissionStatistics s = measure(d, scene);
    nlohmann::ordered_json strongest = nlohmann::ordered_json::array();
    for (const LightShare& l : s.strongest) {
        const SceneSummary::Light& light = scene.summary().lights[l.light];
        strongest.push_back({{"kind", light.kind}, {"where", light.where}, {"probability", l.learned}, {"by_power", l.power}});
    }
    out["emitters"] = {{"count", scene.emitters().all().size()}, {"learned", s.emitters}, {"with_places", s.places}};
    out["cells"] = {{"finite", s.finite_cells}, {"infinite", s.infinite_cells}, {"with_directions", s.directional_cells}};
    out["leaves"] = s.leaves;
    out["by_power"] = {{"all", d.power_share}, {"places", d.power_places}, {"directions", d.power_directions}};
    out["strongest_lights"] = std::move(strongest);
    return out;
}

void print_emission(const EmissionData& d, const Scene& scene) {
    if (!d.learned()) {
        std::printf("  emission   by power: nothing was learned\n");
        return;
    }
    const EmissionStatistics s = measure(d, scene);
    std::printf("  emission   %.0f %% by power; of the rest %.0f %% of the places and %.0f %% of the directions\n",
                100 * double(d.power_share), 100 * double(d.power_places), 100 * double(d.power_directions));
    std::printf("    learned  %zu of %zu emitters, places on %zu; directions of %zu of %zu cells; %zu leaves\n", s.emitters,
                scene.emitters().all().size(), s.places, s.directional_cells, s.finite_cells + s.infinite_cells, s.leaves);
    for (const LightShare& l : s.strongest) {
        const SceneSummary::Light& light = scene.summary().lights[l.light];
        std::printf("    %-11s %5.1f %% of the light sub-paths, by power %5.1f %%%s%s\n", light.kind.c_str(), 100 * l.learned,
                    100 * l.power, light.where.empty() ? "" : ", ", light.where.c_str());
    }
}

}  // namespace lightloom::client
