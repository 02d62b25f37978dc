// The plan, the spec's digest and file lists.

#include "common/work/job.h"
#include "common/work/service.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>

#include "common/scene/scene.h"
#include "common/transport/renderer.h"
#include "common/work/asset.h"
#include "common/work/golden.h"
#include "common/work/service.h"
#include "tests/support/algorithm_of.h"
#include "tests/support/estimates.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

FrameLayout frame(int width, int height) { return {width, height, {0, 0, width, height}}; }

/// A columns x rows cut of a window, uneven on purpose.
std::vector<Rect> cut(const Rect& crop, int columns, int rows) {
    std::vector<Rect> tiles;
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
            tiles.push_back({crop.x0 + crop.width() * i / columns, crop.y0 + crop.height() * j / rows,
                             crop.x0 + crop.width() * (i + 1) / columns, crop.y0 + crop.height() * (j + 1) / rows});
        }
    }
    return tiles;
}

class TempDirectory {
  public:
    TempDirectory() {
        std::string name = (fs::temp_directory_path() / "lightloom-test-XXXXXX").string();
        path = ::mkdtemp(name.data());
    }
    ~TempDirectory() { fs::remove_all(path); }
    fs::path path;
};

TEST(TimeLimit, IsLongEnoughToBeOfUse) {
    for (const double seconds : {0.0, 0.001, 1.0, 30 * 86400.0}) EXPECT_TRUE(check_time_limit(seconds).ok()) << seconds;
    for (const double seconds : {1e-300, 0.00099, -1.0, 30 * 86401.0, double(INFINITY), double(NAN)}) {
        const Status status = check_time_limit(seconds);
        EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << seconds;
        EXPECT_NE(status.message().find("is not from 0.001 s to 30 days"), std::string::npos) << status.message();
    }
}

TEST(Plan, TilesCoverTheCropExactlyOnce) {
    for (const FrameLayout& f : {frame(64, 64), frame(512, 512), frame(1280, 720), frame(1921, 1083), frame(3, 5000),
                                 frame(5000, 3), FrameLayout{1920, 1080, {100, 200, 1333, 1007}}}) {
        const Plan plan(f, testing::algorithm_of("bdpt"));
        int64_t area = 0;
        std::vector<Rect> seen;
        for (const WorkUnit& unit : plan.units(plan.group(0))) {
            const Rect& tile = unit.render.tile;
            EXPECT_FALSE(tile.empty());
            for (const Rect& other : seen) {
                const bool apart = tile.x1 <= other.x0 || other.x1 <= tile.x0 || tile.y1 <= other.y0 || other.y1 <= tile.y0;
                EXPECT_TRUE(apart);
            }
            seen.push_back(unit.render.tile);
            area += unit.render.tile.area();
        }
        EXPECT_EQ(area, f.crop.area());
        EXPECT_EQ(seen.size(), plan.tile_count());
    }
}

TEST(Plan, SmallFramesAreOneTileAndLargeTilesAreLarge) {
    EXPECT_EQ(Plan(frame(512, 512), PlanOptions{}).tile_count(), 1u);
    EXPECT_EQ(Plan(frame(1920, 1080), PlanOptions{.whole_frame = true}).tile_count(), 1u);
    const Plan plan(frame(1920, 1080), PlanOptions{});
    for (const WorkUnit& unit : plan.units(plan.group(0))) {
        EXPECT_GE(unit.render.tile.width(), 256);
        EXPECT_GE(unit.render.tile.height(), 256);
        EXPECT_LE(unit.render.tile.area(), 3 << 17);
    }
}

TEST(Plan, GroupsGrowByAtMostFivePercentUpToTheCap) {
    for (const FrameLayout& f : {frame(64, 64), frame(160, 90), frame(1024, 576), frame(1920, 1080)}) {
        const Plan plan(f, PlanOptions{.light_paths_per_iteration = 64 * 64}),
            same(f, PlanOptions{.light_paths_per_iteration = 64 * 64});
        uint64_t done = 0;
        for (uint32_t i = 0; i < 2000; ++i) {
            const Group group = plan.group(i);
            ASSERT_EQ(group.index, i);
            ASSERT_EQ(group.first_iteration, done);
            ASSERT_GE(group.iteration_count, 1u);
            ASSERT_LE(group.iteration_count, std::max<uint64_t>(1, done / 20));
            ASSERT_LE(group.iteration_count, plan.max_group_iterations());
            ASSERT_EQ(same.group(i).iteration_count, group.iteration_count) << "a pure function";
            done += group.iteration_count;
        }
        EXPECT_EQ(plan.group(1999).iteration_count, plan.max_group_iterations());
        for (const WorkUnit& unit : plan.units(plan.group(1999)))
            EXPECT_LE(unit.render.tile.area() * unit.render.iteration_count, int64_t(1) << 22);
    }
}

