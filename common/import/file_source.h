#pragma once
// Where the importer's bytes come from. A scene names its files relative to the directory of its main file or to one
// above it, up to the scene's root, which it may not leave: a worker receives exactly that directory's content. pbrt-v4
// looks below the main file's directory and then below the current one, which for scenes that rely on this is above the
// main file's. Going up finds the same files wherever the command is given.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "common/core/result.h"

namespace lightloom::import {

class FileSource {
  public:
    /// `above`: the names of the main file's directory, of the one above it, and so on, as far as the one just below
    /// the scene's root. Empty if the main file lies directly in the root.
    explicit FileSource(std::vector<std::string> above = {}) : above_(std::move(above)) {}
    virtual ~FileSource() = default;

    /// The file that a reference in the scene ("textures/./wood.png") means, as a normalised path relative to the main
    /// file's directory, which may begin with "..". It is the nearest such file, see above; it need not exist. Fails
    /// for an empty or absolute path and for one that leaves the scene's root.
    Result<std::string> resolve(std::string_view reference);
    /// Bytes of the file `name`, which resolve() has given. The message of an error names the file.
    Result<std::string> read(const std::string& name);

    /// How many directories above the main file's the references went: that directory is the root of all that was read.
    size_t levels() const { return levels_; }
    /// Every file read so far, in order of first use, as paths relative to the directory that is levels() above the main file's.
    std::vector<std::string> files() const;

  private:
    virtual Result<std::string> read_bytes(const std::string& name) = 0;
    virtual bool exists(const std::string& name) const = 0;
    /// Normalises a reference relative to the directory `level` above the main file's; `*highest` receives how far up
    /// it went.
    Result<std::string> normalise(std::string_view reference, size_t level, size_t* highest) const;

    std::vector<std::string> above_;
    size_t levels_ = 0;
    std::vector<std::string> files_;
    std::unordered_set<std::string> known_;
};

/// Files below a directory on disk.
class DirectorySource : public FileSource {
  public:
    /// `directory`, the main file's, is empty for the current one. Files larger than `max_bytes` are refused before they are read.
    DirectorySource(std::string directory, std::vector<std::string> above, uint64_t max_bytes)
        : FileSource(std::move(above)),
          directory_(std::move(directory)),
          max_bytes_(max_bytes) {}

  private:
    Result<std::string> read_bytes(const std::string& name) override;
    bool exists(const std::string& name) const override;
    std::string path_of(const std::string& name) const { return directory_.empty() ? name : directory_ + "/" + name; }

    std::string directory_;
    uint64_t max_bytes_;
};

/// Files held in memory; for tests and fuzzing.
class MemorySource : public FileSource {
  public:
    /// The names are those that resolve() gives.
    explicit MemorySource(std::map<std::string, std::string> contents, std::vector<std::string> above = {})
        : FileSource(std::move(above)),
          contents_(std::move(contents)) {}

  private:
    Result<std::string> read_bytes(const std::string& name) override;
    bool exists(const std::string& name) const override { return contents_.contains(name); }
    std::map<std::string, std::string> contents_;
};

bool has_suffix(std::string_view text, std::string_view suffix);
/// The file name's extension in lower case without the dot; empty if there is none.
std::string lower_extension(std::string_view name);

/// Inflates gzip data; the output grows with the data and may not exceed `max_bytes`.
Result<std::string> inflate_gzip(const std::string& bytes, uint64_t max_bytes);

}  // namespace lightloom::import
