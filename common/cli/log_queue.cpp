#include "common/cli/log_queue.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

namespace lightloom {

struct LogQueue::State {
    State(std::string name, size_t most, Write to) : program(std::move(name)), capacity(most), write(std::move(to)) {}

    void run();

    const std::string program;
    const size_t capacity;
    const Write write;
    std::mutex mutex;
    std::condition_variable filled, written;
    std::deque<std::string> lines;
    size_t lost = 0;       ///< Since the last line that told of it.
    bool writing = false;  ///< The thread holds lines that it has not written yet.
    bool closed = false;
};

void LogQueue::State::run() {
    std::unique_lock lock(mutex);
    for (;;) {
        filled.wait(lock, [&] { return closed || !lines.empty(); });
        if (lines.empty()) return;
        std::string line = std::move(lines.front());
        lines.pop_front();
        // What is lost was older than the line at the front.
        if (lost > 0)
            line = program + ": " + std::to_string(lost) + " line(s) of the log are lost, because nobody read them\n" + line;
        lost = 0;
        writing = true;
        lock.unlock();
        write(line);
        lock.lock();
        writing = false;
        if (lines.empty()) written.notify_all();
    }
}

// The thread is not joined: it may be blocked for good. It has a share in everything that it uses.
LogQueue::LogQueue(std::string program, size_t capacity, Write write)
    : state_(std::make_shared<State>(std::move(program), capacity, std::move(write))) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);  // signals are for threads of the program
    std::thread([state = state_] { state->run(); }).detach();
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

LogQueue::~LogQueue() {
    const std::lock_guard lock(state_->mutex);
    state_->closed = true;
    state_->filled.notify_one();
}

void LogQueue::push(std::string line) {
    const std::lock_guard lock(state_->mutex);
    if (state_->lines.size() >= state_->capacity) {
        state_->lines.pop_front();
        ++state_->lost;
    }
    state_->lines.push_back(std::move(line));
    state_->filled.notify_one();
}

bool LogQueue::flush(double seconds) {
    std::unique_lock lock(state_->mutex);
    return state_->written.wait_for(lock, std::chrono::duration<double>(seconds),
                                    [&] { return state_->lines.empty() && !state_->writing; });
}

void write_log_bytes(int file, std::string_view bytes) {
    while (!bytes.empty()) {
        const ssize_t count = ::write(file, bytes.data(), bytes.size());
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) return;
        bytes.remove_prefix(size_t(count));
    }
}

}  // namespace lightloom
