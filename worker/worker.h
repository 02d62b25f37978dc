#pragma once
// Worker: leases units from a coordinator, renders them one at a time on all of its threads, and submits the partials.
// gRPC is hidden behind the port; sources of renderers and tracers hide how scenes and tables are fetched and kept.

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stop_token>
#include <string>

#include <tbb/task_arena.h>

#include "common/transport/renderer.h"
#include "common/transport/training.h"
#include "common/work/service.h"

namespace lightloom {

/// The renderer of a unit's job; fetches and builds what it needs, and may keep it for the next call. Called from several
/// threads.
using RendererSource = std::function<Result<std::shared_ptr<const Renderer>>(const UnitLease& lease, std::stop_token stop)>;
/// Traces a training unit of a job; the same holds for what it needs.
using TrainingTracer = std::function<Result<TrainingData>(const TrainingWork& work, std::stop_token stop)>;
using TracerSource = std::function<Result<TrainingTracer>(const UnitLease& lease, std::stop_token stop)>;

struct WorkerOptions {
    BuildIdentity identity;
    uint32_t thread_count = 1;
    std::string host;           ///< For display only.
    uint64_t process_id = 0;    ///< For display only.
    double drain_seconds = 20;  ///< How long a stopping worker may take to finish the unit that it renders.
};

class Worker {
  public:
    Worker(WorkerPort& port, WorkerOptions options, RendererSource renderers, TracerSource tracers);

    /// Works until a stop is requested: then takes no new unit, finishes the one that it renders (or gives it back after
    /// drain_seconds), and returns OK. An unreachable coordinator is waited for; a refused registration is returned.
    Status run(std::stop_token stop);

  private:
    struct Running {
        std::stop_source stop;
        bool rendering = false;
    };

    Status sign_in(std::stop_token stop, const std::string& stale_id);
    std::string id();
    void lane(std::stop_token stop);
    /// Asks for a unit, one lane at a time: the other one would only wait beside it.
    Result<std::vector<UnitLease>> ask(const std::string& worker_id, std::stop_token stop);
    /// Whether the worker has nothing, has said so, and asks for a unit, which is a sign of life in itself.
    bool idles();
    /// False when the unit could not be rendered here.
    bool run_unit(const UnitLease& lease, std::stop_token stop);
    /// Makes the unit and submits it; an error gives it back.
    Status render_unit(const UnitLease& lease, std::stop_token unit_stop, std::stop_token drain);
    Status trace_unit(const UnitLease& lease, std::stop_token unit_stop, std::stop_token drain);
    /// Waits for the unit's turn and calls `make` on all threads; how long that took.
    Result<double> in_turn(const UnitLease& lease, std::stop_token unit_stop, std::stop_token drain,
                           const std::function<void()>& make);
    /// Sends until there is an answer. An error: the unit is to be given back.
    using Send = std::function<Result<SubmitAck>(const std::string& worker_id)>;
    Status submit(const UnitLease& lease, const Send& send, std::stop_token stop);
    void heartbeats(std::stop_token stop);
    void send_heartbeat();
    void announce_rendering(const UnitReference& unit);
    void wait(double seconds, std::stop_token stop);
    /// Waits after a call that failed: for a connection if it failed for want of one, and then for `seconds`, so that not all
    /// workers come at once, nor one that something else refuses.
    void wait_after(const Status& failed, double seconds, std::stop_token stop);

    WorkerPort& port_;
    const WorkerOptions options_;
    const RendererSource renderers_;
    const TracerSource tracers_;
    tbb::task_arena arena_;
    std::mutex render_mutex_;  ///< One unit renders at a time, on all threads.
    std::mutex sign_in_mutex_;
    std::mutex ask_mutex_;                ///< Held while a lane asks for a unit.
    std::atomic<bool> asking_{false};     ///< Whether one does.
    std::atomic<bool> told_idle_{false};  ///< Whether the last heartbeat named no unit.
    std::mutex beat_mutex_;               ///< Heartbeats and units given back reach the coordinator in order. Before mutex_.
    std::mutex mutex_;                    ///< Guards what follows.
    std::condition_variable_any wake_;
    WorkerGrant grant_;
    std::map<UnitReference, Running> running_;
    std::set<std::string> announced_jobs_;
    Status refusal_;
};

}  // namespace lightloom