/// Bytes of traffic and time of the coordinator go with units and groups: a large frame must not have one for every iteration.
TEST(Plan, LongJobsHaveLongUnitsAndSmallFramesNoLongerOnesThanTheyNeed) {
    const auto cap = [](const FrameLayout& f, const PlanOptions& options) { return Plan(f, options).max_group_iterations(); };
    EXPECT_EQ(cap(frame(64, 64), {}), 64u);
    EXPECT_EQ(cap(frame(160, 90), {}), 32u);
    EXPECT_EQ(cap(frame(512, 512), {}), 16u);
    EXPECT_EQ(cap(frame(1024, 576), {}), 28u);
    EXPECT_EQ(cap(frame(1024, 576), {.shares_light_paths = true}), 14u);
    EXPECT_EQ(cap(frame(1920, 1080), {}), 16u);
    EXPECT_EQ(cap(frame(1920, 1080), {.whole_frame = true}), 8u);
    EXPECT_LE(Plan(frame(1024, 576), PlanOptions{}).group_count(1000), 115u);
    EXPECT_EQ(Plan(frame(1024, 576), PlanOptions{}).group(0).iteration_count, 1u) << "the first preview comes soon";
}

TEST(Plan, BatchesDivideAUnitAndItsLightPaths) {
    const RenderUnit small{.iteration_count = 4, .tile = {0, 0, 256, 256}, .light_path_count = 7};
    EXPECT_EQ(small.batch_iterations(), 4u);
    EXPECT_EQ(small.batch(0), small);
    EXPECT_EQ((RenderUnit{.iteration_count = 2, .tile = {0, 0, 4000, 4000}}.batch_iterations()), 1u) << "one at least";
    for (const uint64_t paths : {uint64_t(0), uint64_t(1), uint64_t(17), uint64_t(31) * 256 * 256, uint64_t(1) << 62}) {
        RenderUnit unit{.first_iteration = 100,
                        .iteration_count = 31,
                        .group_first_iteration = 100,
                        .tile = {256, 0, 512, 256},
                        .first_light_path = 5,
                        .light_path_count = paths};
        uint32_t done = 0;
        uint64_t next = unit.first_light_path;
        while (done < unit.iteration_count) {
            const RenderUnit batch = unit.batch(done);
            EXPECT_EQ(batch.iteration_count, done < 28 ? 4u : 3u);
            EXPECT_EQ(batch.first_iteration, 100 + done);
            EXPECT_EQ(batch.group_first_iteration, 100 + done) << "a group of its own";
            EXPECT_EQ(batch.tile, unit.tile);
            EXPECT_EQ(batch.first_light_path, next);
            EXPECT_EQ(batch.batch(0), batch);
            next += batch.light_path_count;
            done += batch.iteration_count;
        }
        EXPECT_EQ(next, unit.first_light_path + paths);
    }
}

TEST(Plan, BoundedGroupsAreAPrefixOfTheUnboundedOnes) {
    const Plan plan(frame(100, 80), PlanOptions{.light_paths_per_iteration = 4000});
    for (const uint64_t iterations : {1, 2, 19, 20, 21, 57, 400, 4001}) {
        const std::vector<Group> groups = plan.groups_for(iterations);
        uint64_t sum = 0;
        for (size_t i = 0; i < groups.size(); ++i) {
            const Group open = plan.group(uint32_t(i));
            EXPECT_EQ(groups[i].first_iteration, open.first_iteration);
            EXPECT_LE(groups[i].iteration_count, open.iteration_count);
            EXPECT_TRUE(i + 1 == groups.size() || groups[i].iteration_count == open.iteration_count);
            sum += groups[i].iteration_count;
        }
        EXPECT_EQ(sum, iterations);
        EXPECT_EQ(plan.group_count(iterations), groups.size());
    }
    // What a time-limited job keeps is a number of whole groups: asking for that many iterations makes the same groups.
    uint64_t prefix = 0;
    for (uint32_t i = 0; i < 60; ++i) {
        prefix += plan.group(i).iteration_count;
        const std::vector<Group> again = plan.groups_for(prefix);
        ASSERT_EQ(again.size(), i + 1);
        EXPECT_EQ(again.back().iteration_count, plan.group(i).iteration_count);
    }
}

