// Learning without a coordinator: whatever traces the rounds, the rounds that are asked for, the set that a time limit affords, and
// what becomes of errors.

#include "server/learn_tables.h"

#include "tests/service/table_service.h"

namespace lightloom::testing {
namespace {

/// Traces every round itself, and remembers what was asked of it.
class FakeTracing : public TracingPort {
  public:
    FakeTracing(const JobSpec& job, UnitKind first) : spec(job), kind(first) {
        const LearningPlan plan = plan_of(spec);
        work = first == UnitKind::kTraining ? plan.work(0) : TrainingWork{0, kFirstSamples, plan.samples};
    }

    Result<TracedRound> collect(TrainingData earlier) override {
        asked += kind == UnitKind::kProbe ? "probe " : "round" + std::to_string(number) + " ";
        if (asked.ends_with(stops_at)) stop.request_stop();
        if (asked.ends_with(fails_at)) return data_loss("boom");
        const auto generator = TrainingGenerator::create(*golden(), render_settings(spec), guide);
        TracedRound round{kind, number, work, std::move(earlier), number == 1 ? guided_worker_seconds : worker_seconds, 2};
        const uint64_t end = work.first_sample + work.sample_count;
        for (uint64_t first = work.first_sample; first < end; first += kTrainingUnitSamples) {
            const auto unit = generator->trace({first, std::min(kTrainingUnitSamples, end - first), work.total_samples}, {});
            EXPECT_TRUE(round.data.append(*unit).ok());
        }
        return round;
    }
    WorkerRegistry::Crew crew() const override { return {2, 1}; }
    double seconds_left() const override { return left; }
    Result<bool> settle(const AffordableSet& set) override {
        asked += "settle ";
        settled = set;
        spec = set.spec;
        kind = UnitKind::kTraining;
        work = set.grows ? TrainingWork{0, kPilotSamples, kPilotSamples} : plan_of(spec).work(0);
        if (asked.ends_with(fails_at)) return data_loss("boom");
        return goes_on;
    }
    void learning_begins() override {
        asked += "learn ";
        share = 0;
    }
    void learning_goes_on(double now) override {
        EXPECT_GE(now, share);
        EXPECT_LE(now, 1);
        share = now;
    }
    Status open_round(uint32_t next, const Tables& tables, const TrainingWork& rest) override {
        asked += tables.empty() ? "open " : "guide ";
        number = next, guide = tables, work = rest;
        return asked.ends_with(fails_at) ? data_loss("boom") : Status();
    }

    static LearningPlan plan_of(const JobSpec& spec) { return spec.algorithm.info().learning->plan(spec.algorithm); }

    static constexpr uint64_t kFirstSamples = kTrainingUnitSamples;  ///< Of a probe.

