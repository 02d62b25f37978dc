#pragma once
// Collection: what the data directory keeps that nobody needs any more goes by age, and by size. Tables have a limit of their own
// (table_cache.h).

#include <cstdint>
#include <filesystem>
#include <functional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "common/core/digest.h"
#include "common/work/asset.h"

namespace lightloom {

struct CollectionRules {
    double keep_days = 0;     ///< Jobs and scene files that were not used for longer go. 0: age decides nothing.
    uint64_t disk_limit = 0;  ///< Bytes of jobs and scene files; above it the ones that were used longest ago go. 0: none.
};

/// What must stay, whatever the rules say.
struct InUse {
    std::set<std::string> jobs;  ///< Ids.
    std::set<Digest> assets;     ///< Scene files, their lists, and tables.
};

/// Something that can go.
struct StoredItem {
    enum class Kind { kJob, kAsset, kLeftover };  ///< A leftover is what a killed process had not finished.
    Kind kind = Kind::kJob;
    std::filesystem::path path;
    std::string name;  ///< Id of a job, digest of an asset.
    uint64_t bytes = 0;
    double age_seconds = 0;  ///< Since its last use.
    bool in_use = false;
};

/// What was used within this time is never collected: it may be about to be used by a job that is being submitted.
inline constexpr double kCollectionGraceSeconds = 3600;

/// Everything in the data directory that a rule may be about. What vanishes meanwhile is left out.
std::vector<StoredItem> stored_items(const std::filesystem::path& data, const InUse& in_use,
                                     std::filesystem::file_time_type now = std::filesystem::file_time_type::clock::now());
/// What goes of `items`, the oldest first: what is older than the rules allow, then as much as brings the rest below the limit.
/// Leftovers go after the time of grace.
std::vector<StoredItem> what_goes(std::vector<StoredItem> items, const CollectionRules& rules);

struct Collected {
    std::vector<std::string> jobs;  ///< Ids, whose directories are gone.
    size_t assets = 0, leftovers = 0;
    uint64_t bytes = 0;
};
/// Removes these. A job's directory goes at once for those who look at it, even if this process is killed meanwhile. An item that
/// cannot be removed is logged, and left out of the result.
Collected remove_items(const std::filesystem::path& data, const std::vector<StoredItem>& items);

/// Files that the scenes of these lists need, the lists included. A list that cannot be read needs itself alone.
std::set<Digest> files_of_scenes(const AssetStore& assets, const std::set<Digest>& roots);

/// Collects now and then, on a thread of its own. `in_use` is asked before each time; an end waits for the one that is under way.
class Collector {
  public:
    Collector(std::filesystem::path data, const CollectionRules& rules, std::function<InUse()> in_use);

  private:
    std::jthread thread_;
};

}  // namespace lightloom
