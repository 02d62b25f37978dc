// The queue between those who log and a log that may be blocked.
#include "common/cli/log_queue.h"

#include <gtest/gtest.h>

#include <future>
#include <mutex>

namespace lightloom {
namespace {

/// What was written, by a writer that can be held up. It outlives the test's queue, because a queue's thread may.
struct Paper {
    std::mutex mutex;
    std::string text;
    std::promise<void> begun, gate;
    std::shared_future<void> open = gate.get_future().share();
    bool first = true;

    void write(std::string_view bytes) {
        if (std::exchange(first, false)) begun.set_value();
        open.wait();
        const std::lock_guard lock(mutex);
        text += bytes;
    }
    std::string read() {
        const std::lock_guard lock(mutex);
        return text;
    }
};

LogQueue::Write onto(const std::shared_ptr<Paper>& paper) {
    return [paper](std::string_view bytes) { paper->write(bytes); };
}

TEST(LogQueue, WritesLinesInOrder) {
    const auto paper = std::make_shared<Paper>();
    paper->gate.set_value();
    LogQueue queue("program", 100, onto(paper));
    for (int i = 0; i < 50; ++i) queue.push(std::to_string(i) + "\n");
    EXPECT_TRUE(queue.flush(60));
    std::string all;
    for (int i = 0; i < 50; ++i) all += std::to_string(i) + "\n";
    EXPECT_EQ(paper->read(), all);
}

TEST(LogQueue, DropsTheOldestLinesOfABlockedLogAndTellsHowMany) {
    const auto paper = std::make_shared<Paper>();
    LogQueue queue("program", 3, onto(paper));
    queue.push("held\n");
    paper->begun.get_future().wait();
    for (int i = 0; i < 10; ++i) queue.push(std::to_string(i) + "\n");
    EXPECT_FALSE(queue.flush(0.01)) << "nobody has read";
    paper->gate.set_value();
    EXPECT_TRUE(queue.flush(60));
    EXPECT_EQ(paper->read(), "held\nprogram: 7 line(s) of the log are lost, because nobody read them\n7\n8\n9\n");
}

TEST(LogQueue, DoesNotWaitForABlockedLogWhenItGoes) {
    const auto paper = std::make_shared<Paper>();
    {
        LogQueue queue("program", 3, onto(paper));
        queue.push("held\n");
        paper->begun.get_future().wait();
        queue.push("left\n");
    }
    EXPECT_EQ(paper->read(), "");
    paper->gate.set_value();
}

}  // namespace
}  // namespace lightloom
