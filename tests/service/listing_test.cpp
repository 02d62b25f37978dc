// What people see of a coordinator: names of jobs, states of workers, and the image as far as it is merged.

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/grpc_job_port.h"
#include "client/job_label.h"
#include "common/film/exr_io.h"
#include "common/film/grouped_sum.h"
#include "server/grpc_services.h"
#include "server/reducer.h"
#include "server/status_json.h"
#include "server/worker_registry.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using testing::FakeService;
using Json = nlohmann::ordered_json;

TEST(JobLabel, IsAShortLineOfText) {
    EXPECT_TRUE(check_label({}).ok());
    EXPECT_TRUE(check_label({"K\xc3\xbc"
                             "che, zweite",
                             "me@host"})
                    .ok());
    EXPECT_TRUE(check_label({std::string(128, 'x'), {}}).ok());
    for (const std::string& bad : {std::string(129, 'x'), std::string("a\nb"), std::string("\x1b[2J"), std::string("a\0b", 3),
                                   std::string("\x7f"), std::string("\xc2\x9b"), std::string("caf\xe9"),
                                   std::string("\xe2\x80\xae"
                                               "gpj")}) {
        EXPECT_EQ(check_label({bad, {}}).code(), StatusCode::kInvalidArgument) << bad;
        EXPECT_EQ(check_label({{}, bad}).code(), StatusCode::kInvalidArgument) << bad;
    }
    const JobLabel named = client::make_label("mine", "/scenes/room.pbrt"),
                   unnamed = client::make_label("", "/scenes/room.v2.pbrt");
    EXPECT_EQ(named.name, "mine");
    EXPECT_EQ(unnamed.name, "room.v2");
    EXPECT_NE(named.owner.find('@'), std::string::npos) << named.owner;
    EXPECT_TRUE(check_label(client::make_label("", "/scenes/r\xe9\n" + std::string(300, 'x') + ".pbrt")).ok()) << "of any file";
}

TEST(JobLabel, IsShownAndChangesNothing) {
    FakeService service;
    const JobLabel label{"first try", "me@host"};
    const auto job = service.coordinator->submit_job("r1", service.spec(1), label);
    ASSERT_TRUE(job.ok()) << job.status().message();
    const auto again = service.coordinator->submit_job("r1", service.spec(1), {"another", "you@host"});
    ASSERT_TRUE(again.ok()) << "the same request: " << again.status().message();
    EXPECT_EQ(again->job_id, job->job_id);
    EXPECT_EQ(again->label.name, "first try");
    EXPECT_EQ(service.coordinator->submit_job("r2", service.spec(1), {"a\tb", {}}).status().code(), StatusCode::kInvalidArgument);

    service.now_ms += 90000;
    const Json shown = status_json(service.wait(job->job_id, [](const JobInfo& j) { return j.state == JobState::kRunning; }));
    EXPECT_EQ(shown["name"], "first try");
    EXPECT_EQ(shown["owner"], "me@host");
    EXPECT_EQ(shown["scene"], "scene.pbrt");
    EXPECT_EQ(shown["width"], 40);
    EXPECT_EQ(shown["height"], 30);
    EXPECT_EQ(shown["progress"], 0);
    EXPECT_EQ(shown["age_seconds"], 90);
    const std::string worker = service.add_worker(), unnamed = service.submit(service.spec(1));
    for (int unit = 0; unit < 2; ++unit) service.deliver(worker, service.lease(worker).at(0));
    EXPECT_EQ(service.wait_end(job->job_id).image_digest, service.wait_end(unnamed).image_digest);
    EXPECT_EQ(status_json(*service.coordinator->get_job(unnamed))["progress"], 1);
}

