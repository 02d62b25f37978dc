// How the coordinator learns tables: it waits for the training units of a job, chooses the size of the set where a time
// limit asks for it, and trains in one or two rounds (see TrainingGenerator).

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>

#include "common/transport/catalog.h"
#include "common/transport/parameters.h"
#include "server/coordinator.h"
#include "server/job_record.h"
#include "server/training_budget.h"

namespace lightloom {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(100);

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

Status over() { return {StatusCode::kCancelled, "the job ended while its tables were made"}; }

double learning_seconds(const TablesInfo& info) { return info.classifier_seconds + info.energy_seconds + info.gamma_seconds; }

/// The spec with another size of the training set, in canonical text.
JobSpec with_training_samples(const JobSpec& spec, uint64_t samples) {
    JobSpec out = spec;
    out.parameters[kTrainingPaths] = std::to_string(samples);
    const auto algorithm = find_algorithm(out.algorithm);
    const auto parameters = parse_parameters(**algorithm, out.parameters);
    out.parameters = complete_parameters(**algorithm, *parameters);
    return out;
}

}  // namespace

Status Coordinator::learn(JobRecord& job, std::stop_token stop) {
    std::function<Result<std::shared_ptr<const Scene>>()> build_scene;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return over();
        build_scene = job.facts.build_scene;
    }
    if (!build_scene) return internal_error("this coordinator cannot build the scene that tables are learned for");
    const auto scene = build_scene();
    if (!scene.ok()) return scene.status();
    const EmitterSet& emitters = (*scene)->emitters();

    TablesInfo info;  // of both rounds
    for (;;) {
        const auto data = collect_training(job, emitters.all().size(), stop);
        if (!data.ok()) return data.status();
        JobSpec spec;
        UnitKind kind;
        {
            const std::lock_guard lock(mutex_);
            if (job.state != JobState::kPreparing) return over();
            spec = job.spec;
            kind = job.round->kind();
            if (kind != UnitKind::kProbe) {
                info.trace_seconds = seconds_between(job.training_begin, options_.clock()) - learning_seconds(info);
                info.capped_by_time_limit = job.capped_by_time_limit;
                job.phase = PreparePhase::kLearning;
                job.learning = {.begin = options_.clock(), .share = 0, .heard = {}};
                prepared_further(job);
            }
        }
        if (kind == UnitKind::kProbe) {
            LL_RETURN_IF_ERROR(choose_training_samples(job, *data, **scene, stop));
            const std::lock_guard lock(mutex_);
            if (job.state != JobState::kPreparing || job.maker) return {};  // it has tables or waits for them, or was cancelled
            continue;
        }
        const auto parameters = TransportParameters::read(render_settings(spec));
        if (!parameters.ok()) return parameters.status();
        TrainingReport report;
        const auto progress = [&](double share) {
            const std::lock_guard lock(mutex_);
            if (job.state != JobState::kPreparing) return;
            job.learning.share = share;
            job.learning.heard = options_.clock();
            prepared_further(job);
        };
        const auto tables = train_tables(*data, emitters, parameters->training, {stop, progress}, &report);
        if (!tables.ok()) return tables.status();
        info.training_samples += data->samples;
        info.classifier_seconds += report.classifier_seconds;
        info.energy_seconds += report.energy_seconds;
        info.gamma_seconds += report.gamma_seconds;
        if (kind == UnitKind::kTraining) return finish_tables(job, spec, *tables, report, std::move(info));
        LL_RETURN_IF_ERROR(open_guided_round(job, *tables));
    }
}

Status Coordinator::finish_tables(JobRecord& job, const JobSpec& spec, const SubspaceTables& tables, const TrainingReport& report,
                                  TablesInfo info) {
    info.light_subspaces = tables.light_count;
    info.eye_subspaces = tables.eye_count;
    info.uniform_loss = report.gamma.uniform_loss;
    info.loss = report.gamma.loss;
    info.prior_strength = report.gamma.prior_strength;
    info.note = report.note;
    info.cache_key = table_key(options_.identity, spec);
    const std::string bytes = serialize(tables);
    table_cache_.store(info.cache_key, bytes, info);
    spdlog::info("{}: tables of {} x {} subspaces from {} samples; {:.2f} s traced, {:.2f} s learned{}{}", job.id,
                 info.light_subspaces, info.eye_subspaces, info.training_samples, info.trace_seconds, learning_seconds(info),
                 info.note.empty() ? "" : "; ", info.note);
    SceneFacts facts;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return over();
        facts = std::move(job.facts);
    }
    return adopt_tables(job, spec, facts, bytes, std::move(info));
}

void Coordinator::open_first_round(JobRecord& job) {
    const auto parameters = TransportParameters::read(render_settings(job.spec));  // was read before: valid
    const uint64_t samples = parameters->training_samples, pilot = parameters->pilot_samples;
    open_training(job, pilot > 0 ? UnitKind::kPilot : UnitKind::kTraining, {0, pilot > 0 ? pilot : samples, samples});
}

