// Who is to blame: suspicion and stragglers as pure rules, and what the coordinator makes of workers that die, lack something or
// take too long. The clock is turned by the test.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <queue>

#include "server/blame.h"
#include "server/straggler.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::FakeService;
using Verdict = Suspicion::Verdict;

constexpr TimePoint kNever = TimePoint::max();
constexpr UnitKey kUnit{7, 0};

TimePoint at(double seconds) { return seconds_after(TimePoint(), 1000 + seconds); }

bool nobody(const std::set<uint32_t>&, TimePoint) { return false; }
bool somebody(const std::set<uint32_t>&, TimePoint) { return true; }

FrameLayout whole(int width, int height) { return {width, height, {0, 0, width, height}}; }

TEST(Suspicion, AUnitIsSuspectOnlyWhileOthersGoThrough) {
    Suspicion contrast, none;
    EXPECT_EQ(contrast.fell_silent(kUnit, {1, at(0), false, true, 5}, nobody), Verdict::kNothing);
    EXPECT_EQ(contrast.fell_silent(kUnit, {2, at(9), false, true, 6}, nobody), Verdict::kSuspect);
    for (uint32_t worker = 0; worker < 3; ++worker)
        EXPECT_EQ(none.fell_silent(kUnit, {worker, at(worker), false, false, 0}, nobody), Verdict::kNothing);
    EXPECT_EQ(none.fell_silent(kUnit, {9, at(9), false, false, 0}, nobody), Verdict::kSuspect) << "it is tried alone";
    EXPECT_TRUE(none.holds_back_others());
    EXPECT_FALSE(contrast.holds_back_others());
}

TEST(Suspicion, ThreeWorkersThatRanItAloneMakeItGuilty) {
    Suspicion suspicion;
    for (uint32_t worker = 0; worker < 20; ++worker)
        EXPECT_NE(suspicion.fell_silent(kUnit, {worker, at(worker), false, true, 1}, nobody), Verdict::kGuilty) << "not alone";
    EXPECT_EQ(suspicion.fell_silent(kUnit, {30, at(30), true, true, 1}, nobody), Verdict::kSuspect);
    EXPECT_FALSE(suspicion.may_run(kUnit, 1, true)) << "first another unit has to go through";
    EXPECT_TRUE(suspicion.may_run(kUnit, 2, true));
    EXPECT_TRUE(suspicion.may_run(kUnit, 1, false)) << "there are no others";
    EXPECT_EQ(suspicion.fell_silent(kUnit, {31, at(31), true, true, 2}, nobody), Verdict::kSuspect);
    EXPECT_EQ(suspicion.fell_silent(kUnit, {32, at(32), true, true, 3}, nobody), Verdict::kGuilty);
    EXPECT_EQ(suspicion.lost_alone(kUnit), (std::set<uint32_t>{30, 31, 32}));
}

TEST(Suspicion, AnotherSilenceAReturnAndAResultSpeakForTheUnit) {
    Suspicion suspicion;
    for (uint32_t worker = 0; worker < 2; ++worker) suspicion.fell_silent(kUnit, {worker, at(worker), false, true, 1}, nobody);
    for (uint32_t worker = 10; worker < 40; ++worker)
        EXPECT_EQ(suspicion.fell_silent(kUnit, {worker, at(worker), true, true, 1}, worker % 3 == 0 ? somebody : nobody),
                  Verdict::kSuspect);
    suspicion.acquit(kUnit);
    EXPECT_TRUE(suspicion.empty());
    suspicion.fell_silent(kUnit, {1, at(1), false, true, 1}, nobody);
    suspicion.fell_silent(kUnit, {2, at(1), false, true, 1}, nobody);
    EXPECT_TRUE(suspicion.suspects(kUnit));
    suspicion.returned(kUnit, 2);
    EXPECT_FALSE(suspicion.suspects(kUnit)) << "that worker is alive";
}

