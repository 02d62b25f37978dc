#include "server/table_cache.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "common/cli/log_line.h"
#include "common/core/atomic_file.h"
#include "common/work/cache_trim.h"
#include "common/work/job_fields.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::string_view kMagic = "lightloom-table-cache 1 ";
constexpr const char* kExtension = ".tables";
/// Part of the names of entries that write_file_atomically() has not completed.
constexpr const char* kTemporary = ".tables.tmp-";

/// JSON has finite numbers only, and a null in their place would count as damage.
double finite(double value) { return std::isfinite(value) ? value : 0; }

Json entry_json(const TablesInfo& info) {
    return {{"light_subspaces", info.light_subspaces},   {"eye_subspaces", info.eye_subspaces},
            {"training_samples", info.training_samples}, {"capped_by_time_limit", info.capped_by_time_limit},
            {"trace_seconds", info.trace_seconds},       {"classifier_seconds", info.classifier_seconds},
            {"energy_seconds", info.energy_seconds},     {"gamma_seconds", info.gamma_seconds},
            {"uniform_loss", finite(info.uniform_loss)}, {"loss", finite(info.loss)},
            {"prior_strength", info.prior_strength},     {"note", info.note}};
}

/// False unless the field is there and of the type.
template <class T>
bool take(const Json& json, const char* name, T* out) {
    const auto item = json.find(name);
    if (item == json.end()) return false;
    if constexpr (std::is_same_v<T, bool>) {
        if (!item->is_boolean()) return false;
    } else if constexpr (std::is_integral_v<T>) {
        if (!item->is_number_unsigned() || item->template get<uint64_t>() > std::numeric_limits<T>::max()) return false;
    } else if constexpr (std::is_floating_point_v<T>) {
        if (!item->is_number()) return false;
    } else {
        if (!item->is_string()) return false;
    }
    *out = item->template get<T>();
    return true;
}

/// Reads every field with a check, because a correct digest only shows that the entry is as it was written.
Result<TablesInfo> info_from(std::string_view text) {
    const Json json = Json::parse(text, nullptr, false);
    TablesInfo info;
    const bool complete =
        json.is_object() && take(json, "light_subspaces", &info.light_subspaces) &&
        take(json, "eye_subspaces", &info.eye_subspaces) && take(json, "training_samples", &info.training_samples) &&
        take(json, "capped_by_time_limit", &info.capped_by_time_limit) && take(json, "trace_seconds", &info.trace_seconds) &&
        take(json, "classifier_seconds", &info.classifier_seconds) && take(json, "energy_seconds", &info.energy_seconds) &&
        take(json, "gamma_seconds", &info.gamma_seconds) && take(json, "uniform_loss", &info.uniform_loss) &&
        take(json, "loss", &info.loss) && take(json, "prior_strength", &info.prior_strength) && take(json, "note", &info.note);
    if (!complete) return data_loss("the entry's report is malformed");
    info.from_cache = true;
    return info;
}

struct Parts {
    std::string_view key_line, info_line, tables;
};

/// Splits an entry: magic and digest of the rest, then a line with the key, one with the report, and the tables.
Result<Parts> split(std::string_view bytes) {
    const Status damaged = data_loss("the entry is damaged");
    const size_t digest_end = kMagic.size() + 64;
    if (!bytes.starts_with(kMagic) || bytes.size() <= digest_end || bytes[digest_end] != '\n') return damaged;
    const std::string_view rest = bytes.substr(digest_end + 1);
    if (sha256(rest).hex() != bytes.substr(kMagic.size(), 64)) return damaged;
    const size_t first = rest.find('\n');
    const size_t second = first == std::string_view::npos ? first : rest.find('\n', first + 1);
    if (second == std::string_view::npos) return damaged;
    return Parts{rest.substr(0, first), rest.substr(first + 1, second - first - 1), rest.substr(second + 1)};
}

}  // namespace

Digest table_key(const BuildIdentity& identity, const JobSpec& spec) {
    std::string text = "lightloom-tables-key 2\n";
    append_text(text, "build", identity.build_id);
    append_text(text, "profile", identity.math_profile);
    append_text(text, "golden", identity.golden_digest.hex());  // builds of the same sources may compute differently
    return sha256(text + fields_text<job_role::kTables>(spec));
}

Result<std::string> tables_of_file(std::string bytes) {
    if (!bytes.starts_with(kMagic)) return bytes;
    const auto parts = split(bytes);
    if (!parts.ok()) return parts.status();
    return std::string(parts->tables);
}

TableCache::TableCache(fs::path directory, uint64_t max_bytes) : directory_(std::move(directory)), max_bytes_(max_bytes) {
    std::error_code ignored;  // the first write reports a directory that cannot be made
    if (!directory_.empty()) fs::create_directories(directory_, ignored);
}

fs::path TableCache::path_of(const Digest& key) const { return directory_ / (key.hex() + kExtension); }

std::optional<TableCache::Entry> TableCache::find(const Digest& key, std::span<const TablePart* const> known) const {
    if (directory_.empty()) return std::nullopt;
    const fs::path path = path_of(key);
    auto bytes = read_file(path.string());
    if (!bytes.ok()) return std::nullopt;
    const auto parts = split(*bytes);
    Status status = parts.status();
    if (parts.ok() && parts->key_line != key.hex()) status = data_loss("the entry is that of another job");
    if (status.ok()) {
        const auto tables = parse_tables(parts->tables, known);
        status = tables.status();
        if (tables.ok() && !tables->consist_of(known)) status = data_loss("a part of the tables is missing");
    }
    Result<TablesInfo> info = status.ok() ? info_from(parts->info_line) : status;
    status = info.status();
    std::error_code ignored;
    if (!status.ok()) {
        log_warn("cached tables {} cannot be used and are made again: {}", path.string(), status.message());
        fs::remove(path, ignored);
        return std::nullopt;
    }
    fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);
    Entry entry{std::string(parts->tables), *std::move(info)};
    entry.info.cache_key = key;
    entry.info.asset = {sha256(entry.bytes), entry.bytes.size()};
    return entry;
}

void TableCache::store(const Digest& key, std::string_view bytes, const TablesInfo& info) const {
    if (directory_.empty()) return;
    // A note may quote bytes that are not UTF-8, for which dump() would throw by default.
    std::string rest = key.hex() + "\n" + entry_json(info).dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    rest += bytes;
    std::string file = std::string(kMagic) + sha256(rest).hex() + "\n" + rest;
    if (file.size() > max_bytes_) return;
    if (const Status s = write_file_atomically(path_of(key).string(), file); !s.ok()) {
        log_warn("the tables could not be cached: {}", s.message());
        return;
    }
    trim(key);
}

void TableCache::trim(const Digest& newest) const {
    trim_cache({directory_}, max_bytes_, path_of(newest), [](const fs::path& path) {
        if (path.extension() == kExtension) return CacheFile::kEntry;
        const bool temporary = path.filename().string().find(kTemporary) != std::string::npos;
        return temporary ? CacheFile::kUnfinished : CacheFile::kForeign;
    });
}

}  // namespace lightloom
