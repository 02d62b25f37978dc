#include "client/grpc_job_port.h"

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <fstream>
#include <mutex>
#include <thread>

#include "common/work/grpc_call.h"

namespace lightloom {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr auto kReconnectInterval = std::chrono::milliseconds(250);
constexpr int kUploadAttempts = 5;
/// Between looks at what another client is sending.
constexpr auto kUploadInterval = std::chrono::milliseconds(500);
constexpr size_t kDigestsPerCall = 1000;

std::string seconds_text(double seconds) { return std::to_string(std::lround(seconds)) + " s"; }

/// Cancels a call in which nothing was heard for a while. A deadline would be one of the whole call, whose length is not known.
class SilenceLimit {
  public:
    SilenceLimit(grpc::ClientContext& context, double seconds)
        : limit_(std::chrono::duration_cast<Clock::duration>(Seconds(seconds))),
          thread_([this, &context](std::stop_token ended) { watch(context, ended); }) {}
    void heard() {
        const std::lock_guard lock(mutex_);
        last_ = Clock::now();
    }
    bool exceeded() {
        const std::lock_guard lock(mutex_);
        return exceeded_;
    }

  private:
    void watch(grpc::ClientContext& context, const std::stop_token& ended) {
        std::unique_lock lock(mutex_);
        while (!ended.stop_requested() && !exceeded_) {
            wake_.wait_until(lock, ended, last_ + limit_, [] { return false; });
            exceeded_ = !ended.stop_requested() && Clock::now() >= last_ + limit_;
        }
        if (exceeded_) context.TryCancel();
    }

    const Clock::duration limit_;
    std::mutex mutex_;
    std::condition_variable_any wake_;
    Clock::time_point last_ = Clock::now();
    bool exceeded_ = false;
    std::jthread thread_;  // last: ends before anything that it uses goes away
};

/// For a call after an interruption, such as that for the image of a job that had just ended: only a later one could stop it.
std::stop_token unless_requested(const std::stop_token& stop) { return stop.stop_requested() ? std::stop_token() : stop; }

/// The bytes that a method streams in messages, of which chunk_of() gives the chunk, or null for one without bytes. `later`
/// completes an error: what to do when the bytes do not arrive.
template <class Request, class Message, class ChunkOf>
Result<std::string> collect(v1::JobService::Stub& stub,
                            std::unique_ptr<grpc::ClientReader<Message>> (v1::JobService::Stub::*method)(grpc::ClientContext*,
                                                                                                         const Request&),
                            const Request& request, const GrpcJobPortOptions& options, const std::string& later,
                            const ChunkOf& chunk_of) {
    const double silence_seconds = options.silence_seconds;
    const std::stop_token stop = unless_requested(options.stop);
    grpc::ClientContext context;
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    const auto reader = (stub.*method)(&context, request);
    SilenceLimit silence(context, silence_seconds);
    std::string bytes;
    Message message;
    while (reader->Read(&message)) {
        silence.heard();
        const v1::Chunk* const chunk = chunk_of(message);
        if (!chunk) continue;
        if (chunk->offset_bytes() != bytes.size()) {
            abandon(context, *reader);
            return chunk_out_of_order();
        }
        bytes += chunk->data();
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) return bytes;
    if (stop.stop_requested()) return Status(StatusCode::kCancelled, "interrupted" + later);
    if (silence.exceeded())
        return Status(StatusCode::kDeadlineExceeded,
                      "nothing more has come from the coordinator for " + seconds_text(silence_seconds) + later);
    if (status.error_code() == grpc::StatusCode::UNAVAILABLE)
        return Status(StatusCode::kUnavailable, "the connection to the coordinator broke (" + status.error_message() + ")" + later);
    return wire::from_grpc(status);
}

/// The same for messages that are chunks.
template <class Request>
Result<std::string> collect(v1::JobService::Stub& stub,
                            std::unique_ptr<grpc::ClientReader<v1::Chunk>> (v1::JobService::Stub::*method)(grpc::ClientContext*,
                                                                                                           const Request&),
                            const Request& request, const GrpcJobPortOptions& options) {
    return collect(stub, method, request, options, "; nothing is lost, `lightloom fetch` tries again",
                   [](const v1::Chunk& chunk) { return &chunk; });
}

template <class Value>
const Status& status_of(const Result<Value>& result) {
    return result.status();
}

Result<JobInfo> job_info(const Result<v1::Job>& answer) {
    if (!answer.ok()) return answer.status();
    return wire::get(*answer);
}

}  // namespace

