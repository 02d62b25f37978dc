#include "server/resume.h"

#include <algorithm>
#include <chrono>

#include "common/cli/log_line.h"
#include "server/admission.h"
#include "server/learn_job.h"
#include "server/prepare_job.h"

namespace lightloom {
namespace {

/// A revision that nobody has seen: an earlier coordinator began earlier, and made fewer than 65536 in a millisecond.
uint64_t first_revision() {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return uint64_t(std::chrono::duration_cast<std::chrono::milliseconds>(now).count()) << 16;
}

/// The job as far as its submission says what it is; `archived` says how far it was. `build` is the name of the present one.
Result<JobPtr> restore_job(JobBook& book, ArchivedJob archived, const std::string& build, TimePoint now) {
    if (archived.build != build) {  // what another build did is rendered anew, and takes its time again
        archived.learning_seconds = archived.rendering_seconds = 0;
        archived.settled.reset();
    }
    const Job::Past past{archived.age_seconds, archived.rendering_seconds, first_revision()};
    auto key = reuse_key(archived.submission.submitted);
    if (archived.last) {
        if (archived.build != build) key.reset();  // another build may render other bytes
        const JobPtr file = book.add(Job(std::move(archived.submission), *archived.last, now, past), key);
        book.job_ended(*file);
        return file;
    }
    auto canonical = canonical_spec(archived.submission.submitted);
    if (!canonical.ok()) return canonical.status();
    if (archived.finish_with || archived.cancelled) key.reset();
    const JobPtr file = book.add(Job(archived.submission, *std::move(canonical), now, past), key);
    if (archived.finish_with) file->job.finish_with(*archived.finish_with);
    Preparation& preparation = file->job.preparation();
    preparation.learning_seconds = archived.learning_seconds;
    if (archived.settled) {
        file->job.complete_spec(*archived.settled);
        preparation.capped_by_time_limit = true;
    }
    if (archived.planned) {
        preparation.tables_file = archived.planned->tables.asset.digest;
        book.ledger.pin(file->number, preparation.tables_file);
    }
    file->archived = std::make_shared<const ArchivedJob>(std::move(archived));
    return file;
}

/// Whether it was the reading that failed, of bytes that may be as good as ever: too many open files, a device that does not
/// answer.
bool may_pass(const Status& status) {
    return status.code() == StatusCode::kInternal || status.code() == StatusCode::kResourceExhausted;
}

/// Adds the stored partials of groups that are not in the checkpoint. Returns those that could be read, in their order. What is
/// damaged is dropped; what could not be read is rendered again all the same, to the bytes that are there.
std::vector<const StoredResult*> replay_partials(Office& office, const ArchivedJob& archived, const UnitTable& units,
                                                 Job::RenderPlan& plan) {
    std::vector<const StoredResult*> good;
    for (const StoredResult& result : archived.results) {
        if (result.unit.kind != UnitKind::kRender) continue;
        if (!result.place) {  // the checkpoint has it
            good.push_back(&result);
            continue;
        }
        const auto unit = units.find(result.unit);
        const auto read = [&]() -> Status {
            if (!unit) return data_loss("there is no such unit");
            const RenderUnit& work = unit->render;
            const auto partial =
                office.archive.read_partial(result, {plan.spec.frame, work.tile, work.samples_per_pixel(), work.light_path_count});
            if (!partial.ok()) return partial.status();
            const auto refused = plan.reducer->add(*unit, *partial);
            if (!refused.ok()) return refused.status();
            if (*refused) return **refused;
            plan.counters += partial->counters;
            plan.dropped += partial->dropped_count;
            return {};
        };
        if (const Status status = read(); !status.ok()) {
            log_warn("{}: unit {} is rendered again: {}", archived.submission.id, unit_name(result.unit), status.message());
            if (!may_pass(status)) office.archive.drop_soon(archived.submission.id, result.unit);
            continue;
        }
        good.push_back(&result);
    }
    return good;
}

UnitTable::Known known(const StoredResult& result) { return {result.unit, result.worker, result.digest}; }

Status replay_training(Office& office, const JobPtr& file) {
    std::shared_ptr<const ArchivedJob> archived;
    UnitKind kind{};
    uint32_t round = 0;
    {
        const OpenBook book(office);
        archived = file->archived;
        if (!archived || file->job.state() != JobState::kPreparing || !file->job.preparation().round) return {};
        kind = file->job.preparation().round->kind();
        round = file->job.preparation().round->number();
    }
    size_t count = 0;
    for (const StoredResult& result : archived->results) {
        if (result.unit.kind != kind || result.unit.round != round || !result.place) continue;
        auto part = office.archive.read_training(result);
        OpenBook book(office);
        UnitTable* const units = file->job.open_units(result.unit);
        if (!units) return {};                     // the job ended meanwhile
        (void)units->has_more_than(SIZE_MAX - 1);  // opens all units of the round
        const auto unit = units->find(result.unit);
        Status problem = unit ? part.status() : data_loss("there is no such unit");
        if (problem.ok()) problem = check_unit_data(part->data, file->job.spec(), unit->training);
        if (!problem.ok()) {
            book.note().warn(file->job.id() + ": unit " + unit_name(result.unit) + " is traced again: " + problem.message());
            if (!may_pass(problem)) office.archive.drop_soon(file->job.id(), result.unit);
            continue;
        }
        // A worker may have been faster than the disk.
        if (units->complete(result.unit, result.worker, result.digest) != UnitTable::Completion::kFirst) continue;
        file->job.preparation().round->add(result.unit.group, *std::move(part));
        ++count;
        book.changed(file);
    }
    OpenBook book(office);
    if (count == 0 || !file->job.preparation().round || file->job.state() != JobState::kPreparing) return {};
    book.note().info(file->job.id() + ": " + std::to_string(count) + " training unit(s) were traced before the restart");
    Preparation& preparation = file->job.preparation();
    if (preparation.round_begin == TimePoint()) preparation.round_begin = office.now();
    if (preparation.training_begin == TimePoint()) {
        preparation.training_begin = preparation.round_begin;
        start_learning(office, book, file);
    }
    return {};
}

}  // namespace

Status replay_results(Office& office, const ArchivedJob& archived, Job::RenderPlan& plan) {
    const std::string& id = archived.submission.id;
    uint32_t merged = 0;
    if (archived.checkpoint) {
        const auto bytes = office.archive.read_checkpoint(*archived.checkpoint);
        const Status restored = bytes.ok() ? plan.reducer->restore(*bytes) : bytes.status();
        // Then the job fails, and nothing says so on disk: the next start tries again.
        if (may_pass(restored)) return restored;
        if (!restored.ok()) {
            log_warn("{}: it is rendered anew, because its checkpoint cannot be used: {}", id, restored.message());
            office.archive.drop_all_soon(id);
            return {};
        }
        merged = archived.checkpoint->groups;
    }
    std::vector<UnitTable::Known> all;
    for (const StoredResult& result : archived.results)
        if (result.unit.kind == UnitKind::kRender) all.push_back(known(result));
    UnitTable units = plan.units;  // for what the units are
    LL_RETURN_IF_ERROR(units.restore(merged, all));
    plan.counters = plan.reducer->counters();
    plan.dropped = plan.reducer->dropped();
    const auto good = replay_partials(office, archived, units, plan);
    std::vector<UnitTable::Known> kept;
    for (const StoredResult* result : good) {
        kept.push_back(known(*result));
        plan.workers.insert(result->worker);
    }
    LL_RETURN_IF_ERROR(plan.units.restore(merged, kept));
    if (!kept.empty()) log_info("{}: {} unit(s) were rendered before the restart", id, kept.size());
    return {};
}

void start_replaying_training(Office& office, OpenBook& book, const JobPtr& file) {
    if (!file->archived) return;
    book.start(file, "to read the training data of this job", [&office, file] { return replay_training(office, file); });
}

Status restore_jobs(Office& office) {
    std::map<uint32_t, WorkerHello> workers;
    std::vector<std::string> unreadable;
    auto jobs = office.archive.load(office.options.directory / "jobs", workers, unreadable);
    if (!jobs.ok()) return jobs.status();
    for (const std::string& line : unreadable) log_error("{}; the job stays on disk and is left out", line);
    OpenBook book(office);
    for (const auto& [index, hello] : workers) book->workers.restore(index, hello);
    size_t open = 0;
    for (ArchivedJob& archived : *jobs) {
        const std::string id = archived.submission.id;
        const auto file = restore_job(*book, std::move(archived), name_of(office.options.identity), office.now());
        if (!file.ok()) {
            book.note().error(id + ": " + file.status().message() + "; the job stays on disk and is left out");
        } else if (!(*file)->job.ended()) {
            if ((*file)->archived->cancelled && !(*file)->archived->planned) {
                book.apply(*file, (*file)->job.end(JobState::kCancelled, {}, office.now()));
                continue;
            }
            ++open;
            start_preparing(office, book, *file);
        }
    }
    if (!jobs->empty())
        book.note().info(std::to_string(jobs->size()) + " job(s) of an earlier coordinator, of which " + std::to_string(open) +
                         " go on");
    return {};
}

}  // namespace lightloom