TEST(WorkerStates, FollowWhatAWorkerDoes) {
    FakeService service;
    const std::string first = service.add_worker(), second = service.add_worker();
    const auto of = [&](const std::string& id) {
        for (const WorkerStatus& status : service.coordinator->workers())
            if (status.worker_id == id) return status;
        ADD_FAILURE() << id << " is not there";
        return WorkerStatus();
    };
    EXPECT_EQ(of(first).state, WorkerState::kIdle);
    const std::string job = service.submit(service.spec(40));
    const UnitLease lease = service.lease(first).at(0);
    EXPECT_EQ(of(first).state, WorkerState::kBusy);
    EXPECT_FALSE(of(first).in_work) << "it may fetch the scene";
    ASSERT_TRUE(service.coordinator->heartbeat(first, {{lease.reference(), true}}).ok());
    ASSERT_TRUE(of(first).in_work);
    EXPECT_EQ(*of(first).in_work, lease.reference());
    const Json shown = status_json(of(first));
    EXPECT_EQ(shown["state"], "busy");
    EXPECT_EQ(shown["unit"]["job"], job);
    EXPECT_EQ(shown["unit"]["training"], false);
    EXPECT_TRUE(shown["samples_per_second"].is_null());

    const auto deliver = [&](const UnitLease& done, double seconds) {
        const auto encoded = encode_partial(testing::fake_partial(done.unit.render, done.spec.frame), done.spec.frame);
        ASSERT_TRUE(
            service.coordinator->submit_payload(first, done.reference(), encoded->descriptor, encoded->payload, seconds).ok());
    };
    deliver(lease, 0.5);
    EXPECT_EQ(of(first).state, WorkerState::kIdle);
    EXPECT_FALSE(of(first).in_work);
    EXPECT_EQ(of(first).units_merged, 1u);
    EXPECT_DOUBLE_EQ(of(first).samples_per_second, 40 * 30 / 0.5);
    deliver(service.lease(first).at(0), std::numeric_limits<double>::quiet_NaN());
    EXPECT_DOUBLE_EQ(of(first).samples_per_second, 40 * 30 / 0.5) << "nobody knows how long that took";

    // Both are leased before one fails: a failed unit waits for another worker, and no further group is opened meanwhile.
    const UnitLease held[] = {service.lease(first).at(0), service.lease(first).at(0)};
    for (const UnitLease& failed : held)
        ASSERT_TRUE(service.coordinator->release_unit(first, failed.reference(), internal_error("no space")).ok());
    EXPECT_EQ(of(first).state, WorkerState::kResting);
    EXPECT_EQ(of(first).note, "failed 2 units in a row");

    ASSERT_TRUE(service.coordinator->goodbye(second).ok());
    EXPECT_EQ(of(second).state, WorkerState::kGone);
    EXPECT_EQ(of(second).note, "left");
    service.now_ms += 20000;
    EXPECT_EQ(of(first).state, WorkerState::kGone);
    EXPECT_EQ(of(first).note, "fell silent");
    EXPECT_EQ(of(first).seconds_since_heard, 20);
    EXPECT_EQ(service.coordinator->workers(21).size(), 2u);
    EXPECT_TRUE(service.coordinator->workers(19).empty());
}

TEST(WorkerStates, ARefusedWorkerIsShownUntilItsHostIsLetIn) {
    FakeService service;
    WorkerHello other{service.identity, 4, "render7", 99};
    other.identity.build_id = "older";
    for (int attempt = 0; attempt < 3; ++attempt)
        EXPECT_EQ(service.coordinator->register_worker(other).status().code(), StatusCode::kFailedPrecondition);
    service.now_ms += 5000;
    const auto refused = service.coordinator->workers();
    ASSERT_EQ(refused.size(), 1u) << "however often it tries";
    EXPECT_EQ(refused[0].state, WorkerState::kRefused);
    EXPECT_EQ(refused[0].host, "render7");
    EXPECT_EQ(refused[0].thread_count, 4u);
    EXPECT_EQ(refused[0].seconds_since_heard, 5);
    EXPECT_NE(refused[0].note.find("worker has build older"), std::string::npos) << refused[0].note;
    EXPECT_TRUE(service.coordinator->workers(4).empty());
    for (int host = 0; host < 100; ++host) {
        other.host = std::string(1, 'h').append(std::to_string(host));
        (void)service.coordinator->register_worker(other);
    }
    EXPECT_EQ(service.coordinator->workers().size(), 32u);
    ASSERT_TRUE(service.coordinator->register_worker({service.identity, 1, "h99", 1}).ok());
    const auto after = service.coordinator->workers();
    ASSERT_EQ(after.size(), 32u);
    EXPECT_EQ(after.front().state, WorkerState::kIdle);
    EXPECT_EQ(after.back().host, "h98");
}

