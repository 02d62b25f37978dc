#pragma once
// A parallel loop whose fork and join a race detector can see. Distributions ship TBB without instrumentation, so that
// ThreadSanitizer knows nothing of the hand-over from the caller to its tasks and back, and would report every body that
// reads what the caller wrote. The fences below say what TBB guarantees, and no more than that: the bodies of one loop stay
// unordered among themselves, so that a true race between two of them is still found. Without ThreadSanitizer this is
// tbb::parallel_for.

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cstddef>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace lightloom {

#ifdef __SANITIZE_THREAD__
namespace detail {

/// Lives inside TBB's tasks, which one thread writes and another reads: no access is recorded before the fence is passed.
template <class Body>
struct FencedBody {
    const Body* body;
    char* forked;
    char* joined;

    __attribute__((no_sanitize("thread"))) void operator()(const tbb::blocked_range<size_t>& part) const {
        __tsan_acquire(forked);
        (*body)(part.begin(), part.end());
        __tsan_release(joined);
    }
};

}  // namespace detail
#endif

/// body(begin, end) for disjoint parts of [0, count), in any order, on the threads of the caller's arena; returns when all
/// are done.
template <class Body>
void fork_join(size_t count, const Body& body) {
    const tbb::blocked_range<size_t> all(0, count);
#ifdef __SANITIZE_THREAD__
    char forked = 0, joined = 0;
    __tsan_release(&forked);
    tbb::parallel_for(all, detail::FencedBody<Body>{&body, &forked, &joined});
    __tsan_acquire(&joined);
#else
    tbb::parallel_for(all, [&body](const tbb::blocked_range<size_t>& part) { body(part.begin(), part.end()); });
#endif
}

}  // namespace lightloom
