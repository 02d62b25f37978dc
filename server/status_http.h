#pragma once
// The status endpoint: GET /healthz, /readyz and /api/v1/status over HTTP, for people and monitors. It has one thread, and
// everything about it is bounded.

#include <memory>
#include <string>

#include "server/coordinator.h"
#include "server/health.h"

namespace lightloom {

class StatusHttp {
  public:
    /// `address`: HOST:PORT of a literal address or "localhost"; port 0 picks a free one. kUnavailable when it cannot be
    /// bound.
    static Result<std::unique_ptr<StatusHttp>> start(const Coordinator& coordinator, const std::string& address,
                                                     HealthChecks health = {});
    ~StatusHttp();
    int port() const;

  private:
    struct Impl;
    explicit StatusHttp(std::unique_ptr<Impl> impl);
    std::unique_ptr<Impl> impl_;
};

}  // namespace lightloom
