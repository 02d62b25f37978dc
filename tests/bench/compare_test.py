#!/usr/bin/env python3
"""Tests of compare.sh and compare.py on a repository made for the purpose, whose `micro` is a script that invents its times."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
sys.dont_write_bytecode = True
import compare  # noqa: E402

LISTS = """cmake_minimum_required(VERSION 3.25)
project(invented LANGUAGES NONE)
add_custom_target(micro COMMAND mkdir -p bin COMMAND cp ${CMAKE_SOURCE_DIR}/tests/bench/micro/micro.py bin/micro)
"""
PRESETS = {"version": 6, "configurePresets": [{"name": "release", "generator": "Ninja", "binaryDir": "${sourceDir}/build/release"}]}
MICRO = """#!%s
import json, random, re, sys, time
seconds = {"walk/camera": 1e-7, "walk/light": %s, "a": 1, "b": 1e-3, "c": 1e-4, "d": 1e-5}
words = dict(a.lstrip("-").split("=", 1) for a in sys.argv[1:] if "=" in a)
names = [n for n in seconds if re.search(words["benchmark_filter"], n)]
if "--benchmark_list_tests" in sys.argv:
    print(*names, sep="\\n") if names else print("Failed to match", file=sys.stderr)
    sys.exit()
time.sleep(float(words["benchmark_min_time"]))
json.dump({"benchmarks": [{"name": n, "items_per_second": 1 / (seconds[n] * random.lognormvariate(0, 0.02))} for n in names]},
          open(words["benchmark_out"], "w"))
