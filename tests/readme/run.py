#!/usr/bin/env python3
"""Checks the READMEs: runs every command in them on a clean copy of the tree, and checks length, links and paths.

    tests/readme/run.py                       all READMEs, with the programs of build/release/bin
    tests/readme/run.py client/README.md      one of them
    tests/readme/run.py --list                what would run, as it would run
    tests/readme/run.py --clone               on a clone that deploy/quickstart.sh has built (takes minutes)

A command is a line of a block that is fenced by ```sh, or of an indented block in which some line begins with a program, a word
of the shell or an assignment. Other indented blocks (a formula, a drawing) and blocks fenced with another name hold none; --list
shows them. A line that ends with a backslash goes on with the next one. The commands of one README run in one shell, in its order,
from the top of the tree, and each must succeed. A coordinator or worker is started in the background and stopped when the README
ends. An HTML comment before a block keeps the block from being run, and says why:

    <!-- not run: needs a second host -->

A block that only looks like commands is marked by <!-- not a command -->. What is neither run nor marked fails the test. Long
commands are shortened by RULES; nothing else is changed in them.
"""

import argparse
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
FRONT_PAGE = "README.md"
FRONT_PAGE_WORDS = 700
TIMEOUT = 120  # seconds for one README
PROGRAMS = os.environ["PATH"]  # and what --bin names

# What is changed in a command before it runs: (pattern, replacement, reason). The test prints commands as they ran.
RULES = [
    (r"(?<![\w/.-])(?:\./)?scene\.pbrt\b", "tests/scenes/quickstart.pbrt", "the reader's own scene"),
    (r"--time [\d.]+", "--time 0.5", "half a second instead of minutes"),
    (r"--cross-time [\d.]+", "--cross-time 0.5", "the same for a cross-check"),
    (r"--spp \d+", "--spp 1", "one sample per pixel"),
    (r"^(?!.*--(?:spp|time|pyramid|noise|help)\b)((?:.*[( ])?(?:\S+/)?lightloom (?:render|submit)\b)", r"\1 --spp 1",
     "also where the scene asks for more"),
    (r"(lightloom reference\b.*)--time 0\.5\b", r"\1--spp 20", "as many samples as a cross-check needs at least"),
    (r"--seeds \d+", "--seeds 1", "one run of each algorithm"),
    (r"(?<=--resolution )320x180\b", "80x45", "a smaller picture"),
    (r"(?<=--resolution )160x90\b", "32x18", "a smaller picture"),
    (r"training-paths=\d+", "training-paths=2000", "a small training set"),
    (r"^(?!.*(?:--time|training-paths))(.*(?:-a|--algorithm) (?:spc|lvc)bpt\b)", r"\1 --set training-paths=2000",
     "also where it is the default"),
    (r"127\.0\.0\.1:50051", "127.0.0.1:${PORT}", "a free port instead of the default"),
    (r"127\.0\.0\.1:9464", "127.0.0.1:${STATUS_PORT}", "the same for the status page"),
    (r"(?<=lightloom-server)(?!.*--(?:listen|help|version))(?= |$)",
     " --listen 127.0.0.1:${PORT} --status 127.0.0.1:${STATUS_PORT}", "the defaults may be somebody else's"),
]
# What no test may run, so that it has to be marked: (pattern, reason).
NEVER = [
    (r"(?:ctest|quickstart\.sh|test\.sh|sanitize\.sh|package\.sh|run\.py)\b", "this builds or tests for minutes"),
    (r"cmake\b", "this configures or builds"),
    (r"(?:xargs\b.*\s)?clang-tidy\S*", "this takes many minutes"),
    (r"(?:sudo|su|apt|apt-get|dpkg|install-deps\.sh|systemctl)\b", "this changes the host"),
    (r"(?:ssh|scp|rsync)\b", "this needs a second host"),
    (r"git (?:add|checkout|commit|merge|push|reset|stash)\b", "this changes the repository"),
    (r"(?:\$EDITOR|vi|vim|nano|emacs)(?!\w)", "this waits for a person"),
]
DAEMON = re.compile(r"^(?:\S*/)?lightloom-(server|worker)\b(?!.*--(?:help|version))")
NOT_RUN = re.compile(r"<!--\s*(not run: \S.*?|not a command)\s*-->")
MACHINE_PATH = re.compile(r"(?<![\w.:/-])/(?:work|root|home|tmp|mnt|media|Users)(?=/|\s|$)")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


