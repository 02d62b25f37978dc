#pragma once
// SegmentLog: append-only files of payloads, segments/NNNNNN.log. A record is a header of 32 bytes and its payload:
//
//   0  magic "LLSG"    8  record number    16  length      24  CRC-32C of the payload
//   4  CRC-32C of the header's bytes from 8 on             28  number of the segment
//
// What is not flushed may be torn by a power failure; the end of the last segment behind its last whole record is cut when the
// log is opened, unless it is known to have held more. Nothing is ever changed in place, and room comes back when a whole segment
// is removed.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"
#include "server/store/files.h"

namespace lightloom {

/// Where a payload lies.
struct PayloadPlace {
    uint32_t segment = 0;  ///< From 1 on.
    uint64_t offset = 0;   ///< Of the record's header, in bytes.
    uint64_t length = 0;   ///< Of the payload, in bytes.
    friend bool operator==(const PayloadPlace&, const PayloadPlace&) = default;
};

/// For one thread, except read().
class SegmentLog {
  public:
    static constexpr uint64_t kSegmentBytes = uint64_t(64) << 20;
    static constexpr uint64_t kHeaderBytes = 32;

    /// `directory` exists. A record that would make a segment larger than `segment_bytes` begins another one. `last_known` is the
    /// last record that somebody refers to (segment 0: nobody does). New records lie behind it, also if it was lost or damaged, so
    /// that no reference ever leads to another record.
    static Result<SegmentLog> open(const std::filesystem::path& directory, const PayloadPlace& last_known = {},
                                   uint64_t segment_bytes = kSegmentBytes, StoreFiles& files = StoreFiles::system());
    SegmentLog(SegmentLog&& other) noexcept;
    SegmentLog& operator=(SegmentLog&&) = delete;
    ~SegmentLog();

    /// Appends one record, whose payload is all of `parts` (some hundred at most) in a row. It is on disk only after sync(). After
    /// an error the log is as before: kResourceExhausted if there is no room.
    Result<PayloadPlace> append(std::span<const std::string_view> parts);
    /// Flushes what was appended.
    Status sync();
    /// A state of the log, to which rewind() goes back: what was appended since is gone.
    struct Mark {
        uint32_t current = 0, next = 1;
        uint64_t size = 0;
    };
    Mark mark() const { return {current_, next_, size_}; }
    Status rewind(const Mark& mark);

    /// The payload, whose checksums were verified. kDataLoss, naming the file, if it is damaged or gone. Any thread may call it, as
    /// long as nobody removes the segment.
    Result<std::string> read(const PayloadPlace& place) const;

    /// Numbers of all segments, in ascending order.
    Result<std::vector<uint32_t>> segments() const;
    /// Deletes a segment to which nothing refers any more.
    Status remove(uint32_t segment);

    /// Set once a flush or a way back failed: the kernel may have dropped pages that it reported as written, so that nobody knows
    /// what is on disk. The log refuses everything from then on, and the process should end.
    const std::optional<Status>& broken() const { return broken_; }

  private:
    SegmentLog(std::filesystem::path directory, uint64_t segment_bytes, StoreFiles& files)
        : directory_(std::move(directory)),
          segment_bytes_(segment_bytes),
          files_(&files) {}
    std::filesystem::path path(uint32_t segment) const;
    Status open_last(uint32_t segment, uint64_t known_end);
    Status begin_segment();
    Status break_with(Status why);
    void close();

    std::filesystem::path directory_;
    uint64_t segment_bytes_;
    StoreFiles* files_;
    int file_ = -1;         // the current segment
    uint32_t current_ = 0;  // its number; 0 for none
    uint64_t size_ = 0;     // its size in bytes
    uint32_t next_ = 1;     // number of the next segment
    uint64_t records_ = 0;  // appended since the log was opened
    bool dirty_ = false;    // whether something was appended since the last flush
    std::optional<Status> broken_;
};

}  // namespace lightloom
