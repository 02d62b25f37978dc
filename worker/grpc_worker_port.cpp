#include "worker/grpc_worker_port.h"

#include <chrono>

#include "common/core/utf8.h"
#include "common/work/grpc_call.h"

namespace lightloom {
namespace {

/// A slower connection than this counts as broken.
constexpr double kSlowestBytesPerSecond = 1e6;

/// `message` holds the header; the payload follows in chunks.
template <class Request>
Result<SubmitAck> submit(v1::WorkerService::Stub& stub,
                         std::unique_ptr<grpc::ClientWriter<Request>> (v1::WorkerService::Stub::*method)(grpc::ClientContext*,
                                                                                                         v1::SubmitResultResponse*),
                         Request& message, std::string_view payload) {
    grpc::ClientContext context;
    set_deadline(context, 120 + double(payload.size()) / kSlowestBytesPerSecond);
    v1::SubmitResultResponse response;
    const auto writer = (stub.*method)(&context, &response);
    bool open = writer->Write(message);
    for (size_t offset = 0; open && offset < payload.size(); offset += kMaxChunkBytes) {
        v1::Chunk* chunk = message.mutable_chunk();
        const std::string_view part = payload.substr(offset, kMaxChunkBytes);
        chunk->set_offset_bytes(offset);
        chunk->set_data(part.data(), part.size());
        open = writer->Write(message);
    }
    // A stream that the coordinator closed early has its answer already; Finish() fetches it.
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    if (!status.ok()) return wire::from_grpc(status);
    return wire::get(response);
}

}  // namespace

GrpcWorkerPort::GrpcWorkerPort(std::shared_ptr<grpc::Channel> channel, double read_seconds)
    : read_seconds_(read_seconds),
      channel_(std::move(channel)),
      worker_(v1::WorkerService::NewStub(channel_)),
      assets_(v1::AssetService::NewStub(channel_)) {}

bool GrpcWorkerPort::wait_connected(double seconds) {
    return channel_->WaitForConnected(
        std::chrono::system_clock::now() +
        std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(seconds)));
}

Result<WorkerGrant> GrpcWorkerPort::register_worker(const WorkerHello& hello) {
    v1::WorkerHello request;
    wire::put(hello, &request);
    const auto response = call(*worker_, &v1::WorkerService::Stub::Register, request, 30);
    if (!response.ok()) return response.status();
    return wire::get(*response);
}

Result<std::vector<UnitLease>> GrpcWorkerPort::lease_units(const std::string& worker_id, double wait_seconds,
                                                           std::stop_token stop) {
    v1::LeaseUnitsRequest request;
    request.set_worker_id(worker_id);
    request.set_wait_seconds(wait_seconds);
    const auto response = call(*worker_, &v1::WorkerService::Stub::LeaseUnits, request, wait_seconds + 10, std::move(stop));
    if (!response.ok()) return response.status();
    return get_all<UnitLease>(response->leases());
}

Result<std::vector<UnitReference>> GrpcWorkerPort::heartbeat(const std::string& worker_id,
                                                             const std::vector<RunningUnit>& running) {
    v1::HeartbeatRequest request;
    request.set_worker_id(worker_id);
    for (const RunningUnit& item : running) {
        v1::RunningUnit* out = request.add_running();
        wire::put(item.unit, out->mutable_unit());
        out->set_rendering(item.rendering);
    }
    const auto response = call(*worker_, &v1::WorkerService::Stub::Heartbeat, request, 2);
    if (!response.ok()) return response.status();
    return get_all<UnitReference>(response->revoked());
}

Result<SubmitAck> GrpcWorkerPort::submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                                double render_seconds) {
    const auto encoded = encode_partial(partial, lease.spec.frame);
    if (!encoded.ok()) return encoded.status();
    v1::SubmitResultRequest message;
    v1::SubmitResultHeader* header = message.mutable_header();
    header->set_worker_id(worker_id);
    wire::put(lease.reference(), header->mutable_unit());
    wire::put(encoded->descriptor, header);
    header->set_render_seconds(render_seconds);
    return submit(*worker_, &v1::WorkerService::Stub::SubmitResult, message, encoded->payload);
}

Result<SubmitAck> GrpcWorkerPort::submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                                  double trace_seconds) {
    v1::SubmitTrainingRequest message;
    v1::SubmitTrainingHeader* header = message.mutable_header();
    header->set_worker_id(worker_id);
    wire::put(lease.reference(), header->mutable_unit());
    wire::put(sha256(payload), header->mutable_payload_digest());
    header->set_payload_size_bytes(payload.size());
    header->set_trace_seconds(trace_seconds);
    return submit(*worker_, &v1::WorkerService::Stub::SubmitTraining, message, payload);
}

Status GrpcWorkerPort::release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) {
    v1::ReleaseUnitRequest request;
    request.set_worker_id(worker_id);
    wire::put(unit, request.mutable_unit());
    request.set_status_code(int(why.code()));
    request.set_message(clipped_utf8(why.message(), wire::kMaxMessageBytes));
    return call(*worker_, &v1::WorkerService::Stub::ReleaseUnit, request, 10).status();
}

Status GrpcWorkerPort::goodbye(const std::string& worker_id) {
    v1::GoodbyeRequest request;
    request.set_worker_id(worker_id);
    return call(*worker_, &v1::WorkerService::Stub::Goodbye, request, 5).status();
}

Status GrpcWorkerPort::read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) {
    // The time that an asset takes is unknown before its size is; a call that was fast enough until its deadline is
    // continued.
    for (;;) {
        const uint64_t begin = offset;
        grpc::ClientContext context;
        set_deadline(context, read_seconds_);
        v1::ReadRequest request;
        wire::put(digest, request.mutable_digest());
        request.set_offset_bytes(offset);
        const auto reader = assets_->Read(&context, request);
        v1::Chunk chunk;
        while (reader->Read(&chunk)) {
            Status status = chunk.offset_bytes() == offset ? sink(chunk.data()) : chunk_out_of_order();
            if (!status.ok()) {
                abandon(context, *reader);
                return status;
            }
            offset += chunk.data().size();
        }
        const Status status = wire::from_grpc(reader->Finish());
        const bool slow = double(offset - begin) < read_seconds_ * kSlowestBytesPerSecond;
        if (status.code() != StatusCode::kDeadlineExceeded || slow) return status;
    }
}

}  // namespace lightloom
