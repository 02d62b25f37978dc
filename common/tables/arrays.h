#pragma once
// Arrays of plain values as sections of table files.

#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace lightloom {

/// The values' bytes in memory, which are little-endian on every supported host.
template <class T>
std::string bytes_of(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// False when the bytes are not a whole number of values.
template <class T>
bool from_bytes(std::string_view bytes, std::vector<T>* values) {
    if (bytes.size() % sizeof(T) != 0) return false;
    values->resize(bytes.size() / sizeof(T));
    if (!bytes.empty()) std::memcpy(values->data(), bytes.data(), bytes.size());
    return true;
}

}  // namespace lightloom
