#include "server/dispatch.h"

#include "common/core/crash_point.h"
#include "server/blame.h"
#include "server/finish_job.h"
#include "server/learn_job.h"
#include "server/plan_job.h"
#include "server/straggler.h"

namespace lightloom {
namespace {

constexpr double kLongestLeaseWait = 5;
/// A waiting call looks by itself that often whether its caller is still there, and whether a worker that rested may go on. Since
/// the worker is heard of in this way, it is at most a share of a lease.
constexpr double kLookSeconds = 2.5, kLookShare = 0.25;

std::string describe(const BuildIdentity& identity) {
    return "build " + identity.build_id + ", math profile \"" + identity.math_profile + "\", golden unit " +
           identity.golden_digest.hex().substr(0, 16);
}

/// Whether the worker has a lease of the unit.
bool has(const JobBook& book, const UnitReference& unit, uint32_t worker) {
    const JobPtr file = book.find(unit.job_id);
    const UnitTable* const units = file ? file->job.open_units(unit.key) : nullptr;
    return units && units->is_held(unit.key, worker);
}

/// Of what a worker holds, takes out what it has lost: units of jobs that have ended, and leases that ran out. A worker that idles
/// sends no heartbeats that would say so.
void forget_what_it_has_not(JobBook& book, WorkerRecord& worker) {
    std::erase_if(worker.held, [&](const UnitReference& unit) { return !has(book, unit, worker.index); });
}

/// In the line of those that wait for as long as it lives.
class InLine {
  public:
    explicit InLine(JobBook& book) : book_(book), place_(book.waiters.insert(book.waiters.end(), &waiter_)) {}
    ~InLine() {
        const auto next = book_.waiters.erase(place_);
        if (waiter_.look) book_.wake_one_waiter(next);  // it was told to look and did not
    }
    JobBook::Waiter& waiter() { return waiter_; }
    std::list<JobBook::Waiter*>::iterator behind() const { return std::next(place_); }

