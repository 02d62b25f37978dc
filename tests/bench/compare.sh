#!/usr/bin/env bash
# Compares the microbenchmarks (tests/bench/micro) of two revisions: builds both in worktrees, runs them by turns, and says for every
# benchmark how HEAD's time relates to BASE's, with an interval that holds the true ratio with 95 % confidence.
#
#   tests/bench/compare.sh [options] BASE HEAD [FILTER]
#
# BASE and HEAD are revisions of git; HEAD may be "." for the working tree as it is, with what is not committed. FILTER is a regular
# expression; benchmarks are chosen by a match anywhere in their names (micro --benchmark_list_tests).
#
#   --rounds N        rounds of BASE HEAD HEAD BASE, or HEAD BASE BASE HEAD: two pairs of runs each (default 6)
#   --min-time S      seconds for each benchmark in each run (default 0.05)
#   --fail-above R    exit with 1 if a benchmark needs more than R times as long (1.05: five percent more), with confidence
#                     over all the benchmarks together
#
# Exit codes: 0; 1 see --fail-above; 2 for whatever keeps the comparison from being made.
set -euo pipefail

fail() {
    echo "compare: $*" >&2
    exit 2
}

rounds=6 min_time=0.05 fail_above=
while [ $# -gt 0 ]; do
    case $1 in
    --rounds | --min-time | --fail-above)
        [ $# -ge 2 ] || fail "$1 needs a value"
        case $1 in
        --rounds) rounds=$2 ;;
        --min-time) min_time=$2 ;;
        --fail-above) fail_above=$2 ;;
        esac
        shift 2
        ;;
    -h | --help)
        sed -n '2,/^set /{/^#/s/^# \{0,1\}//p}' "$0"
        exit 0
        ;;
    -*) fail "there is no option $1; there are --rounds, --min-time and --fail-above" ;;
    *) break ;;
    esac
done
if [ $# -lt 2 ] || [ $# -gt 3 ]; then
    fail "usage: compare.sh [--rounds N] [--min-time S] [--fail-above R] BASE HEAD [FILTER]; --help says more"
fi
base=$1 head=$2 filter=${3:-.}
[[ $rounds =~ ^[1-9][0-9]*$ && ! $rounds =~ ^[12]$ ]] ||
    fail "--rounds is a number from 3 on, not $rounds: fewer pairs have no interval of 95 %"
[[ $min_time =~ ^[0-9]*\.?[0-9]+$ ]] || fail "--min-time is a number of seconds, not $min_time"
[[ -z $fail_above || $fail_above =~ ^[0-9]*\.?[0-9]+$ ]] || fail "--fail-above is a ratio such as 1.05, not $fail_above"

command -v python3 >/dev/null || fail "there is no python3; deploy/install-deps.sh installs it"
tools=$(cd "$(dirname "$0")" && pwd)
root=$(git -C "$tools" rev-parse --show-toplevel 2>/dev/null) || fail "$tools is not in a git repository, which has the revisions"
git() { command git -C "$root" "$@"; }

commit_of() { # role, revision
    git rev-parse --verify --quiet "$2^{commit}" || fail "$1: there is no revision $2"
}
dirty() { [ -n "$(git status --porcelain)" ]; }

mkdir -p "$root/build"
work=$(mktemp -d "$root/build/compare.XXXXXX")
child=
clean_up() {
    trap - EXIT INT TERM HUP
    if [ -n "$child" ]; then
        kill -- "-$child" 2>/dev/null || true
        wait "$child" 2>/dev/null || true
    fi
    local tree known=
    for tree in "$work/base" "$work/head"; do
        if [ -e "$tree" ]; then git worktree remove --force "$tree" 2>/dev/null || known=1; fi
    done
    rm -rf "$work"
    if [ -n "$known" ]; then git worktree prune; fi
}
trap clean_up EXIT
trap 'clean_up; exit 130' INT
trap 'clean_up; exit 143' TERM
trap 'clean_up; exit 129' HUP

# Whatever takes long is a process group of its own in the background, so that a signal ends it at once and leaves nothing behind.
run() {
    local status=0
    set -m
    "$@" &
    child=$!
    set +m
    wait "$child" || status=$?
    child=
    return $status
}

base_commit=$(commit_of BASE "$base")
if [ "$head" = . ]; then
    # The tree with all that git does not ignore, as a commit that no branch knows.
    cp "$(git rev-parse --path-format=absolute --git-path index)" "$work/index"
    export GIT_INDEX_FILE=$work/index
    git add --all
    head_commit=$(git -c user.name=compare -c user.email=compare@localhost commit-tree -p HEAD -m "working tree" "$(git write-tree)")
    unset GIT_INDEX_FILE
else
    head_commit=$(commit_of HEAD "$head")
    for revision in "$base_commit" "$head_commit"; do
        if [ "$revision" = "$(git rev-parse HEAD)" ] && dirty; then
            fail "the working tree has changes that no commit holds; commit them, or give . as HEAD to compare the tree as it is"
        fi
    done
fi
for role in base head; do
    commit=${role}_commit
    git cat-file -e "${!commit}:tests/bench/micro" 2>/dev/null ||
        fail "${role^^}: ${!role} has no microbenchmarks yet (tests/bench/micro); take a later revision"
done

# Both trees have paths of the same length and build at the same place in them. Names in the output of the compiler are relative
# to the tree, so that what both have in common is compiled once.
for role in base head; do
    commit=${role}_commit tree=$work/$role log=$work/$role.log
    echo "compare: building ${role^^} ($(git log -1 --format='%h %s' "${!commit}"))" >&2
    git worktree add --quiet --detach "$tree" "${!commit}" 2>"$log" || fail "${role^^}: $(tail -n 1 "$log")"
    build() {
        cd "$tree"
        export CCACHE_BASEDIR=$tree CCACHE_NOHASHDIR=1
        cmake --preset release && cmake --build build/release --target micro
    }
    if ! run build >"$log" 2>&1; then
        grep -m 20 -E "error|Error|FAILED" "$log" >&2 || tail -n 20 "$log" >&2
        fail "${role^^}: ${!role} does not build"
    fi
    [ -x "$tree/build/release/bin/micro" ] || fail "${role^^}: no program micro was built; deploy/install-deps.sh installs its library"
    "$tree/build/release/bin/micro" --benchmark_list_tests "--benchmark_filter=$filter" >"$work/$role.list" 2>"$log" || true
    [ -s "$work/$role.list" ] || fail "${role^^}: $(head -n 1 "$log")"
done
if [ -n "$fail_above" ]; then
    run python3 "$tools/compare.py" "$work" $((2 * rounds)) --check "$(wc -l <"$work/head.list")"
fi

measure() { # role, number
    run "$work/$1/build/release/bin/micro" "--benchmark_filter=$filter" "--benchmark_min_time=$min_time" \
        "--benchmark_out=$work/$1-$2.json" --benchmark_out_format=json >"$work/run.log" 2>&1 ||
        fail "${1^^}: micro failed: $(tail -n 1 "$work/run.log")"
}
# Every second round begins with HEAD, so that neither is always between two runs of the other.
for ((pair = 0; pair < 2 * rounds; ++pair)); do
    if ((pair % 2 == 0)); then echo "compare: round $((pair / 2 + 1)) of $rounds" >&2; fi
    case $((pair % 4)) in
    0 | 3) measure base $pair && measure head $pair ;;
    *) measure head $pair && measure base $pair ;;
    esac
done
run python3 "$tools/compare.py" "$work" $((2 * rounds)) ${fail_above:+--fail-above "$fail_above"}