GrpcJobPort::GrpcJobPort(std::shared_ptr<grpc::Channel> channel, GrpcJobPortOptions options)
    : channel_(std::move(channel)),
      options_(std::move(options)),
      jobs_(v1::JobService::NewStub(channel_)),
      assets_(v1::AssetService::NewStub(channel_)) {}

bool GrpcJobPort::connected_before(Clock::time_point end, const std::stop_token& stop) {
    if (!told_ && options_.on_lost) options_.on_lost();
    told_ = true;
    // Looks after a moment only, so that no server is called without a pause.
    std::this_thread::sleep_for(kReconnectInterval);
    // A proxy in front of a coordinator that is gone stays connected.
    while (Clock::now() < end && !stop.stop_requested()) {
        // Not GetState(): while nobody waits inside of gRPC, a connection makes a step every 5 s only.
        if (channel_->WaitForConnected(std::chrono::system_clock::now() + kReconnectInterval)) return true;
    }
    return false;
}

template <class Call>
std::invoke_result_t<Call> GrpcJobPort::insist(const Call& make) {
    const std::stop_token stop = unless_requested(options_.stop);
    const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(Seconds(options_.reconnect_seconds));
    for (;;) {
        auto answer = make();
        if (status_of(answer).code() != StatusCode::kUnavailable) {
            answered_ = true;
            told_ = false;
            return answer;
        }
        if (!answered_ || !connected_before(end, stop)) return answer;
    }
}

Result<JobInfo> GrpcJobPort::submit_job(const std::string& request_id, const JobSpec& spec, const JobLabel& label, Reuse reuse) {
    v1::SubmitJobRequest request;
    request.set_request_id(request_id);
    wire::put(spec, request.mutable_spec());
    wire::put(label, request.mutable_label());
    request.set_reuse(reuse == Reuse::kAllowed);
    return job_info(insist([&] { return call(*jobs_, &v1::JobService::Stub::SubmitJob, request, 30); }));
}

Result<JobInfo> GrpcJobPort::get_job(const std::string& job_id) {
    v1::GetJobRequest request;
    request.set_job_id(job_id);
    return job_info(insist([&] { return call(*jobs_, &v1::JobService::Stub::GetJob, request, 10); }));
}

Result<std::vector<JobInfo>> GrpcJobPort::list_jobs() {
    const auto response = insist([&] { return call(*jobs_, &v1::JobService::Stub::ListJobs, {}, 10); });
    if (!response.ok()) return response.status();
    return get_all<JobInfo>(response->jobs());
}

Result<std::vector<WorkerStatus>> GrpcJobPort::list_workers(double gone_within_seconds) {
    v1::ListWorkersRequest request;
    request.set_gone_within_seconds(gone_within_seconds);
    const auto response = insist([&] { return call(*jobs_, &v1::JobService::Stub::ListWorkers, request, 10); });
    if (!response.ok()) return response.status();
    return get_all<WorkerStatus>(response->workers());
}

Result<JobInfo> GrpcJobPort::cancel_job(const std::string& job_id, OnCancel what) {
    v1::CancelJobRequest request;
    request.set_job_id(job_id);
    request.set_keep(what == OnCancel::kKeep);
    return job_info(insist([&] { return call(*jobs_, &v1::JobService::Stub::CancelJob, request, 10); }));
}

Result<JobInfo> GrpcJobPort::finish_job(const std::string& job_id) {
    v1::FinishJobRequest request;
    request.set_job_id(job_id);
    return job_info(insist([&] { return call(*jobs_, &v1::JobService::Stub::FinishJob, request, 10); }));
}