  private:
    JobBook& book_;
    JobBook::Waiter waiter_;
    std::list<JobBook::Waiter*>::iterator place_;
};

}  // namespace

Result<WorkerGrant> Dispatch::register_worker(const WorkerHello& hello) {
    const CoordinatorOptions& options = office_.options;
    if (hello.thread_count == 0) return invalid_argument("a worker needs at least one thread");
    OpenBook book(office_);
    if (hello.identity != options.identity) {
        const Status refusal = failed_precondition(
            "this worker could render other pixels than the coordinator and is refused: worker has " + describe(hello.identity) +
            "; coordinator has " + describe(options.identity) + "; install the same build on both hosts");
        book.note().error("worker on " + hello.host + " (process " + std::to_string(hello.process_id) + "): " + refusal.message());
        book->workers.refuse(hello, refusal.message(), office_.now());
        return refusal;
    }
    const WorkerRecord& worker = book->workers.add(hello, office_.now());
    book.note().info(worker.id + ": registered, " + std::to_string(hello.thread_count) + " thread(s)");
    return WorkerGrant{worker.id, options.heartbeat_seconds, options.lease_seconds};
}

Choice::Turn Dispatch::next_unit(OpenBook& book, WorkerRecord& worker, std::optional<UnitLease>* lease) {
    if (!book->paused.empty()) return Choice::Turn::kNothingLeft;
    forget_what_it_has_not(*book, worker);
    const auto offers = [&](const std::function<bool(const Offer&)>& visit) {
        for (const auto& [number, in_line] : book->open_jobs()) {
            const JobPtr file = book->in_its_place(in_line);
            const JobState state = file->job.state();
            UnitTable* const units = file->job.open_units();
            if (!units || (file != in_line && state != JobState::kPreparing)) continue;
            if (!visit({file->number, file->job.id(), units, state == JobState::kRunning})) return;
        }
    };
    const Choice choice = choose_unit(offers, worker, book->workers, office_.now(), office_.lease_end());
    if (choice.turn != Choice::Turn::kLeased) return choice.turn;
    const JobPtr file = book->find(choice.job);
    const UnitKey& key = choice.unit.key;
    if (choice.kind == Choice::Kind::kSuspect) worker.alone = UnitReference{file->job.id(), key};
    if (choice.kind == Choice::Kind::kCopy)
        book.note().info(file->job.id() + ": unit " + unit_name(key) + " is rendered by " + worker.id +
                         ", too, which has nothing else");
    make_lease(book, file, worker, choice.unit, lease);
    return choice.turn;
}

void Dispatch::make_lease(OpenBook& book, const JobPtr& file, WorkerRecord& worker, const WorkUnit& unit,
                          std::optional<UnitLease>* lease) {
    const TimePoint now = office_.now();
    Job& job = file->job;
    book.look_again(file, office_.lease_end());
    worker.held.insert({job.id(), unit.key});
    worker.unconfirmed.insert({job.id(), unit.key});
    crash_point("server.unit-leased");
    if (unit.key.kind == UnitKind::kRender) {
        *lease = UnitLease{job.id(), job.spec(), unit, job.tables().asset};
        return;
    }
    Preparation& preparation = job.preparation();
    if (preparation.round_begin == TimePoint()) preparation.round_begin = now;
    if (preparation.learning_seconds > 0) preparation.start_clock(now);  // it goes on
    *lease = UnitLease{job.id(), job.spec(), unit, preparation.guide};
    if (preparation.training_begin == TimePoint()) {
        preparation.training_begin = preparation.round_begin;
        start_learning(office_, book, file);
    }
}

bool Dispatch::took_too_long(OpenBook& book, const JobPtr& file, UnitTable& units, const UnitKey& key, WorkerRecord& worker) {
    const TimePoint now = office_.now();
    const auto begun = units.rendering(key, worker.index, now);
    if (!begun) return false;
    const double taken = seconds_between(*begun, now);
    const std::string& job_id = file->job.id();
    const double longest = longest_seconds(*units.find(key), worker.samples_per_second(job_id), office_.options.unit_time);
    if (taken <= longest) return false;
    const Status why{StatusCode::kDeadlineExceeded, worker.id + " has rendered it for " + std::to_string(int64_t(taken)) +
                                                        " s, at most " + std::to_string(int64_t(longest)) + " s are allowed"};
    book->workers.unit_failed(worker, why.message(), now);
    unit_failed(book, file, key, units.fail(key, worker.index, worker.successes), why, now);
    return true;
}

Result<std::vector<UnitLease>> Dispatch::lease(const std::string& worker_id, double wait_seconds,
                                               const std::function<bool()>& cancelled) {
    if (!(wait_seconds >= 0)) return invalid_argument("a worker waits for 0 or more seconds");
    const double look_seconds = std::min(kLookSeconds, kLookShare * office_.options.lease_seconds);
    const auto deadline = seconds_after(std::chrono::steady_clock::now(), std::min(wait_seconds, kLongestLeaseWait));
    OpenBook book(office_);
    WorkerRecord* const worker = book->workers.find(worker_id);
    if (!worker) return no_worker(worker_id);
    ++worker->waiting;
    std::vector<UnitLease> leases;
    {
        InLine place(*book);
        while (!book->closing && !worker->left && !cancelled()) {
            worker->last_heard = office_.now();
            std::optional<UnitLease> unit;
            const bool woken = std::exchange(place.waiter().look, false);
            const Choice::Turn turn = next_unit(book, *worker, &unit);
            // Where there may be more, the next in line looks, too.
            if (turn == Choice::Turn::kLeased || (woken && turn == Choice::Turn::kNotForThisOne))
                book->wake_one_waiter(place.behind());
            if (unit) {
                leases.push_back(*std::move(unit));
                break;
            }
            const auto now = std::chrono::steady_clock::now();
            if (now >= deadline) break;
            const auto until = std::min(deadline, seconds_after(now, look_seconds));
            while (!place.waiter().look && std::chrono::steady_clock::now() < until) book.wait_until(place.waiter().woken, until);
        }
    }
    --worker->waiting;
    if (book->closing) return Status(StatusCode::kUnavailable, "the coordinator is going down");
    return leases;
}

void Dispatch::wake() { OpenBook(office_)->wake_all_waiters(); }

Result<std::vector<UnitReference>> Dispatch::heartbeat(const std::string& worker_id, const std::vector<RunningUnit>& running) {
    OpenBook book(office_);
    WorkerRecord* const worker = book->workers.find(worker_id);
    if (!worker) return no_worker(worker_id);
    const TimePoint now = office_.now();
    worker->last_heard = now;
    std::vector<UnitReference> revoked;
    std::set<UnitReference> held;
    worker->in_work.reset();
    for (const RunningUnit& item : running) {
        const JobPtr file = book->find(item.unit.job_id);
        UnitTable* const units = file ? file->job.open_units(item.unit.key) : nullptr;
        if (!units || !units->renew(item.unit.key, worker->index, now, office_.lease_end()) ||
            (item.rendering && took_too_long(book, file, *units, item.unit.key, *worker))) {
            revoked.push_back(item.unit);
            continue;
        }
        book.look_again(file, office_.lease_end());
        held.insert(item.unit);
        worker->unconfirmed.erase(item.unit);
        if (!item.rendering) continue;
        worker->in_work = item.unit;
        if (item.unit.key.kind != UnitKind::kRender) {
            file->job.preparation().start_clock(now);
        } else {
            book.apply(file, file->job.rendering_begins(now));
            if (const auto end = file->job.end_of_time()) book.look_again(file, *end);
        }
    }
    // A lease whose answer crosses the heartbeat is not in `running`, and neither is one whose answer was lost, which expires by
    // itself. Until then the worker is taken to hold it: it may be a suspect that runs alone.
    std::erase_if(worker->unconfirmed, [&](const UnitReference& unit) { return !has(*book, unit, worker->index); });
    held.insert(worker->unconfirmed.begin(), worker->unconfirmed.end());
    worker->held = std::move(held);
    return revoked;
}

Status Dispatch::release(const std::string& worker_id, const UnitReference& unit, const Status& why) {
    const bool lost_bytes = why.code() == StatusCode::kDataLoss || why.code() == StatusCode::kNotFound;
    const bool repaired = lost_bytes && repair_tables(office_, unit.job_id);
    OpenBook book(office_);
    const auto [worker, file, units] = book->take_back(worker_id, unit);
    if (!worker) return no_worker(worker_id);
    if (!units) return {};
    // Network errors say nothing about the unit and only cost time.
    const bool blameless = repaired || why.code() == StatusCode::kCancelled || why.code() == StatusCode::kUnavailable ||
                           why.code() == StatusCode::kDeadlineExceeded || why.code() == StatusCode::kAborted;
    if (why.ok() || blameless) {
        units->release(unit.key, worker->index);
        book.units_appeared();
    } else if (why.code() == StatusCode::kResourceExhausted && office_.options.no_other_workers) {
        book.fail(file, {why.code(), "unit " + unit_name(unit.key) + ": " + why.message()});
    } else if (why.code() == StatusCode::kResourceExhausted) {
        host_failed(book, file, *units, unit.key, *worker, why, office_.now());
    } else {
        const TimePoint now = office_.now();
        if (why.code() != StatusCode::kInvalidArgument)
            book->workers.unit_failed(*worker, why.message(), now);  // else it is the job
        const UnitTable::Failures failures = units->fail(unit.key, worker->index, worker->successes);
        unit_failed(book, file, unit.key, failures, {why.code(), worker->id + ": " + why.message()}, now);
    }
    file->job.stop_idle_clock(office_.now());
    return {};
}

Status Dispatch::goodbye(const std::string& worker_id) {
    OpenBook book(office_);
    WorkerRecord* const worker = book->workers.find(worker_id);
    if (!worker) return no_worker(worker_id);
    for (const auto& [number, file] : book->open_jobs()) {
        UnitTable* const units = file->job.open_units();
        if (!units || units->leased_count() == 0) continue;
        units->release_all(worker->index);
        file->job.stop_idle_clock(office_.now());
    }
    worker->held.clear();
    worker->left = true;
    book.note().info(worker_id + ": left");
    book->wake_all_waiters();
    return {};
}

std::vector<WorkerStatus> Dispatch::workers(double gone_within_seconds) const {
    return OpenBook(office_)->workers.statuses(office_.now(), gone_within_seconds);
}

void Dispatch::tick(OpenBook& book) {
    const TimePoint now = office_.now();
    for (const uint64_t number : book->agenda.take_due(now)) {
        const JobPtr file = book->find(number);
        UnitTable* const units = file ? file->job.open_units() : nullptr;
        if (!units) continue;
        if (const auto expired = units->expire(now); !expired.empty()) {
            // An answer may have been lost on its way, and an idle worker tells nothing of what it has not.
            for (const UnitTable::Expired& lease : expired) book->workers.at(lease.worker).held.erase({file->job.id(), lease.unit});
            leases_expired(book, file, *units, expired, now);
        }
        file->job.stop_idle_clock(now);
        if (file->job.time_is_up(now)) {
            file->job.close();
            finish_if_complete(office_, book, file);
        }
        if (file->job.ended()) continue;
        if (const auto end = file->job.end_of_time()) book.look_again(file, *end);
        if (const UnitTable* const open = file->job.open_units())
            if (const auto expiry = open->next_expiry()) book.look_again(file, *expiry);
    }
}

}  // namespace lightloom
