// The production loop around the algorithms: the same bytes however a unit is run, samples that
// belong to pixels and not to tiles, and non-finite samples that are dropped, counted and recorded.

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <limits>
#include <mutex>
#include <set>
#include <thread>

#include "common/transport/light_cache.h"
#include "tests/support/row_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::expect_identical;
using testing::frame_of;
using testing::has_cache;
using testing::render;
using testing::row_settings;
using testing::SceneBuilder;
using testing::whole_frame;

/// Pairs of triangles in the very same place with different materials: which one a ray reports must
/// not depend on anything.
std::shared_ptr<const Scene> coplanar_duplicates() {
    SceneBuilder b = testing::cornell_builder();
    const MaterialId blue = b.diffuse({0.1f, 0.2f, 0.8f}), yellow = b.diffuse({0.8f, 0.7f, 0.1f});
    b.quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, blue);
    b.quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, yellow);
    b.quad({-0.7f, 0.6f, 0.1f}, {0, 0, 0.5f}, {0.5f, 0, 0}, yellow);
    b.quad({-0.3f, 1.99f, -0.3f}, {0.6f, 0, 0}, {0, 0, 0.6f}, blue, b.emission({1, 2, 15}));
    return b.build();
}

TEST(Determinism, OneTwoAndEightThreadsMakeTheSameBytes) {
    tbb::global_control allowance(tbb::global_control::max_allowed_parallelism, 8);
    for (const auto make : {testing::diffuse_box, testing::environment_lit, coplanar_duplicates}) {
        // The scene is built twice: its acceleration structure must come out the same.
        const auto scene = make(), again = make();
        for (const AlgorithmInfo* row : catalog()) {
            const RenderUnit work = frame_of(*scene, *row, 4);
            Partial alone;
            tbb::task_arena(1).execute([&] { alone = render(scene, *row, work); });
            EXPECT_EQ(alone.samples_per_pixel, row->camera_samples ? 4u : 0u) << row->name;
            EXPECT_TRUE(check_partial(alone, scene->frame()).ok()) << row->name;
            // Chunks are dealt to threads as these become free, so repeated runs take them in
            // different orders.
            for (const int threads : {2, 8, 8, 8}) {
                Partial partial;
                tbb::task_arena(threads).execute([&] { partial = render(threads == 2 ? again : scene, *row, work); });
                expect_identical(alone, partial, std::string(row->name) + " on " + std::to_string(threads) + " threads");
            }
        }
    }
}

TEST(Determinism, SeedsAndIterationsMakeDifferentSamples) {
    const auto scene = testing::diffuse_box();
    for (const AlgorithmInfo* row : catalog()) {
        const RenderUnit work = frame_of(*scene, *row, 1);
        const Partial a = render(scene, *row, work), b = render(scene, *row, work, 6);
        EXPECT_TRUE(a.camera != b.camera || a.splats != b.splats) << row->name;
        // Camera samples are keyed by their iteration, and light paths by their number.
        if (!row->camera_samples || row->traces == Traces::kLight) continue;
        RenderUnit later = work;
        later.first_iteration = 1;
        EXPECT_NE(a.camera, render(scene, *row, later).camera) << row->name;
    }
}

/// A prepared algorithm that asks for it has a new state in every iteration, and no light sub-path twice: a unit is the sum of its
/// iterations.
TEST(Determinism, StatesOfIterationsAreIndependent) {
    const auto scene = testing::diffuse_box();
    const AlgorithmInfo& row = **find_algorithm("stub-anew");
    constexpr uint32_t kIterations = 3;
    const RenderUnit work = frame_of(*scene, row, kIterations);
    const Partial whole = render(scene, row, work);
    const uint64_t paths = work.light_path_count / kIterations;
    std::vector<double> camera(whole.camera.size(), 0.0);
    std::vector<Partial> parts;
    for (uint32_t b = 0; b < kIterations; ++b) {
        RenderUnit alone = work;
        alone.first_iteration = b, alone.iteration_count = 1;
        alone.first_light_path = b * paths, alone.light_path_count = paths;
        parts.push_back(render(scene, row, alone));
        for (size_t i = 0; i < camera.size(); ++i) camera[i] += parts.back().camera[i];
    }
    EXPECT_EQ(camera, whole.camera);
    EXPECT_EQ(whole.light_paths, work.light_path_count);
    EXPECT_EQ(whole.counters.light_paths, work.light_path_count);
    EXPECT_NE(parts[0].splats, parts[1].splats);
}

/// Notes where the light sub-paths of every state begin.
struct NotingAlgorithm {
    static constexpr bool kPerIteration = true;
    std::vector<double>* starts;
    uint64_t paths;

