// What the weights of spcbpt read: every technique describes the very same path, its labels and the throughput of its light
// prefixes alike, and names of subspaces mean nothing. Everything is rebuilt through production code. That the weights sum to one
// is weights_test, for every row of the catalog.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/transport/spcbpt_merging.h"
#include "common/transport/unit_renderer.h"
#include "tests/support/path_generator.h"
#include "tests/support/random_emission.h"
#include "tests/support/random_tables.h"
#include "tests/support/tally.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::can_be_hit;
using testing::FullPath;
using testing::kLooseTraced;
using testing::random_tables;
using testing::rebuild;
using testing::Tally;

constexpr int kEdges = 7;

struct EveryTechnique {
    MergingSelection operator()(MergingSelection s) const { return s; }
};
using SpcbptWeights = detail::CachedWeights<MergingConnections<EveryTechnique>>;

SpcbptWeights weights_of(const Scene& scene, SubspaceTables tables, int connections) {
    const auto prepared = std::make_shared<const PreparedTables>(std::move(tables));
    const SpcbptSelection selection =
        spcbpt_selection(prepared, {.light_paths_per_iteration = 0.7 * double(scene.frame().crop.area()),
                                    .connections = connections,
                                    .roulette = RouletteRule{}});
    const MergingSelection merging{selection, {.paths = 2000, .radius = {.fixed2 = 1e-3, .most2 = 1}}};
    return {MergingConnections<EveryTechnique>({}, merging, 1, prepared, connections), Heuristic::kBalance};
}

TEST(TypicalSurvival, CountsTheEventsThatASubPathWentThrough) {
    const TypicalSurvival none, off(RouletteRule{.min_survival = 1}), late(RouletteRule{.first_vertex = 256});
    const TypicalSurvival usual(RouletteRule{.first_vertex = 4, .min_survival = 0.5f});
    for (const int n : {0, 1, 4, 256, kMaxEdges + 1}) {
        EXPECT_EQ(none(n), 1);
        EXPECT_EQ(off(n), 1);
    }
    EXPECT_EQ(late(256), 1);
    EXPECT_LT(late(257), 1);
    // The walk plays when it leaves vertex 4 and every later one, on its way to the fifth.
    EXPECT_EQ(usual(4), 1);
    EXPECT_FLOAT_EQ(float(usual(5)), TypicalSurvival::kPerEvent);
    EXPECT_FLOAT_EQ(float(usual(7)), float(std::pow(TypicalSurvival::kPerEvent, 3)));
    EXPECT_FLOAT_EQ(float(TypicalSurvival(RouletteRule{.min_survival = 0.9f})(5)), 0.9f);
}

class SubspaceWeights : public ::testing::TestWithParam<testing::NamedScene> {};

/// c_s lies in [1/n, 1], and both ends occur: a camera sub-path that had to be this one, and one that is a rare choice of many.
TEST(CorrelationFactor, LiesBetweenOneOverTheConnectionsAndOne) {
    PathView view;
    view.k = 4;
    view.primary_distance2 = 1;
    const auto factor = [&](double camera, double light, int s, double n) {
        for (int i = 0; i < view.k; ++i) view.rev[i] = camera, view.fwd[i] = light, view.delta[i] = false;
        return correlation_factor(view, s, n);
    };
    EXPECT_EQ(factor(1e9, 1e-3, 2, 3), 1);
    EXPECT_EQ(factor(1e-3, 1e9, 2, 3), 1.0 / 3);
    EXPECT_EQ(factor(1e-200, 1e-200, 2, 3), 1) << "nothing is known";
    for (const double camera : {1e-2, 1.0, 1e2, 1e3, 1e4})
        for (const double light : {1e-2, 1.0, 1e2, 1e3, 1e4})
            for (const int s : {1, 2, 3}) {
                const double c = factor(camera, light, s, 8);
                EXPECT_GE(c, 1.0 / 8);
                EXPECT_LE(c, 1);
            }
    // Dirac events and discrete lights do not dilute: only what spreads counts.
    factor(1e-3, 1e-3, 2, 1e9);
    view.delta[3] = view.delta[0] = true;
    view.rev[3] = 1e9;
    view.source = PathView::Source::kDiscrete;
    EXPECT_EQ(correlation_factor(view, 2, 1e9), 1);
}

