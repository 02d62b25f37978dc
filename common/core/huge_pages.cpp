#include "common/core/huge_pages.h"

#include <mutex>
#include <vector>

namespace lightloom {
namespace {

constexpr size_t kMostKept = HugePage::kMostKeptBytes / HugePage::kBytes;

/// Pages that have no owner at present. This object is never destroyed, because owners of pages may outlive static
/// objects.
struct Spare {
    std::mutex mutex;
    std::vector<std::byte*> pages;
};
Spare& spare() {
    static Spare& s = *new Spare;
    return s;
}

}  // namespace

HugePage::HugePage() : memory_(nullptr) {
    {
        Spare& s = spare();
        const std::lock_guard lock(s.mutex);
        s.pages.reserve(kMostKept);  // so that giving a page back cannot fail
        if (!s.pages.empty()) {
            memory_ = s.pages.back();
            s.pages.pop_back();
        }
    }
    if (!memory_) memory_ = HugePageAllocator<std::byte>().allocate(kBytes);
}

HugePage::~HugePage() {
    if (!memory_) return;
    {
        Spare& s = spare();
        const std::lock_guard lock(s.mutex);
        if (s.pages.size() < kMostKept) {
            s.pages.push_back(memory_);
            return;
        }
    }
    HugePageAllocator<std::byte>().deallocate(memory_, kBytes);
}

}  // namespace lightloom
