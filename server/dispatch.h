#pragma once
// The desk for workers: they register, get units, say what they do and leave. See WorkerService for the errors.

#include <functional>

#include "server/choose_unit.h"
#include "server/office.h"

namespace lightloom {

class Dispatch {
  public:
    explicit Dispatch(Office& office) : office_(office) {}

    Result<WorkerGrant> register_worker(const WorkerHello& hello);
    Result<std::vector<UnitLease>> lease(const std::string& worker_id, double wait_seconds, const std::function<bool()>& cancelled);
    /// Makes calls of lease() look at `cancelled` now; they do so by themselves every few seconds.
    void wake();
    Result<std::vector<UnitReference>> heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running);
    Status release(const std::string& worker_id, const UnitReference& unit, const Status& why);
    Status goodbye(const std::string& worker_id);
    std::vector<WorkerStatus> workers(double gone_within_seconds) const;
    /// Takes back leases that have run out and closes jobs whose time is over; says when there is more to do.
    void tick(OpenBook& book);

  private:
    /// Leases a unit to the worker, if there is one for it.
    Choice::Turn next_unit(OpenBook& book, WorkerRecord& worker, std::optional<UnitLease>* lease);
    /// What the worker is told about the unit that it has got.
    void make_lease(OpenBook& book, const JobPtr& file, WorkerRecord& worker, const WorkUnit& unit,
                    std::optional<UnitLease>* lease);
    /// Takes the unit away from the worker if it has rendered it for too long.
    bool took_too_long(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker);

    Office& office_;
};

}  // namespace lightloom
