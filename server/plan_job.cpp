#include "server/plan_job.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include "common/core/crash_point.h"
#include "server/finish_job.h"
#include "server/keep_groups.h"
#include "server/memory_need.h"
#include "server/resume.h"

namespace lightloom {
namespace {

/// Puts down what the job renders, before anything of it is leased.
Status keep_plan(Office& office, const JobPtr& file, const Job::RenderPlan& plan) {
    JobInfo info;
    info.job_id = file->job.id();
    info.state = JobState::kRunning;
    info.spec = plan.spec;
    info.algorithm = plan.spec.algorithm.name();
    info.tables = plan.tables;
    return with_room(office, file, [&] { return office.archive.plan(info); });
}

}  // namespace

Status plan_units(Office& office, const JobPtr& file, JobSpec spec, SceneFacts facts, TablesInfo tables) {
    const FrameLayout frame = facts.frame;
    const Plan plan(frame, spec.algorithm);
    // A noise target alone may be out of reach.
    const uint64_t iterations = only_noise_bounds(spec) ? JobSpec::kMaxSamplesPerPixel : spec.samples_per_pixel;
    UnitTable units(plan, iterations, most_open_groups(spec, office.options.waiting_bytes), office.options.shuffle_seed);
    auto reducer = std::make_shared<Reducer>(frame, plan.tile_count(), facts.response, spec.noise_target);
    Job::RenderPlan render{
        std::move(spec), std::move(facts.layers), std::move(units), std::move(reducer), std::move(tables), {}, 0, {}};
    Job& job = file->job;
    std::shared_ptr<const ArchivedJob> archived;
    {
        const OpenBook book(office);
        archived = file->archived;
    }
    if (archived && archived->planned) {
        LL_RETURN_IF_ERROR(replay_results(office, *archived, render));
    } else {
        LL_RETURN_IF_ERROR(keep_plan(office, file, render));
    }

    OpenBook book(office);
    if (job.state() != JobState::kPreparing) return {};
    const Digest guide = job.preparation().guide.digest;
    file->archived.reset();
    book.apply(file, job.begin_rendering(std::move(render), office.now()));
    book->ledger.stop_making(file->number);
    book.release_crowd(file);
    book.unpin(file, guide);
    crash_point("server.units-planned");
    if (archived && archived->cancelled) {  // and was killed before its groups were written
        const std::string message = job.merged_groups() > 0 ? kGroupsAreKept : "";
        book.apply(file, job.end(JobState::kCancelled, message, office.now(), OnCancel::kKeep));
        return {};
    }
    if (job.state() == JobState::kRunning && job.spec().time_limit_seconds > 0 && job.seconds_left(office.now()) <= 0) job.close();
    finish_if_complete(office, book, file);  // an earlier coordinator may have had all results
    return {};
}

Status store_tables(Office& office, const Digest& digest, std::string_view bytes) {
    const MutexLock files(office.tables_mutex);
    AssetStore& assets = office.assets;
    if (assets.contains(digest) && !assets.read(digest).ok()) assets.remove(digest);
    return assets.put(digest, bytes);
}

Status adopt_tables(Office& office, const JobPtr& file, const JobSpec& spec, const SceneFacts& facts, std::string_view bytes,
                    TablesInfo tables) {
    const Digest digest = sha256(bytes);
    tables.asset = {digest, bytes.size()};
    {
        const OpenBook book(office);
        if (file->job.ended()) return {};
        // They are pinned before they are stored, so that no job that ends removes them.
        file->job.preparation().tables_file = digest;
        book->ledger.pin(file->number, digest);
    }
    LL_RETURN_IF_ERROR(with_room(office, file, [&] { return store_tables(office, digest, bytes); }));
    crash_point("server.tables-stored");
    LL_RETURN_IF_ERROR(plan_units(office, file, spec, facts, std::move(tables)));
    OpenBook book(office);
    if (file->job.ended() && !book->ledger.pinned(digest)) book.drop_tables(digest);  // it ended while they were stored
    return {};
}

bool adopt_cached_tables(Office& office, const JobPtr& file, const JobSpec& spec, const SceneFacts& facts) {
    const Digest key = table_key(office.options.identity, spec);
    auto entry = office.table_cache.find(key, spec.algorithm.learning()->parts);
    if (!entry) return false;
    {
        OpenBook book(office);
        book.note().info(file->job.id() + ": tables " + entry->info.asset.digest.hex().substr(0, 12) +
                         " of an earlier job are used again");
        entry->info.capped_by_time_limit = file->job.preparation().capped_by_time_limit;
    }
    if (const Status s = adopt_tables(office, file, spec, facts, entry->bytes, std::move(entry->info)); !s.ok())
        OpenBook(office).fail(file, s);
    return true;
}

bool repair_tables(Office& office, const std::string& job_id) {
    JobPtr file;
    std::shared_ptr<const std::string> guide;
    AssetReference asset;
    Digest cache_key;
    std::span<const TablePart* const> parts;
    {
        const OpenBook book(office);
        file = book->find(job_id);
        if (!file || file->job.ended() || !file->job.spec().algorithm.learning()) return false;
        parts = file->job.spec().algorithm.learning()->parts;
        guide = file->job.preparation().guide_bytes;
        asset = guide ? file->job.preparation().guide : file->job.tables().asset;
        cache_key = file->job.tables().cache_key;
    }
    const Digest& digest = asset.digest;
    if (asset.size_bytes == 0) return false;
    Status stored;
    {
        const MutexLock files(office.tables_mutex);
        AssetStore& assets = office.assets;
        if (assets.read(digest).ok()) return false;  // it is the worker's own trouble, or was repaired meanwhile
        assets.remove(digest);
        const auto entry = guide ? std::nullopt : office.table_cache.find(cache_key, parts);
        const bool cached = entry && entry->info.asset.digest == digest;
        stored = guide    ? assets.put(digest, *guide)
                 : cached ? assets.put(digest, entry->bytes)
                          : data_loss("no other copy is left; submit the job again");
    }
    OpenBook book(office);
    if (!stored.ok()) {
        book.fail(file, data_loss("the tables are damaged on the coordinator's disk: " + stored.message()));
        return false;
    }
    book.note().warn(job_id + ": tables " + digest.hex().substr(0, 12) + " were damaged on disk and are restored");
    if (!book->ledger.pinned(digest)) book.drop_tables(digest);  // the job ended meanwhile
    return true;
}

}  // namespace lightloom
