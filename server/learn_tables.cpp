#include "server/learn_tables.h"

#include <algorithm>

#include "common/transport/catalog.h"
#include "common/transport/parameters.h"
#include "server/training_budget.h"

namespace lightloom {
namespace {

/// The spec with another size of the training set, in canonical text.
JobSpec with_training_samples(const JobSpec& spec, uint64_t samples) {
    JobSpec out = spec;
    out.parameters[kTrainingPaths] = std::to_string(samples);
    const auto algorithm = find_algorithm(out.algorithm);
    const auto parameters = parse_parameters(**algorithm, out.parameters);
    out.parameters = complete_parameters(**algorithm, *parameters);
    return out;
}

Result<AffordableSet> affordable_set(const JobSpec& spec, const TracedRound& probe, const EmitterSet& emitters,
                                     const WorkerRegistry::Crew& crew, const std::function<TimePoint()>& clock,
                                     const std::stop_token& stop) {
    const auto parameters = TransportParameters::read(render_settings(spec));
    if (!parameters.ok()) return parameters.status();
    const TimePoint begin = clock();
    TrainingReport report;
    const auto tables = train_tables(probe.data, emitters, parameters->training, {stop, {}}, &report);
    if (!tables.ok()) return tables.status();
    AffordableSet set;
    set.wanted = parameters->training_samples;
    set.probe_samples = probe.data.samples;
    set.probe_traced_seconds = probe.worker_seconds;
    set.probe_learned_seconds = seconds_between(begin, clock());
    const double samples = double(std::max<uint64_t>(1, set.probe_samples));
    const uint32_t threads = std::max(1u, crew.most_threads);  // of the worker that traced the probe: the largest, to be safe
    const auto affordable = [&](bool guided, uint64_t most) {
        // Every round learns once more what the probe's learning cost.
        const double budget =
            kTrainingShare * spec.time_limit_seconds - set.probe_traced_seconds - (guided ? 3 : 2) * set.probe_learned_seconds;
        const double per_sample = (guided ? kGuidedCost : 1) * set.probe_traced_seconds / samples;
        return affordable_training_samples({.trace_seconds_per_sample = per_sample / double(std::max<size_t>(1, crew.workers)),
                                            .learn_seconds_per_sample = kLearningOverTracing * per_sample * threads},
                                           budget, most);
    };
    const auto has_pilot = [&](uint64_t n) {
        const auto p = TransportParameters::read(render_settings(with_training_samples(spec, n)));
        return p.ok() && p->pilot_samples > 0;
    };
    set.samples = affordable(has_pilot(set.wanted), set.wanted);
    // A set too small for two rounds costs what one round costs.
    if (has_pilot(set.wanted) && !has_pilot(set.samples))
        set.samples = affordable(false, std::min(set.wanted, kTrainingUnitSamples));
    set.spec = with_training_samples(spec, set.samples);
    return set;
}

}  // namespace

Result<std::optional<LearnedTables>> learn_tables(JobSpec spec, const EmitterSet& emitters, TracingPort& port,
                                                  const std::function<TimePoint()>& clock, std::stop_token stop) {
    TablesInfo info;  // of both rounds
    for (;;) {
        const auto round = port.collect();
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
        const auto parameters = TransportParameters::read(render_settings(spec));
        if (!parameters.ok()) return parameters.status();
        port.learning_begins();
        TrainingReport report;
        auto tables = train_tables(round->data, emitters, parameters->training,
                                   {stop, [&](double share) { port.learning_goes_on(share); }}, &report);
        if (!tables.ok()) return tables.status();
        info.training_samples += round->data.samples;
        info.trace_seconds += round->seconds;
        info.classifier_seconds += report.classifier_seconds;
        info.energy_seconds += report.energy_seconds;
        info.gamma_seconds += report.gamma_seconds;
        if (round->kind == UnitKind::kTraining) {
            info.light_subspaces = tables->light_count;
            info.eye_subspaces = tables->eye_count;
            info.uniform_loss = report.gamma.uniform_loss;
            info.loss = report.gamma.loss;
            info.prior_strength = report.gamma.prior_strength;
            info.note = report.note;
            return std::optional(LearnedTables{*std::move(tables), std::move(spec), std::move(info)});
        }
        const TrainingWork& pilot = round->work;
        const uint64_t rest = pilot.total_samples - pilot.sample_count;
        LL_RETURN_IF_ERROR(port.open_guided_round(*tables, {pilot.sample_count, rest, pilot.total_samples}));
    }
}

}  // namespace lightloom
