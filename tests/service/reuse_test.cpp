// A job that was rendered before, or is under way, is not rendered twice.

#include <gtest/gtest.h>

#include <filesystem>

#include "server/admission.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::FakeService;

struct ReuseService : FakeService {
    explicit ReuseService(const std::function<void(CoordinatorOptions&)>& change = {})
        : FakeService({40, 30, {0, 0, 40, 30}}, std::nullopt, change) {
        durable = true;
        restart();
    }
    JobInfo ask(const JobSpec& s, Reuse reuse = Reuse::kAllowed) {
        const auto job = coordinator->submit_job("ask-" + std::to_string(++requests), s, {}, reuse);
        EXPECT_TRUE(job.ok()) << job.status().message();
        return job.ok() ? *job : JobInfo();
    }
    JobInfo render(const JobSpec& s, Reuse reuse = Reuse::kAllowed) {
        const JobInfo job = ask(s, reuse);
        EXPECT_FALSE(job.reused);
        wait(job.job_id, [](const JobInfo& j) { return j.state != JobState::kPreparing; });
        const std::string worker = add_worker();
        for (auto leases = lease(worker); !leases.empty(); leases = lease(worker)) deliver(worker, leases[0]);
        const JobInfo ended = wait_end(job.job_id);
        EXPECT_EQ(ended.state, JobState::kSucceeded) << ended.message;
        return ended;
    }
    std::filesystem::path image(const JobInfo& job) const { return directory.path / "jobs" / job.job_id / "image.exr"; }
};

TEST(Reuse, ARenderedJobIsTheAnswerUntilItIsAskedForAnew) {
    ReuseService service;
    const JobInfo first = service.render(service.spec(10));
    const JobInfo again = service.ask(service.spec(10));
    EXPECT_EQ(again.job_id, first.job_id);
    EXPECT_TRUE(again.reused);
    EXPECT_EQ(again.state, JobState::kSucceeded);
    EXPECT_FALSE(service.coordinator->get_job(first.job_id)->reused) << "it is a matter of the submission";
    service.restart();
    EXPECT_EQ(service.ask(service.spec(10)).job_id, first.job_id);
    const JobInfo anew = service.render(service.spec(10), Reuse::kAnew);
    EXPECT_NE(anew.job_id, first.job_id);
    EXPECT_EQ(anew.image_digest, first.image_digest);
    EXPECT_EQ(service.ask(service.spec(10)).job_id, anew.job_id);
}

TEST(Reuse, AJobThatIsUnderWayIsTheAnswer) {
    ReuseService service;
    const JobInfo first = service.ask(service.spec(10));
    EXPECT_EQ(service.ask(service.spec(10)).job_id, first.job_id);
    service.restart();
    EXPECT_EQ(service.ask(service.spec(10)).job_id, first.job_id);
    ASSERT_TRUE(service.coordinator->cancel_job(first.job_id).ok());
    EXPECT_NE(service.ask(service.spec(10)).job_id, first.job_id) << "a cancelled job is no answer";
}

TEST(Reuse, AnythingElseInTheSpecMakesAnotherJob) {
    ReuseService service;
    const JobInfo first = service.render(service.spec(10));
    JobSpec other = service.spec(10);
    other.seed = 1;
    EXPECT_FALSE(service.ask(other).reused);
    other = service.spec(10);
    other.crop = {1, 2, 30, 20};
    EXPECT_FALSE(service.ask(other).reused);
    other = service.spec(10);
    other.noise_target = 1e-3;
    EXPECT_FALSE(service.ask(other).reused);
    EXPECT_FALSE(service.ask(service.spec(11)).reused);
    other = service.spec(10);
    other.algorithm = other.algorithm.completed();
    EXPECT_NE(reuse_key(other), reuse_key(service.spec(10))) << "a chosen size of the training set is not the one that follows";
    other = service.spec(0);
    other.time_limit_seconds = 10;
    EXPECT_FALSE(service.ask(other).reused);
    EXPECT_FALSE(service.ask(other).reused) << "time never gives the same image twice";
}

TEST(Reuse, AnImageThatIsGoneOrOfAnotherSizeIsRenderedAgain) {
    ReuseService service;
    const JobInfo first = service.render(service.spec(10));
    std::filesystem::resize_file(service.image(first), 100);
    const JobInfo second = service.render(service.spec(10));
    EXPECT_NE(second.job_id, first.job_id);
    EXPECT_EQ(second.image_digest, first.image_digest);
    EXPECT_EQ(service.ask(service.spec(10)).job_id, second.job_id);
    std::filesystem::remove_all(service.image(second).parent_path());
    EXPECT_NE(service.ask(service.spec(10)).job_id, second.job_id);
}

TEST(Reuse, AJobThatWasFinishedEarlyIsNoAnswer) {
    ReuseService service;
    const JobInfo job = service.ask(service.spec(50));
    service.wait(job.job_id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
    ASSERT_TRUE(service.coordinator->finish_job(job.job_id).ok());
    EXPECT_FALSE(service.ask(service.spec(50)).reused) << "it will not have all samples";
    service.restart();
    const std::string worker = service.add_worker();
    service.wait(job.job_id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
    const auto leases = service.lease(worker);
    ASSERT_EQ(leases.size(), 1u);
    ASSERT_EQ(leases[0].job_id, job.job_id);
    service.deliver(worker, leases[0]);
    EXPECT_EQ(service.wait_end(job.job_id).state, JobState::kSucceeded);
    service.restart();
    EXPECT_NE(service.ask(service.spec(50)).job_id, job.job_id);
}

TEST(Reuse, WhatAnotherBuildRenderedIsNoAnswer) {
    ReuseService service;
    const JobInfo first = service.render(service.spec(10));
    service.options.identity.build_id = "another build";
    service.identity = service.options.identity;
    service.restart();
    EXPECT_FALSE(service.ask(service.spec(10)).reused);
}

TEST(Reuse, AForgottenJobIsNoAnswer) {
    ReuseService service([](CoordinatorOptions& options) { options.kept_jobs = 1; });
    service.render(service.spec(10));
    service.render(service.spec(11));
    EXPECT_FALSE(service.ask(service.spec(10)).reused);
    EXPECT_TRUE(service.ask(service.spec(11)).reused);
}

}  // namespace
}  // namespace lightloom
