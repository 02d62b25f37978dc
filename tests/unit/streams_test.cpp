// No two parts of a job share random numbers: not two groups, not two tiles of a group, not training and rendering. Where they do,
// every unit still looks right on its own and the mean is still right, but the error does not fall with the number of groups, and
// the variance that group images show is not the one that the image has. Every row of the catalog is put to the test.
//
// The statistic. D = X - X', the cells of a unit under one seed less those under another, has mean zero whatever the image is. If
// units A and B are independent, exchanging the two seeds in B alone changes nothing, so that D_A . D_B is as likely to be
// positive as negative, given its size. With D_g of unit g, summed over pairs of seeds and units g,
//     R - 1 = 2 sum U / sum |D_g|^2,   U = D_g . (D_1 + ... + D_{g-1}),
// where R = Var(mean of G units) G / Var(unit), over cells together. The U are symmetric given those before them, so that
// P(|sum U| > z sqrt(sum U^2)) <= 2 exp(-z^2 / 2), exactly and for any distribution [Hoeffding 1963; de la Pena 1999, for symmetric
// increments]: kLevel makes that 1.4e-9, below 1e-6 for 700 tests, of which each row of the catalog has at most 17.
// Units that share everything have R = G and sum U near sqrt(n sum U^2), n the number of U: with 400 pairs of seeds and four units
// that is five times what is allowed, and the interval of R is 1 +- 0.12, so that a tenth of the variance may not be shared either.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "common/work/job.h"
#include "tests/support/estimates.h"
#include "tests/support/small_scenes.h"

namespace lightloom {

/// For messages of tests.
static void PrintTo(const AlgorithmInfo* row, std::ostream* out) { *out << row->name; }

namespace {

constexpr double kLevel = 6.5;
constexpr int kUnits = 4, kSeedPairs = 400;
constexpr int kWidth = 32, kHeight = 8, kCellsAcross = 8, kCellsDown = 2, kCells = kCellsAcross * kCellsDown;
constexpr uint64_t kTrainingSamples = 256;

using Cells = std::array<double, kCells>;

double dot(const Cells& a, const Cells& b) {
    double sum = 0;
    for (int i = 0; i < kCells; ++i) sum += a[size_t(i)] * b[size_t(i)];
    return sum;
}
Cells difference(Cells a, const Cells& b) {
    for (int i = 0; i < kCells; ++i) a[size_t(i)] -= b[size_t(i)];
    return a;
}
double grey(const double* rgb) { return rgb[0] + rgb[1] + rgb[2]; }
int cell_at(int x, int y, int width, int height) { return y * kCellsDown / height * kCellsAcross + x * kCellsAcross / width; }

Cells camera_cells(const Partial& partial) {
    Cells cells{};
    const int width = partial.tile.width(), height = partial.tile.height();
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            cells[size_t(cell_at(x, y, width, height))] += grey(&partial.camera[3 * (size_t(y) * size_t(width) + size_t(x))]);
    return cells;
}
Cells splat_cells(const Partial& partial) {
    Cells cells{};
    for (const SplatSum& s : partial.splats)
        cells[size_t(cell_at(int(s.pixel) % kWidth, int(s.pixel) / kWidth, kWidth, kHeight))] += grey(s.rgb.data());
    return cells;
}
/// Both, in proportion to what they add to an image of a unit over the whole frame.
Cells image_cells(const Partial& partial) {
    Cells cells{};
    if (partial.samples_per_pixel > 0) cells = camera_cells(partial);
    const Cells splats = splat_cells(partial);
    const double camera = partial.samples_per_pixel > 0 ? 1.0 / partial.samples_per_pixel : 0;
    for (int i = 0; i < kCells; ++i) {
        double& cell = cells[size_t(i)];
        cell *= camera;
        if (partial.light_paths > 0) cell += splats[size_t(i)] / double(partial.light_paths);
    }
    return cells;
}

/// Sums of U over units that are to be independent.
class Independence {
  public:
    /// The differences of one pair of seeds, unit by unit.
    void add(const std::vector<Cells>& differences) {
        Cells before{};
        for (const Cells& d : differences) {
            const double u = dot(d, before);
            sum_ += u, squares_ += u * u, size_ += dot(d, d);
            for (int i = 0; i < kCells; ++i) before[size_t(i)] += d[size_t(i)];
        }
    }
    /// Where units share a low-discrepancy sequence on purpose, their errors may cancel: R may then be less than one.
    void check(const std::string& what, bool may_cancel) const {
        if (size_ == 0) return;  // the row has nothing of this kind
        const double r = 1 + 2 * sum_ / size_, half = 2 * kLevel * std::sqrt(squares_) / size_;
        EXPECT_LT(half, 0.5 * (kUnits - 1)) << what << ": the interval says nothing";
        EXPECT_LE(r, 1 + half) << what << ": Var(mean of units) * units / Var(unit) is too large; they share random numbers";
        if (!may_cancel) {
            EXPECT_GE(r, 1 - half) << what;
        }
        ::testing::Test::RecordProperty(what, std::to_string(r) + " +- " + std::to_string(half));
    }

