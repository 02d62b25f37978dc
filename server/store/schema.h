#pragma once
// The schema of the store's database, as the list of its migrations. A migration that was once released never changes; a new one
// is appended.

#include <span>
#include <string_view>

namespace lightloom {

/// For Database::open().
std::span<const std::string_view> store_migrations();

}  // namespace lightloom
