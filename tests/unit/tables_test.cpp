// The tables as data: what is written is read again, what is damaged is refused, and what trains them is deterministic.

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <chrono>
#include <cstring>
#include <limits>
#include <thread>

#include "common/tables/emission_part.h"
#include "common/tables/gain_part.h"
#include "common/transport/training.h"
#include "tests/support/table_render.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

RenderSettings small_settings(uint64_t seed = 3) {
    return testing::settings_of(
        "spcbpt",
        {{"training-paths", "3000"}, {"light-subspaces", "60"}, {"eye-subspaces", "40"}, {"cache", "500"}, {"windows", "4"}}, seed);
}

/// What spcbpt learns of a scene.
SubspaceTables learned(const Scene& scene, uint64_t seed = 3) {
    TrainingReport report;
    const auto tables = make_tables(scene, small_settings(seed), {}, &report);
    if (!tables.ok()) throw std::runtime_error(tables.status().message());
    return *tables->get<SubspaceTables>();
}

TrainingData small_data(const std::shared_ptr<const Scene>& scene, uint64_t samples = 600) {
    return testing::trace_training(*scene, small_settings(), {0, samples, samples});
}

TEST(Tables, SerializedAndParsedAreTheSame) {
    for (const testing::NamedScene& named : testing::kScenes) {
        const auto scene = named.make();
        const SubspaceTables random = testing::random_tables(scene->emitters(), 1);
        for (const SubspaceTables& tables : {random, learned(*scene), trivial_tables(scene->emitters())}) {
            ASSERT_TRUE(tables.validate(scene->emitters()).ok()) << named.name;
            const std::string bytes = serialize(tables);
            const Result<SubspaceTables> again = parse_subspace_tables(bytes);
            ASSERT_TRUE(again.ok()) << again.status().message();
            EXPECT_TRUE(again->validate(scene->emitters()).ok());
            EXPECT_EQ(serialize(*again), bytes);
            EXPECT_EQ(again->light_count, tables.light_count);
            EXPECT_EQ(again->division.cell_count(), tables.division.cell_count());
            EXPECT_EQ(again->gamma, tables.gamma);
            EXPECT_EQ(again->energy, tables.energy);
            EXPECT_EQ(again->window, tables.window);
            EXPECT_EQ(again->vertices_per_path, tables.vertices_per_path);
        }
    }
}

/// Whichever byte it is: of the magic, a name, a size, a digest, a separator or a value.
TEST(Tables, EveryDamagedByteIsDetected) {
    const auto scene = testing::diffuse_box();
    testing::RandomTableOptions options;
    options.light_count = 5, options.eye_count = 3, options.tree_leaves = 6;
    const std::string bytes = serialize(testing::random_tables(scene->emitters(), 2, options));
    for (size_t i = 0; i < bytes.size(); ++i) {
        for (const char flip : {char(0x01), char(0x20), char(0x80)}) {
            std::string damaged = bytes;
            damaged[i] = char(damaged[i] ^ flip);
            const Result<SubspaceTables> parsed = parse_subspace_tables(damaged);
            EXPECT_FALSE(parsed.ok()) << "byte " << i << " flipped by " << int(flip);
            if (!parsed.ok()) {
                EXPECT_EQ(parsed.status().code(), StatusCode::kDataLoss);
            }
        }
    }
    for (size_t size = 0; size < bytes.size(); ++size)
        EXPECT_FALSE(parse_subspace_tables(std::string_view(bytes).substr(0, size)).ok()) << "cut to " << size << " bytes";
    EXPECT_FALSE(parse_subspace_tables(bytes + "x").ok());
    EXPECT_FALSE(parse_subspace_tables(bytes + bytes.substr(bytes.find('\n') + 1)).ok()) << "every table twice";
}

/// A part of a container, for its own sake.
template <int kNumber>
struct Numbered {
    int value = 0;