TEST(Plan, LightPathSharesSumToTheTotalAndFollowTheArea) {
    for (const Rect& crop : {Rect{0, 0, 1234, 777}, Rect{13, 57, 640, 481}, Rect{0, 0, 7, 5}}) {
        const std::vector<Rect> tiles = cut(crop, 7, 5);
        const auto area = uint64_t(crop.area());
        for (const uint64_t per_iteration : {uint64_t(0), uint64_t(1), area / 3, area, 20 * area + 1}) {
            for (const uint32_t iterations : {1u, 3u, 64u}) {
                const auto units = split_group({4, 100, iterations}, tiles, {.light_paths_per_iteration = per_iteration});
                ASSERT_EQ(units.size(), 35u);
                const uint64_t total = per_iteration * iterations;
                uint64_t next = 0;
                for (const WorkUnit& unit : units) {
                    EXPECT_EQ(unit.render.first_light_path, next);
                    next += unit.render.light_path_count;
                    const double share = double(total) * double(unit.render.tile.area()) / double(area);
                    EXPECT_NEAR(double(unit.render.light_path_count), share, 1);
                }
                EXPECT_EQ(next, total);
            }
        }
    }
}

TEST(Plan, OneLightPathPerPixelGivesEveryTileItsArea) {
    for (const WorkUnit& unit : split_group({0, 0, 3}, cut({5, 5, 700, 400}, 7, 5), {.light_paths_per_iteration = 695 * 395}))
        EXPECT_EQ(unit.render.light_path_count, uint64_t(3 * unit.render.tile.area()));
}

/// The weights of every group reckon with L1 light paths per iteration: no group may have one more or less, or its image would be
/// too bright or too dark by that much.
TEST(Plan, EveryGroupHasExactlyTheLightPathsThatItsWeightsCountOn) {
    for (const FrameLayout& f : {frame(64, 64), frame(3, 5), frame(1280, 720), FrameLayout{1920, 1080, {100, 200, 1333, 1007}}}) {
        for (const AlgorithmInfo* row : catalog()) {
            for (const char* per_pixel : {"0.001", "0.3", "2.7"}) {
                AlgorithmSettings settings = testing::algorithm_of(std::string(row->name));
                if (settings.has("light-paths"))
                    settings = testing::algorithm_of(std::string(row->name), {{"light-paths", per_pixel}});
                const uint64_t l1 = settings.light_paths_per_iteration(f.crop.area());
                EXPECT_EQ(l1 > 0, row->light_paths_per_pixel != nullptr) << row->name << ": at least one where there are any";
                const Plan plan(f, settings);
                for (const Group& group : plan.groups_for(150)) {
                    uint64_t next = 0;
                    for (const WorkUnit& unit : plan.units(group)) {
                        EXPECT_EQ(unit.render.first_light_path, next);
                        next += unit.render.light_path_count;
                    }
                    ASSERT_EQ(next, l1 * group.iteration_count) << row->name << ", group " << group.index;
                }
            }
        }
    }
}

/// What the row says about its units is what the units are.
TEST(Plan, UnitsHaveTheShapeThatTheOptionsSay) {
    const FrameLayout f = frame(1280, 720);
    for (const bool whole : {false, true}) {
        for (const bool splats_only : {false, true}) {
            const Plan plan(f, {.light_paths_per_iteration = 9, .whole_frame = whole, .splats_only = splats_only});
            EXPECT_EQ(plan.tile_count() == 1, whole);
            for (const WorkUnit& unit : plan.units(plan.group(40))) {
                EXPECT_EQ(unit.render.tile == f.crop, whole);
                EXPECT_EQ(unit.render.splats_only, splats_only);
                EXPECT_EQ(unit.render.samples_per_pixel(), splats_only ? 0 : unit.render.iteration_count);
            }
            // A large frame that cannot be cut has groups of several iterations in the end, so that not every one costs a partial.
            EXPECT_EQ(plan.max_group_iterations(), whole ? 8u : 27u);
        }
    }
}

