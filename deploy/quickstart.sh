#!/usr/bin/env bash
# From a fresh clone to a picture: installs, builds, starts a coordinator and two workers on loopback, renders a scene with
# them, and stops what it started. A second run takes seconds.
#
#   deploy/quickstart.sh [OUTPUT_DIRECTORY]          default: quickstart-output in the current directory
#   LIGHTLOOM_QUICKSTART_SPP=256 deploy/quickstart.sh   more samples than the default
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
output=${1:-quickstart-output}
spp=${LIGHTLOOM_QUICKSTART_SPP:-40}
scene=$root/tests/scenes/quickstart.pbrt
bin=$root/build/release/bin

"$root/deploy/install-deps.sh" render
cd "$root"
if [ ! -f build/release/build.ninja ]; then
    echo "configuring..."
    cmake --preset release -DLIGHTLOOM_TESTS=OFF -DLIGHTLOOM_UNITY=ON >/dev/null
fi
cd - >/dev/null
mkdir -p "$output"
echo "building (the first time takes some minutes; CMAKE_BUILD_PARALLEL_LEVEL limits the number of compilers)..."
build=(cmake --build "$root/build/release" --target lightloom lightloom-server lightloom-worker)
# On a terminal one sees how far it is.
if [ -t 1 ]; then "${build[@]}" 2>&1 | tee "$output/build.log"; else "${build[@]}" >"$output/build.log" 2>&1; fi || {
    grep -E 'error|FAILED' "$output/build.log" | head -n 20 >&2 || true
    echo "quickstart: the build failed; all that the compilers said is in $output/build.log" >&2
    exit 1
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

started=()
stop_all() {
    local pid
    # Workers stop first, so that they give back their units while the coordinator still listens.
    for ((i = ${#started[@]} - 1; i >= 0; --i)); do
        pid=${started[i]}
        kill "$pid" 2>/dev/null || true
        wait "$pid" 2>/dev/null || true
    done
    rm -rf "$work"
}
trap stop_all EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

"$bin/lightloom-server" --listen 127.0.0.1:0 --status 127.0.0.1:0 --data "$work/data" --port-file "$work/ports" \
    2>"$output/server.log" &
started+=($!)
for _ in $(seq 300); do
    [ -s "$work/ports" ] && break
    kill -0 "${started[0]}" 2>/dev/null || break
    sleep 0.1
done
[ -s "$work/ports" ] || { echo "quickstart: the coordinator did not start:" >&2; cat "$output/server.log" >&2; exit 1; }
read -r port status_port <"$work/ports"
threads=$((($(nproc) + 1) / 2))
for i in 1 2; do
    "$bin/lightloom-worker" --server "127.0.0.1:$port" --threads "$threads" --cache "$work/cache" 2>"$output/worker$i.log" &
    started+=($!)
done
for i in 1 2; do
    until grep -qs 'registered as' "$output/worker$i.log"; do
        if ! kill -0 "${started[i]}" 2>/dev/null; then
            echo "quickstart: a worker did not start:" >&2
            cat "$output/worker$i.log" >&2
            exit 1
        fi
        sleep 0.1
    done
done
echo "coordinator on port $port, status at http://127.0.0.1:$status_port/api/v1/status, two workers with $threads thread(s) each"

"$bin/lightloom" submit "$scene" --server "127.0.0.1:$port" --algorithm bdpt --spp "$spp" \
    -o "$output/quickstart.exr" --png "$output/quickstart.png" --exposure 1
echo
echo "picture:  $(realpath "$output/quickstart.png")"
echo "EXR:      $(realpath "$output/quickstart.exr")"
echo "manifest: $(realpath "$output/quickstart.manifest.json")"