TEST(UnitTable, SuspectsAreLeasedApart) {
    UnitTable table(Plan(whole(100, 60), PlanOptions{}), 40, 8, std::nullopt);
    const UnitKey first = table.lease(0, at(0), at(10))->key;
    for (uint32_t worker = 0; worker < 2; ++worker) {
        if (worker == 1) {
            ASSERT_EQ(table.lease(1, at(20), at(30))->key, first);
        }
        const auto other = table.lease(9, at(20), kNever);
        ASSERT_EQ(table.complete(other->key, 9, sha256("x")), UnitTable::Completion::kFirst);
        const auto expired = table.expire(at(31));
        ASSERT_EQ(expired.size(), 1u);
        EXPECT_EQ(table.lose(expired[0], nobody), worker == 0 ? Verdict::kNothing : Verdict::kSuspect);
    }
    EXPECT_TRUE(table.has_suspect());
    EXPECT_NE(table.lease(3, at(40), kNever)->key, first);
    EXPECT_EQ(table.lease_suspect(4, at(40), kNever)->key, first);
    EXPECT_FALSE(table.has_suspect());
    EXPECT_FALSE(table.copy(first, 5, at(41), kNever)) << "a suspect is not copied";
    EXPECT_EQ(table.complete(first, 4, sha256("x")), UnitTable::Completion::kFirst);
    EXPECT_TRUE(table.suspicion().empty());
}

TEST(UnitTable, ACopyChangesNothingForTheOriginal) {
    UnitTable table(Plan(whole(100, 60), PlanOptions{}), 1, 8, std::nullopt);
    const UnitKey key = table.lease(0, at(0), kNever)->key;
    EXPECT_FALSE(table.copy(key, 0, at(1), at(10))) << "the same worker";
    ASSERT_TRUE(table.copy(key, 1, at(1), at(10)));
    EXPECT_FALSE(table.copy(key, 2, at(1), at(10))) << "one copy";
    EXPECT_TRUE(table.expire(at(11)).empty()) << "the copy is lost";
    EXPECT_EQ(table.copies(), 0u);
    EXPECT_EQ(table.leased_count(), 1u);
    ASSERT_TRUE(table.copy(key, 1, at(12), kNever));
    table.release(key, 1);
    EXPECT_EQ(table.leased_count(), 1u);
    ASSERT_TRUE(table.copy(key, 1, at(12), kNever));
    EXPECT_TRUE(table.renew(key, 0, {}, kNever) && table.renew(key, 1, {}, kNever)) << "both go on";
    table.release(key, 0);
    EXPECT_EQ(table.leased_count(), 1u) << "the copy holds it now";
    EXPECT_FALSE(table.lease(2, at(13), kNever));
    ASSERT_TRUE(table.copy(key, 2, at(13), kNever));
    EXPECT_EQ(table.complete(key, 2, sha256("x")), UnitTable::Completion::kFirst);
    EXPECT_FALSE(table.renew(key, 1, {}, kNever)) << "revoked";
    EXPECT_EQ(table.complete(key, 1, sha256("x")), UnitTable::Completion::kDuplicateSame);
    EXPECT_EQ(table.copies_made(), 4u);
}

TEST(UnitTable, WhatWasTakenFromAWorkerIsNotRenewed) {
    UnitTable table(Plan(whole(100, 60), PlanOptions{}), 1, 8, std::nullopt);
    const UnitKey key = table.lease(0, at(0), kNever)->key;
    EXPECT_EQ(table.rendering(key, 0, at(1)), at(1));
    EXPECT_EQ(table.rendering(key, 0, at(5)), at(1)) << "since when";
    table.fail(key, 0);
    EXPECT_FALSE(table.renew(key, 0, {}, kNever));
    EXPECT_EQ(table.lease(0, at(6), kNever)->key, key) << "where nobody else is";
    EXPECT_TRUE(table.renew(key, 0, {}, kNever));
}

TEST(Blame, FailuresCountOfWorkersThatDoBetterOrIfAllHaveTried) {
    WorkerRegistry workers(10);
    for (int i = 0; i < 4; ++i) workers.add({{}, 1, "host", 1}, at(0));
    const auto counted = [&](const UnitTable::FailedWorkers& by) { return failures_that_count(by, workers, "job", at(1)); };
    UnitTable::FailedWorkers by{{0, {5, 0, 0}}, {1, {2, 1, 0}}};
    EXPECT_EQ(counted(by).total, 1) << "the second worker succeeded after its first failure";
    workers.unit_succeeded(workers.at(0), "job");
    EXPECT_EQ(counted(by).total, 6);
    EXPECT_EQ(counted(by).workers, 2);
    by[2] = by[3] = {1, 0, 0};
    EXPECT_EQ(counted(by).total, 9) << "nobody is left to try";
    workers.lacks(workers.at(3), "job", "no disk", at(1));
    by.erase(3);
    EXPECT_EQ(counted(by).total, 8) << "and who lacks disk cannot";
}

