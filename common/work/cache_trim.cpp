#include "common/work/cache_trim.h"

#include <algorithm>
#include <chrono>
#include <system_error>

namespace lightloom {
namespace fs = std::filesystem;

void trim_cache(const std::vector<fs::path>& directories, uint64_t max_bytes, const fs::path& newest,
                const std::function<CacheFile(const fs::path&)>& kind_of) {
    struct File {
        fs::file_time_type used;
        fs::path path;
        uint64_t size;
    };
    std::vector<File> entries, abandoned;
    uint64_t total = 0;
    const auto hour_ago = fs::file_time_type::clock::now() - std::chrono::hours(1);
    std::error_code error;  // another process may remove a file meanwhile
    for (const fs::path& directory : directories) {
        for (fs::directory_iterator item(directory, error), end; item != end; item.increment(error)) {
            const CacheFile kind = item->is_regular_file(error) ? kind_of(item->path()) : CacheFile::kForeign;
            if (kind == CacheFile::kForeign) continue;
            File file{item->last_write_time(error), item->path(), 0};
            if (error) continue;
            file.size = item->file_size(error);
            if (error) continue;
            if (kind == CacheFile::kEntry) {
                total += file.size;
                if (file.path != newest) entries.push_back(std::move(file));
            } else if (file.used < hour_ago) {
                abandoned.push_back(std::move(file));
            }
        }
    }
    for (const File& file : abandoned) fs::remove(file.path, error);
    std::sort(entries.begin(), entries.end(), [](const File& a, const File& b) { return a.used < b.used; });
    for (const File& file : entries) {
        if (total <= max_bytes) break;
        fs::remove(file.path, error);
        total -= file.size;
    }
}

}  // namespace lightloom
