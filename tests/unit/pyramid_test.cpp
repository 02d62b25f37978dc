// The pictures of techniques: their sum is the image, they are normalised as it is, and the directory that they are written to is
// theirs alone.

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/pyramid.h"
#include "client/pyramid_render.h"
#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "common/film/grouped_sum.h"
#include "common/transport/unit_renderer.h"
#include "common/work/job.h"
#include "tests/support/small_scenes.h"
#include "tests/support/temp_directory.h"

namespace lightloom::client {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr FrameLayout kFrame{4, 3, {1, 0, 4, 3}};

/// A contribution that nobody found.
struct Made {
    PathContribution found;
    PathView view;

    Made(Technique technique, int k, const Rgb& value) {
        found.technique = technique;
        found.value = value;
        view.k = k;
    }
    SeenContribution seen(double weight, uint32_t pixel) const { return {found, view, weight, pixel, 0, false}; }
};

TEST(Pyramid, CameraSamplesAndSplatsHaveTheirOwnNumbers) {
    const Rect tile{2, 1, 4, 3};
    Pyramid pyramid(kFrame, 3);
    const Made connect(Technique::connect(2), 3, {1, 2, 4}), lens(Technique::lens(3), 3, {10, 0, 0});
    for (int group = 0; group < 2; ++group) {
        UnitPictures unit(kFrame.crop, tile, 3);
        unit.add(connect.seen(0.5, 4));  // (2, 1)
        unit.add(lens.seen(0.25, 0));    // outside of the tile
        pyramid.begin_group(2, 50);
        ASSERT_TRUE(pyramid.add(unit).ok());
        pyramid.end_group();
    }
    ASSERT_EQ(pyramid.keys().size(), 2u);
    EXPECT_EQ(pyramid.contributions(), 4u);
    const PyramidKey connected = pyramid.keys()[0], splatted = pyramid.keys()[1];
    EXPECT_EQ(connected.name(), "k3-s2-connect");
    EXPECT_EQ(splatted.name(), "k3-s3-lens");
    // One contribution in two iterations, and one in fifty light paths.
    EXPECT_FLOAT_EQ(pyramid.weighted(connected).pixels[3 * 4 + 2], 1.0f);
    EXPECT_FLOAT_EQ(pyramid.unweighted(connected).pixels[3 * 4 + 2], 2.0f);
    EXPECT_FLOAT_EQ(pyramid.weighted(splatted).pixels[0], 0.05f);
    EXPECT_FLOAT_EQ(pyramid.unweighted(splatted).pixels[0], 0.2f);
    EXPECT_EQ(pyramid.weighted(splatted).pixels[3 * 4], 0.0f);
}

TEST(Pyramid, LongerPathsShareAPictureForEachKind) {
    Pyramid pyramid(kFrame, 3);
    UnitPictures unit(kFrame.crop, kFrame.crop, 3);
    for (int s = 2; s < 7; ++s) unit.add(Made(Technique::connect(s), s + 2, {1, 1, 1}).seen(1, 0));
    unit.add(Made(Technique::next_event(), 9, {1, 1, 1}).seen(1, 0));
    pyramid.begin_group(1, 1);
    ASSERT_TRUE(pyramid.add(unit).ok());
    pyramid.end_group();
    const auto keys = pyramid.keys();
    ASSERT_EQ(keys.size(), 2u);
    EXPECT_EQ(keys[0].name(), "longer-next-event");
    EXPECT_EQ(keys[1].name(), "longer-connect");
    EXPECT_EQ(pyramid.weighted(keys[1]).pixels[0], 5.0f);
}

TEST(Pyramid, VarianceIsThatOfGroups) {
    Pyramid pyramid(kFrame, 3, {.exposure = 2});
    const double values[] = {1, 4, 2};
    const uint32_t iterations[] = {1, 2, 3};
    double n = 0, mean = 0, variance = 0;
    for (int g = 0; g < 3; ++g) {
        UnitPictures unit(kFrame.crop, kFrame.crop, 3);
        for (uint32_t i = 0; i < iterations[g]; ++i) unit.add(Made(Technique::hit(), 1, Rgb(float(values[g]))).seen(1, 5));
        pyramid.begin_group(iterations[g], 1);
        ASSERT_TRUE(pyramid.add(unit).ok());
        RgbImage black{3, 3, std::vector<float>(27)};
        EXPECT_EQ(std::isnan(pyramid.noise(pyramid.keys()[0], black)), g < 2) << "from complete groups alone";
        pyramid.end_group();
        n += iterations[g];
        mean += iterations[g] * values[g];
    }
    mean /= n;
    for (int g = 0; g < 3; ++g) variance += iterations[g] * (values[g] - mean) * (values[g] - mean) / (2 * n);
    const RgbImage image = pyramid.weighted(pyramid.keys()[0]);
    EXPECT_NEAR(image.pixels[3 * 5], 2 * mean, 1e-6);
    EXPECT_NEAR(pyramid.noise(pyramid.keys()[0], image), 4 * variance / (4 * mean * mean + 0.01) / 9, 1e-6);
}

TEST(Pyramid, WhatIsNotFiniteIsCounted) {
    Pyramid pyramid(kFrame, 3);
    UnitPictures unit(kFrame.crop, kFrame.crop, 3);
    unit.add(Made(Technique::hit(), 1, {HUGE_VALF, 0, 0}).seen(0, 0));
    unit.add(Made(Technique::hit(), 1, {1, 1, 1}).seen(NAN, 0));
    unit.add(Made(Technique::hit(), 1, {1, 1, 1}).seen(1, 0));
    pyramid.begin_group(1, 1);
    ASSERT_TRUE(pyramid.add(unit).ok());
    pyramid.end_group();
    EXPECT_EQ(pyramid.not_finite(), 2u);
    EXPECT_EQ(pyramid.unweighted(pyramid.keys()[0]).pixels[0], 1.0f);
}

TEST(Pyramid, MemoryIsBounded) {
    Pyramid pyramid(kFrame, 3, {}, 9 * 8 * sizeof(double));
    UnitPictures unit(kFrame.crop, kFrame.crop, 3);
    unit.add(Made(Technique::hit(), 1, {1, 1, 1}).seen(1, 0));
    pyramid.begin_group(1, 1);
    EXPECT_TRUE(pyramid.add(unit).ok());
    unit.add(Made(Technique::hit(), 2, {1, 1, 1}).seen(1, 0));
    const Status status = pyramid.add(unit);
    EXPECT_EQ(status.code(), StatusCode::kResourceExhausted);
    EXPECT_NE(status.message().find("--pyramid-depth"), std::string::npos);
}

/// A pyramid of real light, its image, and the frame.
struct Rendered {
    static constexpr FilmResponse kResponse{1.5, {{{1.2, -0.1, 0}, {0, 1, 0.1}, {0, 0.2, 0.7}}}};

