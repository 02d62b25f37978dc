// The coordinator's side of learning: learn_tables() runs on a thread of the job's own. Through a TracingPort it
// reaches what only the coordinator has: units that workers trace, other jobs with the same tables, and the mutex.

#include <chrono>

#include "common/cli/log_line.h"
#include "common/core/crash_point.h"
#include "common/transport/parameters.h"
#include "server/coordinator.h"
#include "server/job_record.h"
#include "server/learn_tables.h"

namespace lightloom {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(100);

Status over() { return {StatusCode::kCancelled, "the job ended while its tables were made"}; }

double learning_seconds(const TablesInfo& info) { return info.classifier_seconds + info.energy_seconds + info.gamma_seconds; }

}  // namespace

class Coordinator::Tracing final : public TracingPort {
  public:
    Tracing(Coordinator& coordinator, JobRecord& job, size_t emitter_count, std::stop_token stop)
        : coordinator_(coordinator),
          job_(job),
          emitter_count_(emitter_count),
          stop_(std::move(stop)) {}

    Result<TracedRound> collect(TrainingData earlier) override {
        std::unique_lock lock(coordinator_.mutex_);
        for (;;) {
            coordinator_.work_changed_.wait_for(lock, kPoll, [&] { return !alive() || job_.round->complete(); });
            if (!alive()) return over();
            TrainingRound& round = *job_.round;
            if (!round.complete()) continue;
            if (job_.work_begin == TimePoint()) job_.work_begin = coordinator_.options_.clock();  // it waited for the scene
            TracedRound traced{.kind = round.kind(),
                               .round = round.number(),
                               .work = round.work(),
                               .data = {},
                               .worker_seconds = round.traced_seconds()};
            const TimePoint begin = job_.round_begin;
            auto parts = round.take();
            lock.unlock();
            // Digest and size were right; a worker whose data are invalid all the same loses its unit.
            std::vector<std::pair<uint32_t, Status>> bad;
            for (uint32_t i = 0; i < parts.size(); ++i)
                if (Status s = parts[i].data.validate(emitter_count_); !s.ok()) bad.emplace_back(i, std::move(s));
            if (bad.empty()) {
                auto data = join(std::move(earlier), std::move(parts), stop_);
                if (!data.ok()) return data.status();
                traced.data = *std::move(data);
                lock.lock();
                traced.seconds = seconds_between(begin, coordinator_.options_.clock());
                return alive() ? Result<TracedRound>(std::move(traced)) : over();
            }
            lock.lock();
            if (!alive()) return over();
            job_.round->put_back(std::move(parts));
            for (const auto& [unit, why] : bad) {
                ++job_.rejected;
                coordinator_.unit_failed(job_, job_.round->key(unit), job_.round->refuse(unit), why);
                if (!alive()) return over();  // the unit has failed too often
            }
        }
    }

    WorkerRegistry::Crew crew() const override {
        const std::lock_guard lock(coordinator_.mutex_);
        return coordinator_.workers_.crew(coordinator_.options_.clock());
    }

    double seconds_left() const override {
        const std::lock_guard lock(coordinator_.mutex_);
        return job_.seconds_left(coordinator_.options_.clock());
    }

    Result<bool> settle(const AffordableSet& set) override {
        log_info("{}: the time limit has room for {}{} of {} training samples; {} traced in {:.3f} s, learned in {:.3f} s", job_.id,
                 set.grows ? "about " : "", set.samples, set.wanted, set.probe_samples, set.probe_traced_seconds,
                 set.probe_learned_seconds);
        const bool smaller = set.samples < set.wanted && !set.grows;
        SceneFacts facts;
        {
            const std::lock_guard lock(coordinator_.mutex_);
            if (!alive()) return over();
            job_.capped_by_time_limit = smaller;
            job_.table_key = table_key(coordinator_.options_.identity, set.spec);
            facts = job_.facts;
        }
        // A smaller set makes other tables, which have not been looked up yet; those of the whole set may exist by now.
        if (coordinator_.adopt_cached_tables(job_, set.spec, facts)) return false;
        if (set.grows && adopt_smaller(set, facts)) return false;
        const std::lock_guard lock(coordinator_.mutex_);
        if (!alive()) return over();
        job_.spec = set.spec;
        const bool whole = !set.grows || set.samples == set.wanted;
        if (job_.may_wait && whole && coordinator_.wait_for_maker(job_)) return false;
        job_.set_grows = set.grows;
        job_.training_begin = coordinator_.options_.clock();
        if (set.grows) {
            coordinator_.open_training(job_, UnitKind::kTraining, 0, {0, kPilotSamples, kPilotSamples});
        } else {
            coordinator_.open_first_round(job_);
        }
        return true;
    }

    void learning_begins() override {
        const std::lock_guard lock(coordinator_.mutex_);
        if (!alive()) return;
        job_.phase = PreparePhase::kLearning;
        job_.learning = {.begin = coordinator_.options_.clock(), .share = 0, .heard = {}};
        coordinator_.prepared_further(job_);
    }

