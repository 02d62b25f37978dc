// Specs and units on the wire: what is sent comes back, and what cannot be is refused.

#include "common/work/wire.h"

#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "tests/support/algorithm_of.h"

namespace lightloom {
namespace {

TEST(Wire, SpecAndUnitsSurviveTheRoundTrip) {
    JobSpec spec;
    spec.algorithm = testing::algorithm_of("bdpt", {{"heuristic", "power"}, {"rr-min", "0.1"}});
    spec.seed = ~0ull;
    spec.samples_per_pixel = 7;
    spec.max_depth = -1;
    spec.width = 640;
    spec.height = 480;
    spec.scene_root = sha256("x");
    spec.frame = {640, 480, {1, 2, 3, 4}};
    const UnitLease lease{"job-1",
                          spec,
                          {.key = {3, 4},
                           .render = {.first_iteration = 5,
                                      .iteration_count = 6,
                                      .group_first_iteration = 5,
                                      .tile = {1, 2, 3, 4},
                                      .first_light_path = 7,
                                      .light_path_count = 8,
                                      .splats_only = true}},
                          {sha256("tables"), 9}};
    v1::UnitLease message;
    wire::put(lease, &message);
    const auto back = wire::get(message);
    ASSERT_TRUE(back.ok());
    EXPECT_EQ(back->spec.spec_digest(), spec.spec_digest());
    EXPECT_EQ(back->spec.max_depth, -1);
    EXPECT_EQ(back->unit.key, lease.unit.key);
    EXPECT_EQ(back->unit.render, lease.unit.render);
    EXPECT_EQ(back->tables.digest, lease.tables.digest);
    EXPECT_EQ(back->tables.size_bytes, 9u);
    EXPECT_TRUE(back->spec == spec) << "what was chosen and what was left to the defaults, too";
    message.mutable_spec()->mutable_scene_root()->set_sha256("short");
    EXPECT_EQ(wire::get(message).status().code(), StatusCode::kInvalidArgument);
    EXPECT_FALSE(wire::get(v1::SubmitResultResponse()).ok()) << "UNSPECIFIED must be refused";
}

/// Rounds of one job have units of the same numbers: whoever goes on with a round that another process began must be able to tell.
TEST(Wire, UnitsOfAnUnfinishedRoundKeepTheirRound) {
    JobSpec spec;
    spec.algorithm = testing::algorithm_of("spcbpt");
    const LearningPlan plan = spec.algorithm.info().learning->plan(spec.algorithm);
    ASSERT_GT(plan.rounds.size(), 1u);
    std::set<UnitKey> keys;
    for (uint32_t round = 0; round < plan.rounds.size(); ++round) {
        const TrainingWork work = plan.work(round);
        const Plan units = Plan::training(UnitKind::kTraining, round, work);
        for (uint32_t i = 0; i < units.group_count(work.sample_count); ++i) {
            const UnitLease lease{"job-1", spec, units.units(units.group(i))[0], {}};
            v1::UnitLease message;
            wire::put(lease, &message);
            v1::UnitLease received;
            ASSERT_TRUE(received.ParseFromString(message.SerializeAsString()));
            const auto back = wire::get(received);
            ASSERT_TRUE(back.ok()) << back.status().message();
            EXPECT_EQ(back->unit.key, lease.unit.key);
            EXPECT_EQ(back->unit.key.round, round);
            EXPECT_EQ(back->unit.training, lease.unit.training);
            v1::UnitReference reference;
            wire::put(lease.reference(), &reference);
            const auto named = wire::get(reference);
            ASSERT_TRUE(named.ok()) << named.status().message();
            EXPECT_EQ(*named, lease.reference());
            EXPECT_TRUE(keys.insert(back->unit.key).second) << "two units of one key";
        }
    }
}

/// A spec that exists is valid, so that text which is not is refused where it comes in.
TEST(Wire, SpecsWithAlgorithmsOrParametersThatDoNotExistAreRefused) {
    JobSpec spec;
    spec.algorithm = testing::algorithm_of("bdpt");
    const auto refusal = [&](const std::function<void(v1::JobSpec&)>& change) {
        v1::JobSpec message;
        wire::put(spec, &message);
        EXPECT_TRUE(wire::get(message).ok());
        change(message);
        const Status status = wire::get(message).status();
        EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
        return status.message();
    };
    const auto says = [](const std::string& message, const std::string& what) {
        EXPECT_NE(message.find(what), std::string::npos) << message;
    };
    const std::string unknown = refusal([](v1::JobSpec& s) { s.set_algorithm("no-such"); });
    says(unknown, "no algorithm named 'no-such'; choose one of: ");
    for (const AlgorithmInfo* row : catalog()) says(unknown, std::string(row->name));
    says(refusal([](v1::JobSpec& s) { s.set_algorithm(""); }), "no algorithm named ''");
    says(refusal([](v1::JobSpec& s) {
             s.mutable_parameters()->insert({"connections", "3"});
         }),
         "algorithm 'bdpt' has no parameter 'connections'");
    says(refusal([](v1::JobSpec& s) {
             s.mutable_parameters()->insert({"rr-start", "1"});
         }),
         "parameter rr-start=1 of 'bdpt' must be an integer from 2 to 256");
    says(refusal([](v1::JobSpec& s) {
             s.mutable_parameters()->insert({"heuristic", "veach"});
         }),
         "must be balance, power, maximum, popov or correlation-aware");
}

/// A coordinator may know more algorithms and parameters than a client, which has to list its jobs all the same.
TEST(Wire, JobsOfUnknownAlgorithmsCanBeShown) {
    JobInfo job;
    job.job_id = "job-1";
    job.algorithm = job.spec.algorithm.name();
    job.spec.seed = 77;
    v1::Job message;
    wire::put(job, &message);
    message.mutable_spec()->set_algorithm("not-known-here");
    message.mutable_spec()->mutable_parameters()->insert({"nor-this", "1"});
    const auto shown = wire::get(message);
    ASSERT_TRUE(shown.ok()) << shown.status().message();
    EXPECT_EQ(shown->algorithm, "not-known-here");
    EXPECT_EQ(shown->spec.seed, 77u);
    EXPECT_FALSE(wire::get(message.spec()).ok()) << "nobody may render it";
}

/// Only training has rounds.
TEST(Wire, UnitsOfTheImageHaveNoRound) {
    v1::UnitReference message;
    wire::put(UnitReference{"job-1", {3, 1, UnitKind::kRender, 1}}, &message);
    EXPECT_EQ(wire::get(message).status().code(), StatusCode::kInvalidArgument);
}

TEST(Wire, RareLightSurvivesTheRoundTrip) {
    PartialDescriptor descriptor;
    v1::SubmitResultHeader header;
    wire::put(descriptor, &header);
    EXPECT_FALSE(header.has_rare_light()) << "most units have none";
    descriptor.rare_light = {{0.5f, 0.25f, 0.125f}, {1, 2, 3}, 1e9, 77};
    wire::put(descriptor, &header);
    auto back = wire::get(header);
    ASSERT_TRUE(back.ok());
    EXPECT_EQ(back->rare_light, descriptor.rare_light);
    header.mutable_rare_light()->add_by_chance(4);
    EXPECT_EQ(wire::get(header).status().code(), StatusCode::kInvalidArgument);

    JobInfo job;
    job.rare_light = {0.3, 0.1, 12.5, 0.2};
    v1::Job message;
    wire::put(job, &message);
    const auto shown = wire::get(message);
    ASSERT_TRUE(shown.ok());
    EXPECT_EQ(shown->rare_light, job.rare_light);
}

TEST(Wire, TheNoiseOfAJobTravelsWhereItIsKnown) {
    JobInfo job;
    v1::Job message;
    wire::put(job, &message);
    EXPECT_FALSE(message.has_noise());
    EXPECT_FALSE(wire::get(message)->noise.has_value());
    job.noise = NoiseReport{{0.012, 0.001, 31, 44}, true, false};
    wire::put(job, &message);
    EXPECT_EQ(wire::get(message)->noise, job.noise);
    job.noise = NoiseReport{{0.012, 0.001, 31, 44}, false, true};
    wire::put(job, &message);
    EXPECT_EQ(wire::get(message)->noise, job.noise);
}

}  // namespace
}  // namespace lightloom