    Rendered()
        : scene(testing::cornell_builder(20).build()),
          pyramid(scene->frame(), 4, kResponse),
          sums(scene->frame(), kResponse) {
        const RenderSettings settings{.algorithm = *AlgorithmSettings::parse("bdpt", {}), .seed = 1, .max_depth = 6};
        const auto renderer = Renderer::create(scene, settings);
        const Plan plan(scene->frame(), settings.algorithm);
        for (const Group& group : plan.groups_for(5)) {
            for (const WorkUnit& unit : plan.units(group)) {
                pyramid.begin_group(group.iteration_count, unit.render.light_path_count);
                UnitPictures pictures(scene->frame().crop, unit.render.tile, 4);
                const auto partial = (*renderer)->watch(unit.render, [&](const SeenContribution& seen) { pictures.add(seen); }, {});
                EXPECT_TRUE(sums.add(*partial).ok());
                EXPECT_TRUE(pyramid.add(pictures).ok());
            }
            EXPECT_TRUE(sums.fold(group.iteration_count).ok());
            pyramid.end_group();
        }
    }
    std::shared_ptr<const Scene> scene;
    Pyramid pyramid;
    GroupedSum sums;
};

TEST(Pyramid, WeightedPicturesSumToTheImage) {
    const Rendered rendered;
    const RgbImage image = rendered.sums.complete().develop();
    std::vector<double> sum(image.pixels.size());
    int longer = 0;
    for (const PyramidKey& key : rendered.pyramid.keys()) {
        const RgbImage picture = rendered.pyramid.weighted(key);
        ASSERT_EQ(picture.pixels.size(), sum.size());
        for (size_t i = 0; i < sum.size(); ++i) sum[i] += double(picture.pixels[i]);
        longer += key.k == PyramidKey::kLonger;
        EXPECT_TRUE(key.k == PyramidKey::kLonger || key.k <= 4);
        if (key.k == 1) {
            EXPECT_EQ(picture.pixels, rendered.pyramid.unweighted(key).pixels) << "directly visible";
        }
    }
    EXPECT_EQ(longer, 4) << "hit, next event, connect and lens";
    for (size_t i = 0; i < sum.size(); ++i) EXPECT_NEAR(sum[i], double(image.pixels[i]), 1e-5 * (1 + double(image.pixels[i])));
}

TEST(PyramidFiles, ADirectoryOfItsOwnIsReplaced) {
    const testing::TempDirectory directory;
    const std::string place = directory.file("a/b");
    ASSERT_TRUE(open_pyramid_directory(place).ok());
    EXPECT_TRUE(fs::is_empty(place));
    const Rendered rendered;
    const RgbImage image = rendered.sums.complete().develop();
    const PyramidPage page{.scene = "<room> & \"b\".pbrt", .algorithm = "bdpt", .samples_per_pixel = 5};
    ASSERT_TRUE(write_pyramid(place, rendered.pyramid, rendered.scene->frame(), image, page).ok());
    const auto html = *read_file(place + "/index.html");
    const Json json = Json::parse(*read_file(place + "/pyramid.json"));
    EXPECT_EQ(json["pictures"].size(), rendered.pyramid.keys().size());
    double light = 0, noise = 0;
    for (const Json& picture : json["pictures"]) {
        const std::string name = picture["name"];
        for (const std::string weighting : {"weighted-", "unweighted-"}) {
            const std::string file = weighting + name;
            EXPECT_NE(html.find("src=\"" + file + ".png\""), std::string::npos);
            EXPECT_NE(html.find("href=\"" + file + ".exr\""), std::string::npos);
            const auto exr = read_exr(place + "/" + file + ".exr");
            ASSERT_TRUE(exr.ok()) << exr.status().message();
            EXPECT_EQ(exr->frame, rendered.scene->frame());
            EXPECT_TRUE(fs::exists(place + "/" + file + ".png"));
        }
        light += picture["light_share"].get<double>();
        noise += picture["noise_share"].get<double>();
    }
    EXPECT_NEAR(light, 1, 1e-4);
    EXPECT_NEAR(noise, 1, 1e-4);
    EXPECT_NE(html.find("&lt;room&gt; &amp; &quot;b&quot;.pbrt"), std::string::npos);
    EXPECT_EQ(html.find("<room>"), std::string::npos);
    EXPECT_EQ(html.find("http"), std::string::npos) << "nothing from elsewhere";

    // Another pyramid takes its place, and leaves what is not a pyramid's.
    std::ofstream(place + "/notes.txt") << "mine";
    std::ofstream(place + "/weighted-k9-s9-merge.png") << "of an earlier pyramid";
    ASSERT_TRUE(open_pyramid_directory(place).ok());
    ASSERT_TRUE(write_pyramid(place, rendered.pyramid, rendered.scene->frame(), image, page).ok());
    EXPECT_TRUE(fs::exists(place + "/notes.txt"));
    EXPECT_FALSE(fs::exists(place + "/weighted-k9-s9-merge.png"));
    EXPECT_EQ(*read_file(place + "/index.html"), html);
}

TEST(PyramidFiles, OtherPlacesAreRefused) {
    const testing::TempDirectory directory;
    std::ofstream(directory.file("file")) << "x";
    for (const std::string& place : {directory.path.string(), directory.file("file"), directory.file("file/below")}) {
        const Status status = open_pyramid_directory(place);
        EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << place;
        EXPECT_NE(status.message().find(place), std::string::npos) << status.message();
    }
    std::ofstream(directory.file("pyramid.json")) << "{\"other\": 1}";
    EXPECT_FALSE(open_pyramid_directory(directory.path.string()).ok());
}

TEST(PyramidFiles, OneSampleHasNoVariance) {
    PyramidPage page{.samples_per_pixel = 1, .rows = {{.k = 2, .pictures = {{.s = 0, .name = "k2-s0-hit", .noise_share = NAN}}}}};
    EXPECT_TRUE(Json::parse(pyramid_json(page))["pictures"][0]["noise_share"].is_null());
    EXPECT_EQ(pyramid_html(page).find(">nan"), std::string::npos);
}

/// Makes light in loops of its own.
struct OwnLoops {
    void run(const UnitScope&, UnitSink& sink) const {
        sink.open(1);
        sink.camera(0, 0, 0, Rgb(1));
    }
};

constexpr ParameterInfo kOwnLoopsParameters[] = {kRouletteStart, kRouletteMin};
const AlgorithmInfo kOwnLoopsRow{
    .name = "own-loops",
    .summary = "a test's",
    .source = "none",
    .bias = "everything",
    .parameters = kOwnLoopsParameters,
    .make = [](const RendererRequest& r) -> Result<std::unique_ptr<Renderer>> {
        return make_unit_renderer(r, [](auto&&) { return OwnLoops{}; });
    },
};

TEST(PyramidFiles, AnAlgorithmThatShowsNothingIsRefused) {
    add_to_catalog(kOwnLoopsRow);
    const testing::TempDirectory directory;
    JobOptions options;
    options.scene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt";
    options.algorithm = "own-loops";
    options.resolution = "8x8";
    options.quiet = true;
    TableCacheOptions no_cache;
    no_cache.directory = "off";
    ::testing::internal::CaptureStderr();
    EXPECT_EQ(render_pyramid(options, {.directory = directory.file("p")}, 1, no_cache), kUsage);
    EXPECT_NE(::testing::internal::GetCapturedStderr().find("'own-loops' does its own loops"), std::string::npos);
    EXPECT_TRUE(fs::is_empty(directory.file("p")));
}

}  // namespace
}  // namespace lightloom::client
