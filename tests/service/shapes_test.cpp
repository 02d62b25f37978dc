// Units of every shape through coordinator and workers, with algorithms that the product does not have (tests/support/stub_rows.h):
// whole frames, loops of the algorithm's own, splats alone. Whoever renders which unit when, the image has the same bytes.

#include <gtest/gtest.h>

#include <numeric>

#include "client/progressive_render.h"
#include "common/film/exr_io.h"
#include "common/transport/training.h"
#include "tests/service/forwarding_port.h"
#include "tests/service/light_crew.h"
#include "tests/service/table_service.h"
#include "tests/support/small_scenes.h"
#include "tests/support/stub_rows.h"

namespace lightloom {
namespace {

using namespace lightloom::testing;
using client::ProgressiveRender;

/// Before any test reads the catalog.
const bool kStubs = add_stub_rows();

constexpr char const* kStubNames[] = {kStubMerging, kStubPairing, kStubSplats};
/// More pixels than a tile has, so that a whole frame is something else than a tile.
const FrameLayout kLarge{520, 512, {0, 0, 520, 512}};
constexpr uint32_t kIterations = 3;
constexpr int kMaxDepth = 3;

std::shared_ptr<const Scene> large_box() {
    static const std::shared_ptr<const Scene> scene = [] {
        SceneBuilder b = cornell_builder();
        b.description().film.width = kLarge.width, b.description().film.height = kLarge.height;
        return b.build();
    }();
    return scene;
}

JobSpec stub_spec(const FakeService& service, const std::string& algorithm) {
    JobSpec spec = service.spec(kIterations);
    spec.algorithm = algorithm_of(algorithm);
    spec.max_depth = kMaxDepth;
    return spec;
}

/// Goes silent when its first unit is rendered: nothing of it arrives any more, not even a goodbye.
class VanishingPort final : public ForwardingPort {
  public:
    explicit VanishingPort(std::unique_ptr<WorkerPort> port) : ForwardingPort(*port), own_(std::move(port)) {}
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds, std::stop_token stop) override {
        if (leased_.exchange(true)) return gone();  // a worker asks from several threads
        auto leases = port_.lease_units(worker_id, wait_seconds, stop);
        if (!leases.ok() || leases->empty()) leased_ = false;
        return leases;
    }
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) override {
        return leased_ ? Result<std::vector<UnitReference>>(gone()) : port_.heartbeat(worker_id, running);
    }
    Result<SubmitAck> submit_result(const std::string&, const UnitLease&, Partial, double) override {
        vanished = true;
        return gone();
    }
    Status release_unit(const std::string&, const UnitReference&, const Status&) override { return gone(); }
    Status goodbye(const std::string&) override { return gone(); }

    std::atomic<bool> vanished{false};

  private:
    static Status gone() { return {StatusCode::kUnavailable, "the network is gone"}; }
    const std::unique_ptr<WorkerPort> own_;
    std::atomic<bool> leased_{false};
};

struct Rendered {
    JobInfo info;
    std::string exr;
};

struct CrewShape {
    const char* name;
    int workers;
    uint32_t threads;
    std::optional<uint64_t> shuffle;
    bool one_vanishes;
};

