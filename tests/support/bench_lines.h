#pragma once
// Results of a benchmark that nobody measured: lines of the format "lightloom-bench 2" with errors by a known law.

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/core/rng.h"

namespace lightloom::testing {

using BenchLine = nlohmann::ordered_json;

inline BenchLine start_line() {
    return {{"type", "start"},
            {"format", "lightloom-bench 2"},
            {"suite", "made-up"},
            {"suite_digest", std::string(64, 'a')},
            {"suite_seconds", 0.0},
            {"utc", "2026-11-30T04:00:00Z"},
            {"build", "0.1.0+abc"},
            {"machine", {{"processor", "A <fast> one"}, {"logical_processors", 2}, {"memory_bytes", 25e9}, {"system", "Linux"}}},
            {"threads", 1},
            {"stability", false}};
}

/// `floor` 0: the reference's noise is not known.
inline BenchLine scene_line(const std::string& scene, double floor) {
    BenchLine line{{"type", "scene"},
                   {"scene", scene},
                   {"file", "tests/scenes/" + scene + ".pbrt"},
                   {"scene_digest", "d-" + scene},
                   {"width", 16},
                   {"height", 12},
                   {"max_depth", 20},
                   {"claim", scene + " & its claim"},
                   {"reference", "r.exr"},
                   {"reference_digest", "r-" + scene},
                   {"reference_algorithm", "bdpt"},
                   {"reference_samples_per_pixel", 4096},
                   {"reference_image", scene + "-reference.exr"}};
    line["reference_regions"] = BenchLine::array();
    for (int i = 0; i < 10; ++i) line["reference_regions"].push_back({{"mean", 0.5}, {"variance", 1e-7}});
    if (floor > 0) line["reference_relmse"] = floor;
    return line;
}

/// A run whose relMSE, without the reference's noise, is `error` / n times a factor of the seed and of chance.
struct MadeRun {
    std::string scene, label;
    uint64_t seed = 1;
    double error = 1, seconds_per_iteration = 0.1, preparation = 0, floor = 0;
    int iterations = 100;
    double noise = 0;       ///< Of the logarithm of the error.
    bool finished = true;   ///< Otherwise it was killed.
    bool estimates = true;  ///< Groups were kept.

    std::vector<BenchLine> lines() const {
        std::vector<BenchLine> out;
        const std::string id = std::to_string(std::hash<std::string>{}(scene + "|" + label + "|" + std::to_string(seed)));
        Rng rng({seed, Stage::kCamera, std::hash<std::string>{}(scene + label), 0});
        const auto chance = [&] { return std::exp(noise * 3.46 * (rng.uniform_double() - 0.5)); };
        const double luck = chance();
        for (int n = 1;; n = std::min(iterations, std::max(n + 1, int(std::ceil(n * 1.25))))) {
            const double own = error / n * luck * chance();
            BenchLine line{{"type", "checkpoint"},
                           {"run", id},
                           {"scene", scene},
                           {"label", label},
                           {"algorithm", label.substr(0, label.find(':'))},
                           {"seed", seed},
                           {"threads", 1},
                           {"budget", {{"seconds", 10}}},
                           {"iterations", n},
                           {"groups", n},
                           {"seconds", n * seconds_per_iteration},
                           {"preparation_seconds", preparation},
                           {"mape_percent", 10 * std::sqrt(own)},
                           {"relmse", own + floor},
                           {"relmse_trimmed", (own + floor) * 0.9},
                           {"mean_ratio", 1.0},
                           {"dropped_samples", 0}};
            if (floor > 0) line["relmse_own"] = own;
            if (floor > 0 && own < 3 * floor) line["near_floor"] = true;
            if (estimates && n > 1) line["estimated_relmse"] = own * chance();
            out.push_back(std::move(line));
            if (n == iterations) break;
        }
        if (!finished) return out;
        BenchLine end = out.back();
        end["type"] = "run";
        end["region_means"] = BenchLine::array();
        for (int i = 0; i < 10; ++i) end["region_means"].push_back(0.5 + 0.001 * (rng.uniform_double() - 0.5));
        end["fireflies"] = {{"count", 0}, {"energy", 0.0}};
        end["image"] = scene + "-" + label + "-" + std::to_string(seed) + ".exr";
        out.push_back(std::move(end));
        return out;
    }
};

inline std::string text_of(const std::vector<BenchLine>& lines) {
    std::string out;
    for (const BenchLine& line : lines) out += line.dump() + "\n";
    return out;
}

}  // namespace lightloom::testing
