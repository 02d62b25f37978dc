#include "server/learn_tables.h"

#include <algorithm>

#include "common/transport/parameters.h"
#include "server/training_budget.h"

namespace lightloom {
namespace {

Result<AffordableSet> affordable_set(const JobSpec& spec, const TracedRound& probe, const EmitterSet& emitters,
                                     const WorkerRegistry::Crew& crew, const std::function<TimePoint()>& clock,
                                     const std::stop_token& stop) {
    const RenderSettings settings = render_settings(spec);
    const LearningPlan plan = learning_plan(spec.algorithm);
    const TimePoint begin = clock();
    TrainingReport report;
    const auto tables = learn({probe.data, 0, {}, emitters, settings, {stop, {}, {}}, &report});
    if (!tables.ok()) return tables.status();
    AffordableSet set;
    set.wanted = plan.samples;
    set.probe_samples = probe.data.samples;
    set.probe_traced_seconds = probe.worker_seconds;
    set.probe_learned_seconds = seconds_between(begin, clock());
    const double samples = double(std::max<uint64_t>(1, set.probe_samples));
    const uint32_t threads = std::max(1u, crew.most_threads);  // the largest worker may have traced the probe
    const auto affordable = [&](bool guided, uint64_t most) {
        // The learning of every round costs at least what that of the probe cost.
        const double budget =
            kTrainingShare * spec.time_limit_seconds - set.probe_traced_seconds - (guided ? 3 : 2) * set.probe_learned_seconds;
        const double per_sample = (guided ? kGuidedCost : 1) * set.probe_traced_seconds / samples;
        return affordable_training_samples({.trace_seconds_per_sample = per_sample / double(std::max<size_t>(1, crew.workers)),
                                            .learn_seconds_per_sample = kLearningOverTracing * per_sample * threads},
                                           budget, most);
    };
    const auto with_samples = [&](uint64_t n) { return spec.algorithm.with(kTrainingPaths, double(n)); };
    const auto has_pilot = [&](uint64_t n) { return learning_plan(with_samples(n)).rounds.size() > 1; };
    set.samples = affordable(has_pilot(set.wanted), set.wanted);
    // A set that is too small for two rounds costs as much as one round.
    if (has_pilot(set.wanted) && !has_pilot(set.samples))
        set.samples = affordable(false, std::min(set.wanted, kTrainingUnitSamples));
    set.spec = spec;
    set.spec.algorithm = with_samples(set.samples);
    return set;
}

}  // namespace

Result<std::optional<LearnedTables>> learn_tables(JobSpec spec, const EmitterSet& emitters, TracingPort& port,
                                                  const std::function<TimePoint()>& clock, std::stop_token stop) {
    TablesInfo info;  // covers all rounds
    Tables guide;
    for (;;) {
        auto round = port.collect();
        if (!round.ok()) return round.status();
        if (round->kind == UnitKind::kProbe) {
            const auto set = affordable_set(spec, *round, emitters, port.crew(), clock, stop);
            if (!set.ok()) return set.status();
            const auto opened = port.settle(*set);
            if (!opened.ok()) return opened.status();
            if (!*opened) return std::optional<LearnedTables>();
            spec = set->spec;
            continue;
        }
        port.learning_begins();
        TrainingReport report;
        const uint64_t samples = round->data.samples;
        auto tables = learn({round->data,
                             round->round,
                             guide,
                             emitters,
                             render_settings(spec),
                             {stop, [&](double share) { port.learning_goes_on(share); }, [&] { round->data = {}; }},
                             &report});
        if (!tables.ok()) return tables.status();
        info.training_samples += samples;
        info.trace_seconds += round->seconds;
        info.classifier_seconds += report.classifier_seconds;
        info.energy_seconds += report.energy_seconds;
        info.gamma_seconds += report.gamma_seconds;
        const LearningPlan plan = learning_plan(spec.algorithm);
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
        round->data = {};  // freed before the next round's data come
        LL_RETURN_IF_ERROR(port.open_round(uint32_t(next), guide, plan.work(next)));
    }
}

}  // namespace lightloom
