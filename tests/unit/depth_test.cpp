// Connections by depth: what weights and training make of "first,later" is, for every vertex, what they make of its number alone.
// (A weight that took another number would keep every mean.) That the estimator draws as many is draw_test and table_fuzz_test.

#include <gtest/gtest.h>

#include "tests/support/path_generator.h"
#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using Parameters = std::map<std::string, std::string>;

constexpr int kEdges = 5;

/// Weights of one path with 4 connections at the first hit and 2 later ones, with 4 everywhere, and with 2.
struct Three {
    std::unique_ptr<PathWeights> by_depth, four, two;
};

Three weights_of(const AlgorithmInfo& row, const std::shared_ptr<const Scene>& scene, const Parameters& changes) {
    const std::string name(row.name);
    const Tables tables = testing::random_tables_for(row, *scene, 5);
    const auto make = [&](const char* connections) {
        Parameters parameters = testing::with_small_training(name, changes);
        parameters["connections"] = connections;
        const auto renderer = Renderer::create(scene, testing::settings_of(name, parameters), tables);
        if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
        return (*renderer)->weights();
    };
    return {make("4,2"), make("4"), make("2")};
}

/// Mutations: LearnedAffinity, SubspaceSelection::OnPath::connections() or UniformSelection with one number for all vertices fail
/// this.
TEST(ConnectionsByDepth, WeightsKnowTheNumberOfEachVertex) {
    const auto scene = testing::glossy();
    int rows = 0;
    for (const AlgorithmInfo* row : catalog()) {
        const AlgorithmSettings defaults = testing::settings_of(std::string(row->name)).algorithm;
        if (!defaults.has("connections")) continue;
        ++rows;
        std::vector<Parameters> variants{{}};
        if (defaults.has("ris-aware")) variants.insert(variants.end(), {{{"ris-aware", "off"}}, {{"ris-aware", "on"}}});
        for (const char* heuristic : {"balance", "correlation-aware"}) variants.push_back({{"heuristic", heuristic}});
        for (const Parameters& changes : variants) {
            const Three weights = weights_of(*row, scene, changes);
            int first = 0, later = 0, different = 0;
            testing::for_each_path(
                *scene, 200, kEdges, 3,
                [&](const testing::FullPath&, Technique, const PathView& view, const Rgb&) {
                    if (view.k < 2) return;
                    for (int s = 0; s <= view.k; ++s)
                        for_each_technique_of_split(s, view.k, [&](Technique t) {
                            if (!can_connect(view, s)) return;
                            const double four = weights.four->sigma(view, t), two = weights.two->sigma(view, t);
                            const bool at_first = view.k + 1 - s == 2;
                            EXPECT_EQ(weights.by_depth->sigma(view, t), at_first ? four : two) << row->name << ", s = " << s;
                            ++(at_first ? first : later);
                            different += four != two;
                            EXPECT_TRUE(t.kind == TechniqueKind::kConnect || four == two) << row->name;
                        });
                },
                weights.by_depth.get());
            EXPECT_GT(std::min({first, later, different}), 100) << row->name;
        }
    }
    EXPECT_GE(rows, 2);
}

TrainingData traced(const Scene& scene, const std::string& connections, const Tables& guide = {}) {
    const RenderSettings settings = testing::settings_of("spcbpt", {{"connections", connections}}, 3, kEdges - 1);
    return testing::trace_training(scene, settings, {0, 500, 500}, guide);
}

/// The pilot traces the same paths whatever the number of connections, and notes the densities that the render will have.
/// Mutation: RenderToCome with one number fails this.
TEST(ConnectionsByDepth, TrainingDataHaveTheCorrectionOfEachVertex) {
    const auto scene = testing::glossy();
    const TrainingData by_depth = traced(*scene, "16,1"), many = traced(*scene, "16"), few = traced(*scene, "1");
    ASSERT_EQ(by_depth.vertices.size(), many.vertices.size());
    ASSERT_EQ(by_depth.vertices.size(), few.vertices.size());
    int first = 0, later = 0;
    for (const TrainingPath& path : by_depth.paths)
        for (uint32_t s = 1; s + 1 < path.vertex_count; ++s) {
            const uint32_t v = path.first_vertex + s;
            const bool at_first = path.vertex_count - s == 2;
            const float a = many.vertices[v].density, b = few.vertices[v].density;
            EXPECT_EQ(by_depth.vertices[v].density, at_first ? a : b) << s << " of " << path.vertex_count;
            if (a != b) ++(at_first ? first : later);
        }
    EXPECT_GT(std::min(first, later), 20);
}

/// Four connections at the first hit and two later are the same to Gamma as one, at densities that are four and two times as large.
/// Mutation: gamma_dataset() with one number fails this.
TEST(ConnectionsByDepth, GammaIsTrainedForTheNumberOfEachVertex) {
    const auto scene = testing::glossy();
    const TrainingData data = traced(*scene, "1");
    TrainingData scaled = data;
    for (const TrainingPath& path : scaled.paths)
        for (uint32_t s = 1; s + 1 < path.vertex_count; ++s)
            scaled.vertices[path.first_vertex + s].density *= path.vertex_count - s == 2 ? 4 : 2;
    const auto learned = [&](const TrainingData& from, const ByDepth<int>& connections) {
        TrainingOptions options;
        options.light_subspaces = options.eye_subspaces = 20;
        options.connections = connections;
        TrainingReport report;
        const auto tables = train_tables(from, scene->emitters(), options, {}, &report);
        EXPECT_TRUE(tables.ok()) << tables.status().message();
        return tables.ok() ? serialize(*tables) : std::string();
    };
    const std::string right = learned(data, {4, 2});
    EXPECT_EQ(right, learned(scaled, 1));
    EXPECT_NE(right, learned(data, 4));
    EXPECT_NE(right, learned(data, 2));
}

}  // namespace
}  // namespace lightloom
