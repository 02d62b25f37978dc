// Which unit a worker gets next, without a coordinator around it.

#include "server/choose_unit.h"

#include <gtest/gtest.h>

#include <deque>

namespace lightloom {
namespace {

using Turn = Choice::Turn;
using Kind = Choice::Kind;

constexpr TimePoint kNever = TimePoint::max();

TimePoint at(double seconds) { return seconds_after(TimePoint(), seconds); }

/// Jobs of one tile a group, and workers that were heard of.
struct Shop {
    UnitTable& add_job(uint64_t iterations, uint32_t window = 8) {
        return jobs.emplace_back(Plan({100, 60, {0, 0, 100, 60}}, PlanOptions{}), iterations, window, std::nullopt);
    }
    WorkerRecord& add_worker() { return workers.add({{}, 1, "host", 1}, at(0)); }
    Choice choose(WorkerRecord& worker, double seconds = 0) {
        const auto offers = [&](const std::function<bool(const Offer&)>& visit) {
            for (size_t i = 0; i < jobs.size(); ++i)
                if (!visit({i, names[i], &jobs[i], true})) return;
        };
        const Choice choice = choose_unit(offers, worker, workers, at(seconds), kNever);
        if (choice.turn != Turn::kLeased) return choice;
        const UnitReference unit{names[choice.job], choice.unit.key};
        worker.held.insert(unit);
        if (choice.kind == Kind::kSuspect) worker.alone = unit;
        return choice;
    }
    void deliver(WorkerRecord& worker, const Choice& choice, double seconds) {
        EXPECT_EQ(jobs[choice.job].complete(choice.unit.key, worker.index, sha256("x")), UnitTable::Completion::kFirst);
        worker.delivered(names[choice.job], 6000, seconds);
        worker.held.erase({names[choice.job], choice.unit.key});
    }

    const std::vector<std::string> names{"first", "second", "third"};
    std::deque<UnitTable> jobs;
    WorkerRegistry workers{1e9};
};

TEST(ChooseUnit, JobsAreServedInTheirOrder) {
    Shop shop;
    shop.add_job(1), shop.add_job(2);
    std::vector<uint64_t> jobs;
    for (int i = 0; i < 3; ++i) jobs.push_back(shop.choose(shop.add_worker()).job);
    EXPECT_EQ(jobs, (std::vector<uint64_t>{0, 1, 1}));
    EXPECT_EQ(shop.choose(shop.add_worker()).turn, Turn::kNothingLeft);
}

TEST(ChooseUnit, ASecondUnitIsForWhoeverHasOneOnlyWhereNobodyHasNone) {
    Shop shop;
    shop.add_job(3);
    WorkerRecord &busy = shop.add_worker(), &waits = shop.add_worker();
    ASSERT_EQ(shop.choose(busy).turn, Turn::kLeased);
    waits.waiting = 1;
    EXPECT_EQ(shop.choose(busy).turn, Turn::kLeased) << "two are left, one of them for the other worker";
    EXPECT_EQ(shop.choose(busy).turn, Turn::kNotForThisOne) << "nobody holds three";
    EXPECT_EQ(shop.choose(waits).turn, Turn::kLeased);
    Shop scarce;
    scarce.add_job(2);
    WorkerRecord &one = scarce.add_worker(), &other = scarce.add_worker();
    ASSERT_EQ(scarce.choose(one).turn, Turn::kLeased);
    other.waiting = 1;
    EXPECT_EQ(scarce.choose(one).turn, Turn::kNotForThisOne) << "the last one is for the other worker";
    EXPECT_EQ(scarce.choose(other).turn, Turn::kLeased);
}

TEST(ChooseUnit, ASuspectIsForAWorkerThatHoldsNothing) {
    Shop shop;
    UnitTable& units = shop.add_job(20);
    WorkerRecord &busy = shop.add_worker(), &free = shop.add_worker();
    const UnitKey unit{};
    for (uint32_t dead = 10; dead < 12; ++dead) {  // which took two workers down, while another one went through
        ASSERT_EQ(units.lease(dead, at(0), at(1))->key, unit);
        const Choice other = shop.choose(busy);
        shop.deliver(busy, other, 1);
        for (const UnitTable::Expired& lease : units.expire(at(2))) units.lose(lease, [](auto&&...) { return false; });
    }
    ASSERT_TRUE(units.has_suspect());
    shop.add_job(5);
    busy.held.insert({"second", {0, 0}});
    EXPECT_EQ(shop.choose(busy).turn, Turn::kNotForThisOne);
    const Choice choice = shop.choose(free);
    EXPECT_EQ(choice.kind, Kind::kSuspect);
    EXPECT_EQ(choice.unit.key, unit);
    EXPECT_EQ(shop.choose(free).turn, Turn::kNotForThisOne) << "nothing is given beside it";
    EXPECT_EQ(shop.choose(busy).turn, Turn::kLeased) << "and all others go on";
}

TEST(ChooseUnit, WhoFindsNothingCopiesAStraggler) {
    Shop shop;
    shop.add_job(3);
    WorkerRecord &slow = shop.add_worker(), &fast = shop.add_worker(), &fresh = shop.add_worker();
    const Choice of_slow = shop.choose(slow), of_fast = shop.choose(fast);
    shop.deliver(slow, of_slow, 1000);
    shop.deliver(fast, of_fast, 1);
    const Choice straggler = shop.choose(slow);
    ASSERT_EQ(straggler.turn, Turn::kLeased);
    shop.jobs[0].rendering(straggler.unit.key, slow.index, at(0));
    EXPECT_EQ(shop.choose(fresh, 5).turn, Turn::kNothingLeft) << "it would not know whether that saves time";
    const Choice copy = shop.choose(fast, 5);
    EXPECT_EQ(copy.kind, Kind::kCopy);
    EXPECT_EQ(copy.unit.key, straggler.unit.key);
}

TEST(ChooseUnit, AWorkerWhoseHostLacksSomethingLeavesTheJobToOthers) {
    Shop shop;
    shop.add_job(1), shop.add_job(1);
    WorkerRecord& worker = shop.add_worker();
    shop.workers.lacks(worker, "first", "no disk", at(0));
    const Choice choice = shop.choose(worker);
    EXPECT_EQ(choice.job, 1u);
    EXPECT_EQ(shop.choose(shop.add_worker()).job, 0u);
}

}  // namespace
}  // namespace lightloom