/// Mutation: the time of the lease, which nobody knows, is left at the beginning of all time.
TEST(UnitTable, ALeaseOfAnEarlierCoordinatorBeginsWhenItIsHeardOf) {
    UnitTable table(Plan(whole(100, 60), PlanOptions{}), 1, 8, std::nullopt);
    ASSERT_TRUE(table.has_more_than(0));
    ASSERT_TRUE(table.renew({}, 3, at(70), kNever));
    ASSERT_EQ(table.in_work().size(), 1u);
    EXPECT_EQ(table.in_work()[0].leased, at(70));
    EXPECT_EQ(table.in_work()[0].worker, 3u);
}

TEST(Straggler, AUnitHasTwentyTimesItsTimeAndAtLeastAMinute) {
    const UnitTable::InWork item{Plan(whole(100, 60), PlanOptions{}).units({0, 0, 10})[0], 0, {}, {}, false};
    EXPECT_EQ(samples_of(item.unit), 60000);
    EXPECT_EQ(longest_seconds(item.unit, 1000, {}), 1200);
    EXPECT_EQ(longest_seconds(item.unit, 60000, {}), 60);
    EXPECT_EQ(longest_seconds(item.unit, 0, {}), 3600);
}

/// Seconds of a job with these workers, whose speeds are samples a second; the table, the paces and the rules are the real ones.
double makespan(const std::vector<double>& speeds, uint64_t* copies) {
    constexpr uint32_t kIterations = 600;
    const FrameLayout frame = whole(512, 512);
    UnitTable table(Plan(frame, PlanOptions{}), kIterations, 42, std::nullopt);
    WorkerRegistry workers(1e9);
    for (size_t i = 0; i < speeds.size(); ++i) workers.add({{}, 1, "host", i}, TimePoint());
    struct Holder {
        std::deque<WorkUnit> held;
        TimePoint begun, done;
    };
    std::vector<Holder> holders(speeds.size());
    TimePoint now;
    std::vector<bool> group_done(table.group_total());
    uint32_t merged = 0;
    while (table.done_count() < table.unit_total()) {
        const auto begin = [&](uint32_t w) {
            Holder& holder = holders[w];
            if (holder.held.empty()) return;
            holder.begun = now;
            holder.done = seconds_after(now, samples_of(holder.held.front()) / speeds[w]);
            table.rendering(holder.held.front().key, w, now);
        };
        for (bool more = true; more;) {
            more = false;
            for (uint32_t w = 0; w < holders.size(); ++w) {
                Holder& holder = holders[w];
                if (holder.held.size() > 1) continue;
                size_t idle = 0;
                for (const Holder& h : holders) idle += h.held.empty();
                std::optional<WorkUnit> unit;
                if (holder.held.empty() ? table.has_more_than(0) : table.has_more_than(idle)) unit = table.lease(w, now, kNever);
                if (!unit && holder.held.empty() && may_copy(table)) {
                    for (const UnitKey& key : worth_copying(table, "job", workers, workers.at(w).samples_per_second("job"), now))
                        if ((unit = table.copy(key, w, now, kNever))) break;
                }
                if (!unit) continue;
                holder.held.push_back(*unit);
                if (holder.held.size() == 1) begin(w);
                more = true;
            }
        }
        // A second without an event lets those that are idle ask again.
        TimePoint next = seconds_after(now, 1);
        for (const Holder& holder : holders)
            if (!holder.held.empty()) next = std::min(next, holder.done);
        now = next;
        for (uint32_t w = 0; w < holders.size(); ++w) {
            Holder& holder = holders[w];
            // What somebody else has delivered is revoked at the next heartbeat.
            const bool had = !holder.held.empty();
            const UnitKey in_work = had ? holder.held.front().key : UnitKey{};
            std::erase_if(holder.held, [&](const WorkUnit& u) { return table.is_done(u.key); });
            if (had && (holder.held.empty() || holder.held.front().key != in_work)) {
                begin(w);
                continue;
            }
            if (!had || holder.done > now) continue;
            const WorkUnit unit = holder.held.front();
            holder.held.pop_front();
            workers.at(w).delivered("job", samples_of(unit), seconds_between(holder.begun, now));
            if (table.complete(unit.key, w, sha256("x")) == UnitTable::Completion::kFirst) group_done[unit.key.group] = true;
            while (merged < group_done.size() && group_done[merged]) table.advance(++merged);
            begin(w);
        }
    }
    if (copies) *copies = table.copies_made();
    return seconds_between(TimePoint(), now);
}