  private:
    double sum_ = 0, squares_ = 0, size_ = 0;
};

std::shared_ptr<const Scene> bounded_scene() {
    testing::SceneBuilder b;
    const MaterialId white = b.diffuse(Rgb(0.7f));
    b.quad({-2, 0, -1}, {0, 0, 2}, {4, 0, 0}, white);
    b.quad({-2, 0.3f, 1.5f}, {0, 1.7f, 0}, {4, 0, 0}, b.diffuse({0.7f, 0.5f, 0.4f}));
    b.sphere({0.3f, 0.8f, 0.3f}, 0.4f, b.diffuse({0.3f, 0.5f, 0.7f}));
    b.quad({-0.7f, 2.5f, -0.7f}, {1.4f, 0, 0}, {0, 0, 1.4f}, b.diffuse(Rgb(0.2f)), b.emission({6, 5, 4}));
    b.look({0, 1.4f, -3}, {0, 0.6f, 0}, 16);
    b.description().film.width = kWidth, b.description().film.height = kHeight;
    return b.build();
}

/// Whose light sub-path a splat is: two units that trace the same one add the very same numbers to the same pixel.
using SplatIdentity = std::tuple<uint32_t, double, double, double>;

class Streams : public ::testing::TestWithParam<const AlgorithmInfo*> {
  protected:
    void SetUp() override {
        scene_ = bounded_scene();
        // So few paths in a cache that it holds those that splat and others besides.
        set({{"cache", "200"}});
        if (!GetParam()->learning) return;
        // One table for all seeds: the units of a job share it as well, and given the table they are independent.
        TrainingReport report;
        auto made = make_tables(*scene_, settings(1), {}, &report);
        ASSERT_TRUE(made.ok()) << made.status().message();
        tables_ = *std::move(made);
    }
    RenderSettings settings(uint64_t seed) const {
        const std::string name(GetParam()->name);
        return testing::settings_of(name, testing::with_all_learned(name, parameters_), seed, 3);
    }
    /// Sets what the row has of these parameters.
    void set(const std::map<std::string, std::string>& parameters) {
        for (const auto& [name, value] : parameters)
            if (settings(1).algorithm.has(name)) parameters_[name] = value;
    }
    bool has_tiles() const { return GetParam()->frame == FrameShape::kTiles; }
    std::vector<Rect> bands() const {
        std::vector<Rect> tiles;
        for (int i = 0; i < kUnits; ++i) tiles.push_back({0, i * kHeight / kUnits, kWidth, (i + 1) * kHeight / kUnits});
        return tiles;
    }
    /// The units of a group.
    std::vector<WorkUnit> units(uint64_t first_iteration, const std::vector<Rect>& tiles, uint32_t iterations = 1) const {
        return split_group({0, first_iteration, iterations}, tiles, plan_options(scene_->frame(), settings(1).algorithm));
    }
    std::vector<Partial> render(uint64_t seed, const std::vector<WorkUnit>& units) const {
        const auto renderer = Renderer::create(scene_, settings(seed), tables_);
        if (!renderer.ok()) throw std::runtime_error(renderer.status().message());
        std::vector<Partial> partials;
        for (const WorkUnit& unit : units) {
            Result<Partial> partial = (*renderer)->render(unit.render, {});
            if (!partial.ok()) throw std::runtime_error(partial.status().message());
            partials.push_back(*std::move(partial));
        }
        return partials;
    }
    /// A unit of training.
    TrainingData train(uint64_t seed, bool guided, uint64_t first_sample) const {
        const auto generator = TrainingGenerator::create(*scene_, settings(seed), guided ? tables_ : Tables());
        if (!generator.ok()) throw std::runtime_error(generator.status().message());
        Result<TrainingData> data = generator->trace({first_sample, kTrainingSamples, kTrainingSamples}, {});
        if (!data.ok()) throw std::runtime_error(data.status().message());
        return *std::move(data);
    }
    /// Groups that begin at `first(g)`, each over the whole frame.
    template <class First>
    std::vector<WorkUnit> groups(First&& first) const {
        std::vector<WorkUnit> all;
        for (int g = 0; g < kUnits; ++g) all.push_back(units(first(g), {scene_->frame().crop}).front());
        return all;
    }
    /// Iterations of a job far apart at random. The low-discrepancy sequence of a pixel runs over its iterations, so that those of
    /// neighbouring groups cancel one another's errors; two random places of the sequence are independent.
    std::vector<WorkUnit> scattered_groups(uint64_t seed) const {
        Rng rng({seed, Stage::kPairing, 0, 0});
        return groups([&](int) { return rng.next_u64() >> 33; });
    }
    std::vector<WorkUnit> first_groups() const {
        return groups([](int g) { return uint64_t(g); });
    }