    template <class Contribute>
    int prepare(const UnitScope& scope, UnitPreparation* preparation, Contribute&&) const {
        const LightCache cache = trace_light_cache(
            scope, paths, preparation, [](PathVertex*, int) {}, [](const PathVertex*, int, Vec2, uint64_t, auto&) {});
        for (const LightCache::Path& path : cache.paths) starts->push_back(double(cache.at(path.first_vertex)->p.x));
        return 0;
    }
    template <class Contribute>
    void trace(SampleContext&, int, Contribute&&) const {}
    float weight(int, const PathView&, Technique) const { return 1; }
};

/// Those that are counted, and those that fill a cache beside them.
TEST(Determinism, IterationsShareNoLightSubPath) {
    const auto scene = testing::diffuse_box();
    constexpr uint32_t kIterations = 3;
    constexpr uint64_t kPaths = 40;
    std::vector<double> starts;
    const RenderUnit work = whole_frame(*scene, kIterations, 10);
    ASSERT_TRUE(render_unit(NotingAlgorithm{&starts, kPaths}, *scene, 3, 6, {}, work, {}).ok());
    EXPECT_EQ(starts.size(), kIterations * kPaths);
    EXPECT_EQ(std::set<double>(starts.begin(), starts.end()).size(), starts.size());

    RenderUnit uneven = work;
    uneven.light_path_count += 1;
    const Status refused = render_unit(NotingAlgorithm{&starts, kPaths}, *scene, 3, 6, {}, uneven, {}).status();
    EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument);
    EXPECT_NE(refused.message().find("every iteration"), std::string::npos) << refused.message();
}

/// Notes the keys of every sample and of what is made for its batch.
struct KeysAlgorithm {
    struct Notes {
        std::mutex mutex;
        std::vector<RenderUnit> prepared;
        std::set<std::pair<uint64_t, uint32_t>> samples;      ///< Iteration and pixel.
        std::set<std::pair<uint64_t, uint64_t>> light_paths;  ///< First iteration of the group and number in it.
    };
    Notes* notes;

    template <class Contribute>
    int prepare(const UnitScope& scope, UnitPreparation*, Contribute&&) const {
        notes->prepared.push_back(scope.work);
        return 0;
    }
    template <class Contribute>
    void trace(SampleContext& context, int, Contribute&& contribute) const {
        {
            const std::lock_guard lock(notes->mutex);
            notes->samples.insert({context.iteration, context.pixel});
            notes->light_paths.insert({context.group_iteration, context.light_path});
        }
        PathView view;
        contribute(PathContribution{.value = Rgb(1.0f), .technique = Technique::hit()}, view);
        const Vec2 film{float(context.px) + 0.5f, float(context.py) + 0.5f};
        contribute(PathContribution{.value = Rgb(2.0f), .technique = Technique::lens(2), .film = film}, view);
    }
    float weight(int, const PathView&, Technique) const { return 1; }
};

/// A unit that is longer than a batch: nothing is left out or made twice, and what an algorithm keeps it keeps for a batch.
TEST(Units, AreRenderedInBatches) {
    const auto scene = testing::diffuse_box();
    const auto area = uint64_t(scene->frame().crop.area());
    const auto per_batch = uint32_t(uint64_t(RenderUnit::kBatchSamples) / area);
    const uint32_t iterations = per_batch + 3;
    RenderUnit work = whole_frame(*scene, iterations, area);
    work.first_iteration = work.group_first_iteration = 50;
    KeysAlgorithm::Notes notes;
    const Result<Partial> partial = render_unit(KeysAlgorithm{&notes}, *scene, 3, 6, {}, work, {});
    ASSERT_TRUE(partial.ok());
    ASSERT_EQ(notes.prepared.size(), 2u);
    EXPECT_EQ(notes.prepared[0], work.batch(0));
    EXPECT_EQ(notes.prepared[1], work.batch(per_batch));
    EXPECT_EQ(notes.samples.size(), iterations * area);
    EXPECT_EQ(notes.samples.begin()->first, 50u);
    EXPECT_EQ(notes.samples.rbegin()->first, 50u + iterations - 1);
    EXPECT_EQ(notes.light_paths.size(), iterations * area);
    EXPECT_EQ(partial->samples_per_pixel, iterations);
    EXPECT_EQ(partial->light_paths, iterations * area);
    EXPECT_EQ(partial->counters.camera_samples, iterations * area);
    ASSERT_EQ(partial->splats.size(), area);
    for (size_t p = 0; p < area; ++p) {
        EXPECT_EQ(partial->camera[3 * p], iterations);
        EXPECT_EQ(partial->splats[p].rgb[0], 2 * iterations);
    }
}

