#pragma once
// Common parts of the three services' handlers: answering a call, and receiving its chunks.

#include <grpcpp/support/status.h>
#include <grpcpp/support/sync_stream.h>

#include <atomic>
#include <string>

#include "common/work/wire.h"

namespace lightloom {

inline grpc::Status invalid(const std::string& what) { return {grpc::StatusCode::INVALID_ARGUMENT, what}; }

inline grpc::Status going_down() { return {grpc::StatusCode::UNAVAILABLE, "the coordinator is going down"}; }

/// Puts a value into the response, or returns its error as the call's status.
template <class Value, class Message>
grpc::Status answer(const Result<Value>& value, Message* response) {
    if (!value.ok()) return wire::to_grpc(value.status());
    wire::put(*value, response);
    return grpc::Status::OK;
}

/// Calls take(chunk) with every chunk that follows the header of a stream. Ends with the first error, or as soon as the coordinator
/// goes down.
template <class Request, class Take>
grpc::Status read_chunks(grpc::ServerReader<Request>* reader, const std::atomic<bool>& closing, const Take& take) {
    Request message;
    while (reader->Read(&message)) {
        if (closing) return going_down();
        if (!message.has_chunk()) return invalid("only the first message is a header");
        const v1::Chunk& chunk = message.chunk();
        if (chunk.data().size() > kMaxChunkBytes) return invalid("a chunk holds at most 1 MiB");
        if (const grpc::Status status = take(chunk); !status.ok()) return status;
    }
    return grpc::Status::OK;
}

}  // namespace lightloom
