// The classifiers of sub-path ends: labels that stay in their range, trees that are bounded, nested and the same when compacted.

#include <gtest/gtest.h>

#include <cstring>

#include "common/core/packed_normal.h"
#include "common/core/rng.h"
#include "common/scene/sampling.h"
#include "common/tables/train_classifier.h"

namespace lightloom {
namespace {

std::vector<WeightedEnd> random_ends(int count, uint64_t seed, bool on_a_line) {
    Rng rng({seed, Stage::kTraining, 0, 0});
    std::vector<WeightedEnd> ends;
    for (int i = 0; i < count; ++i) {
        WeightedEnd e;
        const Vec3 p{rng.uniform(), rng.uniform(), rng.uniform()};
        e.end.position = on_a_line ? Vec3{4 * p.x, 1, 2} : p;
        e.end.normal = on_a_line || rng.uniform() < 0.5f ? Vec3{0, 1, 0} : Vec3{0, -1, 0};
        const Vec2 u = rng.uniform2();
        e.end.direction = on_a_line ? Vec3{0, 1, 0} : face_forward(sample_sphere(u), e.end.normal);
        e.weight = 0.1f + rng.uniform();
        ends.push_back(e);
    }
    return ends;
}

TEST(Classifier, LabelsStayBelowTheirCountAndItsSizeIsBounded) {
    const auto ends = random_ends(4000, 1, false);
    for (const uint32_t subspaces : {1u, 2u, 3u, 17u, 256u, 5000u}) {
        ClassifierOptions options;
        options.subspaces = subspaces, options.first_label = 7, options.seed = 2;
        const SubspaceTree tree = train_classifier(ends, options);
        EXPECT_TRUE(tree.validate(7 + subspaces).ok()) << subspaces;
        EXPECT_LE(tree.nodes().size(), size_t(64 * subspaces + 1));
        std::vector<bool> used(subspaces, false);
        for (const WeightedEnd& e : ends) {
            const uint32_t label = tree.label(e.end);
            ASSERT_GE(label, 7u);
            ASSERT_LT(label, 7 + subspaces);
            used[label - 7] = true;
        }
        if (subspaces <= 256) {
            EXPECT_GT(std::count(used.begin(), used.end(), true), 8 * int(subspaces) / 10);
        }
        // The same again.
        const SubspaceTree again = train_classifier(ends, options);
        ASSERT_EQ(again.nodes().size(), tree.nodes().size());
        EXPECT_EQ(std::memcmp(again.nodes().data(), tree.nodes().data(), tree.nodes().size() * sizeof(SubspaceTree::Node)), 0);
    }
}

/// Breadth first, with splits that decide nothing, as a trainer leaves them.
SubspaceTree random_tree(uint64_t seed) {
    Rng rng({seed, Stage::kTraining, 0, 0});
    std::vector<SubspaceTree::Node> nodes{SubspaceTree::make_leaf(0)};
    for (uint32_t i = 0; i < nodes.size() && nodes.size() < 4000; ++i) {
        if (i > 20 && rng.uniform() < 0.3f) continue;
        const uint32_t axis = i == 0 ? 0 : uint32_t(rng.next_u64() % SubspaceTree::kAxes), left = uint32_t(nodes.size());
        nodes[i] = SubspaceTree::make_inner(axis, 2 * rng.uniform() - 1, left);
        for (int child = 0; child < 2; ++child) nodes.push_back(SubspaceTree::make_leaf(uint32_t(rng.next_u64() % 5)));
    }
    return SubspaceTree(std::move(nodes));
}

TEST(Classifier, CompactingAndSettlingChangeNoLabel) {
    for (const uint64_t seed : {1, 2, 3}) {
        const SubspaceTree tree = random_tree(seed), compact = tree.compacted(), other = random_tree(seed + 10);
        EXPECT_TRUE(compact.validate(5).ok());
        EXPECT_LT(compact.nodes().size(), tree.nodes().size() - 200);
        Rng rng({seed, Stage::kTraining, 1, 0});
        const auto vector = [&] { return Vec3{2 * rng.uniform() - 1, 2 * rng.uniform() - 1, 2 * rng.uniform() - 1}; };
        uint32_t settled_below_root = 0;
        for (int i = 0; i < 20000; ++i) {
            const SubPathEnd end{vector(), vector(), vector()};
            const auto [label, branch] = compact.label_and_settle(end, other);
            ASSERT_EQ(label, tree.label(end));
            ASSERT_EQ(label, compact.label(end));
            SubPathEnd turned = end;
            turned.direction = vector();
            ASSERT_EQ(other.label(turned, branch), other.label(turned));
            settled_below_root += branch > 0;
        }
        EXPECT_GT(settled_below_root, 0u);
    }
    EXPECT_EQ(SubspaceTree().compacted().nodes().size(), 1u);
}

/// Neighbouring numbers are neighbours in space: on a line they ascend with it, and dropping lower bits coarsens.
TEST(Classifier, LabelsAreNested) {
    auto ends = random_ends(5000, 3, true);
    ClassifierOptions options;
    options.subspaces = 64, options.seed = 4;
    const SubspaceTree tree = train_classifier(ends, options);
    std::sort(ends.begin(), ends.end(),
              [](const WeightedEnd& a, const WeightedEnd& b) { return a.end.position.x < b.end.position.x; });
    uint32_t previous = 0;
    for (const WeightedEnd& e : ends) {
        const uint32_t label = tree.label(e.end);
        EXPECT_GE(label, previous);
        previous = std::max(previous, label);
    }
    EXPECT_GT(previous, 40u);

    // In space: two ends of one coarse class are nearer than two of any, and coarser classes are wider.
    const auto cloud = random_ends(3000, 5, false);
    const SubspaceTree in_space = train_classifier(cloud, options);
    double last = 0;
    for (const uint32_t bits : {0u, 2u, 4u, 6u}) {
        double sum = 0, pairs = 0;
        for (size_t i = 0; i < cloud.size(); i += 3)
            for (size_t j = i + 1; j < cloud.size(); j += 5) {
                if (in_space.label(cloud[i].end) >> bits != in_space.label(cloud[j].end) >> bits) continue;
                sum += double(length_squared(cloud[i].end.position - cloud[j].end.position) +
                              length_squared(cloud[i].end.normal - cloud[j].end.normal));
                pairs += 1;
            }
        EXPECT_GT(sum / pairs, last) << bits;
        last = sum / pairs;
    }
}

/// Training data are packed and flat walls' normals rounded: what was learned must hold for what will be looked up. The walls
/// of this room and the slab in its middle lie where the middle of the bounds would divide them, and so do their normals.
TEST(Classifier, RoundedAndPackedEndsKeepTheirLabels) {
    Rng rng({3, Stage::kTraining, 0, 0});
    std::vector<WeightedEnd> learned;
    std::vector<SubPathEnd> asked;
    const auto rounding = [&] { return 4e-7f * (rng.uniform() - 0.5f); };
    for (int i = 0; i < 20000; ++i) {
        Vec3 p{2 * rng.uniform() - 1, 2 * rng.uniform() - 1, 2 * rng.uniform() - 1}, n{};
        const int axis = int(rng.next_u64() % 3);
        const float plane = float(int(rng.next_u64() % 3) - 1);
        (axis == 0 ? p.x : axis == 1 ? p.y : p.z) = plane;
        (axis == 0 ? n.x : axis == 1 ? n.y : n.z) = rng.uniform() < 0.5f ? 1 : -1;
        const Vec3 exact = normalize(n + Vec3{rounding(), rounding(), rounding()});
        const Vec3 direction = face_forward(sample_sphere(rng.uniform2()), n);
        const SubPathEnd end{p, Vec3(PackedNormal(exact)), direction};
        learned.push_back({end, 0.1f + rng.uniform()});
        asked.push_back({p + Vec3{rounding(), rounding(), rounding()}, exact, direction});
    }
    ClassifierOptions options;
    options.subspaces = 200, options.seed = 5;
    const SubspaceTree tree = train_classifier(learned, options);
    int differ = 0;
    for (size_t i = 0; i < asked.size(); ++i) differ += tree.label(asked[i]) != tree.label(learned[i].end) ? 1 : 0;
    EXPECT_LE(differ, 10) << "of " << asked.size();
}

TEST(Classifier, SurvivesWhatCannotBeTrained) {
    ClassifierOptions options;
    options.subspaces = 100, options.first_label = 3;
    const auto only_label = [&](const std::vector<WeightedEnd>& ends) {
        const SubspaceTree tree = train_classifier(ends, options);
        EXPECT_TRUE(tree.validate(103).ok());
        return tree.label({{0, 0, 0}, {0, 1, 0}, {0, 1, 0}});
    };
    EXPECT_EQ(only_label({}), 3u);
    auto weightless = random_ends(50, 6, false);
    for (WeightedEnd& e : weightless) e.weight = 0;
    EXPECT_EQ(only_label(weightless), 3u);
    const auto one = random_ends(1, 7, false);
    EXPECT_EQ(only_label(one), 3u);
    EXPECT_EQ(only_label(std::vector<WeightedEnd>(500, one[0])), 3u);
    // All the light in one place.
    auto spike = random_ends(500, 8, false);
    spike[17].weight = 1e30f;
    only_label(spike);
}

}  // namespace
}  // namespace lightloom
