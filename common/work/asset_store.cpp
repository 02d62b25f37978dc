#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "common/core/atomic_file.h"
#include "common/core/crash_point.h"
#include "common/work/asset.h"
#include "common/work/cache_trim.h"

namespace lightloom {
namespace fs = std::filesystem;
namespace {

Status io_error(const fs::path& path, int error) {
    const auto code = error == ENOENT                      ? StatusCode::kNotFound
                      : error == ENOSPC || error == EDQUOT ? StatusCode::kResourceExhausted
                                                           : StatusCode::kInternal;
    return {code, path.string() + ": " + std::strerror(error)};
}

Status write_all(int file, std::string_view bytes, const fs::path& path) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(file, bytes.data(), bytes.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io_error(path, errno);
        bytes.remove_prefix(size_t(n));
    }
    return {};
}

using Clock = std::chrono::steady_clock;

/// Closes a file when it goes.
struct OpenFile {
    explicit OpenFile(int number) : file(number) {}
    OpenFile(const OpenFile&) = delete;
    ~OpenFile() {
        if (file >= 0) ::close(file);
    }
    const int file;
};

/// Reads up to `size` bytes; fewer at the end of the file only.
Result<size_t> read_some(int file, char* buffer, size_t size, const fs::path& path) {
    size_t got = 0;
    while (got < size) {
        const ssize_t n = ::read(file, buffer + got, size - got);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io_error(path, errno);
        if (n == 0) break;
        got += size_t(n);
    }
    return got;
}

Status taken_over() { return {StatusCode::kAborted, "another upload took over, because nothing more had come for a while"}; }

/// Whether `path` still names the open file.
bool still_named(int file, const fs::path& path) {
    struct stat ours {
    }, named{};
    return ::fstat(file, &ours) == 0 && ::stat(path.c_str(), &named) == 0 && ours.st_ino == named.st_ino &&
           ours.st_dev == named.st_dev;
}

}  // namespace

/// What holds an upload's place. Its mutex is held while bytes are written or verified, which is no stall.
struct AssetStore::Lock {
    std::mutex mutex;
    int file = -1;  ///< Locked against other processes. Negative after another upload took over.
    Clock::time_point last = Clock::now();
};

