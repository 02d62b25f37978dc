#pragma once
// A Partial on the wire: an EXR file in memory plus a small descriptor (which travels in the RPC header).
//
// The file is a multi-part, flat scanline EXR without compression, and its bytes are a pure function of the partial:
//   part "camera": data window = the tile; UINT channels hi.{B,G,R}, lo.{B,G,R} are the upper and lower 32 bits of the
//                  double sums of camera samples. Absent where there are none, provided that there are splats.
//   part "splat":  absent without splats; otherwise whichever is smaller of
//                  dense  - data window = the crop, the same six channels, zero where nothing was splatted, or
//                  sparse - N x 1 pixels, the same six channels and `pixel` (row-major in the crop, ascending); not beyond
//                           2^31 - 1 bytes, EXR's limit for a line.
// Any EXR tool opens it. The receiver does not use one: it knows the unit it leased, makes for itself every byte that is
// not pixel data, compares those, the size and the digest, and only then reads the sums at their known offsets. It never
// interprets a header that it would not have written itself.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/digest.h"
#include "common/core/result.h"
#include "common/film/partial.h"

namespace lightloom {

/// Everything in a partial that is not a sum, and the payload's size and digest.
struct PartialDescriptor {
    uint64_t splat_count = 0;  ///< Pixels with a non-zero splat sum. Decides the layout of the splat part.
    uint32_t samples_per_pixel = 0;
    uint64_t light_paths = 0;
    uint64_t dropped_count = 0;
    std::vector<DroppedSample> dropped;
    UnitCounters counters;
    RareLight rare_light;
    uint64_t payload_size = 0;  ///< Bytes.
    Digest payload_digest;      ///< SHA-256 of the payload.
};

struct EncodedPartial {
    PartialDescriptor descriptor;
    std::string payload;  ///< The EXR file.
};

/// What the receiver knows about a unit beforehand, because it follows from the plan.
struct PartialExpectation {
    FrameLayout frame;
    Rect tile;
    uint32_t samples_per_pixel = 0;
    uint64_t light_paths = 0;
};

/// Size in bytes of the payload for `splat_count` splat sums; for size limits and admission. The tile and crop are valid.
uint64_t partial_payload_size(const PartialExpectation& expected, uint64_t splat_count);

/// Encodes a partial. Splat sums that are zero in all channels are left out. kDataLoss if check_partial() refuses the
/// partial.
Result<EncodedPartial> encode_partial(const Partial& partial, const FrameLayout& frame);

/// Decodes any bytes safely: kDataLoss, naming what differs, unless the payload is exactly what encode_partial() makes
/// for the expected unit.
Result<Partial> decode_partial(const PartialExpectation& expected, const PartialDescriptor& descriptor, std::string_view payload);

}  // namespace lightloom
