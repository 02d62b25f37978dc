#!/usr/bin/env bash
# Installs, builds with warnings as errors, and runs the whole test suite. Arguments go to ctest.
#
#   deploy/test.sh                     everything
#   deploy/test.sh -R work_test        some of it
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
"$root/deploy/install-deps.sh"
cd "$root"
cmake --preset release -B build/test -DLIGHTLOOM_WERROR=ON >/dev/null
cmake --build build/test
cd build/test
if [ $# -gt 0 ]; then
    exec ctest --output-on-failure "$@"
fi
# The statistical label goes last and alone: its tests use all processors themselves.
if ctest -N -L statistical | grep -q '^Total Tests: 0$'; then
    exec ctest --output-on-failure -j "$(nproc)"
fi
ctest --output-on-failure -j "$(nproc)" -LE statistical
exec ctest --output-on-failure -L statistical