    void learning_goes_on(double share) override {
        const std::lock_guard lock(coordinator_.mutex_);
        if (!alive()) return;
        job_.learning.share = share;
        job_.learning.heard = coordinator_.options_.clock();
        coordinator_.prepared_further(job_);
    }

    Status open_round(uint32_t round, const Tables& guide, const TrainingWork& work) override {
        if (guide.empty()) {
            const std::lock_guard lock(coordinator_.mutex_);
            if (!alive()) return over();
            replace_guide({}, nullptr);
            coordinator_.open_training(job_, UnitKind::kTraining, round, work);
            return {};
        }
        auto bytes = std::make_shared<const std::string>(serialize(guide));
        const Digest digest = sha256(*bytes);
        {
            const std::lock_guard lock(coordinator_.mutex_);
            if (!alive()) return over();
            replace_guide({digest, bytes->size()}, bytes);  // before they are stored: no job that ends removes them
        }
        LL_RETURN_IF_ERROR(coordinator_.store_tables(digest, *bytes));
        const std::lock_guard lock(coordinator_.mutex_);
        if (!alive()) {
            coordinator_.drop_tables(digest);
            return over();
        }
        coordinator_.open_training(job_, UnitKind::kTraining, round, work);
        return {};
    }

  private:
    /// Adopts tables of an earlier job whose set ended where this one's may end, and is not smaller than the guess.
    bool adopt_smaller(const AffordableSet& set, const SceneFacts& facts) {
        std::vector<uint64_t> sizes = larger_sets(kGuideSamples, set.wanted);
        sizes.insert(sizes.begin(), {kPilotSamples, 2 * kPilotSamples, kGuideSamples});
        for (auto size = sizes.rbegin(); size != sizes.rend() && *size >= set.samples; ++size) {
            if (*size >= set.wanted) continue;  // it was looked up
            JobSpec spec = set.spec;
            spec.algorithm = spec.algorithm.with(kTrainingPaths, double(*size));
            {
                const std::lock_guard lock(coordinator_.mutex_);
                job_.capped_by_time_limit = true;
            }
            if (coordinator_.adopt_cached_tables(job_, spec, facts)) return true;
        }
        const std::lock_guard lock(coordinator_.mutex_);
        job_.capped_by_time_limit = false;
        return false;
    }
    /// Sets the tables that units of the next round read. The caller holds the mutex.
    void replace_guide(const AssetReference& guide, std::shared_ptr<const std::string> bytes) {
        const Digest old = std::exchange(job_.guide, guide).digest;
        job_.guide_bytes = std::move(bytes);
        if (old != guide.digest) coordinator_.drop_tables(old);
    }
    /// The caller holds the mutex.
    bool alive() const { return job_.state == JobState::kPreparing && !stop_.stop_requested(); }

    Coordinator& coordinator_;
    JobRecord& job_;
    const size_t emitter_count_;
    const std::stop_token stop_;
};

Status Coordinator::learn(JobRecord& job, std::stop_token stop) {
    JobSpec spec;
    std::function<Result<std::shared_ptr<const Scene>>()> build_scene;
    {
        const std::lock_guard lock(mutex_);
        if (job.state != JobState::kPreparing) return over();
        spec = job.spec;
        build_scene = job.facts.build_scene;
        job.scene_built = false;
    }
    if (!build_scene) return internal_error("this coordinator cannot build the scene that tables are learned for");
    const auto scene = build_scene();
    if (!scene.ok()) return scene.status();
    {
        const std::lock_guard lock(mutex_);
        job.scene_built = true;
    }
    const EmitterSet& emitters = (*scene)->emitters();
    Tracing tracing(*this, job, emitters.all().size(), stop);
    auto learned = learn_tables(std::move(spec), emitters, tracing, options_.clock, stop);
    if (!learned.ok()) return learned.status();
    return *learned ? finish_tables(job, **std::move(learned)) : Status();
}

Status Coordinator::finish_tables(JobRecord& job, LearnedTables learned) {
    TablesInfo& info = learned.info;
    info.cache_key = table_key(options_.identity, learned.spec);
    SceneFacts facts;  // empty if the job ended meanwhile; its tables are kept all the same
    {
        const std::lock_guard lock(mutex_);
        job.set_grows = false;
        job.table_key = info.cache_key;
        job.capped_by_time_limit = job.capped_by_time_limit || info.capped_by_time_limit;
        info.capped_by_time_limit = job.capped_by_time_limit;
        facts = std::move(job.facts);
    }
    const std::string bytes = serialize(learned.tables);
    crash_point("server.tables-learned");
    table_cache_.store(info.cache_key, bytes, info);
    crash_point("server.tables-cached");
    log_info("{}: {} from {} samples; {:.2f} s traced, {:.2f} s learned{}{}", job.id, info.what(), info.training_samples,
             info.trace_seconds, learning_seconds(info), info.note.empty() ? "" : "; ", info.note);
    return adopt_tables(job, learned.spec, facts, bytes, std::move(info));
}

void Coordinator::open_first_round(JobRecord& job) {
    const AlgorithmSettings& algorithm = job.spec.algorithm;
    open_training(job, UnitKind::kTraining, 0, learning_plan(algorithm).work(0));
}

}  // namespace lightloom
