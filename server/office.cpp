#include "server/office.h"

#include <chrono>
#include <filesystem>
#include <new>
#include <stdexcept>

namespace lightloom {

Office::Office(CoordinatorOptions o, std::unique_ptr<JobStore> store)
    : options(std::move(o)),
      assets(options.directory / "assets"),
      table_cache(options.table_cache, options.table_cache_bytes),
      archive(std::move(store)),
      book(options.lease_seconds) {}

void OpenBook::close() {
    if (!access_) return;
    access_.reset();
    for (const JobInfo& info : std::exchange(ended_, {})) office_.archive.end_soon(info);
    for (const std::string& id : std::exchange(forgotten_, {})) office_.archive.forget_soon(id);
    for (const Effects::Line& line : noted_.log) log_line(line.level, "{}", {line.text});
    noted_ = {};  // frees what is large
    for (const Digest& file : std::exchange(dropped_, {})) {
        const MutexLock files(office_.tables_mutex);
        const bool needed = Guarded<JobBook>::Access(office_.book)->ledger.pinned(file);
        if (!needed) office_.assets.remove(file);
    }
}

void OpenBook::changed(const JobPtr& file) {
    file->job.touch();
    file->changed.notify_all();
    for (const uint64_t number : (*this)->ledger.waiting_for(file->number)) changed((*this)->find(number));
}

void OpenBook::look_again(const JobPtr& file, TimePoint when) {
    if ((*this)->agenda.at_most(file->number, when)) (*this)->agenda_changed.notify_one();
}

void OpenBook::release_crowd(const JobPtr& maker) {
    JobBook& book = **this;
    const TablesInfo& tables = maker->job.tables();
    for (const uint64_t number : book.ledger.waiting_for(maker->number)) {
        const JobPtr file = book.find(number);
        book.ledger.stop_waiting(number);
        Preparation& preparation = file->job.preparation();
        preparation.handed_over = {};
        // The maker of a time-limited job may have settled for a smaller training set, which makes other tables.
        if (tables.asset.size_bytes > 0 && tables.cache_key == preparation.table_key) {
            preparation.handed_over = tables;
            preparation.tables_file = tables.asset.digest;
            book.ledger.pin(number, tables.asset.digest);
        }
        preparation.phase = PreparePhase::kReadingScene;
        if (!book.closing) office_.resume(*this, file);
    }
}

void OpenBook::apply(const JobPtr& file, Effects effects) {
    JobBook& book = **this;
    if (effects.ended) {
        file->stop.request_stop();
        release_crowd(file);
        for (const Digest& tables : book.ledger.forget(file->number)) drop_tables(tables);
        book.job_ended(*file);
        // What has not been read back after a restart is no loss of a job that failed meanwhile: the next start tries again.
        const bool unread = file->job.state() == JobState::kFailed && file->archived && file->archived->planned;
        file->archived.reset();
        // What is on disk of a job that keeps its groups stays until these are written.
        if (effects.keep)
            office_.keep(*this, file);
        else if (!unread)
            note_end(file);
        forget_old_jobs();
    }
    if (effects.changed) changed(file);
    if (effects.units) units_appeared();
    noted_ += std::move(effects);
}

void OpenBook::note_end(const JobPtr& file) {
    if (office_.archive.keeps()) ended_.push_back((*this)->info(*file, office_.now()));
}

void OpenBook::set_paused(std::string why) {
    JobBook& book = **this;
    if (book.paused == why) return;
    const bool news = book.paused.empty() != why.empty();
    book.paused = std::move(why);
    if (!news) return;
    if (book.paused.empty()) {
        noted_.info("there is room on the disk again: jobs go on");
        book.wake_all_waiters();
    } else {
        noted_.error("no units are given out, because the disk is full: " + book.paused);
        book.agenda_changed.notify_one();  // which looks at the disk more often now
    }
    for (const auto& [number, file] : book.open_jobs()) {
        file->job.touch();
        file->changed.notify_all();
    }
}

void OpenBook::forget_old_jobs() {
    const size_t kept = office_.options.kept_jobs;
    for (const JobPtr& old : (*this)->forget_ended(kept)) {
        noted_.info(old->job.id() + ": forgotten; " + std::to_string(kept) + " newer jobs have ended");
        noted_.discard.push_back(old);
        forgotten_.push_back(old->job.id());
    }
}

bool OpenBook::start(const JobPtr& file, const char* purpose, std::function<Status()> task) {
    Office& office = office_;
    const auto run = [&office, file, purpose, work = std::move(task)]() mutable {
        const auto no_memory = [&] {
            return Status(StatusCode::kResourceExhausted, std::string("the coordinator has too little memory ") + purpose);
        };
        Status status;
        try {
            status = work();
        } catch (const std::bad_alloc&) {  // one job that is too large must not end the coordinator and all other jobs
            status = no_memory();
        } catch (const std::length_error&) {
            status = no_memory();
        }
        work = {};
        OpenBook book(office);
        if (!status.ok() && !book->closing) book.fail(file, status);
        --file->running_tasks;
        book.forget_old_jobs();
    };
    ++file->running_tasks;
    try {
        office_.tasks.run(run);
        return true;
    } catch (const std::exception& e) {  // no thread, or no memory for one
        --file->running_tasks;
        fail(file,
             {StatusCode::kResourceExhausted, std::string("the coordinator cannot start a thread ") + purpose + ": " + e.what()});
        return false;
    }
}

void pause(Office& office, const Status& why) { OpenBook(office).set_paused(why.message()); }

Status no_job(const std::string& id) {
    return not_found("no job has the id '" + id +
                     "'; a name is only a label: `lightloom list` shows the ids of those that exist (the oldest that ended are "
                     "forgotten)");
}

Status closing_status() { return {StatusCode::kUnavailable, "the coordinator is going down"}; }

Status with_room(Office& office, const JobPtr& file, const std::function<Status()>& work, WaitsUntil until) {
    for (;;) {
        Status status = work();
        if (status.code() != StatusCode::kResourceExhausted) return status;
        pause(office, status);
        OpenBook book(office);
        const auto over = [&] { return book->closing || (until == WaitsUntil::kJobEnds && file->job.ended()); };
        const auto again = std::chrono::steady_clock::now() + std::chrono::seconds(1);
        while (!over() && std::chrono::steady_clock::now() < again) book.wait_until(file->changed, again);
        if (over()) return {StatusCode::kCancelled, "the job ended while the disk was full"};
    }
}

Status check_room(const Office& office) {
    std::error_code error;
    const auto space = std::filesystem::space(office.options.directory, error);
    if (error) return internal_error(office.options.directory.string() + ": " + error.message());
    if (space.available >= office.options.disk_reserve_bytes) return {};
    return {StatusCode::kResourceExhausted, office.options.directory.string() + " has " + std::to_string(space.available >> 20) +
                                                " MiB left; the coordinator wants " +
                                                std::to_string(office.options.disk_reserve_bytes >> 20) +
                                                " MiB: delete something, or move the directory to a larger disk"};
}

}  // namespace lightloom
