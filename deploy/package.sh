#!/usr/bin/env bash
# Builds the three programs in build/release and packs them as lightloom_VERSION_ARCHITECTURE.deb, for Debian 12.
#
#   deploy/package.sh [OUTPUT_DIRECTORY]          default: the current directory
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
mkdir -p "${1:-.}"
output=$(cd "${1:-.}" && pwd)
"$root/deploy/install-deps.sh" render
cd "$root"
# Files of one commit get the time of that commit.
if seconds=$(git log -1 --format=%ct 2>/dev/null); then export SOURCE_DATE_EPOCH=$seconds; fi
[ -f build/release/build.ninja ] || cmake --preset release -DLIGHTLOOM_TESTS=OFF -DLIGHTLOOM_UNITY=ON >/dev/null
cmake --build --preset release --target lightloom lightloom-server lightloom-worker
cd build/release
cpack -G DEB -B "$output"
rm -rf "$output/_CPack_Packages"
