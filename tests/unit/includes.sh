#!/usr/bin/env bash
# Includes run one way: no circle among the files of the product, none among its folders, and no folder of common/ knows server,
# worker or client. tsort complains about circles.
#
#   includes.sh SOURCE_DIRECTORY
set -euo pipefail
cd "$1"

pairs=$(grep -rnoE '^#include "(common|server|worker|client)/[^"]+"' --include='*.h' --include='*.cpp' common server worker client |
    sed -E 's/^([^:]+):[0-9]+:#include "([^"]+)"/\1 \2/')
failed=0
check() { # name, pairs on standard input
    local message
    if ! message=$(tsort 2>&1 >/dev/null); then
        echo "circle among $1:" >&2
        echo "$message" >&2
        failed=1
    fi
}
check files <<<"$pairs"
check folders < <(sed -E 's#/[^/ ]+ # #; s#/[^/]+$##' <<<"$pairs" | awk '$1 != $2' | sort -u)
if grep -E '^common/[^ ]+ (server|worker|client)/' <<<"$pairs" >&2; then
    echo "common/ includes what stands above it" >&2
    failed=1
fi
if grep -E '^(server|worker)/[^ ]+ client/|^server/[^ ]+\.h worker/' <<<"$pairs" >&2; then
    echo "an include that points upwards" >&2
    failed=1
fi
exit $failed
