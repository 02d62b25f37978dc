#pragma once
// Arrays of plain values as sections of table files.

#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace lightloom {

/// The values' bytes in memory, which are little-endian on every supported host.
template <class T>
std::string bytes_of(const std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// Copies the values of a section of parse_sections(). False when it is missing, or not a whole number of values.
template <class T>
bool read_section(const std::vector<std::pair<std::string, std::string_view>>& sections, std::string_view name,
                  std::vector<T>* values) {
    const auto item = std::find_if(sections.begin(), sections.end(), [&](const auto& s) { return s.first == name; });
    if (item == sections.end() || item->second.size() % sizeof(T) != 0) return false;
    values->resize(item->second.size() / sizeof(T));
    if (!values->empty()) std::memcpy(values->data(), item->second.data(), item->second.size());
    return true;
}

}  // namespace lightloom