TEST(Plan, UnitsOfTrainingSayWhichRoundTheyAreOf) {
    const TrainingWork work{kTrainingUnitSamples, 2 * kTrainingUnitSamples + 5, 4 * kTrainingUnitSamples};
    const Plan plan = Plan::training(UnitKind::kTraining, 3, work);
    ASSERT_EQ(plan.group_count(work.sample_count), 3u);
    uint64_t next = work.first_sample;
    for (uint32_t i = 0; i < 3; ++i) {
        const auto units = plan.units(plan.group(i));
        ASSERT_EQ(units.size(), 1u);
        EXPECT_EQ(units[0].key, (UnitKey{i, 0, UnitKind::kTraining, 3}));
        EXPECT_EQ(units[0].training.first_sample, next);
        EXPECT_EQ(units[0].training.total_samples, work.total_samples);
        next += units[0].training.sample_count;
    }
    EXPECT_EQ(next, work.first_sample + work.sample_count);
}

/// Late units have many times the samples of early ones.
TEST(JobInfo, ProgressCountsSamplesAndNotUnits) {
    JobInfo job;
    job.state = JobState::kRunning;
    job.unit_total = 10, job.unit_done = 8;
    job.spec.samples_per_pixel = 100;
    job.spec.frame = frame(20, 10);
    job.spec.algorithm = testing::algorithm_of("bdpt");
    EXPECT_EQ(rendered_share(job), 0);
    job.camera_samples = 25 * 200;
    job.light_paths = 99 * 200;
    EXPECT_DOUBLE_EQ(rendered_share(job), 0.25);
    job.spec.algorithm = testing::algorithm_of("light");
    job.camera_samples = 0;
    job.light_paths = 40 * job.spec.algorithm.light_paths_per_iteration(200);
    EXPECT_DOUBLE_EQ(rendered_share(job), 0.4) << "no camera samples at all";
    job.spec.samples_per_pixel = 0;
    EXPECT_EQ(sample_share(job), 0) << "nobody knows how many there will be";
}

TEST(JobSpec, DigestChangesWithEverythingThatChangesTheImageAndOnlyThat) {
    JobSpec spec;
    spec.frame = frame(64, 48);
    spec.max_depth = 5;
    const Digest base = spec.spec_digest();
    JobSpec other = spec;
    other.samples_per_pixel = 99;
    other.time_limit_seconds = 3;
    EXPECT_EQ(other.spec_digest(), base);
    const auto differs = [&](auto change) {
        JobSpec changed = spec;
        change(changed);
        EXPECT_NE(changed.spec_digest(), base);
    };
    differs([](JobSpec& s) { s.algorithm = testing::algorithm_of("bdpt"); });
    differs([](JobSpec& s) { s.algorithm = s.algorithm.with("rr-start", 7); });
    differs([](JobSpec& s) { s.seed = 1; });
    differs([](JobSpec& s) { s.max_depth = 6; });
    differs([](JobSpec& s) { s.scene_root.bytes[3] = 1; });
    differs([](JobSpec& s) { s.frame.crop.x1 = 63; });
    differs([](JobSpec& s) { s.frame.width = 65; });
}

TEST(AssetPath, OnlyPlainRelativePathsTravel) {
    for (const char* good : {"a", "a/b.ply", "a b/c", "..a/b..", "\xc3\xa4/x"}) EXPECT_TRUE(validate_asset_path(good).ok()) << good;
    for (const char* bad : {"", "/a", "../a", "a/../b", "a/./b", "a//b", "a/", ".", "..", "a\\b", "a\nb", "a\x7f", "caf\xe9.pbrt",
                            "\xc3", "\xc0\xaf", "\xed\xa0\x80", "\xf5\x80\x80\x80"})
        EXPECT_FALSE(validate_asset_path(bad).ok()) << bad;
    EXPECT_FALSE(validate_asset_path(std::string(300, 'x')).ok());
    EXPECT_FALSE(validate_asset_path(std::string_view("a\0b", 3)).ok());
}

