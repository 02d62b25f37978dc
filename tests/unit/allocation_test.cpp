// No allocation per sample: a unit with ten times the samples allocates hardly more often. Replaces
// the global operator new, so it is a program of its own.

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "common/transport/parameters.h"
#include "tests/support/estimates.h"
#include "tests/support/test_scenes.h"

namespace {
std::atomic<uint64_t> allocations{0};

void* counted(std::size_t size) {
    ++allocations;
    void* p = std::malloc(size > 0 ? size : 1);
    if (p == nullptr) throw std::bad_alloc();
    return p;
}
}  // namespace

void* operator new(std::size_t size) { return counted(size); }
void* operator new[](std::size_t size) { return counted(size); }
// The standard library's temporary buffers ask for this one and give back through the ordinary delete.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
    ++allocations;
    return std::malloc(size > 0 ? size : 1);
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }

namespace lightloom {
namespace {

uint64_t allocations_of(const std::shared_ptr<const Scene>& scene, const AlgorithmInfo& row, uint32_t iterations) {
    const std::string name(row.name);
    const RenderSettings settings = testing::settings_of(name, testing::with_small_training(name, {}), 1);
    const auto renderer = create_with_tables(scene, settings, {});
    EXPECT_TRUE(renderer.ok());
    const RenderUnit work = testing::whole_frame(*scene, settings.algorithm, iterations);
    const uint64_t before = allocations;
    const Result<Partial> partial = (*renderer)->render(work, {});
    EXPECT_TRUE(partial.ok());
    return allocations - before;
}

TEST(Allocation, DoesNotGrowWithTheSamples) {
    for (const auto make : {testing::diffuse_box, testing::rough_and_coated, testing::environment_lit}) {
        const auto scene = make();
        for (const AlgorithmInfo* row : catalog()) {
            allocations_of(scene, *row, 1);  // the thread pool wakes up
            const uint64_t few = allocations_of(scene, *row, 4), many = allocations_of(scene, *row, 40);
            const uint64_t more_samples = 36 * uint64_t(scene->frame().crop.area());
            // Lists of splats double a few times more in each of the chunks; a cache adds chunks of 256 light paths, whose three
            // lists double from one on; what is made anew for each iteration is small next to a real frame. That is all.
            const int per_allocation = row->frame == FrameShape::kWhole ? 3 : row->shares_light_paths ? 6 : 50;
            EXPECT_LT(many, few + more_samples / uint64_t(per_allocation))
                << row->name << ": " << few << " allocations, then " << many;
        }
    }
}

}  // namespace
}  // namespace lightloom
