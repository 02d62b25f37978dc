#pragma once
// Calls to the coordinator's services, the same for clients and workers: they add a deadline and cancellation, and turn
// errors into a Status.

#include <grpcpp/client_context.h>

#include <chrono>
#include <stop_token>
#include <vector>

#include "common/work/wire.h"

namespace lightloom {

inline void set_deadline(grpc::ClientContext& context, double seconds) {
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::duration_cast<std::chrono::system_clock::duration>(std::chrono::duration<double>(seconds)));
}

/// Makes one call and waits for its answer. kDeadlineExceeded after `seconds`, kCancelled soon after a stop request.
template <class Stub, class Request, class Response>
Result<Response> call(Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                      const Request& request, double seconds, std::stop_token stop = {}) {
    grpc::ClientContext context;
    set_deadline(context, seconds);
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    Response response;
    const grpc::Status status = (stub.*method)(&context, request, &response);
    if (!status.ok()) return wire::from_grpc(status);
    return response;
}

/// Ends a stream whose rest is not wanted.
template <class Stream>
void abandon(grpc::ClientContext& context, Stream& stream) {
    context.TryCancel();
    (void)stream.Finish();
}

/// Converts a message's list; returns the error of the first value that the protocol forbids.
template <class Value, class Messages>
Result<std::vector<Value>> get_all(const Messages& messages) {
    std::vector<Value> values;
    for (const auto& message : messages) {
        Result<Value> value = wire::get(message);
        if (!value.ok()) return value.status();
        values.push_back(*std::move(value));
    }
    return values;
}

inline Status chunk_out_of_order() { return data_loss("the coordinator sent a chunk out of order"); }

}  // namespace lightloom
