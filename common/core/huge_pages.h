#pragma once
// Memory for large arrays that are read at random. It asks the kernel for huge pages, because with small ones most
// reads of a light-vertex cache miss the translation buffer before they miss the cache. Where the system has no huge
// pages to give, this is ordinary memory.

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <new>
#include <utility>

namespace lightloom {

template <class T>
struct HugePageAllocator {
    using value_type = T;
    static constexpr size_t kPage = size_t(2) << 20;

    HugePageAllocator() = default;
    template <class U>
    HugePageAllocator(const HugePageAllocator<U>&) {}  // NOLINT: allocators convert

    T* allocate(size_t count) {
        const size_t bytes = (count * sizeof(T) + kPage - 1) / kPage * kPage;
        void* memory = std::aligned_alloc(kPage, bytes);
        if (!memory) throw std::bad_alloc();
        (void)madvise(memory, bytes, MADV_HUGEPAGE);  // only advice: a failure costs nothing but time
        return static_cast<T*>(memory);
    }
    void deallocate(T* memory, size_t) { std::free(memory); }
    friend bool operator==(const HugePageAllocator&, const HugePageAllocator&) { return true; }
};

/// Owns one huge page, uninitialised. Pages that are given back are kept for the next owner, up to a bound: the kernel
/// clears every page that it hands out, which takes a tenth of the time in which a light-vertex cache is traced into
/// it. Throws std::bad_alloc.
class HugePage {
  public:
    static constexpr size_t kBytes = HugePageAllocator<std::byte>::kPage;
    /// How much memory without an owner a process keeps at most.
#ifdef __SANITIZE_ADDRESS__
    static constexpr size_t kMostKeptBytes = 0;  // reused pages would hide reads of released memory
#else
    static constexpr size_t kMostKeptBytes = size_t(128) << 20;
#endif

    HugePage();
    ~HugePage();
    HugePage(HugePage&& other) noexcept : memory_(std::exchange(other.memory_, nullptr)) {}
    HugePage& operator=(HugePage&& other) noexcept {
        std::swap(memory_, other.memory_);
        return *this;
    }
    std::byte* data() const { return memory_; }

  private:
    std::byte* memory_;
};

/// Fetches the cache lines of an object that is needed soon.
template <class T>
void prefetch(const T* object) {
    const char* bytes = reinterpret_cast<const char*>(object);
    for (size_t offset = 0; offset < sizeof(T); offset += 64) __builtin_prefetch(bytes + offset);
}

}  // namespace lightloom
