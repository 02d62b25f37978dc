#pragma once
// LL_ALWAYS_INLINE: for what stands in the innermost loops and is used at more than one place, where the compiler's guess of its
// size would make a call of it. Each use is measured.

#define LL_ALWAYS_INLINE __attribute__((always_inline))