Rendered render(const std::string& algorithm, const CrewShape& shape) {
    FakeService service(kLarge, shape.shuffle);
    LightCrew crew(large_box());
    VanishingPort* vanishing = nullptr;
    const auto local = [&] { return std::make_unique<LocalWorkerPort>(*service.coordinator); };
    const std::string id = service.submit(stub_spec(service, algorithm));
    if (shape.one_vanishes) {
        auto port = std::make_unique<VanishingPort>(local());
        vanishing = port.get();
        crew.add(std::move(port), service.identity, shape.threads);
        for (int i = 0; i < 12000 && !vanishing->vanished; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
        EXPECT_TRUE(vanishing->vanished);
    }
    for (int i = 0; i < shape.workers; ++i) crew.add(local(), service.identity, shape.threads);
    if (vanishing) {
        // Its unit is all that is left, until its lease runs out.
        service.wait(id, [](const JobInfo& j) { return j.unit_done + 1 == j.unit_total && j.unit_leased == 1; });
        service.now_ms += 11000;
    }
    Rendered out{service.wait_end(id), {}};
    EXPECT_EQ(out.info.state, JobState::kSucceeded) << out.info.message;
    const auto image = service.coordinator->image(id, ImageKind::kFinal);
    if (image.ok()) out.exr = *image;
    EXPECT_EQ(sha256(out.exr), out.info.image_digest);
    const auto preview = service.coordinator->image(id, ImageKind::kPreview);
    EXPECT_TRUE(preview.ok() && preview->starts_with("\x89PNG")) << preview.status().message();
    return out;
}

double mean_of(const std::string& exr) {
    const auto image = decode_exr(exr, "image");
    if (!image.ok()) return std::nan("");
    const std::vector<float>& p = image->color.pixels;
    return std::accumulate(p.begin(), p.end(), 0.0) / double(p.size());
}

/// Of a unit of the whole frame by `bdpt`, whose paths have `min_edges` edges or more.
double mean_by_bdpt(int min_edges) {
    const RenderSettings settings{algorithm_of("bdpt"), 7, kMaxDepth};
    TechniqueMask mask;
    mask.min_k = min_edges;
    const auto renderer = Renderer::create(large_box(), settings, {}, &mask);
    const Rect& crop = large_box()->frame().crop;
    const auto part = (*renderer)->render({.iteration_count = 2, .tile = crop, .light_path_count = 2 * uint64_t(crop.area())}, {});
    double camera = 0, splats = 0;
    for (const double v : part->camera) camera += v;
    for (const SplatSum& s : part->splats) splats += s.rgb[0] + s.rgb[1] + s.rgb[2];
    return (camera / part->samples_per_pixel + splats / double(part->light_paths)) / (3 * double(crop.area()));
}

class Shapes : public ::testing::TestWithParam<const char*> {};

TEST_P(Shapes, BytesDoNotDependOnWhoRendersWhatAndWhoVanishes) {
    const std::string algorithm = GetParam();
    const CrewShape crews[] = {{"one worker, one thread", 1, 1, std::nullopt, false},
                               {"three workers, two threads each", 3, 2, std::nullopt, false},
                               {"shuffled leases", 2, 2, 5, false},
                               {"one worker vanishes", 1, 2, std::nullopt, true}};
    const Rendered first = render(algorithm, crews[0]);
    for (const CrewShape& crew : crews) {
        if (&crew == &crews[0]) continue;
        const Rendered other = render(algorithm, crew);
        EXPECT_EQ(other.info.image_digest, first.info.image_digest) << crew.name;
    }
    EXPECT_EQ(first.info.samples_per_pixel_done, kIterations);
    EXPECT_EQ(first.info.unit_done, first.info.unit_total);

    // Without a service, group by group.
    auto renderer = Renderer::create(large_box(), {algorithm_of(algorithm), 0, kMaxDepth});
    ASSERT_TRUE(renderer.ok()) << renderer.status().message();
    ProgressiveRender alone(*std::move(renderer), kLarge, Plan(kLarge, algorithm_of(algorithm)), {}, 0);
    while (alone.iterations() < kIterations) ASSERT_TRUE(alone.advance(kIterations).ok());
    const auto image = decode_exr(first.exr, "image");
    ASSERT_TRUE(image.ok());
    EXPECT_EQ(alone.image().pixels, image->color.pixels);

    // What arrives at the image is what arrives at the sensor: the frame's mean is that of an algorithm of the product.
    const double mean = mean_of(first.exr), expected = mean_by_bdpt(algorithm == kStubSplats ? 2 : 1);
    EXPECT_GT(mean, 0);
    EXPECT_NEAR(mean / expected, 1, algorithm == kStubMerging ? 0.1 : 0.02) << "few photons, and their kernel";
}

INSTANTIATE_TEST_SUITE_P(Stubs, Shapes, ::testing::ValuesIn(kStubNames), [](const auto& name) {
    std::string text = name.param;
    text.erase(text.find('-'), 1);
    return text;
});

TEST(ShapesOfUnits, AreThoseThatTheRowSays) {
    const auto units_of = [](const std::string& algorithm) {
        const Plan plan(kLarge, algorithm_of(algorithm));
        return plan.units(plan.group(0));
    };
    const auto whole = units_of(kStubMerging);
    ASSERT_EQ(whole.size(), 1u);
    EXPECT_EQ(whole[0].render.tile, kLarge.crop);
    EXPECT_FALSE(whole[0].render.splats_only);
    for (const char* tiled : {kStubPairing, kStubSplats, "bdpt"}) {
        const auto units = units_of(tiled);
        EXPECT_GT(units.size(), 1u) << tiled;
        for (const WorkUnit& unit : units) {
            EXPECT_EQ(unit.render.splats_only, tiled == kStubSplats) << tiled;
            EXPECT_GT(unit.render.light_path_count, 0u);
        }
    }
}

/// The counters, the time left and the preview of a job that has no camera samples at all.
TEST(SplatsAlone, AJobTellsHowFarItIsAndShowsIt) {
    FakeService service(kLarge);
    JobSpec spec = stub_spec(service, kStubSplats);
    spec.samples_per_pixel = 2;
    const std::string id = service.submit(spec), worker = service.add_worker();
    LocalWorkerPort port(*service.coordinator);
    RendererCache cache([](const JobSpec&, std::stop_token) { return Result<std::shared_ptr<const Scene>>(large_box()); },
                        direct_tables(port));
    const uint64_t units = service.coordinator->get_job(id)->unit_total;
    ASSERT_EQ(units, 4u) << "two groups of two tiles";
    EXPECT_EQ(service.coordinator->image(id, ImageKind::kPreview).status().code(), StatusCode::kFailedPrecondition);
    std::string first_preview;
    for (uint64_t done = 1; done <= units; ++done) {
        const auto leases = service.lease(worker);
        ASSERT_EQ(leases.size(), 1u);
        const UnitLease& lease = leases[0];
        ASSERT_TRUE(service.coordinator->heartbeat(worker, {{lease.reference(), true}}).ok());
        service.now_ms += 1000;
        const auto expected = service.coordinator->expected_partial(lease.reference());
        ASSERT_TRUE(expected.ok());
        EXPECT_EQ(expected->samples_per_pixel, 0u);
        EXPECT_EQ(expected->light_paths, lease.unit.render.light_path_count);
        const auto renderer = cache.renderer(lease, {});
        ASSERT_TRUE(renderer.ok()) << renderer.status().message();
        const auto partial = (*renderer)->render(lease.unit.render, {});
        ASSERT_TRUE(partial.ok()) << partial.status().message();
        const auto encoded = encode_partial(*partial, lease.spec.frame);
        ASSERT_TRUE(encoded.ok()) << encoded.status().message();
        const auto ack = service.coordinator->submit_payload(worker, lease.reference(), encoded->descriptor, encoded->payload);
        ASSERT_TRUE(ack.ok()) << ack.status().message();
        EXPECT_EQ(ack->outcome, SubmitOutcome::kAccepted) << ack->reason;
        const JobInfo info = *service.coordinator->get_job(id);
        EXPECT_EQ(info.unit_done, done);
        EXPECT_EQ(info.camera_samples, 0u);
        EXPECT_EQ(info.light_paths, done * uint64_t(kLarge.crop.area()) / 2);
        EXPECT_GT(info.rays, 0u);
        EXPECT_EQ(info.samples_per_pixel_done, done / 2) << "iterations, whatever they consist of";
        if (done < units) {
            EXPECT_NEAR(info.eta_seconds, double(units - done), 1e-9) << "a second per unit";
        }
        if (done != 2) continue;
        const auto preview = service.coordinator->image(id, ImageKind::kPreview);
        ASSERT_TRUE(preview.ok()) << preview.status().message();
        first_preview = *preview;
    }
    const JobInfo info = service.wait_end(id);
    ASSERT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_EQ(info.samples_per_pixel_done, 2u);
    EXPECT_EQ(info.light_paths, 2 * uint64_t(kLarge.crop.area()));
    EXPECT_NE(*service.coordinator->image(id, ImageKind::kPreview), first_preview);
    const auto image = decode_exr(*service.coordinator->image(id, ImageKind::kFinal), "image");
    ASSERT_TRUE(image.ok());
    EXPECT_TRUE(image->layer("variance")) << "of two groups";
}

TEST(SplatsAlone, ATimeLimitEndsThemToo) {
    FakeService service(kLarge);
    JobSpec spec = stub_spec(service, kStubSplats);
    spec.samples_per_pixel = 0;
    spec.time_limit_seconds = 10;
    const std::string id = service.submit(spec);
    LightCrew crew(large_box());
    crew.add(std::make_unique<LocalWorkerPort>(*service.coordinator), service.identity, 2);
    service.wait(id, [](const JobInfo& j) { return j.samples_per_pixel_done > 0; });
    service.now_ms += 10001;
    const JobInfo info = service.wait_end(id);
    ASSERT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_GE(info.samples_per_pixel_done, 1u);
    EXPECT_GT(mean_of(*service.coordinator->image(id, ImageKind::kFinal)), 0);
}

// ---- What does not fit.

Status render_status(const std::string& algorithm, const RenderUnit& unit) {
    const auto renderer = Renderer::create(large_box(), {algorithm_of(algorithm), 0, kMaxDepth});
    EXPECT_TRUE(renderer.ok()) << renderer.status().message();
    return (*renderer)->render(unit, {}).status();
}

TEST(WrongUnits, AreRefusedWithTheReason) {
    const auto refuses = [](const std::string& algorithm, const RenderUnit& unit, const std::string& reason) {
        const Status status = render_status(algorithm, unit);
        EXPECT_EQ(status.code(), StatusCode::kInvalidArgument) << algorithm;
        EXPECT_NE(status.message().find(reason), std::string::npos) << status.message();
    };
    const Rect tile{0, 0, 260, 512};
    refuses(kStubMerging, {.iteration_count = 1, .tile = tile, .light_path_count = 9},
            "algorithm 'stub-merging' renders units of the whole frame, not tiles of it");
    refuses(kStubSplats, {.iteration_count = 1, .tile = tile, .light_path_count = 9},
            "algorithm 'stub-splats' only splats, and the unit asks for camera samples");
    refuses(kStubPairing, {.iteration_count = 1, .tile = tile, .light_path_count = 9, .splats_only = true},
            "algorithm 'stub-pairing' makes camera samples, and the unit has none");
    refuses("path", {.iteration_count = 1, .tile = tile, .light_path_count = 9},
            "algorithm 'path' traces no light paths, and the unit asks for some");
    refuses("path", {.iteration_count = 1, .tile = {0, 0, 521, 512}}, "the unit's tile does not lie inside the frame");
}

/// A coordinator that plans otherwise than the worker's algorithm needs.
class CuttingPort final : public ForwardingPort {
  public:
    explicit CuttingPort(std::unique_ptr<WorkerPort> port) : ForwardingPort(*port), own_(std::move(port)) {}
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds, std::stop_token stop) override {
        auto leases = port_.lease_units(worker_id, wait_seconds, stop);
        if (leases.ok())
            for (UnitLease& lease : *leases) lease.unit.render.tile.x1 /= 2;
        return leases;
    }

  private:
    const std::unique_ptr<WorkerPort> own_;
};

