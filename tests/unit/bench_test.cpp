// What a benchmark concludes from its measurements, and how its file survives a kill.

#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <filesystem>

#include "client/bench/reference_image.h"
#include "client/bench/results_file.h"
#include "client/bench/run_lines.h"
#include "client/bench/suite_table.h"
#include "common/core/atomic_file.h"

namespace {
int flock_error = 0;  ///< What the file system answers to locks, if not 0.
}  // namespace

/// Instead of the C library's.
extern "C" int flock(int file, int operation) noexcept {
    if (flock_error == 0) return int(::syscall(SYS_flock, file, operation));
    errno = flock_error;
    return -1;
}

namespace lightloom::client {
namespace {

std::vector<CurvePoint> square_root_law(double error_at_one, double seconds_per_iteration) {
    std::vector<CurvePoint> curve;
    for (const double n : {1., 2., 4., 10., 30., 100.})
        curve.push_back({n, n * seconds_per_iteration, error_at_one / std::sqrt(n)});
    return curve;
}

TEST(ErrorCurve, InterpolationIsExactOnAPowerLaw) {
    const auto crossing = find_crossing(square_root_law(60, 0.5), 12);  // (60 / 12)^2 = 25 iterations
    ASSERT_TRUE(crossing);
    EXPECT_EQ(crossing->kind, Crossing::Kind::kInterpolated);
    EXPECT_NEAR(crossing->iterations, 25, 1e-9);
    EXPECT_NEAR(crossing->seconds, 12.5, 1e-9);
}

TEST(ErrorCurve, APointOnTheThresholdIsTheCrossing) {
    const std::vector<CurvePoint> curve{{1, 2, 40}, {2, 4, 12}, {3, 6, 10}};
    EXPECT_DOUBLE_EQ(find_crossing(curve, 12)->iterations, 2);
}

TEST(ErrorCurve, TheCrossingIsTheOneAfterWhichTheErrorStaysBelow) {
    const std::vector<CurvePoint> curve{{1, 1, 20}, {10, 10, 11}, {12, 12, 14}, {100, 100, 5}};
    const double n = find_crossing(curve, 12)->iterations;
    EXPECT_GT(n, 12);
    EXPECT_LT(n, 100);
}

TEST(ErrorCurve, AnErrorThatRisesFirstIsNeitherReachedNorExtrapolatedAsIfItFell) {
    // Nearly black, hence nearly right, until the first bright paths are found.
    std::vector<CurvePoint> curve{{1, 1, 11}, {2, 2, 13}, {4, 4, 15}, {8, 8, 19}};
    auto crossing = find_crossing(curve, 12);
    EXPECT_EQ(crossing->kind, Crossing::Kind::kExtrapolated);
    EXPECT_TRUE(crossing->lower_bound);
    EXPECT_GT(*final_slope(curve), 0);
    for (const double n : {100., 150., 225., 337.}) curve.push_back({n, n, 300 / std::sqrt(n)});
    crossing = find_crossing(curve, 12);
    EXPECT_EQ(crossing->kind, Crossing::Kind::kExtrapolated);
    EXPECT_FALSE(crossing->lower_bound);
    EXPECT_NEAR(*final_slope(curve), -0.5, 1e-9);
    EXPECT_FALSE(final_slope({curve.data(), 2}));
}

TEST(ErrorCurve, AnEasySceneIsReachedAtMostAtItsFirstPoint) {
    const auto crossing = find_crossing(square_root_law(5, 2), 12);
    ASSERT_TRUE(crossing);
    EXPECT_EQ(crossing->kind, Crossing::Kind::kAtMost);
    EXPECT_EQ(crossing->iterations, 1);
    EXPECT_EQ(crossing->seconds, 2);
}

TEST(ErrorCurve, ExtrapolationFollowsTheSquareRootLaw) {
    const auto crossing = find_crossing(square_root_law(240, 0.5), 12);  // (240 / 12)^2 = 400
    ASSERT_TRUE(crossing);
    EXPECT_EQ(crossing->kind, Crossing::Kind::kExtrapolated);
    EXPECT_NEAR(crossing->iterations, 400, 1e-9);
    EXPECT_NEAR(crossing->seconds, 200, 1e-9);
}

TEST(ErrorCurve, NoPointsAndNoErrorAreHandled) {
    EXPECT_FALSE(find_crossing({}, 12));
    const std::vector<CurvePoint> exact{{1, 1, 20}, {2, 2, 0}};
    EXPECT_EQ(find_crossing(exact, 12)->iterations, 2);
}

TEST(ErrorCurve, CheckpointsGrowGeometrically) {
    std::vector<double> n{1};
    while (n.back() < 1000) n.push_back(next_checkpoint(n.back()));
    EXPECT_EQ((std::vector<double>(n.begin(), n.begin() + 8)), (std::vector<double>{1, 2, 3, 4, 5, 7, 9, 12}));
    for (size_t i = 8; i < n.size(); ++i) EXPECT_NEAR(n[i] / n[i - 1], 1.25, 0.1);
}

TEST(AlgorithmChoice, ParsesSettingsAndNamesMistakes) {
    const auto choice = parse_algorithm("bdpt:rr-start=6:heuristic=power");
    ASSERT_TRUE(choice.ok()) << choice.status().message();
    EXPECT_EQ(choice->settings.name(), "bdpt");
    EXPECT_EQ(choice->settings.named_text(), (std::map<std::string, std::string>{{"emission", "power"},
                                                                                 {"heuristic", "power"},
                                                                                 {"next-event", "1"},
                                                                                 {"roulette", "albedo"},
                                                                                 {"rr-min", "0.5"},
                                                                                 {"rr-start", "6"},
                                                                                 {"shadow-rays", "1"},
                                                                                 {"techniques", "all"},
                                                                                 {"training-paths", "100000"}}));
    EXPECT_EQ(choice->label, "bdpt:rr-start=6:heuristic=power");
    EXPECT_TRUE(parse_algorithm("path").ok());
    for (const char* wrong : {"", "no-such", "bdpt:", "bdpt:=1", "bdpt:heuristic", "bdpt:heuristic=9", "bdpt:heuristic=powr",
                              "bdpt:no-such=1", "bdpt:heuristic=power:heuristic=maximum"}) {
        const auto refused = parse_algorithm(wrong);
        ASSERT_FALSE(refused.ok()) << wrong;
        EXPECT_EQ(refused.status().code(), StatusCode::kInvalidArgument) << wrong;
        EXPECT_FALSE(refused.status().message().empty());
    }
}

/// Values may have commas, too.
TEST(AlgorithmChoice, ListsAreSplitBetweenAlgorithms) {
    using Words = std::vector<std::string>;
    EXPECT_EQ(split_algorithms("path"), Words{"path"});
    EXPECT_EQ(split_algorithms("path,spcbpt:connections=5,2,lvcbpt:connections=1,4:cache=8,bdpt"),
              (Words{"path", "spcbpt:connections=5,2", "lvcbpt:connections=1,4:cache=8", "bdpt"}));
    EXPECT_EQ(split_algorithms("path,,bdpt,"), (Words{"path", "", "bdpt", ""}));
    EXPECT_EQ(parse_algorithm("spcbpt:connections=5,2")->settings.named_text().at("connections"), "5,2");
    for (const AlgorithmInfo* row : catalog()) EXPECT_FALSE(row->name[0] >= '0' && row->name[0] <= '9') << row->name;
}

BenchRun some_run() {
    BenchRun run;
    run.scene_digest = "s", run.reference_digest = "r", run.algorithm = *parse_algorithm("bdpt:heuristic=power"),
    run.algorithm.label = "", run.build = "b";
    run.width = 160, run.height = 90, run.max_depth = 10, run.budget.seconds = 60;
    return run;
}

TEST(BenchRun, EveryFieldEntersTheKey) {
    std::vector<BenchRun> runs(18, some_run());
    runs[1].scene_digest = "t";
    runs[2].reference_digest = "t";
    runs[3].algorithm.settings = parse_algorithm("path:heuristic=power")->settings;
    runs[4].algorithm.settings = runs[4].algorithm.settings.with("heuristic", 2);
    runs[5].width = 161;
    runs[6].height = 91;
    runs[7].max_depth = 11;
    runs[8].seed = 1;
    runs[9].threads = 2;
    runs[10].budget.seconds = 61;
    runs[11].budget.samples = 5;
    runs[12].threshold = 10;
    runs[13].stop_after = 0;
    runs[14].build = "c";
    runs[15].scene = "another name";
    runs[16].tables = "shared";
    runs[17].server = "host:1";
    std::set<std::string> keys;
    for (const BenchRun& run : runs) keys.insert(run.key());
    EXPECT_EQ(keys.size(), runs.size());
    EXPECT_EQ(some_run().key(), runs[0].key());
}

constexpr const char* kStart = "{\"type\":\"start\",\"format\":\"lightloom-bench 2\",\"suite\":\"s\",\"suite_seconds\":3}\n";
constexpr const char* kEndOfA = "{\"type\":\"run\",\"run\":\"a\",\"iterations\":2,\"suite_seconds\":7}\n";

TEST(BenchHistory, ResumeKeepsFinishedRunsAndForgetsBegunOnes) {
    const std::string finished = std::string("{\"type\":\"checkpoint\",\"run\":\"a\",\"iterations\":1}\n") + kEndOfA;
    const std::string begun = "{\"type\":\"checkpoint\",\"run\":\"b\",\"iterations\":1,\"suite_seconds\":9}\n";
    const std::string shares = "{\"type\":\"techniques\",\"scene\":\"x\",\"label\":\"bdpt\"}\n";
    const auto history = parse_history(kStart + begun + finished + shares, "f");
    ASSERT_TRUE(history.ok()) << history.status().message();
    EXPECT_EQ(history->kept, kStart + finished + shares);
    ASSERT_EQ(history->done.size(), 1u);
    EXPECT_EQ(history->done.at("a")["iterations"], 2);
    EXPECT_EQ(history->suite, "s");
    EXPECT_EQ(history->suite_seconds, 9) << "the begun run took its time, too";
    EXPECT_EQ(history->shares, std::set<std::string>{"x\nbdpt"});
    // A run that was measured again and had not ended keeps what it had; one that had, replaces it.
    const std::string more = "{\"type\":\"checkpoint\",\"run\":\"a\",\"iterations\":4}\n";
    const std::string end = "{\"type\":\"run\",\"run\":\"a\",\"iterations\":9}\n";
    EXPECT_EQ(parse_history(kStart + finished + more, "f")->kept, kStart + finished);
    EXPECT_EQ(parse_history(kStart + finished + more + end, "f")->kept, kStart + more + end);
    // Another key of the same name, as after a new reference.
    EXPECT_EQ(parse_history(R"({"type":"run","run":"a","seed":1})"
                            "\n"
                            R"({"type":"run","run":"b","seed":1})",
                            "f")
                  ->kept,
              "{\"type\":\"run\",\"run\":\"b\",\"seed\":1}\n");
}

TEST(BenchHistory, ATornLastLineIsIgnoredWhereverItIsCut) {
    const std::string whole = kEndOfA;
    const std::string last = "{\"type\":\"run\",\"run\":\"b\",\"seed\":2,\"iterations\":7}\n";
    for (size_t cut = 0; cut + 2 < last.size(); ++cut) {
        const auto history = parse_history(whole + last.substr(0, cut), "f");
        ASSERT_TRUE(history.ok()) << cut;
        EXPECT_EQ(history->kept, whole) << cut;
        EXPECT_EQ(history->done.size(), 1u) << cut;
        EXPECT_EQ(history->torn, cut > 0) << cut;
    }
    // Only the newline is missing: nothing of the line is.
    EXPECT_EQ(parse_history(whole + last.substr(0, last.size() - 1), "f")->kept, whole + last);
}

TEST(BenchHistory, AFileOfSomethingElseIsLeftAlone) {
    for (const std::string text :
         {"my only notes\n", "my only notes", "{\"type\":\n", "{}\n", "{\"a\":1}", "{\"a\":1", "{ my notes"})
        EXPECT_EQ(parse_history(text, "notes").status().code(), StatusCode::kInvalidArgument) << text;
}

TEST(BenchHistory, DamageElsewhereIsNamed) {
    for (const std::string damaged : {"{\"type\":\"run\",", "[]", "17", "{\"run\":\"a\"}", "{\"type\":\"run\",\"run\":3}",
                                      "{\"type\":\"start\",\"format\":\"lightloom-bench 9\"}"}) {
        const auto history = parse_history(kEndOfA + damaged + "\n" + kEndOfA, "runs.jsonl");
        ASSERT_FALSE(history.ok()) << damaged;
        EXPECT_NE(history.status().message().find("runs.jsonl:2"), std::string::npos) << history.status().message();
    }
}

TEST(BenchWriter, LinesAreReadBack) {
    const std::string path = (std::filesystem::temp_directory_path() / ("bench-writer-" + std::to_string(::getpid()))).string();
    {
        auto writer = BenchWriter::open(path, false);
        ASSERT_TRUE(writer.ok()) << writer.status().message();
        ASSERT_TRUE(writer->append({{"type", "run"}, {"run", "x"}}).ok());
        EXPECT_EQ(parse_history(*writer->text(), path)->done.size(), 1u);
        ASSERT_TRUE(writer->replace(kEndOfA).ok());
        ASSERT_TRUE(writer->append({{"type", "run"}, {"run", "b"}, {"seed", 2}}).ok());
    }
    EXPECT_EQ(parse_history(*read_file(path), path)->done.size(), 2u);
    EXPECT_NE(BenchWriter::open(path, false).status().message().find("--resume"), std::string::npos);
    std::filesystem::remove(path);
    for (const bool resume : {false, true}) EXPECT_FALSE(BenchWriter::open("/no/such/directory/file", resume).ok());
}

/// Two processes that both go on with it would lose what the first one finishes.
TEST(BenchWriter, AFileHasOneWriterUnderAllOfItsNames) {
    const std::filesystem::path directory =
        std::filesystem::temp_directory_path() / ("bench-writers-" + std::to_string(::getpid()));
    std::filesystem::create_directory(directory);
    const std::string path = directory / "a.jsonl", link = directory / "link.jsonl";
    std::filesystem::create_symlink("a.jsonl", link);
    const auto refused = [](const std::string& name) {
        return BenchWriter::open(name, true).status().message().find("another bench") != std::string::npos;
    };
    {
        auto first = BenchWriter::open(path, true);
        ASSERT_TRUE(first.ok()) << first.status().message();
        EXPECT_TRUE(refused(path));
        ASSERT_TRUE(first->replace("").ok());
        EXPECT_TRUE(refused(path)) << "the new file is locked, too";
        EXPECT_TRUE(refused(link));
    }
    auto second = BenchWriter::open(link, true);
    ASSERT_TRUE(second.ok()) << second.status().message();
    ASSERT_TRUE(second->replace("").ok());
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    EXPECT_TRUE(refused(path));
    size_t files = 0;
    for ([[maybe_unused]] const auto& item : std::filesystem::directory_iterator(directory)) ++files;
    EXPECT_EQ(files, 2u) << "nothing else is left there";
    std::filesystem::remove_all(directory);
}

TEST(BenchWriter, GoesOnUnlockedWhereThereAreNoLocks) {
    const std::string path = (std::filesystem::temp_directory_path() / ("bench-unlocked-" + std::to_string(::getpid()))).string();
    for (const int error : {ENOSYS, EOPNOTSUPP, ENOLCK, EIO}) {
        flock_error = error;
        ::testing::internal::CaptureStderr();
        auto writer = BenchWriter::open(path, true);
        EXPECT_EQ(writer.ok(), error != EIO);
        if (writer.ok()) {
            EXPECT_TRUE(writer->replace("").ok());
            EXPECT_TRUE(writer->append({{"type", "run"}, {"run", "x"}}).ok());
            EXPECT_EQ(parse_history(*writer->text(), path)->done.size(), 1u);
        }
        const std::string warning = ::testing::internal::GetCapturedStderr();
        EXPECT_EQ(warning.find("cannot be locked") != std::string::npos, error != EIO) << warning;
        EXPECT_EQ(std::count(warning.begin(), warning.end(), '\n'), error != EIO) << warning;
    }
    flock_error = 0;
    std::filesystem::remove(path);
}

Json finished(const std::string& label, double preparation, const std::vector<CurvePoint>& curve) {
    Json line{{"label", label},
              {"iterations", curve.back().iterations},
              {"seconds", curve.back().seconds},
              {"preparation_seconds", preparation}};
    add_crossing(line, curve, 12);
    return line;
}

TEST(BenchTable, ShowsMediansPreparationAndRatios) {
    std::vector<Json> done;
    for (const double error : {48., 60., 120.}) done.push_back(finished("slow", 0, square_root_law(error, 1)));
    for (const double error : {24., 24., 36.}) done.push_back(finished("fast:m=2", 1, square_root_law(error, 1)));
    const std::string table = threshold_table({"slow", "fast:m=2"}, done, 12);
    // 25 iterations against 4; 25 s against 4 + 1 s.
    EXPECT_NE(table.find("slow          3      0         25.0      25.00       0.00      25.00        1.00        1.00"),
              std::string::npos)
        << table;
    EXPECT_NE(table.find("fast:m=2      3      0          4.0       4.00       1.00       5.00        6.25        5.00"),
              std::string::npos)
        << table;
    EXPECT_EQ(table.find('~'), std::string::npos) << table;
}

TEST(BenchTable, MarksPreparationThatWasNotMeasured) {
    std::vector<Json> done{finished("made", 1, square_root_law(24, 1)), finished("found", 1, square_root_law(24, 1))};
    EXPECT_EQ(threshold_table({"made", "found"}, done, 12).find('*'), std::string::npos);
    done[0]["tables"] = "made";
    done[1]["tables"] = "cached";
    const std::string table = threshold_table({"made", "found"}, done, 12);
    EXPECT_NE(table.find("found         1      0          4.0       4.00      *1.00       5.00"), std::string::npos) << table;
    EXPECT_NE(table.find("made          1      0          4.0       4.00       1.00       5.00"), std::string::npos) << table;
    EXPECT_NE(table.find("* as recorded"), std::string::npos) << table;
}

TEST(BenchTable, MarksWhatIsExtrapolated) {
    const std::vector<Json> done{finished("path", 0, square_root_law(60, 1)), finished("path", 0, square_root_law(240, 1)),
                                 finished("path", 0, square_root_law(360, 1))};
    EXPECT_TRUE(done[1]["capped"].get<bool>());
    EXPECT_FALSE(done[1].contains("reached"));
    EXPECT_DOUBLE_EQ(done[1]["extrapolated"]["iterations"].get<double>(), 400);
    const std::string table = threshold_table({"path", "none"}, done, 12);
    EXPECT_NE(table.find("~400.0"), std::string::npos) << table;
    EXPECT_NE(table.find("> 100 iterations, > 100.00 s"), std::string::npos) << table;
    EXPECT_NE(table.find("~ extrapolated"), std::string::npos) << table;
}

ExrImage grey(float value, float variance) {
    const FrameLayout frame{8, 8, {0, 0, 8, 8}};
    const std::vector<float> pixels(8 * 8 * 3, value);
    return {frame,
            {8, 8, pixels},
            {{"variance", "RGB", std::vector<float>(pixels.size(), variance)}},
            {{exr_attribute::kAlgorithm, "bdpt"}, {exr_attribute::kMaxDepth, "5"}, {exr_attribute::kScene, "digest"}}};
}

TEST(BenchReference, IsRefusedWhereItCannotJudge) {
    const BenchSubject subject{{8, 8, {0, 0, 8, 8}}, 5, "digest", {*parse_algorithm("path")}, 12};
    const auto good = check_reference("ref.exr", grey(1, 1e-4f), subject);
    ASSERT_TRUE(good.ok()) << good.status().message();
    EXPECT_TRUE(good->empty());
    BenchSubject other = subject;
    other.max_depth = 6;
    EXPECT_FALSE(check_reference("ref.exr", grey(1, 0), other).ok());
    other = subject;
    other.frame.width = 9;
    EXPECT_FALSE(check_reference("ref.exr", grey(1, 0), other).ok());
    EXPECT_FALSE(check_reference("ref.exr", grey(NAN, 0), subject).ok());
    const auto dark = check_reference("ref.exr", grey(0.001f, 0), subject);
    ASSERT_FALSE(dark.ok()) << "0.001 / 0.011 is 9 %, and so is what a black image shows";
    EXPECT_NE(dark.status().message().find("black"), std::string::npos);
}

TEST(BenchReference, IsWarnedOfWhereItMayMislead) {
    const BenchSubject subject{{8, 8, {0, 0, 8, 8}}, 5, "another", {*parse_algorithm("bdpt")}, 12};
    // Standard deviation 0.1 of 1: MAPE 100 % * sqrt(2 / pi) * 0.1 / 1.01 = 7.9 %.
    EXPECT_NEAR(noise_mape(grey(1, 0.01f)).value_or(0), 7.9, 0.01);
    EXPECT_EQ(check_reference("ref.exr", grey(1, 0.01f), subject)->size(), 3u);
    ExrImage foreign = grey(1, 0);
    EXPECT_EQ(noise_mape(foreign), 0);
    foreign.layers.clear();
    EXPECT_FALSE(noise_mape(foreign));
    const auto unknown = check_reference("ref.exr", foreign, subject);
    ASSERT_EQ(unknown->size(), 3u);
    EXPECT_EQ(unknown->back(), "ref.exr has no variance layer, so its own noise is unknown");
}

}  // namespace
}  // namespace lightloom::client