TEST(Straggler, AWorkerAtThreePercentCostsAtMostFifteenPercent) {
    uint64_t copies = 0;
    const double alone = makespan({100000}, nullptr), both = makespan({100000, 3000}, &copies);
    std::printf("alone %.0f s, with a worker at 3 %% %.0f s, ratio %.3f, %llu copies\n", alone, both, both / alone,
                (unsigned long long)copies);
    EXPECT_LE(both / alone, 1.15);
    EXPECT_GE(copies, 1u);
    EXPECT_LE(makespan({100000, 3000, 100000}, nullptr), 0.5 * 1.15 * alone);
}

/// A service whose workers die and are replaced.
struct Farm : FakeService {
    using FakeService::FakeService;
    void beat(const std::string& worker) { EXPECT_TRUE(coordinator->heartbeat(worker, {}).ok()); }
    /// Time passes, and only these workers are heard of.
    void pass(double seconds, const std::vector<std::string>& alive, const std::string& job) {
        for (double done = 0; done < seconds; done += 2) {
            now_ms += 2000;
            for (const std::string& worker : alive) beat(worker);
        }
        wait(job, [](const JobInfo& j) { return j.unit_leased == 0 || is_terminal(j.state); });
    }
};

TEST(Blame, AUnitThatTakesDownWorkersAloneFailsItsJobByName) {
    Farm farm;
    const std::string id = farm.submit(farm.spec(200)), able = farm.add_worker();
    std::vector<std::string> names;
    UnitKey unit;
    for (int i = 0; i < 5; ++i) {
        ASSERT_EQ(farm.coordinator->get_job(id)->state, JobState::kRunning) << i;
        names.push_back(farm.add_worker());
        const UnitLease lease = farm.lease(names.back()).at(0);
        if (i == 0) unit = lease.unit.key;
        ASSERT_EQ(lease.unit.key, unit) << i;
        EXPECT_EQ(farm.lease(names.back()).size(), i < 2 ? 1u : 0u) << "a suspect runs alone";
        EXPECT_EQ(farm.deliver(able, farm.lease(able).at(0)).outcome, SubmitOutcome::kAccepted);
        farm.pass(12, {able}, id);
        // Once the trial has begun, another unit has to go through before the next run.
        if (i == 2 || i == 3)
            for (const UnitLease& other : farm.lease(able)) farm.deliver(able, other);
    }
    const JobInfo info = farm.wait_end(id);
    EXPECT_EQ(info.state, JobState::kFailed);
    EXPECT_TRUE(info.message.starts_with("unit " + std::to_string(unit.group) + "/0: 3 workers fell silent over it ("))
        << info.message;
    for (int i = 2; i < 5; ++i) EXPECT_NE(info.message.find(names[size_t(i)]), std::string::npos) << info.message;
    EXPECT_EQ(info.message.find(names[0]), std::string::npos) << info.message;
}

