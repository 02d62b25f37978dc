#pragma once
// Connections on which either end notices that the other one has stopped or cannot be reached any more.

#include <grpcpp/channel.h>

#include <memory>
#include <string>

namespace lightloom {

/// Either end sends a ping after this much silence, and closes the connection when no answer has come after the
/// timeout.
inline constexpr int kKeepaliveMilliseconds = 20000, kKeepaliveTimeoutMilliseconds = 10000;

/// Sets these times for one end by calls of set(name, value).
template <class Set>
void set_keepalive(Set&& set) {
    set(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveMilliseconds);
    set(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMilliseconds);
    set(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);  // the default allows only two pings without data in between
}

/// A worker's or client's channel to the coordinator at `server`, HOST:PORT or unix:PATH.
std::shared_ptr<grpc::Channel> open_channel(const std::string& server);

}  // namespace lightloom
