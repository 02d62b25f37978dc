// What nobody waits for is written down once there is room, and what a full disk makes fail is tried again.

#include <gtest/gtest.h>

#include "common/core/atomic_file.h"
#include "server/archive.h"
#include "tests/service/fake.h"
#include "tests/service/full_database.h"
#include "tests/service/store_testing.h"

namespace lightloom {
namespace {

using testing::FakeService;
using testing::FullDatabase;
using testing::TempDirectory;

std::unique_ptr<JobStore> open_store(const TempDirectory& directory) {
    auto store = JobStore::open({.directory = directory.path / "store"});
    EXPECT_TRUE(store.ok()) << store.status().message();
    return *std::move(store);
}

/// Mutation: end_soon() forgets what it has handed over.
TEST(NoRoom, AJobThatEndedWithoutRoomHasEndedAfterARestart) {
    const FullDatabase database;
    FakeService service;
    service.durable = true;
    service.restart();
    const std::string id = service.submit(service.spec(5));
    const std::string worker = service.add_worker();
    const auto leases = service.lease(worker);
    ASSERT_EQ(leases.size(), 1u);
    database.full = true;
    ASSERT_TRUE(service.coordinator->release_unit(worker, leases[0].reference(), invalid_argument("it is wrong")).ok());
    EXPECT_EQ(service.wait_end(id).state, JobState::kFailed);
    database.full = false;
    service.now_ms += 10000;  // the next look for room
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    service.restart();
    const auto after = service.coordinator->get_job(id);
    ASSERT_TRUE(after.ok());
    EXPECT_EQ(after->state, JobState::kFailed) << "it does not go on";
}

TEST(NoRoom, WhatIsDroppedIsGoneBeforeTheUnitIsKeptAnew) {
    const FullDatabase database;
    const TempDirectory directory;
    Archive archive(open_store(directory));
    Job::Submission submission;
    submission.id = "a";
    ASSERT_TRUE(archive.accept(submission, {}).ok());
    const UnitKey unit{3, 0, UnitKind::kTraining, 0};
    WorkerRecord worker;
    ASSERT_TRUE(archive.keep_training("a", unit, worker, 1, sha256("first"), "first").ok());
    const auto second = [&] { return archive.keep_training("a", unit, worker, 1, sha256("second"), "second"); };
    EXPECT_EQ(second().code(), StatusCode::kAlreadyExists);
    database.full = true;
    archive.drop_soon("a", unit);
    EXPECT_EQ(second().code(), StatusCode::kResourceExhausted);
    EXPECT_EQ(archive.repay().code(), StatusCode::kResourceExhausted);
    EXPECT_EQ(second().code(), StatusCode::kResourceExhausted);
    database.full = false;
    EXPECT_TRUE(second().ok()) << "the first one is not in its way";
    EXPECT_TRUE(second().ok());
}

TEST(NoRoom, ASceneForWhichThereIsNoneIsReadLater) {
    std::atomic<int> reads{0};
    FakeService service({40, 30, {0, 0, 40, 30}}, std::nullopt, [&](CoordinatorOptions& options) {
        options.read_scene = [&reads, read = options.read_scene](const AssetStore& assets, const JobSpec& spec,
                                                                 std::stop_token stop) -> Result<SceneFacts> {
            if (reads++ == 0) return Status(StatusCode::kResourceExhausted, "scratch: No space left on device");
            return read(assets, spec, stop);
        };
    });
    const std::string id = service.submit(service.spec(5));
    EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kRunning) << service.coordinator->get_job(id)->message;
    EXPECT_EQ(reads, 2);
    service.now_ms += 2000;  // the next look for room
    const std::string worker = service.add_worker();
    size_t leased = 0;
    for (int i = 0; i < 200 && leased == 0; ++i) {
        leased = service.lease(worker).size();
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    EXPECT_EQ(leased, 1u);
}

TEST(NoRoom, ResultsOfJobsThatHaveEndedGoWhenTheStoreIsOpened) {
    const TempDirectory directory;
    {
        const auto store = open_store(directory);
        for (const char* id : {"a", "b"}) {
            ASSERT_TRUE(store->put_job(testing::new_job(id)).get().ok());
            ASSERT_TRUE(testing::put(*store, id, testing::render_unit(0), 1000).ok());
            ASSERT_TRUE(store->put_checkpoint(id, 1, "sums").ok());
        }
    }
    // Nothing of this build leaves them behind.
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open((directory.path / "store/jobs.db").c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, "UPDATE job SET state='cancelled', final='x' WHERE id='a'", nullptr, nullptr, nullptr),
              SQLITE_OK);
    sqlite3_close(database);
    const auto store = open_store(directory);
    const auto jobs = store->load();
    ASSERT_TRUE(jobs.ok()) << jobs.status().message();
    ASSERT_EQ(jobs->size(), 2u);
    EXPECT_TRUE((*jobs)[0].results.empty() && !(*jobs)[0].checkpoint);
    EXPECT_TRUE((*jobs)[1].results.size() == 1 && (*jobs)[1].checkpoint);
    size_t files = 0;
    for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator(directory.path / "store/checkpoints")) ++files;
    EXPECT_EQ(files, 1u);
}

}  // namespace
}  // namespace lightloom