Status GrpcJobPort::watch_job(const std::string& job_id, const std::function<void(const JobInfo&)>& on_change,
                              std::stop_token stop) {
    const auto patience = std::chrono::duration_cast<Clock::duration>(Seconds(options_.reconnect_seconds));
    uint64_t seen = 0;
    Clock::time_point begin = Clock::now(), end = begin + patience;
    for (;; begin = Clock::now()) {
        grpc::ClientContext context;
        const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
        v1::WatchJobRequest request;
        request.set_job_id(job_id);
        request.set_after_revision(seen);
        const auto reader = jobs_->WatchJob(&context, request);
        v1::Job message;
        bool heard = false;
        while (reader->Read(&message)) {
            const auto info = wire::get(message);
            if (!info.ok()) {
                abandon(context, *reader);
                return info.status();
            }
            on_change(*info);
            seen = info->revision;
            heard = answered_ = true;
            told_ = false;
        }
        const grpc::Status status = reader->Finish();
        const bool lost = status.error_code() == grpc::StatusCode::UNAVAILABLE;
        // A stream may have nothing to say for hours; one that ends as soon as it has begun does not begin the wait again.
        if (heard || Clock::now() - begin > patience) end = Clock::now() + patience;
        const bool again = lost && !stop.stop_requested() && connected_before(end, stop);
        if (stop.stop_requested()) return {StatusCode::kCancelled, "interrupted"};
        if (seen > 0 && status.error_code() == grpc::StatusCode::NOT_FOUND)
            return not_found("job " + job_id +
                             " is not known any more: the coordinator was restarted without it, or has forgotten it; "
                             "submit it again");
        if (!again) return wire::from_grpc(status);
    }
}

Result<std::string> GrpcJobPort::image(const std::string& job_id, ImageKind kind) {
    v1::GetImageRequest request;
    request.set_job_id(job_id);
    request.set_kind(kind == ImageKind::kPreview ? v1::IMAGE_KIND_PREVIEW : v1::IMAGE_KIND_FINAL);
    request.set_partial(kind == ImageKind::kPartial);
    return insist([&] { return collect(*jobs_, &v1::JobService::Stub::GetImage, request, options_); });
}

Result<Preview> GrpcJobPort::preview(const std::string& job_id, PreviewFormat format, double exposure) {
    v1::GetPreviewRequest request;
    request.set_job_id(job_id);
    request.set_format(format == PreviewFormat::kPng ? v1::PREVIEW_FORMAT_PNG : v1::PREVIEW_FORMAT_EXR);
    request.set_exposure_stops(exposure);
    Preview preview;
    const auto chunk_of = [&](const v1::GetPreviewResponse& message) -> const v1::Chunk* {
        if (message.has_header()) preview.samples_per_pixel = message.header().samples_per_pixel();
        return message.has_chunk() ? &message.chunk() : nullptr;
    };
    auto bytes = insist([&] {
        return collect(*jobs_, &v1::JobService::Stub::GetPreview, request, options_, "; `lightloom preview` tries again", chunk_of);
    });
    if (!bytes.ok()) return bytes.status();
    preview.bytes = *std::move(bytes);
    return preview;
}

Result<std::string> GrpcJobPort::manifest(const std::string& job_id, ManifestKind kind) {
    v1::GetManifestRequest request;
    request.set_job_id(job_id);
    request.set_partial(kind == ManifestKind::kPartial);
    return insist([&] { return collect(*jobs_, &v1::JobService::Stub::GetManifest, request, options_); });
}

Result<std::vector<Digest>> GrpcJobPort::find_missing(const std::vector<Digest>& digests) {
    std::vector<Digest> missing;
    for (size_t begin = 0; begin < digests.size(); begin += kDigestsPerCall) {
        v1::FindMissingRequest request;
        for (size_t i = begin; i < std::min(begin + kDigestsPerCall, digests.size()); ++i)
            wire::put(digests[i], request.add_digests());
        const auto response = insist([&] { return call(*assets_, &v1::AssetService::Stub::FindMissing, request, 30); });
        if (!response.ok()) return response.status();
        const auto found = get_all<Digest>(response->missing());
        if (!found.ok()) return found.status();
        missing.insert(missing.end(), found->begin(), found->end());
    }
    return missing;
}

