// How many results a second the store acknowledges, each of them on disk by then, and how long it takes to open it again.
//
//   store_commits FOLDER [RESULTS [BYTES]]       default: 10000 results of 2000 bytes; FOLDER must not be there

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <thread>
#include <vector>

#include "server/store/store.h"

namespace {

using namespace lightloom;

double seconds_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

void require(const Status& status) {
    if (status.ok()) return;
    std::fprintf(stderr, "store_commits: %s\n", status.message().c_str());
    std::exit(1);
}

std::unique_ptr<JobStore> open(const std::filesystem::path& folder) {
    auto store = JobStore::open({.directory = folder});
    require(store.status());
    return *std::move(store);
}

void measure(const std::filesystem::path& folder, uint32_t threads, uint32_t results, size_t bytes) {
    const auto store = open(folder);
    const std::string job = std::string("threads-").append(std::to_string(threads));
    require(store->put_job({.id = job, .request_id = job}).get());
    const uint64_t before = store->batches();
    const auto begin = std::chrono::steady_clock::now();
    {
        std::vector<std::jthread> senders;
        for (uint32_t t = 0; t < threads; ++t)
            senders.emplace_back([&, t] {
                const std::string payload(bytes, 'x');
                for (uint32_t i = t; i < results; i += threads)
                    require(store->put_result(job, {.unit = {i, 0}, .worker = t, .who = "worker", .payload = payload}));
            });
    }
    const double seconds = seconds_since(begin);
    std::printf("| %u | %.0f | %.1f | %.2f |\n", threads, results / seconds, results / double(store->batches() - before),
                1e3 * seconds * threads / results);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2 || std::filesystem::exists(argv[1])) {
        std::fprintf(stderr, "usage: store_commits FOLDER [RESULTS [BYTES]], where FOLDER is not there\n");
        return 2;
    }
    const auto results = uint32_t(argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 10000);
    const size_t bytes = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 2000;
    std::printf("| threads | results/s | in a transaction | ms until one is on disk |\n|---|---|---|---|\n");
    for (const uint32_t threads : {1, 4, 16, 64}) measure(argv[1], threads, results, bytes);
    const auto begin = std::chrono::steady_clock::now();
    const auto store = open(argv[1]);
    const double opened = seconds_since(begin);
    const auto jobs = store->load();
    require(jobs.status());
    std::printf("opened again in %.0f ms, loaded in %.0f ms\n", 1e3 * opened, 1e3 * (seconds_since(begin) - opened));
    return 0;
}
