#include "server/task_pool.h"

#include <utility>

namespace lightloom {

void TaskPool::run(std::function<void()> task) {
    take_ended();  // what it returns is joined here, without the lock
    const MutexLock lock(threads_mutex_);
    ended_.reserve(threads_.size() + 1);  // so that a thread that ends needs no memory
    const uint64_t number = next_++;
    std::jthread& thread = threads_[number];
    try {
        thread = std::jthread([this, number, run = std::move(task)] {
            run();
            const MutexLock end(threads_mutex_);
            ended_.push_back(number);
        });
    } catch (...) {
        threads_.erase(number);
        throw;
    }
}

std::vector<std::jthread> TaskPool::take_ended() {
    std::vector<std::jthread> threads;
    const MutexLock lock(threads_mutex_);
    threads.reserve(ended_.size());
    for (const uint64_t number : ended_) {
        const auto known = threads_.find(number);
        if (known == threads_.end()) continue;  // join() has it
        threads.push_back(std::move(known->second));
        threads_.erase(known);
    }
    ended_.clear();
    return threads;
}

void TaskPool::join() {
    for (;;) {
        std::map<uint64_t, std::jthread> threads;
        {
            const MutexLock lock(threads_mutex_);
            threads.swap(threads_);
        }
        if (threads.empty()) break;
        threads.clear();  // joins
        const MutexLock lock(threads_mutex_);
        ended_.clear();
    }
}

}  // namespace lightloom
