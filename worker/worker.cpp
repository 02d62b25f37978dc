#include "worker/worker.h"

#include <chrono>
#include <new>
#include <random>
#include <thread>

#include "common/cli/log_line.h"
#include "common/core/crash_point.h"

namespace lightloom {
namespace {

using Clock = std::chrono::steady_clock;

/// Full-jitter exponential back-off: workers that lost the same coordinator must not all come back at once.
class Backoff {
  public:
    double next() {
        const double limit = std::min(5.0, 0.1 * double(1u << std::min(attempt_++, 6u)));
        return std::uniform_real_distribution<double>(0.02, limit)(engine_);
    }
    void reset() { attempt_ = 0; }

  private:
    unsigned attempt_ = 0;
    std::minstd_rand engine_{std::random_device{}()};
};

constexpr double kLeaseWaitSeconds = 5;
/// Between looks at whether a worker that waits for a connection is to stop.
constexpr double kConnectSeconds = 0.2;
constexpr int kSubmitAttempts = 40;
/// Share of a probe's samples that is traced before it is timed, and the least number per thread.
constexpr uint64_t kWarmUpShare = 8, kWarmUpPerThread = kTrainingChunkSamples;

std::string name_of(const UnitReference& unit) {
    if (unit.key.kind != UnitKind::kRender)
        return unit.job_id + " training unit " + std::to_string(unit.key.round) + "/" + std::to_string(unit.key.group);
    return unit.job_id + " unit " + std::to_string(unit.key.group) + "/" + std::to_string(unit.key.tile);
}

/// A rendered unit is worth more than the estimate that goes with it: if that fails, the unit goes without.
RareLight rare_light_of(const Renderer& renderer, std::stop_token stop) {
    try {
        const RareLight light = renderer.rare_light(std::move(stop));
        if (light.is_valid()) return light;
        log_warn("the estimate of light that only chance finds is not finite; the job will not have it");
    } catch (const std::exception& error) {
        log_warn("the estimate of light that only chance finds failed ({}); the job will not have it", error.what());
    }
    return {};
}

}  // namespace

Worker::Worker(WorkerPort& port, WorkerOptions options, RendererSource renderers, TracerSource tracers)
    : port_(port),
      options_(std::move(options)),
      renderers_(std::move(renderers)),
      tracers_(std::move(tracers)),
      arena_(int(options_.thread_count)) {}

std::string Worker::id() {
    const std::lock_guard lock(mutex_);
    return grant_.worker_id;
}

void Worker::wait(double seconds, std::stop_token stop) {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, std::chrono::duration<double>(seconds), [] { return false; });
}

void Worker::wait_after(const Status& failed, double seconds, std::stop_token stop) {
    // Inside of the port: while nobody waits there, a connection makes a step every few seconds only.
    if (failed.code() == StatusCode::kUnavailable)
        while (!stop.stop_requested() && !port_.wait_connected(kConnectSeconds)) {
        }
    wait(seconds, stop);
}

Status Worker::sign_in(std::stop_token stop, const std::string& stale_id) {
    const std::lock_guard only_one(sign_in_mutex_);
    if (id() != stale_id) return {};  // another lane was faster
    const WorkerHello hello{options_.identity, options_.thread_count, options_.host, options_.process_id};
    Backoff backoff;
    bool complained = false;
    while (!stop.stop_requested()) {
        const auto grant = port_.register_worker(hello);
        if (grant.ok()) {
            log_info("registered as {}", grant->worker_id);
            crash_point("worker.registered");
            const std::lock_guard lock(mutex_);
            grant_ = *grant;
            return {};
        }
        const StatusCode code = grant.status().code();
        // After any other error, like a broken stream, the next attempt may succeed.
        if (code == StatusCode::kFailedPrecondition || code == StatusCode::kInvalidArgument || code == StatusCode::kUnimplemented ||
            code == StatusCode::kPermissionDenied) {
            const std::lock_guard lock(mutex_);
            refusal_ = grant.status();
            return grant.status();
        }
        if (!complained) log_warn("waiting for the coordinator: {}", grant.status().message());
        complained = true;
        wait_after(grant.status(), backoff.next(), stop);
    }
    return {StatusCode::kCancelled, "stopped"};
}