    static const TablePart kPart;
};
template <int kNumber>
const TablePart Numbered<kNumber>::kPart{
    kNumber == 0   ? "a-part"
    : kNumber == 1 ? "b-part"
                   : "c-part",
    [](const void* part) { return std::string(1, char(static_cast<const Numbered*>(part)->value)); },
    [](std::string_view bytes) -> Result<std::shared_ptr<const void>> {
        if (bytes.size() != 1) return data_loss("not one byte");
        return std::shared_ptr<const void>(std::make_shared<const Numbered>(Numbered{int(bytes[0])}));
    },
    [](const void* part, const EmitterSet&) {
        return static_cast<const Numbered*>(part)->value == 66 ? data_loss("the value is 66") : Status();
    }};

TEST(Tables, AreNamedPartsThatKnowNothingOfOneAnother) {
    using A = Numbered<0>;
    using B = Numbered<1>;
    using C = Numbered<2>;
    const TablePart* const both[] = {&A::kPart, &B::kPart};
    const TablePart* const others[] = {&A::kPart, &C::kPart};
    const auto scene = testing::diffuse_box();
    Tables tables;
    EXPECT_TRUE(tables.empty());
    EXPECT_TRUE(tables.consist_of({}));
    tables.set(std::make_shared<const B>(B{7}));
    EXPECT_FALSE(tables.consist_of(both));
    tables.set(std::make_shared<const A>(A{5}));
    EXPECT_TRUE(tables.consist_of(both));
    EXPECT_FALSE(tables.consist_of(others));
    EXPECT_FALSE(tables.consist_of(std::span(both).first(1)));
    EXPECT_EQ(tables.get<A>()->value, 5);
    EXPECT_EQ(tables.get<C>(), nullptr);
    EXPECT_TRUE(tables.validate(scene->emitters()).ok());

    // The bytes do not know in which order parts came, and every part comes back.
    Tables turned(A{5});
    turned.set(std::make_shared<const B>(B{7}));
    const std::string bytes = serialize(tables);
    EXPECT_EQ(serialize(turned), bytes);
    const auto again = parse_tables(bytes, both);
    ASSERT_TRUE(again.ok()) << again.status().message();
    EXPECT_EQ(again->get<A>()->value, 5);
    EXPECT_EQ(again->get<B>()->value, 7);
    EXPECT_EQ(serialize(*again), bytes);

    const Status unknown = parse_tables(bytes, others).status();
    EXPECT_EQ(unknown.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(unknown.message().find("b-part"), std::string::npos) << unknown.message();
    for (size_t i = 0; i < bytes.size(); ++i) {
        std::string damaged = bytes;
        damaged[i] = char(damaged[i] ^ 0x01);
        const Status refused = parse_tables(damaged, both).status();
        // A byte of a name makes it another part's name, which is nobody's here.
        EXPECT_TRUE(refused.code() == StatusCode::kDataLoss || refused.code() == StatusCode::kFailedPrecondition) << "byte " << i;
        if (i == 0) continue;
        const auto cut = parse_tables(std::string_view(bytes).substr(0, i), both);
        EXPECT_TRUE(!cut.ok() || !cut->consist_of(both)) << "cut to " << i << " bytes";
    }

    // A part replaces one of its type, and what is wrong with one is wrong with all.
    turned.set(std::make_shared<const A>(A{66}));
    EXPECT_EQ(turned.get<A>()->value, 66);
    EXPECT_EQ(tables.get<A>()->value, 5);
    EXPECT_EQ(turned.validate(scene->emitters()).code(), StatusCode::kDataLoss);
}

TEST(Tables, EveryBadTableIsRefusedByName) {
    const auto scene = testing::environment_lit();
    const SubspaceTables good = testing::random_tables(scene->emitters(), 4);
    ASSERT_TRUE(good.validate(scene->emitters()).ok());
    const auto leaf = [](uint32_t label) { return SubspaceTree({SubspaceTree::make_leaf(label)}); };
    const std::pair<const char*, std::function<void(SubspaceTables&)>> mutations[] = {
        {"no light subspace", [](SubspaceTables& t) { t.light_count = 0; }},
        {"no eye subspace", [](SubspaceTables& t) { t.eye_count = 0; }},
        {"too many subspaces", [](SubspaceTables& t) { t.light_count = SubspaceTables::kMaxSubspaces + 1; }},
        {"division of no scene", [](SubspaceTables& t) { t.division = LightDivision(); }},
        {"division of another scene",
         [](SubspaceTables& t) {
             t.division = LightDivision(std::vector<LightDivision::Cells>(t.division.cells().size() + 1), t.division.finite());
         }},
        {"cells beyond",
         [](SubspaceTables& t) {
             auto cells = t.division.cells();
             for (auto& c : cells)
                 if (c.side > 0) c = {uint16_t(t.light_count - 1), 2};
             t.division = LightDivision(cells, t.division.finite());
         }},
        {"an infinite light without cells",
         [](SubspaceTables& t) {
             t.division = LightDivision(std::vector<LightDivision::Cells>(t.division.cells().size()), t.division.finite());
         }},
        {"a finite light with cells",
         [](SubspaceTables& t) {
             t.division = LightDivision(std::vector<LightDivision::Cells>(t.division.cells().size(), {0, 1}), t.division.finite());
         }},
        {"label of a finite light beyond",
         [&](SubspaceTables& t) { t.division = LightDivision(t.division.cells(), leaf(t.light_count)); }},
        {"division without nodes",
         [](SubspaceTables& t) {
             t.division = LightDivision(t.division.cells(), SubspaceTree(std::vector<SubspaceTree::Node>()));
         }},
        {"light label beyond", [&](SubspaceTables& t) { t.light_tree = leaf(t.light_count); }},
        {"eye label beyond", [&](SubspaceTables& t) { t.eye_tree = leaf(t.eye_count); }},
        {"tree without nodes", [](SubspaceTables& t) { t.eye_tree = SubspaceTree(std::vector<SubspaceTree::Node>()); }},
        {"tree with a loop",
         [](SubspaceTables& t) {
             t.eye_tree = SubspaceTree({SubspaceTree::make_inner(0, 0, 0), SubspaceTree::make_leaf(0)});
         }},
        {"tree with a missing child",
         [](SubspaceTables& t) {
             t.eye_tree = SubspaceTree({SubspaceTree::make_inner(0, 0, 1), SubspaceTree::make_leaf(0)});
         }},
        {"tree with an unknown axis",
         [](SubspaceTables& t) {
             t.light_tree = SubspaceTree(
                 {SubspaceTree::make_inner(SubspaceTree::kAxes, 0, 1), SubspaceTree::make_leaf(0), SubspaceTree::make_leaf(0)});
         }},
        {"tree with a threshold that is no number",
         [](SubspaceTables& t) {
             t.light_tree =
                 SubspaceTree({SubspaceTree::make_inner(0, kNan, 1), SubspaceTree::make_leaf(0), SubspaceTree::make_leaf(0)});
         }},
        {"Q too short", [](SubspaceTables& t) { t.energy.pop_back(); }},
        {"Q zero", [](SubspaceTables& t) { t.energy[1] = 0; }},
        {"Q negative", [](SubspaceTables& t) { t.energy[1] = -1; }},
        {"Q not a number", [](SubspaceTables& t) { t.energy[1] = kNan; }},
        {"Q infinite", [](SubspaceTables& t) { t.energy[1] = kInfinity; }},
        {"Gamma too short", [](SubspaceTables& t) { t.gamma.pop_back(); }},
        {"Gamma zero", [](SubspaceTables& t) { t.gamma[2] += std::exchange(t.gamma[3], 0.0f); }},
        {"Gamma not a number", [](SubspaceTables& t) { t.gamma[3] = kNan; }},
        {"column that does not sum to one", [](SubspaceTables& t) { t.gamma[3] *= 1.5f; }},
        {"windows too short", [](SubspaceTables& t) { t.window.pop_back(); }},
        {"window of nothing", [](SubspaceTables& t) { t.window[0] = 0; }},
        {"window beyond what a unit can trace", [](SubspaceTables& t) { t.window[0] = 60000; }},
        {"no vertices", [](SubspaceTables& t) { t.vertices_per_path = 0; }},
        {"vertices not a number", [](SubspaceTables& t) { t.vertices_per_path = std::nan(""); }},
        {"vertices infinite", [](SubspaceTables& t) { t.vertices_per_path = HUGE_VAL; }},
    };
    for (const auto& [name, change] : mutations) {
        SubspaceTables bad = good;
        change(bad);
        const Status status = bad.validate(scene->emitters());
        EXPECT_EQ(status.code(), StatusCode::kDataLoss) << name;
        EXPECT_FALSE(status.message().empty()) << name;
        // And nothing renders from them.
        Tables tables(bad);
        tables.set(std::make_shared<const EmissionPart>());
        tables.set(std::make_shared<const GainPart>());
        EXPECT_EQ(Renderer::create(scene, small_settings(), tables).status().code(), StatusCode::kDataLoss) << name;
    }
}

TEST(TrainingData, NormalsOf32BitsPointWhereTheyDid) {
    Rng rng({1, Stage::kTraining, 0, 0});
    for (int i = 0; i < 20000; ++i) {
        // Axes and planes of the octahedron, too, where the projection folds.
        const auto coordinate = [&] { return rng.below(4) == 0 ? 0.0f : 2 * float(rng.uniform_double()) - 1; };
        const Vec3 v{coordinate(), coordinate(), coordinate()};
        if (!(length_squared(v) > 0)) continue;
        const PackedNormal packed = v;
        const Vec3 n = normalize(v), back = packed;
        EXPECT_LT(length(back - n), 7e-5f) << v.x << ' ' << v.y << ' ' << v.z;
        EXPECT_NEAR(length(back), 1, 1e-6f);
    }
    const float infinity = std::numeric_limits<float>::infinity();
    for (const Vec3& none : {Vec3{0, 0, 0}, Vec3{infinity, 0, 0}, Vec3{0, kNan, 0}})
        EXPECT_EQ(Vec3(PackedNormal(none)), (Vec3{0, 0, 1}));
}

TEST(TrainingData, SerializedAndParsedAreTheSame) {
    for (const auto make : {testing::diffuse_box, testing::environment_lit, testing::caustic_of_a_point_light}) {
        const auto scene = make();
        const TrainingData data = small_data(scene);
        ASSERT_TRUE(data.validate(scene->emitters().all().size()).ok());
        const std::string bytes = serialize(data);
        const Result<TrainingData> again = parse_training_data(bytes);
        ASSERT_TRUE(again.ok());
        EXPECT_TRUE(again->validate(scene->emitters().all().size()).ok());
        EXPECT_EQ(serialize(*again), bytes);
    }
}

/// Units are joined in their order: the data do not know how they were cut.
TEST(TrainingData, PartsJoinToTheWhole) {
    const auto scene = testing::glossy();
    const uint64_t total = 2048;
    const TrainingData whole = small_data(scene, total);
    TrainingData joined;
    for (uint64_t first = 0; first < total; first += 512) {
        const TrainingData part = testing::trace_training(*scene, small_settings(), {first, 512, total});
        ASSERT_TRUE(joined.append(part).ok());
    }
    EXPECT_EQ(serialize(joined), serialize(whole));
    const auto other_frame = testing::environment_lit();
    TrainingData other = small_data(other_frame);
    other.blocks_x += 1;
    other.block_sum.resize(size_t(other.blocks_x) * size_t(other.blocks_y));
    EXPECT_FALSE(joined.append(other).ok());
}

/// The wire carries a digest beside them; what the parser owes is that no damage leads out of the arrays: it refuses, validation
/// refuses, or training works, with valid tables.
TEST(TrainingData, DamageIsRefusedOrHarmless) {
    const auto scene = testing::diffuse_box();
    const size_t emitters = scene->emitters().all().size();
    const TrainingData data = small_data(scene, 60);
    const std::string bytes = serialize(data);
    const size_t header = 56, block_sums = data.block_sum.size() * sizeof(double);
    Rng rng({5, Stage::kTraining, 0, 0});
    for (int round = 0; round < 3000; ++round) {
        std::string damaged = bytes;
        // Every byte of the header, then any.
        const size_t at = round < int(header) ? size_t(round) : rng.below(uint32_t(bytes.size()));
        damaged[at] = char(damaged[at] ^ char(1 + rng.below(255)));
        const Result<TrainingData> parsed = parse_training_data(damaged);
        if (at < 16 || (at >= 32 && at < header)) {  // between them: how many samples there were
            EXPECT_FALSE(parsed.ok()) << "byte " << at;
        }
        if (at >= header + block_sums) {
            ASSERT_TRUE(parsed.ok());
        }
        if (!parsed.ok() || !parsed->validate(emitters).ok()) continue;
        TrainingReport report;
        TrainingOptions options;
        options.light_subspaces = options.eye_subspaces = 20;
        const Result<SubspaceTables> tables = train_tables(*parsed, scene->emitters(), options, {}, &report);
        if (tables.ok()) {
            EXPECT_TRUE(tables->validate(scene->emitters()).ok());
        }
    }
    for (size_t size = 0; size < bytes.size(); size += 1 + size / 50)
        EXPECT_FALSE(parse_training_data(std::string_view(bytes).substr(0, size)).ok()) << "cut to " << size;
    EXPECT_FALSE(parse_training_data(bytes + "12345678").ok());
}

TEST(TrainingData, BadPathsAreRefused) {
    const auto scene = testing::diffuse_box();
    const TrainingData good = small_data(scene);
    ASSERT_FALSE(good.paths.empty());
    ASSERT_FALSE(good.light_paths.empty());
    const size_t emitters = scene->emitters().all().size();
    const std::pair<const char*, std::function<void(TrainingData&)>> mutations[] = {
        {"no frame", [](TrainingData& d) { d.blocks_x = 0; }},
        {"another frame", [](TrainingData& d) { d.block_sum.pop_back(); }},
        {"no vertex", [](TrainingData& d) { d.paths[0].vertex_count = 0; }},
        {"vertices beyond", [](TrainingData& d) { d.paths.back().first_vertex = uint32_t(d.vertices.size()) - 1; }},
        {"vertices that wrap around", [](TrainingData& d) { d.paths[0].first_vertex = 0xffffffffu; }},
        {"light path beyond", [](TrainingData& d) { d.light_paths[0].vertex_count = 1u << 30; }},
        {"block beyond", [](TrainingData& d) { d.paths[0].block = uint32_t(d.block_sum.size()); }},
        {"emitter beyond", [&](TrainingData& d) { d.paths[0].emitter = uint32_t(emitters); }},
        {"vertex nowhere", [](TrainingData& d) { d.vertices[1].position.y = kNan; }},
    };
    for (const auto& [name, change] : mutations) {
        TrainingData bad = good;
        change(bad);
        EXPECT_FALSE(bad.validate(emitters).ok()) << name;
    }
}

TEST(TrainingData, PathsOutOfRangeAreLeftOutAndCounted) {
    const auto scene = testing::diffuse_box();
    const TrainingData good = small_data(scene);
    ASSERT_GT(good.paths.size(), 20u);
    ASSERT_GT(good.light_paths.size(), 1u);
    TrainingOptions options;
    options.light_subspaces = options.eye_subspaces = 20;
    const auto train = [&](const TrainingData& data, TrainingReport* report) {
        EXPECT_TRUE(data.validate(scene->emitters().all().size()).ok());
        const Result<SubspaceTables> tables = train_tables(data, scene->emitters(), options, {}, report);
        EXPECT_TRUE(tables.ok()) << tables.status().message();
        return tables.ok() ? serialize(*tables) : std::string();
    };
    TrainingReport report;
    train(good, &report);
    EXPECT_EQ(report.out_of_range, 0u);
    EXPECT_EQ(report.note.find("range"), std::string::npos) << report.note;
    // Left out means that the rest trains as if they had never been there.
    TrainingData without = good;
    for (const size_t x : {3, 5, 7, 9}) without.paths[x].estimate = without.paths[x].square = 0;
    const TrainingPath& light = good.light_paths[1];
    for (uint32_t i = 0; i < light.vertex_count; ++i) without.vertices[light.first_vertex + i].density = 0;
    TrainingData wild = good;
    wild.paths[3].estimate = kNan;
    wild.paths[5].square = kInfinity;
    wild.vertices[wild.paths[7].first_vertex].density = kInfinity;
    wild.vertices[wild.paths[9].first_vertex + 1].density = kNan;
    wild.vertices[light.first_vertex].density = kInfinity;
    TrainingReport again;
    EXPECT_EQ(train(wild, &again), train(without, &report));
    EXPECT_EQ(again.out_of_range, 5u);
    const std::string all = std::to_string(good.paths.size() + good.light_paths.size());
    EXPECT_NE(again.note.find("5 of " + all + " training paths"), std::string::npos) << again.note;
    wild.block_sum[0] = std::numeric_limits<double>::infinity();
    train(wild, &again);
}

TEST(TrainingData, RefusesToGrowBeyondItsIndices) {
    const TrainingData part = small_data(testing::diffuse_box(), 60);
    TrainingData all;
    ASSERT_TRUE(all.append(part, 2 * part.vertices.size()).ok());
    ASSERT_TRUE(all.append(part, 2 * part.vertices.size()).ok());
    const Status full = all.append(part, 2 * part.vertices.size());
    EXPECT_EQ(full.code(), StatusCode::kResourceExhausted);
    EXPECT_NE(full.message().find("training-paths"), std::string::npos) << full.message();
    EXPECT_EQ(all.vertices.size(), 2 * part.vertices.size()) << "nothing was taken in";
}

/// Stopped at any moment, training returns soon, whichever loop it is in.
TEST(Training, ActsOnAStopRequestWithinASecond) {
    const auto scene = testing::glossy();
    const TrainingData part = small_data(scene, 4096);
    TrainingData data;
    for (int i = 0; i < 12; ++i) ASSERT_TRUE(data.append(part).ok());
    for (const GammaTrainer trainer : {GammaTrainer::kMm, GammaTrainer::kAdam}) {
        TrainingOptions options;
        options.trainer = trainer;
        for (const int milliseconds : {0, 20, 60, 150, 250}) {
            std::stop_source stop;
            std::chrono::steady_clock::time_point asked;
            std::jthread clock([&] {
                std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
                asked = std::chrono::steady_clock::now();
                stop.request_stop();
            });
            TrainingReport report;
            const Result<SubspaceTables> tables = train_tables(data, scene->emitters(), options, {stop.get_token(), {}}, &report);
            const auto answered = std::chrono::steady_clock::now();
            clock.join();
            EXPECT_LT(answered - asked, std::chrono::seconds(1)) << milliseconds;
            if (answered < asked) continue;  // a fast machine was through before
            EXPECT_EQ(tables.status().code(), StatusCode::kCancelled) << milliseconds;
        }
    }
}

/// Whoever waits sees how far it is: ascending shares, up to the last few steps (which finer subspaces than
/// the data support do not take), a few per cent at a time.
TEST(Training, TellsHowFarItIs) {
    const auto scene = testing::glossy();
    const TrainingData data = small_data(scene, 4096);
    std::vector<double> shares{0};
    TrainingReport report;
    ASSERT_TRUE(train_tables(data, scene->emitters(), {}, {{}, [&](double share) { shares.push_back(share); }}, &report).ok());
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_GT(shares.back(), 0.9);
    EXPECT_LE(shares.back(), 1);
    for (size_t i = 1; i < shares.size(); ++i) EXPECT_LE(shares[i] - shares[i - 1], 0.11);
}

/// Training twice, on one thread and on two, makes the same bytes; another seed others.
TEST(Training, IsDeterministicOnAnyNumberOfThreads) {
    tbb::global_control allowance(tbb::global_control::max_allowed_parallelism, 4);
    for (const auto make : {testing::glossy, testing::environment_lit, testing::delta_lights}) {
        const auto scene = make();
        const auto on_threads = [&](int threads, uint64_t seed) {
            std::string bytes;
            tbb::task_arena(threads).execute([&] { bytes = serialize(learned(*scene, seed)); });
            return bytes;
        };
        const std::string alone = on_threads(1, 3);
        EXPECT_EQ(on_threads(2, 3), alone);
        EXPECT_EQ(on_threads(4, 3), alone);
        EXPECT_NE(on_threads(1, 4), alone);
    }
}

}  // namespace
}  // namespace lightloom