/// Mutation: a heartbeat that was sent before the answer with a lease arrived takes the lease from what the worker holds.
TEST(Blame, AHeartbeatThatCrossesALeaseLeavesASuspectAlone) {
    Farm farm;
    const std::string id = farm.submit(farm.spec(200)), able = farm.add_worker();
    const auto crossed = [&](const std::string& worker) {
        const UnitLease lease = farm.lease(worker).at(0);
        farm.beat(worker);
        return lease;
    };
    const std::string full = farm.add_worker();
    crossed(full), crossed(full);
    EXPECT_TRUE(farm.lease(full).empty()) << "it holds two";
    ASSERT_TRUE(farm.coordinator->goodbye(full).ok());
    for (int i = 0; i < 2; ++i) {
        farm.lease(farm.add_worker());
        EXPECT_EQ(farm.deliver(able, farm.lease(able).at(0)).outcome, SubmitOutcome::kAccepted);
        farm.pass(12, {able}, id);
    }
    const std::string alone = farm.add_worker();
    const UnitLease suspect = crossed(alone);
    EXPECT_TRUE(farm.lease(alone).empty()) << "nothing is given beside a suspect";
    EXPECT_EQ(farm.deliver(alone, suspect).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(farm.lease(alone).size(), 1u);
}

TEST(Blame, SeventyFiveDeathsAtRandomFailNoJob) {
    Farm farm;
    Rng rng({28, Stage::kCamera, 0, 0});
    int kills = 0;
    for (int job = 0; job < 7; ++job) {
        const std::string id = farm.submit(farm.spec(60));
        std::vector<std::string> workers{farm.add_worker(), farm.add_worker(), farm.add_worker()};
        for (int step = 0; step < 2000 && farm.coordinator->get_job(id)->state == JobState::kRunning; ++step) {
            for (std::string& worker : workers) {
                std::vector<UnitLease> held = farm.lease(worker);
                for (UnitLease& more : farm.lease(worker)) held.push_back(std::move(more));
                // Each unit is as likely to see its worker die as not, and two or three die within a lease.
                if (rng.below(2) == 0 && kills < 11 * (job + 1)) {
                    worker = farm.add_worker();
                    ++kills;
                    continue;
                }
                for (const UnitLease& lease : held) farm.deliver(worker, lease);
            }
            farm.now_ms += 5500;
            for (const std::string& worker : workers) farm.beat(worker);
            std::this_thread::sleep_for(std::chrono::milliseconds(25));
        }
        const JobInfo info = farm.wait_end(id);
        EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    }
    EXPECT_GE(kills, 75);
}

/// As `lightloom render` has it: the workers are threads of one process.
TEST(Blame, WhatTheOnlyHostLacksFailsTheJob) {
    FakeService service({40, 30, {0, 0, 40, 30}}, std::nullopt,
                        [](CoordinatorOptions& options) { options.no_other_workers = true; });
    const std::string id = service.submit(service.spec(3)), worker = service.add_worker();
    const auto leases = service.lease(worker);
    ASSERT_EQ(leases.size(), 1u);
    const Status lacks{StatusCode::kResourceExhausted, "this machine has 2.1 GB"};
    ASSERT_TRUE(service.coordinator->release_unit(worker, leases[0].reference(), lacks).ok());
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kFailed);
    EXPECT_TRUE(info.message.ends_with(": this machine has 2.1 GB")) << info.message;
}

TEST(Blame, AFullDiskMakesTheJobWaitAndSayWhoLacksWhat) {
    Farm farm;
    const std::string id = farm.submit(farm.spec(3)), worker = farm.add_worker();
    const Status full{StatusCode::kResourceExhausted, "/cache/scene: No space left on device"};
    int attempts = 0;
    for (int second = 0; second < 600; ++second) {
        for (const UnitLease& lease : farm.lease(worker)) {
            ++attempts;
            ASSERT_TRUE(farm.coordinator->release_unit(worker, lease.reference(), full).ok());
        }
        farm.now_ms += 1000;
        farm.beat(worker);
    }
    EXPECT_GE(attempts, 10);
    EXPECT_LE(attempts, 20) << "it rests for a minute in the end";
    const JobInfo info = *farm.coordinator->get_job(id);
    EXPECT_EQ(info.state, JobState::kRunning);
    EXPECT_EQ(info.message, "waits for its workers: host (" + worker + "): /cache/scene: No space left on device");
    farm.now_ms += 61000;
    farm.beat(worker);
    for (int i = 0; i < 10 && farm.coordinator->get_job(id)->state == JobState::kRunning; ++i)
        for (const UnitLease& lease : farm.lease(worker)) farm.deliver(worker, lease);
    EXPECT_EQ(farm.wait_end(id).state, JobState::kSucceeded);
    EXPECT_EQ(farm.coordinator->get_job(id)->message, "");
}

