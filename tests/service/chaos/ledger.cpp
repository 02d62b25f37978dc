#include "tests/service/chaos/ledger.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"

namespace lightloom::chaos {
namespace {

using Json = nlohmann::ordered_json;

/// The value below or at which the share `q` of all lies.
double quantile(std::vector<double> values, double q) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[size_t(std::ceil(q * double(values.size()))) - 1];
}

/// Calls `field` with the name and the member of every number that a file keeps.
template <class Ledger_, class Field>
void for_each_field(Ledger_& ledger, const Field& field) {
    field("phases", ledger.phases);
    field("images", ledger.images);
    field("worker_kills", ledger.worker_kills);
    field("worker_stops", ledger.worker_stops);
    field("server_kills", ledger.server_kills);
    field("server_stops", ledger.server_stops);
    field("full_disks", ledger.full_disks);
    field("damaged_files", ledger.damaged_files);
    field("worker_crashes", ledger.worker_crashes);
    field("server_crashes", ledger.server_crashes);
    field("ended_early", ledger.ended_early);
    field("acknowledged", ledger.acknowledged);
    field("asked_again", ledger.asked_again);
    field("farms", ledger.farms);
    field("resubmissions", ledger.resubmissions);
    field("leftovers", ledger.leftovers);
    field("next_phase", ledger.next_phase);
    field("crashes", ledger.crashes);
    field("limits", ledger.limits);
    field("digests", ledger.digests);
    field("server_starts", ledger.server_starts);
    field("recoveries", ledger.recoveries);
    field("longest_standstill", ledger.longest_standstill);
    field("standstill_phase", ledger.standstill_phase);
    field("violations", ledger.violations);
}

std::string row(const std::string& name, const std::string& value) {
    std::string line = "  ";
    line.append(name).append(std::max<size_t>(1, 34 - std::min<size_t>(33, name.size())), ' ').append(value).append("\n");
    return line;
}

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.2f", value);
    return text;
}

std::string spread(const std::vector<double>& values) {
    if (values.empty()) return "-";
    return number(quantile(values, 0.5)) + " s median, " + number(quantile(values, 0.99)) + " s p99, " +
           number(quantile(values, 1)) + " s worst, of " + std::to_string(values.size());
}

}  // namespace

size_t Ledger::labels_hit(uint64_t times) const {
    return size_t(std::count_if(crashes.begin(), crashes.end(), [&](const auto& label) { return label.second >= times; }));
}

std::string Ledger::text() const {
    std::string text = "ledger\n";
    text += row("phases, images checked",
                std::to_string(phases) + ", " + std::to_string(images) + "; ended early " + std::to_string(ended_early));
    text += row("worker kills, stops", std::to_string(worker_kills) + ", " + std::to_string(worker_stops));
    text += row("coordinator kills, stops", std::to_string(server_kills) + ", " + std::to_string(server_stops));
    text += row("full disks, damaged files", std::to_string(full_disks) + ", " + std::to_string(damaged_files));
    text += row("deaths at crash points", std::to_string(worker_crashes) + " workers, " + std::to_string(server_crashes) +
                                              " coordinators; of " + std::to_string(std::size(kCrashLabels)) + " labels " +
                                              std::to_string(labels_hit(1)) + " once, " + std::to_string(labels_hit(2)) +
                                              " twice or more");
    std::string missing;
    for (const std::string_view label : kCrashLabels)
        if (!crashes.contains(std::string(label))) missing.append(missing.empty() ? "" : " ").append(label);
    if (!missing.empty()) text += row("labels not reached yet", missing);
    for (const auto& [job, found] : digests) {
        uint64_t count = 0;
        for (const auto& [digest, times] : found) count += times;
        std::string what = std::to_string(count) + ", distinct SHA-256: " + std::to_string(found.size());
        if (found.size() == 1) what.append(" (").append(found.begin()->first, 0, 12).append(")");
        text += row("images of " + job, what);
    }
    for (const auto& [farm, times] : farms) text += row(farm, std::to_string(times) + " images");
    text += row("acknowledged, asked for again", std::to_string(acknowledged) + ", " + std::to_string(asked_again));
    text += row("submitted again", std::to_string(resubmissions));
    text += row("scratch directories left behind", std::to_string(leftovers));
    for (const auto& [limit, times] : limits) text += row("known limit met: " + limit, std::to_string(times));
    text += row("coordinator: start to open port", spread(server_starts));
    text += row("open port to next progress", spread(recoveries));
    text +=
        row("longest standstill", number(longest_standstill) + " s" + (standstill_phase.empty() ? "" : ", " + standstill_phase));
    text += row("violations", std::to_string(violations.size()));
    for (const std::string& violation : violations) text += "    " + violation + "\n";
    return text;
}

Result<Ledger> Ledger::load(const std::string& path) {
    Ledger ledger;
    if (!std::filesystem::exists(path)) return ledger;
    const auto bytes = read_file(path);
    if (!bytes.ok()) return bytes.status();
    const Json json = Json::parse(*bytes, nullptr, false);
    const Status damaged = invalid_argument(path + ": is no ledger of the kill loop; name another file");
    if (!json.is_object()) return damaged;
    try {
        for_each_field(ledger, [&](const char* name, auto& member) { json.at(name).get_to(member); });
    } catch (const Json::exception&) {
        return damaged;
    }
    return ledger;
}

Status Ledger::save(const std::string& path) const {
    Json json;
    for_each_field(*this, [&](const char* name, const auto& member) { json[name] = member; });
    return write_file_atomically(path, json.dump(1) + "\n");
}

}  // namespace lightloom::chaos
