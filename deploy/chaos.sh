#!/usr/bin/env bash
# The kill loop: renders small jobs on loopback with a coordinator and workers of the build tree that are killed, stopped, damaged
# and made to crash at chosen places, and compares every image with that of an undisturbed render. It ends with a ledger.
#
#   deploy/chaos.sh --minutes 10                          as long as that
#   deploy/chaos.sh --minutes 60 --seed 7                 another course of events
#   deploy/chaos.sh --seed 7 --phase 41 --phases 1        one phase again, as a violation prints it
#   deploy/chaos.sh --minutes 30 --ledger ledger.json     adds to a ledger, and goes on where its last run ended
#   deploy/chaos.sh --minutes 10 --expect-durable         a job that is lost with the coordinator is a violation
#   deploy/chaos.sh --minutes 10 --allow-blame            a job that fails because of its workers is none
#
# Exit codes: 0 every promise held, 1 a violation, 2 bad command line. --help shows all options.
set -euo pipefail

root=$(cd "$(dirname "$0")/.." && pwd)
here=$PWD
cd "$root"
[ -f build/release/build.ninja ] || "$root/deploy/install-deps.sh"
cmake --preset release >/dev/null # the quick start configures without tests
cmake --build build/release --target chaos >/dev/null
cd "$here"
exec "$root/build/release/bin/chaos" "$@"
