#pragma once
// TaskPool: threads that each do one thing and end. What a job takes long for (its scene, its tables, its image) runs here. There
// are as many threads as tasks, because tasks wait for workers; a thread that has ended is joined when the next one starts.

#include <cstdint>
#include <functional>
#include <map>
#include <thread>
#include <vector>

#include "server/guarded.h"

namespace lightloom {

class TaskPool {
  public:
    /// Waits for all tasks; whoever destroys the pool has told them to stop.
    ~TaskPool() { join(); }
    /// Runs `task`, which must not throw, on a thread of its own. Throws std::system_error or std::bad_alloc if there is none.
    void run(std::function<void()> task) LL_EXCLUDES(threads_mutex_);
    /// Waits until no task runs.
    void join() LL_EXCLUDES(threads_mutex_);

  private:
    /// Threads that have ended, or about to.
    std::vector<std::jthread> take_ended() LL_EXCLUDES(threads_mutex_);

    Mutex threads_mutex_;
    std::map<uint64_t, std::jthread> threads_ LL_GUARDED_BY(threads_mutex_);
    std::vector<uint64_t> ended_ LL_GUARDED_BY(threads_mutex_);
    uint64_t next_ LL_GUARDED_BY(threads_mutex_) = 0;
};

}  // namespace lightloom
