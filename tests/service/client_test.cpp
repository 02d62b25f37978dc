// The client's side of a job against a port that the test plays, and small things of the coordinator's process.

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/default_algorithm.h"
#include "client/run_job.h"
#include "common/cli/numbers.h"
#include "common/core/atomic_file.h"
#include "common/transport/catalog.h"
#include "server/data_lock.h"
#include "server/results.h"
#include "server/status_http.h"
#include "tests/service/fake.h"

namespace lightloom {
namespace {

using client::AfterFetch;
using testing::FakeService;
using testing::TempDirectory;
using Json = nlohmann::json;

TEST(CommandLine, NumbersAreDecimalAndInRange) {
    const auto accepts = [](const cli::Check& check, const std::string& text) { return check.find_fault(text).empty(); };
    const cli::Check whole = whole_number_between(1, 1024), real = number_between(-30, 2592000);
    for (const char* text : {"1", "10", "1024"}) EXPECT_TRUE(accepts(whole, text)) << text;
    for (const char* text : {"", "0", "1025", "010", "0x10", "+1", "-1", " 1", "1 ", "1.0", "1e2", "nan", "18446744073709551617"})
        EXPECT_FALSE(accepts(whole, text)) << text;
    for (const char* text : {"0", "-1.5", ".5", "+1", "+.5", "1e3", "010", "-30", "2592000"})
        EXPECT_TRUE(accepts(real, text)) << text;
    for (const char* text : {"", "+", "+-1", "++1", "nan", "inf", "-30.01", "2592001", "1x", "0x10", "1,5"})
        EXPECT_FALSE(accepts(real, text)) << text;
    EXPECT_TRUE(accepts(whole_number(), "0"));
    EXPECT_TRUE(accepts(whole_number(), "18446744073709551615"));
    EXPECT_EQ(real.find_fault("3e6"), "\"3e6\" is no number from -30 to 2592000");
}

TEST(DefaultAlgorithm, IsTheScenesIntegratorAsFarAsTheCatalogHasIt) {
    const auto chosen = [](const std::string& integrator) { return client::default_algorithm(integrator).name; };
    EXPECT_EQ(chosen("path"), "path");
    EXPECT_EQ(chosen("volpath"), "path");
    EXPECT_EQ(chosen("bdpt"), "bdpt");
    EXPECT_EQ(chosen("lightpath"), "light");
    for (const char* other : {"", "mlt", "sppm", "simplepath", "simplevolpath", "randomwalk", "light", "spcbpt"})
        EXPECT_EQ(chosen(other), "bdpt") << other;
    const auto says = [](const std::string& integrator, const std::string& reason) {
        EXPECT_EQ(client::default_algorithm(integrator).reason, reason);
        EXPECT_TRUE(find_algorithm(client::default_algorithm(integrator).name).ok()) << "what else would render it?";
    };
    says("volpath", "the scene's Integrator \"volpath\" asks for path; --algorithm overrides");
    says("lightpath", "the scene's Integrator \"lightpath\" asks for light; --algorithm overrides");
    says("sppm", "no algorithm for the scene's Integrator \"sppm\": rendering with bdpt; --algorithm overrides");
    says("", "the scene names no Integrator: rendering with bdpt; --algorithm overrides");
}

TEST(Outputs, ThatAreLinksAreTriedOutWhereTheyPoint) {
    const TempDirectory directory;
    const auto path = [&](const char* name) { return directory.path / name; };
    client::JobOptions options;
    options.output = path("a.exr").string();
    const auto check = [&](const char* png) {
        options.png = path(png).string();
        return client::check_outputs(options, client::beside_image(options, AfterFetch::kImageGoes), nullptr);
    };
    std::filesystem::create_symlink("a.exr", path("same.png"));
    EXPECT_NE(check("same.png").message().find("same.png: is a link to nothing"), std::string::npos) << "it will be the image";
    std::ofstream(path("a.exr")) << "of an earlier render";
    EXPECT_NE(check("same.png").message().find("another output"), std::string::npos);
    std::filesystem::create_directory(path("elsewhere"));
    std::ofstream(path("elsewhere/b.png")) << "of an earlier render";
    std::filesystem::create_symlink("elsewhere/b.png", path("b.png"));
    EXPECT_TRUE(check("b.png").ok()) << check("b.png").message();
    std::filesystem::create_symlink("/proc/version", path("proc.png"));  // where not even root can make files
    EXPECT_EQ(check("proc.png").message().rfind(path("proc.png").string() + ": cannot be written", 0), 0u)
        << check("proc.png").message();
    size_t files = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(directory.path))
        files += std::filesystem::is_regular_file(entry.symlink_status());
    EXPECT_EQ(files, 2u) << "nothing is left of the trial";
}

TEST(Outputs, NeverTakeThePlaceOfAnInput) {
    const TempDirectory directory;
    const auto path = [&](const char* name) { return (directory.path / name).string(); };
    std::filesystem::create_directory(path("scene"));
    for (const char* name : {"scene/main.pbrt", "scene/sky.exr", "scene/inner.pbrt"}) std::ofstream(path(name)) << name;
    std::filesystem::create_directory_symlink("scene", path("link"));
    client::LocalScene scene;
    scene.directory = path("scene");
    scene.imported.files = {"main.pbrt", "sky.exr", "inner.pbrt"};
    const auto check = [&](const char* output, const char* png, const char* json) {
        client::JobOptions options;
        options.output = path(output), options.png = path(png), options.json = path(json);
        return client::check_outputs(options, client::beside_image(options, AfterFetch::kImageGoes), &scene).message();
    };
    EXPECT_EQ(check("scene/out.exr", "out.png", "out.json"), "");
    EXPECT_EQ(check("scene/sky.exr", "out.png", "out.json"),
              path("scene/sky.exr") + ": is an input, which would be lost; give another file name");
    EXPECT_NE(check("out.exr", "link/../scene/./main.pbrt", "out.json"), "");
    EXPECT_NE(check("out.exr", "out.png", "link/inner.pbrt"), "");
    EXPECT_NE(check("out.exr", "out.exr", "out.json").find("another output"), std::string::npos);
    EXPECT_NE(check("out.exr", "out.png", "out.manifest.json").find("another output"), std::string::npos);
    EXPECT_NE(check("out.png", "small.png", "out.json").find("the image is an EXR"), std::string::npos);
    for (const char* name : {"scene/main.pbrt", "scene/sky.exr", "scene/inner.pbrt"}) {
        std::string text;
        std::getline(std::ifstream(path(name)), text);
        EXPECT_EQ(text, name);
    }
}

/// A service that has one finished job, and whose submissions fail as the test says.
class PlayedPort final : public JobPort {
  public:
    Result<JobInfo> submit_job(const std::string& request_id, const JobSpec&, const JobLabel&, Reuse) override {
        request_ids.push_back(request_id);
        if (request_ids.size() <= refusals.size()) return refusals[request_ids.size() - 1];
        return job;
    }
    Result<JobInfo> get_job(const std::string&) override { return job; }
    Result<std::vector<JobInfo>> list_jobs() override { return std::vector<JobInfo>{job}; }
    Result<std::vector<WorkerStatus>> list_workers(double) override { return std::vector<WorkerStatus>(); }
    Result<JobInfo> cancel_job(const std::string&, OnCancel) override { return job; }
    Result<JobInfo> finish_job(const std::string&) override { return job; }
    Status watch_job(const std::string&, const std::function<void(const JobInfo&)>&, std::stop_token) override { return {}; }
    Result<std::string> image(const std::string&, ImageKind) override { return exr; }
    Result<Preview> preview(const std::string&, PreviewFormat, double) override { return Preview{exr, 1}; }
    Result<std::string> manifest(const std::string&, ManifestKind) override {
        return Json{{"image", {{"sha256", job.image_digest.hex()}, {"size_bytes", exr.size()}, {"colour", "float"}}}}.dump();
    }
    Result<std::vector<Digest>> find_missing(const std::vector<Digest>&) override { return std::vector<Digest>(); }
    Status upload(const Digest&, const std::filesystem::path&) override { return {}; }
    Status upload_bytes(const Digest&, std::string_view) override { return {}; }

