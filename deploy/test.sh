#!/usr/bin/env bash
# Installs, checks that sources are formatted, builds, checks the coordinator's locks (thread_safety.sh), and runs the whole test
# suite, then each fuzz target for a minute (LIGHTLOOM_FUZZ_SECONDS), and the quick tests under sanitizers.
# Arguments go to ctest and leave the rest out. With CI=true, warnings are errors.
#
#   deploy/test.sh                     everything
#   deploy/test.sh -R work_test        some of it
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
"$root/deploy/install-deps.sh"
cd "$root"
if git rev-parse --is-inside-work-tree >/dev/null 2>&1 &&
    ! git ls-files -z '*.h' '*.cpp' | xargs -0 clang-format-14 --dry-run -Werror; then
    echo "test: sources are not formatted; mend it with: git ls-files '*.h' '*.cpp' | xargs clang-format-14 -i" >&2
    exit 1
fi
# CI adds warnings as errors.
werror=OFF
if [ "${CI:-}" = true ]; then werror=ON; fi
cmake --preset release -DLIGHTLOOM_WERROR=$werror >/dev/null
cmake --build --preset release
"$root/deploy/thread_safety.sh"
cd build/release
if [ $# -gt 0 ]; then
    exec ctest --output-on-failure "$@"
fi
ctest --output-on-failure -j "$(nproc)" -LE "statistical|nightly"

cd "$root"
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz
seconds=${LIGHTLOOM_FUZZ_SECONDS:-60}
corpus=$(mktemp -d)
trap 'rm -rf "$corpus"' EXIT
declare -A dictionary=([pbrt]="-dict=$root/tests/fuzz/pbrt.dict" [ply]= [pfm]=)
declare -A running
for target in pbrt ply pfm; do # together, each with one thread
    mkdir "$corpus/$target"
    (cd "$corpus" && exec "$root/build/fuzz/bin/${target}_fuzz" -max_total_time="$seconds" -rss_limit_mb=2048 -timeout=20 \
        -verbosity=0 -print_funcs=0 ${dictionary[$target]} -print_final_stats=1 "$corpus/$target" \
        "$root/tests/fuzz/corpus/$target") >"$corpus/$target.log" 2>&1 &
    running[$target]=$!
done
crashed=
for target in "${!running[@]}"; do
    wait "${running[$target]}" || crashed="$crashed $target"
    sed "s/^/$target: /" "$corpus/$target.log"
done
if [ -n "$crashed" ]; then
    echo "test: a fuzzer found a fault:$crashed" >&2
    exit 1
fi

"$root/deploy/sanitize.sh" quick

# Longer runs last. A test renders with one thread; those that use all processors are marked to run alone.
cd build/release
ctest --output-on-failure -j "$(nproc)" -L statistical
