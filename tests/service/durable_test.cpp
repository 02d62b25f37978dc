// A coordinator that forgets nothing: what was acknowledged is there after a restart, and jobs go on to the same bytes.

#include <gtest/gtest.h>

#include "common/core/atomic_file.h"
#include "tests/service/table_service.h"

namespace lightloom {
namespace {

using testing::FakeService;

const FrameLayout kFrame{40, 30, {0, 0, 40, 30}};

struct DurableService : FakeService {
    explicit DurableService(FrameLayout frame = kFrame) : FakeService(frame) {
        durable = true;
        restart();
    }
    /// Delivers up to `count` units; returns how many there were.
    int work(const std::string& worker, int count) {
        int done = 0;
        for (; done < count; ++done) {
            const auto leases = lease(worker);
            if (leases.empty()) break;
            EXPECT_EQ(deliver(worker, leases[0]).outcome, SubmitOutcome::kAccepted);
        }
        return done;
    }
    Digest finish(const std::string& id) {
        const std::string worker = add_worker();
        for (int i = 0; i < 1000 && !is_terminal(coordinator->get_job(id)->state); ++i) {
            work(worker, 1000);
            std::this_thread::sleep_for(std::chrono::milliseconds(2));
        }
        const JobInfo info = wait_end(id);
        EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
        return info.image_digest;
    }
};

Digest undisturbed(uint32_t samples, FrameLayout frame = kFrame) {
    FakeService service(frame);
    const std::string id = service.submit(service.spec(samples));
    const std::string worker = service.add_worker();
    for (auto leases = service.lease(worker); !leases.empty(); leases = service.lease(worker)) service.deliver(worker, leases[0]);
    return service.wait_end(id).image_digest;
}

TEST(Durable, AJobGoesOnAfterEveryRestartToTheSameBytes) {
    DurableService service;
    const std::string id = service.submit(service.spec(60));
    uint64_t done = 0;
    for (int restart = 0; restart < 5; ++restart) {
        done += uint64_t(service.work(service.add_worker(), 3));
        service.restart();
        const JobInfo info = service.wait_running(id);
        EXPECT_EQ(info.state, JobState::kRunning);
        EXPECT_EQ(info.unit_done, done) << "no acknowledged unit is asked for again";
        EXPECT_EQ(info.worker_count, restart + 1u);
    }
    EXPECT_EQ(service.finish(id), undisturbed(60));
    const std::string manifest = *service.coordinator->manifest(id);
    EXPECT_NE(manifest.find("worker-1-host-1"), std::string::npos) << "workers of earlier coordinators are named";
}

TEST(Durable, ALateResultOfAnUnfinishedUnitCountsAndARepeatedOneIsRecognised) {
    DurableService service;
    const std::string id = service.submit(service.spec(40));
    const std::string worker = service.add_worker();
    const auto first = service.lease(worker), second = service.lease(worker);
    service.deliver(worker, first[0]);
    service.restart();
    service.wait_running(id);
    const auto nobody = service.coordinator->submit_payload(worker, second[0].reference(), {}, {});
    EXPECT_FALSE(nobody.ok() && nobody->outcome == SubmitOutcome::kAccepted) << "the worker has to register again";
    const std::string again = service.add_worker();
    EXPECT_EQ(service.deliver(again, second[0]).outcome, SubmitOutcome::kAccepted);
    EXPECT_EQ(service.deliver(again, first[0]).outcome, SubmitOutcome::kDuplicateSame);
    EXPECT_EQ(service.finish(id), undisturbed(40));
}

TEST(Durable, FinishedImagesAreServedAfterARestart) {
    DurableService service;
    const std::string id = service.submit(service.spec(10));
    const Digest digest = service.finish(id);
    const std::string image = *service.coordinator->image(id, ImageKind::kFinal);
    const JobInfo before = *service.coordinator->get_job(id);
    service.restart();
    const JobInfo after = *service.coordinator->get_job(id);
    EXPECT_EQ(after.state, JobState::kSucceeded);
    EXPECT_EQ(after.image_digest, digest);
    EXPECT_EQ(after.unit_total, before.unit_total);
    EXPECT_EQ(after.label.name, before.label.name);
    EXPECT_EQ(*service.coordinator->image(id, ImageKind::kFinal), image);
    EXPECT_TRUE(service.coordinator->manifest(id).ok());
    EXPECT_TRUE(service.coordinator->preview(id, PreviewFormat::kPng).ok());
}

TEST(Durable, ARequestWhoseAnswerWasLostIsOneJob) {
    DurableService service;
    const auto first = service.coordinator->submit_job("the request", service.spec(5));
    ASSERT_TRUE(first.ok());
    service.restart();
    const auto again = service.coordinator->submit_job("the request", service.spec(5));
    ASSERT_TRUE(again.ok()) << again.status().message();
    EXPECT_EQ(again->job_id, first->job_id);
    EXPECT_EQ(service.coordinator->submit_job("the request", service.spec(6)).status().code(), StatusCode::kAlreadyExists);
    EXPECT_EQ(service.coordinator->list_jobs().size(), 1u);
}

TEST(Durable, CancelledAndFailedJobsStayWhatTheyAre) {
    DurableService service;
    const std::string cancelled = service.submit(service.spec(5)), failed = service.submit(service.spec(6));
    ASSERT_TRUE(service.coordinator->cancel_job(cancelled).ok());
    const std::string worker = service.add_worker();
    const auto leases = service.lease(worker);
    ASSERT_EQ(leases.size(), 1u);
    ASSERT_TRUE(service.coordinator->release_unit(worker, leases[0].reference(), invalid_argument("it is wrong")).ok());
    const std::string message = service.wait_end(failed).message;
    service.restart();
    EXPECT_EQ(service.coordinator->get_job(cancelled)->state, JobState::kCancelled);
    EXPECT_EQ(service.coordinator->get_job(failed)->state, JobState::kFailed);
    EXPECT_EQ(service.coordinator->get_job(failed)->message, message);
    EXPECT_TRUE(service.lease(service.add_worker()).empty());
}

TEST(Durable, QueuedJobsKeepTheirOrder) {
    DurableService service;
    std::vector<std::string> ids;
    for (uint32_t i = 1; i <= 5; ++i) ids.push_back(service.submit(service.spec(i)));
    service.restart();
    const auto jobs = service.coordinator->list_jobs();
    ASSERT_EQ(jobs.size(), ids.size());
    for (size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(jobs[i].job_id, ids[i]);
    for (const std::string& id : ids) service.wait_running(id);
    EXPECT_EQ(service.lease(service.add_worker())[0].job_id, ids[0]);
}

TEST(Durable, RevisionsGrowOverARestart) {
    DurableService service;
    const std::string id = service.submit(service.spec(5));
    service.restart();
    const JobInfo second = service.wait_running(id);
    service.restart();
    EXPECT_GT(service.wait_running(id).revision, second.revision) << "who watches the job must see that it changed";
}

TEST(Durable, WhatAnotherBuildRenderedIsRenderedAgain) {
    DurableService service;
    const std::string id = service.submit(service.spec(20));
    service.work(service.add_worker(), 4);
    service.options.identity.build_id = "another build";
    service.identity = service.options.identity;
    service.restart();
    EXPECT_EQ(service.wait_running(id).unit_done, 0u);
    EXPECT_EQ(service.finish(id), undisturbed(20));
}

TEST(Durable, TheTimeThatWasTakenStaysTaken) {
    DurableService service;
    JobSpec spec = service.spec(0);
    spec.time_limit_seconds = 100;
    const std::string id = service.submit(spec);
    const std::string worker = service.add_worker();
    auto leases = service.lease(worker);
    ASSERT_TRUE(service.coordinator->heartbeat(worker, {{leases[0].reference(), true}}).ok());
    service.now_ms += 60000;
    EXPECT_EQ(service.deliver(worker, leases[0]).outcome, SubmitOutcome::kAccepted);
    service.restart();
    service.wait_running(id);
    const std::string next = service.add_worker();
    leases = service.lease(next);
    ASSERT_TRUE(service.coordinator->heartbeat(next, {{leases[0].reference(), true}}).ok());
    EXPECT_NEAR(service.coordinator->get_job(id)->render_seconds, 60, 1);
    service.now_ms += 41000;
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_EQ(info.samples_per_pixel_done, 1u);
}

/// A frame of 1.5 10^5 pixels makes payloads of which a few are due for a checkpoint.
const FrameLayout kLarge{500, 300, {0, 0, 500, 300}};

TEST(Durable, ACheckpointTakesThePlaceOfResults) {
    const auto render = [&](bool durable) {
        FakeService service(kLarge);
        service.durable = durable;
        if (durable) service.restart();
        const std::string id = service.submit(service.spec(60));
        for (int i = 0; !is_terminal(service.coordinator->get_job(id)->state); ++i) {
            const std::string worker = service.add_worker();
            for (auto leases = service.lease(worker); !leases.empty(); leases = service.lease(worker)) {
                service.deliver(worker, leases[0]);
                if (durable && ++i % 17 == 0) break;
            }
            if (durable && !is_terminal(service.coordinator->get_job(id)->state)) {
                service.restart();
                service.wait_running(id);
            } else {
                service.wait_end(id);
            }
        }
        if (durable) {
            uint64_t bytes = 0;
            for (const auto& item : std::filesystem::recursive_directory_iterator(service.directory.file("store")))
                if (item.is_regular_file()) bytes += item.file_size();
            EXPECT_LT(bytes, uint64_t(64) << 20) << "payloads of a job that has ended are gone";
        }
        return service.wait_end(id).image_digest;
    };
    EXPECT_EQ(render(true), render(false));
}

/// A directory in the file's place stands for a device that does not answer.
TEST(Durable, ACheckpointThatCannotBeReadForAMomentIsReadByTheNextCoordinator) {
    DurableService service(kLarge);
    const std::string id = service.submit(service.spec(60)), worker = service.add_worker();
    const std::filesystem::path folder = service.directory.path / "store/checkpoints", aside = service.directory.path / "aside";
    while (std::filesystem::is_empty(folder)) ASSERT_EQ(service.work(worker, 1), 1) << "the job wrote no checkpoint";
    const uint64_t done = service.coordinator->get_job(id)->unit_done;
    service.coordinator.reset();
    const std::filesystem::path checkpoint = std::filesystem::directory_iterator(folder)->path();
    std::filesystem::rename(checkpoint, aside);
    std::filesystem::create_directory(checkpoint);
    service.start();
    EXPECT_EQ(service.wait_end(id).state, JobState::kFailed);
    EXPECT_NE(service.wait_end(id).message.find(checkpoint.string()), std::string::npos) << service.wait_end(id).message;
    service.coordinator.reset();
    std::filesystem::remove(checkpoint);
    std::filesystem::rename(aside, checkpoint);
    service.start();
    EXPECT_EQ(service.wait_running(id).unit_done, done) << "nothing that was acknowledged is lost";
    EXPECT_EQ(service.finish(id), undisturbed(60, kLarge));
}

/// Of three training units two came before the restart: one is traced, and the tables are those of a single machine.
TEST(Durable, TrainingDataCountAsResults) {
    testing::TableService service;
    service.durable = true;
    service.restart();
    const std::string id = service.submit_training(service.table_spec());
    const auto held = testing::lease_all(service);
    ASSERT_EQ(held.size(), 3u);
    for (size_t i = 0; i < 2; ++i)
        EXPECT_EQ(service.give(held[i].first, held[i].second, testing::traced(held[i].second)).outcome, SubmitOutcome::kAccepted);
    service.restart();
    service.wait(id, [](const JobInfo& job) { return job.phase == PreparePhase::kTracing && job.phase_done > 0; });
    for (int i = 0; i < 1000 && service.coordinator->get_job(id)->phase_done < 2 * testing::kSamples / 3; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    const auto rest = testing::lease_all(service);
    ASSERT_EQ(rest.size(), 1u) << "what was acknowledged is not asked for again";
    EXPECT_EQ(rest[0].second.unit.key, held[2].second.unit.key);
    service.give(rest[0].first, rest[0].second, testing::traced(rest[0].second));
    const JobInfo info = service.wait_running(id);
    EXPECT_EQ(info.state, JobState::kRunning) << info.message;
    EXPECT_EQ(info.tables.asset.digest, testing::tables_alone(info.spec));
    service.restart();
    EXPECT_EQ(service.wait_running(id).tables.asset.digest, info.tables.asset.digest);
    EXPECT_TRUE(service.coordinator->assets().read(info.tables.asset.digest).ok()) << "tables of a job that goes on stay";
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
    EXPECT_FALSE(service.coordinator->assets().contains(info.tables.asset.digest));
}

TEST(Durable, ATrainingUnitThatTurnsOutToBeWrongIsTracedAgain) {
    testing::TableService service;
    service.durable = true;
    service.restart();
    const std::string id = service.submit_training(service.table_spec());
    const auto held = testing::lease_all(service);
    ASSERT_EQ(held.size(), 3u);
    TrainingData data = *parse_training_data(testing::traced(held[0].second));
    data.paths[0].emitter = 1000000;  // shows once the scene is built, when the data are on disk already
    EXPECT_EQ(service.give(held[0].first, held[0].second, serialize(data)).outcome, SubmitOutcome::kAccepted);
    for (size_t i = 1; i < 3; ++i)
        EXPECT_EQ(service.give(held[i].first, held[i].second, testing::traced(held[i].second)).outcome, SubmitOutcome::kAccepted);
    std::vector<UnitLease> again;
    for (int i = 0; i < 1000 && again.empty(); ++i) {
        again = service.lease(service.add_worker());
        if (again.empty()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(service.give(held[1].first, again[0], testing::traced(again[0])).outcome, SubmitOutcome::kAccepted)
        << "the store must not hold the wrong data any more";
    EXPECT_EQ(service.wait_running(id).state, JobState::kRunning);
}

}  // namespace
}  // namespace lightloom
