// The commands that look at a service, as a user runs them.

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "common/film/exr_io.h"
#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::kScene;
using testing::Process;
using testing::Service;
using testing::wait_until;
using Json = nlohmann::json;

struct Client : testing::Client {
    using testing::Client::Client;
    std::vector<Json> lines() const {
        std::vector<Json> all;
        std::istringstream text(output);
        for (std::string line; std::getline(text, line);) all.push_back(Json::parse(line, nullptr, false));
        return all;
    }
};

TEST(Commands, ListShowsNamesAndOwners) {
    const Service service;
    Client client(service);
    const std::string first = client.submit({"--spp", "4", "--resolution", "16x12"}),
                      second = client.submit({"--time", "60", "--resolution", "16x12", "--name",
                                              "K\xc3\xbc"
                                              "che, zweite"});
    ASSERT_EQ(client.run({"list"}), 0) << client.output;
    EXPECT_EQ(client.output.rfind("JOB ", 0), 0u) << client.output;
    for (const std::string& text :
         {first, second, std::string("cornell"),
          std::string("K\xc3\xbc"
                      "che, zweite"),
          std::string("@"), std::string("cornell.pbrt"), std::string("16x12"), std::string("0/4 spp 0 %")})
        EXPECT_NE(client.output.find(text), std::string::npos) << text << " is not in\n" << client.output;
    ASSERT_EQ(client.run({"list", "--json"}), 0);
    const auto jobs = client.lines();
    ASSERT_EQ(jobs.size(), 2u) << client.output;
    EXPECT_EQ(jobs[0]["job"], first);
    EXPECT_EQ(jobs[0]["name"], "cornell");
    EXPECT_EQ(jobs[1]["name"],
              "K\xc3\xbc"
              "che, zweite");
    EXPECT_EQ(jobs[0]["samples_per_pixel"], 4);
    EXPECT_TRUE(jobs[0]["time_limit_seconds"].is_null());
    EXPECT_EQ(jobs[1]["time_limit_seconds"], 60);
    for (const std::string& name : {std::string(129, 'x'), std::string("a\x1b[2J"), std::string("caf\xe9")})
        EXPECT_EQ(client.run({"submit", kScene, "--detach", "--name", name}), 2) << client.output;
    EXPECT_EQ(service.jobs().list_jobs()->size(), 2u);
}

