#include "server/store/store.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "common/cli/log_line.h"
#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "server/store/schema.h"

namespace lightloom {
namespace {

/// Most changes of one transaction: a bound for how long the first of them waits.
constexpr size_t kMostChanges = 512;

void end_process(const Status& why) {
    log_error("{}; what is on disk is not known any more, a restart finds out", why.message());
    std::_Exit(EXIT_FAILURE);
}

/// Whether a change was refused for what it is; it has changed nothing, and the others of its batch are not concerned.
bool is_refusal(const Status& status) {
    return status.code() == StatusCode::kNotFound || status.code() == StatusCode::kAlreadyExists ||
           status.code() == StatusCode::kFailedPrecondition;
}

Status check_database_is_there(const std::filesystem::path& file, const std::filesystem::path& segments) {
    std::error_code error;
    if (std::filesystem::file_size(file, error) > 0 && !error) return {};
    if (std::filesystem::is_empty(segments, error) && !error) return {};
    return failed_precondition(segments.string() + " holds results, but " + file.string() +
                               ", which says whose, is gone; put it back, or move " + segments.string() + " away");
}

}  // namespace

Result<std::unique_ptr<JobStore>> JobStore::open(Options options) {
    if (!options.flush_failed) options.flush_failed = end_process;
    const std::filesystem::path segments = options.directory / "segments", file = options.directory / "jobs.db";
    for (const auto& directory : {options.directory, segments, options.directory / "checkpoints"})
        LL_RETURN_IF_ERROR(make_directory(directory, *options.files));
    LL_RETURN_IF_ERROR(check_database_is_there(file, segments));
    auto database = Database::open(file, store_migrations());
    if (!database.ok()) return database.status();
    LL_RETURN_IF_ERROR(options.files->sync_directory(options.directory));
    PayloadPlace last;
    LL_RETURN_IF_ERROR(database->each(
        "SELECT segment, offset, length FROM result WHERE segment IS NOT NULL ORDER BY segment DESC, offset DESC LIMIT 1", {},
        [&](const SqlRow& row) {
            last = {uint32_t(row.integer(0)), uint64_t(row.integer(1)), uint64_t(row.integer(2))};
            return Status();
        }));
    auto log = SegmentLog::open(segments, last, options.segment_bytes, *options.files);
    if (!log.ok()) return log.status();
    std::unique_ptr<JobStore> store(new JobStore(std::move(options), *std::move(database), *std::move(log)));
    LL_RETURN_IF_ERROR(store->drop_leftovers());
    LL_RETURN_IF_ERROR(store->count_live());
    LL_RETURN_IF_ERROR(store->delete_unused());
    store->committer_ = std::jthread([self = store.get()](std::stop_token stop) { self->commit_loop(stop); });
    return store;
}

JobStore::JobStore(Options options, Database database, SegmentLog log)
    : options_(std::move(options)),
      database_(std::move(database)),
      log_(std::move(log)) {}

JobStore::~JobStore() {
    committer_.request_stop();
    if (committer_.joinable()) committer_.join();
}

/// Results and checkpoints of jobs that have ended: nobody will ask for them.
Status JobStore::drop_leftovers() {
    for (const char* const sql : {"DELETE FROM result WHERE job IN (SELECT number FROM job WHERE final IS NOT NULL)",
                                  "DELETE FROM checkpoint WHERE job IN (SELECT number FROM job WHERE final IS NOT NULL)"}) {
        const Status status = database_.run(sql);
        if (status.code() != StatusCode::kResourceExhausted) LL_RETURN_IF_ERROR(status);
        if (!status.ok()) log_warn("results of jobs that have ended stay: {}; the next start tries again", status.message());
    }
    return {};
}

Status JobStore::count_live() {
    return database_.each("SELECT segment, COUNT(*) FROM result WHERE segment IS NOT NULL GROUP BY segment", {},
                          [&](const SqlRow& row) {
                              live_[uint32_t(row.integer(0))] = row.integer(1);
                              return Status();
                          });
}

Status JobStore::delete_unused() {
    const auto segments = log_.segments();
    if (!segments.ok()) return segments.status();
    for (const uint32_t segment : *segments)
        if (!live_.contains(segment)) LL_RETURN_IF_ERROR(log_.remove(segment));

    std::vector<std::string> used;
    LL_RETURN_IF_ERROR(database_.each("SELECT file FROM checkpoint", {}, [&](const SqlRow& row) {
        used.push_back(row.text(0));
        return Status();
    }));
    std::error_code error;
    std::vector<std::filesystem::path> unused;
    for (std::filesystem::directory_iterator entry(checkpoints(), error), end; !error && entry != end; entry.increment(error)) {
        const std::string name = entry->path().filename().string();
        next_checkpoint_ = std::max<uint64_t>(next_checkpoint_, std::strtoull(name.c_str(), nullptr, 10) + 1);
        if (std::find(used.begin(), used.end(), name) == used.end()) unused.push_back(entry->path());
    }
    for (const auto& path : unused)
        if (!error) std::filesystem::remove(path, error);
    return error ? file_error(checkpoints(), "cannot be tidied up", error.value()) : Status();
}

JobStore::Done JobStore::hand_over(Apply apply) {
    Change change{std::move(apply), {}, {}};
    Done done = change.done.get_future();
    {
        const std::lock_guard lock(queue_mutex_);
        queue_.push_back(std::move(change));
    }
    queue_changed_.notify_one();
    return done;
}

void JobStore::commit_loop(std::stop_token stop) {
    std::vector<Change> changes;
    std::unique_lock lock(queue_mutex_);
    while (queue_changed_.wait(lock, stop, [&] { return !queue_.empty(); })) {
        const size_t count = std::min(queue_.size(), kMostChanges);
        changes.assign(std::make_move_iterator(queue_.begin()), std::make_move_iterator(queue_.begin() + ptrdiff_t(count)));
        queue_.erase(queue_.begin(), queue_.begin() + ptrdiff_t(count));
        lock.unlock();
        commit(changes);
        for (Change& change : changes) change.done.set_value(std::move(change.status));
        changes.clear();
        lock.lock();
    }
}

void JobStore::commit(std::span<Change> changes) {
    const std::lock_guard lock(database_mutex_);
    Batch batch;
    const Status status = try_commit(changes, batch);
    if (status.ok()) return settle(batch);
    if (changes.size() == 1 || broken()) {
        for (Change& change : changes) change.status = status;
        return;
    }
    // A large payload may have no room where the others have.
    for (size_t i = 0; i < changes.size(); ++i) {
        Batch alone;
        const Status own = try_commit(changes.subspan(i, 1), alone);
        if (own.ok())
            settle(alone);
        else
            changes[i].status = own;
    }
}

bool JobStore::broken() {
    if (broken_) return true;
    if (log_.broken())
        broken_ = *log_.broken();
    else if (database_.flush_failed())
        broken_ = internal_error((options_.directory / "jobs.db").string() + ": cannot be flushed to disk");
    if (broken_) options_.flush_failed(*broken_);
    return broken_.has_value();
}

Status JobStore::try_commit(std::span<Change> changes, Batch& batch) {
    if (broken()) return *broken_;
    const SegmentLog::Mark mark = log_.mark();
    const auto all = [&]() -> Status {
        LL_RETURN_IF_ERROR(database_.begin());
        for (Change& change : changes) {
            change.status = change.apply(batch);
            if (!change.status.ok() && !is_refusal(change.status)) return change.status;
        }
        crash_point("server.payloads-written");
        LL_RETURN_IF_ERROR(log_.sync());
        crash_point("server.payloads-synced");
        return database_.commit();
    };
    Status status = all();
    if (status.ok()) {
        crash_point("server.batch-committed");
        ++batches_;
        return status;
    }
    if (broken()) return *broken_;
    // Neither can fail unless more is wrong than there being no room.
    if (Status undone = database_.rollback(); !undone.ok()) broken_ = undone;
    if (Status undone = log_.rewind(mark); !undone.ok() && !broken_) broken_ = undone;
    if (broken_) options_.flush_failed(*broken_);
    return status;
}

void JobStore::settle(const Batch& batch) {
    for (const auto& [segment, change] : batch.live) {
        const int64_t live = live_[segment] += change;
        if (live > 0) continue;
        live_.erase(segment);
        if (const Status removed = log_.remove(segment); !removed.ok())
            log_warn("{}; the next start tries again", removed.message());
    }
    for (const std::string& file : batch.unused_checkpoints) {
        std::error_code error;
        std::filesystem::remove(checkpoints() / file, error);
        if (error)
            log_warn("{}: cannot be deleted: {}; the next start tries again", (checkpoints() / file).string(), error.message());
    }
}

Result<StoredPayload> JobStore::read_payload(const StoredResult& result) const {
    if (!result.place) return failed_precondition("the payload of unit " + unit_name(result.unit) + " is part of a checkpoint");
    auto bytes = log_.read(*result.place);
    if (!bytes.ok()) return bytes.status();
    StoredPayload payload{*std::move(bytes), 0};
    uint32_t size = 0;
    const bool whole = payload.bytes.size() >= StoredPayload::kPrefix;
    if (whole) std::copy_n(payload.bytes.data(), sizeof size, reinterpret_cast<char*>(&size));
    if (!whole || size > payload.bytes.size() - StoredPayload::kPrefix)
        return data_loss("the saved result of unit " + unit_name(result.unit) + " is damaged; it has to be rendered again");
    payload.header_size = size;
    return payload;
}

Status JobStore::put_checkpoint(const std::string& id, uint32_t groups, std::string_view state) {
    char name[32];
    std::snprintf(name, sizeof name, "%06llu.state", static_cast<unsigned long long>(next_checkpoint_++));
    const StoredCheckpoint checkpoint{groups, name, sha256(state), state.size()};
    const std::filesystem::path path = checkpoints() / name;
    if (const Status written = write_file_atomically(path.string(), state); !written.ok())
        return written.code() == StatusCode::kResourceExhausted ? written : internal_error(written.message());
    Status status = options_.files->sync_directory(checkpoints());
    crash_point("server.checkpoint-saved");
    if (status.ok()) status = hand_over([&](Batch& batch) { return insert_checkpoint(batch, id, checkpoint); }).get();
    std::error_code error;
    if (!status.ok()) std::filesystem::remove(path, error);
    return status;
}

Result<std::string> JobStore::read_checkpoint(const StoredCheckpoint& checkpoint) const {
    const std::string path = (checkpoints() / checkpoint.file).string();
    auto bytes = read_file(path);
    // It is the store's own file: what keeps it from being read is nobody's argument.
    if (!bytes.ok() && bytes.status().code() != StatusCode::kNotFound) return internal_error(bytes.status().message());
    if (!bytes.ok() || bytes->size() != checkpoint.size || sha256(*bytes) != checkpoint.digest)
        return data_loss(path + ": the saved sums are damaged or gone; the job has to be rendered again");
    return bytes;
}

}  // namespace lightloom