class Command:
    def __init__(self, file, line, text):
        self.file, self.line, self.text = file, line, text
        self.daemon = DAEMON.match(text)

    def where(self):
        return f"{self.file}:{self.line}"

    def reduced(self):
        text = self.text
        for pattern, replacement, _ in RULES:
            text = re.sub(pattern, replacement, text)
        return text


def join_lines(file, block):
    """Commands of [(number, line)]: continued lines are joined, and those of a here-document or of an open quote stay together."""
    commands, open_text, begin = [], "", 0
    for number, line in block:
        if not open_text:
            begin = number
        open_text += ("\n" if open_text else "") + line
        if line.endswith("\\") or not is_whole(open_text):
            continue
        if open_text.strip() and not open_text.lstrip().startswith("#"):
            commands.append(Command(file, begin, open_text.replace("\\\n", " ").strip()))
        open_text = ""
    if open_text.strip():
        commands.append(Command(file, begin, open_text.strip()))
    return commands


def is_command(line):
    """Whether a line begins with a program, a word of the shell, or an assignment."""
    line = line.strip()
    if re.match(r"\w+=\S", line):
        return True
    word = re.split(r"[\s;|&]", line)[0]
    if re.match(r"(?:\S*/)?lightloom(?:-\w+)?$", word) or re.match(r"(?:\./)?(?:build|deploy|tests)/\S", word):
        return True
    return bool(shutil.which(word, path=PROGRAMS)) or word in ("export", "for", "cd", "if", "while", "source", "(", "{")


def is_whole(text):
    """Whether the shell would run this, rather than wait for more lines."""
    check = subprocess.run(["bash", "-n"], input=text + "\n", text=True, capture_output=True)
    return check.returncode == 0 and "here-document" not in check.stderr


def parse(file, lines):
    """(commands, notes, faults): what runs, [(line, why it does not run)] of other blocks, and what is wrong with any."""
    commands, notes, faults = [], [], []
    i, note, indent = 0, None, 4  # so far is a block indented; more inside of a list
    while i < len(lines):
        line = lines[i]
        fence = re.match(r"^(\s*)(```+|~~~+)\s*([\w-]*)", line)
        if fence:
            end = i + 1
            while end < len(lines) and not lines[end].strip().startswith(fence.group(2)):
                end += 1
            language = fence.group(3)
            if note:
                notes.append((i + 1, note))
            elif language in ("sh", "bash", "shell", "console"):
                commands += join_lines(file, [(n + 1, lines[n].removeprefix(fence.group(1))) for n in range(i + 1, end)])
            elif not language:
                faults.append(f"{file}:{i + 1}: a fenced block without a name; write ```sh for commands, ```text for others")
            else:
                notes.append((i + 1, language))
            i, note = end + 1, None
            continue
        after_gap = i == 0 or not lines[i - 1].strip() or NOT_RUN.search(lines[i - 1])
        if line.startswith(" " * indent) and line.strip() and after_gap:
            block = []
            while i < len(lines) and (lines[i].startswith(" " * indent) or not lines[i].strip()):
                block.append((i + 1, lines[i][indent:].rstrip()))
                i += 1
            if note:
                notes.append((block[0][0], note))
            elif any(is_command(text) for _, text in block):
                commands += join_lines(file, block)
            else:
                notes.append((block[0][0], "text"))
            note = None
            continue
        if line.startswith("    ") and after_gap and is_command(line):
            faults.append(f"{file}:{i + 1}: these commands belong to the list above; write a line of text between, or a fence")
        if found := NOT_RUN.search(line):
            note = found.group(1)
        elif line.strip():
            note = None
        if item := re.match(r"^\s*(?:[-*+]|\d+[.)])\s+", line):
            indent = len(item.group(0)) + 4
        elif line.strip() and not line.startswith(" "):
            indent = 4
        i += 1
    for command in commands:
        faults += [f"{command.where()}: {why}; mark the block with <!-- not run: ... -->" for pattern, why in NEVER
                   if re.search(r"(?:^|&&\s*|;\s*|\|\s*)(?:\S*/)?" + pattern, command.text)]
    return commands, notes, faults


