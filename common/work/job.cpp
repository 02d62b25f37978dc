#include "common/work/job.h"

namespace lightloom {
namespace {

/// Length-prefixed, so that no two specs can have the same text.
void put(std::string& out, std::string_view key, std::string_view value) {
    out += key;
    out += ' ';
    out += std::to_string(value.size());
    out += ' ';
    out += value;
    out += '\n';
}

}  // namespace

Digest JobSpec::image_digest() const {
    std::string text = "lightloom-image 1\n";
    put(text, "algorithm", algorithm);
    for (const auto& [key, value] : parameters) put(text, "set " + key, value);
    put(text, "seed", std::to_string(seed));
    put(text, "max_depth", std::to_string(max_depth));
    put(text, "scene_root", scene_root.hex());
    const int32_t numbers[] = {frame.width, frame.height, frame.crop.x0, frame.crop.y0, frame.crop.x1, frame.crop.y1};
    for (const int32_t n : numbers) put(text, "frame", std::to_string(n));
    put(text, "layers", first_hit_layers ? "first-hit" : "none");
    return sha256(text);
}

}  // namespace lightloom
