// The gain table of Russian roulette: its format, how it is learned, and what it makes of a walk.

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "common/tables/gain_part.h"
#include "common/tables/train_gain.h"
#include "common/transport/parameters.h"
#include "common/transport/training.h"
#include "common/transport/visits.h"
#include "tests/support/estimates.h"
#include "tests/support/random_gain.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

constexpr Rect kCrop{0, 0, 40, 20};

TEST(GainTable, KeepsItsBytesAndRefusesDamage) {
    const GainData data = testing::random_gain(kCrop, 1);
    ASSERT_TRUE(data.validate().ok()) << data.validate().message();
    const std::string bytes = serialize(data);
    const auto parsed = parse_gain(bytes);
    ASSERT_TRUE(parsed.ok());
    EXPECT_EQ(serialize(*parsed), bytes);
    EXPECT_TRUE(GainData{}.validate().ok());
    EXPECT_FALSE(parse_gain(bytes.substr(0, bytes.size() / 2)).ok());

    const auto refused = [&](const char* what, auto&& damage) {
        GainData bad = data;
        damage(bad);
        EXPECT_EQ(bad.validate().code(), StatusCode::kDataLoss) << what;
    };
    refused("no brightness", [](GainData& d) { d.brightness.pop_back(); });
    refused("black block", [](GainData& d) { d.brightness[3] = 0; });
    refused("endless brightness", [](GainData& d) { d.brightness[3] = HUGE_VALF; });
    refused("negative gain", [](GainData& d) { d.gains[0].keep = -1; });
    refused("gain that is no number", [](GainData& d) { d.gains[0].split = NAN; });
    refused("loop", [](GainData& d) { d.nodes[1] = GainData::make_inner(0, 0, 0); });
    refused("child beyond the end", [](GainData& d) { d.nodes[0] = GainData::make_inner(0, 0, uint32_t(d.nodes.size()) - 1); });
    refused("gain beyond the end", [](GainData& d) { d.nodes.back() = GainData::make_leaf(uint32_t(d.gains.size())); });
    refused("unknown axis", [](GainData& d) { d.nodes[0] = GainData::make_inner(6, 0, 1); });
    refused("threshold that is no number", [](GainData& d) { d.nodes[0].threshold = NAN; });
    refused("gains without places", [](GainData& d) { d.nodes.clear(); });
    refused("too many levels", [](GainData& d) {
        d.nodes.assign(1, GainData::make_leaf(0));
        for (uint32_t i = 0; i < 200; i += 2) {  // the left child goes on
            d.nodes[i > 0 ? i - 1 : 0] = GainData::make_inner(0, 0, i + 1);
            d.nodes.resize(d.nodes.size() + 2, GainData::make_leaf(0));
        }
    });
}

TEST(GainTable, BelongsToAFrame) {
    Tables tables(GainPart{testing::random_gain(kCrop, 1)});
    EXPECT_TRUE(gain_of(tables, kCrop).ok());
    EXPECT_EQ(gain_of(tables, Rect{0, 0, 41, 20}).status().code(), StatusCode::kFailedPrecondition);
    EXPECT_EQ(*gain_of(Tables(GainPart{}), kCrop), nullptr);
}

/// Between a half and two sub-paths one goes on; a tenth and sixteen are the limits.
TEST(GainTable, ContinuationsStayInTheirWindow) {
    const GainData::Gain gain{2, 1};
    EXPECT_EQ(GainTable::continuations(gain, 0), GainTable::kLeast);
    EXPECT_FLOAT_EQ(GainTable::continuations(gain, 0.1f), 0.4f);
    EXPECT_EQ(GainTable::continuations(gain, 0.25f), 1);
    EXPECT_EQ(GainTable::continuations(gain, 2), 1);
    EXPECT_FLOAT_EQ(GainTable::continuations(gain, 3), 1.5f);
    EXPECT_EQ(GainTable::continuations(gain, 1e30f), GainTable::kMost);
}

