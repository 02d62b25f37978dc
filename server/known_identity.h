#pragma once
// The identity of a process that renders for itself alone. Golden units prove that hosts whose pixels come together compute
// alike; where nobody else's pixels come in, what the same code found on the same machine a moment ago need not be found again
// for every picture.

#include <filesystem>
#include <optional>
#include <string>

#include "common/core/result.h"
#include "common/work/service.h"

namespace lightloom {

/// Text of everything that the golden units of this process may depend on: the build id that the linker gave to the program and
/// to each library that is loaded, the processor, the machine's current boot, and what chooses among the C library's
/// implementations. Empty where one of them is not to be had; then nothing may be kept.
std::optional<std::string> code_and_machine();

/// Digests of golden units that earlier processes found, a line for each code and machine, the newest first. Processes may
/// share the file: it changes as a whole, and a line counts only if its own digest is right.
class GoldenCache {
  public:
    static constexpr size_t kMaxLines = 16;

    /// In `directory`, which is made when something is stored.
    explicit GoldenCache(const std::filesystem::path& directory) : file_(directory / "golden-units") {}
    std::optional<Digest> find(const Digest& key) const;
    /// What cannot be written is only logged: the next process renders golden units as this one did.
    void store(const Digest& key, const Digest& golden) const;

  private:
    std::filesystem::path file_;
};

/// build_identity(), but with the golden units' digest from the cache in `directory`, if it has that of this code and machine.
/// An empty directory is none. Not for coordinators and workers of a service, which prove themselves anew.
Result<BuildIdentity> known_identity(const std::filesystem::path& directory);

}  // namespace lightloom
