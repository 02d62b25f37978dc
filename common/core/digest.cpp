#include "common/core/digest.h"

#include <openssl/evp.h>

#include <new>

namespace lightloom {

struct Sha256::Impl {
    EVP_MD_CTX* context = nullptr;
};

Sha256::Sha256() : impl_(std::make_unique<Impl>()) {
    impl_->context = EVP_MD_CTX_new();
    if (impl_->context == nullptr || EVP_DigestInit_ex(impl_->context, EVP_sha256(), nullptr) != 1) throw std::bad_alloc();
}

Sha256::~Sha256() { EVP_MD_CTX_free(impl_->context); }

void Sha256::update(const void* data, size_t size) { EVP_DigestUpdate(impl_->context, data, size); }

Digest Sha256::finish() {
    Digest digest;
    unsigned int written = 0;
    EVP_DigestFinal_ex(impl_->context, digest.bytes.data(), &written);
    return digest;
}

Digest sha256(std::string_view bytes) {
    Sha256 hash;
    hash.update(bytes);
    return hash.finish();
}

std::string Digest::hex() const {
    static constexpr char kDigits[] = "0123456789abcdef";
    std::string text;
    text.reserve(64);
    for (const uint8_t b : bytes) {
        text.push_back(kDigits[b >> 4]);
        text.push_back(kDigits[b & 15]);
    }
    return text;
}

Result<Digest> Digest::from_hex(std::string_view hex) {
    if (hex.size() != 64) return invalid_argument("a digest has 64 hexadecimal digits, not " + std::to_string(hex.size()));
    Digest digest;
    for (size_t i = 0; i < 64; ++i) {
        const char c = hex[i];
        int v = -1;
        if (c >= '0' && c <= '9') v = c - '0';
        if (c >= 'a' && c <= 'f') v = c - 'a' + 10;
        if (c >= 'A' && c <= 'F') v = c - 'A' + 10;
        if (v < 0) return invalid_argument("not a hexadecimal digit in a digest: position " + std::to_string(i));
        digest.bytes[i / 2] = uint8_t(digest.bytes[i / 2] * 16 + v);
    }
    return digest;
}

}  // namespace lightloom
