#include "server/end_early.h"

#include "server/finish_job.h"
#include "server/keep_groups.h"

namespace lightloom {

Status EndEarly::written_down(const std::string& job_id, const Status& status, const char* decision) {
    if (status.ok() || status.code() == StatusCode::kNotFound) return {};
    if (status.code() == StatusCode::kResourceExhausted) pause(office_, status);
    return {StatusCode::kUnavailable, "job " + job_id + " goes on: that it is to " + decision + " could not be written down (" +
                                          status.message() + "); try again"};
}

Result<JobInfo> EndEarly::cancel(const std::string& job_id, OnCancel what) {
    OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    if (!file) return no_job(job_id);
    Job& job = file->job;
    if (what == OnCancel::kKeep && !job.ended() && job.merged_groups() > 0) {
        // A coordinator that is killed before the groups are written goes on with the job, and finds that it is to end.
        book.close();
        LL_RETURN_IF_ERROR(written_down(job_id, office_.archive.cancel_and_keep(job_id), "be cancelled"));
        book.reopen();
    }
    if (job.ended()) {
        const JobInfo info = book->info(*file, office_.now());
        const bool kept = job.has_partial();
        book.close();
        // The call may be repeated because the first one could not be put down.
        if (info.state == JobState::kCancelled && !kept) LL_RETURN_IF_ERROR(put_down_end(job_id, info));
        return info;
    }
    if (what == OnCancel::kKeep && file->archived && file->archived->planned)
        return Status(StatusCode::kUnavailable,
                      "job " + job_id + " is being read back after a restart; cancel it again in a moment");
    std::string message;
    if (job.merged_groups() > 0)
        message = what == OnCancel::kKeep
                      ? std::string(kGroupsAreKept)
                      : "its " + std::to_string(job.merged_iterations()) + " sample(s) per pixel were thrown away";
    book.apply(file, job.end(JobState::kCancelled, std::move(message), office_.now(), what));
    const JobInfo info = book->info(*file, office_.now());
    const bool kept = job.has_partial();
    book.close();
    if (kept) return info;
    // That it ended is told to the archive when the book is closed; it is said here once more, to know that it is on disk.
    LL_RETURN_IF_ERROR(put_down_end(job_id, info));
    return info;
}

Status EndEarly::put_down_end(const std::string& job_id, const JobInfo& info) {
    const Status on_disk = office_.archive.end(info);
    if (on_disk.ok() || on_disk.code() == StatusCode::kNotFound) return {};
    return {StatusCode::kUnavailable, "job " + job_id + " is cancelled, but that could not be written down (" + on_disk.message() +
                                          "): after a restart it would go on; cancel it again"};
}

Result<JobInfo> EndEarly::finish(const std::string& job_id) {
    OpenBook book(office_);
    const JobPtr file = book->find(job_id);
    if (!file) return no_job(job_id);
    Job& job = file->job;
    const auto answer = [&]() -> Result<JobInfo> {
        if (job.finishes_early() || job.state() == JobState::kFinishing) return book->info(*file, office_.now());
        const std::string what = "job " + job_id + " is " + std::string(to_string(job.state()));
        if (job.state() == JobState::kPreparing)
            return failed_precondition(what + " (" + phase_text(book->info(*file, office_.now())) +
                                       "): it can be finished once it renders; `lightloom cancel` ends it now");
        return failed_precondition(what + ": there is nothing left to finish");
    };
    if (job.state() != JobState::kRunning || job.finishes_early()) return answer();
    const uint32_t groups = job.merged_groups() + 1;
    book.close();
    LL_RETURN_IF_ERROR(written_down(job_id, office_.archive.finish(job_id, groups), "finish"));
    book.reopen();
    if (job.state() != JobState::kRunning || job.finishes_early()) return answer();
    job.finish_with(groups);
    book->withdraw(*file);
    book.note().info(job_id + ": finishes with its first " + std::to_string(groups) + " group(s), as a client asks");
    book.changed(file);
    finish_if_complete(office_, book, file);
    return book->info(*file, office_.now());
}

}  // namespace lightloom
