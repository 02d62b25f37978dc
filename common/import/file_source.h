#pragma once
// Where the importer's bytes come from. A scene names its files relative to the directory of its main file and may not
// leave that directory: what a worker receives is exactly that directory's content.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/result.h"

namespace lightloom::import {

class FileSource {
  public:
    virtual ~FileSource() = default;

    /// Bytes of the file `name`, a normalised relative path. The message of an error names the file.
    Result<std::string> read(const std::string& name);
    /// Every file read so far, in order of first use.
    const std::vector<std::string>& files() const { return files_; }

  private:
    virtual Result<std::string> read_bytes(const std::string& name) = 0;
    std::vector<std::string> files_;
};

/// Files below a directory on disk.
class DirectorySource : public FileSource {
  public:
    /// `root` is empty for the current directory. Files larger than `max_bytes` are refused before they are read.
    DirectorySource(std::string root, uint64_t max_bytes) : root_(std::move(root)), max_bytes_(max_bytes) {}

  private:
    Result<std::string> read_bytes(const std::string& name) override;
    std::string root_;
    uint64_t max_bytes_;
};

/// Files held in memory; for tests and fuzzing.
class MemorySource : public FileSource {
  public:
    explicit MemorySource(std::map<std::string, std::string> contents) : contents_(std::move(contents)) {}

  private:
    Result<std::string> read_bytes(const std::string& name) override;
    std::map<std::string, std::string> contents_;
};

/// A reference as written in a scene file ("textures/./wood.png") as a normalised relative path. Fails for an empty or
/// absolute path and for one that leaves the directory.
Result<std::string> normalise_reference(std::string_view reference);

bool has_suffix(std::string_view text, std::string_view suffix);
/// The file name's extension in lower case without the dot; empty if there is none.
std::string lower_extension(std::string_view name);

/// Inflates gzip data; the output grows as data are seen and may not exceed `max_bytes`.
Result<std::string> inflate_gzip(const std::string& bytes, uint64_t max_bytes);

}  // namespace lightloom::import
