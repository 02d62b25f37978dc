// The pure parts of the coordinator: the states of a job, who makes which tables, and what is due when. No lock, clock or thread.

#include <gtest/gtest.h>

#include "server/job_book.h"
#include "tests/support/algorithm_of.h"

namespace lightloom {
namespace {

constexpr TimePoint kStart{std::chrono::hours(1)};

TimePoint at(double seconds) { return seconds_after(kStart, seconds); }

JobSpec spec_of(uint32_t samples, double time_limit = 0) {
    JobSpec spec;
    spec.algorithm = testing::algorithm_of("bdpt").completed();
    spec.samples_per_pixel = samples;
    spec.time_limit_seconds = time_limit;
    spec.frame = {8, 4, {0, 0, 8, 4}};
    return spec;
}

Job job_of(const std::string& id, const JobSpec& spec = spec_of(4)) {
    return Job({.id = id,
                .request_id = "request of " + id,
                .submitted = spec,
                .label = {},
                .scene = "scene.pbrt",
                .created_at = "now",
                .directory = {}},
               spec, kStart);
}

Job::RenderPlan plan_of(const JobSpec& spec) {
    const Plan plan(spec.frame, spec.algorithm);
    return {spec,
            {},
            UnitTable(plan, spec.samples_per_pixel, 4, std::nullopt),
            std::make_shared<Reducer>(spec.frame, plan.tile_count()),
            {}};
}

TEST(Job, BeginsToRenderOnlyFromPreparing) {
    Job job = job_of("job-1");
    EXPECT_EQ(job.open_units(), nullptr);
    const Effects begun = job.begin_rendering(plan_of(job.spec()), at(3));
    EXPECT_TRUE(begun.changed);
    EXPECT_TRUE(begun.units);
    EXPECT_EQ(job.state(), JobState::kRunning);
    EXPECT_NE(job.open_units(), nullptr);
    EXPECT_EQ(job.info(at(5)).prepare_seconds, 3);
    const Effects again = job.begin_rendering(plan_of(job.spec()), at(4));
    EXPECT_FALSE(again.changed);
    EXPECT_EQ(again.discard.size(), 1u) << "a plan that comes too late is thrown away without the lock";
}

TEST(Job, EndsOnce) {
    Job job = job_of("job-1");
    job.begin_rendering(plan_of(job.spec()), at(1));
    const Effects effects = job.end(JobState::kCancelled, {}, at(2));
    EXPECT_TRUE(effects.ended);
    EXPECT_FALSE(effects.discard.empty()) << "sums and units are freed without the lock";
    EXPECT_EQ(job.open_units(), nullptr);
    EXPECT_EQ(job.reducer(), nullptr);
    EXPECT_FALSE(job.fail(internal_error("late"), at(3)).ended);
    EXPECT_EQ(job.state(), JobState::kCancelled);
    EXPECT_EQ(job.message(), "");
    EXPECT_GT(job.info(at(9)).unit_total, 0u) << "the counts outlive the units";
}

TEST(Job, TimeRunsFromTheFirstSampleAndWithoutThePreparation) {
    Job job = job_of("job-1", spec_of(0, 10));
    job.preparation().start_clock(at(1));
    EXPECT_EQ(job.seconds_left(at(3)), 8);
    job.begin_rendering(plan_of(job.spec()), at(3));
    EXPECT_EQ(job.seconds_left(at(50)), 8) << "nothing renders";
    EXPECT_FALSE(job.end_of_time());
    EXPECT_TRUE(job.rendering_begins(at(100)).changed);
    EXPECT_FALSE(job.rendering_begins(at(101)).changed) << "only the first counts";
    EXPECT_EQ(job.seconds_left(at(103)), 5);
    ASSERT_TRUE(job.end_of_time());
    EXPECT_EQ(*job.end_of_time(), at(108));
    EXPECT_FALSE(job.time_is_up(at(107)));
    EXPECT_TRUE(job.time_is_up(at(108)));
    job.close();
    EXPECT_FALSE(job.time_is_up(at(109))) << "it is said once";
    bool finish = true;
    job.finish_if_complete(at(109), &finish);
    EXPECT_FALSE(finish) << "an image needs one group";
}

TEST(Job, OldTrainingUnitsDoNotBelongToTheNextRound) {
    Job job = job_of("job-1");
    job.open_round(UnitKind::kTraining, 0, {0, 4, 4}, std::nullopt);
    const UnitKey first = job.preparation().round->key(0);
    EXPECT_NE(job.open_units(first), nullptr);
    const Effects effects = job.open_round(UnitKind::kTraining, 1, {4, 4, 8}, std::nullopt);
    EXPECT_TRUE(effects.units);
    EXPECT_EQ(effects.discard.size(), 1u);
    EXPECT_EQ(job.open_units(first), nullptr);
    EXPECT_TRUE(job.wait_for_tables().changed);
    EXPECT_EQ(job.open_units(), nullptr);
    EXPECT_EQ(job.info(at(1)).phase, PreparePhase::kWaitingForTables);
}

TEST(TableLedger, TheOldestMakerIsWaitedFor) {
    TableLedger ledger;
    const Digest key = sha256("key");
    ledger.make(7, key);
    ledger.make(3, key);
    EXPECT_EQ(ledger.maker_of(key, 9), 3u);
    EXPECT_EQ(ledger.maker_of(key, 3), 7u) << "nobody waits for itself";
    EXPECT_FALSE(ledger.maker_of(sha256("other"), 9));
    ledger.make(3, sha256("other"));
    EXPECT_EQ(ledger.maker_of(key, 9), 7u) << "a job makes tables of one key";
    ledger.stop_making(7);
    EXPECT_FALSE(ledger.maker_of(key, 9));
}

TEST(TableLedger, WhoWaitsMakesNothing) {
    TableLedger ledger;
    const Digest key = sha256("key");
    ledger.make(1, key);
    ledger.make(2, key);
    ledger.wait(2, 1);
    ledger.wait(5, 1);
    EXPECT_FALSE(ledger.maker_of(key, 1));
    EXPECT_EQ(ledger.waiting_for(1), (std::vector<uint64_t>{2, 5}));
    ledger.wait(5, 2);
    EXPECT_EQ(ledger.waiting_for(1), (std::vector<uint64_t>{2}));
    EXPECT_EQ(ledger.maker_of_last_resort(5), 1u);
    EXPECT_EQ(ledger.maker_of_last_resort(9), 9u);
    ledger.stop_waiting(2);
    EXPECT_EQ(ledger.maker_of_last_resort(5), 2u);
    EXPECT_TRUE(ledger.waiting_for(1).empty());
}

TEST(TableLedger, AFileStaysAsLongAsAJobNeedsIt) {
    TableLedger ledger;
    const Digest a = sha256("a"), b = sha256("b");
    ledger.pin(1, a);
    ledger.pin(2, a);
    ledger.pin(1, b);
    ledger.pin(1, {});
    EXPECT_FALSE(ledger.pinned({})) << "the zero digest is no file";
    EXPECT_FALSE(ledger.unpin(1, a));
    EXPECT_TRUE(ledger.pinned(a));
    EXPECT_FALSE(ledger.unpin(1, a)) << "it was not pinned any more";
    EXPECT_TRUE(ledger.unpin(2, a));
    EXPECT_FALSE(ledger.pinned(a));
    EXPECT_EQ(ledger.forget(1), std::vector<Digest>{b});
    EXPECT_TRUE(ledger.forget(1).empty());
}

TEST(Agenda, TellsTheEarliestTimeOfEachJob) {
    Agenda agenda;
    EXPECT_FALSE(agenda.next());
    EXPECT_TRUE(agenda.at_most(1, at(10)));
    EXPECT_FALSE(agenda.at_most(2, at(20)));
    EXPECT_TRUE(agenda.at_most(2, at(5))) << "now it is the first";
    EXPECT_FALSE(agenda.at_most(2, at(7))) << "it is due earlier anyway";
    EXPECT_EQ(agenda.next(), at(5));
    EXPECT_EQ(agenda.take_due(at(10)), (std::vector<uint64_t>{2, 1}));
    EXPECT_FALSE(agenda.next());
}

TEST(JobBook, FindsJobsAndForgetsTheOldestThatEnded) {
    JobBook book(10);
    std::vector<JobPtr> files;
    for (int i = 0; i < 4; ++i) files.push_back(book.add(job_of("job-" + std::to_string(i))));
    EXPECT_EQ(book.find("job-2"), files[2]);
    EXPECT_EQ(book.find(files[2]->number), files[2]);
    EXPECT_EQ(book.find_request("request of job-2"), files[2]);
    EXPECT_EQ(book.open_jobs().size(), 4u);
    for (const int i : {0, 1, 3}) {
        files[size_t(i)]->job.end(JobState::kCancelled, {}, at(1));
        book.job_ended(*files[size_t(i)]);
    }
    EXPECT_EQ(book.open_jobs().size(), 1u);
    files[0]->running_tasks = 1;
    EXPECT_EQ(book.forget_ended(1), (std::vector<JobPtr>{files[1], files[3]})) << "a task still works for the oldest";
    files[0]->running_tasks = 0;
    EXPECT_EQ(book.find("job-1"), nullptr);
    EXPECT_EQ(book.find_request("request of job-1"), nullptr);
    EXPECT_TRUE(book.forget_ended(1).empty());
    EXPECT_EQ(book.jobs().size(), 2u);
}

TEST(JobBook, ServesTheMakerInThePlaceOfWhoWaits) {
    JobBook book(10);
    const JobPtr first = book.add(job_of("job-1")), second = book.add(job_of("job-2"));
    EXPECT_EQ(book.in_its_place(first), first);
    book.ledger.wait(first->number, second->number);
    EXPECT_EQ(book.in_its_place(first), second);
    EXPECT_EQ(book.info(*first, at(1)).waits_for, "job-2");
}

TEST(JobBook, WakesOneWaiterAfterTheOther) {
    JobBook book(10);
    JobBook::Waiter a, b;
    book.waiters = {&a, &b};
    book.wake_one_waiter();
    EXPECT_TRUE(a.look);
    EXPECT_FALSE(b.look);
    book.wake_one_waiter();
    EXPECT_TRUE(b.look);
    book.wake_one_waiter();  // all look already
    a.look = b.look = false;
    book.wake_all_waiters();
    EXPECT_TRUE(a.look && b.look);
    // Who looked in vain passes on to those behind, and never back.
    a.look = b.look = false;
    book.wake_one_waiter(std::next(book.waiters.begin()));
    EXPECT_FALSE(a.look);
    EXPECT_TRUE(b.look);
    b.look = false;
    book.wake_one_waiter(book.waiters.end());
    EXPECT_FALSE(a.look || b.look);
}

}  // namespace
}  // namespace lightloom
