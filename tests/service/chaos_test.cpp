// What the kill loop is made of: plans that a seed repeats, a ledger that goes on, and programs that refuse a wrong crash point.

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/stat.h>

#include <set>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "tests/service/chaos/ledger.h"
#include "tests/service/chaos/plan.h"
#include "tests/service/process.h"
#include "tests/support/temp_directory.h"

namespace lightloom::chaos {
namespace {

using lightloom::testing::Process;
using lightloom::testing::TempDirectory;

std::string text_of(const Phase& phase) {
    std::string text =
        phase.kind + " " + std::to_string(phase.workers) + (phase.shared_cache ? " shared, " : ", ") + farm_name(phase) + "\n";
    for (const Round& round : phase.rounds) {
        text += to_text(round) + "\n";
        for (const Action& action : round.actions) text += to_text(action) + " " + std::to_string(action.place) + "\n";
    }
    return text;
}

TEST(ChaosPlan, IsAFunctionOfSeedAndNumber) {
    std::set<std::string> texts;
    for (const uint64_t seed : {1, 2})
        for (uint64_t number = 0; number < 40; ++number) {
            const std::string text = text_of(plan_phase(seed, number));
            EXPECT_EQ(text, text_of(plan_phase(seed, number)));
            texts.insert(text);
        }
    EXPECT_EQ(texts.size(), 80u) << "no two phases are the same";
}

TEST(ChaosPlan, EveryKindAndEveryCrashPointHasItsTurn) {
    std::set<std::string> kinds, labels;
    for (uint64_t number = 0; number < 200; ++number) {
        const Phase phase = plan_phase(7, number);
        kinds.insert(phase.kind);
        for (const Round& round : phase.rounds) {
            EXPECT_FALSE(round.jobs.empty());
            EXPECT_EQ(round.jobs.size(), round.attached.size());
            EXPECT_EQ(round.jobs.size(), round.endings.size());
            for (size_t i = 0; i < round.jobs.size(); ++i) EXPECT_FALSE(round.attached[i] && round.endings[i] != Ending::kComplete);
            double before = -1;
            for (const Action& action : round.actions) {
                EXPECT_GE(action.at, before);
                before = action.at;
                EXPECT_LT(action.worker, phase.workers);
                for (const std::string& crash : action.crashes) {
                    EXPECT_TRUE(arm_crash_point(crash).ok()) << crash;
                    labels.insert(crash.substr(0, crash.find(':')));
                }
            }
        }
    }
    EXPECT_TRUE(arm_crash_point("").ok());
    EXPECT_EQ(kinds.size(), phase_kinds().size());
    EXPECT_EQ(labels.size(), std::size(kCrashLabels));
}

TEST(ChaosLedger, GoesOnWhereItWasSaved) {
    const TempDirectory directory;
    const std::string file = directory.file("ledger.json");
    Ledger ledger = *Ledger::load(file);
    EXPECT_EQ(ledger.phases, 0u);
    ledger.phases = 3;
    ledger.next_phase = 41;
    ledger.crashes["server.after-merge"] = 2;
    ledger.digests["path"]["abc"] = 5;
    ledger.recoveries = {0.5, 1.5};
    ledger.violations = {"seed 1 phase 2: something"};
    ASSERT_TRUE(ledger.save(file).ok());
    const auto again = Ledger::load(file);
    ASSERT_TRUE(again.ok()) << again.status().message();
    EXPECT_EQ(again->next_phase, 41u);
    EXPECT_EQ(again->text(), ledger.text());
    EXPECT_EQ(again->labels_hit(2), 1u);
    for (const char* wrong : {"", "[]", "{}", "{\"phases\": \"three\"}"}) {
        ASSERT_TRUE(write_file_atomically(file, wrong).ok());
        EXPECT_EQ(Ledger::load(file).status().code(), StatusCode::kInvalidArgument) << wrong;
    }
}

TEST(Programs, OutliveTheReaderOfTheirLog) {
    const TempDirectory directory;
    const std::string pipe = directory.file("pipe"), ports = directory.file("ports");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    const int reader = ::open(pipe.c_str(), O_RDWR | O_CLOEXEC);
    Process server("lightloom-server",
                   {"--listen", "127.0.0.1:0", "--status", "off", "--data", directory.file("data"), "--port-file", ports}, pipe);
    ASSERT_TRUE(lightloom::testing::wait_until(60, [&] { return std::filesystem::exists(ports); }));
    ::close(reader);
    server.signal(SIGTERM);  // of which it logs a line
    EXPECT_EQ(server.wait(), 0);
}

TEST(CrashPoints, AWrongLabelIsRefusedAtTheStart) {
    const TempDirectory directory;
    ::setenv(kCrashVariable, "server.job-acepted:2", 1);
    for (const char* program : {"lightloom-server", "lightloom-worker"}) {
        const std::string log = directory.file(program);
        EXPECT_EQ(Process(program, {}, log).wait(), 2) << program;
        EXPECT_EQ(*read_file(log), std::string(program) +
                                       ": LIGHTLOOM_CRASH_AT=server.job-acepted:2: no crash point has the label "
                                       "\"server.job-acepted\" (did you mean 'server.job-accepted'?); common/core/crash_point.h "
                                       "lists them\n");
    }
    ::unsetenv(kCrashVariable);
}

TEST(CrashPoints, ACoordinatorDiesWhereItIsTold) {
    const TempDirectory directory;
    ::setenv(kCrashVariable, "file.after-rename", 1);
    Process server(
        "lightloom-server",
        {"--listen", "127.0.0.1:0", "--status", "off", "--data", directory.file("data"), "--port-file", directory.file("ports")},
        directory.file("log"));
    ::unsetenv(kCrashVariable);
    EXPECT_EQ(server.wait(), 128 + SIGKILL);
    EXPECT_TRUE(std::filesystem::exists(directory.file("ports"))) << "the first file that it renames";
    EXPECT_NE(read_file(directory.file("log"))->find("LIGHTLOOM_CRASH_AT: killed at file.after-rename, pass 1\n"),
              std::string::npos);
}

}  // namespace
}  // namespace lightloom::chaos