"""


class Statistics(unittest.TestCase):
    def test_intervals_hold_the_median_as_often_as_they_say(self):
        source = random.Random(1)
        for pairs in (6, 12, 20):
            # Skewed, with outliers; the median is 1.
            held = 0
            for _ in range(4000):
                ratios = [source.lognormvariate(0, 0.05) ** (10 if source.random() < 0.1 else 1) for _ in range(pairs)]
                low, high = compare.interval(ratios)
                held += low <= 1 <= high
            self.assertGreater(held / 4000, 0.94, pairs)

    def test_what_too_few_pairs_cannot_say(self):
        self.assertEqual(compare.interval([3, 1, 2, 6, 5, 4]), (1, 6))
        self.assertEqual(compare.interval(list(range(12))), (2, 9))
        with self.assertRaises(compare.Unusable):
            compare.interval([1, 2, 3, 4])
        self.assertEqual(compare.conviction(12, 69), 0)
        with self.assertRaises(compare.Unusable):
            compare.conviction(6, 69)

    def test_durations(self):
        self.assertEqual([compare.duration(s) for s in (2.5, 1.5e-3, 2e-6, 7.25e-9)], ["2.5 s", "1.5 ms", "2 us", "7.25 ns"])


class Script(unittest.TestCase):
    """Commits: "none" has no microbenchmarks, "first" and "second" do the same work, "slow" needs longer for one of the two."""

    @classmethod
    def setUpClass(cls):
        cls.root = tempfile.mkdtemp(prefix="lightloom-compare-")
        cls.git("init", "--quiet")
        bench = os.path.join(cls.root, "tests", "bench")
        os.makedirs(bench)
        for name in ("compare.sh", "compare.py"):
            shutil.copy(os.path.join(HERE, name), bench)
        cls.write(".gitignore", "/build/\n__pycache__/\n")
        cls.write("CMakeLists.txt", LISTS)
        cls.write("CMakePresets.json", json.dumps(PRESETS))
        cls.commit("none")
        for tag, seconds in (("first", "2e-7"), ("slow", "4e-7"), ("second", "2.0e-7")):
            cls.write("tests/bench/micro/micro.py", MICRO % (sys.executable, seconds))
            os.chmod(os.path.join(bench, "micro", "micro.py"), 0o755)
            cls.commit(tag)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.root)

    @classmethod
    def git(cls, *arguments):
        return subprocess.run(["git", "-C", cls.root, "-c", "user.name=t", "-c", "user.email=t@t", *arguments], check=True,
                              capture_output=True, text=True).stdout

    @classmethod
    def commit(cls, tag):
        cls.git("add", "--all")
        cls.git("commit", "--quiet", "-m", tag)
        cls.git("tag", tag)

    @classmethod
    def write(cls, name, text):
        path = os.path.join(cls.root, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)

    def tearDown(self):
        self.assertEqual(self.git("worktree", "list").count("\n"), 1, "worktrees are left")
        build = os.path.join(self.root, "build")
        self.assertEqual(os.listdir(build) if os.path.exists(build) else [], [])

    def start(self, *arguments):
        return subprocess.Popen([os.path.join(self.root, "tests/bench/compare.sh"), *arguments], stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True)

    def run_script(self, *arguments):
        process = self.start("--min-time", "0", "--rounds", "4", *arguments)
        out, errors = process.communicate(timeout=60)
        return process.returncode, out, errors

    def assert_refused(self, what, *arguments):
        status, out, errors = self.run_script(*arguments)
        self.assertEqual((status, out), (2, ""), errors)
        self.assertIn(what, errors.splitlines()[-1])
        self.assertEqual(sum(not line.startswith("compare: building") for line in errors.splitlines()), 1, errors)

    def test_equal_revisions(self):
        status, out, errors = self.run_script("--fail-above", "1.2", "first", "second")
        self.assertEqual(status, 0, errors)
        self.assertRegex(out, r"walk/camera +\S+ ns +\S+ ns +(0\.9|1\.0)\d\d ")
        self.assertIn("of 6 intervals contain 1", out)

    def test_a_slower_revision_is_convicted_of_what_is_slower(self):
        status, out, errors = self.run_script("--fail-above", "1.2", "first", "slow")
        self.assertEqual(status, 1, errors)
        self.assertRegex(out, r"walk/light +\S+ ns +\S+ ns +(1\.9|2\.0)\d\d .* slower")
        self.assertTrue(errors.endswith("compare: more than 1.2 times as slow, with confidence: walk/light\n"), errors)
        self.assertEqual(self.run_script("--fail-above", "1.2", "first", "slow", "camera")[0], 0)
        self.assertEqual(self.run_script("--fail-above", "3", "first", "slow")[0], 0)
        self.assertEqual(self.run_script("first", "slow")[0], 0)

    def test_the_working_tree(self):
        name = "tests/bench/micro/micro.py"
        self.write(name, MICRO % (sys.executable, "8e-7"))
        try:
            self.assert_refused("changes that no commit holds", "first", "HEAD")
            before = self.git("status", "--porcelain")
            status, out, errors = self.run_script("second", ".")
            self.assertEqual(status, 0, errors)
            self.assertRegex(out, r"walk/light +\S+ ns +\S+ ns +(3\.9|4\.0|4\.1)\d\d .* slower")
            self.assertEqual(self.git("status", "--porcelain"), before)
        finally:
            self.git("checkout", "--quiet", "--", name)

    def test_what_cannot_be_compared(self):
        self.assert_refused("usage", "first")
        self.assert_refused("there is no option --round", "--round", "3", "first", "second")
        self.assert_refused("--rounds is a number from 3 on", "--rounds", "2", "first", "second")
        self.assert_refused("--fail-above is a ratio", "--fail-above", "5%", "first", "second")
        self.assert_refused("BASE: there is no revision nowhere", "nowhere", "second")
        self.assert_refused("HEAD: there is no revision nowhere", "first", "nowhere")
        self.assert_refused("BASE: none has no microbenchmarks yet", "none", "second")
        self.assert_refused("BASE: Failed to match", "first", "second", "nonesuch")
        self.assert_refused("cannot convict one of 6 benchmarks", "--rounds", "3", "--fail-above", "1.2", "first", "second")

    def test_a_revision_that_does_not_build(self):
        self.write("CMakeLists.txt", "message(FATAL_ERROR broken)\n")
        try:
            status, _, errors = self.run_script("second", ".")
            self.assertEqual(status, 2)
            self.assertEqual(errors.splitlines()[-1], "compare: HEAD: . does not build")
        finally:
            self.git("checkout", "--quiet", "--", "CMakeLists.txt")

    def test_signals_leave_nothing_behind(self):
        for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
            process = self.start("--min-time", "30", "first", "second")
            self.assertTrue(any("round 1" in line for line in iter(process.stderr.readline, "")))
            time.sleep(0.2)
            begin = time.monotonic()
            process.send_signal(number)
            process.communicate(timeout=20)
            self.assertEqual(process.returncode, status)
            self.assertLess(time.monotonic() - begin, 10)


if __name__ == "__main__":
    unittest.main()
