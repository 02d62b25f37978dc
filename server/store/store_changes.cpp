// The changes of a JobStore as SQL. All of them run on the committer's thread, inside a transaction.

#include "server/store/store.h"

#include <array>
#include <utility>

namespace lightloom {
namespace {

SqlBlob blob(const Digest& digest) { return {{reinterpret_cast<const char*>(digest.bytes.data()), digest.bytes.size()}}; }

std::optional<SqlBlob> blob(const std::optional<std::string>& bytes) {
    return bytes ? std::optional(SqlBlob{*bytes}) : std::nullopt;
}

Result<Digest> digest_of(std::string_view bytes) {
    Digest digest;
    if (bytes.size() != digest.bytes.size()) return data_loss("the store holds a digest of another length");
    std::copy(bytes.begin(), bytes.end(), reinterpret_cast<char*>(digest.bytes.data()));
    return digest;
}

Result<JobState> state_of(std::string_view word) {
    for (int i = 0; i <= int(JobState::kCancelled); ++i)
        if (to_string(JobState(i)) == word) return JobState(i);
    return data_loss("the store holds a job in the state \"" + std::string(word) + "\", which is none");
}

}  // namespace

Result<int64_t> JobStore::number_of(const std::string& id) {
    int64_t number = 0;
    LL_RETURN_IF_ERROR(database_.each("SELECT number FROM job WHERE id=?", {id}, [&](const SqlRow& row) {
        number = row.integer(0);
        return Status();
    }));
    if (number == 0) return not_found("the store holds no job " + id);
    return number;
}

Result<int64_t> JobStore::open_number_of(const std::string& id) {
    auto number = number_of(id);
    if (!number.ok()) return number;
    bool ended = false;
    LL_RETURN_IF_ERROR(database_.each("SELECT final IS NOT NULL FROM job WHERE number=?", {*number}, [&](const SqlRow& row) {
        ended = row.integer(0) != 0;
        return Status();
    }));
    return ended ? not_found("job " + id + " has ended") : number;
}

JobStore::Done JobStore::put_job(NewJob job, std::optional<StoredEvent> first) {
    return hand_over([this, job = std::move(job), first = std::move(first)](Batch&) -> Status {
        const auto known = number_of(job.id);
        if (known.ok()) return {StatusCode::kAlreadyExists, "the store holds job " + job.id + " already"};
        if (known.status().code() != StatusCode::kNotFound) return known.status();
        LL_RETURN_IF_ERROR(database_.run(
            "INSERT INTO job(id,request_id,created_at,submitted,label,scene,state) VALUES(?,?,?,?,?,?,?)",
            {job.id, job.request_id, job.created_at, SqlBlob{job.submitted}, SqlBlob{job.label}, job.scene, to_string(job.state)}));
        if (!first) return {};
        return database_.run("INSERT INTO event(job,number,kind,bytes) SELECT number, 1, ?, ? FROM job WHERE id=?",
                             {first->kind, SqlBlob{first->bytes}, job.id});
    });
}

JobStore::Done JobStore::update_job(std::string id, JobUpdate update) {
    return hand_over([this, id = std::move(id), update = std::move(update)](Batch&) -> Status {
        const auto job = number_of(id);
        if (!job.ok()) return job.status();
        const auto state = update.state ? std::optional(to_string(*update.state)) : std::nullopt;
        return database_.run(
            "UPDATE job SET state=COALESCE(?,state), message=COALESCE(?,message), scene=COALESCE(?,scene), spec=COALESCE(?,spec) "
            "WHERE number=?",
            {state, update.message, update.scene, blob(update.spec), *job});
    });
}

JobStore::Done JobStore::end_job(std::string id, JobState state, std::string message, std::string info) {
    return hand_over(
        [this, id = std::move(id), state, message = std::move(message), info = std::move(info)](Batch& batch) -> Status {
            const auto job = number_of(id);
            if (!job.ok()) return job.status();
            LL_RETURN_IF_ERROR(drop(batch, *job));
            return database_.run("UPDATE job SET state=?, message=?, final=? WHERE number=?",
                                 {to_string(state), message, SqlBlob{info}, *job});
        });
}

JobStore::Done JobStore::forget_job(std::string id) {
    return hand_over([this, id = std::move(id)](Batch& batch) -> Status {
        const auto job = number_of(id);
        if (!job.ok()) return job.status();
        LL_RETURN_IF_ERROR(drop(batch, *job));
        return database_.run("DELETE FROM job WHERE number=?", {*job});
    });
}

JobStore::Done JobStore::append_event(std::string id, std::string kind, std::string bytes) {
    return hand_over([this, id = std::move(id), kind = std::move(kind), bytes = std::move(bytes)](Batch&) -> Status {
        const auto job = number_of(id);
        if (!job.ok()) return job.status();
        return database_.run(
            "INSERT INTO event(job,number,kind,bytes) SELECT ?1, 1+COALESCE(MAX(number),0), ?2, ?3 FROM event WHERE job=?1",
            {*job, kind, SqlBlob{bytes}});
    });
}

JobStore::Done JobStore::drop_result(std::string id, UnitKey unit) {
    return hand_over([this, id = std::move(id), unit](Batch& batch) -> Status {
        const auto job = number_of(id);
        if (!job.ok()) return job.status();
        LL_RETURN_IF_ERROR(database_.each(
            "SELECT segment FROM result WHERE job=? AND kind=? AND round=? AND unit_group=? AND tile=? AND segment IS NOT NULL",
            {*job, int(unit.kind), unit.round, unit.group, unit.tile}, [&](const SqlRow& row) {
                --batch.live[uint32_t(row.integer(0))];
                return Status();
            }));
        return database_.run("DELETE FROM result WHERE job=? AND kind=? AND round=? AND unit_group=? AND tile=?",
                             {*job, int(unit.kind), unit.round, unit.group, unit.tile});
    });
}

JobStore::Done JobStore::drop_results(std::string id) {
    return hand_over([this, id = std::move(id)](Batch& batch) -> Status {
        const auto job = number_of(id);
        return job.ok() ? drop(batch, *job) : job.status();
    });
}

Status JobStore::drop(Batch& batch, int64_t job) {
    LL_RETURN_IF_ERROR(database_.each("SELECT segment, COUNT(*) FROM result WHERE job=? AND segment IS NOT NULL GROUP BY segment",
                                      {job}, [&](const SqlRow& row) {
                                          batch.live[uint32_t(row.integer(0))] -= row.integer(1);
                                          return Status();
                                      }));
    LL_RETURN_IF_ERROR(database_.each("SELECT file FROM checkpoint WHERE job=?", {job}, [&](const SqlRow& row) {
        batch.unused_checkpoints.push_back(row.text(0));
        return Status();
    }));
    LL_RETURN_IF_ERROR(database_.run("DELETE FROM result WHERE job=?", {job}));
    return database_.run("DELETE FROM checkpoint WHERE job=?", {job});
}

Status JobStore::put_result(const std::string& id, const NewResult& result) {
    return hand_over([&](Batch& batch) { return insert_result(batch, id, result); }).get();
}

Status JobStore::insert_result(Batch& batch, const std::string& id, const NewResult& result) {
    const auto job = open_number_of(id);
    if (!job.ok()) return job.status();
    const UnitKey& unit = result.unit;
    bool known = false, same = false;
    LL_RETURN_IF_ERROR(database_.each("SELECT digest FROM result WHERE job=? AND kind=? AND round=? AND unit_group=? AND tile=?",
                                      {*job, int(unit.kind), unit.round, unit.group, unit.tile}, [&](const SqlRow& row) {
                                          known = true;
                                          same = row.bytes(0) == blob(result.digest).bytes;
                                          return Status();
                                      }));
    if (same) return {};
    if (known) return {StatusCode::kAlreadyExists, "the store holds another result of unit " + unit_name(unit) + " of job " + id};
    const uint32_t header_size = uint32_t(result.header.size());
    const std::string_view prefix(reinterpret_cast<const char*>(&header_size), sizeof header_size);
    static_assert(sizeof header_size == StoredPayload::kPrefix);
    const auto place = log_.append(std::array{prefix, result.header, result.payload});
    if (!place.ok()) return place.status();
    LL_RETURN_IF_ERROR(database_.run("INSERT OR IGNORE INTO worker VALUES(?,?,?)", {*job, result.worker, SqlBlob{result.who}}));
    LL_RETURN_IF_ERROR(database_.run("INSERT INTO result VALUES(?,?,?,?,?,?,?,?,?,?,?)",
                                     {*job, int(unit.kind), unit.round, unit.group, unit.tile, blob(result.digest), result.worker,
                                      result.seconds, place->segment, place->offset, place->length}));
    ++batch.live[place->segment];
    return {};
}

Status JobStore::insert_checkpoint(Batch& batch, const std::string& id, const StoredCheckpoint& checkpoint) {
    const auto job = open_number_of(id);
    if (!job.ok()) return job.status();
    int64_t before = 0;
    std::string old_file;
    LL_RETURN_IF_ERROR(database_.each("SELECT groups, file FROM checkpoint WHERE job=?", {*job}, [&](const SqlRow& row) {
        before = row.integer(0);
        old_file = row.text(1);
        return Status();
    }));
    if (before > int64_t(checkpoint.groups)) return failed_precondition("the store holds a checkpoint of more groups of job " + id);
    LL_RETURN_IF_ERROR(database_.run("INSERT OR REPLACE INTO checkpoint VALUES(?,?,?,?,?)",
                                     {*job, checkpoint.groups, checkpoint.file, blob(checkpoint.digest), checkpoint.size}));
    LL_RETURN_IF_ERROR(database_.each(
        "SELECT segment, COUNT(*) FROM result WHERE job=? AND kind=? AND unit_group<? AND segment IS NOT NULL GROUP BY segment",
        {*job, int(UnitKind::kRender), checkpoint.groups}, [&](const SqlRow& row) {
            batch.live[uint32_t(row.integer(0))] -= row.integer(1);
            return Status();
        }));
    if (!old_file.empty()) batch.unused_checkpoints.push_back(old_file);
    return database_.run(
        "UPDATE result SET segment=NULL, offset=NULL, length=NULL WHERE job=? AND kind=? AND unit_group<? AND segment IS NOT NULL",
        {*job, int(UnitKind::kRender), checkpoint.groups});
}

Result<std::vector<StoredJob>> JobStore::load() {
    const std::lock_guard lock(database_mutex_);
    std::vector<StoredJob> jobs;
    std::vector<int64_t> numbers;
    LL_RETURN_IF_ERROR(database_.each(
        "SELECT number,id,request_id,created_at,submitted,label,scene,state,message,spec,final FROM job ORDER BY number", {},
        [&](const SqlRow& row) -> Status {
            const auto state = state_of(row.bytes(7));
            if (!state.ok()) return state.status();
            const auto some = [&](int i) { return row.is_null(i) ? std::nullopt : std::optional(row.text(i)); };
            numbers.push_back(row.integer(0));
            jobs.push_back({.job = {row.text(1), row.text(2), row.text(3), row.text(4), row.text(5), row.text(6), *state},
                            .message = row.text(8),
                            .spec = some(9),
                            .info = some(10)});
            return {};
        }));
    for (size_t i = 0; i < jobs.size(); ++i) LL_RETURN_IF_ERROR(load_parts(numbers[i], jobs[i]));
    return jobs;
}

Status JobStore::load_parts(int64_t job, StoredJob& out) {
    LL_RETURN_IF_ERROR(database_.each("SELECT kind, bytes FROM event WHERE job=? ORDER BY number", {job}, [&](const SqlRow& row) {
        out.events.push_back({row.text(0), row.text(1)});
        return Status();
    }));
    LL_RETURN_IF_ERROR(
        database_.each("SELECT number, bytes FROM worker WHERE job=? ORDER BY number", {job}, [&](const SqlRow& row) {
            out.workers.push_back({uint32_t(row.integer(0)), row.text(1)});
            return Status();
        }));
    LL_RETURN_IF_ERROR(database_.each(
        "SELECT kind,round,unit_group,tile,digest,worker,seconds,segment,offset,length FROM result WHERE job=? "
        "ORDER BY kind,round,unit_group,tile",
        {job}, [&](const SqlRow& row) -> Status {
            const auto digest = digest_of(row.bytes(4));
            if (!digest.ok()) return digest.status();
            StoredResult& result = out.results.emplace_back();
            result.unit = {uint32_t(row.integer(2)), uint32_t(row.integer(3)), UnitKind(row.integer(0)), uint32_t(row.integer(1))};
            result.digest = *digest;
            result.worker = uint32_t(row.integer(5));
            result.seconds = row.real(6);
            if (!row.is_null(7))
                result.place = PayloadPlace{uint32_t(row.integer(7)), uint64_t(row.integer(8)), uint64_t(row.integer(9))};
            return {};
        }));
    return database_.each("SELECT groups,file,digest,size FROM checkpoint WHERE job=?", {job}, [&](const SqlRow& row) -> Status {
        const auto digest = digest_of(row.bytes(2));
        if (!digest.ok()) return digest.status();
        out.checkpoint = StoredCheckpoint{uint32_t(row.integer(0)), row.text(1), *digest, uint64_t(row.integer(3))};
        return {};
    });
}

}  // namespace lightloom
