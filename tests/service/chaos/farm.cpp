#include "tests/service/chaos/farm.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "common/tables/tables.h"

namespace lightloom::chaos {
namespace {

namespace fs = std::filesystem;
using testing::Process;

/// Where a worker's disk is "full": lists and small scene files still fit, tables do not.
constexpr rlim_t kFullDiskBytes = 8192;
constexpr double kStatusSeconds = 0.5;
/// With what follows, a worker's line about a result that counts.
constexpr std::string_view kAcceptedLine = "result accepted: ";

sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
}

bool is_free(int port) {
    const int probe = ::socket(AF_INET, SOCK_STREAM, 0);
    const sockaddr_in address = loopback(port);
    const bool free = ::bind(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
    ::close(probe);
    return free;
}

/// A port that a coordinator finds free again after its death: below those that the system gives away by itself.
int pick_port(uint64_t hint) {
    int port = 20000 + int(hint % 10000);
    while (!is_free(port)) port = 20000 + (port - 20000 + 1) % 10000;
    return port;
}

/// The body of the answer; nothing if there is none in time.
std::optional<std::string> http_get(int port, const std::string& page) {
    const int client = ::socket(AF_INET, SOCK_STREAM, 0);
    const timeval patience{.tv_sec = 0, .tv_usec = suseconds_t(kStatusSeconds * 1e6)};
    ::setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setsockopt(client, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
    const sockaddr_in address = loopback(port);
    std::string answer;
    ssize_t got = -1;
    if (::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
        const std::string request = "GET " + page + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
        (void)!::send(client, request.data(), request.size(), MSG_NOSIGNAL);
        char buffer[4096];
        while ((got = ::recv(client, buffer, sizeof buffer, 0)) > 0) answer.append(buffer, size_t(got));
    }
    ::close(client);
    const size_t body = answer.find("\r\n\r\n");
    if (got != 0 || body == std::string::npos) return std::nullopt;
    return answer.substr(body + 4);
}

std::string head_of(const fs::path& file) {
    std::string head(32, '\0');
    std::ifstream in(file, std::ios::binary);
    in.read(head.data(), std::streamsize(head.size()));
    head.resize(size_t(in.gcount()));
    return head;
}

std::vector<fs::path> files_below(const fs::path& directory) {
    std::vector<fs::path> found;
    std::error_code error;
    for (fs::recursive_directory_iterator item(directory, error), end; !error && item != end; item.increment(error)) {
        if (item->path().filename() == "incoming") item.disable_recursion_pending();
        if (item->is_regular_file(error)) found.push_back(item->path());
    }
    std::sort(found.begin(), found.end());
    return found;
}

Clock::time_point after(double seconds) {
    return Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace

Farm::Farm(const Phase& phase, fs::path directory, Ledger& ledger)
    : phase_(phase),
      directory_(std::move(directory)),
      ledger_(ledger),
      workers_(size_t(phase.workers)) {
    fs::create_directories(directory_);
    server_.name = "server";
    ::mkfifo(path("server.pipe").c_str(), 0600);
    log_pipe_ = ::open(path("server.pipe").c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    for (size_t i = 0; i < workers_.size(); ++i) workers_[i].name = "worker" + std::to_string(i);
    port_ = pick_port(uint64_t(::getpid()) * 7 + 2 * phase.number);
    status_port_ = pick_port(uint64_t(port_) - 20000 + 1);
}

Farm::~Farm() {
    server_.process.reset();
    read_log();
    ::close(log_pipe_);
}

void Farm::read_log() {
    std::ofstream log(path("server.log"), std::ios::binary | std::ios::app);
    char buffer[4096];
    for (ssize_t got; (got = ::read(log_pipe_, buffer, sizeof buffer)) > 0;) log.write(buffer, got);
}

void Farm::block_log(double seconds) {
    read_log();
    const std::string line(64, '\n');
    while (::write(log_pipe_, line.data(), line.size()) > 0) {
    }
    while (::write(log_pipe_, line.data(), 1) > 0) {
    }
    log_blocked_since_ = Clock::now();
    log_free_at_ = after(seconds);
}

bool Farm::start(double patience_seconds) {
    spawn(server_);
    const bool up = testing::wait_until(patience_seconds, [&] {
        poll(server_);
        return server_open_;
    });
    if (!up) return false;
    for (Slot& worker : workers_) spawn(worker);
    return true;
}

void Farm::spawn(Slot& slot) {
    // The environment of this process is what the other one inherits; there is one thread here.
    if (!slot.crashes.empty()) ::setenv(kCrashVariable, slot.crashes.front().c_str(), 1);
    const fs::path log = path(is_server(slot) ? "server.pipe" : slot.name + ".log");
    if (is_server(slot)) {
        fs::remove(path("ports"));
        server_open_ = false;
        server_spawned_ = Clock::now();
        std::vector<std::string> arguments{
            "--listen", address(),    "--status",           "127.0.0.1:" + std::to_string(status_port_),
            "--data",   path("data"), "--port-file",        path("ports"),
            "--lease",  "1",          "--checkpoint-after", "1"};
        if (phase_.shuffle) arguments.insert(arguments.end(), {"--shuffle-leases", std::to_string(*phase_.shuffle)});
        slot.process = std::make_unique<Process>("lightloom-server", arguments, log);
    } else {
        const int index = int(&slot - workers_.data());
        slot.process =
            std::make_unique<Process>("lightloom-worker",
                                      std::vector<std::string>{"--server", address(), "--threads", std::to_string(phase_.threads),
                                                               "--cache", cache_of(index), "--log", "debug"},
                                      log);
        if (slot.disk_free_at) set_disk(slot, true);
    }
    ::unsetenv(kCrashVariable);
}

fs::path Farm::cache_of(int worker) const { return path(phase_.shared_cache ? "cache" : "cache" + std::to_string(worker)); }

void Farm::kill(Slot& slot, double restart_after) {
    if (slot.process) {
        slot.process->signal(SIGKILL);
        slot.process->wait();
        slot.process.reset();
        if (is_server(slot)) ++server_deaths_;
    }
    slot.restarted = true;
    slot.continue_at.reset();
    slot.crashes.clear();
    slot.start_at = after(restart_after);
    if (is_server(slot)) server_open_ = false, recovering_since_.reset();
}

void Farm::stop(Slot& slot, double seconds) {
    if (!slot.process || slot.continue_at) return;
    slot.process->signal(SIGSTOP);
    slot.continue_at = after(seconds);
}

void Farm::go_on(Slot& slot) {
    if (slot.process && slot.continue_at) slot.process->signal(SIGCONT);
    slot.continue_at.reset();
}

void Farm::set_disk(const Slot& slot, bool full) const {
    rlimit limit{};
    if (!slot.process || ::prlimit(slot.process->pid(), RLIMIT_FSIZE, nullptr, &limit) != 0) return;
    limit.rlim_cur = full ? kFullDiskBytes : limit.rlim_max;
    ::prlimit(slot.process->pid(), RLIMIT_FSIZE, &limit, nullptr);
}

void Farm::apply(const Action& action) {
    Slot* const worker = action.worker < int(workers_.size()) ? &workers_[size_t(action.worker)] : nullptr;
    switch (action.act) {
        case Act::kKillWorker:
            if (!worker->process) return;
            ++ledger_.worker_kills;
            return kill(*worker, action.seconds);
        case Act::kStopWorker:
            ledger_.worker_stops += worker->process && !worker->continue_at;
            return stop(*worker, action.seconds);
        case Act::kCrashWorker:
            kill(*worker, 0);
            worker->crashes = action.crashes;
            return;
        case Act::kFillDisk:
            ++ledger_.full_disks;
            disk_was_full_ = true;
            worker->disk_free_at = after(action.seconds);
            return set_disk(*worker, true);
        case Act::kDamageWorker: {
            kill(*worker, 0);
            const fs::path cache = cache_of(action.worker);
            return damage(file_to_damage(cache / "assets", cache / "worker-tables", action.damage, action.place), action.place);
        }
        case Act::kKillServer:
            if (!server_.process) return;
            ++ledger_.server_kills;
            return kill(server_, action.seconds);
        case Act::kBlockLog: return block_log(action.seconds);
        case Act::kStopServer:
            ledger_.server_stops += server_.process && !server_.continue_at;
            return stop(server_, action.seconds);
        case Act::kCrashServer:
            kill(server_, 0);
            server_.crashes = action.crashes;
            server_.crash_delay = action.seconds;
            return;
        case Act::kDamageServer:
            return damage(file_to_damage(path("data/assets"), path("data/tables"), action.damage, action.place), action.place);
    }
}

fs::path Farm::file_to_damage(const fs::path& store, const fs::path& tables, Damage damage, uint64_t place) const {
    std::vector<fs::path> found = files_below(damage == Damage::kTables ? tables : store);
    std::erase_if(found, [&](const fs::path& file) {
        const std::string head = head_of(file);
        const bool list = head.starts_with("lightloom-scene "), table = head.starts_with(kTablesPrefix);
        return damage == Damage::kFileList ? !list : damage == Damage::kSceneFile && (list || table);
    });
    return found.empty() ? fs::path() : found[size_t(place >> 32) % found.size()];
}

void Farm::damage(const fs::path& file, uint64_t place) {
    const auto bytes = file.empty() ? Result<std::string>(not_found("no such file yet")) : read_file(file.string());
    if (!bytes.ok() || bytes->empty()) return;
    std::string changed = *bytes;
    changed[place % changed.size()] = char(changed[place % changed.size()] ^ (1 << ((place >> 24) % 8)));
    // A new file under the name: who has the old one open, or another link to it, does not see it change while it reads.
    if (write_file_atomically(file.string(), changed).ok()) ++ledger_.damaged_files;
}

fs::path Farm::tables_in_use() const {
    for (const fs::path& file : files_below(path("data/assets")))
        if (head_of(file).starts_with(kTablesPrefix)) return file;
    return {};
}

std::pair<uint64_t, uint64_t> Farm::acknowledged() const {
    std::map<std::string, uint64_t> times;
    for (const Slot& worker : workers_) {
        std::ifstream log(path(worker.name + ".log"));
        for (std::string line; std::getline(log, line);)
            if (const size_t at = line.find(kAcceptedLine); at != std::string::npos)
                ++times[line.substr(at + kAcceptedLine.size())];
    }
    uint64_t again = 0;
    for (const auto& [unit, count] : times) again += count - 1;
    return {times.size(), again};
}

uint64_t Farm::leftovers() const {
    std::set<fs::path> parents{path("data/scratch")};
    for (int i = 0; i < phase_.workers; ++i) parents.insert(cache_of(i));
    uint64_t count = 0;
    std::error_code error;
    for (const fs::path& parent : parents)
        for (fs::directory_iterator item(parent, error), end; !error && item != end; item.increment(error))
            count +=
                item->path().filename().string().starts_with("scene");  // "scenes-..." of a worker, "scene-..." of the coordinator
    return count;
}

bool Farm::remove_asset(const std::string& hex) { return fs::remove(path("data/assets") / hex.substr(0, 2) / hex); }

void Farm::poll(Slot& slot) {
    const auto now = Clock::now();
    if (slot.process && slot.process->ended()) {
        const int code = slot.process->wait();
        slot.process.reset();
        std::vector<std::string> next;
        if (code == 128 + SIGKILL && !slot.crashes.empty()) {
            const std::string& crash = slot.crashes.front();
            ++ledger_.crashes[crash.substr(0, crash.find(':'))];
            ++(is_server(slot) ? ledger_.server_crashes : ledger_.worker_crashes);
            next.assign(slot.crashes.begin() + 1, slot.crashes.end());
        } else {
            violations_.push_back(slot.name + " ended by itself with exit code " + std::to_string(code));
        }
        const double delay = slot.crash_delay;
        kill(slot, delay);
        slot.crashes = std::move(next);
        if (is_server(slot)) ++server_deaths_;
    }
    if (slot.continue_at && now >= *slot.continue_at) go_on(slot);
    if (slot.disk_free_at && now >= *slot.disk_free_at) {
        slot.disk_free_at.reset();
        set_disk(slot, false);
    }
    if (!slot.process && now >= slot.start_at) spawn(slot);
    if (is_server(slot) && slot.process && !server_open_ && fs::exists(path("ports"))) {
        server_open_ = true;
        if (slot.restarted) {
            ledger_.server_starts.push_back(seconds_since(server_spawned_));
            recovering_since_ = Clock::now();
        }
    }
}

void Farm::poll() {
    if (log_free_at_ && Clock::now() >= *log_free_at_) log_free_at_.reset(), log_blocked_since_.reset();
    if (!log_free_at_) read_log();
    poll(server_);
    for (Slot& worker : workers_) poll(worker);
}

void Farm::heal() {
    go_on(server_);
    log_free_at_.reset(), log_blocked_since_.reset();
    for (Slot& worker : workers_) {
        go_on(worker);
        if (std::exchange(worker.disk_free_at, std::nullopt)) set_disk(worker, false);
    }
}

bool Farm::healed() const {
    const auto runs = [](const Slot& slot) { return slot.process && !slot.continue_at && !slot.disk_free_at; };
    return runs(server_) && server_open_ && !log_free_at_ && std::all_of(workers_.begin(), workers_.end(), runs);
}

std::optional<nlohmann::json> Farm::status() {
    if (!server_answers()) return std::nullopt;
    const auto body = http_get(status_port_, "/api/v1/status");
    if (!body) return std::nullopt;
    auto json = nlohmann::json::parse(*body, nullptr, false);
    if (json.is_discarded()) return std::nullopt;
    return json;
}

void Farm::progress_seen() {
    if (recovering_since_) ledger_.recoveries.push_back(seconds_since(*recovering_since_));
    recovering_since_.reset();
}

bool Farm::is_alive(int64_t process_id) const {
    return std::any_of(workers_.begin(), workers_.end(),
                       [&](const Slot& worker) { return worker.process && int64_t(worker.process->pid()) == process_id; });
}

bool Farm::stop_cleanly(double patience_seconds) {
    heal();
    bool clean = true;
    const auto stop_one = [&](Slot& slot) {
        if (!slot.process) return;
        slot.process->signal(SIGTERM);
        if (!testing::wait_until(patience_seconds, [&] { return slot.process->ended(); })) {
            violations_.push_back(slot.name + " did not stop within " + std::to_string(int(patience_seconds)) + " s of SIGTERM");
            clean = false;
            return;
        }
        const int code = slot.process->wait();
        slot.process.reset();
        if (code == 0 || (code == 128 + SIGKILL && !slot.crashes.empty())) return;
        violations_.push_back(slot.name + " ended with exit code " + std::to_string(code) + " after SIGTERM");
        clean = false;
    };
    for (Slot& worker : workers_) stop_one(worker);
    stop_one(server_);
    return clean;
}

}  // namespace lightloom::chaos
