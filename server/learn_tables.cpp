#include "server/learn_tables.h"

#include <algorithm>
#include <cmath>

#include "common/cli/log_line.h"
#include "common/transport/parameters.h"
#include "server/training_budget.h"

namespace lightloom {
namespace {

JobSpec with_samples(const JobSpec& spec, uint64_t samples) {
    JobSpec out = spec;
    out.algorithm = spec.algorithm.with(kTrainingPaths, double(samples));
    return out;
}

Result<AffordableSet> affordable_set(const JobSpec& spec, const TracedRound& probe, const EmitterSet& emitters,
                                     const WorkerRegistry::Crew& crew, const std::function<TimePoint()>& clock,
                                     const std::stop_token& stop) {
    const RenderSettings settings = render_settings(spec);
    const LearningPlan plan = learning_plan(spec.algorithm);
    AffordableSet set;
    set.wanted = plan.samples;
    set.probe_samples = probe.data.samples;
    set.probe_traced_seconds = probe.worker_seconds;
    if (!plan.grows || spec.time_limit_seconds < kShortLimit) {
        const TimePoint begin = clock();
        TrainingReport report;
        const auto tables = learn({probe.data, 0, {}, emitters, settings, {stop, {}, {}}, &report});
        if (!tables.ok()) return tables.status();
        set.probe_learned_seconds = seconds_between(begin, clock());
    }
    const double samples = double(std::max<uint64_t>(1, set.probe_samples));
    const uint32_t threads = std::max(1u, crew.most_threads);  // the largest worker may have traced the probe
    const auto affordable = [&](bool guided, double share, uint64_t most) {
        // The learning of every round costs at least what that of the probe cost.
        const double budget =
            share * spec.time_limit_seconds - set.probe_traced_seconds - (guided ? 3 : 2) * set.probe_learned_seconds;
        const double per_sample = (guided ? kGuidedCost : 1) * set.probe_traced_seconds / samples;
        return affordable_training_samples({.trace_seconds_per_sample = per_sample / double(std::max<size_t>(1, crew.workers)),
                                            .learn_seconds_per_sample = kLearningOverTracing * per_sample * threads},
                                           budget, most);
    };
    set.grows = plan.grows && affordable(true, kLongestShare, set.wanted) >= 2 * kPilotSamples;
    set.samples = set.grows ? affordable(true, kTrainingShare, set.wanted)
                            : affordable(false, kTrainingShare, plan.grows ? std::min(set.wanted, kPilotSamples) : set.wanted);
    set.spec = set.grows ? spec : with_samples(spec, set.samples);
    return set;
}

/// What the rounds of a set that grows have shown.
struct Growth {
    double trace_seconds_per_sample = 0;  ///< Of guided samples, with all workers together.
    double learn_seconds = 0, learn_seconds_per_sample = 0;
    double loss_per_doubling = kTypicalLossPerDoubling;
};

Growth growth_after(const TracedRound& round, uint64_t samples, double learned_seconds, const TrainingReport& report,
                    const WorkerRegistry::Crew& crew) {
    const double per_sample = round.worker_seconds / double(std::max<uint64_t>(1, round.work.sample_count));
    const double workers = double(std::max<size_t>(1, crew.workers));
    if (round.round == 0) {  // nothing has been guided yet
        return {.trace_seconds_per_sample = kGuidedCost * per_sample / workers,
                .learn_seconds = learned_seconds,
                .learn_seconds_per_sample = kLearningOverTracing * kGuidedCost * per_sample * std::max(1u, crew.most_threads)};
    }
    return {.trace_seconds_per_sample = per_sample / workers,
            .learn_seconds = (1 - kLearningThatGrows) * learned_seconds,
            .learn_seconds_per_sample = kLearningThatGrows * learned_seconds / double(samples),
            .loss_per_doubling = expected_loss_per_doubling(report.gamma.loss, report.judged_loss,
                                                            std::log2(double(kGuideSamples) / double(kPilotSamples)))};
}

/// The size that the set should have, where the tables of the samples before `end` exist.
uint64_t best_size(const Growth& growth, uint64_t end, uint64_t wanted, double limit, double left) {
    std::vector<LargerSet> sets;
    for (const uint64_t samples : larger_sets(end, wanted)) {
        const double more = double(samples - end), guided = double(samples - kPilotSamples);
        sets.push_back(
            {samples, more * growth.trace_seconds_per_sample + growth.learn_seconds + guided * growth.learn_seconds_per_sample});
    }
    return best_training_size(end, sets, growth.loss_per_doubling, limit, left);
}

}  // namespace

Result<std::optional<LearnedTables>> learn_tables(JobSpec spec, const EmitterSet& emitters, TracingPort& port,
                                                  const std::function<TimePoint()>& clock, std::stop_token stop) {
    TablesInfo info;  // covers all rounds
    Tables guide;
    TrainingData kept;     // of guided rounds
    bool growing = false;  // whether it is open with how many samples the set will end
    const uint64_t wanted = learning_plan(spec.algorithm).samples;
    for (;;) {
        auto round = port.collect(std::move(kept));
        if (!round.ok()) return round.status();
        kept = {};
        if (round->kind == UnitKind::kProbe) {
            const auto set = affordable_set(spec, *round, emitters, port.crew(), clock, stop);
            if (!set.ok()) return set.status();
            const auto opened = port.settle(*set);
            if (!opened.ok()) return opened.status();
            if (!*opened) return std::optional<LearnedTables>();
            spec = set->spec;
            growing = set->grows;
            continue;
        }
        port.learning_begins();
        TrainingReport report;
        const uint64_t end = round->work.first_sample + round->work.sample_count, samples = round->data.samples;
        growing = growing && !larger_sets(end, wanted).empty();
        LearningPlan plan = learning_plan(spec.algorithm);
        const auto data_read = [&] {
            if (!growing && end == plan.samples) round->data = {};
        };
        const TimePoint begin = clock();
        auto tables = learn({round->data,
                             round->round,
                             guide,
                             emitters,
                             render_settings(spec),
                             {stop, [&](double share) { port.learning_goes_on(share); }, data_read},
                             &report,
                             growing && round->round > 0});
        if (!tables.ok()) return tables.status();
        info.training_samples += round->work.sample_count;
        info.trace_seconds += round->seconds;
        info.classifier_seconds += report.classifier_seconds;
        info.energy_seconds += report.energy_seconds;
        info.gamma_seconds += report.gamma_seconds;
        if (growing) {
            const Growth growth = growth_after(*round, samples, seconds_between(begin, clock()), report, port.crew());
            const double left = port.seconds_left();
            const uint64_t size = best_size(growth, end, wanted, spec.time_limit_seconds, left);
            log_info(
                "{} training samples are there and {:.1f} s are left, the next doubling is expected to leave {:.3f} of the loss: "
                "{}",
                end, left, growth.loss_per_doubling, size == end ? "no more" : "on to " + std::to_string(size));
            growing = size != end && !larger_sets(size, wanted).empty();
            spec = with_samples(spec, size);
            plan = learning_plan(spec.algorithm);
            info.capped_by_time_limit = size < wanted;
        }
        const size_t next = round->round + 1;
        if (next == plan.rounds.size()) {
            info.light_subspaces = report.light_subspaces;
            info.eye_subspaces = report.eye_subspaces;
            info.uniform_loss = report.gamma.uniform_loss;
            info.loss = report.gamma.loss;
            info.prior_strength = report.gamma.prior_strength;
            info.note = report.note;
            return std::optional(LearnedTables{*std::move(tables), std::move(spec), std::move(info)});
        }
        guide = plan.rounds[next].guided ? *std::move(tables) : Tables();
        if (plan.rounds[next].guided && plan.rounds[round->round].guided) kept = std::move(round->data);
        round->data = {};  // freed before the next round's data come
        LL_RETURN_IF_ERROR(port.open_round(uint32_t(next), guide, plan.work(next)));
    }
}

}  // namespace lightloom