/// Mutations: light_step() of random_walk.h without the squared index ratio of a Dirac refraction fails this (and the sums) on
/// spheres_in_glass; with it for thin panes as well, on mixes_and_pane.
void check_labels(const testing::NamedScene& named, bool lit) {
    const auto unlit = named.make(), unlit_stage = named.stage(unlit);
    const auto scene = lit ? testing::randomly_lit(unlit, 3) : unlit;
    const auto stage = lit ? testing::randomly_lit(unlit_stage, 3) : unlit_stage;
    testing::RandomTableOptions options;
    options.light_count = options.eye_count = 200, options.source_cells = 60, options.tree_leaves = 300;
    const SpcbptWeights weights = weights_of(*scene, random_tables(scene->emitters(), 5, options), 3);
    Tally throughput, labels, sources;
    testing::for_each_path(
        *scene, can_be_hit(*scene) ? 4000 : 8000, kEdges, 51,
        [&](const FullPath& path, Technique, const PathView& traced, const Rgb&) {
            const int k = path.k();
            if (k < 2) return;
            testing::for_each_technique(k, [&](Technique t) {
                const auto other = rebuild(*stage, path, t, &weights);
                if (!other) return;
                // What a connection of s' light vertices reads, where it is possible and light tracing reaches it.
                if (traced.fwd[0] > 0 && path.x[1].bsdf.has_smooth_lobe())
                    sources.add(other->view.light_label[1] == traced.light_label[1] ? 0 : 1, path);
                double reached = 1;
                for (int c = 1; c <= k - 1; ++c) {
                    reached *= traced.fwd[c - 1] > 0 ? 1 : 0;
                    if (reached == 0 || traced.delta[c - 1] || traced.delta[c]) continue;
                    if (!path.x[size_t(c)].bsdf.has_smooth_lobe()) continue;
                    if (c >= 2 && !path.x[size_t(c - 1)].bsdf.has_smooth_lobe()) continue;
                    labels.add(other->view.light_label[c] == traced.light_label[c] ? 0 : 1, path);
                    labels.add(other->view.eye_label[c] == traced.eye_label[c] ? 0 : 1, path);
                    throughput.add(other->view.light_throughput[c] / traced.light_throughput[c] - 1, path);
                }
            });
        },
        &weights);
    throughput.check("throughput of light prefixes", lit ? testing::kLooseLit : kLooseTraced, lit ? testing::kGrossLit : 2e-4);
    // A direction is recomputed to the last bits only: a split between its two values is as likely as that.
    EXPECT_GT(labels.count, 500u);
    // What x_0 is made of is stored and not recomputed.
    EXPECT_GT(sources.count, 500u);
    EXPECT_EQ(sources.gross, 0u) << "of " << sources.count << " labels of points on lights";
    EXPECT_LE(double(labels.gross), 1e-4 * double(labels.count)) << labels.gross << " of " << labels.count;
}

TEST_P(SubspaceWeights, EveryTechniqueSeesTheSameLabelsAndThroughput) { check_labels(GetParam(), false); }
TEST_P(SubspaceWeights, EveryTechniqueSeesTheSameWithLearnedEmission) { check_labels(GetParam(), true); }

INSTANTIATE_TEST_SUITE_P(Scenes, SubspaceWeights, ::testing::ValuesIn(testing::kScenes),
                         [](const ::testing::TestParamInfo<testing::NamedScene>& param) { return param.param.name; });

