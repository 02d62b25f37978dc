#!/usr/bin/env python3
"""The statistics of compare.sh: ratios of times between two builds, from pairs of runs that were made one right after the other.

    compare.py DIRECTORY PAIRS [--fail-above R]
    compare.py DIRECTORY PAIRS --check BENCHMARKS    only says whether so many pairs can decide about --fail-above

DIRECTORY holds base-N.json and head-N.json, what Google Benchmark wrote in the N-th pair of runs, N = 0 .. PAIRS - 1.

A pair gives a ratio of HEAD's time over BASE's. Of each benchmark the median of the ratios is shown, between two of the sorted
ratios that hold the true median with 95 % confidence at least: each ratio is below or above it with probability 1/2 each, whatever
the distribution, so that the number below is binomial. With a dozen pairs they are the third smallest and the third largest.
"""

import argparse
import json
import math
import os
import statistics
import sys

CONFIDENCE = 0.95


class Unusable(Exception):
    """What keeps the comparison from being made, in one line."""


def binomial_below(n, k):
    """Probability that of n fair coins fewer than k show heads."""
    return sum(math.comb(n, i) for i in range(k)) / 2**n


def trimmed(n, risk):
    """How many of n sorted ratios may be cut off at one end, so that the true median is beyond with a probability of at most
    `risk`. None where even the last one is beyond it more often."""
    k = 0
    while 2 * (k + 1) <= n + 1 and binomial_below(n, k + 1) <= risk:
        k += 1
    return k - 1 if k else None


def interval(ratios, confidence=CONFIDENCE):
    """(lowest, highest) of the true median ratio."""
    cut = trimmed(len(ratios), (1 - confidence) / 2)
    if cut is None:
        raise Unusable(f"{len(ratios)} pairs are too few for an interval of {confidence:.0%}")
    ordered = sorted(ratios)
    return ordered[cut], ordered[-1 - cut]


def conviction(pairs, benchmarks, confidence=CONFIDENCE):
    """Which of the sorted ratios is below the true median with confidence over as many benchmarks together [Sidak 1967]."""
    cut = trimmed(pairs, 1 - confidence ** (1 / benchmarks))
    if cut is None:
        raise Unusable(f"{pairs} pairs of runs cannot convict one of {benchmarks} benchmarks; give more --rounds or a FILTER")
    return cut


def read_times(path):
    """Seconds of processor time for an item of each benchmark."""
    try:
        with open(path, encoding="utf-8") as file:
            runs = json.load(file)["benchmarks"]
    except (OSError, ValueError, KeyError) as error:
        raise Unusable(f"{path}: is not a result of Google Benchmark: {error}") from error
    times = {}
    for run in runs:
        if run.get("error_occurred"):
            raise Unusable(f"{path}: {run['name']}: {run.get('error_message')}")
        rate = run.get("items_per_second", 0)
        if not rate > 0:
            raise Unusable(f"{path}: {run['name']} counts no items per second")
        times[run["name"]] = 1 / rate
    return times


def duration(seconds):
    for unit, size in (("s", 1), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def main():
    parser = argparse.ArgumentParser(description="Ratios of benchmarks' times between two builds.")
    parser.add_argument("directory")
    parser.add_argument("pairs", type=int)
    parser.add_argument("--fail-above", type=float)
    parser.add_argument("--check", type=int)
    options = parser.parse_args()
    if options.check is not None:
        conviction(options.pairs, options.check)
        return 0

    times = {role: [read_times(os.path.join(options.directory, f"{role}-{n}.json")) for n in range(options.pairs)]
             for role in ("base", "head")}
    for role, runs in times.items():
        if any(run.keys() != runs[0].keys() for run in runs):
            raise Unusable(f"the runs of {role.upper()} do not have the same benchmarks")
    names = [name for name in times["base"][0] if name in times["head"][0]]
    if not names:
        raise Unusable("the revisions have no benchmark in common")
    width = max(len(name) for name in names)
    print(f"{'time for an item':<{width}} {'BASE':>9} {'HEAD':>9} {'ratio':>7}  with {CONFIDENCE:.0%} confidence")
    equal, slower = 0, []
    convicting = None if options.fail_above is None else conviction(options.pairs, len(names))
    for name in names:
        base, head = ([run[name] for run in times[role]] for role in ("base", "head"))
        ratios = [h / b for b, h in zip(base, head)]
        low, high = interval(ratios)
        verdict = "slower" if low > 1 else "faster" if high < 1 else ""
        equal += not verdict
        if convicting is not None and sorted(ratios)[convicting] > options.fail_above:
            slower.append(name)
        print(f"{name:<{width}} {duration(statistics.median(base)):>9} {duration(statistics.median(head)):>9}"
              f" {statistics.median(ratios):7.3f}  {low:.3f} .. {high:.3f}  {verdict}".rstrip())
    print(f"{equal} of {len(names)} intervals contain 1; where nothing has changed, about {1 - CONFIDENCE:.0%} do not")
    for role, other in (("base", "head"), ("head", "base")):
        for name in times[role][0].keys() - times[other][0].keys():
            print(f"only in {role.upper()}: {name}")
    if slower:
        print(f"compare: more than {options.fail_above:g} times as slow, with confidence: {', '.join(slower)}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Unusable as error:
        print(f"compare: {error}", file=sys.stderr)
        sys.exit(2)
