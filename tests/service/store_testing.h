#pragma once
// Files that fail on command, and jobs that say which they are.

#include <atomic>
#include <cerrno>
#include <string>

#include "server/store/store.h"

namespace lightloom::testing {

/// Fails the chosen write or flush, counted from 1, or all writes of a full disk; all others work.
class FailingFiles : public StoreFiles {
  public:
    ssize_t write(int file, const iovec* parts, int count, off_t offset) override {
        if (full) {
            errno = ENOSPC;
            return -1;
        }
        if (++writes != failing_write) return StoreFiles::write(file, parts, count, offset);
        // A full disk takes some bytes first.
        iovec some = parts[0];
        some.iov_len /= 2;
        if (!torn && some.iov_len > 0) {
            torn = true;
            --writes;
            return StoreFiles::write(file, &some, 1, offset);
        }
        errno = ENOSPC;
        return -1;
    }
    int sync(int file) override {
        if (++syncs != failing_sync) return StoreFiles::sync(file);
        errno = EIO;
        return -1;
    }
    std::atomic<int> writes{0}, syncs{0}, failing_write{0}, failing_sync{0};
    std::atomic<bool> full{false};
    bool torn = false;
};

inline NewJob new_job(const std::string& id) {
    return {.id = id,
            .request_id = std::string("request of ").append(id),
            .created_at = "2001-02-03T04:05:06Z",
            .submitted = std::string("spec\0of ", 8).append(id),
            .label = "label",
            .scene = "scene.pbrt"};
}

inline UnitKey render_unit(uint32_t group, uint32_t tile = 0) { return {group, tile, UnitKind::kRender, 0}; }

/// Bytes that differ from unit to unit.
inline std::string payload_of(const UnitKey& unit, size_t size) {
    std::string bytes = unit_name(unit).append(std::to_string(int(unit.kind))).append(std::to_string(unit.round));
    for (size_t i = bytes.size(); i < size; ++i) bytes.push_back(char(bytes[i % 7] + char(i)));
    bytes.resize(size);
    return bytes;
}

/// Puts the unit's result, with a payload of `size` bytes.
inline Status put(JobStore& store, const std::string& id, const UnitKey& unit, size_t size, uint32_t worker = 0) {
    const std::string payload = payload_of(unit, size);
    const std::string who = std::string("worker ").append(std::to_string(worker));
    return store.put_result(id, {.unit = unit,
                                 .digest = sha256(payload),
                                 .worker = worker,
                                 .who = who,
                                 .seconds = 1.5,
                                 .header = "header",
                                 .payload = payload});
}

}  // namespace lightloom::testing
