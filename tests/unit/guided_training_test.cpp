// Training sets, whoever made them, are estimates of the same things: the image, the light of every path length, the loss of any
// Gamma, and Q. A guide, good or bad, changes their noise alone.

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "common/transport/subspace_view.h"
#include "tests/support/estimates.h"
#include "tests/support/random_tables.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using testing::Sample;

constexpr int kReplications = 24;
constexpr uint64_t kSamples = 2000;
constexpr int kMaxDepth = 5;

RenderSettings settings_of(uint64_t seed, const std::map<std::string, std::string>& changes = {}) {
    auto parameters = changes;
    parameters.insert({{"training-paths", "40000"}, {"light-subspaces", "60"}, {"eye-subspaces", "40"}, {"cache", "500"}});
    return testing::settings_of("spcbpt", parameters, seed, kMaxDepth);
}

/// Tables of a small training set.
Tables learned(const Scene& scene) {
    TrainingReport report;
    auto tables = make_tables(scene, settings_of(7, {{"training-paths", "3000"}}), {}, &report);
    if (!tables.ok()) throw std::runtime_error(tables.status().message());
    return *std::move(tables);
}

/// What a unit estimates, by name.
std::vector<std::pair<std::string, double>> estimates(const TrainingData& data) {
    std::vector<std::pair<std::string, double>> out{{"image", 0}, {"energy", 0}, {"loss", 0}, {"loss of path tracing", 0}};
    for (int k = 2; k <= kMaxDepth + 1; ++k) out.emplace_back("length " + std::to_string(k), 0.0);
    const double n = double(data.samples);
    for (const double b : data.block_sum) out[0].second += b / n;
    for (const TrainingPath& p : data.light_paths)
        for (uint32_t i = 0; i < p.vertex_count; ++i)
            out[1].second += double(data.vertices[p.first_vertex + i].density) / double(data.light_samples);
    for (const TrainingPath& p : data.paths) {
        out[p.vertex_count + 1].second += double(p.estimate) / n;  // k = vertex_count - 1 stands at 4 + k - 2
        // Of a renderer with N Gamma / Q = 1 that does not splat: the density of splats is that of the guide's emission.
        double density = 0;
        for (uint32_t i = 0; i < p.vertex_count; ++i) density += double(data.vertices[p.first_vertex + i].density);
        if (density > 0) out[2].second += double(p.square) / density / n;
        const double from_camera = double(data.vertices[p.first_vertex].density) + double(p.next_event);
        if (from_camera > 0) out[3].second += double(p.square) / from_camera / n;
    }
    return out;
}

std::vector<std::vector<double>> replicate(const Scene& scene, const Tables& guide, uint64_t first_seed,
                                           const std::string& energy_paths = "1") {
    std::vector<std::vector<double>> values;
    for (uint64_t r = 0; r < kReplications; ++r) {
        const RenderSettings settings = settings_of(first_seed + r, {{"energy-paths", energy_paths}});
        const TrainingData data =
            testing::trace_training(scene, settings, {r * kSamples, kSamples, kReplications * kSamples}, guide);
        const Status valid = data.validate(scene.emitters().all().size());
        EXPECT_TRUE(valid.ok()) << valid.message();
        const auto numbers = estimates(data);
        values.resize(numbers.size());
        for (size_t i = 0; i < numbers.size(); ++i) values[i].push_back(numbers[i].second);
    }
    return values;
}

TEST(GuidedTraining, EstimatesWhatThePilotEstimates) {
    testing::TestFamily family;
    for (const testing::NamedScene& named : testing::kScenes) {
        const auto scene = named.make();
        const auto names = estimates(testing::trace_training(*scene, settings_of(1), {0, 100, 100}));
        const auto pilot = replicate(*scene, {}, 100);
        testing::RandomTableOptions random;
        random.spread = 2, random.max_window = 3;
        const Tables right = learned(*scene), wrong(testing::random_tables(scene->emitters(), 3, random));
        for (const auto& [what, guide] : {std::pair{"learned", &right}, std::pair{"random", &wrong}}) {
            const auto guided = replicate(*scene, *guide, 1000);
            for (size_t i = 0; i < names.size(); ++i) {
                const Sample a(pilot[i]), b(guided[i]);
                if (a.mean == 0 && b.mean == 0) continue;
                if (std::max(a.relative_error(), b.relative_error()) > 0.1) continue;  // would find nothing
                family.add(testing::welch_p_value(a, b), std::string(named.name) + ", " + what + " guide, " + names[i].first +
                                                             ": " + std::to_string(a.mean) + " and " + std::to_string(b.mean));
            }
        }
    }
    EXPECT_GE(family.size(), 80);
    family.check();
}