/// Directions in the very plane of a surface have density zero. A ray that left along one and escaped to the sky had no weight.
TEST(Walk, DoesNotFollowDirectionsOfZeroDensity) {
    PathVertex before, v;
    v.ng = {0, 0, 1};
    v.shading = Frame(v.ng);
    v.wo = v.wo_local = normalize(Vec3{0.3f, 0.2f, 1});
    v.alpha = Rgb(1.0f);
    v.bsdf.kind = BsdfKind::kDiffuse;
    v.bsdf.reflectance = Rgb(0.5f);
    for (int i = 0; i < 64; ++i)
        for (const float edge : {0.0f, 1 - 0x1p-24f, 0.5f}) {
            const float along = float(i) / 64;
            for (const Vec2 u : {Vec2{edge, along}, Vec2{along, edge}}) {
                WalkRay ray;
                if (leave<TransportMode::kRadiance>(&v, &before, {0.5f, u}, &ray)) {
                    EXPECT_GT(ray.pdf, 0);
                }
                if (leave<TransportMode::kImportance>(&v, &before, {0.5f, u}, &ray)) {
                    EXPECT_GT(ray.pdf, 0);
                }
            }
        }
}

/// Calls visit(technique, view of a, view of b) for every technique of spcbpt that can make the path.
template <class Visit>
void each_weighted(const Scene& scene, const FullPath& path, const SpcbptWeights& a, const SpcbptWeights& b, Visit&& visit) {
    testing::for_each_technique(path.k(), [&](Technique t) {
        const auto ra = rebuild(scene, path, t, &a), rb = rebuild(scene, path, t, &b);
        ASSERT_EQ(ra.has_value(), rb.has_value());
        if (ra) visit(t, ra->view, rb->view);
    });
}

/// Glass keeps sub-paths alive: of a path of ten edges whose inner vertices x_3 ... x_6 are glass, roulette at those counts for
/// nothing, from whichever end. Mutation: PathSurvival without mark().
TEST(TypicalSurvival, LosslessVerticesDoNotCount) {
    const TypicalSurvival typical(RouletteRule{.first_vertex = 3, .min_survival = 0.5f});
    PathView view;
    view.k = 10;
    for (int i = 0; i <= view.k; ++i) view.lossless[i] = i >= 3 && i <= 6;
    const PathSurvival survival(typical, view);
    const auto events = [&](int first, int last) {  // of x_first ... x_last
        int lossy = 0;
        for (int i = first; i <= last; ++i) lossy += !view.lossless[i];
        return std::pow(double(TypicalSurvival::kPerEvent), lossy);
    };
    for (int s = 3; s <= view.k; ++s) EXPECT_NEAR(survival.light(s), events(2, s - 2), 1e-9) << s;
    for (int t = 3; t <= view.k + 1; ++t) EXPECT_NEAR(survival.camera(t), events(view.k - t + 2, view.k - 2), 1e-9) << t;
    for (int i = 0; i <= view.k; ++i) view.lossless[i] = false;
    const PathSurvival plain(typical, view);
    for (int n = 1; n <= view.k; ++n) {
        EXPECT_EQ(plain.light(n), typical(n));
        EXPECT_EQ(plain.camera(n), typical(n));
    }
}

