// What `replay --paths` says of a sample: its sum is the sample's value to the last bit, its densities are those that the weights
// reckon with, whichever part of them the algorithm's view holds, and its JSON is what the schema says.

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "client/path_report.h"
#include "common/transport/training.h"
#include "tests/support/small_scenes.h"

namespace lightloom::client {
namespace {

using Json = nlohmann::json;

constexpr int kSize = 12;

/// A room with diffuse walls and a sphere of glass, whose lobes are Dirac's.
std::shared_ptr<const Scene> room() {
    testing::SceneBuilder builder = testing::cornell_builder(kSize);
    Material glass;
    glass.kind = MaterialKind::kDielectric;
    glass.ior = 1.5f;
    builder.sphere({-0.4f, 0.4f, -0.2f}, 0.3f, builder.add(glass));
    return builder.build();
}

RenderSettings settings_of(const std::string& name) {
    auto algorithm = *AlgorithmSettings::parse(name, {});
    if (algorithm.has("training-paths")) algorithm = algorithm.with("training-paths", 2000);
    if (algorithm.has("cache")) algorithm = algorithm.with("cache", 200);
    return {.algorithm = algorithm, .seed = 3, .max_depth = 5};
}

RenderUnit unit_of(const Scene& scene, const RenderSettings& settings) {
    const Rect crop = scene.frame().crop;
    return {.first_iteration = 2,
            .iteration_count = 1,
            .group_first_iteration = 2,
            .tile = crop,
            .light_path_count = settings.algorithm.light_paths_per_iteration(crop.area()),
            .splats_only = !settings.algorithm.info().camera_samples};
}

struct Seen {
    Partial partial;
    std::map<uint32_t, std::vector<ReportedPath>> camera;  // by pixel
    std::vector<ReportedPath> splats;
};

Seen watch(const std::string& name, const std::shared_ptr<const Scene>& scene,
           const std::function<void(const SeenContribution&, const ReportedPath&)>& check = {}) {
    const RenderSettings settings = settings_of(name);
    const auto renderer = create_with_tables(scene, settings, {});
    EXPECT_TRUE(renderer.ok()) << renderer.status().message();
    Seen seen;
    auto partial = (*renderer)->watch(unit_of(*scene, settings),
                                      [&](const SeenContribution& c) {
                                          ReportedPath path = report_path(*scene, c);
                                          if (check) check(c, path);
                                          if (c.found.technique.splats())
                                              seen.splats.push_back(std::move(path));
                                          else
                                              seen.camera[c.pixel].push_back(std::move(path));
                                      },
                                      {});
    EXPECT_TRUE(partial.ok()) << partial.status().message();
    seen.partial = *std::move(partial);
    return seen;
}

TEST(PathReport, SumsAreTheSamplesToTheLastBit) {
    const auto scene = room();
    for (const AlgorithmInfo* row : catalog()) {
        const Seen seen = watch(std::string(row->name), scene);
        ASSERT_FALSE(seen.camera.empty() && seen.splats.empty()) << row->name;
        for (uint32_t pixel = 0; pixel < uint32_t(kSize * kSize) && row->camera_samples; ++pixel) {
            SampleReport report{.response = {.exposure = double(1.7f)}};
            if (const auto paths = seen.camera.find(pixel); paths != seen.camera.end()) report.paths = paths->second;
            const auto sum = report.sum();
            for (size_t c = 0; c < 3; ++c) EXPECT_EQ(sum[c], double(1.7f) * seen.partial.camera[3 * pixel + c]) << row->name;
        }
        std::map<uint32_t, double> splats;
        for (const ReportedPath& path : seen.splats) splats[uint32_t(path.y * kSize + path.x)] += double(path.weighted.g);
        for (const SplatSum& splat : seen.partial.splats) EXPECT_DOUBLE_EQ(splats[splat.pixel], splat.rgb[1]) << row->name;
    }
}

TEST(PathReport, VerticesAreThoseOfTheWholePath) {
    const auto scene = room();
    for (const AlgorithmInfo* row : catalog()) {
        watch(std::string(row->name), scene, [&](const SeenContribution& c, const ReportedPath& path) {
            const size_t k = size_t(path.k);
            ASSERT_EQ(path.vertices.size(), k + 1);
            EXPECT_EQ(path.vertices[k].kind, "lens");
            EXPECT_TRUE(path.vertices[0].kind.ends_with("light")) << path.vertices[0].kind;
            EXPECT_GE(path.vertices[0].emitter, 0);
            EXPECT_EQ(path.source_measure, "area");
            EXPECT_EQ(std::isnan(path.next_event), k == 1);
            for (size_t i = 0; i < k; ++i) {
                const ReportedVertex& v = path.vertices[i];
                EXPECT_TRUE(v.fwd >= 0 && v.rev >= 0 && std::isfinite(v.fwd) && std::isfinite(v.rev)) << row->name << " x" << i;
                EXPECT_GT(v.survival, 0);
                EXPECT_LE(v.survival, 1);
                EXPECT_EQ(v.dirac, v.kind == "dielectric") << row->name << " x" << i;
                EXPECT_FALSE(v.dirac && (i == 0));
            }
            EXPECT_EQ(path.technique, c.found.technique);
            EXPECT_EQ(path.t, c.found.t);
        });
    }
}

TEST(PathReport, DensitiesAreThoseThatTheWeightsReckonWith) {
    const auto scene = room();
    // These algorithms fill in the whole view.
    for (const std::string name : {"bdpt", "lvcbpt", "spcbpt", "light"}) {
        watch(name, scene, [&](const SeenContribution& c, const ReportedPath& path) {
            for (int i = 0; i < path.k; ++i) {
                EXPECT_EQ(path.vertices[size_t(i)].fwd, c.view.fwd[i]) << name << " x" << i << " of " << path.k;
                EXPECT_EQ(path.vertices[size_t(i)].rev, c.view.rev[i]) << name << " x" << i << " of " << path.k;
                EXPECT_EQ(path.vertices[size_t(i)].dirac, c.view.delta[i]);
            }
        });
    }
    // `path` fills in what lies next to the light; its camera sub-paths are those of bdpt.
    const Seen path = watch("path", scene), bdpt = watch("bdpt", scene);
    size_t compared = 0;
    for (const auto& [pixel, found] : path.camera) {
        for (const ReportedPath& a : found) {
            for (const ReportedPath& b : bdpt.camera.at(pixel)) {
                const bool same = a.technique == b.technique && a.k == b.k && a.vertices[0].position == b.vertices[0].position;
                if (!same) continue;
                ++compared;
                for (size_t i = 0; i + 1 < a.vertices.size(); ++i) {
                    EXPECT_EQ(a.vertices[i].fwd, b.vertices[i].fwd) << to_string(a.technique.kind) << " x" << i << " of " << a.k;
                    EXPECT_EQ(a.vertices[i].rev, b.vertices[i].rev) << to_string(a.technique.kind) << " x" << i << " of " << a.k;
                    EXPECT_EQ(a.vertices[i].dirac, b.vertices[i].dirac);
                }
            }
        }
    }
    EXPECT_GT(compared, size_t(kSize * kSize));
}

TEST(PathReport, OnlyAlgorithmsWithSubspacesHaveLabels) {
    const auto scene = room();
    for (const AlgorithmInfo* row : catalog()) {
        size_t light = 0, eye = 0;
        watch(std::string(row->name), scene, [&](const SeenContribution&, const ReportedPath& path) {
            for (const ReportedVertex& v : path.vertices) {
                light += v.light_label >= 0, eye += v.eye_label >= 0;
                EXPECT_LT(v.light_label, 20000);
                EXPECT_LT(v.eye_label, 20000);
            }
            EXPECT_EQ(path.vertices.back().light_label, -1);
            EXPECT_EQ(path.vertices.front().eye_label, -1);
        });
        EXPECT_EQ(light > 0, row->name == "spcbpt") << row->name;
        EXPECT_EQ(eye > 0, row->name == "spcbpt") << row->name;
    }
}

TEST(PathReport, JsonSaysWhatTheSchemaSays) {
    const auto scene = room();
    const Seen seen = watch("spcbpt", scene);
    SampleReport report{.algorithm = "spcbpt", .iteration = 2, .x = 3, .y = 4, .group = 2, .splats_of_unit = true};
    for (const auto& [pixel, paths] : seen.camera)
        if (paths.size() > report.paths.size()) report.paths = paths;
    report.splats = {seen.splats.front()};
    report.camera = report.sum();
    const Json json = Json::parse(to_json(report));
    EXPECT_EQ(json["camera"], json["sum"]);
    EXPECT_EQ(json["pixel"], Json({3, 4}));
    ASSERT_EQ(json["paths"].size(), report.paths.size());
    const std::string schema = kPathSchema;
    const auto in_schema = [&](const Json& object) {
        for (const auto& [key, value] : object.items()) EXPECT_NE(schema.find(key), std::string::npos) << key;
    };
    in_schema(json);
    for (const char* list : {"paths", "splats"}) {
        for (const Json& path : json[list]) {
            in_schema(path);
            EXPECT_EQ(path["k"].get<size_t>() + 1, path["vertices"].size());
            for (int c = 0; c < 3; ++c)
                EXPECT_EQ(float(path["value"][c].get<double>()) * float(path["weight"].get<double>()),
                          float(path["weighted"][c].get<double>()));
            for (const Json& vertex : path["vertices"]) in_schema(vertex);
            EXPECT_TRUE(path["vertices"].back()["fwd"].is_null());
        }
    }
    // What is not finite has no number in JSON, and shows in the text.
    report.paths.front().value.g = std::numeric_limits<float>::infinity();
    report.paths.front().weighted.g = std::numeric_limits<float>::quiet_NaN();
    const Json broken = Json::parse(to_json(report));
    EXPECT_TRUE(broken["paths"][0]["value"][1].is_null());
    EXPECT_TRUE(broken["sum"][1].is_null());
    EXPECT_NE(to_text(report).find("nan"), std::string::npos);
    report.splats.clear();
    report.splats_left_out = true;
    EXPECT_TRUE(Json::parse(to_json(report))["splats"].is_null());
    EXPECT_NE(to_text(report).find("--splats"), std::string::npos);
}

TEST(PathReport, AnInfiniteLightIsADirection) {
    testing::SceneBuilder builder;
    builder.description().film.width = builder.description().film.height = kSize;
    builder.sphere({0, 0, 2}, 0.5f, builder.diffuse({0.5f, 0.5f, 0.5f}));
    builder.look({0, 0, 0}, {0, 0, 1}, 60);
    InfiniteLight sky;
    sky.radiance = {1, 1, 2};
    builder.description().infinite_lights = {sky};
    const auto scene = builder.build();
    size_t hits = 0, next_events = 0;
    for (const std::string name : {"path", "lvcbpt"}) {
        watch(name, scene, [&](const SeenContribution&, const ReportedPath& path) {
            EXPECT_EQ(path.source_measure, "solid angle");
            EXPECT_EQ(path.vertices[0].kind, "environment");
            EXPECT_NEAR(length(path.vertices[0].normal), 1, 1e-4);
            hits += path.technique.kind == TechniqueKind::kHit, next_events += path.technique.s == 1;
            for (int i = 0; i < path.k; ++i) EXPECT_TRUE(std::isfinite(path.vertices[size_t(i)].rev));
        });
    }
    EXPECT_GT(hits, 0u);
    EXPECT_GT(next_events, 0u);
}

}  // namespace
}  // namespace lightloom::client