TEST(Commands, AJobThatRunsCanBeLookedAt) {
    const Service service;
    Client client(service);
    const std::string id = client.submit({"--time", "600", "--resolution", "24x18", "--algorithm", "bdpt", "--max-depth", "3"});
    EXPECT_EQ(client.run({"preview", id, "-o", service.path("early.png")}), 1);
    EXPECT_NE(client.output.find(id), std::string::npos) << client.output;
    EXPECT_FALSE(std::filesystem::exists(service.path("early.png")));
    EXPECT_EQ(client.run({"preview", id, "-o", service.path("x.jpg")}), 2) << client.output;
    EXPECT_EQ(client.run({"preview", id, "-o", service.path("x.exr"), "--exposure", "1"}), 2) << client.output;

    const Process watch("lightloom", {"watch", id, "--json", "--server", service.address()}, service.path("watch.log"));
    const auto worker = service.worker("worker", 1);
    GrpcJobPort jobs = service.jobs();
    ASSERT_TRUE(wait_until(60, [&] { return jobs.get_job(id)->samples_per_pixel_done >= 3; })) << service.log("worker");
    ASSERT_TRUE(wait_until(60, [&] {
        const std::string log = service.log("watch");
        return std::count(log.begin(), log.end(), '\n') >= 3;
    })) << service.log("watch");
    ASSERT_EQ(client.run({"workers"}), 0) << client.output;
    EXPECT_EQ(client.output.rfind("WORKER ", 0), 0u) << client.output;
    ASSERT_EQ(client.run({"workers", "--json"}), 0);
    const auto workers = client.lines();
    ASSERT_EQ(workers.size(), 1u) << client.output;
    EXPECT_EQ(workers[0]["process_id"], worker->pid());
    EXPECT_EQ(workers[0]["threads"], 1);
    EXPECT_GT(workers[0]["samples_per_second"].get<double>(), 0);

    ASSERT_EQ(client.run({"preview", id, "-o", service.path("now.png")}), 0) << client.output;
    EXPECT_TRUE(read_file(service.path("now.png"))->starts_with("\x89PNG"));
    ASSERT_EQ(client.run({"preview", id, "-o", service.path("now.exr")}), 0) << client.output;
    const auto image = decode_exr(*read_file(service.path("now.exr")), "now.exr");
    ASSERT_TRUE(image.ok()) << image.status().message();
    const std::string samples = image->attribute(exr_attribute::kSamples);
    EXPECT_NE(client.output.find("now.exr  " + samples + " spp"), std::string::npos) << client.output;

    ASSERT_EQ(client.run({"cancel", id}), 0) << client.output;
    ASSERT_TRUE(wait_until(60, [&] { return watch.ended(); }));
    std::istringstream text(service.log("watch"));
    std::vector<std::string> seen;
    uint64_t done = 0;
    for (std::string line; std::getline(text, line) && line.starts_with("{");) {
        const Json change = Json::parse(line);
        EXPECT_EQ(change["job"], id);
        EXPECT_GE(change["samples_per_pixel_done"].get<uint64_t>(), done);
        done = change["samples_per_pixel_done"].get<uint64_t>();
        seen.push_back(change["state"].get<std::string>());
    }
    EXPECT_GE(seen.size(), 3u) << service.log("watch");
    EXPECT_EQ(seen.back(), "cancelled");
    EXPECT_GE(done, 3u);
    EXPECT_EQ(client.run({"watch", id, "--json"}), 130);
    EXPECT_EQ(client.lines().at(0)["state"], "cancelled") << client.output;
    EXPECT_EQ(client.run({"preview", id, "-o", service.path("late.png")}), 1);
    EXPECT_NE(client.output.find("is cancelled: what was rendered of it is gone"), std::string::npos) << client.output;

    // The image of as many samples.
    ASSERT_EQ(Process("lightloom",
                      {"render", kScene, "-q", "-o", service.path("again.exr"), "--spp", samples, "--resolution", "24x18",
                       "--algorithm", "bdpt", "--max-depth", "3"},
                      service.path("again.log"))
                  .wait(),
              0)
        << service.log("again");
    EXPECT_EQ(service.digest("now"), service.digest("again"));
}

TEST(Commands, ASubmissionThatWaitsTellsTheJobsIdAtOnce) {
    const Service service;
    Client client(service);
    // Without a worker neither ends.
    Process loud("lightloom", {"submit", kScene, "--server", service.address(), "--spp", "4", "-o", service.path("loud.exr")},
                 service.path("loud.log"));
    ASSERT_TRUE(wait_until(60, [&] { return service.log("loud").find("lightloom: job-") != std::string::npos; }))
        << service.log("loud");
    const std::string log = service.log("loud");
    const std::string id = log.substr(log.find("job-"), service.jobs().list_jobs()->front().job_id.size());
    EXPECT_EQ(client.run({"cancel", id}), 0) << client.output;
    EXPECT_EQ(loud.wait(), 130) << service.log("loud");
    const auto quiet = service.submit("quiet", {"--spp", "4"});
    ASSERT_TRUE(wait_until(60, [&] { return service.jobs().list_jobs()->size() == 2; })) << service.log("quiet");
    EXPECT_EQ(client.run({"cancel", service.jobs().list_jobs()->back().job_id}), 0) << client.output;
    EXPECT_EQ(quiet->wait(), 130);
    EXPECT_EQ(service.log("quiet").find("lightloom: job-"), std::string::npos) << service.log("quiet");
}

TEST(Commands, AJobThatNobodyKnowsIsAFailureWithItsName) {
    const Service service;
    Client client(service);
    for (const char* command : {"fetch", "watch", "cancel", "preview"}) {
        EXPECT_EQ(client.run({command, "job-of-old"}), 1) << command;
        EXPECT_NE(client.output.find("job-of-old"), std::string::npos) << client.output;
        EXPECT_NE(client.output.find("`lightloom list`"), std::string::npos) << client.output;
        EXPECT_EQ(std::count(client.output.begin(), client.output.end(), '\n'), 1) << client.output;
    }
    EXPECT_EQ(client.run({"fetch"}), 2) << "of which job?";
    EXPECT_FALSE(std::filesystem::exists("job-of-old.exr"));
    EXPECT_FALSE(std::filesystem::exists("job-of-old-preview.png"));
}

}  // namespace
}  // namespace lightloom
