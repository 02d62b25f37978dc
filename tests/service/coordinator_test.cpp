// The coordinator by itself: exactly-once merging, leases on a clock that the test turns, refusals.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::FakeService;

/// Runs a whole job with one hand-driven worker; `reorder` holds several units and delivers them backwards, twice.
Digest run_by_hand(FakeService& service, uint32_t spp, bool reorder) {
    const std::string id = service.submit(service.spec(spp));
    std::vector<std::string> workers;
    for (int i = 0; i < 4; ++i) workers.push_back(service.add_worker());
    std::vector<std::pair<std::string, UnitLease>> held;
    for (int round = 0; round < 100000; ++round) {
        for (const std::string& worker : workers) {
            for (const UnitLease& lease : service.lease(worker)) held.emplace_back(worker, lease);
        }
        if (held.empty()) break;
        if (reorder) std::reverse(held.begin(), held.end());
        for (const auto& [worker, lease] : held) {
            EXPECT_EQ(service.deliver(worker, lease).outcome, SubmitOutcome::kAccepted);
            if (reorder) {
                const SubmitAck again = service.deliver(workers[0], lease);
                EXPECT_TRUE(again.outcome == SubmitOutcome::kDuplicateSame || again.outcome == SubmitOutcome::kStale);
            }
        }
        held.clear();
    }
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_EQ(info.samples_per_pixel_done, spp);
    EXPECT_EQ(info.duplicates_different, 0u);
    return info.image_digest;
}

TEST(Coordinator, OrderAndDuplicatesDoNotChangeTheImage) {
    FakeService plain, turned, shuffled({40, 30, {0, 0, 40, 30}}, 7);
    const Digest reference = run_by_hand(plain, 70, false);
    EXPECT_EQ(run_by_hand(turned, 70, true), reference);
    EXPECT_EQ(run_by_hand(shuffled, 70, true), reference);
    FakeService other;
    EXPECT_NE(run_by_hand(other, 71, false), reference);
}

TEST(Coordinator, TiledFramesWithACropMergeTheSameWay) {
    const FrameLayout frame{1400, 700, {30, 20, 1230, 620}};
    FakeService plain(frame), shuffled(frame, 3);
    EXPECT_EQ(run_by_hand(plain, 2, false), run_by_hand(shuffled, 2, true));
}

TEST(Coordinator, RepeatedSubmissionIsOneJob) {
    FakeService service;
    const auto first = service.coordinator->submit_job("same", service.spec(4));
    const auto second = service.coordinator->submit_job("same", service.spec(4));
    ASSERT_TRUE(first.ok() && second.ok());
    EXPECT_EQ(first->job_id, second->job_id);
    EXPECT_EQ(service.coordinator->submit_job("same", service.spec(5)).status().code(), StatusCode::kAlreadyExists);
    EXPECT_EQ(service.coordinator->list_jobs().size(), 1u);
}

TEST(Coordinator, RefusesSpecsThatCannotSucceed) {
    FakeService service;
    const auto code = [&](auto change) {
        JobSpec spec = service.spec(4);
        change(spec);
        return service.coordinator->submit_job("r" + std::to_string(++service.requests), spec).status().code();
    };
    EXPECT_EQ(code([](JobSpec& s) { s.samples_per_pixel = 0; }), StatusCode::kInvalidArgument);
    EXPECT_EQ(code([](JobSpec& s) { s.time_limit_seconds = 1; }), StatusCode::kInvalidArgument);
    EXPECT_EQ(code([](JobSpec& s) { s.width = 10; }), StatusCode::kInvalidArgument);
    EXPECT_EQ(code([](JobSpec& s) { s.scene_root = sha256("not uploaded"); }), StatusCode::kFailedPrecondition);
    EXPECT_EQ(service.coordinator->get_job("job-0").status().code(), StatusCode::kNotFound);
}

