#pragma once
// SHA-256 content addresses.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "common/core/result.h"

namespace lightloom {

struct Digest {
    std::array<uint8_t, 32> bytes{};

    friend bool operator==(const Digest&, const Digest&) = default;
    friend auto operator<=>(const Digest&, const Digest&) = default;
    /// 64 lower-case hexadecimal digits.
    std::string hex() const;
    /// Nothing but 64 hexadecimal digits is accepted.
    static Result<Digest> from_hex(std::string_view hex);
};

/// Incremental SHA-256.
class Sha256 {
  public:
    Sha256();
    ~Sha256();
    Sha256(const Sha256&) = delete;
    Sha256& operator=(const Sha256&) = delete;

    void update(const void* data, size_t size);
    void update(std::string_view text) { update(text.data(), text.size()); }
    /// May be called once.
    Digest finish();

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

Digest sha256(std::string_view bytes);

}  // namespace lightloom
