#include "server/learn_job.h"

#include <chrono>

#include "common/cli/log_line.h"
#include "common/core/crash_point.h"
#include "common/transport/parameters.h"
#include "server/blame.h"
#include "server/learn_tables.h"
#include "server/plan_job.h"
#include "server/prepare_job.h"

namespace lightloom {
namespace {

/// A waiting thread looks by itself that often, should nobody tell it.
constexpr auto kPoll = std::chrono::seconds(1);

Status over() { return {StatusCode::kCancelled, "the job ended while its tables were made"}; }

double learning_seconds(const TablesInfo& info) { return info.classifier_seconds + info.energy_seconds + info.gamma_seconds; }

/// The TracingPort of one job.
class Tracing final : public TracingPort {
  public:
    Tracing(Office& office, JobPtr file, size_t emitter_count)
        : office_(office),
          file_(std::move(file)),
          job_(file_->job),
          emitter_count_(emitter_count),
          stop_(file_->stop.get_token()) {}

    Result<TracedRound> collect(TrainingData earlier) override {
        OpenBook book(office_);
        for (;;) {
            while (alive() && !preparation().round->complete())
                book.wait_until(file_->changed, std::chrono::steady_clock::now() + kPoll);
            if (!alive()) return over();
            TrainingRound& round = *preparation().round;
            preparation().start_clock(office_.now());  // it may have waited for the scene
            TracedRound traced{.kind = round.kind(),
                               .round = round.number(),
                               .work = round.work(),
                               .data = {},
                               .worker_seconds = round.traced_seconds()};
            const TimePoint begin = preparation().round_begin;
            auto parts = round.take();
            book.close();
            // Digest and size were right; a worker whose data are invalid all the same loses its unit.
            std::vector<std::pair<uint32_t, Status>> bad;
            for (uint32_t i = 0; i < parts.size(); ++i)
                if (Status s = parts[i].data.validate(emitter_count_); !s.ok()) bad.emplace_back(i, std::move(s));
            if (bad.empty()) {
                auto data = join(std::move(earlier), std::move(parts), stop_);
                if (!data.ok()) return data.status();
                traced.data = *std::move(data);
                book.reopen();
                traced.seconds = seconds_between(begin, office_.now());
                return alive() ? Result<TracedRound>(std::move(traced)) : over();
            }
            book.reopen();
            if (!alive()) return over();
            preparation().round->put_back(std::move(parts));
            for (const auto& [unit, why] : bad) {
                ++job_.incidents.rejected;
                office_.archive.drop_soon(job_.id(), preparation().round->key(unit));
                TrainingRound& open = *preparation().round;
                const UnitTable::Failures failures = open.refuse(unit);
                unit_failed(book, file_, open.key(unit), failures, why, office_.now());
                if (!alive()) return over();  // the unit has failed too often
            }
        }
    }

    WorkerRegistry::Crew crew() const override { return OpenBook(office_)->workers.crew(office_.now()); }

    double seconds_left() const override {
        const OpenBook book(office_);
        return job_.seconds_left(office_.now());
    }

    Result<bool> settle(const AffordableSet& set) override {
        log_info("{}: the time limit has room for {}{} of {} training samples; {} traced in {:.3f} s, learned in {:.3f} s",
                 job_.id(), set.grows ? "about " : "", set.samples, set.wanted, set.probe_samples, set.probe_traced_seconds,
                 set.probe_learned_seconds);
        const bool smaller = set.samples < set.wanted && !set.grows;
        SceneFacts facts;
        {
            const OpenBook book(office_);
            if (!alive()) return over();
            preparation().capped_by_time_limit = smaller;
            preparation().table_key = table_key(office_.options.identity, set.spec);
            facts = preparation().facts;
        }
        // A smaller set makes other tables, which have not been looked up yet; those of the whole set may exist by now.
        if (adopt_cached_tables(office_, file_, set.spec, facts)) return false;
        if (set.grows && adopt_smaller(set, facts)) return false;
        if (!set.grows) LL_RETURN_IF_ERROR(with_room(office_, file_, [&] { return office_.archive.settle(job_.id(), set.spec); }));
        OpenBook book(office_);
        if (!alive()) return over();
        preparation().rounds_are_fixed = !set.grows;
        job_.complete_spec(set.spec);
        const bool whole = !set.grows || set.samples == set.wanted;
        if (preparation().may_wait && whole && wait_for_maker(book, file_)) return false;
        preparation().training_begin = office_.now();
        if (set.grows) {
            // Nobody knows yet which tables these will be, and nobody can wait for them.
            open_training(office_, book, file_, UnitKind::kTraining, 0, {0, kPilotSamples, kPilotSamples});
        } else {
            open_first_round(office_, book, file_);
        }
        return true;
    }

    void learning_begins() override {
        OpenBook book(office_);
        if (!alive()) return;
        preparation().phase = PreparePhase::kLearning;
        preparation().learning = {.begin = office_.now(), .share = 0, .heard = {}};
        book.changed(file_);
    }

