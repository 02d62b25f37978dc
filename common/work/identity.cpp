#include "common/work/identity.h"

#include "common/work/golden.h"

namespace lightloom {

std::string math_profile() { return std::string(kTools) + " isa=avx2 x86-64-v3 contract=off"; }

Result<BuildIdentity> build_identity() {
    static const Result<Digest> digest = golden_unit_digest();
    if (!digest.ok()) return digest.status();
    return BuildIdentity{kBuildId, math_profile(), *digest};
}

}  // namespace lightloom