TEST(AssetManifest, CanonicalTextIsTheOnlyOneAccepted) {
    const TempDirectory directory;
    fs::create_directories(directory.path / "meshes");
    std::ofstream(directory.path / "scene.pbrt") << "Camera";
    std::ofstream(directory.path / "meshes/a.ply") << "ply";
    const auto manifest = AssetManifest::of_files(directory.path, {"scene.pbrt", "meshes/a.ply", "scene.pbrt"});
    ASSERT_TRUE(manifest.ok());
    ASSERT_EQ(manifest->entries.size(), 2u);
    EXPECT_EQ(manifest->main, "scene.pbrt");
    const std::string text = manifest->canonical_text();
    const auto again = AssetManifest::parse(text);
    ASSERT_TRUE(again.ok()) << again.status().message();
    EXPECT_EQ(again->root(), manifest->root());
    EXPECT_FALSE(AssetManifest::parse(text + "x").ok());
    EXPECT_FALSE(AssetManifest::parse(text.substr(0, text.size() - 1)).ok());
    for (size_t i = 0; i < text.size(); ++i) {
        std::string changed = text;
        changed[i] = changed[i] == '/' ? '\n' : '/';
        const auto parsed = AssetManifest::parse(changed);
        if (parsed.ok()) {
            EXPECT_EQ(parsed->canonical_text(), changed);
        }
    }
    // What is left out is part of the scene.
    const auto without = AssetManifest::of_files(directory.path, {"scene.pbrt", "meshes/a.ply"}, {"media", "bump", "media"});
    ASSERT_TRUE(without.ok());
    EXPECT_NE(without->root(), manifest->root());
    const auto parsed = AssetManifest::parse(without->canonical_text());
    ASSERT_TRUE(parsed.ok()) << parsed.status().message();
    EXPECT_EQ(parsed->without, (std::vector<std::string>{"bump", "media"}));
    EXPECT_EQ(parsed->entries.size(), 2u);
    for (const char* bad : {"", "media,bump", "bump,bump", "bump,", ",bump", "Bump", "bump media"}) {
        std::string changed = without->canonical_text();
        EXPECT_FALSE(AssetManifest::parse(changed.replace(changed.find("bump,media"), 10, bad)).ok()) << bad;
    }
    EXPECT_FALSE(AssetManifest::of_files(directory.path, {"../x"}).ok());
    EXPECT_EQ(AssetManifest::of_files(directory.path, {"none"}).status().code(), StatusCode::kNotFound);
}

/// A kind that no golden unit computes could differ between two hosts unseen.
TEST(Golden, ItsScenesHoldEveryKindOfMaterialTextureShapeAndLight) {
    const SceneDescription room = golden_scene(), court = golden_courtyard();
    const auto materials = [](MaterialKind kind) {
        return [kind](const SceneDescription& d) {
            return std::any_of(d.materials.begin(), d.materials.end(), [&](const Material& m) { return m.kind == kind; });
        };
    };
    for (int kind = 0; kind <= int(MaterialKind::kMix); ++kind)
        EXPECT_TRUE(materials(MaterialKind(kind))(room) || materials(MaterialKind(kind))(court)) << kind;
    for (int kind = 0; kind <= int(TextureKind::kImage); ++kind) {
        const auto is = [&](const TextureNode& t) { return t.kind == TextureKind(kind); };
        EXPECT_TRUE(std::any_of(room.textures.begin(), room.textures.end(), is) ||
                    std::any_of(court.textures.begin(), court.textures.end(), is))
            << kind;
    }
    EXPECT_FALSE(court.instances.empty() || court.spheres.empty() || court.meshes.empty());
    EXPECT_FALSE(court.point_lights.empty() || court.spot_lights.empty() || court.distant_lights.empty() ||
                 court.infinite_lights.empty() || court.infinite_lights[0].image == kNone);
    EXPECT_GT(court.camera.lens_radius, 0);
    EXPECT_NE(court.objects[0].meshes[0].attributes.alpha, kNone);
}

