#pragma once
// A coordinator and workers as processes that the kill loop disturbs and starts again.

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/service/chaos/ledger.h"
#include "tests/service/chaos/plan.h"
#include "tests/service/process.h"

namespace lightloom::chaos {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

/// One thread uses it, and calls poll() every few hundredths of a second.
class Farm {
  public:
    Farm(const Phase& phase, std::filesystem::path directory, Ledger& ledger);
    Farm(const Farm&) = delete;
    ~Farm();

    /// False if the coordinator did not start.
    bool start(double patience_seconds);
    void apply(const Action& action);
    /// Starts again what is down and due, lets go on what was stopped long enough.
    void poll();
    /// No fault is left: all processes run, disks have room, no crash point is armed.
    void heal();
    bool healed() const;

    /// What the status page says; nothing while the coordinator is down, stopped or does not answer.
    std::optional<nlohmann::json> status();
    /// SIGTERM to all, workers first; false if one does not end cleanly.
    bool stop_cleanly(double patience_seconds);

    /// The coordinator listens and is not stopped.
    bool server_answers() const { return server_open_ && server_.process && !server_.continue_at; }
    /// While nobody reads the coordinator's log: since when.
    std::optional<Clock::time_point> log_blocked_since() const { return log_blocked_since_; }
    std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
    std::filesystem::path path(const std::string& name) const { return directory_ / name; }
    /// How often the coordinator has died.
    uint64_t server_deaths() const { return server_deaths_; }
    bool disk_was_full() const { return disk_was_full_; }
    bool is_alive(int64_t process_id) const;
    /// A job made progress; the coordinator's recovery ends with it.
    void progress_seen();
    /// A file of the coordinator's that holds tables of a job; empty if there is none.
    std::filesystem::path tables_in_use() const;
    /// Of the results that workers were thanked for: how many there are, and how many of them were asked for once more. What a
    /// worker has logged last is lost when it is killed, so some are missing.
    std::pair<uint64_t, uint64_t> acknowledged() const;
    /// Scratch directories of processes that are gone; asked when none runs.
    uint64_t leftovers() const;
    /// Removes a file of the coordinator, as an operator would whom a message tells that it is damaged.
    bool remove_asset(const std::string& hex);
    /// What went wrong with the processes since the last call.
    std::vector<std::string> take_violations() { return std::exchange(violations_, {}); }

  private:
    struct Slot {
        std::string name;
        std::unique_ptr<testing::Process> process;
        Clock::time_point start_at{};  ///< While there is no process.
        std::optional<Clock::time_point> continue_at, disk_free_at;
        std::vector<std::string> crashes;  ///< The first is armed in the process that runs or that is started next.
        double crash_delay = 0;            ///< Seconds after which a process that died of it is started again.
        bool restarted = false;
    };

    void spawn(Slot& slot);
    void kill(Slot& slot, double restart_after);
    void stop(Slot& slot, double seconds);
    void go_on(Slot& slot);
    void set_disk(const Slot& slot, bool full) const;
    void poll(Slot& slot);
    void read_log();
    void block_log(double seconds);
    std::filesystem::path cache_of(int worker) const;
    std::filesystem::path file_to_damage(const std::filesystem::path& store, const std::filesystem::path& tables, Damage damage,
                                         uint64_t place) const;
    void damage(const std::filesystem::path& file, uint64_t place);
    bool is_server(const Slot& slot) const { return &slot == &server_; }

    const Phase& phase_;
    const std::filesystem::path directory_;
    Ledger& ledger_;
    Slot server_;
    std::vector<Slot> workers_;
    int port_ = 0, status_port_ = 0;
    uint64_t server_deaths_ = 0;
    bool disk_was_full_ = false;
    int log_pipe_ = -1;  ///< The coordinator's standard error, both ends, so that it outlives each of its processes.
    std::optional<Clock::time_point> log_blocked_since_, log_free_at_;
    Clock::time_point server_spawned_{};
    std::optional<Clock::time_point> recovering_since_;  ///< The port of a coordinator that died is open again since then.
    bool server_open_ = false;
    std::vector<std::string> violations_;
};

}  // namespace lightloom::chaos
