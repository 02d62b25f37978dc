#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

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

}  // namespace

Result<Digest> digest_file(const fs::path& path) {
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return io_error(path, errno);
    Sha256 hash;
    std::vector<char> buffer(size_t(1) << 18);
    for (;;) {
        const ssize_t n = ::read(file, buffer.data(), buffer.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) {
            const int error = errno;
            ::close(file);
            return io_error(path, error);
        }
        if (n == 0) break;
        hash.update(buffer.data(), size_t(n));
    }
    ::close(file);
    return hash.finish();
}

AssetStore::AssetStore(fs::path directory, uint64_t max_asset_bytes)
    : directory_(std::move(directory)),
      max_asset_bytes_(max_asset_bytes) {
    std::error_code ignored;  // the first write reports a directory that cannot be made
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
    if (sha256(*bytes) != digest) return data_loss("asset " + digest.hex() + " is damaged on disk");
    return bytes;
}

Status AssetStore::put(const Digest& digest, std::string_view bytes) {
    if (contains(digest)) return {};
    auto upload = begin_upload(digest, bytes.size());
    if (!upload.ok()) return upload.status();
    LL_RETURN_IF_ERROR(upload->append(bytes.substr(upload->offset())));
    return upload->finish();
}

void AssetStore::remove(const Digest& digest) {
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
    {
        const std::lock_guard lock(mutex_);
        if (!uploading_.insert(digest).second)
            return Status(StatusCode::kAborted, "another upload of asset " + digest.hex() + " is running");
    }
    const fs::path path = incoming_path(digest);
    const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    const int error = errno;
    Upload upload(this, digest, size_bytes, 0, file);
    if (file < 0) return io_error(path, error);
    // Another process may share the directory, and it may have published or removed this very file between open() and
    // flock().
    struct stat ours {
    }, named{};
    if (::flock(file, LOCK_EX | LOCK_NB) != 0 || contains(digest) || ::fstat(file, &ours) != 0 ||
        ::stat(path.c_str(), &named) != 0 || ours.st_ino != named.st_ino)
        return Status(StatusCode::kAborted, "asset " + digest.hex() + " is being stored by another process");
    const off_t offset = ::lseek(file, 0, SEEK_END);
    upload.offset_ = uint64_t(offset);
    if (uint64_t(offset) > size_bytes) {  // left by an upload that declared another size
        if (::ftruncate(file, 0) != 0) return io_error(path, errno);
        upload.offset_ = 0;
    }
    return Result<Upload>(std::move(upload));
}

AssetStore::Upload::Upload(AssetStore* store, const Digest& digest, uint64_t size, uint64_t offset, int file)
    : store_(store),
      digest_(digest),
      size_(size),
      offset_(offset),
      file_(file) {}

AssetStore::Upload::Upload(Upload&& other) noexcept
    : store_(other.store_),
      digest_(other.digest_),
      size_(other.size_),
      offset_(other.offset_),
      file_(other.file_) {
    other.store_ = nullptr;
    other.file_ = -1;
}

AssetStore::Upload::~Upload() {
    if (file_ >= 0) ::close(file_);
    if (!store_) return;
    const std::lock_guard lock(store_->mutex_);
    store_->uploading_.erase(digest_);
}

Status AssetStore::Upload::append(std::string_view bytes) {
    if (bytes.size() > size_ - offset_) return invalid_argument("more data than the declared size");
    LL_RETURN_IF_ERROR(write_all(file_, bytes, store_->incoming_path(digest_)));
    offset_ += bytes.size();
    crash_point("asset.appended");
    return {};
}

Status AssetStore::Upload::finish() {
    const fs::path from = store_->incoming_path(digest_);
    if (offset_ != size_) return invalid_argument("upload ended before the declared size; resume it");
    if (::fsync(file_) != 0) return io_error(from, errno);
    auto digest = digest_file(from);
    if (!digest.ok()) return digest.status();
    std::error_code error;
    if (*digest != digest_) {
        fs::remove(from, error);
        return data_loss("the bytes have digest " + digest->hex() + ", but the declared one is " + digest_.hex());
    }
    const fs::path to = store_->path_of(digest_);
    fs::create_directories(to.parent_path(), error);
    crash_point("asset.before-commit");
    if (::rename(from.c_str(), to.c_str()) != 0) return io_error(to, errno);
    crash_point("asset.committed");
    return {};
}

Status AssetStore::materialise(const AssetManifest& manifest, const fs::path& directory) const {
    for (const AssetEntry& entry : manifest.entries) {
        LL_RETURN_IF_ERROR(validate_asset_path(entry.path));
        const fs::path from = path_of(entry.digest), to = directory / entry.path;
        auto digest = digest_file(from);
        if (!digest.ok()) return digest.status();
        std::error_code error;
        if (*digest != entry.digest) {
            fs::remove(from, error);
            return data_loss("cached file of \"" + entry.path + "\" was damaged; it was removed, try again");
        }
        fs::create_directories(to.parent_path(), error);
        if (error) return internal_error(to.parent_path().string() + ": " + error.message());
        fs::remove(to, error);
        fs::create_hard_link(from, to, error);
        if (error) {
            fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);
            if (error) return internal_error(to.string() + ": " + error.message());
        }
    }
    return {};
}

}  // namespace lightloom
