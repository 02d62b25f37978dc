// Jobs that end before all that was asked for: nothing that was rendered is lost.

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/core/atomic_file.h"
#include "common/film/exr_io.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::FakeService;
using Json = nlohmann::json;

struct EarlyService : FakeService {
    explicit EarlyService(bool keeps = true) {
        durable = keeps;
        if (keeps) restart();
    }
    /// Delivers up to `count` units.
    void work(int count) {
        const std::string worker = add_worker();
        for (int i = 0; i < count; ++i) {
            const auto leases = lease(worker);
            if (leases.empty()) break;
            EXPECT_EQ(deliver(worker, leases[0]).outcome, SubmitOutcome::kAccepted);
        }
        EXPECT_TRUE(coordinator->goodbye(worker).ok());
    }
    std::string started(uint32_t samples, int units) {
        const std::string id = submit(spec(samples));
        work(units);
        return id;
    }
    void fail(const std::string& id) {
        const std::string worker = add_worker();
        const auto leases = lease(worker);
        ASSERT_EQ(leases.size(), 1u);
        ASSERT_EQ(leases[0].job_id, id);
        ASSERT_TRUE(coordinator->release_unit(worker, leases[0].reference(), invalid_argument("it is wrong")).ok());
        EXPECT_EQ(wait_end(id).state, JobState::kFailed);
    }
    std::string partial(const std::string& id) {
        auto image = coordinator->image(id, ImageKind::kPartial);
        EXPECT_TRUE(image.ok()) << image.status().message();
        return image.ok() ? *image : std::string();
    }
    std::filesystem::path file(const std::string& id, const char* name) const { return directory.path / "jobs" / id / name; }
};

uint64_t samples_of(const std::string& exr) {
    const auto image = decode_exr(exr, "the image");
    EXPECT_TRUE(image.ok()) << image.status().message();
    return image.ok() ? std::stoull(image->attribute(exr_attribute::kSamples)) : 0;
}

/// The image of a job that asks for so many samples.
std::string image_of(uint32_t samples) {
    EarlyService service(false);
    const std::string id = service.started(samples, 100000);
    EXPECT_EQ(service.wait_end(id).state, JobState::kSucceeded);
    return *service.coordinator->image(id, ImageKind::kFinal);
}

TEST(Finish, AJobEndsWithItsNextGroupAndTheBytesOfAsManySamples) {
    EarlyService service;
    const std::string id = service.started(60, 7);
    const JobInfo told = *service.coordinator->finish_job(id);
    EXPECT_EQ(told.state, JobState::kRunning) << "the group that is begun is completed";
    EXPECT_EQ(told.samples_per_pixel_done, 7u);
    EXPECT_EQ(service.coordinator->finish_job(id)->state, JobState::kRunning) << "it may be said twice";
    service.work(100);
    const JobInfo info = service.wait_end(id);
    EXPECT_EQ(info.state, JobState::kSucceeded) << info.message;
    EXPECT_EQ(info.samples_per_pixel_done, 8u);
    EXPECT_EQ(*service.coordinator->image(id, ImageKind::kFinal), image_of(8));
    const Json manifest = Json::parse(*service.coordinator->manifest(id));
    EXPECT_EQ(manifest["image"]["samples_per_pixel"], 8);
    EXPECT_EQ(manifest["spec"]["requested_samples_per_pixel"], 60);
    EXPECT_FALSE(manifest.contains("partial"));
    EXPECT_TRUE(service.coordinator->finish_job(id).ok()) << "whose answer was lost may ask again";
}

TEST(Finish, AJobWithoutACompleteGroupRendersOne) {
    EarlyService service;
    const std::string id = service.submit(service.spec(60));
    ASSERT_TRUE(service.coordinator->finish_job(id).ok());
    service.work(100);
    EXPECT_EQ(service.wait_end(id).samples_per_pixel_done, 1u);
    EXPECT_EQ(*service.coordinator->image(id, ImageKind::kFinal), image_of(1));
}

TEST(Finish, ADecisionOutlivesTheCoordinator) {
    EarlyService service;
    const std::string id = service.started(60, 7);
    ASSERT_TRUE(service.coordinator->finish_job(id).ok());
    service.restart();
    service.wait(id, [](const JobInfo& job) { return job.state != JobState::kPreparing; });
    service.work(100);
    EXPECT_EQ(service.wait_end(id).samples_per_pixel_done, 8u);
    EXPECT_EQ(*service.coordinator->image(id, ImageKind::kFinal), image_of(8));
}

