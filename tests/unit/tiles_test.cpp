// Tiles and crops: samples that belong to pixels and not to tiles, and means that know neither, for every row of the catalog.

#include <gtest/gtest.h>

#include "tests/support/row_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::frame_of;
using testing::has_cache;
using testing::render;
using testing::row_settings;
using testing::SceneBuilder;

/// What `replay` does: one pixel and iteration of a unit, with the whole unit's cache.
TEST(Tiles, ASampleOfACachedUnitCanBeRenderedAlone) {
    const auto scene = testing::diffuse_box();
    const Rect crop = scene->frame().crop;
    const Rect tile{3, 4, 8, 9};
    for (const AlgorithmInfo* row : catalog()) {
        if (!has_cache(*row) || row->frame != FrameShape::kTiles) continue;
        // Fewer counted paths than the cache holds, so that both kinds of keys matter.
        const RenderUnit unit{2, 2, 2, tile, 17, 20};
        for (const std::string& heuristic : testing::heuristics_of(*row)) {
            const testing::Parameters parameters{{"heuristic", heuristic}};
            const Partial whole = render(scene, *row, unit, 5, parameters);
            RenderUnit sample = unit;
            sample.owner_tile = tile;
            sample.tile = {5, 6, 6, 7};
            sample.iteration_count = 1;
            double sum[3] = {};
            for (const uint64_t iteration : {2, 3}) {
                sample.first_iteration = iteration;
                const Partial alone = render(scene, *row, sample, 5, parameters);
                for (size_t c = 0; c < 3; ++c) sum[c] += alone.camera[c];
            }
            for (size_t c = 0; c < 3; ++c)
                EXPECT_EQ(sum[c], whole.camera[3 * size_t((6 - 4) * tile.width() + (5 - 3)) + c]) << row->name << ", " << heuristic;
        }
        EXPECT_TRUE(crop.contains(5, 6));
    }
}

/// A camera sample is keyed by its pixel, not by its tile; with rows as tiles and one iteration, so is its light sub-path.
TEST(Tiles, HoldExactlyTheSamplesOfTheFrame) {
    const auto scene = testing::diffuse_box();
    const Rect crop = scene->frame().crop;
    for (const AlgorithmInfo* row : catalog()) {
        if (row->frame != FrameShape::kTiles || has_cache(*row)) continue;
        const Partial whole = render(scene, *row, frame_of(*scene, *row, 1));
        std::vector<double> splats(size_t(crop.area()) * 3, 0);
        for (int y0 = 0; y0 < crop.height(); y0 += 5) {
            const Rect rows{0, y0, crop.width(), std::min(y0 + 5, crop.height())};
            const uint64_t first = uint64_t(y0) * uint64_t(crop.width());
            const uint64_t paths = row->light_paths_per_pixel ? uint64_t(rows.area()) : 0;
            const Partial part = render(scene, *row, {0, 1, 0, rows, first, paths});
            EXPECT_EQ(std::memcmp(part.camera.data(), &whole.camera[3 * first], part.camera.size() * sizeof(double)), 0)
                << row->name;
            for (const SplatSum& s : part.splats)
                for (size_t c = 0; c < 3; ++c) splats[3 * s.pixel + c] += s.rgb[c];
        }
        // Splats of different tiles meet in a pixel, so their sum is the same up to the order of additions.
        for (const SplatSum& s : whole.splats)
            for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(splats[3 * s.pixel + c], s.rgb[c], 1e-12 * s.rgb[c]) << row->name;
    }
    // No sub-path of its own: any tiling, any number of iterations.
    for (const AlgorithmInfo* row : catalog()) {
        if (row->frame != FrameShape::kTiles || row->light_paths_per_pixel) continue;
        const Partial whole = render(scene, *row, frame_of(*scene, *row, 3));
        for (int y0 = 0; y0 < crop.height(); y0 += 5)
            for (int x0 = 0; x0 < crop.width(); x0 += 7) {
                const Rect tile{x0, y0, std::min(x0 + 7, crop.width()), std::min(y0 + 5, crop.height())};
                const Partial part = render(scene, *row, {0, 3, 0, tile, 0, 0});
                for (int64_t i = 0; i < tile.area(); ++i) {
                    const int64_t p = crop.index(tile.x0 + int(i % tile.width()), tile.y0 + int(i / tile.width()));
                    EXPECT_EQ(std::memcmp(&part.camera[size_t(3 * i)], &whole.camera[size_t(3 * p)], 3 * sizeof(double)), 0)
                        << row->name;
                }
            }
    }
}

