#include "server/store/segment_log.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <utility>

#include "common/core/crash_point.h"
#include "server/store/crc32c.h"

namespace lightloom {
namespace {

constexpr uint32_t kMagic = 0x4753'4c4c;  // "LLSG"

struct RecordHeader {
    uint32_t magic = kMagic, header_sum = 0;
    uint64_t number = 0, length = 0;
    uint32_t payload_sum = 0, segment = 0;

    std::string_view bytes() const { return {reinterpret_cast<const char*>(this), sizeof *this}; }
    uint32_t sum() const { return crc32c(bytes().substr(8)); }
    bool is_valid(uint32_t of_segment) const { return magic == kMagic && header_sum == sum() && segment == of_segment; }
};
static_assert(sizeof(RecordHeader) == SegmentLog::kHeaderBytes, "the header has no padding");

/// Reads exactly `size` bytes; false with errno set if that fails, with errno 0 if the file ends before.
bool read_exactly(int file, void* to, uint64_t size, uint64_t offset) {
    char* at = static_cast<char*>(to);
    while (size > 0) {
        const ssize_t got = ::pread(file, at, std::min<uint64_t>(size, 1u << 30), off_t(offset));
        if (got < 0 && errno == EINTR) continue;
        if (got == 0) errno = 0;
        if (got <= 0) return false;
        at += got;
        size -= uint64_t(got);
        offset += uint64_t(got);
    }
    return true;
}

/// Whether a payload of `size` bytes at `offset` has the checksum.
bool has_sum(int file, uint64_t size, uint64_t offset, uint32_t expected) {
    std::string buffer(size_t(std::min<uint64_t>(size, 1u << 20)), '\0');
    uint32_t sum = 0;
    while (size > 0) {
        const uint64_t part = std::min<uint64_t>(size, buffer.size());
        if (!read_exactly(file, buffer.data(), part, offset)) return false;
        sum = crc32c(std::string_view(buffer).substr(0, size_t(part)), sum);
        size -= part;
        offset += part;
    }
    return sum == expected;
}

/// The number of a segment by the name of its file, or 0.
uint32_t number_of(const std::filesystem::path& file) {
    const std::string stem = file.stem().string();
    uint32_t number = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    return file.extension() == ".log" && error == std::errc() && end == stem.data() + stem.size() ? number : 0;
}

}  // namespace

SegmentLog::SegmentLog(SegmentLog&& other) noexcept
    : directory_(std::move(other.directory_)),
      segment_bytes_(other.segment_bytes_),
      files_(other.files_),
      file_(std::exchange(other.file_, -1)),
      current_(other.current_),
      size_(other.size_),
      next_(other.next_),
      records_(other.records_),
      dirty_(other.dirty_),
      broken_(std::move(other.broken_)) {}

SegmentLog::~SegmentLog() { close(); }

void SegmentLog::close() {
    if (file_ >= 0) ::close(file_);
    file_ = -1;
    current_ = 0;
    size_ = 0;
}

std::filesystem::path SegmentLog::path(uint32_t segment) const {
    char name[24];
    std::snprintf(name, sizeof name, "%06u.log", segment);
    return directory_ / name;
}

Result<SegmentLog> SegmentLog::open(const std::filesystem::path& directory, const PayloadPlace& last_known, uint64_t segment_bytes,
                                    StoreFiles& files) {
    SegmentLog log(directory, segment_bytes, files);
    const auto found = log.segments();
    if (!found.ok()) return found.status();
    const uint32_t last = found->empty() ? 0 : found->back();
    log.next_ = std::max(last, last_known.segment) + 1;
    const uint64_t known_end = last == last_known.segment ? last_known.offset + kHeaderBytes + last_known.length : 0;
    if (last > 0 && last >= last_known.segment) LL_RETURN_IF_ERROR(log.open_last(last, known_end));
    return log;
}

Status SegmentLog::open_last(uint32_t segment, uint64_t known_end) {
    const std::filesystem::path name = path(segment);
    file_ = ::open(name.c_str(), O_RDWR | O_CLOEXEC);
    if (file_ < 0) return file_error(name, "cannot be opened", errno);
    current_ = segment;
    struct stat info {};
    if (::fstat(file_, &info) != 0) return file_error(name, "cannot be read", errno);
    const uint64_t size = uint64_t(info.st_size);
    for (RecordHeader header; size - size_ >= kHeaderBytes; size_ += kHeaderBytes + header.length) {
        if (!read_exactly(file_, &header, kHeaderBytes, size_) || !header.is_valid(segment)) break;
        const uint64_t room = size - size_ - kHeaderBytes;
        if (header.length > room || !has_sum(file_, header.length, size_ + kHeaderBytes, header.payload_sum)) break;
    }
    if (size_ < known_end) {  // It was damaged, not torn: records behind the damage can still be read.
        close();
        return {};
    }
    if (size_ == size) return {};
    if (::ftruncate(file_, off_t(size_)) != 0) return file_error(name, "its torn end cannot be cut", errno);
    dirty_ = true;
    return sync();
}

Status SegmentLog::break_with(Status why) {
    broken_ = std::move(why);
    return *broken_;
}

Status SegmentLog::begin_segment() {
    if (dirty_) LL_RETURN_IF_ERROR(sync());
    const std::filesystem::path name = path(next_);
    const int created = ::open(name.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (created < 0) return file_error(name, "cannot be created", errno);
    close();
    file_ = created;
    current_ = next_++;
    crash_point("server.segment-created");
    if (Status synced = files_->sync_directory(directory_); !synced.ok()) return break_with(std::move(synced));
    return {};
}

Result<PayloadPlace> SegmentLog::append(std::span<const std::string_view> parts) {
    if (broken_) return *broken_;
    RecordHeader header;
    header.number = ++records_;
    for (const std::string_view part : parts) {
        header.length += part.size();
        header.payload_sum = crc32c(part, header.payload_sum);
    }
    const uint64_t whole = kHeaderBytes + header.length;
    if (current_ == 0 || (size_ > 0 && size_ + whole > segment_bytes_)) LL_RETURN_IF_ERROR(begin_segment());
    header.segment = current_;
    header.header_sum = header.sum();

    std::vector<iovec> rest{{&header, sizeof header}};
    for (const std::string_view part : parts)
        if (!part.empty()) rest.push_back({const_cast<char*>(part.data()), part.size()});
    dirty_ = true;
    uint64_t at = size_;
    for (size_t first = 0; first < rest.size();) {
        ssize_t written = files_->write(file_, &rest[first], int(rest.size() - first), off_t(at));
        if (written < 0 && errno == EINTR) continue;
        if (written <= 0) {
            const int error = written < 0 ? errno : ENOSPC;
            LL_RETURN_IF_ERROR(rewind(mark()));
            return file_error(path(current_), "cannot be written", error);
        }
        at += uint64_t(written);
        for (; first < rest.size() && size_t(written) >= rest[first].iov_len; ++first) written -= ssize_t(rest[first].iov_len);
        if (written > 0) {
            rest[first].iov_base = static_cast<char*>(rest[first].iov_base) + written;
            rest[first].iov_len -= size_t(written);
        }
    }
    const PayloadPlace place{current_, size_, header.length};
    size_ = at;
    return place;
}

Status SegmentLog::sync() {
    if (broken_) return *broken_;
    if (!dirty_) return {};
    if (files_->sync(file_) != 0) return break_with(file_error(path(current_), "cannot be flushed to disk", errno));
    dirty_ = false;
    return {};
}

Status SegmentLog::rewind(const Mark& mark) {
    if (broken_) return *broken_;
    for (uint32_t segment = mark.next; segment < next_; ++segment)
        if (::unlink(path(segment).c_str()) != 0) return break_with(file_error(path(segment), "cannot be deleted", errno));
    next_ = mark.next;
    if (current_ != mark.current) {
        close();
        dirty_ = false;
        if (mark.current == 0) return {};
        file_ = ::open(path(mark.current).c_str(), O_RDWR | O_CLOEXEC);
        if (file_ < 0) return break_with(file_error(path(mark.current), "cannot be opened", errno));
        current_ = mark.current;
    }
    size_ = mark.size;
    if (file_ >= 0 && ::ftruncate(file_, off_t(size_)) != 0)
        return break_with(file_error(path(current_), "cannot be shortened", errno));
    return {};
}

Result<std::string> SegmentLog::read(const PayloadPlace& place) const {
    const std::filesystem::path name = path(place.segment);
    const auto damaged = [&](const char* what) {
        return data_loss(name.string() + ": the record at byte " + std::to_string(place.offset) + " " + what +
                         "; its unit has to be rendered again");
    };
    const int file = ::open(name.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return errno == ENOENT ? damaged("is gone with its file") : file_error(name, "cannot be opened", errno);
    RecordHeader header;
    errno = 0;
    const bool known =
        read_exactly(file, &header, kHeaderBytes, place.offset) && header.is_valid(place.segment) && header.length == place.length;
    std::string payload(known ? size_t(place.length) : 0, '\0');
    const bool whole = known && read_exactly(file, payload.data(), payload.size(), place.offset + kHeaderBytes);
    const int error = errno;
    ::close(file);
    if (!whole && error != 0) return file_error(name, "cannot be read", error);
    if (!whole || crc32c(payload) != header.payload_sum) return damaged("is damaged");
    return payload;
}

Result<std::vector<uint32_t>> SegmentLog::segments() const {
    std::vector<uint32_t> found;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(directory_, error), end; !error && entry != end; entry.increment(error))
        if (const uint32_t number = number_of(entry->path()); number > 0) found.push_back(number);
    if (error) return file_error(directory_, "cannot be listed", error.value());
    std::sort(found.begin(), found.end());
    return found;
}

Status SegmentLog::remove(uint32_t segment) {
    if (segment == current_) {
        close();
        dirty_ = false;
    }
    if (::unlink(path(segment).c_str()) != 0 && errno != ENOENT) return file_error(path(segment), "cannot be deleted", errno);
    return {};
}

}  // namespace lightloom
