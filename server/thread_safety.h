#pragma once
// Names for the attributes of clang's thread-safety analysis, which deploy/thread_safety.sh runs over the coordinator. Other
// compilers see nothing.

#if defined(__clang__)
#define LL_THREAD_ATTRIBUTE(x) __attribute__((x))
#else
#define LL_THREAD_ATTRIBUTE(x)
#endif

/// A class that is a lock.
#define LL_CAPABILITY(name) LL_THREAD_ATTRIBUTE(capability(name))
/// A class that holds a lock for as long as it lives.
#define LL_SCOPED_CAPABILITY LL_THREAD_ATTRIBUTE(scoped_lockable)
/// A member that is touched only while that lock is held.
#define LL_GUARDED_BY(mutex) LL_THREAD_ATTRIBUTE(guarded_by(mutex))
/// A function whose caller holds the lock, or must not hold it.
#define LL_REQUIRES(...) LL_THREAD_ATTRIBUTE(requires_capability(__VA_ARGS__))
#define LL_EXCLUDES(...) LL_THREAD_ATTRIBUTE(locks_excluded(__VA_ARGS__))
/// A function that takes or gives back the lock.
#define LL_ACQUIRE(...) LL_THREAD_ATTRIBUTE(acquire_capability(__VA_ARGS__))
#define LL_RELEASE(...) LL_THREAD_ATTRIBUTE(release_capability(__VA_ARGS__))
