#!/usr/bin/env bash
# Installs the packages of a set that this host lacks, from Debian 12. Silent when nothing is missing.
#
#   deploy/install-deps.sh render      to build the three programs, to pack them (deploy/package.sh), and for charts
#   deploy/install-deps.sh [develop]   also the tests, the benchmarks, the fuzz targets and the format check
set -euo pipefail

packages=(
    build-essential cmake ninja-build pkg-config help2man gnuplot-nox
    libembree-dev libopenexr-dev libtbb-dev libpng-dev zlib1g-dev libstb-dev
    libgrpc++-dev protobuf-compiler protobuf-compiler-grpc libprotobuf-dev libssl-dev
    libspdlog-dev nlohmann-json3-dev libcli11-dev libboost-dev libsqlite3-dev
)
case ${1:-develop} in
    render) ;;
    develop) packages+=(ccache libgtest-dev libbenchmark-dev clang-14 libclang-rt-14-dev clang-format-14 curl python3) ;;
    *)
        echo "install-deps: there are the sets render and develop, not $1" >&2
        exit 2
        ;;
esac

missing=()
for package in "${packages[@]}"; do
    dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q '^install ok installed$' || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get >/dev/null; then
    echo "install-deps: this is not Debian; install the equivalents of: ${missing[*]}" >&2
    exit 1
fi
as_root=()
if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || { echo "install-deps: run as root, or install: ${missing[*]}" >&2; exit 1; }
    as_root=(sudo)
fi
echo "install-deps: installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
