#pragma once
// The services of proto/lightloom/v1 as thin adapters around a Coordinator: they convert the request, call, and convert
// the answer.
//
// The synchronous API is deliberate: a handler is a plain function, each worker and client has two or three calls in
// flight, and a coordinator of this design is limited by rendering and not by the number of connections.

#include <grpcpp/server.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "common/core/result.h"
#include "server/coordinator.h"
#include "server/health.h"

namespace lightloom {

struct GrpcServerOptions {
    bool reflection = false;        ///< Let grpcurl and its like list the calls.
    std::function<Status()> ready;  ///< What the health service answers, looked at once a second. Empty: always well.
};

class GrpcServer {
  public:
    /// `address`: HOST:PORT, port 0 picks a free one. kUnavailable when the port cannot be bound.
    static Result<std::unique_ptr<GrpcServer>> start(Coordinator& coordinator, const std::string& address,
                                                     const GrpcServerOptions& options = {});
    ~GrpcServer();
    int port() const { return port_; }

  private:
    struct Services;
    GrpcServer();
    std::unique_ptr<Services> services_;
    std::unique_ptr<grpc::Server> server_;
    int port_ = 0;
    std::jthread health_;  // last: it uses server_
};

}  // namespace lightloom