TEST(Finish, AJobThatDoesNotRenderSaysSo) {
    EarlyService service;
    EXPECT_EQ(service.coordinator->finish_job("job-of-old").status().code(), StatusCode::kNotFound);
    const std::string cancelled = service.submit(service.spec(5));
    ASSERT_TRUE(service.coordinator->cancel_job(cancelled).ok());
    const Status over = service.coordinator->finish_job(cancelled).status();
    EXPECT_EQ(over.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(over.message().find(cancelled + " is cancelled"), std::string::npos) << over.message();

    std::atomic<bool> read{false};
    FakeService slow({40, 30, {0, 0, 40, 30}}, std::nullopt, [&](CoordinatorOptions& options) {
        options.read_scene = [&read](const AssetStore&, const JobSpec&, std::stop_token) {
            while (!read) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            return Result<SceneFacts>(SceneFacts{{40, 30, {0, 0, 40, 30}}, {}, 5});
        };
    });
    const auto preparing = slow.coordinator->submit_job("request", slow.spec(5));
    const Status early = slow.coordinator->finish_job(preparing->job_id).status();
    EXPECT_EQ(early.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(early.message().find("is preparing"), std::string::npos) << early.message();
    EXPECT_EQ(slow.coordinator->image(preparing->job_id, ImageKind::kPartial).status().code(), StatusCode::kFailedPrecondition);
    read = true;
}

TEST(Partial, AJobThatRendersGivesItsCompleteGroups) {
    EarlyService service;
    const std::string id = service.submit(service.spec(60));
    const Status none = service.coordinator->image(id, ImageKind::kPartial).status();
    EXPECT_EQ(none.code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(none.message().find(id), std::string::npos) << none.message();
    service.work(9);
    EXPECT_EQ(service.partial(id), image_of(9));
    EXPECT_EQ(service.coordinator->manifest(id, ManifestKind::kPartial).status().code(), StatusCode::kFailedPrecondition);
    service.work(1000);
    EXPECT_EQ(service.wait_end(id).state, JobState::kSucceeded);
    EXPECT_EQ(service.partial(id), image_of(60)) << "in the end that is the image";
}

TEST(Partial, ACancelledJobKeepsItsGroupsIfItIsToldSo) {
    EarlyService service;
    const std::string id = service.started(60, 9);
    const JobInfo info = *service.coordinator->cancel_job(id, OnCancel::kKeep);
    EXPECT_EQ(info.state, JobState::kCancelled);
    EXPECT_NE(info.message.find("are kept"), std::string::npos) << info.message;
    EXPECT_EQ(service.partial(id), image_of(9)) << "at once";
    const Json manifest = Json::parse(*service.coordinator->manifest(id, ManifestKind::kPartial));
    EXPECT_EQ(manifest["image"]["samples_per_pixel"], 9);
    EXPECT_EQ(manifest["image"]["sha256"], sha256(image_of(9)).hex());
    EXPECT_EQ(manifest["partial"]["state"], "cancelled");
    EXPECT_EQ(manifest["work"]["units"], 9);
    EXPECT_EQ(*read_file(service.file(id, "partial.exr").string()), image_of(9));
    for (int restart = 0; restart < 2; ++restart) {
        EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kCancelled);
        EXPECT_EQ(service.coordinator->get_job(id)->image_digest, sha256(image_of(9)));
        EXPECT_EQ(service.partial(id), image_of(9));
        EXPECT_TRUE(service.coordinator->manifest(id, ManifestKind::kPartial).ok());
        const auto preview = service.coordinator->preview(id, PreviewFormat::kPng);
        ASSERT_TRUE(preview.ok()) << preview.status().message();
        EXPECT_EQ(preview->samples_per_pixel, 9u);
        EXPECT_EQ(service.coordinator->image(id, ImageKind::kFinal).status().code(), StatusCode::kFailedPrecondition);
        service.restart();
    }
    EXPECT_TRUE(service.lease(service.add_worker()).empty());
}

TEST(Partial, ACancelledJobThrowsAwayAndSaysHowMuch) {
    EarlyService service;
    const std::string id = service.started(60, 9);
    const JobInfo info = *service.coordinator->cancel_job(id);
    EXPECT_EQ(info.message, "its 9 sample(s) per pixel were thrown away");
    EXPECT_EQ(service.coordinator->image(id, ImageKind::kPartial).status().code(), StatusCode::kFailedPrecondition);
    EXPECT_FALSE(std::filesystem::exists(service.file(id, "partial.exr")));
    EXPECT_EQ(service.coordinator->cancel_job(id, OnCancel::kKeep)->message, info.message) << "it is too late";
    const std::string nothing = service.submit(service.spec(5));
    EXPECT_EQ(service.coordinator->cancel_job(nothing, OnCancel::kKeep)->message, "") << "there is nothing to keep";
    service.restart();
    EXPECT_EQ(service.coordinator->get_job(nothing)->state, JobState::kCancelled);
}

TEST(Partial, AFailedJobKeepsItsGroups) {
    EarlyService service;
    const std::string id = service.started(60, 9);
    service.fail(id);
    EXPECT_TRUE(service.coordinator->manifest(id, ManifestKind::kPartial).ok());  // waits until they are written
    const std::string message = service.coordinator->get_job(id)->message;
    EXPECT_EQ(service.coordinator->get_job(id)->samples_per_pixel_done, 9u);
    service.restart();
    EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kFailed);
    EXPECT_EQ(service.coordinator->get_job(id)->message, message);
    EXPECT_EQ(service.partial(id), image_of(9));
}

/// As after a SIGKILL between the decision and its being carried out.
TEST(Partial, ACancellationThatIsOnDiskIsCarriedOutByTheNextCoordinator) {
    EarlyService service;
    const std::string rendering = service.started(60, 9), begun = service.submit(service.spec(70));
    service.coordinator.reset();
    {
        auto store = JobStore::open({.directory = service.directory.file("store")});
        ASSERT_TRUE(store.ok());
        Archive archive(*std::move(store));
        ASSERT_TRUE(archive.cancel_and_keep(rendering).ok());
        ASSERT_TRUE(archive.cancel_and_keep(begun).ok());
    }
    service.start();
    EXPECT_EQ(service.wait_end(rendering).state, JobState::kCancelled);
    EXPECT_EQ(service.wait_end(begun).state, JobState::kCancelled);
    EXPECT_NE(service.wait_end(rendering).message, "");
    EXPECT_EQ(service.wait_end(begun).message, "") << "there are no groups that it could have kept";
    EXPECT_EQ(service.partial(rendering), image_of(9));
    EXPECT_EQ(service.coordinator->image(begun, ImageKind::kPartial).status().code(), StatusCode::kFailedPrecondition);
}

/// A directory in the file's place stands for a disk that cannot be written to.
TEST(Partial, GroupsThatCannotBeWrittenAreReportedAndTheJobEnds) {
    EarlyService service;
    const std::string id = service.started(60, 9);
    std::filesystem::create_directories(service.file(id, "partial.exr") / "in the way");
    ASSERT_TRUE(service.coordinator->cancel_job(id, OnCancel::kKeep).ok());
    EXPECT_FALSE(service.coordinator->manifest(id, ManifestKind::kPartial).ok());
    EXPECT_FALSE(service.coordinator->image(id, ImageKind::kPartial).ok());
    EXPECT_EQ(service.coordinator->get_job(id)->image_size_bytes, 0u);
    service.restart();
    EXPECT_EQ(service.coordinator->get_job(id)->state, JobState::kCancelled);
}

TEST(Pause, AFullDiskIsTheMessageOfEveryJobThatWaitsForIt) {
    FakeService service({40, 30, {0, 0, 40, 30}}, std::nullopt,
                        [](CoordinatorOptions& options) { options.disk_reserve_bytes = std::numeric_limits<uint64_t>::max(); });
    service.durable = true;
    service.restart();
    const auto job = service.coordinator->submit_job("request", service.spec(4));
    ASSERT_TRUE(job.ok());
    const JobInfo info = service.wait(job->job_id, [](const JobInfo& j) { return j.message.starts_with("paused: "); });
    EXPECT_NE(info.message.find(service.directory.path.string() + " has "), std::string::npos) << info.message;
    EXPECT_FALSE(is_terminal(info.state));
    EXPECT_GT(info.revision, job->revision) << "who watches the job sees it";
    EXPECT_TRUE(service.lease(service.add_worker()).empty());
}

TEST(Partial, SamplesOfAPartialAreInItsHeader) {
    EarlyService service;
    EXPECT_EQ(samples_of(service.partial(service.started(60, 12))), 12u);
}

}  // namespace
}  // namespace lightloom
