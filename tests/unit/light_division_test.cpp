// Subspaces of points on lights: labels are those of the point alone, cells lie where light comes from, and whatever was not
// seen, or is not known at all, has a label, too.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>

#include "common/core/rng.h"
#include "common/scene/sampling.h"
#include "common/tables/train_division.h"

namespace lightloom {
namespace {

Emitter triangle(const Vec3& corner, const Vec3& edge1, const Vec3& edge2) {
    Emitter e;
    e.position = corner, e.edge1 = edge1, e.edge2 = edge2;
    const Vec3 n = cross(edge1, edge2);
    e.normal = normalize(n);
    e.inv_area = 2 / std::sqrt(length_squared(n));
    e.radiance = Rgb(1.0f);
    return e;
}

Emitter light_at(EmitterKind kind, const Vec3& position, const Vec3& axis = {}) {
    Emitter e;
    e.kind = kind, e.position = position, e.normal = axis;
    e.radiance = Rgb(1.0f);
    e.total_height = e.falloff_height = 0.5f;
    return e;
}

Emitter sphere(const Vec3& centre, float radius) {
    Emitter e = light_at(EmitterKind::kSphere, centre);
    e.radius = radius, e.inv_area = 1 / (4 * kPi * radius * radius);
    return e;
}

/// An environment among them is white.
EmitterSet set_of(std::vector<Emitter> emitters) {
    return {std::move(emitters), Environment(std::vector<InfiniteLight>(1), {}), {}, 100};
}

/// A rectangle in the plane y = `height` that shines downwards: emitters `first` and `first + 1`.
void add_panel(std::vector<Emitter>* emitters, const Vec3& corner, float width, float depth) {
    const Vec3 x{width, 0, 0}, z{0, 0, depth};
    emitters->push_back(triangle(corner, x, z));
    emitters->push_back(triangle(corner + x + z, -x, -z));
}

WeightedSource on(uint32_t emitter, const Vec3& position, float weight = 1) { return {emitter, position, {}, weight, 0}; }

/// What trace_light_path() would start from.
std::vector<WeightedSource> emission(const EmitterSet& emitters, int count) {
    Rng rng({1, Stage::kTraining, 0, 0});
    std::vector<WeightedSource> out;
    for (int i = 0; i < count; ++i) {
        EmissionSample s;
        if (emitters.sample_emission(rng.uniform_double(), rng.uniform2(), rng.uniform2(), &s))
            out.push_back({s.emitter, s.position, s.normal, 1, 0});
    }
    return out;
}

std::set<uint32_t> labels_of(const LightDivision& d, const EmitterSet& emitters, const std::vector<WeightedSource>& points) {
    std::set<uint32_t> labels;
    for (const WeightedSource& s : points) labels.insert(d.label(emitters, s.emitter, s.position, s.w));
    return labels;
}

void expect_valid(const LightDivision& d, const EmitterSet& emitters, uint32_t cells) {
    EXPECT_TRUE(d.validate(emitters, cells).ok());
    EXPECT_GE(d.cell_count(), 1u);
    EXPECT_LE(d.cell_count(), cells);
}

TEST(LightDivision, ManyTrianglesOfOneLampAreOneSurface) {
    // A lamp of 2 x 1000 slivers, 4 m long.
    std::vector<Emitter> list;
    for (int i = 0; i < 1000; ++i) add_panel(&list, {0.004f * float(i), 2, 0}, 0.004f, 0.1f);
    const EmitterSet emitters = set_of(std::move(list));
    const auto points = emission(emitters, 20000);
    const LightDivision d = train_division(emitters, points, points, {.cells = 40});
    expect_valid(d, emitters, 40);
    EXPECT_EQ(d.cell_count(), 40u);
    double low[40], high[40];
    std::fill_n(low, 40, HUGE_VAL), std::fill_n(high, 40, -HUGE_VAL);
    for (const WeightedSource& s : points) {
        const uint32_t label = d.label(emitters, s.emitter, s.position, s.w);
        low[label] = std::min(low[label], double(s.position.x)), high[label] = std::max(high[label], double(s.position.x));
    }
    for (int i = 0; i < 40; ++i) EXPECT_LT(high[i] - low[i], 0.3) << i;
    // Labels are in the order of the places, so that those that agree in their upper bits are neighbours.
    for (int i = 0; i + 4 <= 40; i += 4) EXPECT_LT(high[i + 3] - low[i], 0.9) << i;
}

TEST(LightDivision, WhatIsNeverSeenTakesFewCellsAndSharesNone) {
    // Two panels of 240 m^2, of which a window shows 1 m^2 of the first.
    std::vector<Emitter> list;
    add_panel(&list, {0, 5, 0}, 10, 24);
    add_panel(&list, {0, 9, 0}, 10, 24);
    const EmitterSet emitters = set_of(std::move(list));
    Rng rng({2, Stage::kTraining, 0, 0});
    std::vector<WeightedSource> seen, rest;
    for (int i = 0; i < 4000; ++i) seen.push_back(on(0, {1 + rng.uniform(), 5, 2 + rng.uniform()}));
    const auto emitted = emission(emitters, 40000);
    const auto in_sight = [](const Vec3& p) { return p.y < 6 && p.x > 0.8f && p.x < 2.2f && p.z > 1.8f && p.z < 3.2f; };
    for (const WeightedSource& s : emitted)
        if (!in_sight(s.position)) rest.push_back(s);
    const LightDivision d = train_division(emitters, seen, emitted, {.cells = 160});
    expect_valid(d, emitters, 160);
    const auto of_seen = labels_of(d, emitters, seen);
    EXPECT_GT(of_seen.size(), 40u);
    size_t shared = 0;
    for (const WeightedSource& s : rest) shared += of_seen.count(d.label(emitters, s.emitter, s.position, s.w));
    EXPECT_LT(double(shared), 0.02 * double(rest.size()));
}

TEST(LightDivision, TheSkyHasAGridAndSharesCellsByImportance) {
    const EmitterSet sky = set_of({light_at(EmitterKind::kEnvironment, {})});
    Rng rng({3, Stage::kTraining, 0, 0});
    std::vector<WeightedSource> from_sky, from_lamp;
    for (int i = 0; i < 4000; ++i) {
        from_sky.push_back({0, {}, sample_sphere(rng.uniform2()), 0.5f, 1});
        from_lamp.push_back(on(1, {rng.uniform(), 2, 0.5f * rng.uniform()}, 1.5f));
    }
    const LightDivision alone = train_division(sky, from_sky, from_sky, {.cells = 110});
    expect_valid(alone, sky, 110);
    EXPECT_EQ(labels_of(alone, sky, from_sky).size(), 100u) << "10 x 10";
    // With a lamp that contributes three times as much.
    std::vector<Emitter> list{light_at(EmitterKind::kEnvironment, {})};
    add_panel(&list, {0, 2, 0}, 1, 1);
    const EmitterSet both = set_of(std::move(list));
    std::vector<WeightedSource> all = from_sky;
    all.insert(all.end(), from_lamp.begin(), from_lamp.end());
    const LightDivision shared = train_division(both, all, all, {.cells = 100});
    expect_valid(shared, both, 100);
    const auto of_sky = labels_of(shared, both, from_sky), of_lamp = labels_of(shared, both, from_lamp);
    EXPECT_EQ(of_sky.size(), 25u) << "5 x 5";
    EXPECT_EQ(of_lamp.size(), 75u);
    for (const uint32_t label : of_sky) EXPECT_EQ(of_lamp.count(label), 0u);
}

TEST(LightDivision, LightsAtAPointTakeOneCellEach) {
    const EmitterSet one = set_of({light_at(EmitterKind::kPoint, {1, 2, 3})});
    const std::vector<WeightedSource> points(1000, on(0, {1, 2, 3}));
    EXPECT_EQ(train_division(one, points, points, {.cells = 200}).cell_count(), 1u);
    // Two back to back in one place, a third elsewhere, and a sun.
    const EmitterSet four =
        set_of({light_at(EmitterKind::kSpot, {0, 2, 0}, {0, 1, 0}), light_at(EmitterKind::kSpot, {0, 2, 0}, {0, -1, 0}),
                light_at(EmitterKind::kPoint, {5, 2, 0}), light_at(EmitterKind::kDistant, {}, {0, -1, 0})});
    std::vector<WeightedSource> starts;
    for (uint32_t i = 0; i < 400; ++i) starts.push_back(on(i % 4, four[i % 4].position, i % 4 == 3 ? 1000.0f : 1.0f));
    const LightDivision d = train_division(four, starts, starts, {.cells = 200});
    EXPECT_EQ(d.cell_count(), 4u);
    std::set<uint32_t> labels;
    for (uint32_t i = 0; i < 4; ++i) labels.insert(d.label(four, i, four[i].position, {}));
    EXPECT_EQ(labels.size(), 4u);
}

TEST(LightDivision, BothFacesOfAPanelDifferAndBothSidesOfAFaceDoNot) {
    std::vector<Emitter> list{triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), triangle({0, 0, 0}, {0, 1, 0}, {1, 0, 0})};
    const EmitterSet faces = set_of(list);
    const auto points = emission(faces, 4000);
    const LightDivision d = train_division(faces, points, points, {.cells = 8});
    const Vec3 p{0.2f, 0.3f, 0};
    EXPECT_NE(d.label(faces, 0, p, {0, 0, 1}), d.label(faces, 1, p, {0, 0, -1}));
    // A start of a light sub-path on a two-sided lamp may be connected to on either side.
    list.pop_back();
    list[0].two_sided = true;
    const EmitterSet sheet = set_of(list);
    const auto starts = emission(sheet, 4000);
    const LightDivision two = train_division(sheet, starts, starts, {.cells = 8});
    EXPECT_EQ(two.label(sheet, 0, p, {0, 0, 1}), two.label(sheet, 0, p, {0, 0, -1}));
}

TEST(LightDivision, AnUnseenLampHasALabel) {
    std::vector<Emitter> list;
    add_panel(&list, {0, 2, 0}, 1, 1);
    list.push_back(sphere({50, 2, 0}, 0.5f));
    list.push_back(light_at(EmitterKind::kEnvironment, {}));
    const EmitterSet emitters = set_of(std::move(list));
    const std::vector<WeightedSource> seen{on(0, {0.1f, 2, 0.2f}), on(0, {0.5f, 2, 0.1f}), on(1, {0.9f, 2, 0.8f})};
    std::vector<WeightedSource> emitted = seen;
    for (int i = 0; i < 3; ++i) emitted.push_back(on(2, {50.5f, 2 + 0.01f * float(i), 0}));
    // Light sub-paths start there: it has labels of its own.
    const LightDivision known = train_division(emitters, seen, emitted, {.cells = 20});
    expect_valid(known, emitters, 20);
    EXPECT_EQ(labels_of(known, emitters, seen).count(known.label(emitters, 2, {50.5f, 2, 0}, {})), 0u);
    // Nothing ever did, on the sky least of all: it shares a label.
    for (const uint32_t cells : {1u, 2u, 20u}) {
        const LightDivision unknown = train_division(emitters, seen, seen, {.cells = cells});
        expect_valid(unknown, emitters, cells);
        EXPECT_LT(unknown.label(emitters, 2, {50.5f, 2, 0}, {}), unknown.cell_count());
        EXPECT_LT(unknown.label(emitters, 3, {}, {0, 1, 0}), unknown.cell_count());
    }
}

/// A draw from a subspace of which the cache holds nothing is lost.
TEST(LightDivision, NoCellIsTooSmallForTheCache) {
    std::vector<Emitter> list;
    add_panel(&list, {0, 2, 0}, 1, 1);
    const EmitterSet emitters = set_of(std::move(list));
    std::vector<WeightedSource> emitted = emission(emitters, 8000);
    for (WeightedSource& s : emitted) s.per_cache = 0.1f;
    // All that is seen lies in one corner.
    Rng rng({5, Stage::kTraining, 0, 0});
    std::vector<WeightedSource> seen;
    for (int i = 0; i < 4000; ++i) seen.push_back(on(0, {0.1f * rng.uniform(), 2, 0.1f * rng.uniform()}));
    for (const double fewest : {0.0, 2.0, 30.0, 1000.0}) {
        const LightDivision d = train_division(emitters, seen, emitted, {.cells = 100, .fewest = fewest});
        expect_valid(d, emitters, 100);
        std::vector<double> held(d.cell_count(), 0.0);
        for (const WeightedSource& s : emitted) held[d.label(emitters, s.emitter, s.position, s.w)] += double(s.per_cache);
        for (const double points : held) EXPECT_TRUE(d.cell_count() == 1 || points >= 0.999 * fewest) << points;
        EXPECT_EQ(d.cell_count() == 1, fewest > 400) << d.cell_count();
        EXPECT_EQ(d.cell_count() == 100, fewest < 8) << d.cell_count();
    }
}

TEST(LightDivision, NoDataAndBadDataGiveFiniteLightsOneCell) {
    const EmitterSet emitters =
        set_of({triangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), light_at(EmitterKind::kEnvironment, {}), sphere({0, 0, 0}, 0)});
    const float inf = HUGE_VALF;
    const std::vector<WeightedSource> bad{
        on(0, {inf, 0, 0}), on(0, {0, 0, 0}, std::nanf("")), on(0, {0, 0, 0}, 0), {1, {}, {0, std::nanf(""), 0}, 1}};
    for (const auto& points : {std::vector<WeightedSource>(), bad}) {
        const LightDivision d = train_division(emitters, points, points, {.cells = 50});
        expect_valid(d, emitters, 50);
        EXPECT_EQ(d.finite().label_end(), 1u);
        EXPECT_EQ(d.label(emitters, 0, {0.1f, 0.1f, 0}, {}), 0u);
        EXPECT_EQ(d.label(emitters, 2, {0, 0, 0}, {}), 0u);
        EXPECT_LT(d.label(emitters, 1, {}, {0, 1, 0}), d.cell_count());
    }
    const EmitterSet none = set_of({});
    expect_valid(train_division(none, {}, {}, {.cells = 50}), none, 1);
    EXPECT_EQ(train_division(emitters, {}, {}, {.cells = 0}).cell_count(), 1u) << "at least one";
}