Status Worker::run(std::stop_token stop) {
    if (Status s = sign_in(stop, {}); !s.ok()) return s.code() == StatusCode::kCancelled ? Status() : s;
    std::stop_source internal;  // also ends the worker when a later registration is refused
    const std::stop_callback forward(stop, [&] { internal.request_stop(); });
    {
        std::jthread beats([this](std::stop_token beat_stop) { heartbeats(beat_stop); });
        const auto drain_guard = [&](std::stop_token guard_stop) {
            // Waits for the stop, then gives the running unit its time to finish.
            std::unique_lock lock(mutex_);
            wake_.wait(lock, guard_stop, [&] { return internal.stop_requested(); });
            if (guard_stop.stop_requested()) return;
            wake_.wait_for(lock, guard_stop, std::chrono::duration<double>(options_.drain_seconds), [] { return false; });
            for (auto& [unit, running] : running_) running.stop.request_stop();
        };
        std::jthread guard(drain_guard);
        const std::stop_callback wake_guard(internal.get_token(), [&] {
            const std::lock_guard lock(mutex_);
            wake_.notify_all();
        });
        const auto work = [&] {
            lane(internal.get_token());
            bool refused = false;
            {
                const std::lock_guard lock(mutex_);
                refused = !refusal_.ok();
            }
            if (refused) internal.request_stop();
        };
        // Two lanes: while one renders, the other submits its partial and leases the next unit.
        std::jthread first(work), second(work);
        first.join();
        second.join();
    }
    (void)port_.goodbye(id());
    const std::lock_guard lock(mutex_);
    return refusal_;
}

Result<std::vector<UnitLease>> Worker::ask(const std::string& worker_id, std::stop_token stop) {
    const std::lock_guard one_asks(ask_mutex_);
    if (stop.stop_requested()) return std::vector<UnitLease>();
    asking_ = true;
    auto leases = port_.lease_units(worker_id, kLeaseWaitSeconds, std::move(stop));
    asking_ = false;
    return leases;
}

void Worker::lane(std::stop_token stop) {
    Backoff backoff;
    while (!stop.stop_requested()) {
        const std::string worker_id = id();
        const auto leases = ask(worker_id, stop);
        if (leases.ok()) {
            // A worker that cannot render (its disk is full, say) must not use up the units of the whole farm.
            for (const UnitLease& lease : *leases) {
                if (run_unit(lease, stop))
                    backoff.reset();
                else
                    wait(backoff.next(), stop);
            }
        } else if (leases.status().code() == StatusCode::kNotFound) {
            if (!sign_in(stop, worker_id).ok()) return;
        } else if (!stop.stop_requested()) {
            log_debug("lease: {}", leases.status().message());
            wait_after(leases.status(), backoff.next(), stop);
        }
    }
}

bool Worker::run_unit(const UnitLease& lease, std::stop_token stop) {
    crash_point("worker.unit-received");
    const UnitReference reference = lease.reference();
    std::stop_token unit_stop;
    {
        const std::lock_guard lock(mutex_);
        const auto [item, fresh] = running_.try_emplace(reference);
        if (!fresh) return true;  // the other lane has it and gives it back if its result fails
        unit_stop = item->second.stop.get_token();
    }
    const bool training = reference.key.kind != UnitKind::kRender;
    Status made;
    try {
        made = training ? trace_unit(lease, unit_stop, stop) : render_unit(lease, unit_stop, stop);
    } catch (const std::bad_alloc&) {
        made = {StatusCode::kResourceExhausted, "this worker has too little memory for the unit"};
    }
    const bool able = made.ok() || made.code() == StatusCode::kCancelled;
    if (!able) log_error("{}: {}", name_of(reference), made.message());
    // A heartbeat that still named a unit that is being given back would renew its lease, and nobody would render it
    // until that lease expired.
    std::unique_lock beat(beat_mutex_, std::defer_lock);
    if (!made.ok()) beat.lock();
    {
        const std::lock_guard lock(mutex_);
        running_.erase(reference);
    }
    if (!made.ok()) {
        const Status status = port_.release_unit(id(), reference, made);
        if (!status.ok()) log_debug("release: {}", status.message());
        crash_point("worker.unit-released");
    }
    return able;
}