Status Coordinator::open_guided_round(JobRecord& job, const SubspaceTables& pilot) {
    auto bytes = std::make_shared<const std::string>(serialize(pilot));
    const Digest digest = sha256(*bytes);
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return over();
        job.guide = {digest, bytes->size()};  // before the bytes are there, so that no job that ends takes them away
        job.guide_bytes = bytes;
    }
    LL_RETURN_IF_ERROR(store_tables(digest, *bytes));
    const std::lock_guard lock(mutex_);
    if (job.state != JobState::kPreparing) return drop_tables(digest), over();
    const uint64_t total = job.round->work().total_samples, first = job.round->work().sample_count;
    open_training(job, UnitKind::kTraining, {first, total - first, total});
    return {};
}

Result<TrainingData> Coordinator::collect_training(JobRecord& job, size_t emitter_count, std::stop_token stop) {
    std::unique_lock lock(mutex_);
    const auto alive = [&] { return job.state == JobState::kPreparing && !stop.stop_requested(); };
    for (;;) {
        work_changed_.wait_for(lock, kPoll, [&] { return !alive() || job.round->complete(); });
        if (!alive()) return over();
        if (!job.round->complete()) continue;
        auto parts = job.round->take();
        lock.unlock();
        // Digest and size were right; a worker whose data are nonsense all the same loses its unit.
        std::vector<std::pair<uint32_t, Status>> bad;
        for (uint32_t i = 0; i < parts.size(); ++i)
            if (Status s = parts[i].data.validate(emitter_count); !s.ok()) bad.emplace_back(i, std::move(s));
        if (bad.empty()) return join(std::move(parts), stop);
        lock.lock();
        if (!alive()) return over();
        job.round->put_back(std::move(parts));
        for (const auto& [unit, why] : bad) {
            ++job.rejected;
            unit_failed(job, {unit, 0, job.round->kind()}, job.round->refuse(unit), why);
            if (!alive()) return over();  // the unit has failed too often
        }
    }
}

Status Coordinator::choose_training_samples(JobRecord& job, const TrainingData& probe, const Scene& scene, std::stop_token stop) {
    JobSpec spec;
    SceneFacts facts;
    double traced = 0;
    WorkerRegistry::Crew crew;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return over();
        spec = job.spec;
        facts = job.facts;
        traced = job.round->traced_seconds();
        crew = workers_.crew(options_.clock());
    }
    const auto parameters = TransportParameters::read(render_settings(spec));
    if (!parameters.ok()) return parameters.status();
    const auto begin = Clock::now();
    TrainingReport report;
    const auto tables = train_tables(probe, scene.emitters(), parameters->training, {stop, {}}, &report);
    if (!tables.ok()) return tables.status();
    const double learned = seconds_since(begin), samples = double(std::max<uint64_t>(1, probe.samples));
    const uint64_t wanted = parameters->training_samples;
    const uint32_t threads = std::max(1u, crew.most_threads);  // of the worker that traced the probe: the largest, to be safe
    const auto affordable = [&](bool guided, uint64_t most) {
        // Every round learns once more what the probe's learning cost.
        const double budget = kTrainingShare * spec.time_limit_seconds - traced - (guided ? 3 : 2) * learned;
        const double per_sample = (guided ? kGuidedCost : 1) * traced / samples;
        const TrainingRate rate{per_sample / double(std::max<size_t>(1, crew.workers)), kLearningOverTracing * per_sample * threads};
        return affordable_training_samples(rate, budget, most);
    };
    const auto has_pilot = [&](uint64_t n) {
        const auto p = TransportParameters::read(render_settings(with_training_samples(spec, n)));
        return p.ok() && p->pilot_samples > 0;
    };
    uint64_t chosen = affordable(has_pilot(wanted), wanted);
    // A set too small for two rounds costs what one round costs.
    if (has_pilot(wanted) && !has_pilot(chosen)) chosen = affordable(false, std::min(wanted, kTrainingUnitSamples));
    spec = with_training_samples(spec, chosen);
    spdlog::info("{}: the time limit has room for {} of {} training samples; {} traced in {:.3f} s, learned in {:.3f} s", job.id,
                 chosen, wanted, probe.samples, traced, learned);
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return over();
        job.capped_by_time_limit = chosen < wanted;
        job.table_key = table_key(options_.identity, spec);
    }
    if (chosen < wanted && adopt_cached_tables(job, spec, facts)) return {};
    const std::lock_guard lock(mutex_);
    if (job.state != JobState::kPreparing) return over();
    job.spec = std::move(spec);
    if (chosen < wanted && wait_for_maker(job)) return {};
    job.training_begin = options_.clock();
    open_first_round(job);
    return {};
}

}  // namespace lightloom
