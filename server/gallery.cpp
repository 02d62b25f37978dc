#include "server/gallery.h"

#include <new>

#include "common/core/atomic_file.h"
#include "server/results.h"

namespace lightloom {
namespace {

/// How long a manifest is waited for that is being written.
constexpr auto kWrittenSoon = std::chrono::seconds(5);

std::string is_in_state(const Job& job) { return "job " + job.id() + " is " + std::string(to_string(job.state())); }

Status not_succeeded(const Job& job, const char* what) {
    return failed_precondition(is_in_state(job) + "; its " + what + " exists once it has succeeded");
}

}  // namespace

Result<std::string> Gallery::image(const std::string& job_id, ImageKind kind) const {
    if (kind != ImageKind::kFinal) {
        auto made = preview(job_id, kind == ImageKind::kPreview ? PreviewFormat::kPng : PreviewFormat::kExr, 0);
        if (!made.ok()) return made.status();
        return std::move(made->bytes);
    }
    std::filesystem::path directory;
    {
        const OpenBook book(office_);
        const JobPtr file = book->find(job_id);
        if (!file) return no_job(job_id);
        if (file->job.state() != JobState::kSucceeded) return not_succeeded(file->job, "image");
        directory = file->job.submission().directory;
    }
    return read_file((directory / kImageFiles.image).string());
}

Result<std::string> Gallery::manifest(const std::string& job_id, ManifestKind kind) const {
    std::filesystem::path path;
    {
        OpenBook book(office_);
        const JobPtr file = book->find(job_id);
        if (!file) return no_job(job_id);
        const Job& job = file->job;
        path = job.submission().directory / kImageFiles.manifest;
        if (job.state() != JobState::kSucceeded) {
            if (kind == ManifestKind::kFinal) return not_succeeded(job, "manifest");
            if (!job.has_partial()) return failed_precondition(is_in_state(job) + ": no groups of it are on disk");
            const auto end = std::chrono::steady_clock::now() + kWrittenSoon;
            while (!book->closing && job.reducer() && std::chrono::steady_clock::now() < end) book.wait_until(file->changed, end);
            if (job.reducer())
                return Status(StatusCode::kUnavailable, is_in_state(job) + ", and its complete groups are still being written");
            path = job.submission().directory / kPartialFiles.manifest;
        }
    }
    return read_file(path.string());
}

Result<Preview> Gallery::preview(const std::string& job_id, PreviewFormat format, double exposure) const {
    const MutexLock one_at_a_time(preview_mutex_);
    std::shared_ptr<Reducer> reducer;
    JobPtr file;
    JobSpec spec;
    std::filesystem::path image;
    {
        const OpenBook book(office_);
        file = book->find(job_id);
        if (!file) return no_job(job_id);
        const Job& job = file->job;
        if (job.state() == JobState::kPreparing)
            return failed_precondition(is_in_state(job) + " (" + phase_text(book->info(*file, office_.now())) +
                                       "): there is no image yet");
        const bool succeeded = job.state() == JobState::kSucceeded;
        if (!job.reducer() && !succeeded && !job.has_partial())
            return failed_precondition(is_in_state(job) + ": what was rendered of it is gone");
        reducer = job.reducer();
        spec = job.spec();
        image = job.submission().directory / (succeeded ? kImageFiles.image : kPartialFiles.image);
    }
    try {
        auto made = make_preview(spec, image, reducer.get(), format, exposure);
        if (made.ok()) return made;
        return Status(made.status().code(), "job " + job_id + ": " + made.status().message());
    } catch (const std::bad_alloc&) {  // it must not end the coordinator
        return Status(StatusCode::kResourceExhausted, "the coordinator has too little memory for a preview of job " + job_id);
    }
}

}  // namespace lightloom