/// Two walls: sub-paths that reach the one with x > 0 find light every other time, those on the other one never.
TrainingData two_walls() {
    TrainingData data;
    data.blocks_x = data.blocks_y = 1;
    data.block_sum = {5000}, data.block_square = {50000};
    data.samples = 10000;
    for (int i = 0; i < 10000; ++i) {
        const float side = i % 2 ? 1 : -1;
        data.visits.push_back({{side, float(i) * 1e-4f, 0}, Vec3{0, 0, 1}, side > 0 && i % 4 == 1 ? 2.0f : 0.0f, 1.0f});
    }
    return data;
}

TEST(TrainGain, LearnsWhereSomethingIsToBeGained) {
    const TrainingData data = two_walls();
    const GainData learned = train_gain(data, {1.0}, {});
    ASSERT_TRUE(learned.learned());
    ASSERT_TRUE(learned.validate().ok()) << learned.validate().message();
    const GainTable table(learned, Rect{0, 0, 1, 1});
    const auto& rich = table.at({1, 0.5f, 0}, {0, 0, 1});
    const auto& poor = table.at({-1, 0.5f, 0}, {0, 0, 1});
    // tau^2 = cost over relative variance = 1 / (5 - 1); E[g^2] = 2 on one side.
    EXPECT_NEAR(rich.keep, 0.5 * std::sqrt(2.0), 0.05);
    EXPECT_GT(rich.keep, rich.split);
    EXPECT_NEAR(rich.split, 0.5, 0.05);  // Var[g] = 1
    EXPECT_EQ(poor.split, 0);
    // Nothing was ever found there, but surroundings are believed.
    EXPECT_GT(poor.keep, 0);
    EXPECT_LT(poor.keep, rich.keep);
}

TEST(TrainGain, DataWithoutLightTeachNothing) {
    TrainingData data = two_walls();
    EXPECT_FALSE(train_gain(data, {0.0}, {}).learned());
    for (TrainingVisit& v : data.visits) v.gain = 0;
    EXPECT_FALSE(train_gain(data, {1.0}, {}).learned());
    data.visits.clear();
    EXPECT_FALSE(train_gain(data, {1.0}, {}).learned());
    EXPECT_FALSE(train_gain(TrainingData{}, {}, {}).learned());
}

/// Places that coincide, and values that are not finite, as a damaged or extreme scene may have them.
TEST(TrainGain, SurvivesWhateverVisitsHold) {
    TrainingData data = two_walls();
    for (size_t i = 0; i < data.visits.size(); ++i) {
        data.visits[i].position = {0, 0, 0};
        if (i % 3 == 0) data.visits[i].gain = HUGE_VALF;
        if (i % 5 == 0) data.visits[i].gain = NAN;
        if (i % 7 == 0) data.visits[i].gain = 1e30f;
    }
    data.block_square = {HUGE_VAL};
    const GainData learned = train_gain(data, {1e-3}, {});
    ASSERT_TRUE(learned.learned());
    EXPECT_TRUE(learned.validate().ok()) << learned.validate().message();
    EXPECT_EQ(learned.nodes.size(), 1u);
}

/// A vertex gains what later vertices find, per unit of its throughput; the sky is met one vertex after the last.
TEST(Visits, DivideWhatComesLaterByTheThroughput) {
    PathVertex z[4];
    for (int i = 0; i < 4; ++i) {
        z[i].p = {float(i), 0, 0}, z[i].ng = {0, 0, 1};
        z[i].alpha = Rgb(std::exp2(float(-i)));
        z[i].emitter = kNone;
    }
    TrainingData data;
    data.block_square = {0, 0};
    Visits visits(true);
    visits.add({.technique = Technique::next_event(), .t = 2, .z = z}, 1);
    visits.add({.technique = Technique::next_event(), .t = 3, .z = z}, 2);
    visits.add({.technique = Technique::hit(), .t = 4, .z = z, .emitter = 7}, 4);  // escaped from z_3
    visits.move_to(&data, z, 4, 10, 1);
    ASSERT_EQ(data.visits.size(), 3u);
    const double unit = double(scalar_of(Rgb(1.0f)));
    EXPECT_NEAR(data.visits[0].gain * unit, 4 * 8, 1e-4);  // z_3
    EXPECT_NEAR(data.visits[1].gain * unit, 4 * 4, 1e-4);
    EXPECT_NEAR(data.visits[2].gain * unit, 6 * 2, 1e-4);
    EXPECT_EQ(data.visits[2].vertices, 2);
    EXPECT_EQ(data.block_square[1], 49);
    EXPECT_EQ(data.block_square[0], 0);
}