TEST(Preview, HoldsWholeGroupsOnlyWhileResultsComeIn) {
    const FrameLayout frame{600, 300, {0, 0, 600, 300}};
    ASSERT_GT(size_t(frame.crop.area()), 2 * Reducer::kPixelsAtATime);
    const Plan plan(frame, {.light_paths_per_iteration = 1000});
    Reducer reducer(frame, plan.tile_count());
    GroupedSum serial(frame);
    uint32_t group = 0;
    const auto add = [&](const WorkUnit& unit) {
        const Partial partial = testing::fake_partial(unit.render, frame);
        const auto refused = reducer.add(unit, partial);
        ASSERT_TRUE(refused.ok() && !*refused);
        ASSERT_TRUE(serial.add(partial).ok());
    };
    const auto add_group = [&] {
        const Group next = plan.group(group++);
        for (const WorkUnit& unit : plan.units(next)) add(unit);
        ASSERT_TRUE(serial.fold(next.iteration_count).ok());
    };
    EXPECT_EQ(reducer.developed(true).status().code(), StatusCode::kFailedPrecondition);
    add_group();
    const auto first = reducer.developed(true);
    ASSERT_TRUE(first.ok());
    EXPECT_EQ(first->groups, 1u);
    EXPECT_TRUE(first->variance.pixels.empty()) << "one group says nothing of it";
    EXPECT_EQ(first->color.pixels, serial.complete().develop().pixels);

    // A group that is completed between two parts: the image is that of both groups or of one, in all of its pixels.
    int calls = 0;
    const auto second = reducer.developed(true, [&] {
        if (calls++ == 1) add_group();
    });
    ASSERT_TRUE(second.ok());
    EXPECT_EQ(calls, 4) << "two parts, and all three again";
    EXPECT_EQ(second->groups, 2u);
    EXPECT_EQ(second->iterations, 2u);
    EXPECT_EQ(second->color.pixels, serial.complete().develop().pixels);
    EXPECT_EQ(second->variance.pixels, serial.complete().variance().pixels);

    // Whatever comes in, it ends.
    calls = 0;
    const auto busy = reducer.developed(false, [&] {
        ++calls;
        add_group();
    });
    ASSERT_TRUE(busy.ok());
    EXPECT_EQ(calls, 3);
    EXPECT_EQ(busy->groups, 5u);
    EXPECT_EQ(busy->color.pixels, serial.complete().develop().pixels);
    EXPECT_TRUE(busy->variance.pixels.empty()) << "nobody asked for it";
}