Result<double> Worker::in_turn(const UnitLease& lease, std::stop_token unit_stop, std::stop_token drain,
                               const std::function<void()>& make) {
    const std::lock_guard only_one(render_mutex_);
    if (unit_stop.stop_requested() || drain.stop_requested()) return Status(StatusCode::kCancelled, "given back");
    announce_rendering(lease.reference());
    const auto begin = Clock::now();
    arena_.execute(make);
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

Status Worker::render_unit(const UnitLease& lease, std::stop_token unit_stop, std::stop_token drain) {
    const auto renderer = renderers_(lease, unit_stop);
    if (!renderer.ok()) return renderer.status();
    Result<Partial> partial = internal_error("not rendered");
    double seconds = 0;
    const auto taken = in_turn(lease, unit_stop, drain, [&] {
        const auto begin = Clock::now();
        partial = (*renderer)->render(lease.unit.render, unit_stop);
        seconds = std::chrono::duration<double>(Clock::now() - begin).count();
        // What samples cannot tell of the job's error is estimated once, by whoever renders its first unit.
        if (partial.ok() && lease.unit.key == UnitKey{}) partial->rare_light = rare_light_of(**renderer, unit_stop);
    });
    if (!taken.ok()) return taken.status();
    if (!partial.ok()) return partial.status();
    crash_point("worker.unit-rendered");
    return submit(
        lease, [&](const std::string& worker_id) { return port_.submit_result(worker_id, lease, *partial, seconds); }, drain);
}

Status Worker::trace_unit(const UnitLease& lease, std::stop_token unit_stop, std::stop_token drain) {
    const auto tracer = tracers_(lease, unit_stop);
    if (!tracer.ok()) return tracer.status();
    Result<TrainingData> data = internal_error("not traced");
    if (lease.unit.key.kind == UnitKind::kProbe) {
        // A probe measures what a sample costs. The first ones also pay for threads, page faults and cold caches, a
        // tenth of a second that the job pays only once. In a short probe it would make every sample seem several times
        // too expensive.
        TrainingWork first = lease.unit.training;
        first.sample_count =
            std::min(first.sample_count, std::max(first.sample_count / kWarmUpShare, kWarmUpPerThread * options_.thread_count));
        const auto warm = in_turn(lease, unit_stop, drain, [&] { data = (*tracer)(first, unit_stop); });
        if (!warm.ok()) return warm.status();
        if (!data.ok()) return data.status();
    }
    const auto seconds = in_turn(lease, unit_stop, drain, [&] { data = (*tracer)(lease.unit.training, unit_stop); });
    if (!seconds.ok()) return seconds.status();
    if (!data.ok()) return data.status();
    crash_point("worker.training-traced");
    const std::string payload = serialize(*data);
    const auto send = [&](const std::string& worker_id) { return port_.submit_training(worker_id, lease, payload, *seconds); };
    return submit(lease, send, drain);
}

Status Worker::submit(const UnitLease& lease, const Send& send, std::stop_token stop) {
    Backoff backoff;
    for (int attempt = 0; attempt < kSubmitAttempts; ++attempt) {
        const std::string worker_id = id();
        crash_point("worker.before-submit");
        const auto ack = send(worker_id);
        crash_point("worker.after-submit");
        if (ack.ok()) {
            if (ack->outcome == SubmitOutcome::kAccepted) log_debug("result accepted: {}", name_of(lease.reference()));
            if (ack->outcome == SubmitOutcome::kDuplicateDifferent) log_error("{}: {}", name_of(lease.reference()), ack->reason);
            // The coordinator has counted the failure, but a heartbeat or our other lane may have leased the unit again
            // meanwhile.
            if (ack->outcome == SubmitOutcome::kRejected) return {StatusCode::kAborted, ack->reason};
            return {};
        }
        const StatusCode code = ack.status().code();
        if (code == StatusCode::kNotFound) {
            if (const Status status = sign_in(stop, worker_id); !status.ok()) return status;
        } else if (code == StatusCode::kUnavailable || code == StatusCode::kDeadlineExceeded) {
            wait_after(ack.status(), backoff.next(), stop);
            if (stop.stop_requested() && attempt > 2) return {StatusCode::kCancelled, "this worker leaves"};
        } else {
            return ack.status();
        }
    }
    return {StatusCode::kUnavailable, "the coordinator did not take the result"};
}

void Worker::announce_rendering(const UnitReference& unit) {
    bool first = false;
    {
        const std::lock_guard lock(mutex_);
        running_[unit].rendering = true;
        first = unit.key.kind == UnitKind::kRender && announced_jobs_.insert(unit.job_id).second;
    }
    // The clock of a time-limited job starts here: the coordinator must know at once.
    if (first) send_heartbeat();
}

void Worker::send_heartbeat() {
    const std::lock_guard beat(beat_mutex_);
    std::vector<RunningUnit> running;
    std::string worker_id;
    {
        const std::lock_guard lock(mutex_);
        worker_id = grant_.worker_id;
        for (const auto& [unit, state] : running_) running.push_back({unit, state.rendering});
    }
    const auto revoked = port_.heartbeat(worker_id, running);
    told_idle_ = revoked.ok() && running.empty();
    if (!revoked.ok()) {
        log_debug("heartbeat: {}", revoked.status().message());
        return;
    }
    const std::lock_guard lock(mutex_);
    for (const UnitReference& unit : *revoked) {
        const auto item = running_.find(unit);
        if (item != running_.end()) item->second.stop.request_stop();
    }
}

bool Worker::idles() {
    const std::lock_guard lock(mutex_);
    return running_.empty() && asking_ && told_idle_;
}

void Worker::heartbeats(std::stop_token stop) {
    while (!stop.stop_requested()) {
        double interval = 1;
        {
            const std::lock_guard lock(mutex_);
            interval = grant_.heartbeat_seconds;
        }
        if (!idles()) send_heartbeat();
        wait(interval, stop);
    }
}

}  // namespace lightloom