/// M' is an option of its own: fewer are left out, more are traced beside the samples.
TEST(GuidedTraining, EnergyIsMeasuredWithAsManyLightSubPathsAsAskedFor) {
    testing::TestFamily family;
    const auto scene = testing::diffuse_box();
    const Sample plain(replicate(*scene, {}, 1)[1]);
    uint64_t seed = 100;
    for (const Tables& guide : {Tables(), Tables(testing::random_tables(scene->emitters(), 3))}) {
        for (const double ratio : {0.25, 1.0, 2.5}) {
            const RenderSettings settings = settings_of(1, {{"energy-paths", std::to_string(ratio)}});
            const auto generator = TrainingGenerator::create(*scene, settings, guide);
            ASSERT_TRUE(generator.ok());
            uint64_t traced = 0;
            std::set<std::tuple<float, float, float>> starts;
            size_t kept = 0;
            for (const auto& [first, count] : {std::pair{0, 1001}, std::pair{1001, 999}}) {
                const Result<TrainingData> data = generator->trace({uint64_t(first), uint64_t(count), 2000}, {});
                ASSERT_TRUE(data.ok());
                traced += data->light_samples;
                kept += data->light_paths.size();
                for (const TrainingPath& p : data->light_paths) {
                    const Vec3& x = data->vertices[p.first_vertex].position;
                    starts.insert({x.x, x.y, x.z});
                }
            }
            EXPECT_EQ(traced, uint64_t(2000 * ratio));
            EXPECT_LE(kept, traced);
            EXPECT_EQ(starts.size(), kept) << "units or samples share light sub-paths";
            const Sample energy(replicate(*scene, guide, seed += 1000, std::to_string(ratio))[1]);
            family.add(testing::welch_p_value(plain, energy), "energy-paths=" + std::to_string(ratio));
        }
    }
    family.check();
}

TEST(GuidedTraining, LightsLeaveASubspaceToLongerPrefixes) {
    TrainingReport report;
    const auto tables =
        make_tables(*testing::environment_lit(),
                    settings_of(3, {{"training-paths", "2000"}, {"light-subspaces", "17"}, {"source-share", "1"}}), {}, &report);
    ASSERT_TRUE(tables.ok());
    EXPECT_LE(tables->get<SubspaceTables>()->light_count, 17u);
}

/// Q is learned from packed vertices, and what a cache holds is labelled as traced: the walls of this room are tilted by what
/// rounding leaves, and must be in the same subspaces.
TEST(GuidedTraining, EnergyIsWhatCachesHold) {
    testing::SceneBuilder builder = testing::cornell_builder();
    for (TriangleMesh& mesh : builder.description().meshes)
        for (Vec3& p : mesh.positions) p = {p.x + 1e-7f * (p.y - p.z), p.y - 1e-7f * p.x, p.z + 1e-7f * p.x};
    const auto scene = builder.build();
    TrainingReport report;
    const RenderSettings settings = settings_of(11, {{"training-paths", "20000"}, {"emission", "power"}});
    const auto tables = make_tables(*scene, settings, {}, &report);
    ASSERT_TRUE(tables.ok());
    const SubspaceTables& learned = *tables->get<SubspaceTables>();
    std::vector<double> held(learned.light_count);
    constexpr uint64_t kPaths = 100000;
    const int max_edges = settings.max_edges();
    std::vector<PathVertex> y(size_t(max_edges) + 1);
    for (uint64_t m = 0; m < kPaths; ++m) {
        LightSampler sampler({12, Stage::kLight, 0, m});
        WalkCounters counters;
        const int n = trace_light_path(*scene, sampler, max_edges, {}, y.data(), &counters);
        SubspaceLabeller{learned, scene->emitters()}.label_light_path(y.data(), n);
        for (int i = 0; i < n && i + 1 < max_edges; ++i)
            held[y[size_t(i)].label] += double(scalar_of(y[size_t(i)].alpha)) / double(kPaths);
    }
    double total = 0, apart = 0;
    for (uint32_t i = 0; i < learned.light_count; ++i)
        total += double(learned.energy[i]), apart += std::fabs(double(learned.energy[i]) - held[i]);
    EXPECT_LT(apart, 0.1 * total);
}

/// Labels are learned from these points: x_0 of a sun or a sky must lie where its light comes from, whoever made the path.
TEST(GuidedTraining, InfiniteLightsLieInTheDirectionOfTheirLight) {
    int seen = 0;
    for (const auto& scene : {testing::environment_lit(), testing::delta_lights()}) {
        for (const Tables& guide : {Tables(), Tables(testing::random_tables(scene->emitters(), 9))}) {
            const TrainingData data = testing::trace_training(*scene, settings_of(4), {0, 4000, 4000}, guide);
            for (const TrainingPath& p : data.paths) {
                const TrainingVertex* v = &data.vertices[p.first_vertex];
                // Light tracing starts from where its path started, which is the right place for it.
                if (!scene->emitters()[p.emitter].is_infinite()) continue;
                const Vec3 d = normalize(v[0].position - v[1].position);
                EXPECT_NEAR(dot(d, v[0].normal), -1, 1e-4);
                ++seen;
            }
        }
    }
    EXPECT_GT(seen, 2000);
}

