// Learned emission: whatever a table holds, sub-paths leave with the densities that the weights use, and the light that
// they carry is the emitters', in every direction and from every place.

#include "common/scene/emission_table.h"

#include <gtest/gtest.h>

#include "common/scene/emitter_square.h"
#include "common/tables/emission_part.h"
#include "common/tables/train.h"
#include "common/tables/train_emission.h"
#include "emitter_cases.h"
#include "tests/support/random_emission.h"
#include "tests/support/statistics.h"

namespace lightloom {
namespace {

using testing::Case;
using testing::EnvironmentCase;
using testing::kCentre;
using testing::kRadius;

/// A case beside a lamp, so that there is a choice.
EmitterSet with_a_lamp(const Case& c, const EnvironmentCase& source) {
    std::vector<Emitter> emitters{c.emitter, testing::sphere(false)};
    emitters[1].position = {1.5f, 0.2f, 1.2f};
    emitters[1].radiance = Rgb(0.4f);
    return EmitterSet(emitters, c.environment != 0 ? source.make() : Environment(), kCentre, kRadius, c.maps);
}

/// Sixteen bins by place and direction.
int bin_of(const EmitterSet& set, const EmissionSample& s) {
    const Emitter& e = set[s.emitter];
    const Vec2 p = has_square(e) ? emitter_square(e, s.position, s.direction) : Vec2{};
    const Vec3 d = e.is_infinite() ? Frame(s.direction).to_local(s.position - kCentre) : s.direction;
    return (p.x < 0.4f ? 8 : 0) + (p.y < 0.6f ? 4 : 0) + (d.x < 0.1f ? 2 : 0) + (d.y < -0.2f ? 1 : 0);
}

/// Light that the samples carry, by bin.
std::vector<testing::Sample> light_of(const EmitterSet& set, uint64_t seed) {
    constexpr int kGroups = 40, kSamples = 4000;
    std::vector<std::vector<double>> groups(16);
    int differ = 0;
    Rng rng({seed, Stage::kTraining, 0, 0});
    for (int g = 0; g < kGroups; ++g) {
        std::vector<double> sum(16, 0.0);
        for (int i = 0; i < kSamples; ++i) {
            EmissionSample s;
            const double pick = rng.uniform_double();
            const Vec2 u = rng.uniform2(), v = rng.uniform2();
            if (!set.sample_emission(pick, u, v, &s)) continue;
            const Emitter& e = set[s.emitter];
            const Vec3 x1 = s.position + s.direction * 2.5f;
            const float seen = set.emission_densities(e, s.position, s.normal, s.direction, x1).direction;
            differ += std::fabs(seen / s.pdf_direction - 1) > 1e-3f;
            // What passes by the scene is no one's light; emission by power has none of it.
            if (e.is_infinite() && length_squared(cross(s.position - kCentre, s.direction)) > kRadius * kRadius) continue;
            sum[size_t(bin_of(set, s))] += double(scalar_of(s.alpha));
        }
        for (size_t b = 0; b < 16; ++b) groups[b].push_back(sum[b] / kSamples);
    }
    // x_1 sees the density that the sub-path left with, but where rounding moves it across the border of a leaf.
    EXPECT_LT(differ, kGroups * kSamples / 1000);
    std::vector<testing::Sample> samples;
    for (const auto& g : groups) samples.emplace_back(g);
    return samples;
}

TEST(LearnedEmission, CarriesTheSameLightAsEmissionByPower) {
    testing::TestFamily family;
    uint64_t seed = 0;
    for (const Case& c : testing::cases()) {
        const EnvironmentCase source(c.environment);
        const EmitterSet by_power = with_a_lamp(c, source);
        const auto expected = light_of(by_power, ++seed);
        for (int table = 0; table < 2; ++table) {
            EmitterSet learned = by_power;
            EmissionData data = testing::random_emission(by_power, ++seed, kCentre, kRadius);
            ASSERT_TRUE(data.validate(2).ok()) << data.validate(2).message();
            learned.guide_emission(std::make_shared<const EmissionTable>(std::move(data)));
            const auto found = light_of(learned, ++seed);
            for (size_t b = 0; b < found.size(); ++b)
                if (expected[b].variance > 0 && found[b].variance > 0)
                    family.add(testing::welch_p_value(expected[b], found[b]), c.name + ", bin " + std::to_string(b));
        }
    }
    family.check();
}

/// Next event estimation goes on to choose by power.
TEST(LearnedEmission, LeavesNextEventAlone) {
    const Case c{"triangle", testing::triangle(false), 0};
    const EmitterSet by_power = with_a_lamp(c, EnvironmentCase(0));
    EmitterSet learned = by_power;
    learned.guide_emission(std::make_shared<const EmissionTable>(testing::random_emission(by_power, 3, kCentre, kRadius)));
    const Vec3 reference{0.3f, -0.5f, 0.4f};
    Rng rng({1, Stage::kTraining, 0, 0});
    for (int i = 0; i < 100; ++i) {
        NextEventSample a, b;
        const double pick = rng.uniform_double();
        const Vec2 u = rng.uniform2();
        const bool found = by_power.sample_next_event(reference, pick, u, &a);
        ASSERT_EQ(learned.sample_next_event(reference, pick, u, &b), found);
        if (!found) continue;
        EXPECT_EQ(a.pdf, b.pdf);
        EXPECT_EQ(learned.pdf_next_event(learned[b.emitter], reference, b.position, b.normal, b.wi),
                  by_power.pdf_next_event(by_power[a.emitter], reference, a.position, a.normal, a.wi));
    }
}

TEST(LearnedEmission, PointsAndSquaresAreInverse) {
    Rng rng({2, Stage::kTraining, 0, 0});
    for (const Emitter& e : {testing::triangle(true), testing::sphere(false), testing::sphere(true)}) {
        for (int i = 0; i < 1000; ++i) {
            const Vec2 p = rng.uniform2();
            Vec3 normal;
            const Vec2 q = emitter_square(e, point_in_square(e, p, &normal), {});
            EXPECT_NEAR(p.x, q.x, 1e-4f);
            EXPECT_NEAR(std::remainder(p.y - q.y, 1.0f), 0, 1e-2f * (e.kind == EmitterKind::kTriangle ? 1 : 2)) << p.x;
        }
    }
}

/// A table for a single emitter, with one density for its places and one cell.
EmissionData table_of(std::vector<SquareNode> squares, uint32_t place, const EmissionData::Cell& cell) {
    EmissionData data;
    data.power_share = 0.1f, data.power_places = 0.15f, data.power_directions = 0.1f;
    data.emitters = {1};
    data.places = {place};
    data.finite = data.infinite = {EmissionData::make_leaf(0)};
    data.cells = {cell};
    data.squares = std::move(squares);
    return data;
}

/// Where the origin of a ray is far from what its cell lights, rounding moves the place at which the ray crosses the cell. The area
/// that rays cross is the sum of their reciprocal densities.
TEST(LearnedEmission, ACellFarSmallerThanTheSceneIsCrossedEverywhereAlike) {
    constexpr float kWide = 1e4f, kHalf = 10;
    EmitterSet set({testing::distant()}, {}, {}, kWide);
    const Vec3 pivot{30, -20, 50};
    set.guide_emission(std::make_shared<const EmissionTable>(table_of({}, kUniformSquare, {kUniformSquare, pivot, kHalf})));
    constexpr int kSamples = 1000000;
    double area = 0;
    Rng rng({7, Stage::kTraining, 0, 0});
    for (int i = 0; i < kSamples; ++i) {
        EmissionSample s;
        const double pick = rng.uniform_double();
        const Vec2 u = rng.uniform2(), v = rng.uniform2();
        ASSERT_TRUE(set.sample_emission(pick, u, v, &s));
        const Vec3 at = Frame(s.direction).to_local(s.position - pivot);
        if (std::max(std::fabs(at.x), std::fabs(at.y)) < kHalf + 0.01f) area += 1 / double(s.pdf_direction) / kSamples;
    }
    EXPECT_NEAR(area, 4 * kHalf * kHalf, 2);
}

/// A facet of a fluorescent tube, and a slit.
TEST(LearnedEmission, PlacesOnNarrowTrianglesHaveTheDensityWithWhichTheyAreDrawn) {
    for (const float width : {2.5e-3f, 4e-4f}) {
        Emitter e = testing::triangle(false);
        e.position = {0.3f, 2.1f, -0.4f};
        e.edge1 = {1.2f, 0, 0.3f};
        e.edge2 = e.edge1 + normalize(Vec3{-0.3f, 0, 1.2f}) * width;
        e.normal = {0, -1, 0};
        e.inv_area = 2 / length(cross(e.edge1, e.edge2));
        EmitterSet set({e}, {}, kCentre, kRadius);
        std::vector<SquareNode> squares(4);
        for (uint32_t i = 0; i < 4; ++i) {
            squares[i] = {.share = {0.7f, 0.1f, 0.1f, 0.1f}, .child = {}};
            if (i < 3) squares[i].child[0] = i + 1;
        }
        set.guide_emission(std::make_shared<const EmissionTable>(table_of(squares, 0, {})));
        Rng rng({8, Stage::kTraining, 0, 0});
        constexpr int kSamples = 400000;
        double area = 0, far = 0;
        for (int i = 0; i < kSamples; ++i) {
            EmissionSample s;
            const double pick = rng.uniform_double();
            const Vec2 u = rng.uniform2(), v = rng.uniform2();
            ASSERT_TRUE(set.sample_emission(pick, u, v, &s));
            area += 1 / double(s.pdf_position) / kSamples;
            Vec3 normal;
            const Vec2 back = emitter_square(e, point_in_square(e, u, &normal), {});
            far += (std::fabs(back.x - u.x) > 0.01f) / double(kSamples);
        }
        EXPECT_NEAR(area * double(e.inv_area), 1, 0.015) << width;
        EXPECT_LT(far, 0.001) << width;
    }
}

/// Training data keep directions in 32 bits, which is not where a sun stands.
TEST(LearnedEmission, ASunLeavesByWhatItTaughtAndNotByWhatTheSkyTaught) {
    for (int turn = 0; turn < 8; ++turn) {
        const EnvironmentCase sky(1);
        std::vector<Emitter> emitters{testing::distant(), testing::environment()};
        emitters[0].normal = normalize(Vec3{0.3f + 0.07f * float(turn), -0.7f, 0.2f});
        const EmitterSet set(emitters, sky.make(), kCentre, kRadius);
        const Vec3 by_the_sun{2, 0, 1}, by_the_sky{-2, 0, -1};
        TrainingData data;
        data.blocks_x = data.blocks_y = 1;
        Rng rng({9, Stage::kTraining, 0, uint64_t(turn)});
        for (int i = 0; i < 4000; ++i) {
            const uint32_t emitter = i % 5 < 3 ? 0 : 1;
            Vec3 travel = emitters[0].normal;
            if (emitter == 1) travel = normalize(Vec3{rng.uniform() - 0.9f, -0.3f, rng.uniform() - 0.9f});
            const Vec3 jitter = Vec3{rng.uniform(), rng.uniform(), rng.uniform()} * 0.2f;
            TrainingPath path;
            path.first_vertex = uint32_t(data.vertices.size());
            path.vertex_count = 4;
            path.emitter = emitter;
            path.estimate = path.square = 1;
            data.vertices.push_back({travel * -10.0f, travel, 0});
            data.vertices.push_back({(emitter == 0 ? by_the_sun : by_the_sky) + jitter, {}, 1});
            data.vertices.push_back({Vec3{0, 1, 0}, {}, 1});
            data.vertices.push_back({Vec3{0, 2, 0}, {}, 0});
            data.paths.push_back(path);
        }
        data.samples = 4000;
        data.block_sum = {4000};
        const EmissionTable table(train_emission(data, block_brightness(data), set, {}));
        EXPECT_LT(length(table.infinite_cell(emitters[0].normal).pivot - by_the_sun), 0.5f) << turn;
    }
}

/// They are copied for each round of learning and each renderer.
TEST(LearnedEmission, CopiesOfEmittersShareTheSky) {
    const EmitterSet set({testing::environment()}, EnvironmentCase(2).make(), kCentre, kRadius);
    const EmitterSet copy = set;
    EXPECT_EQ(&copy.environment(), &set.environment());
}

TEST(LearnedEmission, ComesBackFromItsBytesAndRefusesOthers) {
    const EmitterSet set = with_a_lamp({"triangle", testing::triangle(false), 0}, EnvironmentCase(0));
    const EmissionData data = testing::random_emission(set, 5, kCentre, kRadius);
    const std::string bytes = serialize(data);
    const auto again = parse_emission(bytes);
    ASSERT_TRUE(again.ok());
    EXPECT_EQ(serialize(*again), bytes);
    const auto refused = [&](auto&& spoil, const char* why) {
        EmissionData spoilt = data;
        spoil(&spoilt);
        EXPECT_EQ(spoilt.validate(2).code(), StatusCode::kDataLoss) << why;
    };
    refused([](EmissionData* d) { d->power_share = 0.05f; }, "too little by power");
    refused([](EmissionData* d) { d->power_places = NAN; }, "a share that is no number");
    refused([](EmissionData* d) { d->emitters.pop_back(); }, "another scene");
    refused([](EmissionData* d) { d->emitters[0] += 0.1f; }, "probabilities");
    refused([](EmissionData* d) { d->places[0] = 1000; }, "no such density");
    refused([](EmissionData* d) { d->cells[0].half = 0; }, "no size");
    refused([](EmissionData* d) { d->finite[0] = EmissionData::make_inner(0, 0, 0); }, "a loop");
    refused([](EmissionData* d) { d->infinite.clear(); }, "no tree");
    refused([](EmissionData* d) { d->squares[0].share[1] = 0; }, "no density");
    refused([](EmissionData* d) { d->squares[1].child[2] = 1; }, "a loop");
    refused([](EmissionData* d) { d->cells[0].half = 1e-25f; }, "a density beyond single precision");
    refused([](EmissionData* d) { d->cells[0].half = 1e25f; }, "a density that is zero in single precision");
    refused(
        [](EmissionData* d) {
            const uint32_t first = uint32_t(d->squares.size());
            for (uint32_t i = 0; i < 80; ++i)
                d->squares.push_back({.share = {0.97f, 0.01f, 0.01f, 0.01f}, .child = {first + i + 1}});
            d->squares.back().child[0] = 0;
        },
        "so deep that the density is beyond single precision");
    EXPECT_FALSE(parse_emission(bytes.substr(0, bytes.size() - 1)).ok());
    EXPECT_FALSE(parse_emission("").ok());
    EXPECT_TRUE(EmissionData().validate(2).ok()) << "nothing learned";
}

}  // namespace
}  // namespace lightloom