TEST(Coordinator, RefusesAWorkerThatComputesDifferently) {
    FakeService service;
    const auto refusal = [&](auto change) {
        WorkerHello hello{service.identity, 2, "host", 1};
        change(hello.identity);
        return service.coordinator->register_worker(hello).status();
    };
    const Status golden = refusal([](BuildIdentity& i) { i.golden_digest = sha256("other"); });
    EXPECT_EQ(golden.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(golden.message().find(sha256("other").hex().substr(0, 16)), std::string::npos) << golden.message();
    EXPECT_NE(golden.message().find(sha256("golden").hex().substr(0, 16)), std::string::npos) << golden.message();
    EXPECT_EQ(refusal([](BuildIdentity& i) { i.build_id = "other"; }).code(), StatusCode::kFailedPrecondition);
    EXPECT_EQ(refusal([](BuildIdentity& i) { i.math_profile = "other"; }).code(), StatusCode::kFailedPrecondition);
    EXPECT_TRUE(refusal([](BuildIdentity&) {}).ok());
}

TEST(Coordinator, SilentWorkersLoseTheirUnitsAndLateResultsCount) {
    FakeService service;
    const std::string id = service.submit(service.spec(1));
    const std::string silent = service.add_worker(), other = service.add_worker();
    const auto lost = service.lease(silent);
    ASSERT_EQ(lost.size(), 1u);
    EXPECT_TRUE(service.lease(other).empty());
    service.now_ms += 9000;
    ASSERT_TRUE(service.coordinator->heartbeat(silent, {{lost[0].reference(), true}}).ok());
    service.now_ms += 9000;
    EXPECT_TRUE(service.lease(other).empty()) << "the heartbeat renewed the lease";
    service.now_ms += 2000;
    service.wait(id, [](const JobInfo& j) { return j.unit_leased == 0; });
    const auto again = service.lease(other);
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(again[0].unit.key, lost[0].unit.key);
    EXPECT_EQ(service.deliver(silent, lost[0]).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(service.wait_end(id).state, JobState::kSucceeded);
    EXPECT_EQ(service.deliver(other, again[0]).outcome, SubmitOutcome::kStale);
}

TEST(Coordinator, WhoLeavesComesBackOrOnlyWaitedBehindDoesNotMakeAUnitSuspect) {
    FakeService service;
    const std::string id = service.submit(service.spec(300));
    const auto expire = [&] {
        service.now_ms += 11000;
        service.wait(id, [](const JobInfo& j) { return j.unit_leased == 0; });
    };
    const std::string able = service.add_worker();
    const UnitLease first = service.lease(able).at(0);
    ASSERT_TRUE(service.coordinator->release_unit(able, first.reference(), {}).ok());
    for (int i = 0; i < 8; ++i) {
        const std::string orderly = service.add_worker();
        EXPECT_EQ(service.lease(orderly).size(), 1u);
        ASSERT_TRUE(service.coordinator->goodbye(orderly).ok());
        const std::string back = service.add_worker();
        const auto lease = service.lease(back);
        ASSERT_EQ(lease.size(), 1u);
        EXPECT_EQ(lease[0].unit.key, first.unit.key);
        expire();
        EXPECT_TRUE(service.coordinator->heartbeat(back, {{lease[0].reference(), true}})->empty());
        EXPECT_EQ(service.lease(back).size(), 1u) << "it does not run alone";
        ASSERT_TRUE(service.coordinator->goodbye(back).ok());
    }
    // The unit behind the one in work is not blamed, however often that happens.
    const std::string dying = service.add_worker();
    const auto in_work = service.lease(dying), behind = service.lease(dying);
    ASSERT_EQ(in_work.size() + behind.size(), 2u);
    expire();
    EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kRunning);
}

TEST(Coordinator, DifferentBytesForAMergedUnitAreAnAlarm) {
    FakeService service;
    const std::string id = service.submit(service.spec(2));
    const std::string worker = service.add_worker();
    const UnitLease lease = service.lease(worker).at(0);
    ASSERT_EQ(service.deliver(worker, lease).outcome, SubmitOutcome::kAccepted);
    Partial partial = testing::fake_partial(lease.unit.render, lease.spec.frame);
    partial.camera[5] += 1;
    const auto encoded = encode_partial(partial, lease.spec.frame);
    const auto ack = service.coordinator->submit_payload(worker, lease.reference(), encoded->descriptor, encoded->payload);
    ASSERT_TRUE(ack.ok());
    EXPECT_EQ(ack->outcome, SubmitOutcome::kDuplicateDifferent);
    EXPECT_EQ(service.coordinator->get_job(id)->duplicates_different, 1u);
}

TEST(Coordinator, CorruptPartialsAreRejectedAndTheUnitIsLeasedAgain) {
    FakeService service;
    const std::string id = service.submit(service.spec(1));
    const std::string worker = service.add_worker();
    const UnitLease lease = service.lease(worker).at(0);
    auto encoded = encode_partial(testing::fake_partial(lease.unit.render, lease.spec.frame), lease.spec.frame);
    encoded->payload[encoded->payload.size() / 2] ^= 1;
    const auto ack = service.coordinator->submit_payload(worker, lease.reference(), encoded->descriptor, encoded->payload);
    ASSERT_TRUE(ack.ok());
    EXPECT_EQ(ack->outcome, SubmitOutcome::kRejected);
    const auto again = service.lease(worker);
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(service.deliver(worker, again[0]).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(service.wait_end(id).state, JobState::kSucceeded);
}

TEST(Coordinator, AUnitThatFailsThreeTimesFailsItsJob) {
    FakeService service;
    const std::string id = service.submit(service.spec(1));
    for (int i = 0; i < 3; ++i) {
        const std::string worker = service.add_worker();
        const UnitLease lease = service.lease(worker).at(0);
        ASSERT_TRUE(service.coordinator->release_unit(worker, lease.reference(), internal_error("boom")).ok());
    }
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kFailed);
    EXPECT_NE(info.message.find("boom"), std::string::npos);
}

TEST(Coordinator, ABrokenWorkerFailsNoJobWhileAnotherWorks) {
    FakeService service;
    const std::string id = service.submit(service.spec(40));
    const std::string broken = service.add_worker(), able = service.add_worker();
    int attempts = 0, rounds = 0;
    const auto failed_attempt = [&](const UnitLease& lease) {
        ++attempts;
        const Status s = service.coordinator->release_unit(broken, lease.reference(), internal_error("no space left on device"));
        EXPECT_TRUE(s.ok()) << s.message();
    };
    for (; rounds < 100 && service.coordinator->get_job(id)->state == JobState::kRunning; ++rounds) {
        for (int often = 0; often < 20; ++often)
            for (const UnitLease& lease : service.lease(broken)) failed_attempt(lease);
        service.now_ms += 100;
        for (const UnitLease& lease : service.lease(able))
            EXPECT_EQ(service.deliver(able, lease).outcome, SubmitOutcome::kAccepted);
    }
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_GE(attempts, 2);
    EXPECT_LE(attempts, 5) << "in " << 0.1 * rounds << " s: after 1, 2, 4, ... s of rest";
}

TEST(Coordinator, AJobThatFailsOnAllOfTwoWorkersFailsSoonAndTheNextIsRendered) {
    FakeService service({640, 360, {0, 0, 640, 360}});
    const std::string bad = service.submit(service.spec(200)), good = service.submit(service.spec(1));
    const std::string workers[] = {service.add_worker(), service.add_worker()};
    for (int round = 0; round < 100 && service.coordinator->get_job(good)->state == JobState::kRunning; ++round) {
        service.now_ms += 100;
        for (const std::string& worker : workers) {
            for (const UnitLease& lease : service.lease(worker)) {
                if (lease.job_id == good) {
                    EXPECT_EQ(service.deliver(worker, lease).outcome, SubmitOutcome::kAccepted);
                } else {
                    ASSERT_TRUE(
                        service.coordinator->release_unit(worker, lease.reference(), internal_error("a file is missing")).ok());
                }
            }
        }
    }
    EXPECT_EQ(service.coordinator->get_job(bad)->state, JobState::kFailed);
    EXPECT_EQ(service.wait_end(good).state, JobState::kSucceeded) << "within 10 s";
}

TEST(Coordinator, AWorkerAloneGetsItsFailedUnitsAgain) {
    FakeService service;
    const std::string id = service.submit(service.spec(3));
    const std::string worker = service.add_worker();
    for (int i = 0; i < 5; ++i) {
        const auto leases = service.lease(worker);
        ASSERT_EQ(leases.size(), 1u) << i;
        ASSERT_TRUE(service.coordinator->release_unit(worker, leases[0].reference(), internal_error("for a moment")).ok());
    }
    while (service.coordinator->get_job(id)->state == JobState::kRunning)
        for (const UnitLease& lease : service.lease(worker)) service.deliver(worker, lease);
    EXPECT_EQ(service.wait_end(id).state, JobState::kSucceeded);
}

TEST(Coordinator, ReleasedUnitsGoOnAndGoodbyeReleasesAll) {
    FakeService service;
    service.submit(service.spec(1));
    const std::string first = service.add_worker(), second = service.add_worker();
    const UnitLease lease = service.lease(first).at(0);
    EXPECT_TRUE(service.lease(second).empty());
    ASSERT_TRUE(service.coordinator->goodbye(first).ok());
    EXPECT_EQ(service.lease(second).size(), 1u);
    EXPECT_EQ(service.coordinator->heartbeat(first, {}).status().code(), StatusCode::kNotFound);
}

TEST(Coordinator, CancelledJobsRevokeTheirUnits) {
    FakeService service;
    const std::string id = service.submit(service.spec(4));
    const std::string worker = service.add_worker();
    const UnitLease lease = service.lease(worker).at(0);
    EXPECT_EQ(service.coordinator->cancel_job(id)->state, JobState::kCancelled);
    const auto revoked = service.coordinator->heartbeat(worker, {{lease.reference(), true}});
    ASSERT_TRUE(revoked.ok());
    EXPECT_EQ(revoked->size(), 1u);
    EXPECT_EQ(service.deliver(worker, lease).outcome, SubmitOutcome::kStale);
    EXPECT_TRUE(service.lease(worker).empty());
    EXPECT_EQ(service.coordinator->image(id, ImageKind::kFinal).status().code(), StatusCode::kFailedPrecondition);
}

/// Whoever watches a job hears of its end at once, not of every step before it.
TEST(Coordinator, TheEndOfAJobEndsTheWaitForIt) {
    FakeService service;
    const std::string id = service.submit(service.spec(4));
    EXPECT_TRUE(service.coordinator->wait_job_end(id, 0).ok());
    EXPECT_EQ(service.coordinator->wait_job_end("none", 0).code(), StatusCode::kNotFound);
    const auto begin = std::chrono::steady_clock::now();
    const std::jthread cancel([&] { EXPECT_TRUE(service.coordinator->cancel_job(id).ok()); });
    EXPECT_TRUE(service.coordinator->wait_job_end(id, 300).ok());
    EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kCancelled);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(100));
}

