#pragma once
// How benchmarks report what they have done.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>

namespace lightloom::bench {

/// `items` of the kind `unit` ("vertices") in each iteration: shown as items per second and as time per item.
inline void count_items(benchmark::State& state, uint64_t items, const std::string& unit) {
    state.SetItemsProcessed(int64_t(state.iterations()) * int64_t(items));
    state.SetLabel(unit);
}

}  // namespace lightloom::bench