Result<Digest> digest_file(const fs::path& path) {
    const OpenFile in(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (in.file < 0) return io_error(path, errno);
    Sha256 hash;
    std::vector<char> buffer(size_t(1) << 18);
    for (;;) {
        const auto n = read_some(in.file, buffer.data(), buffer.size(), path);
        if (!n.ok()) return n.status();
        hash.update(buffer.data(), *n);
        if (*n < buffer.size()) return hash.finish();
    }
}

AssetStore::AssetStore(fs::path directory, uint64_t max_asset_bytes, std::chrono::milliseconds stall)
    : directory_(std::move(directory)),
      max_asset_bytes_(max_asset_bytes),
      stall_(stall) {
    std::error_code ignored;  // the first upload tries again, and reports a directory that cannot be made
    fs::create_directories(directory_ / "incoming", ignored);
}

fs::path AssetStore::path_of(const Digest& digest) const {
    const std::string hex = digest.hex();
    return directory_ / hex.substr(0, 2) / hex;
}

fs::path AssetStore::incoming_path(const Digest& digest) const { return directory_ / "incoming" / digest.hex(); }

bool AssetStore::contains(const Digest& digest) const {
    std::error_code ignored;
    return fs::is_regular_file(path_of(digest), ignored);
}

uint64_t AssetStore::committed_size(const Digest& digest) const {
    std::error_code error;
    uint64_t size = fs::file_size(path_of(digest), error);
    if (error) size = fs::file_size(incoming_path(digest), error);
    return error ? 0 : size;
}

Result<std::string> AssetStore::read(const Digest& digest) const {
    auto bytes = read_file(path_of(digest).string());
    if (!bytes.ok()) return not_found("asset " + digest.hex() + " is not in the store");
    if (sha256(*bytes) == digest) return bytes;
    remove(digest);
    return data_loss("asset " + digest.hex() + " is damaged on disk; it was removed");
}

Status AssetStore::stream(const Digest& digest, uint64_t offset, const ChunkSink& sink) const {
    const fs::path path = path_of(digest);
    const OpenFile in(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (in.file < 0) return not_found("asset " + digest.hex() + " is not in the store");
    struct stat facts {};
    if (::fstat(in.file, &facts) != 0) return io_error(path, errno);
    const auto size = uint64_t(facts.st_size);
    if (offset > size) return {StatusCode::kOutOfRange, "the asset has " + std::to_string(size) + " bytes"};
    if (::lseek(in.file, off_t(offset), SEEK_SET) < 0) return io_error(path, errno);
    const bool whole = offset == 0;
    Sha256 hash;
    std::string buffer(std::min(kMaxChunkBytes, size - offset), '\0');
    while (offset < size) {
        const auto n = read_some(in.file, buffer.data(), std::min<uint64_t>(buffer.size(), size - offset), path);
        if (!n.ok()) return n.status();
        if (*n == 0) break;  // it was cut short meanwhile
        if (whole) hash.update(buffer.data(), *n);
        LL_RETURN_IF_ERROR(sink(offset, std::string_view(buffer.data(), *n)));
        offset += *n;
    }
    if (!whole || hash.finish() == digest) return {};
    remove(digest);
    return data_loss("asset " + digest.hex() + " is damaged on disk; it was removed");
}

Status AssetStore::put(const Digest& digest, std::string_view bytes) {
    if (contains(digest)) return {};
    auto upload = begin_upload(digest, bytes.size());
    if (!upload.ok()) return upload.status();
    LL_RETURN_IF_ERROR(upload->append(bytes.substr(upload->offset())));
    return upload->finish();
}

void AssetStore::remove(const Digest& digest) const {
    std::error_code ignored;
    fs::remove(path_of(digest), ignored);
}

void AssetStore::touch(const Digest& digest) const {
    std::error_code ignored;
    fs::last_write_time(path_of(digest), fs::file_time_type::clock::now(), ignored);
}

void AssetStore::trim(uint64_t max_bytes, const Digest& newest) const {
    const fs::path incoming = directory_ / "incoming";
    std::vector<fs::path> directories;
    std::error_code error;
    for (fs::directory_iterator item(directory_, error), end; item != end; item.increment(error))
        if (item->is_directory(error)) directories.push_back(item->path());
    trim_cache(directories, max_bytes, path_of(newest),
               [&](const fs::path& path) { return path.parent_path() == incoming ? CacheFile::kUnfinished : CacheFile::kEntry; });
}

size_t AssetStore::remove_all_that_begin_with(std::string_view prefix, const std::function<bool(const Digest&)>& needed) {
    size_t count = 0;
    std::error_code error;
    std::vector<fs::path> found;
    std::string first(prefix.size(), '\0');
    for (fs::recursive_directory_iterator item(directory_, error), end; !error && item != end; item.increment(error)) {
        if (item->is_directory(error) && item->path().filename() == "incoming") item.disable_recursion_pending();
        if (!item->is_regular_file(error)) continue;
        std::ifstream in(item->path(), std::ios::binary);
        if (!in.read(first.data(), std::streamsize(first.size())) || first != prefix) continue;
        const auto digest = Digest::from_hex(item->path().filename().string());
        if (!digest.ok() || !needed(*digest)) found.push_back(item->path());
    }
    for (const fs::path& path : found) count += fs::remove(path, error);
    return count;
}

Result<AssetStore::Upload> AssetStore::begin_upload(const Digest& digest, uint64_t size_bytes) {
    if (size_bytes > max_asset_bytes_)
        return Status(StatusCode::kResourceExhausted,
                      "asset of " + std::to_string(size_bytes) + " bytes; the limit is " + std::to_string(max_asset_bytes_));
    const auto lock = take_lock(digest);
    if (!lock.ok()) return lock.status();
    const fs::path path = incoming_path(digest);
    Upload upload(this, digest, size_bytes, *lock);
    const std::lock_guard busy((*lock)->mutex);
    int& file = (*lock)->file;
    const auto open = [&] { return ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644); };
    file = open();
    if (file < 0 && errno == ENOENT) {  // the constructor found no room, or somebody tidied up
        std::error_code error;
        fs::create_directories(path.parent_path(), error);
        if (error) return io_error(path.parent_path(), error.value());
        file = open();
    }
    if (file < 0) return io_error(path, errno);
    const Status theirs(StatusCode::kAborted, "asset " + digest.hex() + " is being stored by another process");
    if (::flock(file, LOCK_EX | LOCK_NB) != 0) {
        std::error_code error;
        const auto written = fs::last_write_time(path, error);
        // That process is stopped. What it has stored is no file of this name any more, and it notices that if it goes on.
        if (!error && fs::file_time_type::clock::now() - written > stall_) fs::remove(path, error);
        return theirs;
    }
    // Another process may have published or removed this very file between open() and flock().
    if (contains(digest) || !still_named(file, path)) return theirs;
    ::futimens(file, nullptr);  // others see by this that somebody is here
    upload.offset_ = uint64_t(::lseek(file, 0, SEEK_END));
    if (upload.offset_ > size_bytes) {  // left by an upload that declared another size
        if (::ftruncate(file, 0) != 0) return io_error(path, errno);
        upload.offset_ = 0;
    }
    return Result<Upload>(std::move(upload));
}

Result<std::shared_ptr<AssetStore::Lock>> AssetStore::take_lock(const Digest& digest) {
    const std::lock_guard guard(mutex_);
    std::shared_ptr<Lock>& held = uploading_[digest];
    if (held) {
        const std::unique_lock idle(held->mutex, std::try_to_lock);
        if (!idle || Clock::now() - held->last < stall_)
            return Status(StatusCode::kAborted, "another upload of asset " + digest.hex() + " is running");
        if (held->file >= 0) ::close(held->file);  // which unlocks it
        held->file = -1;
    }
    held = std::make_shared<Lock>();
    return held;
}

AssetStore::Upload::Upload(AssetStore* store, const Digest& digest, uint64_t size, std::shared_ptr<Lock> lock)
    : store_(store),
      digest_(digest),
      size_(size),
      lock_(std::move(lock)) {}

AssetStore::Upload::~Upload() {
    if (!lock_) return;
    const std::lock_guard guard(store_->mutex_);
    const auto held = store_->uploading_.find(digest_);
    if (held != store_->uploading_.end() && held->second == lock_) store_->uploading_.erase(held);
    // Nobody else has this lock now, but whoever takes over at this moment.
    if (lock_->file >= 0) ::close(lock_->file);
    lock_->file = -1;
}

Status AssetStore::Upload::append(std::string_view bytes) {
    const std::lock_guard busy(lock_->mutex);
    if (lock_->file < 0) return taken_over();
    if (bytes.size() > size_ - offset_) return invalid_argument("more data than the declared size");
    LL_RETURN_IF_ERROR(write_all(lock_->file, bytes, store_->incoming_path(digest_)));
    offset_ += bytes.size();
    lock_->last = Clock::now();
    crash_point("asset.appended");
    return {};
}

void AssetStore::Upload::discard() {
    const std::lock_guard busy(lock_->mutex);
    if (lock_->file >= 0 && ::ftruncate(lock_->file, 0) == 0) offset_ = 0;
}

Status AssetStore::Upload::finish() {
    const std::lock_guard busy(lock_->mutex);
    const fs::path from = store_->incoming_path(digest_);
    if (lock_->file < 0 || !still_named(lock_->file, from)) return taken_over();
    if (offset_ != size_) return invalid_argument("upload ended before the declared size; resume it");
    if (::fsync(lock_->file) != 0) return io_error(from, errno);
    ::futimens(lock_->file, nullptr);  // verifying a large file takes its time
    auto digest = digest_file(from);
    if (!digest.ok()) return digest.status();
    std::error_code error;
    if (*digest != digest_) {
        fs::remove(from, error);
        return data_loss("the bytes have digest " + digest->hex() + ", but the declared one is " + digest_.hex());
    }
    const fs::path to = store_->path_of(digest_);
    fs::create_directories(to.parent_path(), error);
    if (error) return io_error(to.parent_path(), error.value());
    crash_point("asset.before-commit");
    if (::rename(from.c_str(), to.c_str()) != 0) return io_error(to, errno);
    crash_point("asset.committed");
    // Whoever is told that the file is here must find it after a power failure.
    LL_RETURN_IF_ERROR(flush_folder(to.parent_path().string()));
    return flush_folder(store_->directory_.string());
}

Status AssetStore::materialise(const AssetManifest& manifest, const fs::path& directory) const {
    Status damaged;  // of the first such file; all are looked for, so that they can be sent again together
    for (const AssetEntry& entry : manifest.entries) {
        LL_RETURN_IF_ERROR(validate_asset_path(entry.path));
        const fs::path from = path_of(entry.digest), to = directory / entry.path;
        auto digest = digest_file(from);
        std::error_code error;
        if (digest.ok() && *digest != entry.digest) {
            fs::remove(from, error);
            digest = data_loss("\"" + entry.path + "\" of the scene was damaged on disk and is removed; it has to be sent again");
        }
        if (damaged.ok()) damaged = digest.status();
        if (!damaged.ok()) continue;
        fs::create_directories(to.parent_path(), error);
        if (error) return io_error(to.parent_path(), error.value());
        fs::remove(to, error);
        fs::create_hard_link(from, to, error);
        if (error) {
            fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);
            if (error) return io_error(to, error.value());
        }
    }
    return damaged;
}

}  // namespace lightloom