/// Numbers of subspaces are names: the weights do not know them.
TEST(Labels, PermutedWithTheirRowsKeepEveryWeight) {
    const auto scene = testing::glossy();
    const SubspaceTables tables = random_tables(scene->emitters(), 8);
    const uint32_t n = tables.light_count, m = tables.eye_count;
    ASSERT_TRUE(n % 5 != 0 && m % 7 != 0) << "no permutation";
    const auto renamed = [n](uint32_t i) { return (5 * i + 3) % n; };
    const auto renamed_eye = [m](uint32_t j) { return (7 * j + 2) % m; };
    const auto with_names = [](const SubspaceTree& tree, const auto& name) {
        std::vector<SubspaceTree::Node> nodes = tree.nodes();
        for (SubspaceTree::Node& node : nodes)
            if (node.axis() == SubspaceTree::kLeaf) node = SubspaceTree::make_leaf(name(node.child()));
        return SubspaceTree(std::move(nodes));
    };
    SubspaceTables other = tables;
    other.light_tree = with_names(tables.light_tree, renamed);
    other.eye_tree = with_names(tables.eye_tree, renamed_eye);
    std::vector<LightDivision::Cells> cells = tables.division.cells();
    for (LightDivision::Cells& c : cells) {
        ASSERT_LE(c.side, 1);
        if (c.side == 1) c.first = uint16_t(renamed(c.first));
    }
    other.division = LightDivision(std::move(cells), with_names(tables.division.finite(), renamed));
    for (uint32_t i = 0; i < n; ++i) {
        other.energy[renamed(i)] = tables.energy[i];
        for (uint32_t j = 0; j < m; ++j) other.gamma[size_t(renamed_eye(j)) * n + renamed(i)] = tables.column(j)[i];
    }
    ASSERT_TRUE(other.validate(scene->emitters()).ok());
    const SpcbptWeights a = weights_of(*scene, tables, 3), b = weights_of(*scene, other, 3);
    uint64_t compared = 0;
    testing::for_each_path(
        *scene, 500, 6, 61,
        [&](const FullPath& path, Technique, const PathView&, const Rgb&) {
            if (path.k() < 2) return;
            each_weighted(*scene, path, a, b, [&](Technique t, const PathView& va, const PathView& vb) {
                EXPECT_EQ(a.weight(va, t), b.weight(vb, t));
                ++compared;
            });
        },
        &a);
    EXPECT_GT(compared, 2000u);
}

/// A subspace that is split, with Gamma shared in proportion to Q, has the same weights: coarse tables are among the fine ones
/// [common/path/README.md, "Nested families"].
TEST(Labels, SplitSubspacesWithSharedGammaKeepEveryWeight) {
    const auto scene = testing::glossy();
    const SubspaceTables tables = random_tables(scene->emitters(), 9);
    SubspaceTables fine = tables;
    const uint32_t n = tables.light_count;
    fine.light_count = n + 1;
    // Half of the places of subspace `split` get the new label.
    const uint32_t split = tables.light_tree.nodes().back().child();
    std::vector<SubspaceTree::Node> nodes = tables.light_tree.nodes();
    for (size_t i = 0, count = nodes.size(); i < count; ++i) {
        if (nodes[i].axis() != SubspaceTree::kLeaf || nodes[i].child() != split) continue;
        nodes[i] = SubspaceTree::make_inner(0, 0.05f, uint32_t(nodes.size()));
        nodes.push_back(SubspaceTree::make_leaf(split));
        nodes.push_back(SubspaceTree::make_leaf(n));
    }
    fine.light_tree = SubspaceTree(std::move(nodes));
    const float share = 0.3f;
    fine.energy.push_back(share * tables.energy[split]);
    fine.energy[split] = (1 - share) * tables.energy[split];
    fine.window.push_back(tables.window[split]);
    fine.gamma.clear();
    for (uint32_t j = 0; j < tables.eye_count; ++j) {
        for (uint32_t i = 0; i < n; ++i) fine.gamma.push_back(tables.column(j)[i] * (i == split ? 1 - share : 1));
        fine.gamma.push_back(tables.column(j)[split] * share);
    }
    ASSERT_TRUE(fine.validate(scene->emitters()).ok());
    const SpcbptWeights a = weights_of(*scene, tables, 2), b = weights_of(*scene, fine, 2);
    uint64_t compared = 0, in_new = 0;
    testing::for_each_path(
        *scene, 500, 6, 62,
        [&](const FullPath& path, Technique, const PathView&, const Rgb&) {
            if (path.k() < 2) return;
            each_weighted(*scene, path, a, b, [&](Technique t, const PathView& va, const PathView& vb) {
                const double weight = a.weight(va, t);
                EXPECT_NEAR(b.weight(vb, t), weight, 1e-6 * weight);
                ++compared;
                for (int c = 2; c < path.k(); ++c) in_new += vb.light_label[c] == n;
            });
        },
        &b);
    EXPECT_GT(compared, 2000u);
    EXPECT_GT(in_new, 50u);
}

}  // namespace
}  // namespace lightloom
