#include "client/output_files.h"

#include <unistd.h>

#include <set>

#include "common/core/atomic_file.h"

namespace lightloom::client {

Status check_output_files(std::span<const std::filesystem::path> inputs, std::span<const std::string> outputs) {
    namespace fs = std::filesystem;
    std::error_code ignored;
    const auto place_of = [&](const fs::path& path) { return fs::weakly_canonical(fs::absolute(path, ignored), ignored); };
    std::set<fs::path> read, written;
    for (const fs::path& input : inputs) read.insert(place_of(input));
    for (const std::string& path : outputs) {
        if (path.empty()) continue;
        const auto status = fs::status(path, ignored);
        if (!fs::exists(status) && fs::is_symlink(fs::symlink_status(path, ignored)))
            return invalid_argument(path +
                                    ": is a link to nothing, which may be another output; remove it or give another file name");
        if (fs::is_directory(status)) return invalid_argument(path + ": is a directory; give a file name");
        if (fs::is_other(status)) continue;  // a pipe or a device
        const fs::path target = place_of(path);
        if (read.contains(target)) return invalid_argument(path + ": is an input, which would be lost; give another file name");
        if (!written.insert(target).second) return invalid_argument(path + ": is another output, too; give another file name");
        // Where the bytes will go: what a link points to is replaced, not the link.
        const std::string probe = (fs::exists(status) ? target.string() : path) + ".probe-" + std::to_string(::getpid());
        if (const Status s = write_file_atomically(probe, {}); !s.ok())
            return {s.code(), path + s.message().substr(probe.size())};  // whose message begins with the name
        fs::remove(probe, ignored);
    }
    return {};
}

}  // namespace lightloom::client
