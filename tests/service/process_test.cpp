// The programs as a user runs them: coordinator, workers and client as processes on loopback, real light.

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

#include "tests/service/service_process.h"

namespace lightloom {
namespace {

using testing::kScene;
using testing::Process;
using testing::Service;
using testing::TempDirectory;
using testing::wait_until;
using Json = nlohmann::json;

const std::vector<std::string> kJob{"--algorithm", "bdpt", "--spp", "24", "--resolution", "48x36", "--max-depth", "4"};

Digest embedded(const Service& service, int workers, int threads, const std::vector<std::string>& job) {
    const std::string name = "embedded" + std::to_string(workers) + "x" + std::to_string(threads);
    std::vector<std::string> arguments{"render",
                                       kScene,
                                       "-q",
                                       "-o",
                                       service.path(name + ".exr"),
                                       "--workers",
                                       std::to_string(workers),
                                       "--threads",
                                       std::to_string(threads)};
    arguments.insert(arguments.end(), job.begin(), job.end());
    EXPECT_EQ(Process("lightloom", arguments, service.path(name + ".log")).wait(), 0) << service.log(name);
    return service.digest(name);
}

/// Files beside the scene's directory travel, and what is left out is left out by everybody.
TEST(Processes, AllLeaveTheSameOutAndSeeTheSameRoot) {
    const Service service;
    std::filesystem::create_directories(service.path("house/rooms"));
    const std::string scene = service.path("house/rooms/scene.pbrt");
    std::ofstream(scene) << "Film \"rgb\" PixelFilter \"box\" LookAt 0 0 -4 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 40\n"
                            "WorldBegin LightSource \"infinite\" MediumInterface \"fog\" \"\"\nInclude \"../ball.pbrt\"\n";
    std::ofstream(service.path("house/ball.pbrt")) << "Material \"hair\" Shape \"sphere\"\nShape \"curve\"\n";
    std::vector<std::string> job{"--without", "media,hair,curves,motion", "--resolution", "16x16", "--spp", "4"};
    const auto run = [&](const std::string& name, std::vector<std::string> arguments) {
        arguments.insert(arguments.end(), {"-o", service.path(name + ".exr")});
        arguments.insert(arguments.end(), job.begin(), job.end());
        return Process("lightloom", arguments, service.path(name + ".log")).wait();
    };
    const auto worker = service.worker("worker", 1);
    ASSERT_EQ(run("embedded", {"render", scene, "--threads", "1"}), 0) << service.log("embedded");
    ASSERT_EQ(run("service", {"submit", scene, "--server", service.address()}), 0)
        << service.log("service") << service.log("worker");
    EXPECT_EQ(service.digest("embedded"), service.digest("service"));
    for (const char* name : {"embedded", "service"}) {
        const Json spec = service.manifest(name)["spec"];
        EXPECT_EQ(spec["scene"], "rooms/scene.pbrt");
        EXPECT_EQ(spec["without"], Json({"curves", "hair", "media"}));
    }
    EXPECT_NE(service.log("service").find("left out: curves (1, first at ../ball.pbrt:2)"), std::string::npos)
        << service.log("service");
    job[1] = "media,hair";
    EXPECT_EQ(run("refused", {"submit", scene, "--server", service.address()}), 2);
    EXPECT_NE(service.log("refused").find("--without curves"), std::string::npos) << service.log("refused");
}

TEST(Processes, BytesAreTheSameHoweverAJobIsRun) {
    const Service service({"--shuffle-leases", "11"});
    const Digest reference = embedded(service, 1, 1, kJob);
    EXPECT_EQ(embedded(service, 1, 2, kJob), reference);
    EXPECT_EQ(embedded(service, 3, 1, kJob), reference);
    EXPECT_EQ(embedded(service, 8, 2, kJob), reference);
    std::vector<std::unique_ptr<Process>> workers;
    for (const size_t count : {1, 2, 3, 8}) {
        while (workers.size() < count)
            workers.push_back(service.worker("worker" + std::to_string(workers.size()), 1 + int(workers.size()) % 2));
        const std::string name = "submitted" + std::to_string(count);
        ASSERT_EQ(service.submit(name, kJob)->wait(), 0) << service.log(name) << service.log("server");
        EXPECT_EQ(service.digest(name), reference) << count << " workers";
    }
    // The same holds for half colours, whoever makes them.
    std::vector<std::string> job = kJob;
    job.push_back("--half");
    const Digest half = embedded(service, 2, 1, job);
    EXPECT_NE(half, reference);
    const std::string id = service.jobs().list_jobs()->front().job_id;
    ASSERT_EQ(Process("lightloom", {"fetch", id, "--server", service.address(), "--half", "-q", "-o", service.path("half.exr")},
                      service.path("half.log"))
                  .wait(),
              0)
        << service.log("half");
    EXPECT_EQ(service.digest("half"), half);
    EXPECT_EQ(service.manifest("half")["image"]["sha256"].get<std::string>(), half.hex());
    EXPECT_EQ(service.manifest("half")["image"]["float_sha256"].get<std::string>(), reference.hex());
    EXPECT_EQ(
        Process("lightloom",
                {"fetch", id, "--server", service.address(), "-o", service.path("one.exr"), "--json", service.path("one.exr")},
                service.path("one.log"))
            .wait(),
        2)
        << "which of the two?";
    EXPECT_FALSE(std::filesystem::exists(service.path("one.exr")));
}

TEST(Processes, ASecondCoordinatorDoesNotShareADirectory) {
    const Service service;
    Process second("lightloom-server", {"--listen", "127.0.0.1:0", "--status", "off", "--data", service.path("data")},
                   service.path("second.log"));
    EXPECT_EQ(second.wait(), 1);
    EXPECT_NE(service.log("second").find("is used by another coordinator"), std::string::npos) << service.log("second");
}

TEST(Processes, TwoProcessesRenderDisjointUnits) {
    const Service service;
    const auto first = service.worker("first", 1), second = service.worker("second", 1);
    ASSERT_TRUE(wait_until(60, [&] { return service.log("server").find("worker-2") != std::string::npos; }));
    std::vector<std::string> job = kJob;
    job[3] = "60";
    ASSERT_EQ(service.submit("image", job)->wait(), 0) << service.log("image");
    const Json manifest = service.manifest("image");
    std::set<int64_t> processes;
    std::map<std::pair<int, int>, int> rendered;
    for (const Json& worker : manifest["workers"]) {
        processes.insert(worker["process_id"].get<int64_t>());
        EXPECT_FALSE(worker["units"].empty());
        for (const Json& unit : worker["units"]) ++rendered[{unit[0].get<int>(), unit[1].get<int>()}];
    }
    EXPECT_EQ(processes, (std::set<int64_t>{first->pid(), second->pid()}));
    EXPECT_EQ(rendered.size(), manifest["work"]["units"].get<size_t>());
    for (const auto& [unit, times] : rendered) EXPECT_EQ(times, 1);
    EXPECT_EQ(manifest["image"]["sha256"].get<std::string>(), service.digest("image").hex());
}

TEST(Processes, AClientNoticesThatTheCoordinatorHasGoneSilent) {
    const Service service;
    const auto submitted = service.submit("image", {"--spp", "4", "--resolution", "16x16"});  // and no worker ever comes
    ASSERT_TRUE(wait_until(60, [&] {
        const auto list = service.jobs().list_jobs();
        return list.ok() && !list->empty() && list->front().state == JobState::kRunning;
    })) << service.log("image");
    service.server->signal(SIGSTOP);
    EXPECT_TRUE(wait_until(120, [&] { return submitted->ended(); })) << "30 s until it notices, and 30 s for a restart";
    submitted->signal(SIGKILL);  // or else it might wait for ever
    EXPECT_EQ(submitted->wait(), 4);
    EXPECT_NE(service.log("image").find("no answer from " + service.address()), std::string::npos) << service.log("image");
}

TEST(Processes, AWorkerKilledMidUnitCostsTimeOnly) {
    const Service service;
    std::vector<std::string> job{"--algorithm", "bdpt", "--spp", "12", "--resolution", "256x256"};
    const Digest reference = embedded(service, 1, 2, job);
    auto victim = service.worker("victim", 1);
    auto client = service.submit("image", job);
    GrpcJobPort jobs = service.jobs();
    ASSERT_TRUE(wait_until(60, [&] {
        const auto list = jobs.list_jobs();
        return list.ok() && !list->empty() && list->front().unit_leased > 0 && list->front().unit_done > 0;
    }));
    victim->signal(SIGKILL);
    EXPECT_EQ(victim->wait(), 128 + SIGKILL);
    const auto survivor = service.worker("survivor", 2);
    ASSERT_EQ(client->wait(), 0) << service.log("image");
    EXPECT_EQ(service.digest("image"), reference);
    const Json manifest = service.manifest("image");
    EXPECT_EQ(manifest["workers"].size(), 2u);
    EXPECT_GE(manifest["work"]["expired_leases"].get<int>(), 1);
}

const std::vector<std::string> kTableJob{"--algorithm",  "spcbpt",
                                         "--spp",        "8",
                                         "--resolution", "48x36",
                                         "--max-depth",  "4",
                                         "--set",        "training-paths=150000",
                                         "--set",        "light-subspaces=40",
                                         "--set",        "eye-subspaces=20",
                                         "--set",        "cache=500"};

TEST(Processes, TrainingIsSharedOutAndAWorkerKilledDuringItCostsTimeOnly) {
    const Service service({"--table-cache-size", "0"});
    std::vector<std::string> alone = kTableJob;
    alone.insert(alone.end(), {"--table-cache", "off"});
    const Digest reference = embedded(service, 1, 1, alone);
    EXPECT_EQ(embedded(service, 4, 1, alone), reference);
    auto victim = service.worker("victim", 1);
    auto client = service.submit("image", kTableJob);
    GrpcJobPort jobs = service.jobs();
    ASSERT_TRUE(wait_until(60, [&] {
        const auto list = jobs.list_jobs();
        // The first round is a single unit; it is to die over one of several.
        return list.ok() && !list->empty() && list->front().phase == PreparePhase::kTracing && list->front().unit_leased > 0 &&
               list->front().phase_done > kPilotSamples;
    }));
    victim->signal(SIGKILL);
    EXPECT_EQ(victim->wait(), 128 + SIGKILL);
    EXPECT_EQ(jobs.list_jobs()->front().state, JobState::kPreparing) << "it was to die during training";
    std::vector<std::unique_ptr<Process>> others;
    for (const char* name : {"second", "third"}) others.push_back(service.worker(name, 1));
    ASSERT_EQ(client->wait(), 0) << service.log("image") << service.log("server");
    EXPECT_EQ(service.digest("image"), reference);
    const Json manifest = service.manifest("image");
    EXPECT_EQ(manifest["tables"]["training_samples"].get<int>(), 150000);
    EXPECT_FALSE(manifest["tables"]["from_cache"].get<bool>());
    EXPECT_GE(manifest["work"]["expired_leases"].get<int>(), 1);
}

/// The coordinator can do everything alone: learn the tables and render.
TEST(Processes, ACoordinatorWithThreadsOfItsOwnNeedsNoWorker) {
    const std::vector<std::string> job{"--algorithm", "spcbpt",      "--spp", "4",     "--resolution",
                                       "32x24",       "--max-depth", "4",     "--set", "training-paths=40000"};
    const Service alone({"--threads", "2"});
    ASSERT_EQ(alone.submit("alone", job)->wait(), 0) << alone.log("alone") << alone.log("server");
    const Json workers = alone.manifest("alone")["workers"];
    ASSERT_EQ(workers.size(), 1u);
    EXPECT_EQ(workers[0]["process_id"].get<int64_t>(), alone.server->pid());
    EXPECT_EQ(alone.digest("alone"), embedded(alone, 1, 1, job));
    // It stops as one does that leaves work to others, in the middle of a job.
    const auto unfinished = alone.submit("unfinished", {"--algorithm", "path", "--spp", "100000"});
    EXPECT_TRUE(wait_until(60, [&] {
        const auto jobs = alone.jobs().list_jobs();
        return jobs.ok() && std::any_of(jobs->begin(), jobs->end(),
                                        [](const JobInfo& j) { return j.state == JobState::kRunning && j.unit_done > 0; });
    }));
    alone.server->signal(SIGTERM);
    EXPECT_EQ(alone.server->wait(), 0) << alone.log("server");
}

TEST(Processes, TablesAreKeptForTheNextRenderAndCanBeInspected) {
    const Service service;
    std::vector<std::string> job = kTableJob;
    job.insert(job.end(), {"--table-cache", service.path("tables"), "--json", service.path("statistics.json")});
    const Digest first = embedded(service, 1, 1, job);
    EXPECT_FALSE(Json::parse(*read_file(service.path("statistics.json")))["tables"]["from_cache"].get<bool>());
    EXPECT_EQ(embedded(service, 2, 1, job), first);
    const Json statistics = Json::parse(*read_file(service.path("statistics.json")));
    EXPECT_TRUE(statistics["tables"]["from_cache"].get<bool>());
    const std::string file = service.path("tables") + "/" + statistics["tables"]["cache_key"].get<std::string>() + ".tables";
    ASSERT_EQ(Process("lightloom",
                      {"inspect", kScene, "--tables", file, "--draw", service.path("seen"), "--json", service.path("seen.json")},
                      service.path("inspect.log"))
                  .wait(),
              0)
        << service.log("inspect");
    const Json seen = Json::parse(*read_file(service.path("seen.json")))["tables"];
    EXPECT_EQ(seen["sha256"], statistics["tables"]["sha256"]);
    EXPECT_TRUE(seen["emission"]["learned"].get<bool>());
    EXPECT_NEAR(seen["emission"]["strongest_lights"][0]["by_power"].get<double>(), 1, 1e-6) << "there is one light";
    EXPECT_NE(service.log("inspect").find("100.0 % of the light sub-paths, by power 100.0 %"), std::string::npos)
        << service.log("inspect");
    for (const char* picture : {"-kappa-eye.png", "-kappa-light.png", "-gamma.png", "-q.png"})
        EXPECT_TRUE(read_file(service.path("seen") + picture)->starts_with("\x89PNG")) << picture;
    // Tables without subspaces.
    embedded(
        service, 1, 1,
        {"--algorithm", "bdpt", "--spp", "1", "--resolution", "16x16", "--set", "emission=learned", "--set", "roulette=learned",
         "--set", "training-paths=2000", "--table-cache", service.path("emission"), "--json", service.path("bdpt.json")});
    const std::string key = Json::parse(*read_file(service.path("bdpt.json")))["tables"]["cache_key"].get<std::string>();
    const std::string emission = service.path("emission") + "/" + key + ".tables";
    EXPECT_EQ(Process("lightloom", {"inspect", kScene, "--tables", emission}, service.path("inspect.log")).wait(), 0);
    EXPECT_NE(service.log("inspect").find("  emission   10 % by power"), std::string::npos) << service.log("inspect");
    EXPECT_NE(service.log("inspect").find(" x 16 blocks of the frame"), std::string::npos) << service.log("inspect");
    EXPECT_EQ(Process("lightloom", {"inspect", kScene, "-q", "--tables", emission, "--draw", "x"}, service.path("none.log")).wait(),
              2);
    std::ofstream(file, std::ios::app) << "x";
    EXPECT_EQ(Process("lightloom", {"inspect", kScene, "--quiet", "--tables", file}, service.path("damaged.log")).wait(), 2);
    EXPECT_EQ(embedded(service, 1, 2, job), first) << "damaged tables are made again";
    EXPECT_FALSE(Json::parse(*read_file(service.path("statistics.json")))["tables"]["from_cache"].get<bool>());
}

TEST(Processes, ATimeLimitedImageCanBeRenderedAgain) {
    const Service service;
    const auto worker = service.worker("worker", 2);
    ASSERT_EQ(service.submit("timed", {"--algorithm", "bdpt", "--time", "1.5", "--resolution", "64x48", "--layers"})->wait(), 0)
        << service.log("timed");
    const Json manifest = service.manifest("timed");
    EXPECT_TRUE(manifest["spec"]["layers"].get<bool>());
    const auto spp = manifest["image"]["samples_per_pixel"].get<uint64_t>();
    ASSERT_GE(spp, 1u);
    EXPECT_EQ(embedded(service, 2, 1, {"--algorithm", "bdpt", "--spp", std::to_string(spp), "--resolution", "64x48", "--layers"}),
              service.digest("timed"));
}

TEST(Processes, AWorkerWithAnotherGoldenUnitIsRefusedByName) {
    const Service service;
    const std::string fake(64, 'a');
    EXPECT_EQ(service.worker("liar", 1, {"--pretend-golden-digest", fake})->wait(), 1);
    EXPECT_NE(service.log("liar").find("golden unit " + fake.substr(0, 16)), std::string::npos) << service.log("liar");
}

TEST(Processes, SigtermEndsWorkerAndServerCleanly) {
    Service service;
    const auto worker = service.worker("worker", 1);
    ASSERT_TRUE(wait_until(60, [&] { return service.log("worker").find("registered as") != std::string::npos; }));
    const auto client = service.submit("image", {"--spp", "100000", "--resolution", "128x128"});
    GrpcJobPort jobs = service.jobs();
    ASSERT_TRUE(wait_until(60, [&] {
        const auto list = jobs.list_jobs();
        return list.ok() && !list->empty() && list->front().unit_done > 0;
    }));
    worker->signal(SIGTERM);
    EXPECT_EQ(worker->wait(), 0) << service.log("worker");
    EXPECT_EQ(jobs.list_jobs()->front().unit_leased, 0u);
    client->signal(SIGINT);
    EXPECT_EQ(client->wait(), 130) << service.log("image");
    EXPECT_EQ(jobs.list_jobs()->front().state, JobState::kCancelled);
    EXPECT_FALSE(std::filesystem::exists(service.path("image.exr")));
    EXPECT_EQ(
        Process("lightloom",
                {"fetch", jobs.list_jobs()->front().job_id, "--server", service.address(), "-o", service.path("no/such/place.exr")},
                service.path("fetch.log"))
            .wait(),
        130)
        << "that it was cancelled matters more";
    service.server->signal(SIGTERM);
    EXPECT_EQ(service.server->wait(), 0) << service.log("server");
}

TEST(Processes, ASocketBelongsToTheServerThatHasIt) {
    const TempDirectory directory;
    const auto path = [&](const std::string& name) { return (directory.path / name).string(); };
    const std::string address = "unix:" + path("socket");
    const auto serve = [&](const std::string& name) {
        return std::make_unique<Process>("lightloom-server",
                                         std::vector<std::string>{"--listen", address, "--status", "off", "--data", path(name),
                                                                  "--port-file", path(name + ".ports")},
                                         path(name + ".log"));
    };
    const auto list = [&] { return Process("lightloom", {"list", "--server", address}, path("list.log")).wait(); };
    const auto first = serve("first");
    ASSERT_TRUE(wait_until(60, [&] { return std::filesystem::exists(path("first.ports")); }));
    EXPECT_EQ(list(), 0);
    EXPECT_EQ(serve("second")->wait(), 1);
    EXPECT_EQ(list(), 0) << "the second has not taken it along";
    first->signal(SIGKILL);
    first->wait();
    const auto third = serve("third");
    EXPECT_TRUE(wait_until(60, [&] { return std::filesystem::exists(path("third.ports")); })) << "what a dead one left is free";
    EXPECT_EQ(list(), 0);
}

/// Every command that renders takes the scene's Integrator for its default and says so in one line; the job names its algorithm.
TEST(Processes, TheScenesIntegratorIsTheDefault) {
    const Service service;
    const auto text = read_file(std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/furnace-sphere.pbrt");  // which includes no file
    const std::string directive = "Integrator \"path\"", note = "Integrator \"";
    ASSERT_NE(text->find(directive), std::string::npos);
    const std::string scene = service.path("own.pbrt");
    const auto ask_for = [&](const std::string& integrator) {
        std::ofstream(scene) << std::string(*text).replace(text->find(directive), directive.size(),
                                                           "Integrator \"" + integrator + "\"");
    };
    // The lines of a command's output that are about the integrator.
    int count = 0;
    const auto lines = [&](std::vector<std::string> arguments, std::vector<std::string> more) {
        const std::string name = "run" + std::to_string(count++);
        arguments.insert(arguments.end(), more.begin(), more.end());
        EXPECT_EQ(Process("lightloom", arguments, service.path(name + ".log")).wait(), 0) << service.log(name);
        std::istringstream log(service.log(name));
        std::vector<std::string> found;
        for (std::string line; std::getline(log, line);)
            if (line.find(note) != std::string::npos) found.push_back(line);
        return found;
    };
    const auto render = [&](std::vector<std::string> more) {
        return lines({"render", scene, "--spp", "1", "--resolution", "8x8", "-o", service.path("own.exr")}, std::move(more));
    };
    const auto rendered = [&] { return service.manifest("own")["spec"]["algorithm"].get<std::string>(); };
    const std::vector<std::string> none;
    ask_for("sppm");
    const std::string with_bdpt = "no algorithm for the scene's Integrator \"sppm\": rendering with bdpt; --algorithm overrides";
    EXPECT_EQ(render({}), std::vector{"lightloom: " + with_bdpt});
    EXPECT_EQ(rendered(), "bdpt");
    EXPECT_EQ(lines({"inspect", scene}, {}), std::vector{"  algorithm  " + with_bdpt});
    ask_for("volpath");
    const std::vector with_path{std::string("lightloom: the scene's Integrator \"volpath\" asks for path; --algorithm overrides")};
    EXPECT_EQ(render({}), with_path);
    EXPECT_EQ(rendered(), "path");
    EXPECT_EQ(render({"-q"}), none);
    EXPECT_EQ(rendered(), "path");
    EXPECT_EQ(render({"--algorithm", "light"}), none);
    EXPECT_EQ(rendered(), "light");
    EXPECT_EQ(lines({"replay", scene, "--pixel", "1,1"}, {}), with_path);
    EXPECT_EQ(lines({"reference", scene, "--spp", "1", "--resolution", "8x8", "-o", service.path("ref.exr")}, {}), with_path);
    EXPECT_EQ(Json::parse(*read_file(service.path("ref.json")))["algorithm"], "path");
    EXPECT_EQ(
        Process("lightloom", {"reference", scene, "--spp", "99", "-o", service.path("own-check.exr"), "--cross-check", "path"},
                service.path("check.log"))
            .wait(),
        2)
        << "the scene's own algorithm cannot check itself";
    EXPECT_EQ(lines({"submit", scene, "--server", service.address(), "--spp", "1", "--detach"}, {}), with_path);
    const auto jobs = service.jobs().list_jobs();
    ASSERT_TRUE(jobs.ok()) << jobs.status().message();
    ASSERT_EQ(jobs->size(), 1u);
    EXPECT_EQ(jobs->front().spec.algorithm.name(), "path") << "a service is told, it does not guess";
}

TEST(Processes, MistakesAreOneLineAndTheDocumentedExitCode) {
    const TempDirectory directory;
    const std::string log = (directory.path / "log").string();
    const auto run = [&](std::vector<std::string> arguments) { return Process("lightloom", arguments, log).wait(); };
    EXPECT_EQ(run({"render", "no-such-scene.pbrt"}), 2);
    EXPECT_EQ(run({"render", kScene, "--algorithm", "no-such"}), 2);
    EXPECT_EQ(run({"render", kScene, "--algorithm", ""}), 2) << "not the default";
    EXPECT_EQ(run({"render", kScene, "--set", "no-such=1"}), 2);
    EXPECT_EQ(run({"render", kScene, "--set", "rr-min=1", "--set", "rr-min=0.5"}), 2);
    for (const char* seed : {"-1", " -1", "010", "18446744073709551616", "1.5"})
        EXPECT_EQ(run({"render", kScene, "--seed", seed}), 2) << seed;
    EXPECT_EQ(run({"render", kScene, "--time", "nan"}), 2);
    for (const char* threads : {"02", "0x2", "+2", "-1", "2.0", "0", "1025"})
        EXPECT_EQ(run({"render", kScene, "--threads", threads}), 2) << threads;
    EXPECT_EQ(run({"render", kScene, "--half", "-o", "own.exr", "--json", "own.float.manifest.json"}), 2) << "may be needed";
    EXPECT_EQ(run({"render", kScene, "-o", "/dev/null"}), 2) << "where would its manifest go?";
    EXPECT_EQ(run({"reference", kScene, "--spp", "1", "-o", "own.json"}), 2) << "its description would take its place";
    EXPECT_EQ(run({"replay", kScene, "--pixel", "1,1", "--iteration", "5", "--spp", "2"}), 2);
    const auto serve = [&](std::vector<std::string> arguments) { return Process("lightloom-server", arguments, log).wait(); };
    EXPECT_EQ(serve({"--listen", "127.0.0.1"}), 2);
    EXPECT_EQ(serve({"--status", "127.0.0.1:94x"}), 2);
    EXPECT_EQ(serve({"--listen", "0.0.0.0:0"}), 2) << "beyond loopback";
    EXPECT_EQ(serve({"--lease", "nan"}), 2);
    EXPECT_EQ(serve({"--listen", "127.0.0.1:0", "--status", "a.name:0", "--allow-plaintext", "--data",
                     (directory.path / "data").string()}),
              2)
        << "of a host, not an address";
    EXPECT_EQ(serve({"--threads", "02"}), 2);
    EXPECT_EQ(Process("lightloom-worker", {"--threads", "0x2"}, log).wait(), 2);
    EXPECT_EQ(run({"render", kScene, "--resolution", "12"}), 2);
    EXPECT_EQ(run({"render", kScene, "--spp", "1", "--time", "1"}), 2);
    EXPECT_EQ(run({"render", kScene, "--exposure", "1"}), 2) << "of which picture?";
    for (const char* later : {"--half", "-o=x.exr", "--png=x.png", "--json=x.json"})
        EXPECT_EQ(run({"submit", kScene, "--detach", later}), 2) << later;
    EXPECT_EQ(run({"no-such-command"}), 2);
    EXPECT_EQ(run({"list", "--server", "127.0.0.1:1"}), 4);
    EXPECT_EQ(run({"--help"}), 0);
    EXPECT_EQ(run({"algorithms"}), 0);
    EXPECT_EQ(run({"replay", kScene, "--algorithm", "bdpt", "--iteration", "3", "--pixel", "10,10"}), 0);
    EXPECT_EQ(run({"replay", kScene, "--algorithm", "bdpt", "--pixel", "5,3x"}), 2);
    EXPECT_EQ(run({"replay", kScene, "--algorithm", "bdpt", "--pixel", "010,3"}), 2);
    EXPECT_EQ(run({"replay", kScene, "--algorithm", "bdpt", "--unit", "00,0"}), 2);
    EXPECT_EQ(run({"replay", kScene, "--algorithm", "bdpt", "--unit", "4000000000,0"}), 2);
    EXPECT_EQ(run({"replay", kScene, "--algorithm", "bdpt", "--iteration", "4000000000", "--pixel", "1,1"}), 2);
    EXPECT_FALSE(std::filesystem::exists("cornell.exr"));
    // No output takes the place of the scene, of another output, or of a device; one behind a link is replaced there.
    const auto at = [&](const char* name) { return (directory.path / name).string(); };
    const std::string source = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/furnace-sphere.pbrt";  // which includes no file
    std::filesystem::copy_file(source, at("own.pbrt"));
    const auto render = [&](std::vector<std::string> more) {
        std::vector<std::string> arguments{"render", at("own.pbrt"), "--spp", "1", "--resolution", "8x8", "-q"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run(arguments);
    };
    EXPECT_EQ(render({"-o", at("own.pbrt")}), 2);
    EXPECT_EQ(render({"-o", at("x.exr"), "--png", at("x.exr")}), 2);
    EXPECT_EQ(*digest_file(at("own.pbrt")), *digest_file(source));
    std::ofstream(at("behind.json")) << "before";
    std::filesystem::create_symlink("behind.json", at("link.json"));
    EXPECT_EQ(render({"-o", at("x.exr"), "--png", "/dev/null", "--json", at("link.json")}), 0);
    EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
    EXPECT_TRUE(std::filesystem::is_symlink(at("link.json")));
    EXPECT_GT(std::filesystem::file_size(at("behind.json")), 100u);
}

}  // namespace
}  // namespace lightloom
