// finish, cancel --keep, fetch --partial and a submission that was rendered before, as a user runs them.

#include <gtest/gtest.h>

#include "common/film/exr_io.h"
#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::kScene;
using testing::Service;
using testing::wait_until;

struct Client : testing::Client {
    using testing::Client::Client;
    /// The id of a job of 24 x 18 pixels.
    std::string submit(std::vector<std::string> more) {
        more.insert(more.end(), {"--resolution", "24x18", "--algorithm", "path"});
        return testing::Client::submit(std::move(more));
    }
    void wait_samples(const std::string& id, uint64_t samples) {
        GrpcJobPort jobs = service.jobs();
        ASSERT_TRUE(wait_until(60, [&] { return jobs.get_job(id)->samples_per_pixel_done >= samples; }));
    }
    std::string samples(const std::string& name) const {
        const auto image = decode_exr(*read_file(service.path(name)), name);
        return image.ok() ? image->attribute(exr_attribute::kSamples) : image.status().message();
    }
};

TEST(EndEarly, NothingThatWasRenderedIsLost) {
    const Service service;
    Client client(service);
    const std::string id = client.submit({"--spp", "1000000"});
    EXPECT_EQ(client.run({"fetch", id, "--partial", "-o", service.path("none.exr")}), 1);
    EXPECT_TRUE(client.printed(id)) << client.output;
    EXPECT_FALSE(std::filesystem::exists(service.path("none.exr")));
    const auto worker = service.worker("worker", 1);
    client.wait_samples(id, 3);
    ASSERT_EQ(client.run({"fetch", id, "--partial", "-o", service.path("now.exr"), "--png", service.path("now.png")}), 0)
        << client.output;
    EXPECT_TRUE(client.printed("now.exr  " + client.samples("now.exr") + " spp of a job that is running")) << client.output;
    EXPECT_TRUE(std::filesystem::exists(service.path("now.png")));
    EXPECT_EQ(client.run({"fetch", id, "--partial", "--half"}), 2) << client.output;

    ASSERT_EQ(client.run({"finish", id}), 0) << client.output;
    EXPECT_TRUE(client.printed(id + " ends with")) << client.output;
    ASSERT_EQ(client.run({"watch", id, "-q"}), 0) << client.output;
    ASSERT_EQ(client.run({"fetch", id, "-o", service.path("finished.exr")}), 0) << client.output;
    EXPECT_EQ(std::to_string(service.manifest("finished")["image"]["samples_per_pixel"].get<uint64_t>()),
              client.samples("finished.exr"));

    const std::string kept = client.submit({"--spp", "1000001"});
    client.wait_samples(kept, 3);
    ASSERT_EQ(client.run({"cancel", kept, "--keep"}), 0) << client.output;
    EXPECT_TRUE(client.printed(kept + " is cancelled: its complete groups are kept")) << client.output;
    EXPECT_EQ(client.run({"finish", kept}), 1);
    EXPECT_TRUE(client.printed("is cancelled: there is nothing left to finish")) << client.output;
    ASSERT_EQ(client.run({"fetch", kept, "--partial", "-o", service.path("kept.exr")}), 0) << client.output;
    EXPECT_EQ(service.manifest("kept")["image"]["sha256"], service.digest("kept").hex());
    EXPECT_EQ(service.manifest("kept")["partial"]["state"], "cancelled");

    const std::string thrown = client.submit({"--spp", "1000002"});
    client.wait_samples(thrown, 3);
    ASSERT_EQ(client.run({"cancel", thrown}), 0);
    EXPECT_TRUE(client.printed("sample(s) per pixel were thrown away")) << client.output;
    EXPECT_EQ(client.run({"fetch", thrown, "--partial", "-o", service.path("none.exr")}), 1);
    EXPECT_TRUE(client.printed("what was rendered of it is gone")) << client.output;
}

TEST(EndEarly, TheSameJobIsRenderedOnce) {
    const Service service;
    Client client(service);
    const auto worker = service.worker("worker", 1);
    const auto render = [&](const std::string& name, std::vector<std::string> more) {
        std::vector<std::string> arguments{"submit", kScene, "--resolution", "24x18", "--algorithm", "path", "--spp", "4"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        arguments.insert(arguments.end(), {"-o", service.path(name + ".exr")});
        EXPECT_EQ(client.run(arguments), 0) << client.output;
    };
    render("first", {});
    EXPECT_FALSE(client.printed("--again")) << client.output;
    const std::string id = service.jobs().list_jobs()->front().job_id;
    render("second", {});
    EXPECT_TRUE(client.printed("lightloom: the same job was rendered before: " + id + "; --again renders anew")) << client.output;
    EXPECT_EQ(service.jobs().list_jobs()->size(), 1u);
    EXPECT_EQ(service.digest("first"), service.digest("second"));
    render("third", {"--again"});
    EXPECT_EQ(service.jobs().list_jobs()->size(), 2u);
    EXPECT_EQ(service.digest("first"), service.digest("third"));
    render("fourth", {"--seed", "1"});
    EXPECT_EQ(service.jobs().list_jobs()->size(), 3u);
}

}  // namespace
}  // namespace lightloom
