#include "server/collection.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <optional>

#include "common/cli/log_line.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

constexpr double kDay = 86400;
constexpr auto kBetweenCollections = std::chrono::minutes(1);

double seconds_between(fs::file_time_type a, fs::file_time_type b) { return std::chrono::duration<double>(b - a).count(); }

/// Size and last change of a file, or of all that is in a directory. Nothing if it vanishes meanwhile.
struct Extent {
    uint64_t bytes = 0;
    fs::file_time_type changed{};
};
std::optional<Extent> extent_of(const fs::path& path) {
    std::error_code error;
    Extent extent{0, fs::last_write_time(path, error)};
    if (error) return std::nullopt;
    if (!fs::is_directory(path, error)) {
        extent.bytes = fs::file_size(path, error);
        return error ? std::nullopt : std::optional(extent);
    }
    for (fs::recursive_directory_iterator item(path, error), end; !error && item != end; item.increment(error)) {
        std::error_code gone;
        const auto changed = item->last_write_time(gone);
        if (!gone) extent.changed = std::max(extent.changed, changed);
        const uint64_t size = item->is_regular_file(gone) ? item->file_size(gone) : 0;
        if (!gone) extent.bytes += size;
    }
    return extent;
}

/// Calls take(path) with everything in a directory, which need not exist.
template <class Take>
void each_in(const fs::path& directory, const Take& take) {
    std::error_code error;
    for (fs::directory_iterator item(directory, error), end; !error && item != end; item.increment(error)) take(item->path());
}

bool older(const StoredItem& a, const StoredItem& b) { return a.age_seconds > b.age_seconds; }

}  // namespace

std::vector<StoredItem> stored_items(const fs::path& data, const InUse& in_use, fs::file_time_type now) {
    std::vector<StoredItem> items;
    const auto add = [&](StoredItem::Kind kind, const fs::path& path, bool used) {
        const auto extent = extent_of(path);
        if (!extent) return;
        items.push_back({kind, path, path.filename().string(), extent->bytes, seconds_between(extent->changed, now), used});
    };
    each_in(data / "jobs",
            [&](const fs::path& path) { add(StoredItem::Kind::kJob, path, in_use.jobs.contains(path.filename().string())); });
    each_in(data / "assets", [&](const fs::path& directory) {
        const bool incoming = directory.filename() == "incoming";
        each_in(directory, [&](const fs::path& path) {
            if (incoming) return add(StoredItem::Kind::kLeftover, path, false);
            // What is not named by a digest is none of ours.
            const auto digest = Digest::from_hex(path.filename().string());
            if (digest.ok()) add(StoredItem::Kind::kAsset, path, in_use.assets.contains(*digest));
        });
    });
    each_in(data / "scratch", [&](const fs::path& path) { add(StoredItem::Kind::kLeftover, path, false); });
    return items;
}

std::vector<StoredItem> what_goes(std::vector<StoredItem> items, const CollectionRules& rules) {
    std::sort(items.begin(), items.end(), older);
    uint64_t kept_bytes = 0;
    std::vector<StoredItem> goes, stays;
    for (StoredItem& item : items) {
        const bool leftover = item.kind == StoredItem::Kind::kLeftover;
        const bool young = item.age_seconds < kCollectionGraceSeconds;
        const bool old = leftover || (rules.keep_days > 0 && item.age_seconds > rules.keep_days * kDay);
        if (!leftover) kept_bytes += item.bytes;
        if (item.in_use || young) continue;
        (old ? goes : stays).push_back(std::move(item));
    }
    for (const StoredItem& item : goes)
        if (item.kind != StoredItem::Kind::kLeftover) kept_bytes -= item.bytes;
    for (StoredItem& item : stays) {
        if (rules.disk_limit == 0 || kept_bytes <= rules.disk_limit) break;
        kept_bytes -= item.bytes;
        goes.push_back(std::move(item));
    }
    std::stable_sort(goes.begin(), goes.end(), older);
    return goes;
}

Collected remove_items(const fs::path& data, const std::vector<StoredItem>& items) {
    Collected collected;
    for (const StoredItem& item : items) {
        std::error_code error;
        fs::path path = item.path;
        if (item.kind == StoredItem::Kind::kJob) {
            // Half a job must never be seen: it moves away first. What is left there goes as a leftover.
            path = data / "scratch" / ("gone-" + item.name);
            fs::create_directories(path.parent_path(), error);
            fs::remove_all(path, error);
            fs::rename(item.path, path, error);
        }
        if (!error) fs::remove_all(path, error);
        if (error) {
            log_warn("{} cannot be removed: {}", item.path.string(), error.message());
            continue;
        }
        collected.bytes += item.bytes;
        switch (item.kind) {
            case StoredItem::Kind::kJob: collected.jobs.push_back(item.name); break;
            case StoredItem::Kind::kAsset: ++collected.assets; break;
            case StoredItem::Kind::kLeftover: ++collected.leftovers; break;
        }
    }
    return collected;
}

std::set<Digest> files_of_scenes(const AssetStore& assets, const std::set<Digest>& roots) {
    std::set<Digest> files = roots;
    for (const Digest& root : roots) {
        const auto text = assets.read(root);
        const auto manifest = text.ok() ? AssetManifest::parse(*text) : text.status();
        if (!manifest.ok()) continue;
        for (const AssetEntry& entry : manifest->entries) files.insert(entry.digest);
    }
    return files;
}

Collector::Collector(fs::path data, const CollectionRules& rules, std::function<InUse()> in_use)
    : thread_([data = std::move(data), rules, in_use = std::move(in_use)](std::stop_token stop) {
          std::mutex mutex;
          std::condition_variable_any wake;
          std::unique_lock lock(mutex);
          while (!stop.stop_requested()) {
              const Collected collected = remove_items(data, what_goes(stored_items(data, in_use()), rules));
              if (collected.bytes > 0)
                  log_info("collected {} job(s), {} scene file(s) and {} leftover(s), {} MiB", collected.jobs.size(),
                           collected.assets, collected.leftovers, collected.bytes >> 20);
              wake.wait_for(lock, stop, kBetweenCollections, [] { return false; });
          }
      }) {}

}  // namespace lightloom
