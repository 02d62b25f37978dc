#include "server/keep_groups.h"

#include <new>
#include <stdexcept>

#include "common/core/crash_point.h"
#include "server/finish_job.h"

namespace lightloom {
namespace {

Status write_groups(Office& office, const JobPtr& file) {
    std::shared_ptr<Reducer> reducer;
    JobSpec spec;
    {
        const OpenBook book(office);
        reducer = file->job.reducer();
        spec = file->job.spec();
    }
    spec.first_hit_layers = false;  // as in previews: the digest in the header is that of an image without them
    reducer->freeze();
    auto finished = finished_image(*reducer, spec, {});
    if (!finished.ok()) return finished.status();
    Manifest manifest;
    {
        const OpenBook book(office);
        manifest = settled_manifest(office, book, file, finished->about);
    }
    manifest.job.spec.first_hit_layers = false;
    return write_image(office, file, finished->bytes, std::move(manifest), kPartialFiles, "server.partial-written",
                       WaitsUntil::kClosing);
}

/// The same, with what goes wrong as an error.
Status try_to_write_groups(Office& office, const JobPtr& file) {
    const Status no_memory(StatusCode::kResourceExhausted, "the coordinator has too little memory for them");
    try {
        return write_groups(office, file);
    } catch (const std::bad_alloc&) {
        return no_memory;
    } catch (const std::length_error&) {
        return no_memory;
    }
}

Status keep(Office& office, const JobPtr& file) {
    const Status written = try_to_write_groups(office, file);
    if (written.code() == StatusCode::kCancelled) return {};  // the coordinator closes, and the next one goes on with the job
    OpenBook book(office);
    if (!written.ok())
        book.note().error(file->job.id() + ": its complete groups could not be written and are lost: " + written.message());
    book.apply(file, file->job.let_go(written.ok()));
    book.note_end(file);
    return {};
}

}  // namespace

void keep_groups(Office& office, OpenBook& book, const JobPtr& file) {
    if (book.start(file, "to keep the groups of this job", [&office, file] { return keep(office, file); })) return;
    book.note().error(file->job.id() + ": its complete groups are lost, because there is no thread to write them");
    book.apply(file, file->job.let_go(false));
    book.note_end(file);
}

}  // namespace lightloom
