#!/usr/bin/env bash
# Checks the locks of the coordinator with clang's thread-safety analysis: every access to what a lock guards (LL_GUARDED_BY in
# server/thread_safety.h) without that lock is an error. Needs a configured build/release, for its compile commands.
#
#   deploy/thread_safety.sh
set -euo pipefail

cd "$(dirname "$0")/.."
[ -f build/release/compile_commands.json ] || { echo "thread_safety: configure first: cmake --preset release" >&2; exit 1; }
# The flags of the compile commands that name include directories and definitions; the rest is for another compiler.
python3 - <<'PYTHON' | xargs -d '\n' -P "$(nproc)" -I '{}' bash -c '{}'
import json, os, shlex
server = os.path.realpath("server")
for command in json.load(open("build/release/compile_commands.json")):
    source = os.path.realpath(os.path.join(command["directory"], command["file"]))
    if os.path.dirname(source) != server: continue
    words, flags = shlex.split(command["command"]), []
    for i, word in enumerate(words):
        if word.startswith(("-I", "-D")): flags.append(word)
        elif word == "-isystem": flags += [word, words[i + 1]]
    print(shlex.join(["clang++-14", "-std=c++20", "-fsyntax-only", "-Wno-everything", "-Wthread-safety", "-Werror=thread-safety"]
                     + flags + [source]))
PYTHON
echo "thread_safety: every guarded access holds its lock"