/// Scenes far from the origin, and lamps of very different size, are divided all the same.
TEST(LightDivision, DividesSmallLampsFarAway) {
    std::vector<Emitter> list;
    add_panel(&list, {10000, 2, 0}, 1, 1);
    add_panel(&list, {10010, 2, 0}, 0.01f, 0.01f);
    const EmitterSet emitters = set_of(std::move(list));
    Rng rng({4, Stage::kTraining, 0, 0});
    std::vector<WeightedSource> seen, large, small;
    for (int i = 0; i < 2000; ++i) {
        large.push_back(on(0, {10000 + rng.uniform(), 2, rng.uniform()}));
        small.push_back(on(2, {10010 + 0.01f * rng.uniform(), 2, 0.01f * rng.uniform()}));
    }
    seen = large, seen.insert(seen.end(), small.begin(), small.end());
    const LightDivision d = train_division(emitters, seen, {}, {.cells = 30});
    expect_valid(d, emitters, 30);
    EXPECT_GT(labels_of(d, emitters, large).size(), 20u);
    for (const uint32_t label : labels_of(d, emitters, small)) EXPECT_EQ(labels_of(d, emitters, large).count(label), 0u);
    // The same again.
    const LightDivision again = train_division(emitters, seen, {}, {.cells = 30});
    const auto &a = d.finite().nodes(), &b = again.finite().nodes();
    ASSERT_EQ(a.size(), b.size());
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])), 0);
}

}  // namespace
}  // namespace lightloom