/// The sums of one unit by bdpt.
Digest unit_digest(SceneDescription description) {
    const std::shared_ptr<const Scene> scene = std::move(Scene::build(std::move(description))).value();
    const auto renderer = std::move(Renderer::create(scene, {testing::algorithm_of("bdpt"), 1, 6})).value();
    const Rect& crop = scene->frame().crop;
    const auto partial = renderer->render({.iteration_count = 4, .tile = crop, .light_path_count = uint64_t(crop.area()) * 4}, {});
    Sha256 hash;
    hash.update(partial->camera.data(), partial->camera.size() * sizeof(double));
    for (const SplatSum& s : partial->splats) hash.update(s.rgb.data(), sizeof s.rgb);
    return hash.finish();
}

/// What changes nothing proves nothing: each shape, light, texture, image and kind of material alone makes another unit.
TEST(Golden, EveryPartOfTheCourtyardShowsInItsUnit) {
    const SceneDescription court = golden_courtyard();
    const Digest whole = unit_digest(court);
    EXPECT_EQ(unit_digest(court), whole);
    const auto changes = [&](const std::string& what, const std::function<void(SceneDescription&)>& change) {
        SceneDescription other = court;
        change(other);
        EXPECT_NE(unit_digest(std::move(other)), whole) << what;
    };
    const auto each = [&](const char* what, auto list, auto change) {
        for (size_t i = 0; i < (court.*list).size(); ++i)
            changes(what + (" " + std::to_string(i)), [&](SceneDescription& d) { change((d.*list)[i]); });
    };
    using D = SceneDescription;
    each("mesh", &D::meshes, [](TriangleMesh& m) {
        for (Vec3& p : m.positions) p.x += 0.01f;
    });
    each("sphere", &D::spheres, [](Sphere& s) { s.radius *= 1.01f; });
    each("instance", &D::instances, [](Instance& i) { i.object_to_world = translation(0.01, 0, 0) * i.object_to_world; });
    each("emission", &D::emissions, [](AreaEmission& e) { e.radiance = e.radiance * 1.001f; });
    each("point light", &D::point_lights, [](PointLight& l) { l.intensity = l.intensity * 1.001f; });
    each("spot light", &D::spot_lights, [](SpotLight& l) { l.falloff_height *= 1.01f; });
    each("distant light", &D::distant_lights, [](DistantLight& l) { l.irradiance = l.irradiance * 1.001f; });
    each("infinite light", &D::infinite_lights, [](InfiniteLight& l) { l.radiance = l.radiance * 1.001f; });
    each("texture", &D::textures, [](TextureNode& t) {
        t.value = t.value * 1.01f, t.scale *= 1.05f, t.su *= 1.01f;
        if (t.kind == TextureKind::kMix || t.kind == TextureKind::kScale) t.b = t.a;
    });
    each("material", &D::materials, [](Material& m) {
        m.kind = m.kind == MaterialKind::kDielectric ? MaterialKind::kThinDielectric : MaterialKind::kDielectric;
    });
    each("image", &D::images, [](Image& i) {
        for (float& f : i.floats) f *= 1.05f;
        for (float& f : i.decode) f *= 1.05f;
    });
    changes("interpolated normals", [](SceneDescription& d) { d.meshes[1].normals.clear(); });
    changes("flipped normal", [](SceneDescription& d) { d.meshes[2].attributes.flip_normal = false; });
    changes("lens", [](SceneDescription& d) { d.camera.focal_distance *= 1.01f; });
}

/// Two ways of rendering it agree. (Not `path`: it misses what point lights send through the pane.)
TEST(Golden, LvcbptAndBdptAgreeOnTheCourtyard) {
    const std::shared_ptr<const Scene> scene = std::move(Scene::build(golden_courtyard())).value();
    testing::TestFamily family;
    std::vector<testing::RegionMeans> means;
    for (const char* algorithm : {"lvcbpt", "bdpt"})
        means.push_back(
            testing::replicate(testing::catalog_image(scene, algorithm, 6, 32), scene->frame().crop, 24, means.size() + 1));
    testing::compare(means[0], means[1], "lvcbpt and bdpt", &family);
    EXPECT_GT(family.size(), 5);
    family.check();
}

}  // namespace
}  // namespace lightloom
