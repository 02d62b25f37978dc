#pragma once
// A stop token that also stops after some time.

#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>

namespace lightloom::client {

class TimedStop {
  public:
    /// Stops with `outer`, or after `seconds`; infinite: never by itself.
    TimedStop(std::stop_token outer, double seconds);
    std::stop_token token() const { return source_.get_token(); }
    /// Whether it was the time that stopped it.
    bool timed_out() const { return source_.stop_requested() && !outer_.stop_requested(); }

  private:
    std::stop_token outer_;
    std::stop_source source_;
    std::mutex mutex_;
    std::condition_variable_any wake_;
    std::jthread timer_;  ///< Last: it ends before what it uses.
};

}  // namespace lightloom::client