/// What the first hits gain is the picture without the light that is seen or found at the first hit itself.
TEST(Visits, OfATrainingSetAddUpToThePicture) {
    const auto scene = testing::diffuse_box();
    for (const char* name : {"path", "bdpt"}) {
        const RenderSettings settings =
            testing::settings_of(name, {{"roulette", "learned"}, {"training-paths", "4000"}, {"rr-min", "1"}}, 3, 1);
        const auto generator = TrainingGenerator::create(*scene, settings);
        ASSERT_TRUE(generator.ok());
        const auto data = generator->trace({0, 4000, 4000}, {});
        ASSERT_TRUE(data.ok()) << data.status().message();
        ASSERT_TRUE(data->validate(scene->emitters().all().size()).ok());
        EXPECT_EQ(data->block_square.size(), data->block_sum.size());
        // Of at most two edges, only sub-paths that hit a lamp behind the first hit gain something.
        EXPECT_GE(data->visits.size(), 2000u) << name;
        for (const TrainingVisit& v : data->visits) EXPECT_GE(v.gain, 0);
        const auto again = parse_training_data(serialize(*data));
        ASSERT_TRUE(again.ok());
        EXPECT_EQ(serialize(*again), serialize(*data));
    }
}

/// What a vertex keeps of its successor belongs to one branch. Mutations: camera_walk.h without the line that resets `rev` and
/// `reverse_label`, or with Branches::next() that does not count down, fail this.
TEST(Roulette, BranchesStartAfresh) {
    const auto scene = testing::diffuse_box();
    const Rect crop = scene->frame().crop;
    std::vector<GainTable> gains;
    for (uint64_t seed = 1; seed <= 10; ++seed) gains.emplace_back(testing::random_gain(crop, seed), crop);
    constexpr int kEdges = 6;
    std::vector<PathVertex> z(kEdges + 2);
    WalkCounters counters;
    uint64_t visits = 0, branched = 0;
    for (uint64_t n = 0; n < 1000; ++n) {
        CameraSampler sampler(7, n, n % uint64_t(crop.area()));
        int here[kEdges + 3] = {};  // visits with so many vertices
        const int px = crop.x0 + int(n) % crop.width(), py = crop.y0 + int(n) / crop.width() % crop.height();
        const int longest = trace_camera_path<true>(
            *scene, sampler, px, py, kEdges, {.gain = &gains[n % gains.size()]}, z.data(), &counters,
            [&](int t) {
                ++visits, ++here[t];
                EXPECT_EQ(z[size_t(t) - 1].reverse_label, kNoLabel);
                if (t > 2) {
                    EXPECT_EQ(z[size_t(t) - 2].rev, 0);
                    EXPECT_EQ(z[size_t(t) - 2].reverse_label, kNoLabel);
                    z[size_t(t) - 2].reverse_label = 5;  // as a path that ends here would leave it
                    EXPECT_GT(z[size_t(t) - 3].rev, 0);
                }
                EXPECT_GT(z[size_t(t) - 1].survival, 0);
            },
            [](int, const WalkRay&) {});
        for (int t = 3; t <= kEdges + 1; ++t) branched += here[t] > 1;
        EXPECT_EQ(here[2], longest >= 2 ? 1 : 0);
    }
    EXPECT_GT(branched, 200u);
    EXPECT_GT(visits, 3000u);
}

/// Tables that nobody asked for are not made, and those of all three kinds of roulette render the same mean (technique_test).
TEST(Roulette, LearnsOnlyOnRequest) {
    EXPECT_EQ(testing::settings_of("path").algorithm.learning(), nullptr);
    EXPECT_NE(testing::settings_of("path", {{"roulette", "learned"}}).algorithm.learning(), nullptr);
    EXPECT_EQ(testing::settings_of("bdpt", {{"roulette", "off"}}).algorithm.learning(), nullptr);
    EXPECT_EQ(roulette_of(testing::settings_of("path", {{"roulette", "off"}}).algorithm).min_survival, 1);
}

}  // namespace
}  // namespace lightloom
