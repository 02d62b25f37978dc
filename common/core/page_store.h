#pragma once
// PageStore keeps many objects in huge pages. Several threads write them, each object once, and they are read at random
// after that. An object never changes its address, even when the store is moved.

#include <bit>
#include <cstdint>
#include <memory>
#include <mutex>
#include <new>
#include <type_traits>
#include <vector>

#include "common/core/huge_pages.h"

namespace lightloom {

/// Objects are appended in runs of at most kLongest, which are contiguous in memory. Numbers are consecutive within a
/// run; the order of runs is unspecified. Nothing is destroyed. Throws std::bad_alloc, also when the 32-bit numbers are
/// used up (after half a terabyte of 128-byte objects).
template <class T, uint32_t kLongest>
class PageStore {
  public:
    const T* at(uint32_t number) const { return page(number >> kPageBits) + (number & kInPage); }

    /// What the store takes of memory, used or not. No writer may be in use.
    uint64_t memory_bytes() const { return uint64_t(pages_.size()) * HugePage::kBytes; }

    /// Room for a run, uninitialised.
    struct Run {
        T* data = nullptr;
        uint32_t first = 0;  ///< Number of data[0].
    };
    /// Appends the runs of one thread. Several writers may be in use at a time; when one ends, the rest of its page
    /// goes to the next.
    class Writer {
      public:
        explicit Writer(PageStore& store) : store_(store) {}
        ~Writer() { store_.give_back(next_); }
        Writer(const Writer&) = delete;
        Writer& operator=(const Writer&) = delete;
        Run append(uint32_t n) {
            if (next_.left < n) next_ = store_.take();
            const Run run = next_.run;
            next_.run = {run.data + n, run.first + n};
            next_.left -= n;
            return run;
        }

      private:
        friend class PageStore;
        struct Place {
            Run run;
            uint32_t left = 0;
        };
        PageStore& store_;
        Place next_;
    };

  private:
    using Place = typename Writer::Place;
    static constexpr uint32_t kCapacity = HugePage::kBytes / sizeof(T);
    static constexpr uint32_t kPageBits = uint32_t(std::bit_width(kCapacity - 1)), kInPage = (1u << kPageBits) - 1;
    static_assert(kCapacity > kLongest && std::is_trivially_copyable_v<T>);

    T* page(size_t i) const { return reinterpret_cast<T*>(pages_[i].data()); }
    /// Returns a place with room for a run of any length.
    Place take() {
        const std::lock_guard lock(*mutex_);
        if (!open_.empty()) {
            const Place place = open_.back();
            open_.pop_back();
            return place;
        }
        if (pages_.size() >> (32 - kPageBits)) throw std::bad_alloc();
        const uint32_t first = uint32_t(pages_.size()) << kPageBits;
        pages_.emplace_back();
        open_.reserve(pages_.capacity());  // so that give_back(), which destructors call, cannot fail
        return {{page(pages_.size() - 1), first}, kCapacity};
    }
    void give_back(const Place& place) noexcept {
        if (place.left < kLongest) return;
        const std::lock_guard lock(*mutex_);
        open_.push_back(place);
    }

    std::vector<HugePage> pages_;
    std::vector<Place> open_;
    std::unique_ptr<std::mutex> mutex_ = std::make_unique<std::mutex>();  ///< Guards pages_ and open_.
};

}  // namespace lightloom