TEST(Coordinator, TimeLimitKeepsAPrefixThatSamplesPerPixelReproduce) {
    FakeService timed;
    JobSpec spec = timed.spec(0);
    spec.time_limit_seconds = 10;
    const std::string id = timed.submit(spec);
    const std::string worker = timed.add_worker();
    // Deliver 30 groups; hold back group 30 and deliver 31: the image ends before the gap.
    std::vector<UnitLease> held;
    for (int i = 0; i < 31; ++i) {
        const auto leases = timed.lease(worker);
        ASSERT_EQ(leases.size(), 1u);
        if (i == 0) {
            ASSERT_TRUE(timed.coordinator->heartbeat(worker, {{leases[0].reference(), true}}).ok());
        }
        if (i < 30) {
            EXPECT_EQ(timed.deliver(worker, leases[0]).outcome, SubmitOutcome::kAccepted);
        } else {
            held = leases;
        }
    }
    const auto after = timed.lease(worker);
    ASSERT_EQ(after.size(), 1u);
    EXPECT_EQ(timed.deliver(worker, after[0]).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(timed.coordinator->get_job(id)->state, JobState::kRunning);
    timed.now_ms += 10001;
    const JobInfo info = timed.wait_end(id);
    ASSERT_EQ(info.state, JobState::kSucceeded);
    EXPECT_EQ(info.samples_per_pixel_done, held[0].unit.render.first_iteration);
    FakeService again;
    EXPECT_EQ(run_by_hand(again, uint32_t(info.samples_per_pixel_done), false), info.image_digest);
}

TEST(Coordinator, TimeLimitWaitsForAtLeastOneGroup) {
    FakeService service;
    JobSpec spec = service.spec(0);
    spec.time_limit_seconds = 1;
    const std::string id = service.submit(spec);
    const std::string worker = service.add_worker();
    const UnitLease lease = service.lease(worker).at(0);
    ASSERT_TRUE(service.coordinator->heartbeat(worker, {{lease.reference(), true}}).ok());
    service.now_ms += 5000;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kRunning);
    EXPECT_TRUE(service.lease(service.add_worker()).empty()) << "only the first group is still wanted";
    EXPECT_EQ(service.deliver(worker, lease).outcome, SubmitOutcome::kAccepted);
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded);
    EXPECT_EQ(info.samples_per_pixel_done, 1u);
}

}  // namespace
}  // namespace lightloom