TEST(Blame, OneSickWorkerAloneDoesNotEmptyTheQueue) {
    Farm farm;
    std::vector<std::string> jobs;
    for (int i = 0; i < 4; ++i) jobs.push_back(farm.submit(farm.spec(2)));
    const std::string sick = farm.add_worker();
    for (int second = 0; second < 300; ++second) {
        for (const UnitLease& lease : farm.lease(sick))
            ASSERT_TRUE(farm.coordinator->release_unit(sick, lease.reference(), internal_error("a broken library")).ok());
        farm.now_ms += 1000;
        farm.beat(sick);
    }
    int failed = 0;
    for (const std::string& job : jobs) failed += farm.coordinator->get_job(job)->state == JobState::kFailed;
    EXPECT_LE(failed, 1);
    EXPECT_NE(farm.coordinator->get_job(jobs[3])->message.find("a broken library"), std::string::npos);
    ASSERT_TRUE(farm.coordinator->goodbye(sick).ok());
    const std::string able = farm.add_worker();
    for (int i = 0; i < 100; ++i)
        for (const UnitLease& lease : farm.lease(able)) farm.deliver(able, lease);
    for (size_t i = 1; i < jobs.size(); ++i) EXPECT_EQ(farm.wait_end(jobs[i]).state, JobState::kSucceeded);
}

TEST(Blame, AUnitThatIsRenderedForTooLongIsTakenAway) {
    Farm farm;
    const std::string id = farm.submit(farm.spec(1)), slow = farm.add_worker(), other = farm.add_worker();
    const UnitLease lease = farm.lease(slow).at(0);
    for (int second = 0; second < 3600; second += 5) {
        ASSERT_TRUE(farm.coordinator->heartbeat(slow, {{lease.reference(), true}})->empty()) << second;
        farm.beat(other);
        farm.now_ms += 5000;
    }
    EXPECT_TRUE(farm.lease(other).empty());
    farm.now_ms += 1000;
    EXPECT_EQ(farm.coordinator->heartbeat(slow, {{lease.reference(), true}})->size(), 1u) << "revoked";
    EXPECT_EQ(farm.coordinator->heartbeat(slow, {{lease.reference(), true}})->size(), 1u) << "and not renewed";
    const UnitLease again = farm.lease(other).at(0);
    EXPECT_EQ(again.unit.key, lease.unit.key);
    EXPECT_EQ(farm.deliver(other, again).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(farm.wait_end(id).state, JobState::kSucceeded);
}

TEST(Blame, AnIdleWorkerRendersTheLastUnitOfASlowOneToo) {
    Farm farm;
    const std::string id = farm.submit(farm.spec(3)), slow = farm.add_worker(), fast = farm.add_worker();
    const auto deliver = [&](const std::string& worker, const UnitLease& lease, double seconds) {
        const auto encoded = encode_partial(testing::fake_partial(lease.unit.render, lease.spec.frame), lease.spec.frame);
        return farm.coordinator->submit_payload(worker, lease.reference(), encoded->descriptor, encoded->payload, seconds)->outcome;
    };
    const UnitLease late = farm.lease(slow).at(0);
    ASSERT_TRUE(farm.coordinator->heartbeat(slow, {{late.reference(), true}})->empty());
    for (int i = 0; i < 2; ++i) EXPECT_EQ(deliver(fast, farm.lease(fast).at(0), 1), SubmitOutcome::kAccepted);
    EXPECT_TRUE(farm.lease(fast).empty()) << "the other worker has only begun";
    farm.now_ms += 4000;
    const UnitLease copy = farm.lease(fast).at(0);
    EXPECT_EQ(copy.unit.key, late.unit.key);
    EXPECT_TRUE(farm.coordinator->heartbeat(slow, {{late.reference(), true}})->empty()) << "both go on";
    EXPECT_TRUE(farm.coordinator->heartbeat(fast, {{copy.reference(), true}})->empty());
    EXPECT_EQ(farm.coordinator->get_job(id)->unit_leased, 1u);
    EXPECT_EQ(deliver(fast, copy, 1), SubmitOutcome::kAccepted);
    EXPECT_EQ(farm.coordinator->heartbeat(slow, {{late.reference(), true}})->size(), 1u);
    EXPECT_EQ(farm.wait_end(id).state, JobState::kSucceeded);
}

}  // namespace
}  // namespace lightloom