/// Holds every sample until a second thread has come, or for ten seconds.
struct MeetingAlgorithm {
    std::mutex* mutex;
    std::set<std::thread::id>* threads;
    template <class Contribute>
    void trace(SampleContext&, Contribute&&) const {
        const auto arrived = [&] {
            std::lock_guard lock(*mutex);
            threads->insert(std::this_thread::get_id());
            return threads->size();
        };
        for (int i = 0; i < 10000 && arrived() < 2; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    float weight(const PathView&, Technique) const { return 1; }
};

/// Building a scene on one thread must leave the others to rendering.
TEST(Units, AreRenderedOnAllThreads) {
    const auto scene = testing::diffuse_box();
    tbb::global_control allowance(tbb::global_control::max_allowed_parallelism, 2);
    std::mutex mutex;
    std::set<std::thread::id> threads;
    RenderUnit work = whole_frame(*scene, 1, 0);
    work.tile = {0, 0, 32, 4};
    tbb::task_arena(2).execute([&] {
        EXPECT_TRUE(render_unit(MeetingAlgorithm{&mutex, &threads}, *scene, 0, 6, {}, work, {}).ok());
    });
    EXPECT_EQ(threads.size(), 2u);
}

/// Not finite at one pixel of one iteration, and in every splat that pixel makes.
struct BrokenAlgorithm {
    uint32_t pixel;
    uint64_t iteration;
    template <class Contribute>
    void trace(SampleContext& context, Contribute&& contribute) const {
        PathView view;
        const bool broken = context.pixel == pixel && context.iteration == iteration;
        const Vec2 film{float(context.px) + 0.5f, float(context.py) + 0.5f};
        contribute(PathContribution{.value = Rgb(broken ? std::numeric_limits<float>::infinity() : 2.0f),
                                    .technique = Technique::lens(2),
                                    .film = film},
                   view);
        const float green = broken ? std::numeric_limits<float>::quiet_NaN() : 1.0f;
        contribute(PathContribution{.value = {1, green, 1}, .technique = Technique::hit()}, view);
    }
    float weight(const PathView&, Technique) const { return 1; }
};

TEST(NonFinite, SamplesAreDroppedCountedAndRecorded) {
    const auto scene = testing::diffuse_box();
    const uint32_t pixel = 333;
    RenderUnit work = whole_frame(*scene, 4, uint64_t(scene->frame().crop.area()));
    work.first_iteration = 10;
    const Result<Partial> partial = render_unit(BrokenAlgorithm{pixel, 12}, *scene, 0, 6, {}, work, {});
    ASSERT_TRUE(partial.ok());
    EXPECT_EQ(partial->dropped_count, 2u);
    ASSERT_EQ(partial->dropped.size(), 2u);
    EXPECT_EQ(partial->dropped[0], (DroppedSample{12, pixel, false}));
    EXPECT_EQ(partial->dropped[1], (DroppedSample{12, pixel, true}));
    for (uint32_t p = 0; p < uint32_t(scene->frame().crop.area()); ++p) {
        EXPECT_EQ(partial->camera[3 * p], p == pixel ? 3 : 4);
        EXPECT_EQ(partial->splats[p].rgb[0], p == pixel ? 6 : 8);
    }
    EXPECT_TRUE(check_partial(*partial, scene->frame()).ok());
}

/// The same of an algorithm with loops of its own: what it hands to its sink.
struct BrokenOwned {
    uint32_t pixel;  ///< Row-major in the tile.

    void run(const UnitScope& scope, UnitSink& sink) const {
        sink.open(2);
        sink.camera(1, pixel, scope.work.first_iteration, {1, std::numeric_limits<float>::quiet_NaN(), 1});
        sink.camera(0, pixel, scope.work.first_iteration, Rgb(1.0f));
        sink.splat(1, pixel, scope.work.first_iteration, Rgb(std::numeric_limits<float>::infinity()));
        sink.splat(1, pixel, scope.work.first_iteration, Rgb(2.0f));
    }
};

TEST(NonFinite, SamplesOfOwnLoopsAreDroppedCountedAndRecorded) {
    const auto scene = testing::diffuse_box();
    RenderUnit work = whole_frame(*scene, 1, 0);
    work.tile = {4, 6, 12, 10};
    work.first_iteration = 7;
    const uint32_t pixel = 8 * 2 + 3, in_crop = uint32_t(scene->frame().crop.index(4 + 3, 6 + 2));
    const Result<Partial> partial = render_unit(BrokenOwned{pixel}, *scene, 0, 6, {}, work, {});
    ASSERT_TRUE(partial.ok());
    EXPECT_EQ(partial->dropped_count, 2u);
    ASSERT_EQ(partial->dropped.size(), 2u);
    EXPECT_EQ(partial->dropped[0], (DroppedSample{7, in_crop, false}));
    EXPECT_EQ(partial->dropped[1], (DroppedSample{7, pixel, true}));
    EXPECT_EQ(partial->camera[3 * pixel], 1);
    ASSERT_EQ(partial->splats.size(), 1u);
    EXPECT_EQ(partial->splats[0].rgb[0], 2);
}

/// Records are bounded, the count is not.
struct NeverFinite {
    template <class Contribute>
    void trace(SampleContext&, Contribute&& contribute) const {
        PathView view;
        contribute(PathContribution{.value = Rgb(std::numeric_limits<float>::infinity())}, view);
    }
    float weight(const PathView&, Technique) const { return 1; }
};

TEST(NonFinite, RecordsAreBounded) {
    const auto scene = testing::diffuse_box();
    const Result<Partial> partial = render_unit(NeverFinite{}, *scene, 0, 6, {}, whole_frame(*scene, 2, 0), {});
    ASSERT_TRUE(partial.ok());
    EXPECT_EQ(partial->dropped_count, 2 * uint64_t(scene->frame().crop.area()));
    EXPECT_EQ(partial->dropped.size(), Partial::kMaxDroppedRecords);
}

TEST(Units, OutsideTheFrameOrCancelledAreRefused) {
    const auto scene = testing::diffuse_box();
    std::stop_source stop;
    stop.request_stop();
    for (const AlgorithmInfo* row : catalog()) {
        const auto renderer = create_with_tables(scene, row_settings(*row), {});
        ASSERT_TRUE(renderer.ok()) << row->name;
        RenderUnit work = frame_of(*scene, *row, 1);
        const auto partial = (*renderer)->render(work, stop.get_token());
        ASSERT_FALSE(partial.ok()) << row->name;
        EXPECT_EQ(partial.status().code(), StatusCode::kCancelled) << row->name;
        for (const Rect tile : {Rect{0, 0, 33, 4}, Rect{-1, 0, 4, 4}, Rect{4, 4, 4, 8}}) {
            work.tile = tile;
            EXPECT_EQ((*renderer)->render(work, {}).status().code(), StatusCode::kInvalidArgument) << row->name;
        }
    }
}

/// What is shown one by one adds up to what is rendered.
TEST(Units, ShowEveryContribution) {
    const auto scene = testing::diffuse_box();
    const Rect crop = scene->frame().crop;
    for (const AlgorithmInfo* row : catalog()) {
        const auto renderer = create_with_tables(scene, row_settings(*row), {});
        ASSERT_TRUE(renderer.ok()) << row->name;
        const RenderUnit work = frame_of(*scene, *row, 2);
        std::vector<double> camera(size_t(crop.area()) * 3, 0.0), splats = camera;
        uint64_t seen = 0;
        const auto see = [&](const SeenContribution& c) {
            ++seen;
            EXPECT_LT(c.pixel, uint32_t(crop.area()));
            const Rgb value = c.found.value * float(c.weight);
            double* sum = &(c.found.technique.splats() ? splats : camera)[3 * size_t(c.pixel)];
            sum[0] += value.r, sum[1] += value.g, sum[2] += value.b;
        };
        const auto watched = (*renderer)->watch(work, see, {}), rendered = (*renderer)->render(work, {});
        ASSERT_TRUE(watched.ok() && rendered.ok()) << row->name;
        expect_identical(*watched, *rendered, std::string(row->name));
        if (seen == 0) continue;  // loops of its own
        for (size_t i = 0; i < camera.size(); ++i)
            ASSERT_NEAR(camera[i], rendered->camera[i], 1e-5 * rendered->camera[i]) << row->name;
        for (const SplatSum& s : rendered->splats)
            for (size_t c = 0; c < 3; ++c) ASSERT_NEAR(splats[3 * s.pixel + c], s.rgb[c], 1e-5 * s.rgb[c]) << row->name;
    }
}

/// Ground that fills the view under a sky of radiance 1 shows its albedo, whatever the size of the
/// primitive that it is made of: where a ray leaves it must not depend on how near its other end
/// is. (Spheres of radius 1000 once came out 20 % too dark, tilted triangles of size 100 by 24 %:
/// they shadowed themselves.)
TEST(SelfIntersection, LargeGroundShowsItsAlbedo) {
    testing::TestFamily family;
    const auto test = [&](SceneBuilder& b, const std::string& what) {
        b.description().film.width = b.description().film.height = 16;
        b.description().infinite_lights.push_back({.radiance = Rgb(1.0f)});
        const auto scene = b.build();
        for (const AlgorithmInfo* row : catalog()) {
            // Light sub-paths of so large a scene rarely come into view.
            if (row->traces == Traces::kLight || !row->camera_samples || has_cache(*row)) continue;
            const std::string algorithm(row->name);
            const auto image = testing::catalog_image(scene, algorithm, 5, 4);
            const testing::RegionMeans means = testing::replicate(image, scene->frame().crop, 16, 77);
            const testing::Sample sample(means.values[0]);
            family.add(testing::one_sample_p_value(sample, 0.5), what + " " + algorithm + ": " + std::to_string(sample.mean));
        }
    };
    for (const float size : {10.0f, 100.0f, 1000.0f, 10000.0f, 1e6f}) {
        SceneBuilder sphere;
        sphere.sphere({0, -size, 0}, size, sphere.diffuse(Rgb(0.5f)));
        sphere.look({0, 1, -0.01f}, {0, 0, 0}, 40);
        test(sphere, "sphere " + std::to_string(size));
        SceneBuilder tilted;
        const Vec3 a = normalize(Vec3{0.8f, 0.53f, 0.21f}), n = normalize(cross(Vec3{0.1f, -0.2f, 1}, a)), c = cross(a, n);
        tilted.quad(a * -size - c * (1.3f * size), c * (2 * size), a * (2.1f * size), tilted.diffuse(Rgb(0.5f)));
        tilted.look(n * (n.y > 0 ? 1.0f : -1.0f), {0, 0, 0}, 40);
        test(tilted, "triangle " + std::to_string(size));
    }
    family.check();
}

/// With rr-min=1 nothing ends a path in a closed white box but its length.
TEST(Roulette, CanBeSwitchedOff) {
    SceneBuilder b;
    b.description().film.width = b.description().film.height = 8;
    b.room({-1, -1, -1}, {1, 1, 1}, b.diffuse(Rgb(1.0f)));
    b.look({0, 0, -0.9f}, {0, 0, 1}, 80);
    const auto scene = b.build();
    const RenderSettings settings = testing::settings_of("path", {{"rr-min", "1"}, {"rr-start", "2"}}, 3, 20);
    const auto renderer = Renderer::create(scene, settings);
    ASSERT_TRUE(renderer.ok());
    const Result<Partial> partial = (*renderer)->render(whole_frame(*scene, settings.algorithm, 4), {});
    ASSERT_TRUE(partial.ok());
    EXPECT_EQ(partial->counters.vertices, partial->counters.camera_samples * 21);
}

/// Every pixel of a view of nothing but the sky holds its radiance, whichever technique an escaped first ray is taken for.
TEST(Means, TheSkyAloneFillsEveryPixel) {
    SceneBuilder b;
    b.description().film.width = b.description().film.height = 16;
    b.description().infinite_lights.push_back({.radiance = Rgb(0.5f)});
    b.sphere({0, 0, -50}, 0.01f, b.diffuse(Rgb(0.5f)));  // behind the camera
    b.look({0, 0, 0}, {0, 0, 1}, 60);
    const auto scene = b.build();
    for (const AlgorithmInfo* row : catalog()) {
        if (!row->camera_samples) continue;  // how many samples a pixel has is random then
        for (const double v : testing::catalog_image(scene, std::string(row->name), 5, 2)(3))
            EXPECT_NEAR(v, 0.5, 1e-6) << row->name;
    }
}

/// All algorithms in a few seconds; tests/statistical does the same per path length on many scenes.
TEST(Means, OfAllAlgorithmsAgree) {
    testing::TestFamily family;
    for (const auto make : {testing::diffuse_box, testing::environment_lit}) {
        const auto scene = make();
        const Rect crop = scene->frame().crop;
        const auto rows = catalog();
        std::vector<testing::RegionMeans> estimates;
        for (const AlgorithmInfo* row : rows)
            estimates.push_back(testing::replicate(testing::catalog_image(scene, std::string(row->name), 5, 8), crop, 32,
                                                   1000 * (estimates.size() + 1)));
        for (size_t i = 0; i < rows.size(); ++i) {
            const std::string what = std::string(rows[i]->name) + " and the next";
            EXPECT_TRUE(testing::compare(estimates[i], estimates[(i + 1) % rows.size()], what, &family)) << what;
        }
    }
    family.check();
}

}  // namespace
}  // namespace lightloom
