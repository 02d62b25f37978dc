#pragma once
// Identifies the code and the machine arithmetic that compute light, and proves on this host that they work.

#include "common/core/result.h"
#include "common/work/service.h"

namespace lightloom {

/// Version and digest of the sources that compute light, for example "0.1.0+1a2b3c4d5e6f7081".
extern const char* const kBuildId;
/// Compiler and ray tracer with their versions, for example "GNU-12.2.0 embree-3.13.5".
extern const char* const kTools;

/// Compiler, instruction set, contraction, ray tracer with its instruction set.
std::string math_profile();

/// The identity of this process; the first call renders the golden units. Thread-safe.
Result<BuildIdentity> build_identity();
/// A service that cannot start for such an error prints this text before it.
inline constexpr const char* kNoIdentity = "the golden unit failed on this host: ";

}  // namespace lightloom
