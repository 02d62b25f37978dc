#include "server/memory_need.h"

#include <algorithm>
#include <cstdio>

#include "common/film/frame.h"
#include "common/transport/catalog.h"
#include "server/reducer.h"

namespace lightloom {
namespace {

/// Sums of the complete groups, per pixel, without and with splats; see reducer.h.
constexpr uint64_t kImageBytes = 48, kSplatImageBytes = 72;
/// Albedo, normal and depth of a pixel.
constexpr uint64_t kLayerBytes = 28;
/// Colour and variance as floats, and the EXR of them.
constexpr uint64_t kWritingBytes = 48;
/// A training sample of a hard interior: 7 10^6 of them took 8 GiB.
constexpr uint64_t kTrainingSampleBytes = 1230;
constexpr uint64_t kMaxOpenGroups = 256;

bool splats(const JobSpec& spec) { return spec.algorithm.light_paths_per_iteration(spec.frame.crop.area()) > 0; }

std::string gb_text(uint64_t bytes) {
    char text[32];
    std::snprintf(text, sizeof text, "%.*f", bytes < 100'000'000 ? 3 : 1, double(bytes) * 1e-9);
    return text;
}

}  // namespace

uint64_t MemoryNeed::peak() const { return layers + std::max(training, image + std::max(groups, writing)); }

uint32_t most_open_groups(const JobSpec& spec, uint64_t waiting_bytes) {
    const uint64_t group = Reducer::open_group_bytes(splats(spec)) * uint64_t(std::max<int64_t>(1, spec.frame.crop.area()));
    return uint32_t(std::min(1 + waiting_bytes / group, kMaxOpenGroups));
}

MemoryNeed memory_need(const JobSpec& spec, uint64_t waiting_bytes, uint64_t training_bytes) {
    const auto pixels = uint64_t(std::max<int64_t>(0, spec.frame.crop.area()));
    uint64_t groups = most_open_groups(spec, waiting_bytes);
    if (spec.samples_per_pixel > 0)
        groups = std::min<uint64_t>(groups, Plan(spec.frame, spec.algorithm).group_count(spec.samples_per_pixel));
    MemoryNeed need;
    need.image = pixels * (splats(spec) ? kSplatImageBytes : kImageBytes);
    need.groups = pixels * Reducer::open_group_bytes(splats(spec)) * groups;
    need.layers = spec.first_hit_layers ? pixels * kLayerBytes : 0;
    need.writing = pixels * kWritingBytes + need.layers;
    if (const LearningInfo* learning = spec.algorithm.learning())
        need.training = std::min(training_bytes, learning->plan(spec.algorithm).samples * kTrainingSampleBytes);
    return need;
}

std::string memory_text(const MemoryNeed& need) {
    std::string parts;
    for (const auto& [what, bytes] : {std::pair{"image ", need.image},
                                      {"groups under way ", need.groups},
                                      {"layers ", need.layers},
                                      {"training ", need.training},
                                      {"writing it ", need.writing}}) {
        if (bytes == 0) continue;
        if (!parts.empty()) parts += ", ";
        parts += what + gb_text(bytes);
    }
    return gb_text(need.peak()) + " GB" + (parts.empty() ? "" : " (" + parts + ")");
}

Status check_memory(const JobSpec& spec, const MemoryNeed& need, uint64_t host_bytes, uint64_t other_jobs_bytes) {
    const uint64_t peak = need.peak();
    const uint64_t free = host_bytes > other_jobs_bytes ? host_bytes - other_jobs_bytes : 0;
    if (host_bytes == 0 || peak <= free) return {};
    const bool learning = need.training > need.image + std::max(need.groups, need.writing);
    const bool alone = peak <= host_bytes;
    std::string text = "the job's " + std::to_string(spec.frame.crop.area()) + " pixels need about " + memory_text(need) +
                       " of memory; the coordinator's host has " + gb_text(host_bytes) + " GB";
    if (alone)
        return {StatusCode::kResourceExhausted,
                text + ", of which other jobs need " + gb_text(other_jobs_bytes) + "; submit it again when they have ended"};
    text += learning ? "; choose fewer training-paths" : "; lower the resolution or give a crop window";
    return {StatusCode::kResourceExhausted, text};
}

}  // namespace lightloom
