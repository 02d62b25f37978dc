// The durable store: what was acknowledged is there after every death, what was not is there as a whole or not at all.

#include "server/store/store.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "tests/service/store_testing.h"
#include "tests/support/temp_directory.h"

namespace lightloom {
namespace {

using testing::FailingFiles;
using testing::new_job;
using testing::payload_of;
using testing::put;
using testing::render_unit;
using testing::TempDirectory;

std::unique_ptr<JobStore> open_store(const TempDirectory& directory, uint64_t segment_bytes = SegmentLog::kSegmentBytes,
                                     StoreFiles& files = StoreFiles::system()) {
    auto store = JobStore::open({.directory = directory.path / "store", .segment_bytes = segment_bytes, .files = &files});
    EXPECT_TRUE(store.ok()) << store.status().message();
    return store.ok() ? *std::move(store) : nullptr;
}

StoredJob only_job(JobStore& store) {
    auto jobs = store.load();
    EXPECT_TRUE(jobs.ok()) << jobs.status().message();
    EXPECT_EQ(jobs->size(), 1u);
    return jobs->at(0);
}

size_t files_in(const TempDirectory& directory, const char* folder) {
    const auto path = directory.path / "store" / folder;
    return size_t(std::distance(std::filesystem::directory_iterator(path), std::filesystem::directory_iterator()));
}

void expect_payload(const JobStore& store, const StoredResult& result, size_t size) {
    const auto payload = store.read_payload(result);
    ASSERT_TRUE(payload.ok()) << payload.status().message();
    EXPECT_EQ(payload->header(), "header");
    EXPECT_EQ(payload->payload(), payload_of(result.unit, size));
    EXPECT_EQ(result.digest, sha256(payload->payload()));
}

TEST(JobStore, AllOfAJobIsThereAfterARestart) {
    const TempDirectory directory;
    const UnitKey trained{3, 0, UnitKind::kTraining, 1};
    {
        const auto store = open_store(directory);
        ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
        ASSERT_TRUE(store->put_job(new_job("b")).get().ok());
        EXPECT_EQ(store->put_job(new_job("a")).get().code(), StatusCode::kAlreadyExists);
        JobUpdate update{.state = JobState::kRunning, .message = "m", .spec = std::string("full\0spec", 9)};
        ASSERT_TRUE(store->update_job("a", update).get().ok());
        ASSERT_TRUE(store->update_job("a", {.scene = "other.pbrt"}).get().ok());
        for (const char* kind : {"training size", "closed", "training size"})
            ASSERT_TRUE(store->append_event("a", kind, std::string("bytes of ").append(kind)).get().ok());
        ASSERT_TRUE(put(*store, "a", render_unit(1, 2), 1000, 7).ok());
        ASSERT_TRUE(put(*store, "a", render_unit(0), 10, 3).ok());
        ASSERT_TRUE(put(*store, "a", trained, 0, 7).ok());
        EXPECT_EQ(store->update_job("c", {}).get().code(), StatusCode::kNotFound);
        EXPECT_EQ(put(*store, "c", render_unit(0), 10).code(), StatusCode::kNotFound);
    }
    const auto store = open_store(directory);
    const auto jobs = *store->load();
    ASSERT_EQ(jobs.size(), 2u);
    const StoredJob& a = jobs[0];
    EXPECT_EQ(a.job.id, "a");
    EXPECT_EQ(a.job.request_id, "request of a");
    EXPECT_EQ(a.job.created_at, "2001-02-03T04:05:06Z");
    EXPECT_EQ(a.job.submitted, new_job("a").submitted);
    EXPECT_EQ(a.job.label, "label");
    EXPECT_EQ(a.job.scene, "other.pbrt");
    EXPECT_EQ(a.job.state, JobState::kRunning);
    EXPECT_EQ(a.message, "m");
    EXPECT_EQ(a.spec, std::string("full\0spec", 9));
    EXPECT_FALSE(a.info);
    ASSERT_EQ(a.events.size(), 3u);
    EXPECT_EQ(a.events[1].kind, "closed");
    EXPECT_EQ(a.events[2].bytes, "bytes of training size");
    ASSERT_EQ(a.workers.size(), 2u);
    EXPECT_EQ(a.workers[1].index, 7u);
    EXPECT_EQ(a.workers[1].who, "worker 7");
    ASSERT_EQ(a.results.size(), 3u);
    EXPECT_EQ(a.results[0].unit, render_unit(0));
    EXPECT_EQ(a.results[1].unit, render_unit(1, 2));
    EXPECT_EQ(a.results[1].worker, 7u);
    EXPECT_EQ(a.results[1].seconds, 1.5);
    EXPECT_EQ(a.results[2].unit, trained);
    expect_payload(*store, a.results[0], 10);
    expect_payload(*store, a.results[1], 1000);
    expect_payload(*store, a.results[2], 0);
    EXPECT_EQ(jobs[1].job.id, "b");
    EXPECT_EQ(jobs[1].job.state, JobState::kPreparing);
    EXPECT_TRUE(jobs[1].results.empty());
}

TEST(JobStore, ARepeatedResultChangesNothing) {
    const TempDirectory directory;
    const auto store = open_store(directory);
    ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
    ASSERT_TRUE(put(*store, "a", render_unit(0), 100, 1).ok());
    const auto size = std::filesystem::file_size(directory.path / "store/segments/000001.log");
    EXPECT_TRUE(put(*store, "a", render_unit(0), 100, 2).ok());
    EXPECT_EQ(put(*store, "a", render_unit(0), 101, 2).code(), StatusCode::kAlreadyExists) << "other bytes";
    EXPECT_EQ(std::filesystem::file_size(directory.path / "store/segments/000001.log"), size);
    EXPECT_EQ(only_job(*store).results.at(0).worker, 1u);

    ASSERT_TRUE(store->drop_result("a", render_unit(0)).get().ok());
    EXPECT_TRUE(store->drop_result("a", render_unit(0)).get().ok()) << "there is none any more";
    EXPECT_TRUE(only_job(*store).results.empty());
    EXPECT_TRUE(put(*store, "a", render_unit(0), 101, 2).ok());
    expect_payload(*store, only_job(*store).results.at(0), 101);
}

TEST(JobStore, ACheckpointTakesThePlaceOfPayloads) {
    const TempDirectory directory;
    std::string state(100000, 's');
    {
        const auto store = open_store(directory, 1000);
        ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
        for (uint32_t group = 0; group < 6; ++group) ASSERT_TRUE(put(*store, "a", render_unit(group), 900).ok());
        EXPECT_EQ(files_in(directory, "segments"), 6u);
        ASSERT_TRUE(store->put_checkpoint("a", 2, "old").ok());
        EXPECT_EQ(files_in(directory, "segments"), 4u);
        ASSERT_TRUE(store->put_checkpoint("a", 4, state).ok());
        EXPECT_EQ(files_in(directory, "segments"), 2u);
        EXPECT_EQ(files_in(directory, "checkpoints"), 1u);
        EXPECT_EQ(store->put_checkpoint("a", 3, "older").code(), StatusCode::kFailedPrecondition);
        EXPECT_EQ(store->put_checkpoint("b", 3, "nobody's").code(), StatusCode::kNotFound);
        EXPECT_EQ(files_in(directory, "checkpoints"), 1u);
    }
    std::ofstream(directory.path / "store/checkpoints/000099.state") << "left by a crash";
    {
        const auto store = open_store(directory, 1000);
        EXPECT_EQ(files_in(directory, "checkpoints"), 1u);
        const StoredJob job = only_job(*store);
        ASSERT_TRUE(job.checkpoint);
        EXPECT_EQ(job.checkpoint->groups, 4u);
        EXPECT_EQ(*store->read_checkpoint(*job.checkpoint), state);
        ASSERT_EQ(job.results.size(), 6u);
        for (const StoredResult& result : job.results) {
            EXPECT_EQ(result.digest, sha256(payload_of(result.unit, 900))) << "it stays known";
            EXPECT_EQ(result.place.has_value(), result.unit.group >= 4);
            if (result.place) expect_payload(*store, result, 900);
        }
        EXPECT_EQ(store->read_payload(job.results[0]).status().code(), StatusCode::kFailedPrecondition);
        EXPECT_TRUE(put(*store, "a", render_unit(0), 900).ok()) << "the same again";

        state[5] = 'x';
        ASSERT_TRUE(write_file_atomically((directory.path / "store/checkpoints" / job.checkpoint->file).string(), state).ok());
        EXPECT_EQ(store->read_checkpoint(*job.checkpoint).status().code(), StatusCode::kDataLoss);
        ASSERT_TRUE(store->drop_results("a").get().ok());
    }
    const auto store = open_store(directory, 1000);
    EXPECT_TRUE(only_job(*store).results.empty());
    EXPECT_FALSE(only_job(*store).checkpoint);
    EXPECT_EQ(files_in(directory, "segments"), 0u);
    EXPECT_EQ(files_in(directory, "checkpoints"), 0u);
}

TEST(JobStore, AJobThatEndedKeepsWhatIsToldOfItAndAForgottenOneNothing) {
    const TempDirectory directory;
    const auto store = open_store(directory);
    for (const char* id : {"a", "b"}) {
        ASSERT_TRUE(store->put_job(new_job(id)).get().ok());
        ASSERT_TRUE(put(*store, id, render_unit(0), 5000).ok());
        ASSERT_TRUE(store->append_event(id, "k", "v").get().ok());
    }
    ASSERT_TRUE(store->end_job("a", JobState::kCancelled, "asked for", "info").get().ok());
    EXPECT_EQ(files_in(directory, "segments"), 1u) << "b's payload lies there, too";
    auto jobs = *store->load();
    EXPECT_EQ(jobs[0].job.state, JobState::kCancelled);
    EXPECT_EQ(jobs[0].message, "asked for");
    EXPECT_EQ(jobs[0].info, "info");
    EXPECT_TRUE(jobs[0].results.empty());
    expect_payload(*store, jobs[1].results.at(0), 5000);
    ASSERT_TRUE(store->forget_job("b").get().ok());
    EXPECT_EQ(files_in(directory, "segments"), 0u);
    EXPECT_EQ(only_job(*store).job.id, "a");
    EXPECT_EQ(store->forget_job("b").get().code(), StatusCode::kNotFound);
    ASSERT_TRUE(store->put_job(new_job("b")).get().ok());
    EXPECT_TRUE((*store->load())[1].events.empty());
    EXPECT_TRUE((*store->load())[1].workers.empty());
}

TEST(JobStore, ThoseWhoWaitTogetherShareATransaction) {
    const TempDirectory directory;
    const auto store = open_store(directory);
    ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
    constexpr uint32_t kThreads = 8, kEach = 50;
    const uint64_t before = store->batches();
    {
        std::vector<std::jthread> threads;
        for (uint32_t t = 0; t < kThreads; ++t)
            threads.emplace_back([&, t] {
                for (uint32_t i = 0; i < kEach; ++i) EXPECT_TRUE(put(*store, "a", render_unit(i, t), 300, t).ok());
            });
    }
    EXPECT_LT(store->batches() - before, kThreads * kEach);
    const StoredJob job = only_job(*store);
    ASSERT_EQ(job.results.size(), kThreads * kEach);
    for (const StoredResult& result : job.results) expect_payload(*store, result, 300);
    // Also one caller can have many under way.
    std::vector<JobStore::Done> events;
    for (int i = 0; i < 1000; ++i) events.push_back(store->append_event("a", "n", std::to_string(i)));
    const uint64_t middle = store->batches();
    for (JobStore::Done& done : events) EXPECT_TRUE(done.get().ok());
    EXPECT_LT(store->batches() - middle, 100u);
    const auto kept = only_job(*store).events;
    ASSERT_EQ(kept.size(), 1000u);
    for (size_t i = 0; i < 1000; ++i) ASSERT_EQ(kept[i].bytes, std::to_string(i)) << "in their order";
}

/// What a small farm does. Writes a byte for each step that was acknowledged.
void live(JobStore& store, int acknowledged) {
    const auto step = [&](const Status& status) {
        if (!status.ok() || ::write(acknowledged, "+", 1) != 1) std::_Exit(3);
    };
    step(store.put_job(new_job("a")).get());
    for (uint32_t group = 0; group < 3; ++group) step(put(store, "a", render_unit(group), 400));
    step(store.put_checkpoint("a", 2, "sums of two groups"));
    step(store.append_event("a", "closed", "3").get());
    step(store.put_job(new_job("b")).get());
    step(put(store, "b", render_unit(0), 700));
    step(store.end_job("a", JobState::kSucceeded, "", "info").get());
}

/// Checks that the first `steps` steps of live() are there, and the next one as a whole or not at all.
void expect_lived(JobStore& store, size_t steps) {
    const auto jobs = *store.load();
    ASSERT_GE(jobs.size(), size_t(steps >= 1) + size_t(steps >= 7));
    if (jobs.empty()) return;
    const StoredJob& a = jobs[0];
    EXPECT_EQ(a.job.submitted, new_job("a").submitted);
    if (steps >= 6) {
        EXPECT_EQ(a.events.size(), 1u);
    }
    if (steps >= 8) {
        expect_payload(store, jobs[1].results.at(0), 700);
    }
    if (a.job.state == JobState::kSucceeded) {
        EXPECT_GE(steps, 8u);
        EXPECT_TRUE(a.results.empty());
        return;
    }
    EXPECT_LT(steps, 9u);
    EXPECT_GE(a.results.size(), std::min<size_t>(steps, 4) - std::min<size_t>(steps, 1));
    if (steps >= 5) {
        EXPECT_TRUE(a.checkpoint);
    }
    if (a.checkpoint) {
        EXPECT_EQ(*store.read_checkpoint(*a.checkpoint), "sums of two groups");
    }
    for (const StoredResult& result : a.results) {
        EXPECT_EQ(result.place.has_value(), !a.checkpoint || result.unit.group >= 2);
        if (result.place) expect_payload(store, result, 400);
    }
}

TEST(JobStore, NothingThatWasAcknowledgedIsLostByADeathAnywhere) {
    int deaths = 0;
    for (const char* label : {"server.segment-created", "server.payloads-written", "server.payloads-synced",
                              "server.batch-committed", "server.checkpoint-saved", "file.before-rename", "file.after-rename"}) {
        for (int pass = 1;; ++pass) {
            const TempDirectory directory;
            int pipe_ends[2];
            ASSERT_EQ(::pipe(pipe_ends), 0);
            const pid_t child = ::fork();
            if (child == 0) {
                if (::freopen("/dev/null", "w", stderr) == nullptr) std::_Exit(5);
                if (!arm_crash_point(std::string(label).append(":").append(std::to_string(pass))).ok()) std::_Exit(2);
                const auto store = open_store(directory, 1000);
                live(*store, pipe_ends[1]);
                std::_Exit(0);
            }
            ::close(pipe_ends[1]);
            std::string acknowledged;
            char byte;
            while (::read(pipe_ends[0], &byte, 1) == 1) acknowledged.push_back(byte);
            ::close(pipe_ends[0]);
            int status = 0;
            ASSERT_EQ(::waitpid(child, &status, 0), child);
            const bool killed = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
            ASSERT_TRUE(killed || (WIFEXITED(status) && WEXITSTATUS(status) == 0)) << label << " " << pass << ": " << status;
            deaths += killed;
            SCOPED_TRACE(std::string(label).append(" ").append(std::to_string(pass)));
            const auto store = open_store(directory, 1000);
            expect_lived(*store, acknowledged.size());
            EXPECT_TRUE(store->put_job(new_job("after")).get().ok());
            if (!killed) {
                EXPECT_EQ(acknowledged.size(), 9u);
                EXPECT_GT(pass, 1) << "the label is passed nowhere";
                break;
            }
        }
    }
    EXPECT_GT(deaths, 25);
}

TEST(JobStore, EveryWriteToASegmentMayFindNoRoom) {
    for (int k = 1; k <= 12; ++k) {
        const TempDirectory directory;
        FailingFiles files;
        files.failing_write = k;
        int failures = 0;
        {
            const auto store = open_store(directory, 1000, files);
            ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
            for (uint32_t group = 0; group < 10; ++group) {
                Status status = put(*store, "a", render_unit(group), 300);
                if (!status.ok()) {
                    EXPECT_EQ(status.code(), StatusCode::kResourceExhausted);
                    EXPECT_EQ(only_job(*store).results.size(), group);
                    ++failures;
                    status = put(*store, "a", render_unit(group), 300);
                }
                EXPECT_TRUE(status.ok()) << status.message();
            }
        }
        EXPECT_EQ(failures, k <= 10 ? 1 : 0);
        const auto store = open_store(directory, 1000);
        const auto results = only_job(*store).results;
        ASSERT_EQ(results.size(), 10u);
        for (const StoredResult& result : results) expect_payload(*store, result, 300);
    }
}

/// A limit of the size of files stands for a full disk, also for the database's own files.
TEST(JobStoreDeathTest, ItGoesOnWhenThereIsRoomAgain) {
    const auto trial = [](rlim_t limit) {
        ::signal(SIGXFSZ, SIG_IGN);
        const TempDirectory directory;
        uint32_t kept = 0;
        const auto limit_to = [](rlim_t bytes) {
            const rlimit files{bytes, RLIM_INFINITY};
            if (::setrlimit(RLIMIT_FSIZE, &files) != 0) std::_Exit(4);
        };
        {
            const auto store = open_store(directory, 1 << 20);
            if (!store->put_job(new_job("a")).get().ok()) std::_Exit(5);
            limit_to(limit);
            Status full;
            while (full.ok() && kept < 5000) {
                full = put(*store, "a", render_unit(kept), 100);
                kept += full.ok();
            }
            if (full.code() != StatusCode::kResourceExhausted) {
                std::fprintf(stderr, "%s\n", full.message().c_str());
                std::_Exit(6);
            }
            if (store->append_event("a", "k", std::string(200000, 'e')).get().ok()) std::_Exit(7);
            if (store->load()->at(0).results.size() != kept) std::_Exit(8);
            limit_to(RLIM_INFINITY);
            for (uint32_t i = 0; i < 10; ++i)
                if (!put(*store, "a", render_unit(kept + i), 100).ok()) std::_Exit(9);
        }
        const auto store = open_store(directory, 1 << 20);
        const auto results = store->load()->at(0).results;
        for (const StoredResult& result : results)
            if (!store->read_payload(result).ok()) std::_Exit(10);
        std::_Exit(results.size() == kept + 10 ? 0 : 11);
    };
    for (const rlim_t limit : {45000, 70001, 100000, 150000, 200000})
        EXPECT_EXIT(trial(limit), ::testing::ExitedWithCode(0), "") << limit;
}

TEST(JobStore, OneWithoutRoomDoesNotKeepTheOthersOut) {
    const TempDirectory directory;
    FailingFiles files;
    const auto store = open_store(directory, 1000, files);
    ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
    files.full = true;
    std::vector<JobStore::Done> events;
    std::jthread other([&] { EXPECT_EQ(put(*store, "a", render_unit(0), 100).code(), StatusCode::kResourceExhausted); });
    for (int i = 0; i < 300; ++i) events.push_back(store->append_event("a", "n", "v"));
    for (JobStore::Done& done : events) EXPECT_TRUE(done.get().ok());
    other.join();
    EXPECT_EQ(only_job(*store).events.size(), 300u);
}

TEST(JobStore, AFlushThatFailsIsTheEnd) {
    const TempDirectory directory;
    FailingFiles files;
    std::string told;
    {
        auto store = *JobStore::open({.directory = directory.path / "store",
                                      .flush_failed = [&](const Status& why) { told = why.message(); },
                                      .files = &files});
        ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
        ASSERT_TRUE(put(*store, "a", render_unit(0), 100).ok());
        files.failing_sync = files.syncs + 1;
        EXPECT_FALSE(put(*store, "a", render_unit(1), 100).ok());
        EXPECT_NE(told.find("000001.log: cannot be flushed to disk"), std::string::npos) << told;
        EXPECT_FALSE(store->append_event("a", "k", "v").get().ok());
    }
    const auto store = open_store(directory);
    EXPECT_EQ(only_job(*store).results.size(), 1u);
    const auto end = [&] {
        FailingFiles broken;
        const TempDirectory elsewhere;
        const auto dying = open_store(elsewhere, SegmentLog::kSegmentBytes, broken);
        (void)dying->put_job(new_job("a")).get();
        broken.failing_sync = 1;
        (void)put(*dying, "a", render_unit(0), 100);
        std::_Exit(0);
    };
    EXPECT_EXIT(end(), ::testing::ExitedWithCode(EXIT_FAILURE), "");
}

TEST(JobStore, DamageIsNoticedAndToldApart) {
    const TempDirectory directory;
    {
        const auto store = open_store(directory);
        ASSERT_TRUE(store->put_job(new_job("a")).get().ok());
        for (uint32_t group = 0; group < 3; ++group) ASSERT_TRUE(put(*store, "a", render_unit(group), 100).ok());
    }
    const std::string segment = (directory.path / "store/segments/000001.log").string();
    std::string bytes = *read_file(segment);
    bytes[bytes.size() / 2] ^= 1;
    ASSERT_TRUE(write_file_atomically(segment, bytes).ok());
    {
        const auto store = open_store(directory);
        const auto results = only_job(*store).results;
        ASSERT_EQ(results.size(), 3u);
        EXPECT_EQ(store->read_payload(results[1]).status().code(), StatusCode::kDataLoss);
        for (const size_t other : {0, 2}) expect_payload(*store, results[other], 100);
        ASSERT_TRUE(store->drop_result("a", results[1].unit).get().ok());
        ASSERT_TRUE(put(*store, "a", results[1].unit, 100).ok());
        for (const StoredResult& result : only_job(*store).results) expect_payload(*store, result, 100);
    }
    std::filesystem::rename(directory.path / "store/jobs.db", directory.path / "elsewhere");
    const auto gone = JobStore::open({.directory = directory.path / "store"});
    EXPECT_EQ(gone.status().code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(gone.status().message().find("which says whose, is gone"), std::string::npos);
    std::filesystem::rename(directory.path / "elsewhere", directory.path / "store/jobs.db");
    EXPECT_EQ(only_job(*open_store(directory)).results.size(), 3u);
}

}  // namespace
}  // namespace lightloom