Result<v1::QueryWriteResponse> GrpcJobPort::query_write(const Digest& digest) {
    v1::QueryWriteRequest request;
    wire::put(digest, request.mutable_digest());
    return insist([&] { return call(*assets_, &v1::AssetService::Stub::QueryWrite, request, 10, options_.stop); });
}

Status GrpcJobPort::write(const Digest& digest, uint64_t size, uint64_t offset, const Source& source) {
    grpc::ClientContext context;
    set_deadline(context, 120.0 * double(1 + (size >> 26)));
    const std::stop_callback cancel(options_.stop, [&] { context.TryCancel(); });
    v1::WriteResponse response;
    const auto writer = assets_->Write(&context, &response);
    v1::WriteRequest message;
    wire::put(digest, message.mutable_header()->mutable_digest());
    message.mutable_header()->set_size_bytes(size);
    bool open = writer->Write(message);
    while (open && offset < size) {
        const auto bytes = source(offset);
        if (!bytes.ok()) {
            abandon(context, *writer);
            return bytes.status();
        }
        message.mutable_chunk()->set_offset_bytes(offset);
        message.mutable_chunk()->set_data(bytes->data(), bytes->size());
        open = writer->Write(message);
        offset += bytes->size();
    }
    writer->WritesDone();
    return wire::from_grpc(writer->Finish());
}

Status GrpcJobPort::send(const Digest& digest, uint64_t size, const std::string& name, const Source& source) {
    uint64_t committed = 0;
    Clock::time_point grown = Clock::now();
    bool theirs = false;  // another client is sending the same file
    for (int failures = 0;;) {
        const auto present = query_write(digest);
        Status status = present.status();
        if (present.ok()) {
            if (present->complete()) return {};
            const bool growing = present->committed_size_bytes() != committed;
            committed = present->committed_size_bytes();
            if (growing) grown = Clock::now();
            // While theirs moves on, an attempt of ours would only cost both of us time.
            status = theirs && growing ? Status(StatusCode::kAborted, "")
                                       : write(digest, size, committed <= size ? committed : 0, source);
            if (status.ok()) return status;
        }
        if (options_.stop.stop_requested()) return {StatusCode::kCancelled, "interrupted"};
        theirs = status.code() == StatusCode::kAborted;
        if (theirs) {
            // The other client may have died: the coordinator takes as long as its keepalive to notice that.
            if (Clock::now() - grown >= Seconds(options_.upload_silence_seconds))
                return {StatusCode::kAborted, name +
                                                  ": another client is sending this file, but nothing more of it has arrived for " +
                                                  seconds_text(options_.upload_silence_seconds) + "; try again later"};
            std::this_thread::sleep_for(kUploadInterval);
            continue;
        }
        const StatusCode code = status.code();
        const bool again = code == StatusCode::kUnavailable || code == StatusCode::kOutOfRange || code == StatusCode::kDataLoss;
        if (!again || ++failures == kUploadAttempts) return status;
        std::this_thread::sleep_for(std::chrono::milliseconds(200 * failures));
    }
}

Status GrpcJobPort::upload(const Digest& digest, const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary | std::ios::ate);
    if (!in) return not_found(path.string() + ": cannot be opened");
    const auto size = uint64_t(in.tellg());
    std::string buffer;
    return send(digest, size, path.string(), [&](uint64_t offset) -> Result<std::string_view> {
        buffer.resize(std::min<uint64_t>(kMaxChunkBytes, size - offset));
        in.seekg(std::streamoff(offset));
        in.read(buffer.data(), std::streamsize(buffer.size()));
        if (!in) return data_loss(path.string() + ": read failed; did the file change?");
        return std::string_view(buffer);
    });
}

Status GrpcJobPort::upload_bytes(const Digest& digest, std::string_view bytes) {
    return send(digest, bytes.size(), "the scene's list of files",
                [&](uint64_t offset) -> Result<std::string_view> { return bytes.substr(offset, kMaxChunkBytes); });
}

}  // namespace lightloom