/// Units are held out against one another: what they share would confirm itself. Paths on a lamp are told apart by where they
/// begin.
TEST(GuidedTraining, UnitsShareNoLightSubPath) {
    const auto scene = testing::diffuse_box();
    testing::RandomTableOptions random;
    random.max_window = 4;
    const Tables guide(testing::random_tables(scene->emitters(), 5, random));
    const auto generator = TrainingGenerator::create(*scene, settings_of(2), guide);
    ASSERT_TRUE(generator.ok());
    std::set<std::tuple<float, float, float>> starts;
    size_t paths = 0;
    for (const uint64_t first : {0, 3000}) {
        const Result<TrainingData> data = generator->trace({first, 3000, 6000}, {});
        ASSERT_TRUE(data.ok());
        paths += data->light_paths.size();
        for (const TrainingPath& p : data->light_paths) {
            const Vec3& x = data->vertices[p.first_vertex].position;
            starts.insert({x.x, x.y, x.z});
        }
    }
    EXPECT_EQ(starts.size(), paths);
}

TEST(GuidedTraining, DoesNotDependOnThreads) {
    const auto scene = testing::glossy();
    const Tables guide(testing::random_tables(scene->emitters(), 5));
    const auto generator = TrainingGenerator::create(*scene, settings_of(2), guide);
    ASSERT_TRUE(generator.ok());
    std::string one, two;
    for (const auto& [threads, bytes] : {std::pair{1, &one}, std::pair{2, &two}}) {
        tbb::global_control allowance(tbb::global_control::max_allowed_parallelism, 2);
        tbb::task_arena(threads).execute([&, out = bytes] { *out = serialize(*generator->trace({0, 3000, 3000}, {})); });
    }
    EXPECT_EQ(one, two);
}

/// A sample's first diffuse vertex finds most of its light; the ones behind it teach other eye subspaces, and keep paths too.
TEST(GuidedTraining, ASampleKeepsTwoPathsOfEveryLength) {
    const auto scene = testing::diffuse_box();
    constexpr uint64_t kTraced = 2000;
    const TrainingData data = testing::trace_training(*scene, settings_of(1), {0, kTraced, kTraced}, learned(*scene));
    EXPECT_GT(data.paths.size(), (size_t(kTrainingLengths) + 1) * kTraced);  // more than one of every length would be
    EXPECT_LE(data.paths.size(), (kTrainingPathsPerSample + 1) * kTraced);
}

/// Tables of a set that has grown are those of a set that had its size from the beginning.
TEST(GuidedTraining, RoundsBeforeTheLastAreThoseOfEveryLargerSet) {
    const auto plan_of = [&](uint64_t samples, double pilot) {
        const auto settings = settings_of(1).algorithm.with("training-paths", double(samples)).with("pilot", pilot);
        return learning_plan(settings);
    };
    EXPECT_EQ(plan_of(500000, 0).rounds.size(), 1u);
    EXPECT_FALSE(plan_of(500000, 0).grows);
    constexpr uint64_t kSizes[] = {
        1, kPilotSamples, 2 * kPilotSamples - 1, 2 * kPilotSamples, kGuideSamples, 100000, 2 * kGuideSamples, 500000, 100000000};
    for (const uint64_t smaller : kSizes) {
        const LearningPlan plan = plan_of(smaller, 1);
        EXPECT_EQ(plan.samples, smaller);
        EXPECT_TRUE(plan.grows);
        for (size_t round = 0; round < plan.rounds.size(); ++round) {
            EXPECT_EQ(plan.rounds[round].guided, round > 0);
            EXPECT_EQ(plan.first_sample(round) % kTrainingUnitSamples, 0u);
        }
        for (const uint64_t larger : larger_sets(smaller, 500000)) {
            const LearningPlan grown = plan_of(larger, 1);
            ASSERT_EQ(grown.rounds.size(), plan.rounds.size() + 1) << smaller << ' ' << larger;
            for (size_t round = 0; round < plan.rounds.size(); ++round)
                EXPECT_EQ(grown.rounds[round].samples, plan.rounds[round].samples) << smaller << ' ' << larger;
        }
    }
    EXPECT_EQ(larger_sets(kPilotSamples, 500000), (std::vector<uint64_t>{32768, 65536}));
    EXPECT_EQ(larger_sets(kGuideSamples, 500000), (std::vector<uint64_t>{131072, 262144, 500000}));
    EXPECT_TRUE(larger_sets(kGuideSamples, 100000).empty());
    EXPECT_TRUE(larger_sets(2 * kPilotSamples, 500000).empty());
}

/// Only tables with subspaces can guide, and only algorithms with tables learn.
TEST(GuidedTraining, RefusesWhatCannotGuideOrLearn) {
    const auto scene = testing::diffuse_box(), other = testing::delta_lights();
    const Tables foreign(testing::random_tables(other->emitters(), 3));
    EXPECT_EQ(TrainingGenerator::create(*scene, settings_of(1), foreign).status().code(), StatusCode::kDataLoss);
    for (const AlgorithmInfo* row : catalog()) {
        const RenderSettings settings = testing::settings_of(std::string(row->name));
        const Status status = TrainingGenerator::create(*scene, settings).status();
        EXPECT_EQ(status.code(), settings.algorithm.learning() ? StatusCode::kOk : StatusCode::kFailedPrecondition) << row->name;
    }
}

}  // namespace
}  // namespace lightloom
