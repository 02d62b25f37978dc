#pragma once
// Pieces of messages that jobs and units have in common. Only the files of wire.h's functions include it.

#include "common/work/wire.h"

namespace lightloom::wire {

inline void put_rect(const Rect& in, v1::Rect* out) {
    out->set_x0(in.x0);
    out->set_y0(in.y0);
    out->set_x1(in.x1);
    out->set_y1(in.y1);
}

inline Rect get_rect(const v1::Rect& in) { return {in.x0(), in.y0(), in.x1(), in.y1()}; }

inline void put_key(const UnitKey& in, v1::UnitKey* out) {
    out->set_group(in.group);
    out->set_tile(in.tile);
    out->set_kind(v1::UnitKind(int(in.kind) + 1));
    out->set_round(in.round);
}

inline Result<UnitKey> get_key(const v1::UnitKey& in) {
    if (in.kind() < v1::UNIT_KIND_RENDER || in.kind() > v1::UNIT_KIND_PROBE)
        return invalid_argument("a unit of unknown kind; install the same build on both hosts");
    if (in.round() != 0 && in.kind() != v1::UNIT_KIND_TRAINING) return invalid_argument("only units of training have rounds");
    return UnitKey{in.group(), in.tile(), UnitKind(int(in.kind()) - 1), in.round()};
}

inline void put_asset(const AssetReference& in, v1::AssetReference* out) {
    put(in.digest, out->mutable_digest());
    out->set_size_bytes(in.size_bytes);
}

inline Result<AssetReference> get_asset(const v1::AssetReference& in) {
    const auto digest = get(in.digest());
    if (!digest.ok()) return digest.status();
    return AssetReference{*digest, in.size_bytes()};
}

}  // namespace lightloom::wire
