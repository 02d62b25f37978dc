#pragma once
// Guarded: a value behind a mutex. There is no way to the value but through a Guarded::Access, which holds the mutex, so that a
// function that takes a reference to the value says by that alone that its caller holds the lock.

#include <condition_variable>
#include <mutex>
#include <utility>

#include "server/thread_safety.h"

namespace lightloom {

/// std::mutex with the attributes of the analysis.
class LL_CAPABILITY("mutex") Mutex {
  public:
    void lock() LL_ACQUIRE() { mutex_.lock(); }
    void unlock() LL_RELEASE() { mutex_.unlock(); }

  private:
    std::mutex mutex_;
};

/// Holds a mutex for as long as it lives.
class LL_SCOPED_CAPABILITY MutexLock {
  public:
    explicit MutexLock(Mutex& mutex) LL_ACQUIRE(mutex) : mutex_(mutex) { mutex.lock(); }
    ~MutexLock() LL_RELEASE() { mutex_.unlock(); }
    MutexLock(const MutexLock&) = delete;
    MutexLock& operator=(const MutexLock&) = delete;

  private:
    Mutex& mutex_;
};

template <class T>
class Guarded {
  public:
    template <class... Values>
    explicit Guarded(Values&&... values) : value_(std::forward<Values>(values)...) {}

    class LL_SCOPED_CAPABILITY Access {
      public:
        explicit Access(Guarded& guarded) LL_ACQUIRE(guarded.mutex_) : guarded_(guarded) {
            guarded.mutex_.lock();
            value_ = &guarded.value_;
        }
        ~Access() LL_RELEASE() { guarded_.mutex_.unlock(); }
        Access(const Access&) = delete;
        Access& operator=(const Access&) = delete;

        T& operator*() const { return *value_; }
        T* operator->() const { return value_; }
        /// Gives the lock back while it waits. May return early, as condition variables do.
        template <class Clock, class Duration>
        void wait_until(std::condition_variable_any& condition, std::chrono::time_point<Clock, Duration> until) {
            condition.wait_until(guarded_.mutex_, until);
        }

      private:
        Guarded& guarded_;
        T* value_ = nullptr;
    };

  private:
    Mutex mutex_;
    T value_ LL_GUARDED_BY(mutex_);
};

}  // namespace lightloom