    JobSpec spec;
    UnitKind kind;
    uint32_t number = 0;
    TrainingWork work;
    Tables guide;
    std::optional<AffordableSet> settled;
    std::string asked, fails_at = "nothing", stops_at = "nothing";
    std::stop_source stop;
    double share = 0, worker_seconds = 1, guided_worker_seconds = 1, left = 0;
    bool goes_on = true;
};

JobSpec complete(JobSpec spec) {
    spec.max_depth = 5;
    spec.frame = kFrame;
    spec.algorithm = spec.algorithm.completed();
    return spec;
}

/// Of a tenth of its limit, 2 s, the probe takes one.
JobSpec limited_spec() {
    const TableService service;
    JobSpec spec = complete(service.table_spec(0));
    spec.time_limit_seconds = 20;
    return spec;
}

const auto no_time_passes = [] { return TimePoint(); };

Result<std::optional<LearnedTables>> learn(FakeTracing& tracing, const std::function<TimePoint()>& clock = no_time_passes) {
    return learn_tables(tracing.spec, golden()->emitters(), tracing, clock, tracing.stop.get_token());
}

TEST(LearnTables, TwoRoundsAreThoseOfASingleMachine) {
    const TableService service;
    const JobSpec spec = complete(service.guided_spec());
    FakeTracing tracing(spec, UnitKind::kTraining);
    const auto learned = learn(tracing);
    ASSERT_TRUE(learned.ok()) << learned.status().message();
    ASSERT_TRUE(learned->has_value());
    EXPECT_EQ(tracing.asked, "round0 learn guide round1 learn ");
    EXPECT_EQ(tracing.work.first_sample, kTrainingUnitSamples);
    EXPECT_EQ(tracing.work.sample_count, kSamples - kTrainingUnitSamples);
    EXPECT_EQ(sha256(serialize((*learned)->tables)), tables_alone(spec));
    EXPECT_EQ((*learned)->info.training_samples, kSamples);
    EXPECT_EQ((*learned)->info.trace_seconds, 4) << "of both rounds";
    EXPECT_EQ((*learned)->info.light_subspaces, (*learned)->tables.get<SubspaceTables>()->light_count);
    EXPECT_LT((*learned)->info.loss, (*learned)->info.uniform_loss);
    EXPECT_GT(tracing.share, 0.1) << "learning tells how far it has come";
}

TEST(LearnTables, ALimitWithRoomForLessMakesTheSetSmaller) {
    FakeTracing tracing(limited_spec(), UnitKind::kProbe);
    const auto learned = learn(tracing);
    ASSERT_TRUE(learned.ok() && learned->has_value()) << learned.status().message();
    EXPECT_EQ(tracing.asked, "probe settle round0 learn ");
    ASSERT_TRUE(tracing.settled.has_value());
    EXPECT_EQ(tracing.settled->wanted, kSamples);
    EXPECT_EQ(tracing.settled->probe_samples, FakeTracing::kFirstSamples);
    // On two workers a sample costs half of the probe's 61 us, and 0.35 of them to learn from: room for 19275.
    EXPECT_EQ(tracing.settled->samples, 16384u);
    EXPECT_EQ((*learned)->spec.algorithm.value("training-paths"), 16384);
    EXPECT_EQ((*learned)->info.training_samples, 16384u);
    EXPECT_EQ(sha256(serialize((*learned)->tables)), tables_alone((*learned)->spec));
}

/// Every round of learning costs what the probe's cost.
TEST(LearnTables, WhatLearningFromTheProbeTookIsNotThereForTracing) {
    FakeTracing tracing(limited_spec(), UnitKind::kProbe);
    tracing.goes_on = false;
    TimePoint now;
    const auto slow = [&] { return now += std::chrono::milliseconds(250); };
    ASSERT_TRUE(learn(tracing, slow).ok());
    EXPECT_EQ(tracing.settled->probe_learned_seconds, 0.25);
    EXPECT_EQ(tracing.settled->samples, 8192u) << "half of the second that the tracing has left: room for 9637";
}

/// A job without a set of its own, which takes next to nothing to trace and has 18 s left.
FakeTracing growing() {
    const TableService service;
    JobSpec spec = complete(service.guided_spec(0));
    // With so many subspaces more paths always teach more.
    spec.algorithm = without(spec.algorithm, "training-paths").with("light-subspaces", 300).with("eye-subspaces", 200).completed();
    spec.time_limit_seconds = 20;
    FakeTracing tracing(spec, UnitKind::kProbe);
    tracing.worker_seconds = 0.01;
    tracing.left = 18;
    return tracing;
}

/// Its tables are those of the spec that it ends with, as a single machine makes them.
void expect_grown(const FakeTracing& tracing, const Result<std::optional<LearnedTables>>& learned, uint64_t samples) {
    ASSERT_TRUE(learned.ok() && learned->has_value()) << learned.status().message();
    ASSERT_TRUE(tracing.settled.has_value());
    EXPECT_TRUE(tracing.settled->grows);
    EXPECT_EQ((*learned)->spec.algorithm.value("training-paths"), double(samples));
    EXPECT_EQ((*learned)->info.training_samples, samples);
    EXPECT_TRUE((*learned)->info.capped_by_time_limit);
    EXPECT_EQ(sha256(serialize((*learned)->tables)), tables_alone((*learned)->spec));
}

TEST(LearnTables, ASetGrowsWhileItIsWorthItsTime) {
    FakeTracing tracing = growing();
    // Above half of the limit there is a millisecond. The last round takes 0.7 of it for 131072 samples, and would take 2
    // for 262144.
    tracing.spec.time_limit_seconds = 36;
    tracing.left = 18.001;
    tracing.worker_seconds = 1e-5;
    tracing.guided_worker_seconds = 0.001;
    const auto learned = learn(tracing);
    EXPECT_EQ(tracing.asked, "probe settle round0 learn guide round1 learn guide round2 learn ");
    expect_grown(tracing, learned, 2 * kGuideSamples);
}

TEST(LearnTables, ASetStopsGrowingWhereNoTimeIsLeft) {
    FakeTracing tracing = growing();
    tracing.left = 10.001;  // nothing fits above half of the limit
    const auto learned = learn(tracing);
    EXPECT_EQ(tracing.asked, "probe settle round0 learn ");
    expect_grown(tracing, learned, kPilotSamples);
}

TEST(LearnTables, ALimitWithoutRoomForAGuideHasASetOfOneRound) {
    FakeTracing tracing = growing();
    tracing.worker_seconds = 6;
    const auto learned = learn(tracing);
    ASSERT_TRUE(learned.ok() && learned->has_value()) << learned.status().message();
    EXPECT_FALSE(tracing.settled->grows);
    EXPECT_EQ(tracing.asked, "probe settle round0 learn ");
    EXPECT_LT((*learned)->info.training_samples, kPilotSamples);
    EXPECT_EQ(sha256(serialize((*learned)->tables)), tables_alone((*learned)->spec));
}

TEST(TrainingTrade, TakesTheLeastErrorOfTheWholeJob) {
    const std::vector<LargerSet> sets{{200, 1}, {400, 3}, {800, 7}};
    // 20 s left; of the loss the next doubling leaves ...
    EXPECT_EQ(best_training_size(100, sets, 1, 20, 20), 100u);
    EXPECT_EQ(best_training_size(100, sets, 0.96, 20, 20), 100u) << "0.96 / 19 > 1 / 20";
    EXPECT_EQ(best_training_size(100, sets, 0.94, 20, 20), 200u);
    EXPECT_EQ(best_training_size(100, sets, 0.8, 20, 20), 400u) << "0.8 0.88 / 17 = 0.0414, 0.8 / 19 = 0.0421";
    EXPECT_EQ(best_training_size(100, sets, 0.3, 20, 20), 800u) << "0.3 0.58 0.748 / 13 = 0.0100, 0.3 0.58 / 17 = 0.0102";
    EXPECT_EQ(best_training_size(100, sets, 0.7, 20, 14), 400u) << "half of the limit is for rendering";
    EXPECT_EQ(best_training_size(100, sets, 0.7, 20, 10.5), 100u);
    EXPECT_EQ(best_training_size(100, sets, 0.7, 20, 0), 100u);
    EXPECT_EQ(best_training_size(100, {}, 0.7, 20, 20), 100u);
}

TEST(TrainingTrade, PreparesForNoLongerThanItRenders) {
    EXPECT_EQ(proportionate_training_samples(0, 500000), kMinTrainingSamples);
    EXPECT_EQ(proportionate_training_samples(4 * 16384 - 1, 500000), 8192u);
    EXPECT_EQ(proportionate_training_samples(4 * 16384, 500000), 16384u);
    EXPECT_EQ(proportionate_training_samples(1999999, 500000), 262144u);
    EXPECT_EQ(proportionate_training_samples(2000000, 500000), 500000u);
    EXPECT_EQ(proportionate_training_samples(10, 700), 700u) << "less than the least that is worth anything";
}

TEST(TrainingTrade, ExpectsLessOfTheNextDoublingsThanTheLastOnesGave) {
    EXPECT_NEAR(expected_loss_per_doubling(0.64, 1, 2), 1 - kGainThatIsLeft * 0.2, 1e-12);
    EXPECT_EQ(expected_loss_per_doubling(2, 1, 2), 1);
    for (const double nothing : {0.0, -1.0, double(NAN), double(INFINITY)}) {
        EXPECT_EQ(expected_loss_per_doubling(nothing, 1, 2), kTypicalLossPerDoubling);
        EXPECT_EQ(expected_loss_per_doubling(1, nothing, 2), kTypicalLossPerDoubling);
    }
}

TEST(LearnTables, NothingIsLearnedWhereTheTablesExist) {
    FakeTracing tracing(limited_spec(), UnitKind::kProbe);
    tracing.goes_on = false;
    const auto learned = learn(tracing);
    ASSERT_TRUE(learned.ok()) << learned.status().message();
    EXPECT_FALSE(learned->has_value());
    EXPECT_EQ(tracing.asked, "probe settle ");
}

TEST(LearnTables, EveryErrorEndsIt) {
    const TableService service;
    for (const char* where : {"round0 ", "guide ", "round1 ", "probe ", "settle "}) {
        const bool probes = std::string_view(where) == "probe " || std::string_view(where) == "settle ";
        FakeTracing tracing(probes ? limited_spec() : complete(service.guided_spec()),
                            probes ? UnitKind::kProbe : UnitKind::kTraining);
        tracing.fails_at = where;
        const auto learned = learn(tracing);
        EXPECT_EQ(learned.status().code(), StatusCode::kDataLoss) << where;
        EXPECT_TRUE(tracing.asked.ends_with(where)) << tracing.asked;
    }
}

TEST(LearnTables, AStopEndsIt) {
    for (const UnitKind first : {UnitKind::kProbe, UnitKind::kTraining}) {
        FakeTracing tracing(limited_spec(), first);
        tracing.stops_at = first == UnitKind::kProbe ? "probe " : "round0 ";
        EXPECT_EQ(learn(tracing).status().code(), StatusCode::kCancelled);
        EXPECT_EQ(tracing.asked, first == UnitKind::kProbe ? "probe " : "round0 learn ");
    }
}

}  // namespace
}  // namespace lightloom::testing