TEST(Preview, IsTheImageOfAsManySamplesOrSaysWhyThereIsNone) {
    FakeService service;
    const auto preview = [&](const std::string& id) { return service.coordinator->preview(id, PreviewFormat::kExr); };
    EXPECT_EQ(preview("job-none").status().code(), StatusCode::kNotFound);
    EXPECT_NE(preview("job-none").status().message().find("lightloom list"), std::string::npos);
    const std::string worker = service.add_worker();
    // The image of the first three iterations.
    const std::string three = service.submit(service.spec(3));
    for (int unit = 0; unit < 3; ++unit) service.deliver(worker, service.lease(worker).at(0));
    ASSERT_EQ(service.wait_end(three).state, JobState::kSucceeded);
    const std::string image = *service.coordinator->image(three, ImageKind::kFinal);
    EXPECT_EQ(preview(three)->bytes, image);
    EXPECT_EQ(preview(three)->samples_per_pixel, 3u);

    JobSpec spec = service.spec(40);
    spec.first_hit_layers = true;
    const std::string id = service.submit(spec);
    EXPECT_EQ(preview(id).status().code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(preview(id).status().message().find("no group of iterations is complete yet"), std::string::npos);
    for (int unit = 0; unit < 3; ++unit) service.deliver(worker, service.lease(worker).at(0));
    const auto now = preview(id);
    ASSERT_TRUE(now.ok()) << now.status().message();
    EXPECT_EQ(now->samples_per_pixel, 3u);
    EXPECT_EQ(now->bytes, image);
    const auto png = service.coordinator->preview(id, PreviewFormat::kPng, 1);
    ASSERT_TRUE(png.ok());
    EXPECT_TRUE(png->bytes.starts_with("\x89PNG"));
    EXPECT_NE(png->bytes, *service.coordinator->image(id, ImageKind::kPreview)) << "which is darker";
    ASSERT_TRUE(service.coordinator->cancel_job(id).ok());
    EXPECT_EQ(preview(id).status().code(), StatusCode::kFailedPrecondition);
    EXPECT_NE(preview(id).status().message().find("is cancelled: what was rendered of it is gone"), std::string::npos);
}

TEST(Listing, TravelsOverGrpc) {
    FakeService service;
    const auto server = std::move(GrpcServer::start(*service.coordinator, "127.0.0.1:0")).value();
    GrpcJobPort port(grpc::CreateChannel("127.0.0.1:" + std::to_string(server->port()), grpc::InsecureChannelCredentials()));
    const auto job = port.submit_job("r", service.spec(40), {"a name", "me@host"});
    ASSERT_TRUE(job.ok()) << job.status().message();
    service.wait(job->job_id, [](const JobInfo& j) { return j.state == JobState::kRunning; });
    const std::string worker = service.add_worker();
    service.deliver(worker, service.lease(worker).at(0));
    const UnitLease lease = service.lease(worker).at(0);
    ASSERT_TRUE(service.coordinator->heartbeat(worker, {{lease.reference(), true}}).ok());
    (void)service.coordinator->register_worker({{"older", "profile", {}}, 1, "host", 2});
    service.now_ms += 3000;

    const auto jobs = port.list_jobs();
    ASSERT_TRUE(jobs.ok()) << jobs.status().message();
    ASSERT_EQ(jobs->size(), 1u);
    EXPECT_EQ(status_json(jobs->front()), status_json(service.coordinator->list_jobs().front()));
    const auto workers = port.list_workers(0);
    ASSERT_TRUE(workers.ok()) << workers.status().message();
    const auto ours = service.coordinator->workers();
    ASSERT_EQ(workers->size(), 2u);
    for (size_t i = 0; i < 2; ++i) EXPECT_EQ(status_json(workers->at(i)), status_json(ours.at(i)));
    EXPECT_EQ(port.list_workers(2)->size(), 1u) << "who was refused 3 s ago is not shown";
    EXPECT_EQ(port.list_workers(-1).status().code(), StatusCode::kInvalidArgument);

    const auto preview = port.preview(job->job_id, PreviewFormat::kExr, 0);
    ASSERT_TRUE(preview.ok()) << preview.status().message();
    EXPECT_EQ(preview->samples_per_pixel, 1u);
    EXPECT_EQ(preview->bytes, service.coordinator->preview(job->job_id, PreviewFormat::kExr)->bytes);
    EXPECT_TRUE(port.preview(job->job_id, PreviewFormat::kPng, 2)->bytes.starts_with("\x89PNG"));
    EXPECT_EQ(port.preview(job->job_id, PreviewFormat::kPng, 31).status().code(), StatusCode::kInvalidArgument);
    EXPECT_EQ(port.preview("job-none", PreviewFormat::kPng, 0).status().code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace lightloom
