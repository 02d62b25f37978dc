#include "server/prepare_job.h"

#include <algorithm>

#include "common/core/crash_point.h"
#include "common/core/usable_memory.h"
#include "common/transport/parameters.h"
#include "server/memory_need.h"
#include "server/plan_job.h"
#include "server/resume.h"
#include "server/training_budget.h"

namespace lightloom {
namespace {

MemoryNeed memory_need_of(const Office& office, const JobSpec& spec) {
    return memory_need(spec, office.options.waiting_bytes, office.options.training_bytes);
}

/// Whether the host has the memory for the job beside those that render now; jobs that wait hold no sums.
Status admit(Office& office, const JobSpec& spec) {
    const int64_t given = office.options.memory_bytes;
    const uint64_t host = given > 0 ? uint64_t(given) : usable_memory();
    uint64_t others = 0;
    {
        const OpenBook book(office);
        for (const auto& [number, file] : book->open_jobs())
            if (const UnitTable* const units = file->job.open_units(); units && file->job.state() == JobState::kRunning)
                if (units->done_count() > 0) others += memory_need_of(office, file->job.spec()).peak();
    }
    return check_memory(spec, memory_need_of(office, spec), host, others);
}

/// Looks the tables up; otherwise the job waits for them or begins to make them.
Status prepare_tables(Office& office, const JobPtr& file, JobSpec spec, SceneFacts facts, bool may_wait) {
    Job& job = file->job;
    const bool chosen_size = job.submission().submitted.algorithm.chosen(kTrainingPaths);
    if (spec.samples_per_pixel > 0 && spec.algorithm.has(kTrainingPaths) && !chosen_size) {
        const uint64_t image_samples = uint64_t(spec.frame.crop.area()) * spec.samples_per_pixel;
        const uint64_t samples = proportionate_training_samples(image_samples, learning_plan(spec.algorithm).samples);
        spec.algorithm = spec.algorithm.with(kTrainingPaths, double(samples));
    }
    if (adopt_cached_tables(office, file, spec, facts)) return {};
    OpenBook book(office);
    if (job.state() != JobState::kPreparing) return {};
    Preparation& preparation = job.preparation();
    // A training set that the user chose is not made smaller, and neither is one that a probe has already chosen.
    const bool open_size =
        spec.time_limit_seconds > 0 && !chosen_size && !preparation.capped_by_time_limit && spec.algorithm.has(kTrainingPaths);
    const uint64_t samples = learning_plan(spec.algorithm).samples;
    preparation.table_key = table_key(office.options.identity, spec);
    preparation.facts = std::move(facts);
    preparation.may_wait = may_wait;
    job.complete_spec(std::move(spec));
    // Another job may take far longer to make the tables than this one's limit allows: therefore this job probes first,
    // see TracingPort::settle().
    const bool probes = open_size && samples > kMinTrainingSamples;
    // A job that has training data from before a restart makes its tables itself.
    const bool traced = file->archived && !file->archived->results.empty();
    if (may_wait && !probes && !traced && wait_for_maker(book, file)) return {};
    if (!probes) {
        open_first_round(office, book, file);
        return {};
    }
    const auto roomy = uint64_t(std::min(job.spec().time_limit_seconds * kProbeSamplesPerSecond, double(kTrainingUnitSamples)));
    const uint64_t probe = std::min(std::max(kProbeSamples, roomy), samples);
    open_training(office, book, file, UnitKind::kProbe, 0, {0, probe, probe});
    return {};
}

/// What an earlier coordinator left of the job is of no use: it begins anew.
Status begin_anew(Office& office, const JobPtr& file, const std::string& why) {
    {
        OpenBook book(office);
        book.note().warn(file->job.id() + ": what was done for it before the restart is of no use, because " + why);
        file->archived.reset();
        book.unpin(file, file->job.preparation().tables_file);
    }
    return with_room(office, file, [&] { return office.archive.begin_anew(file->job.id(), office.options.identity); });
}

/// Goes on with a job that an earlier coordinator began to render. False if it cannot: then it begins anew.
Result<bool> resume_rendering(Office& office, const JobPtr& file, const JobInfo& planned, const SceneFacts& facts) {
    if (planned.spec.frame != facts.frame) {
        LL_RETURN_IF_ERROR(begin_anew(office, file, "its frame is another one now"));
        return false;
    }
    if (planned.tables.asset.size_bytes == 0) {
        LL_RETURN_IF_ERROR(plan_units(office, file, planned.spec, facts, planned.tables));
        return true;
    }
    auto bytes = office.assets.read(planned.tables.asset.digest);
    if (!bytes.ok()) {
        auto entry = office.table_cache.find(planned.tables.cache_key, planned.spec.algorithm.learning()->parts);
        if (entry && entry->info.asset.digest == planned.tables.asset.digest) bytes = std::move(entry->bytes);
    }
    if (!bytes.ok()) {
        LL_RETURN_IF_ERROR(begin_anew(office, file, "its tables are gone: " + bytes.status().message()));
        return false;
    }
    LL_RETURN_IF_ERROR(adopt_tables(office, file, planned.spec, facts, *bytes, planned.tables));
    return true;
}

Status prepare(Office& office, const JobPtr& file) {
    JobSpec spec;
    std::shared_ptr<const ArchivedJob> archived;
    {
        const OpenBook book(office);
        spec = file->job.spec();
        archived = file->archived;
    }
    const bool cancelled = archived && archived->cancelled;
    if (archived && archived->build != name_of(office.options.identity)) {
        LL_RETURN_IF_ERROR(begin_anew(office, file, "another build did it"));
        archived.reset();
    }
    Result<SceneFacts> facts = internal_error("not read");
    LL_RETURN_IF_ERROR(with_room(office, file, [&] {
        facts = office.options.read_scene(office.assets, spec, file->stop.get_token());
        return facts.status();
    }));
    crash_point("server.scene-read");
    const Rect& crop = facts->frame.crop;
    if (crop.empty() || crop.area() > kMaxPartialPixels)
        return invalid_argument("the crop window must hold between 1 and " + std::to_string(kMaxPartialPixels) + " pixels");
    if (archived && archived->planned) {
        const auto resumed = resume_rendering(office, file, *archived->planned, *facts);
        if (!resumed.ok()) return resumed.status();
        if (*resumed) return {};
    }
    if (cancelled) {  // and nothing that could be kept is left
        OpenBook book(office);
        book.apply(file, file->job.end(JobState::kCancelled, {}, office.now()));
        return {};
    }
    spec.frame = facts->frame;
    if (spec.max_depth < 0) spec.max_depth = facts->max_depth;
    LL_RETURN_IF_ERROR(admit(office, spec));
    if (spec.algorithm.learning()) return prepare_tables(office, file, std::move(spec), *std::move(facts), true);
    return plan_units(office, file, std::move(spec), *std::move(facts), {});
}

Status take_over_tables(Office& office, const JobPtr& file) {
    JobSpec spec;
    SceneFacts facts;
    TablesInfo tables;
    {
        const OpenBook book(office);
        if (file->job.state() != JobState::kPreparing) return {};
        Preparation& preparation = file->job.preparation();
        tables = std::exchange(preparation.handed_over, {});
        tables.from_cache = true;
        tables.capped_by_time_limit = preparation.capped_by_time_limit;
        facts = std::move(preparation.facts);
        spec = file->job.spec();
    }
    if (tables.asset.size_bytes == 0) return prepare_tables(office, file, std::move(spec), std::move(facts), true);
    const auto bytes = office.assets.read(tables.asset.digest);
    if (!bytes.ok()) return prepare_tables(office, file, std::move(spec), std::move(facts), false);
    return adopt_tables(office, file, spec, facts, *bytes, std::move(tables));
}

}  // namespace

void start_preparing(Office& office, OpenBook& book, const JobPtr& file) {
    book.start(file, "to prepare this job: its scene or frame is too large", [&office, file] { return prepare(office, file); });
}

void start_taking_over(Office& office, OpenBook& book, const JobPtr& file) {
    book.changed(file);
    book.start(file, "to prepare this job: its frame or tables are too large",
               [&office, file] { return take_over_tables(office, file); });
}

bool wait_for_maker(OpenBook& book, const JobPtr& file) {
    const auto maker = book->ledger.maker_of(file->job.preparation().table_key, file->number);
    if (!maker) return false;
    book->ledger.wait(file->number, *maker);
    book.note().info(file->job.id() + ": waits for the tables of " + book->find(*maker)->job.id());
    book.apply(file, file->job.wait_for_tables());
    book.release_crowd(file);  // who waits for it looks again, and finds the same maker
    return true;
}

void open_training(Office& office, OpenBook& book, const JobPtr& file, UnitKind kind, uint32_t round, const TrainingWork& work) {
    book.apply(file, file->job.open_round(kind, round, work, office.options.shuffle_seed));
    start_replaying_training(office, book, file);
}

void open_first_round(Office& office, OpenBook& book, const JobPtr& file) {
    book->ledger.make(file->number, file->job.preparation().table_key);
    open_training(office, book, file, UnitKind::kTraining, 0, learning_plan(file->job.spec().algorithm).work(0));
}

}  // namespace lightloom