    /// Tests units made by `work(seed)` for all pairs of seeds.
    template <class Work>
    void check_independence(const std::string& what, bool may_cancel, bool whole_frame, Work&& work) const {
        Independence camera, splats, image;
        for (uint64_t pair = 0; pair < kSeedPairs; ++pair) {
            const uint64_t a = 1000 + 2 * pair, b = a + 1;
            const std::vector<Partial> first = render(a, work(a)), second = render(b, work(b));
            std::vector<Cells> camera_d, splat_d, image_d;
            for (size_t u = 0; u < first.size(); ++u) {
                camera_d.push_back(difference(camera_cells(first[u]), camera_cells(second[u])));
                splat_d.push_back(difference(splat_cells(first[u]), splat_cells(second[u])));
                image_d.push_back(difference(image_cells(first[u]), image_cells(second[u])));
            }
            camera.add(camera_d), splats.add(splat_d);
            if (whole_frame) image.add(image_d);
        }
        camera.check(what + "_camera", may_cancel);
        splats.check(what + "_splats", may_cancel);
        image.check(what + "_image", may_cancel);
    }

    std::shared_ptr<const Scene> scene_;
    std::map<std::string, std::string> parameters_;
    Tables tables_;
};

/// No light sub-path is traced by two groups or by two tiles: its splats would be found twice, bit for bit.
/// Mutations: the key of light sub-paths without the group's first iteration (light_cache.h, bdpt.h, light.h: iteration := 0), or
/// without the number of the tile's first path (light_cache.h, unit_loop.h: first_light_path := 0), fail this for every row that
/// uses them.
TEST_P(Streams, NoLightSubPathIsTracedTwice) {
    uint64_t splats = 0, twice = 0;
    for (uint64_t seed = 42; seed < 50; ++seed) {
        std::vector<WorkUnit> work = first_groups();
        for (const WorkUnit& unit : scattered_groups(seed)) work.push_back(unit);
        if (has_tiles())
            for (const WorkUnit& unit : units(kUnits, bands())) work.push_back(unit);
        std::set<SplatIdentity> found;
        for (const Partial& partial : render(seed, work))
            for (const SplatSum& s : partial.splats) {
                if (grey(s.rgb.data()) == 0) continue;
                ++splats;
                twice += !found.insert({s.pixel, s.rgb[0], s.rgb[1], s.rgb[2]}).second;
            }
    }
    EXPECT_EQ(twice, 0u) << "of " << splats << " splat sums are those of another unit";
    if (GetParam()->light_paths_per_pixel) {
        EXPECT_GT(splats, 400u);
    }
}

/// Nor by two units of training, whichever round they belong to.
/// Mutation: trace_guided() with first_light_path := 0 and group_first_iteration := 0 fails this.
TEST_P(Streams, NoLightSubPathIsTrainedOnTwice) {
    if (!GetParam()->learning || learning_plan(settings(1).algorithm).energy_paths == 0) return;
    std::set<std::tuple<float, float, float>> starts;
    uint64_t kept = 0;
    for (uint64_t unit = 0; unit < 4; ++unit) {
        const TrainingData data = train(7, unit >= 2, unit * kTrainingSamples);
        kept += data.light_paths.size();
        for (const TrainingPath& path : data.light_paths) {
            const Vec3& p = data.vertices[path.first_vertex].position;
            starts.insert({p.x, p.y, p.z});
        }
    }
    EXPECT_GT(kept, 2 * kTrainingSamples);
    EXPECT_EQ(starts.size(), kept);
}

/// Mutations: light_cache.h, bdpt.h or light.h without the group's first iteration in the key of light sub-paths, and
/// camera_walk.h without the iteration in that of camera samples, fail this for the rows that use them.
TEST_P(Streams, ScatteredGroupsAreIndependent) {
    check_independence("scattered", false, true, [&](uint64_t seed) { return scattered_groups(seed); });
}

/// As a job has them: streams that only overlap, because they are numbered one after the other, would show here.
TEST_P(Streams, FirstGroupsAreNotCorrelated) {
    check_independence("first", true, true, [&](uint64_t) { return first_groups(); });
}

/// Mutation: first_light_path := 0 (light_cache.h, unit_loop.h) fails this for all rows that splat.
TEST_P(Streams, TilesAreNotCorrelated) {
    if (!has_tiles()) return;
    check_independence("tiles", true, false,
                       [&](uint64_t seed) { return units(scattered_groups(seed)[0].render.first_iteration, bands()); });
}

/// A cache so small that a unit's error is above all that of the light sub-paths in it, nearly all of them such as only fill it; in
/// a band of the frame after a few iterations, which take the noise of its camera samples down.
/// Mutations: light_cache.h without the group's first iteration in the key of those paths, or without their tile's first pixel,
/// fails this for the rows with a cache (neighbouring bands of the frame see the same light vertices).
TEST_P(Streams, CachesAreIndependent) {
    if (!settings(1).algorithm.has("cache")) return;
    set({{"cache", "8"}, {"light-paths", "0.002"}, {"connections", "8"}});
    check_independence("cache_scattered", false, true, [&](uint64_t seed) { return scattered_groups(seed); });
    if (!has_tiles()) return;
    check_independence("cache_tiles", true, false,
                       [&](uint64_t seed) { return units(scattered_groups(seed)[0].render.first_iteration, bands(), 8); });
}

/// Training looks at the same scene with the job's seed. The brightness of its blocks must not follow that of the first groups.
/// Mutation: training.cpp with kTrainingSeed := 0 fails this for the rows with tables.
TEST_P(Streams, TrainingIsIndependentOfRendering) {
    if (!GetParam()->learning) return;
    set({{"light-paths", "1"}});
    const std::vector<WorkUnit> group{first_groups().front()};
    for (const bool guided : {false, true}) {
        const auto brightness = [&](uint64_t seed) {
            const TrainingData data = train(seed, guided, 0);
            Cells cells{};
            for (int y = 0; y < data.blocks_y; ++y)
                for (int x = 0; x < data.blocks_x; ++x)
                    cells[size_t(cell_at(x, y, data.blocks_x, data.blocks_y))] += data.block_sum[size_t(y * data.blocks_x + x)];
            return cells;
        };
        double sums[2] = {}, squares[2] = {};
        for (uint64_t pair = 0; pair < kSeedPairs; ++pair) {
            const uint64_t a = 1000 + 2 * pair, b = a + 1;
            const Partial first = render(a, group)[0], second = render(b, group)[0];
            const Cells trained = difference(brightness(a), brightness(b));
            const double u[] = {dot(difference(camera_cells(first), camera_cells(second)), trained),
                                dot(difference(splat_cells(first), splat_cells(second)), trained)};
            for (int i = 0; i < 2; ++i) sums[i] += u[i], squares[i] += u[i] * u[i];
        }
        for (int i = 0; i < 2; ++i) {
            const std::string what = std::string(guided ? "guided" : "pilot") + (i == 0 ? "_camera" : "_splats");
            EXPECT_LE(std::fabs(sums[i]), kLevel * std::sqrt(squares[i])) << what;
            RecordProperty(what, std::to_string(squares[i] > 0 ? sums[i] / std::sqrt(squares[i]) : 0));
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Catalog, Streams, ::testing::ValuesIn(catalog().begin(), catalog().end()),
                         [](const ::testing::TestParamInfo<const AlgorithmInfo*>& row) { return std::string(row.param->name); });

}  // namespace
}  // namespace lightloom