/// N1 is a constant of the frame: a frame of 7 x 5 tiles, cut at its edges, has the mean of the undivided one.
TEST(Tiles, OfAnySizeKeepTheMean) {
    SceneBuilder b = testing::cornell_builder();
    b.description().film.width = 30;
    b.description().film.height = 22;
    const std::shared_ptr<const Scene> scene = b.build();
    const Rect crop = scene->frame().crop;
    constexpr uint32_t kIterations = 4;
    testing::TestFamily family;
    for (const AlgorithmInfo* row : catalog()) {
        if (row->frame != FrameShape::kTiles || !row->light_paths_per_pixel) continue;
        // Tables per tile, so they are poor ones, and caches of a few hundred paths.
        testing::Parameters poor;
        if (row_settings(*row).algorithm.has(kTrainingPaths)) poor["training-paths"] = "200";
        if (has_cache(*row)) poor["cache"] = "300";
        const uint64_t light_paths = frame_of(*scene, *row, kIterations).light_path_count;
        const auto tiled = [&](uint64_t seed) {
            Partial sum;
            sum.tile = crop;
            sum.camera.assign(size_t(crop.area()) * 3, 0);
            sum.samples_per_pixel = kIterations;
            int64_t pixels = 0;
            for (int y0 = 0; y0 < crop.height(); y0 += 5)
                for (int x0 = 0; x0 < crop.width(); x0 += 7) {
                    const Rect tile{x0, y0, std::min(x0 + 7, crop.width()), std::min(y0 + 5, crop.height())};
                    pixels += tile.area();
                    const uint64_t end = light_paths * uint64_t(pixels) / uint64_t(crop.area());
                    const Partial part =
                        render(scene, *row, {0, kIterations, 0, tile, sum.light_paths, end - sum.light_paths}, seed, poor);
                    sum.light_paths = end;
                    for (int64_t i = 0; i < tile.area(); ++i) {
                        const int64_t p = crop.index(tile.x0 + int(i % tile.width()), tile.y0 + int(i / tile.width()));
                        for (int64_t c = 0; c < 3; ++c) sum.camera[size_t(3 * p + c)] = part.camera[size_t(3 * i + c)];
                    }
                    sum.splats.insert(sum.splats.end(), part.splats.begin(), part.splats.end());
                }
            return testing::develop(sum, crop);
        };
        const std::string name(row->name);
        const auto whole = testing::catalog_image(scene, name, 5, kIterations);
        testing::compare(testing::replicate(whole, crop, 32, 100), testing::replicate(tiled, crop, 32, 200), name, &family);
    }
    family.check();
}

/// The crop renders what the frame shows there, camera samples and splats alike.
TEST(Tiles, ACropHasTheMeanOfItsPartOfTheFrame) {
    SceneBuilder full = testing::cornell_builder(), cropped = testing::cornell_builder();
    const int window[4] = {8, 24, 4, 20};
    std::copy(window, window + 4, cropped.description().film.crop);
    const std::shared_ptr<const Scene> a = full.build(), b = cropped.build();
    ASSERT_EQ(b->frame().crop, (Rect{8, 4, 24, 20}));
    testing::TestFamily family;
    for (const AlgorithmInfo* row : catalog()) {
        const std::string algorithm(row->name);
        const auto frame = testing::catalog_image(a, algorithm, 5, 8);
        const auto part_of_frame = [&](uint64_t seed) {
            const std::vector<double> image = frame(seed);
            std::vector<double> part;
            for (int y = 4; y < 20; ++y)
                for (int x = 8; x < 24; ++x) part.push_back(image[size_t(y * 32 + x)]);
            return part;
        };
        const Rect crop = b->frame().crop;
        testing::compare(testing::replicate(part_of_frame, crop, 32, 100),
                         testing::replicate(testing::catalog_image(b, algorithm, 5, 8), crop, 32, 200), algorithm, &family);
    }
    family.check();
}

}  // namespace
}  // namespace lightloom
