#pragma once
// Scenes by content: the list of a scene's files, whose digest is the scene's root, and a directory of files by digest.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/digest.h"
#include "common/core/result.h"

namespace lightloom {

inline constexpr uint64_t kMaxChunkBytes = uint64_t(1) << 20;

struct AssetEntry {
    std::string path;  ///< Relative to the scene's directory, '/' between components.
    Digest digest;
    uint64_t size_bytes = 0;
};

/// The files of one scene, ascending by path, no path twice.
struct AssetManifest {
    std::string main;  ///< Path of the scene file; one of the entries.
    std::vector<AssetEntry> entries;
    /// ImportOptions::without: what is left out of the scene when it is read; ascending, no name twice. The scene's
    /// root depends on it, so that everyone who reads the scene sees the same one.
    std::vector<std::string> without;

    /// The canonical text that proto/lightloom/v1/asset_service.proto describes.
    std::string canonical_text() const;
    /// Digest of the canonical text.
    Digest root() const { return sha256(canonical_text()); }
    /// Accepts canonical text only: parse(t).canonical_text() == t. kInvalidArgument names the line.
    static Result<AssetManifest> parse(std::string_view text);
    /// Hashes files below `directory`; the first one is the main file. Fails on a name that the protocol forbids or a
    /// file that cannot be read.
    static Result<AssetManifest> of_files(const std::filesystem::path& directory, const std::vector<std::string>& files,
                                          std::vector<std::string> without = {});
};

/// Checks that the path is relative UTF-8 without empty, "." or ".." components, backslashes or control characters, and
/// that components have at most 255 bytes.
Status validate_asset_path(std::string_view path);

/// SHA-256 of a file. kNotFound if it does not exist, kInternal if it cannot be read.
Result<Digest> digest_file(const std::filesystem::path& path);
/// A directory of immutable files named by digest. Safe for any number of threads, and for several processes that share
/// the directory: files appear by rename, when they are complete and verified.
class AssetStore {
  public:
    /// `stall`: an upload to which nothing was added for so long is taken over by another one of the same file.
    explicit AssetStore(std::filesystem::path directory, uint64_t max_asset_bytes = uint64_t(16) << 30,
                        std::chrono::milliseconds stall = std::chrono::seconds(10));

    bool contains(const Digest& digest) const;
    std::filesystem::path path_of(const Digest& digest) const;
    /// Bytes that an unfinished upload has stored; the whole size of a complete file; 0 if the digest is unknown.
    uint64_t committed_size(const Digest& digest) const;
    /// kNotFound; kDataLoss for a file that is damaged, which is removed, so that it can be fetched or stored again.
    Result<std::string> read(const Digest& digest) const;
    /// Reads a file from `offset` on into sink(offset, bytes), in pieces of at most kMaxChunkBytes, and stops with the sink's
    /// error. kNotFound, or kOutOfRange for an offset beyond its end. A file that is read from its beginning is verified on the
    /// way: kDataLoss after its last piece, and it is removed, if it is damaged.
    using ChunkSink = std::function<Status(uint64_t offset, std::string_view bytes)>;
    Status stream(const Digest& digest, uint64_t offset, const ChunkSink& sink) const;
    /// Stores `bytes`; a complete file of that digest is trusted and left as it is.
    Status put(const Digest& digest, std::string_view bytes);
    /// Forgets a file.
    void remove(const Digest& digest) const;
    /// Marks a file as used now, for trim().
    void touch(const Digest& digest) const;
    /// Removes the complete files that were used least recently until the rest have at most `max_bytes`, but never
    /// `newest`; also removes uploads that broke off more than an hour ago.
    void trim(uint64_t max_bytes, const Digest& newest) const;
    /// Removes the complete files that begin with `prefix`, but those that are needed; returns their number.
    size_t remove_all_that_begin_with(std::string_view prefix, const std::function<bool(const Digest&)>& needed);

  private:
    struct Lock;

  public:
    /// One upload in progress. If it is destroyed before it is complete, a later upload goes on from its bytes.
    class Upload {
      public:
        Upload(Upload&& other) noexcept = default;
        Upload& operator=(Upload&&) = delete;
        ~Upload();
        uint64_t offset() const { return offset_; }
        /// Appends bytes; kInvalidArgument beyond the declared size, kResourceExhausted when the disk is full, kAborted after
        /// another upload took over.
        Status append(std::string_view bytes);
        /// Verifies and publishes the file. kDataLoss, and the bytes are thrown away, if they do not have the digest; kAborted
        /// after another upload took over.
        Status finish();
        /// Throws the bytes away, so that a later upload begins anew.
        void discard();

      private:
        friend class AssetStore;
        Upload(AssetStore* store, const Digest& digest, uint64_t size, std::shared_ptr<Lock> lock);
        AssetStore* store_;
        Digest digest_;
        uint64_t size_, offset_ = 0;
        std::shared_ptr<Lock> lock_;  ///< Null in an object that was moved from.
    };
    /// Begins or resumes an upload. kAborted while another upload of the asset runs that is not stalled, kResourceExhausted above
    /// the size limit.
    Result<Upload> begin_upload(const Digest& digest, uint64_t size_bytes);

    /// Fills `directory` with the manifest's files (hard links, or copies across file systems). Every file is verified
    /// against its digest first, so a damaged cache is noticed here: kDataLoss, which names the first one, and all
    /// such files are removed.
    Status materialise(const AssetManifest& manifest, const std::filesystem::path& directory) const;

  private:
    std::filesystem::path incoming_path(const Digest& digest) const;
    /// The lock of a new upload, and its file; takes over from one that is stalled.
    Result<std::shared_ptr<Lock>> take_lock(const Digest& digest);

    std::filesystem::path directory_;
    uint64_t max_asset_bytes_;
    std::chrono::milliseconds stall_;
    std::mutex mutex_;
    std::map<Digest, std::shared_ptr<Lock>> uploading_;
};

}  // namespace lightloom
