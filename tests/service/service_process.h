#pragma once
// A coordinator as a process, with workers and clients around it.

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "client/grpc_job_port.h"
#include "common/core/atomic_file.h"
#include "tests/service/fake.h"
#include "tests/service/process.h"

namespace lightloom::testing {

inline const std::string kScene = std::string(LIGHTLOOM_SOURCE_DIR) + "/tests/scenes/cornell.pbrt";

/// A coordinator and the files around it.
struct Service {
    explicit Service(std::vector<std::string> more = {}) {
        std::vector<std::string> arguments{"--listen",   "127.0.0.1:0", "--status",    "127.0.0.1:0", "--data",
                                           path("data"), "--port-file", path("ports"), "--lease",     "1"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        server = std::make_unique<Process>("lightloom-server", arguments, path("server.log"));
        EXPECT_TRUE(wait_until(60, [&] { return std::filesystem::exists(path("ports")); })) << log("server");
        std::ifstream(path("ports")) >> port >> status_port;
    }
    std::string path(const std::string& name) const { return (directory.path / name).string(); }
    std::string address() const { return "127.0.0.1:" + std::to_string(port); }
    std::string log(const std::string& name) const {
        const auto text = read_file(path(name + ".log"));
        return text.ok() ? *text : std::string();
    }
    std::unique_ptr<Process> worker(const std::string& name, int threads, std::vector<std::string> more = {}) const {
        std::vector<std::string> arguments{"--server", address(), "--threads", std::to_string(threads), "--cache", path("cache")};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return std::make_unique<Process>("lightloom-worker", arguments, path(name + ".log"));
    }
    std::unique_ptr<Process> submit(const std::string& name, std::vector<std::string> more) const {
        std::vector<std::string> arguments{"submit", kScene, "--server", address(), "-o", path(name + ".exr"), "-q", "--again"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return std::make_unique<Process>("lightloom", arguments, path(name + ".log"));
    }
    GrpcJobPort jobs() const { return GrpcJobPort(grpc::CreateChannel(address(), grpc::InsecureChannelCredentials())); }
    Digest digest(const std::string& name) const { return *digest_file(path(name + ".exr")); }
    nlohmann::json manifest(const std::string& name) const {
        return nlohmann::json::parse(*read_file(path(name + ".manifest.json")));
    }

    TempDirectory directory;
    std::unique_ptr<Process> server;
    int port = 0, status_port = 0;
};

/// Runs commands against a service, one after the other.
struct Client {
    explicit Client(const Service& s) : service(s) {}
    /// The exit code; what it printed is in `output`.
    int run(std::vector<std::string> arguments) {
        const std::string name = "command" + std::to_string(++runs);
        arguments.insert(arguments.end(), {"--server", service.address()});
        const int code = Process("lightloom", arguments, service.path(name + ".log")).wait();
        output = service.log(name);
        return code;
    }
    /// The id of a job that is submitted and not waited for.
    std::string submit(std::vector<std::string> more) {
        more.insert(more.begin(), {"submit", kScene, "--detach", "-q"});
        EXPECT_EQ(run(more), 0) << output;
        return output.substr(0, output.find('\n'));
    }
    bool printed(const std::string& text) const { return output.find(text) != std::string::npos; }

    const Service& service;
    std::string output;
    int runs = 0;
};

}  // namespace lightloom::testing
