#!/usr/bin/env bash
# Builds with sanitizers and runs the tests that suit each of them:
#
#   asan   AddressSanitizer, LeakSanitizer, UndefinedBehaviorSanitizer: the whole suite without the statistical tests
#   tsan   ThreadSanitizer: the service tests, the work plan and the transport of light on several threads; and a control that
#          races on purpose in handlers of gRPC and fails the run unless that is reported
#
#   deploy/sanitize.sh                 both
#   deploy/sanitize.sh tsan -R Workers one of them; what follows goes to ctest
#   deploy/sanitize.sh quick           both, but only the tests that are quick to build and to run; what CI has time for
#
# The options and the suppressions (deploy/tsan.supp) are properties of the tests (tests/CMakeLists.txt), so that a plain
# ctest in build/asan or build/tsan uses them too. Any report fails the run, also one of a process that a test has killed.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
"$root/deploy/install-deps.sh"
cd "$root"
presets=(tsan asan) quick=
if [ "${1:-}" = quick ]; then
    quick=1
    shift
elif [ $# -gt 0 ]; then
    presets=("$1")
    shift
fi
# ThreadSanitizer's shadow memory has fixed addresses, with which the widest address randomisation of newer kernels
# collides.
run=()
if setarch -R true 2>/dev/null; then run=(setarch -R); fi

failed=0
for preset in "${presets[@]}"; do
    cmake --preset "$preset" >/dev/null
    names=() controls=()
    if [ "$preset" = tsan ]; then
        names=(coordinator bookkeeping learn_tables worker scene_cache work)
        controls=(race_control)
        if [ -z "$quick" ]; then names+=(client job_port training broadcast guided shapes process transport durable store mutation); fi
    elif [ -n "$quick" ]; then
        # The service runs under ThreadSanitizer, which also sees freed memory: transport need not be built once more
        # here.
        names=(check core film image_io import_shapes import_textures import_looks)
    fi
    tests=(-LE "statistical|nightly")
    targets=(all)
    if [ ${#names[@]} -gt 0 ]; then
        targets=("${names[@]/%/_test}" "${controls[@]}")
        tests=(-R "^($(IFS='|' && echo "${targets[*]}"))\.")
    fi
    "${run[@]}" cmake --build --preset "$preset" --target "${targets[@]}"
    reports="$root/build/$preset/reports"
    rm -rf "$reports" && mkdir -p "$reports"
    (cd "build/$preset" && "${run[@]}" ctest --output-on-failure "${tests[@]}" "$@") || failed=1
    for report in "$reports"/*; do
        [ -s "$report" ] || continue
        cat "$report"
        failed=1
    done
done
exit $failed
