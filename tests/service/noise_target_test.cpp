// Jobs that end at an estimated error: the decision depends on the plan and the merged groups alone, and the image is that of as
// many samples.

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/core/atomic_file.h"
#include "server/results.h"
#include "server/status_json.h"
#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::Process;
using testing::Service;
using testing::wait_until;
using Json = nlohmann::json;

const FrameLayout kFrame{40, 30, {0, 0, 40, 30}};

/// Four workers by hand; `held` results are delivered together, the latest first. Workers that `silent` names never deliver.
JobInfo run_by_hand(FakeService& service, const JobSpec& spec, size_t held = 1, const std::string& silent = {}) {
    const std::string id = service.submit(spec);
    std::vector<std::string> workers;
    for (int i = 0; i < 4; ++i) workers.push_back(service.add_worker());
    std::vector<std::pair<std::string, UnitLease>> results;
    for (int round = 0; round < 100000; ++round) {
        bool leased = false;
        for (size_t i = 0; i < workers.size(); ++i) {
            for (const UnitLease& lease : service.lease(workers[i])) {
                leased = true;
                if (std::to_string(i) != silent) results.emplace_back(workers[i], lease);
            }
        }
        if (results.size() < held && leased) continue;
        std::reverse(results.begin(), results.end());
        for (const auto& [worker, lease] : results) {
            const SubmitOutcome outcome = service.deliver(worker, lease).outcome;
            EXPECT_TRUE(outcome == SubmitOutcome::kAccepted || outcome == SubmitOutcome::kStale);
        }
        results.clear();
        const JobInfo info = *service.coordinator->get_job(id);
        if (info.state != JobState::kRunning) break;
        if (!leased) service.now_ms += 11000, std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return service.wait_end(id);
}

/// The error of an image of 40 iterations, as a target that is reached at about as many.
double target_of_40() {
    FakeService service;
    const JobInfo info = run_by_hand(service, service.spec(40));
    EXPECT_TRUE(info.noise.has_value());
    return info.noise ? info.noise->estimate.relmse + info.noise->estimate.error : 1;
}

JobSpec with_target(const FakeService& service, double target, uint32_t spp = 0, double seconds = 0) {
    JobSpec spec = service.spec(spp);
    spec.noise_target = target;
    spec.time_limit_seconds = seconds;
    return spec;
}

TEST(NoiseTarget, EndsWhereSamplesPerPixelReproduceIt) {
    const double target = target_of_40();
    FakeService noisy;
    const JobInfo info = run_by_hand(noisy, with_target(noisy, target));
    ASSERT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_GE(info.samples_per_pixel_done, 8u);
    EXPECT_LE(info.samples_per_pixel_done, 48u);
    ASSERT_TRUE(info.noise.has_value());
    EXPECT_TRUE(info.noise->reached);
    EXPECT_EQ(info.noise->estimate.iterations, info.samples_per_pixel_done);
    EXPECT_LE(info.noise->estimate.relmse + info.noise->estimate.error, target);

    FakeService again;
    const JobInfo same = run_by_hand(again, again.spec(uint32_t(info.samples_per_pixel_done)));
    EXPECT_EQ(same.image_digest, info.image_digest);
    EXPECT_EQ(same.noise->estimate, info.noise->estimate);
    EXPECT_FALSE(same.noise->reached) << "it had no target";
}

TEST(NoiseTarget, WhoRendersAndWhatIsInFlightDoNotDecide) {
    const double target = target_of_40();
    FakeService plain;
    const JobInfo expected = run_by_hand(plain, with_target(plain, target));
    for (const size_t held : {3, 16, 60}) {
        FakeService service, shuffled(kFrame, 5);
        for (FakeService* s : {&service, &shuffled}) {
            const JobInfo info = run_by_hand(*s, with_target(*s, target), held);
            EXPECT_EQ(info.image_digest, expected.image_digest) << held;
            EXPECT_EQ(info.samples_per_pixel_done, expected.samples_per_pixel_done) << held;
            EXPECT_EQ(info.noise, expected.noise);
        }
    }
    FakeService lossy;
    const JobInfo info = run_by_hand(lossy, with_target(lossy, target), 2, "1");
    EXPECT_EQ(info.image_digest, expected.image_digest) << "one of the workers holds a unit for ever";
}

TEST(NoiseTarget, WithAnotherBoundWhicheverComesFirst) {
    const double target = target_of_40();
    FakeService service;
    const JobInfo few = run_by_hand(service, with_target(service, target / 10, 20));
    EXPECT_EQ(few.samples_per_pixel_done, 20u);
    ASSERT_TRUE(few.noise.has_value());
    EXPECT_FALSE(few.noise->reached);
    const JobInfo many = run_by_hand(service, with_target(service, target, 4000));
    EXPECT_LE(many.samples_per_pixel_done, 48u);
    EXPECT_TRUE(many.noise->reached);
    const JobInfo timed = run_by_hand(service, with_target(service, target, 0, 1000));
    EXPECT_EQ(timed.image_digest, many.image_digest);

    const std::string id = service.submit(with_target(service, target / 1000, 0, 10));
    const std::string worker = service.add_worker();
    for (int i = 0; i < 12; ++i) {
        const UnitLease lease = service.lease(worker).at(0);
        ASSERT_TRUE(service.coordinator->heartbeat(worker, {{lease.reference(), true}}).ok());
        service.deliver(worker, lease);
    }
    service.now_ms += 10001;
    const JobInfo late = service.wait_end(id);
    EXPECT_EQ(late.samples_per_pixel_done, 12u);
    EXPECT_FALSE(late.noise->reached);
}

TEST(NoiseTarget, StatusManifestAndProgressTell) {
    const double target = target_of_40() / 4;
    FakeService service;
    const std::string id = service.submit(with_target(service, target));
    const std::string worker = service.add_worker();
    const auto status = [&] { return status_json(*service.coordinator->get_job(id)); };
    EXPECT_EQ(status()["noise_target"], target);
    EXPECT_TRUE(status()["noise"].is_null());
    EXPECT_TRUE(status()["units_total"].is_null());
    EXPECT_TRUE(status()["samples_per_pixel"].is_null());
    for (int i = 0; i < 10; ++i) {
        const UnitLease lease = service.lease(worker).at(0);
        ASSERT_TRUE(service.coordinator->heartbeat(worker, {{lease.reference(), true}}).ok());
        service.now_ms += 1000;
        service.deliver(worker, lease);
    }
    const auto running = status();
    EXPECT_EQ(running["noise"]["groups"], 10);
    EXPECT_EQ(running["noise"]["samples_per_pixel"], 10);
    EXPECT_EQ(running["noise"]["target"], target);
    EXPECT_EQ(running["noise"]["reached"], false);
    EXPECT_GT(running["noise"]["relmse"], target);
    EXPECT_GT(running["noise"]["standard_error"], 0);
    const double progress = running["progress"];
    EXPECT_GT(progress, 0);
    EXPECT_LT(progress, 1);
    EXPECT_NEAR(double(running["eta_seconds"]), 10 * (1 - progress) / progress, 1e-6);
    EXPECT_TRUE(service.coordinator->cancel_job(id).ok());

    const JobInfo info = run_by_hand(service, with_target(service, 4 * target));
    const Json manifest = Json::parse(*service.coordinator->manifest(info.job_id));
    EXPECT_EQ(manifest["spec"]["noise_target"], 4 * target);
    EXPECT_EQ(manifest["noise"]["reached"], true);
    EXPECT_EQ(manifest["noise"]["samples_per_pixel"], manifest["image"]["samples_per_pixel"]);
    EXPECT_EQ(manifest["noise"]["relmse"], info.noise->estimate.relmse);
}

/// A frame whose every sample is `value`, but for some noise, with an estimate of rare light.
std::optional<NoiseReport> reduce(double value, const RareLight& rare, double target) {
    const Plan plan(kFrame, PlanOptions{});
    Reducer reducer(kFrame, plan.tile_count(), {}, target);
    for (uint32_t g = 0; g < 40; ++g) {
        for (const WorkUnit& unit : plan.units(plan.group(g))) {
            Partial partial;
            partial.tile = unit.render.tile;
            partial.samples_per_pixel = unit.render.samples_per_pixel();
            partial.camera.resize(size_t(3 * partial.tile.area()));
            Rng rng({1, Stage::kCamera, g});
            for (double& v : partial.camera) v = value * partial.samples_per_pixel * (0.9 + 0.2 * rng.uniform_double());
            partial.counters.camera_samples = uint64_t(partial.tile.area()) * partial.samples_per_pixel;
            partial.rare_light = rare;
            EXPECT_TRUE(reducer.add(unit, std::move(partial)).ok());
        }
    }
    return reducer.final_noise();
}

TEST(NoiseTarget, LightThatMayBeMissingHoldsAJobBack) {
    const RareLight none, little{Rgb(1e-4f), {}, 1e-4, 100}, much{Rgb(0.2f), {}, 1e6, 100};
    EXPECT_TRUE(reduce(1, none, 0.01)->reached);
    EXPECT_EQ(reduce(1, none, 0.01)->estimate.groups, NoiseEstimate::kLeastGroups);
    EXPECT_TRUE(reduce(1, little, 0.01)->reached);
    const auto held = reduce(1, much, 0.01);
    EXPECT_FALSE(held->reached);
    EXPECT_TRUE(held->light_missing);
    EXPECT_EQ(held->estimate.groups, 40u);
    const auto black = reduce(0, none, 0.01);
    EXPECT_FALSE(black->reached) << "nothing was found yet";
    EXPECT_TRUE(black->light_missing);
    EXPECT_FALSE(reduce(1, much, 0)->light_missing) << "nobody asked";
}

TEST(NoiseTarget, ImpossibleOnesAreRefused) {
    FakeService service;
    const auto message = [&](const JobSpec& spec) {
        const auto job = service.coordinator->submit_job(std::string("r").append(std::to_string(++service.requests)), spec);
        EXPECT_EQ(job.status().code(), StatusCode::kInvalidArgument);
        return job.status().message();
    };
    for (const double target : {-0.01, 1e-10, 1.5, std::numeric_limits<double>::quiet_NaN()})
        EXPECT_EQ(message(with_target(service, target)), "the noise target is a relMSE between 1e-9 and 1") << target;
    EXPECT_NE(message(with_target(service, 0.1, 7)).find("needs 8 samples per pixel"), std::string::npos);
    EXPECT_NE(message(with_target(service, 0.1, 16, 10)).find("not both"), std::string::npos);
    EXPECT_NE(message(with_target(service, 0)).find("or a noise target"), std::string::npos);

    const testing::TempDirectory directory;
    const auto render = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{"render", testing::kScene, "-q", "-o", (directory.path / "x.exr").string()};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return Process("lightloom", arguments, (directory.path / "log").string()).wait();
    };
    for (const char* target : {"0", "-0.01", "nan", "inf", "2", "1e-30", "much"})
        EXPECT_EQ(render({"--noise", target}), 2) << target;
    EXPECT_EQ(render({"--noise", "0.1", "--spp", "4"}), 2);
    EXPECT_EQ(render({"--noise", "0.1", "--pyramid", (directory.path / "p").string()}), 2);
    EXPECT_FALSE(std::filesystem::exists(directory.path / "x.exr"));
}

