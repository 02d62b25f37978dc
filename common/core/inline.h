#pragma once
// LL_ALWAYS_INLINE marks functions of the innermost loops that are used in more than one place; the compiler, which
// guesses by their size, would not inline them. Each use is justified by a measurement.

#define LL_ALWAYS_INLINE __attribute__((always_inline))
