#pragma once
// The files that a command will write, tried out before its work: a typing error must show before hours of rendering, not after
// them, and nothing that the command reads may be replaced.

#include <filesystem>
#include <span>
#include <string>

#include "common/core/result.h"

namespace lightloom::client {

/// Whether all of `outputs` (names; empty ones are left out) can be written, tried with empty files beside them. kInvalidArgument
/// for one that is a directory, a dangling link, another output or one of `inputs`, wherever links lead; devices and pipes are
/// taken.
Status check_output_files(std::span<const std::filesystem::path> inputs, std::span<const std::string> outputs);

}  // namespace lightloom::client
