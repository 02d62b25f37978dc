#include "server/coordinator.h"

#include "common/cli/log_line.h"
#include "server/keep_groups.h"
#include "server/prepare_job.h"
#include "server/resume.h"

namespace lightloom {
namespace {

/// How often the disk is looked at, by a coordinator that keeps jobs; and how often where it is full.
constexpr double kRoomSeconds = 5, kPausedSeconds = 1;
/// How often the ticker says that it turns.
constexpr double kBeatSeconds = 1;

}  // namespace

Coordinator::Coordinator(CoordinatorOptions options, std::unique_ptr<JobStore> store)
    : office_(std::move(options), std::move(store)),
      admission_(office_),
      end_early_(office_),
      gallery_(office_),
      dispatch_(office_),
      intake_(office_) {
    office_.resume = [this](OpenBook& book, const JobPtr& file) { start_taking_over(office_, book, file); };
    office_.keep = [this](OpenBook& book, const JobPtr& file) { keep_groups(office_, book, file); };
    restored_ = restore_jobs(office_);
    const auto needed = [this](const Digest& digest) { return OpenBook(office_)->ledger.pinned(digest); };
    if (const size_t count = office_.assets.remove_all_that_begin_with(kTablesPrefix, needed); count > 0)
        log_info("removed the tables of {} earlier job(s)", count);
    ticker_ = std::jthread([this](std::stop_token stop) { keep_time(stop); });
}

Coordinator::~Coordinator() {
    ticker_.request_stop();
    {
        OpenBook book(office_);
        book->closing = true;
        for (const auto& [number, file] : book->jobs()) {
            file->stop.request_stop();
            file->changed.notify_all();
        }
        book->wake_all_waiters();
        book->agenda_changed.notify_all();
    }
    ticker_ = {};
    office_.tasks.join();
}

void Coordinator::keep_time(std::stop_token stop) {
    OpenBook book(office_);
    while (!stop.stop_requested()) {
        const TimePoint now = office_.now();
        double seconds = office_.options.longest_sleep_seconds;
        const bool looks = office_.archive.keeps() || !book->paused.empty();
        if (looks) seconds = std::min(seconds, book->paused.empty() ? kRoomSeconds : kPausedSeconds);
        if (office_.options.beat) {
            office_.options.beat();
            seconds = std::min(seconds, kBeatSeconds);
        }
        // A lease has run out a moment after its end, not at it.
        if (const auto next = book->agenda.next()) seconds = std::min(seconds, seconds_between(now, *next) + 1e-3);
        if (seconds > 0) book.wait_until(book->agenda_changed, seconds_after(std::chrono::steady_clock::now(), seconds));
        if (stop.stop_requested()) break;
        dispatch_.tick(book);
        if ((office_.archive.keeps() || !book->paused.empty()) &&
            seconds_between(room_checked_, now) >= (book->paused.empty() ? kRoomSeconds : kPausedSeconds))
            look_for_room(book);
    }
}

std::set<Digest> Coordinator::pinned_tables() const {
    const OpenBook book(office_);
    return book->ledger.pinned_files();
}

Status Coordinator::room() const {
    const OpenBook book(office_);
    return book->paused.empty() ? Status() : Status(StatusCode::kResourceExhausted, "no units are given out: " + book->paused);
}

void Coordinator::look_for_room(OpenBook& book) {
    room_checked_ = office_.now();
    book.close();
    Status room = check_room(office_);
    // Free space is not all that a write needs: there are quotas.
    if (const Status repaid = office_.archive.repay(); room.ok()) room = repaid;
    book.reopen();
    book.set_paused(room.message());
}

}  // namespace lightloom
