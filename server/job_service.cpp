#include "server/job_service.h"

#include "server/grpc_answers.h"

namespace lightloom {
namespace {

constexpr double kWatchSeconds = 0.1;

/// Sends the bytes as chunks, each of which chunk_of(message) points to in its message.
template <class Message, class ChunkOf>
grpc::Status send(const std::string& bytes, grpc::ServerWriter<Message>* writer, const ChunkOf& chunk_of) {
    Message message;
    for (size_t offset = 0; offset < bytes.size(); offset += kMaxChunkBytes) {
        v1::Chunk* const chunk = chunk_of(message);
        chunk->set_offset_bytes(offset);
        chunk->set_data(bytes.data() + offset, std::min<size_t>(kMaxChunkBytes, bytes.size() - offset));
        if (!writer->Write(message)) return {grpc::StatusCode::CANCELLED, "the client went away"};
    }
    return grpc::Status::OK;
}

grpc::Status send(const Result<std::string>& bytes, grpc::ServerWriter<v1::Chunk>* writer) {
    if (!bytes.ok()) return wire::to_grpc(bytes.status());
    return send(*bytes, writer, [](v1::Chunk& chunk) { return &chunk; });
}

}  // namespace

grpc::Status JobServiceImpl::SubmitJob(grpc::ServerContext*, const v1::SubmitJobRequest* request, v1::Job* response) {
    const auto spec = wire::get(request->spec());
    if (!spec.ok()) return wire::to_grpc(spec.status());
    if (const Status s = check_time_limit(spec->time_limit_seconds); !s.ok()) return wire::to_grpc(s);
    const Reuse reuse = request->reuse() ? Reuse::kAllowed : Reuse::kAnew;
    return answer(coordinator_.submit_job(request->request_id(), *spec, wire::get(request->label()), reuse), response);
}

grpc::Status JobServiceImpl::GetJob(grpc::ServerContext*, const v1::GetJobRequest* request, v1::Job* response) {
    return answer(coordinator_.get_job(request->job_id()), response);
}

grpc::Status JobServiceImpl::ListJobs(grpc::ServerContext*, const v1::ListJobsRequest*, v1::ListJobsResponse* response) {
    for (const JobInfo& info : coordinator_.list_jobs()) wire::put(info, response->add_jobs());
    return grpc::Status::OK;
}

grpc::Status JobServiceImpl::ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest* request,
                                         v1::ListWorkersResponse* response) {
    const double within = request->gone_within_seconds();
    if (!(within >= 0)) return invalid("gone_within_seconds is 0 or more");
    const auto workers = within > 0 ? coordinator_.workers(within) : coordinator_.workers();
    for (const WorkerStatus& worker : workers) wire::put(worker, response->add_workers());
    return grpc::Status::OK;
}

grpc::Status JobServiceImpl::CancelJob(grpc::ServerContext*, const v1::CancelJobRequest* request, v1::Job* response) {
    const OnCancel what = request->keep() ? OnCancel::kKeep : OnCancel::kThrowAway;
    return answer(coordinator_.cancel_job(request->job_id(), what), response);
}

grpc::Status JobServiceImpl::FinishJob(grpc::ServerContext*, const v1::FinishJobRequest* request, v1::Job* response) {
    return answer(coordinator_.finish_job(request->job_id()), response);
}

grpc::Status JobServiceImpl::WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                                      grpc::ServerWriter<v1::Job>* writer) {
    uint64_t seen = request->after_revision();
    while (!context->IsCancelled() && !closing_) {
        const auto info = coordinator_.wait_job(request->job_id(), seen, 0.2);
        if (!info.ok()) return wire::to_grpc(info.status());
        if (info->revision > seen) {
            seen = info->revision;
            v1::Job message;
            wire::put(*info, &message);
            if (!writer->Write(message)) break;
            if (is_terminal(info->state)) return grpc::Status::OK;
            // Not every step of a job is worth a message, but its end is waited for.
            if (const Status s = coordinator_.wait_job_end(request->job_id(), kWatchSeconds); !s.ok()) return wire::to_grpc(s);
        } else if (is_terminal(info->state)) {
            return grpc::Status::OK;
        }
    }
    return going_down();
}

grpc::Status JobServiceImpl::GetImage(grpc::ServerContext*, const v1::GetImageRequest* request,
                                      grpc::ServerWriter<v1::Chunk>* writer) {
    if (request->partial() && request->kind() != v1::IMAGE_KIND_FINAL) return invalid("only a FINAL image can be a partial one");
    const ImageKind exr = request->partial() ? ImageKind::kPartial : ImageKind::kFinal;
    switch (request->kind()) {
        case v1::IMAGE_KIND_FINAL: return send(coordinator_.image(request->job_id(), exr), writer);
        case v1::IMAGE_KIND_PREVIEW: return send(coordinator_.image(request->job_id(), ImageKind::kPreview), writer);
        default: return invalid("an image is FINAL or PREVIEW");
    }
}

grpc::Status JobServiceImpl::GetPreview(grpc::ServerContext*, const v1::GetPreviewRequest* request,
                                        grpc::ServerWriter<v1::GetPreviewResponse>* writer) {
    if (request->format() != v1::PREVIEW_FORMAT_PNG && request->format() != v1::PREVIEW_FORMAT_EXR)
        return invalid("a preview is a PNG or an EXR");
    const double exposure = request->exposure_stops();
    if (!(exposure >= -30 && exposure <= 30)) return invalid("the exposure of a preview lies between -30 and 30 stops");
    const auto format = request->format() == v1::PREVIEW_FORMAT_PNG ? PreviewFormat::kPng : PreviewFormat::kExr;
    const auto preview = coordinator_.preview(request->job_id(), format, exposure);
    if (!preview.ok()) return wire::to_grpc(preview.status());
    v1::GetPreviewResponse header;
    header.mutable_header()->set_samples_per_pixel(preview->samples_per_pixel);
    if (!writer->Write(header)) return {grpc::StatusCode::CANCELLED, "the client went away"};
    return send(preview->bytes, writer, [](v1::GetPreviewResponse& message) { return message.mutable_chunk(); });
}

grpc::Status JobServiceImpl::GetManifest(grpc::ServerContext*, const v1::GetManifestRequest* request,
                                         grpc::ServerWriter<v1::Chunk>* writer) {
    const ManifestKind kind = request->partial() ? ManifestKind::kPartial : ManifestKind::kFinal;
    return send(coordinator_.manifest(request->job_id(), kind), writer);
}

}  // namespace lightloom
