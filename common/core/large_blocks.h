#pragma once
// Memory of large blocks goes back to the system as soon as they are freed.

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace lightloom {

/// For the beginning of main(). The GNU C library raises the size from which it asks the system for a block of its own
/// with every such block that is freed, up to 32 MB. From then on smaller blocks come from heaps that are not given back
/// while anything above them lives: after learning, a coordinator held twice the memory that it used.
inline void give_back_large_blocks() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
}

}  // namespace lightloom