    void learning_goes_on(double share) override {
        OpenBook book(office_);
        if (!alive()) return;
        preparation().learning.share = share;
        preparation().learning.heard = office_.now();
        book.changed(file_);
    }

    Status open_round(uint32_t round, const Tables& guide, const TrainingWork& work) override {
        if (guide.empty()) {
            OpenBook book(office_);
            if (!alive()) return over();
            replace_guide(book, {}, nullptr);
            open_training(office_, book, file_, UnitKind::kTraining, round, work);
            return {};
        }
        auto bytes = std::make_shared<const std::string>(serialize(guide));
        const Digest digest = sha256(*bytes);
        {
            OpenBook book(office_);
            if (!alive()) return over();
            replace_guide(book, {digest, bytes->size()}, bytes);  // before they are stored: no job that ends removes them
        }
        LL_RETURN_IF_ERROR(with_room(office_, file_, [&] { return store_tables(office_, digest, *bytes); }));
        OpenBook book(office_);
        if (!alive()) {
            if (!book->ledger.pinned(digest)) book.drop_tables(digest);
            return over();
        }
        open_training(office_, book, file_, UnitKind::kTraining, round, work);
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
                const OpenBook book(office_);
                preparation().capped_by_time_limit = true;
            }
            if (adopt_cached_tables(office_, file_, spec, facts)) return true;
        }
        const OpenBook book(office_);
        preparation().capped_by_time_limit = false;
        return false;
    }
    /// Sets the tables that units of the next round read.
    void replace_guide(OpenBook& book, const AssetReference& guide, std::shared_ptr<const std::string> bytes) {
        const Digest old = std::exchange(preparation().guide, guide).digest;
        preparation().guide_bytes = std::move(bytes);
        book->ledger.pin(file_->number, guide.digest);
        if (old != guide.digest) book.unpin(file_, old);
    }
    /// These two need the open book.
    bool alive() const { return job_.state() == JobState::kPreparing && !stop_.stop_requested(); }
    Preparation& preparation() { return job_.preparation(); }

    Office& office_;
    const JobPtr file_;
    Job& job_;
    const size_t emitter_count_;
    const std::stop_token stop_;
};

Status finish_tables(Office& office, const JobPtr& file, LearnedTables learned) {
    TablesInfo& info = learned.info;
    info.cache_key = table_key(office.options.identity, learned.spec);
    SceneFacts facts;  // empty if the job ended meanwhile; its tables are kept all the same
    {
        const OpenBook book(office);
        Preparation& preparation = file->job.preparation();
        if (!file->job.ended()) book->ledger.make(file->number, info.cache_key);
        preparation.table_key = info.cache_key;
        preparation.capped_by_time_limit = preparation.capped_by_time_limit || info.capped_by_time_limit;
        info.capped_by_time_limit = preparation.capped_by_time_limit;
        facts = std::move(preparation.facts);
    }
    const std::string bytes = serialize(learned.tables);
    crash_point("server.tables-learned");
    office.table_cache.store(info.cache_key, bytes, info);
    crash_point("server.tables-cached");
    log_info("{}: {} from {} samples; {:.2f} s traced, {:.2f} s learned{}{}", file->job.id(), info.what(), info.training_samples,
             info.trace_seconds, learning_seconds(info), info.note.empty() ? "" : "; ", info.note);
    return adopt_tables(office, file, learned.spec, facts, bytes, std::move(info));
}

Status make_tables(Office& office, const JobPtr& file) {
    JobSpec spec;
    std::function<Result<std::shared_ptr<const Scene>>()> build_scene;
    {
        const OpenBook book(office);
        if (file->job.state() != JobState::kPreparing) return over();
        spec = file->job.spec();
        build_scene = file->job.preparation().facts.build_scene;
        file->job.preparation().scene_built = false;
    }
    if (!build_scene) return internal_error("this coordinator cannot build the scene that tables are learned for");
    Result<std::shared_ptr<const Scene>> scene = internal_error("not built");
    LL_RETURN_IF_ERROR(with_room(office, file, [&] {
        scene = build_scene();
        return scene.status();
    }));
    {
        const OpenBook book(office);
        file->job.preparation().scene_built = true;
    }
    const EmitterSet& emitters = (*scene)->emitters();
    Tracing tracing(office, file, emitters.all().size());
    auto learned = learn_tables(std::move(spec), emitters, tracing, office.options.clock, file->stop.get_token());
    if (!learned.ok()) return learned.status();
    return *learned ? finish_tables(office, file, **std::move(learned)) : Status();
}

}  // namespace

void start_learning(Office& office, OpenBook& book, const JobPtr& file) {
    book.start(file, "to learn the tables of this job; choose fewer training-paths, energy-paths or subspaces",
               [&office, file] { return make_tables(office, file); });
}

}  // namespace lightloom
