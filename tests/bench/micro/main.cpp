// Microbenchmarks of the parts that renderings spend their time in, by Google Benchmark:
//
//   micro [--benchmark_list_tests] [--benchmark_filter=REGEX] [--benchmark_format=json] [...]
//
// Every benchmark runs on one thread, works on fixed inputs (inputs.h) and says what an item is. compare.sh compares two
// revisions by them.

#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

int main(int argc, char** argv) {
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
}