TEST(NoiseTarget, AWorkerKilledMidUnitDoesNotDecide) {
    const Service service;
    const std::vector<std::string> base{"--algorithm", "lvcbpt", "--resolution", "128x96", "--set", "training-paths=2000"};
    const auto with = [&](std::vector<std::string> more) {
        more.insert(more.end(), base.begin(), base.end());
        return more;
    };
    auto victim = service.worker("victim", 1);
    auto client = service.submit("image", with({"--noise", "0.012"}));
    GrpcJobPort jobs = service.jobs();
    ASSERT_TRUE(wait_until(60, [&] {
        const auto list = jobs.list_jobs();
        return list.ok() && !list->empty() && list->front().unit_leased > 0 && list->front().samples_per_pixel_done > 2;
    })) << service.log("image");
    victim->signal(SIGKILL);
    EXPECT_EQ(victim->wait(), 128 + SIGKILL);
    std::vector<std::unique_ptr<Process>> survivors;
    for (const char* name : {"a", "b", "c"}) survivors.push_back(service.worker(name, 1));
    ASSERT_EQ(client->wait(), 0) << service.log("image");
    const Json manifest = service.manifest("image");
    EXPECT_EQ(manifest["noise"]["reached"], true);
    EXPECT_LE(manifest["noise"]["relmse"], 0.012);
    ASSERT_EQ(service.submit("alone", with({"--noise", "0.012"}))->wait(), 0) << service.log("alone");
    EXPECT_EQ(service.digest("alone"), service.digest("image"));
    const std::string spp = std::to_string(manifest["image"]["samples_per_pixel"].get<uint64_t>());
    std::vector<std::string> again = with({"--spp", spp, "-q", "-o", service.path("again.exr"), "--workers", "2"});
    again.insert(again.begin(), {"render", testing::kScene});
    ASSERT_EQ(Process("lightloom", again, service.path("again.log")).wait(), 0) << service.log("again");
    EXPECT_EQ(service.digest("again"), service.digest("image"));
}

}  // namespace
}  // namespace lightloom