TEST(WrongUnits, FailTheirJobAtOnce) {
    FakeService service(kLarge);
    const std::string id = service.submit(stub_spec(service, kStubMerging));
    LightCrew crew(large_box());
    crew.add(std::make_unique<CuttingPort>(std::make_unique<LocalWorkerPort>(*service.coordinator)), service.identity);
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kFailed);
    EXPECT_NE(info.message.find("'stub-merging' renders units of the whole frame"), std::string::npos) << info.message;
}

/// A part that no algorithm of the product has.
struct ForeignPart {
    static const TablePart kPart;
};
const TablePart ForeignPart::kPart{
    .name = "foreign",
    .serialize = [](const void*) { return std::string("of another algorithm"); },
    .parse = [](std::string_view) { return Result<std::shared_ptr<const void>>(std::make_shared<const ForeignPart>()); },
    .validate = [](const void*, const EmitterSet&) { return Status(); },
};

TEST(WrongTables, FailTheJobWithTheReason) {
    TableService service;
    const std::string id = train_by_hand(service, service.table_spec(2));
    AssetStore& assets = service.coordinator->assets();
    const std::string bytes = serialize(Tables(ForeignPart{}));
    const AssetReference foreign{sha256(bytes), bytes.size()};
    ASSERT_TRUE(assets.put(foreign.digest, bytes).ok());
    LocalWorkerPort port(*service.coordinator);
    const auto tampered = [&](UnitLease lease, const AssetReference& tables) {
        lease.tables = tables;
        RendererCache cache([](const JobSpec&, std::stop_token) { return Result<std::shared_ptr<const Scene>>(golden()); },
                            direct_tables(port));
        const Status status = cache.renderer(lease, {}).status();
        EXPECT_EQ(status.code(), StatusCode::kFailedPrecondition) << status.message();
        return status;
    };
    for (int i = 0; i < 3; ++i) {
        ASSERT_EQ(service.coordinator->get_job(id)->state, JobState::kRunning);
        const std::string worker = service.add_worker();
        const UnitLease lease = service.lease(worker).at(0);
        EXPECT_NE(tampered(lease, {}).message().find("algorithm 'spcbpt' needs its tables"), std::string::npos);
        ASSERT_TRUE(service.coordinator->release_unit(worker, lease.reference(), tampered(lease, foreign)).ok());
    }
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kFailed);
    EXPECT_NE(info.message.find("the tables " + foreign.digest.hex() +
                                " do not fit this scene: the tables have a part 'foreign' "
                                "that this algorithm does not read; they belong to another algorithm"),
              std::string::npos)
        << info.message;

    FakeService plain(kFrame);
    const std::string without = plain.submit(plain.spec(1)), worker = plain.add_worker();
    const UnitLease lease = plain.lease(worker).at(0);
    EXPECT_NE(tampered(lease, foreign).message().find("algorithm 'bdpt' reads no tables"), std::string::npos);
}

/// The renderer's door by itself.
TEST(WrongTables, MakeNoRenderer) {
    const auto renderer = Renderer::create(golden(), {algorithm_of("spcbpt"), 0, kMaxDepth}, Tables(ForeignPart{}));
    EXPECT_EQ(renderer.status().code(), StatusCode::kFailedPrecondition);
    EXPECT_EQ(renderer.status().message(), "the tables are not those of algorithm 'spcbpt'");
}

}  // namespace
}  // namespace lightloom
