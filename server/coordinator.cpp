#include "server/coordinator.h"

#include "common/cli/log_line.h"
#include "server/prepare_job.h"

namespace lightloom {

Coordinator::Coordinator(CoordinatorOptions options)
    : office_(std::move(options)),
      admission_(office_),
      dispatch_(office_),
      intake_(office_) {
    office_.resume = [this](OpenBook& book, const JobPtr& file) { start_taking_over(office_, book, file); };
    // Jobs do not outlive the coordinator, so that nothing refers to tables that are found at the start.
    if (const size_t count = office_.assets.remove_all_that_begin_with(kTablesPrefix); count > 0)
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
        // A lease has run out a moment after its end, not at it.
        if (const auto next = book->agenda.next()) seconds = std::min(seconds, seconds_between(now, *next) + 1e-3);
        if (seconds > 0) book.wait_until(book->agenda_changed, seconds_after(std::chrono::steady_clock::now(), seconds));
        if (!stop.stop_requested()) dispatch_.tick(book);
    }
}

}  // namespace lightloom