    JobInfo job;
    std::string exr;
    std::vector<Status> refusals;
    std::vector<std::string> request_ids;
};

/// A 3 x 2 image whose pixel (1, 1) is `value`.
PlayedPort port_with_image(float value) {
    ExrImage image;
    image.frame = {3, 2, {0, 0, 3, 2}};
    image.color = {3, 2, std::vector<float>(18, 0.1f)};
    image.color.pixels[3 * 4 + 1] = value;
    image.layers.push_back({"variance", "RGB", std::vector<float>(18, 1e6f)});
    image.attributes = {{exr_attribute::kSeed, "7"}};
    PlayedPort port;
    port.exr = *encode_exr(image);
    port.job.job_id = "job-1";
    port.job.state = JobState::kSucceeded;
    port.job.image_digest = sha256(port.exr);
    return port;
}

client::JobOptions half_to(const std::filesystem::path& path) {
    client::JobOptions options;
    options.output = path.string();
    options.quiet = options.half = true;
    return options;
}

TEST(Client, HalfColoursAreMadeWhenTheImageIsFetched) {
    const TempDirectory directory;
    PlayedPort port = port_with_image(65504);
    ASSERT_EQ(client::fetch(port, port.job, half_to(directory.path / "a.exr"), {}, AfterFetch::kImageStays), client::kSuccess);
    const auto bytes = read_file((directory.path / "a.exr").string());
    ASSERT_TRUE(bytes.ok());
    const Json manifest = Json::parse(*read_file((directory.path / "a.manifest.json").string()));
    EXPECT_EQ(manifest["image"]["sha256"], sha256(*bytes).hex());
    EXPECT_EQ(manifest["image"]["size_bytes"], bytes->size());
    EXPECT_EQ(manifest["image"]["colour"], "half");
    EXPECT_EQ(manifest["image"]["float_sha256"], port.job.image_digest.hex());
    const auto image = decode_exr(*bytes, "a");
    ASSERT_TRUE(image.ok()) << image.status().message();
    EXPECT_EQ(image->color.pixels[13], 65504.0f);
    EXPECT_NE(image->color.pixels[0], 0.1f) << "a tenth is no half";
    EXPECT_NEAR(image->color.pixels[0], 0.1f, 1e-4f);
    ASSERT_TRUE(image->layer("variance"));
    EXPECT_EQ(image->layer("variance")->pixels[0], 1e6f);
    EXPECT_EQ(image->attribute(exr_attribute::kSeed), "7");
}

TEST(Client, AnImageBeyondHalfIsRefusedAndNotLost) {
    const TempDirectory directory;
    PlayedPort port = port_with_image(70000);
    const auto options = half_to(directory.path / "a.exr");
    ::testing::internal::CaptureStderr();
    EXPECT_EQ(client::fetch(port, port.job, options, {}, AfterFetch::kImageStays), client::kFailure);
    const std::string message = ::testing::internal::GetCapturedStderr();
    EXPECT_NE(message.find("pixel (1, 1) is 70000"), std::string::npos) << message;
    EXPECT_NE(message.find("`lightloom fetch job-1` without --half"), std::string::npos) << message;
    EXPECT_TRUE(std::filesystem::is_empty(directory.path));

    ::testing::internal::CaptureStderr();
    EXPECT_EQ(client::fetch(port, port.job, options, {}, AfterFetch::kImageGoes), client::kFailure);
    EXPECT_NE(::testing::internal::GetCapturedStderr().find("a.float.exr"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(directory.path / "a.exr"));
    EXPECT_EQ(*read_file((directory.path / "a.float.exr").string()), port.exr);
    EXPECT_TRUE(std::filesystem::exists(directory.path / "a.float.manifest.json"));
}

TEST(Client, SubmitsAgainUnderTheSameRequestWhenTheAnswerIsLost) {
    PlayedPort port = port_with_image(1);
    port.refusals = {{StatusCode::kDeadlineExceeded, "late"}, {StatusCode::kUnavailable, "gone"}};
    EXPECT_TRUE(client::submit(port, {}).ok());
    ASSERT_EQ(port.request_ids.size(), 3u);
    EXPECT_EQ(port.request_ids[0], port.request_ids[1]);
    EXPECT_EQ(port.request_ids[0], port.request_ids[2]);
    port.request_ids.clear();
    port.refusals = {invalid_argument("no")};
    EXPECT_EQ(client::submit(port, {}).status().code(), StatusCode::kInvalidArgument);
    EXPECT_EQ(port.request_ids.size(), 1u);
}

TEST(Results, ReplayCommandsAreOneShellCommand) {
    JobSpec spec;
    spec.frame = {4, 4, {0, 0, 4, 4}};
    spec.algorithm = testing::algorithm_of("path", {{"rr-start", "6"}});
    const std::string plain = replay_command(spec, "room/a-b.pbrt", {{0, 0}, {3, 6, false}});
    EXPECT_EQ(plain.find('\''), std::string::npos) << plain;
    EXPECT_NE(replay_command(spec, "a.pbrt", {{0, 0}, {3, 6, false}}, {"bump", "media"}).find(" --without bump,media --seed "),
              std::string::npos);
    const std::string scene = "my room; it's \"$HOME\" `x`.pbrt";
    const std::string command = "printf '%s|' " + replay_command(spec, scene, {{0, 0}, {3, 6, false}});
    FILE* shell = ::popen(command.c_str(), "r");
    ASSERT_TRUE(shell);
    std::string output(1000, '\0');
    output.resize(std::fread(output.data(), 1, output.size(), shell));
    EXPECT_EQ(::pclose(shell), 0);
    EXPECT_TRUE(output.starts_with(
        "lightloom|replay|" + scene +
        "|--algorithm|path|--set|heuristic=balance|--set|next-event=1|--set|roulette=albedo|--set|rr-min=0.7|--set|rr-start=6|"))
        << output;
}

TEST(DataLock, OneHolderAtATime) {
    const TempDirectory directory;
    {
        const auto first = DataLock::take(directory.path);
        ASSERT_TRUE(first.ok()) << first.status().message();
        const auto second = DataLock::take(directory.path);
        ASSERT_FALSE(second.ok());
        EXPECT_NE(second.status().message().find("--data"), std::string::npos) << second.status().message();
    }
    EXPECT_TRUE(DataLock::take(directory.path).ok());
    EXPECT_FALSE(DataLock::take(directory.path / "no-such").ok());
}

double cpu_seconds() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) { return double(t.tv_sec) + 1e-6 * double(t.tv_usec); };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

bool connect_to(int descriptor, int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return ::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

std::string healthz(int descriptor) {
    const std::string request = "GET /healthz HTTP/1.1\r\nHost: x\r\n\r\n";
    EXPECT_EQ(::send(descriptor, request.data(), request.size(), 0), ssize_t(request.size()));
    std::string answer(1000, '\0');
    answer.resize(size_t(std::max<ssize_t>(0, ::recv(descriptor, answer.data(), answer.size(), 0))));
    return answer;
}

TEST(StatusHttp, WithoutDescriptorsItWaitsInsteadOfSpinning) {
    FakeService service;
    const auto http = StatusHttp::start(*service.coordinator, "127.0.0.1:0");
    ASSERT_TRUE(http.ok()) << http.status().message();
    const int descriptor = ::socket(AF_INET, SOCK_STREAM, 0);
    rlimit saved{};
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &saved), 0);
    // No descriptor is left for the connection that the server would accept.
    rlimit none = saved;
    none.rlim_cur = 0;
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
    EXPECT_TRUE(connect_to(descriptor, (*http)->port()));
    const double before = cpu_seconds();
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    EXPECT_LT(cpu_seconds() - before, 0.25);
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &saved), 0);
    EXPECT_EQ(healthz(descriptor).substr(0, 15), "HTTP/1.1 200 OK") << "it goes on when there are descriptors again";
    ::close(descriptor);
}

}  // namespace
}  // namespace lightloom