def tracked(root):
    """The files of the tree as they are now; without git, all that are not built."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=root,
                            capture_output=True, text=True)
    if listed.returncode == 0:
        return [f for f in listed.stdout.split("\0") if f and os.path.isfile(os.path.join(root, f))]
    found = []
    for directory, folders, files in os.walk(root):
        folders[:] = [f for f in folders if f not in ("build", ".git")]
        found += [os.path.relpath(os.path.join(directory, f), root) for f in files]
    return found


def check_text(root, file, lines, files):
    faults = []
    text = "\n".join(lines)
    if file == FRONT_PAGE and (words := len(text.split())) > FRONT_PAGE_WORDS:
        faults.append(f"{file}: {words} words; the front page has {FRONT_PAGE_WORDS} at most")
    known = set(files)
    folders = {os.path.dirname(f) for f in files}
    for number, line in enumerate(lines, 1):
        if found := MACHINE_PATH.search(line):
            faults.append(f"{file}:{number}: {found.group(0)} is a path of one machine")
    for link in LINK.finditer(text):
        target = link.group(1)
        path, _, anchor = target.partition("#")
        if re.match(r"^[a-z]+:", target):
            continue
        where = f"{file}:{text.count(chr(10), 0, link.start()) + 1}"
        place = os.path.normpath(os.path.join(os.path.dirname(file), path)) if path else file
        if place not in known and place not in folders:
            faults.append(f"{where}: the link {target} leads nowhere")
        elif anchor and place.endswith(".md") and anchor not in anchors(root, place):
            faults.append(f"{where}: {place} has no heading #{anchor}")
    return faults


def anchors(root, file):
    """Of the headings, as GitHub makes them."""
    found = set()
    for line in open(os.path.join(root, file), encoding="utf-8"):
        if heading := re.match(r"^#+\s+(.*)", line):
            found.add(re.sub(r"[^\w\- ]", "", heading.group(1).strip().lower()).replace(" ", "-"))
    return found


def free_ports():
    sockets = [socket.socket() for _ in range(2)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


PRELUDE = r"""
daemons=()
stop_daemons() {
    local i pid
    # Workers first: they give back what they hold to a coordinator that still listens.
    for ((i = ${#daemons[@]} - 1; i >= 0; --i)); do
        pid=${daemons[i]}
        kill "$pid" 2>/dev/null
        wait "$pid" || { echo "@fault $? from the background"; cat "$LOGS/$pid" >&2; }
    done
    daemons=()
}
trap stop_daemons EXIT
wait_for_server() {
    for _ in $(seq 200); do
        (exec 3<>"/dev/tcp/127.0.0.1/$PORT") 2>/dev/null && return 0
        kill -0 "$1" 2>/dev/null || return 1
        sleep 0.05
    done
    return 1
}
"""


def script_of(commands):
    out = [PRELUDE]
    for index, command in enumerate(commands):
        text = command.reduced()
        out.append(f"echo '@run {index} '$EPOCHREALTIME")
        if command.daemon:
            text = re.sub(r"&?\s*(#.*)?$", "", text)
            out.append(f"{text} >\"$LOGS/new\" 2>&1 &")
            out.append('daemons+=($!); mv "$LOGS/new" "$LOGS/$!"')
            out.append("wait_for_server $!" if command.daemon.group(1) == "server" else "sleep 0.1; kill -0 $!")
        else:
            out.append(text)
        out.append("code=$?; echo; echo \"@code $code $EPOCHREALTIME\"; [ $code = 0 ] || exit 1")
    return "\n".join(out) + "\n"


def run_readme(file, commands, tree):
    """Faults of its commands, run in one shell."""
    port, status_port = free_ports()
    logs = os.path.join(tree, "..", "logs-" + file.replace("/", "-"))
    home = os.path.join(tree, "..", "home")
    os.makedirs(logs), os.makedirs(home, exist_ok=True)
    path = os.path.join(tree, "build/release/bin") + ":" + os.environ["PATH"]
    environment = dict(os.environ, PORT=str(port), STATUS_PORT=str(status_port), LOGS=logs, HOME=home, PATH=path,
                       LIGHTLOOM_SERVER=f"127.0.0.1:{port}")
    environment.pop("XDG_CACHE_HOME", None)
    out_path = os.path.join(logs, "out")
    with open(out_path, "wb") as out:
        # A session of its own, so that nothing that a README started outlives it.
        shell = subprocess.Popen(["bash", "-c", worker_fix(script_of(commands))], cwd=tree, env=environment,
                                 stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
        try:
            shell.wait(TIMEOUT)
            timed_out = False
        except subprocess.TimeoutExpired:
            timed_out = True
        try:
            os.killpg(shell.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass  # nothing is left of it, as it should be
        shell.wait()
    return report(file, commands, open(out_path, errors="replace").read(), timed_out)


def worker_fix(script):
    """A worker's default coordinator is the port that the rules gave the coordinator."""
    return re.sub(r"(lightloom-worker)(?= (?!.*--server).*>\"\$LOGS)", r"\1 --server 127.0.0.1:${PORT}", script)


def report(file, commands, output, timed_out):
    """Faults of what the shell printed, and a line with its seconds for every command that ran."""
    faults, current, begin, said, done = [], None, 0.0, [], 0
    for line in output.split("\n"):
        mark, *values = line.split(" ") if line.startswith("@") else ("", )
        if mark == "@run":
            current, begin, said = commands[int(values[0])], float(values[1].replace(",", ".")), []
        elif mark == "@code":
            done += 1
            seconds = float(values[1].replace(",", ".")) - begin
            print(f"  {current.where():28} {seconds:5.1f} s  {current.reduced()[:140]}")
            if values[0] != "0":
                faults.append(f"{current.where()}: exit code {values[0]}: {current.reduced()}" + quoted(said))
        elif mark == "@fault":
            faults.append(f"{file}: a program ended with exit code {' '.join(values)}" + quoted(output.split("\n")))
        else:
            said.append(line)
    if timed_out:
        faults.append(f"{current.where() if current else file}: not done after {TIMEOUT} s" + quoted(said))
    elif done < len(commands) and not faults:
        faults.append(f"{file}: the shell ended after {done} of {len(commands)} commands" + quoted(said))
    return faults


def quoted(lines):
    return "".join("\n    " + line for line in [line for line in lines if line.strip()][-15:])


def copy_tree(root, files, binaries, target):
    for file in files:
        os.makedirs(os.path.dirname(os.path.join(target, file)), exist_ok=True)
        shutil.copy2(os.path.join(root, file), os.path.join(target, file), follow_symlinks=False)
    subprocess.run("git init -q . && git add -A", cwd=target, shell=True, capture_output=True)  # for `git ls-files` and its like
    os.makedirs(os.path.join(target, "build/release"))
    os.symlink(binaries, os.path.join(target, "build/release/bin"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", help="READMEs, relative to the top of the tree (default: all)")
    parser.add_argument("--bin", default=os.path.join(ROOT, "build/release/bin"), help="directory of the programs")
    parser.add_argument("--list", action="store_true", help="print the commands instead of running them")
    parser.add_argument("--clone", action="store_true", help="clone the last commit and build it with deploy/quickstart.sh first")
    arguments = parser.parse_args()
    global PROGRAMS
    PROGRAMS += ":" + arguments.bin
    files = tracked(ROOT)
    readmes = arguments.files or sorted((f for f in files if os.path.basename(f) == "README.md"), key=lambda f: (f.count("/"), f))
    faults, plans = [], []
    for file in readmes:
        lines = open(os.path.join(ROOT, file), encoding="utf-8").read().split("\n")
        commands, notes, wrong = parse(file, lines)
        faults += wrong + check_text(ROOT, file, lines, files)
        plans.append((file, [] if wrong else commands, notes))
        if arguments.list:
            for command in commands:
                print(f"{command.where():28} {command.reduced()}")
            for line, why in notes:
                print(f"{file}:{line}: {why}")
    if not arguments.list:
        with tempfile.TemporaryDirectory(prefix="lightloom-readme-") as scratch:
            clone = os.path.join(scratch, "clone")
            if arguments.clone:
                subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
                subprocess.run(["deploy/quickstart.sh"], cwd=clone, check=True)
                # Of the tests, which the quick start leaves out, READMEs run a few.
                subprocess.run("cmake --preset release && cmake --build --preset release", cwd=clone, shell=True, check=True)
            for number, (file, commands, notes) in enumerate(plans):
                begin = time.time()
                print(f"{file}: {len(commands)} commands, {len(notes)} other blocks")
                if not commands:
                    continue
                tree = clone if arguments.clone else os.path.join(scratch, str(number), "lightloom")
                if not arguments.clone:
                    copy_tree(ROOT, files, os.path.abspath(arguments.bin), tree)
                faults += run_readme(file, commands, tree)
                print(f"  {time.time() - begin:.1f} s")
    for fault in faults:
        print("readme: " + fault, file=sys.stderr)
    print(f"readme: {len(faults)} fault(s) in {len(readmes)} README(s)")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
