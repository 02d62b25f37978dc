#pragma once
// A parallel loop whose fork and join a race detector can see. Linux distributions ship TBB without instrumentation,
// but its templates are compiled with our code: ThreadSanitizer sees one thread write a task and another run it, but
// not the atomics that hand the task over. In builds with ThreadSanitizer, and only there, the loop runs on threads of
// its own, whose start and end the detector sees. In both cases the calls of the body are unordered, so that a race
// between two of them is found.

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cstddef>

#ifdef __SANITIZE_THREAD__
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>
#endif

namespace lightloom {

/// Calls body(begin, end) for disjoint parts of [0, count), in any order, on as many threads as the caller's arena has;
/// returns when all calls are done.
template <class Body>
void fork_join(size_t count, const Body& body) {
#ifdef __SANITIZE_THREAD__
    std::atomic<size_t> next{0};
    const auto run = [&] {
        for (size_t i; (i = next.fetch_add(1, std::memory_order_relaxed)) < count;) body(i, i + 1);
    };
    std::vector<std::thread> threads;
    for (size_t i = 1; i < std::min(count, size_t(tbb::this_task_arena::max_concurrency())); ++i) threads.emplace_back(run);
    run();
    for (std::thread& thread : threads) thread.join();
#else
    tbb::parallel_for(tbb::blocked_range<size_t>(0, count),
                      [&body](const tbb::blocked_range<size_t>& part) { body(part.begin(), part.end()); });
#endif
}

}  // namespace lightloom
