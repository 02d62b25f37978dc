#pragma once
// A port that hands everything on: tests override what goes wrong.

#include <utility>

#include "common/work/service.h"

namespace lightloom::testing {

class ForwardingPort : public WorkerPort {
  public:
    explicit ForwardingPort(WorkerPort& port) : port_(port) {}
    Result<WorkerGrant> register_worker(const WorkerHello& hello) override { return port_.register_worker(hello); }
    Result<std::vector<UnitLease>> lease_units(const std::string& worker_id, double wait_seconds, std::stop_token stop) override {
        return port_.lease_units(worker_id, wait_seconds, stop);
    }
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) override {
        return port_.heartbeat(worker_id, running);
    }
    Result<SubmitAck> submit_result(const std::string& worker_id, const UnitLease& lease, Partial partial,
                                    double seconds) override {
        return port_.submit_result(worker_id, lease, std::move(partial), seconds);
    }
    Result<SubmitAck> submit_training(const std::string& worker_id, const UnitLease& lease, std::string_view payload,
                                      double seconds) override {
        return port_.submit_training(worker_id, lease, payload, seconds);
    }
    Status release_unit(const std::string& worker_id, const UnitReference& unit, const Status& why) override {
        return port_.release_unit(worker_id, unit, why);
    }
    Status goodbye(const std::string& worker_id) override { return port_.goodbye(worker_id); }
    Status read_asset(const Digest& digest, uint64_t offset, const std::function<Status(std::string_view)>& sink) override {
        return port_.read_asset(digest, offset, sink);
    }
    bool wait_connected(double seconds) override { return port_.wait_connected(seconds); }

  protected:
    WorkerPort& port_;
};

}  // namespace lightloom::testing
