#!/usr/bin/env python3
"""Checks the READMEs: runs every command in them on a clean copy of the tree, and checks length, links and paths.

    tests/readme/run.py                       all READMEs, with the programs of build/release/bin
    tests/readme/run.py client/README.md      one of them
    tests/readme/run.py --list                what would run, as it would run
    tests/readme/run.py --clone               on a clone that deploy/quickstart.sh has built (takes minutes)

A command is a line of a block that is fenced by ```sh, or of an indented block in which some line begins with a program, a word of
the shell or an assignment. Other indented blocks (a formula, a drawing) and blocks fenced with another name hold none; --list shows
them. A line that ends with a backslash goes on with the next one. The commands of one README run in one shell, in its order, from
the top of the tree, and each must succeed. A coordinator or worker is started in the background and stopped when the README ends.
An HTML comment before a block keeps the block from being run, and says why:

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
    (r"--time (?:\d{2,}|[2-9])\b", "--time 1", "a time limit is a second at most"),
    (r"--cross-time \d+", "--cross-time 1", "the same for a cross-check"),
    (r"--spp (?:\d{2,}|[3-9])\b", "--spp 2", "two samples per pixel at most"),
    (r"--seeds \d+", "--seeds 1", "one run of each algorithm"),
    (r"(?<=--resolution )320x180\b", "80x45", "a smaller picture"),
    (r"(?<=--resolution )160x90\b", "32x18", "a smaller picture"),
    (r"^(?!.*--(?:spp|time|pyramid|help)\b)((?:.*[( ])?(?:\S+/)?lightloom (?:render|submit)\b)", r"\1 --spp 2", "not the scene's own 64 samples per pixel"),
    (r"^(?!.*(?:--time|training-paths))(.*(?:-a|--algorithm) (?:spc|lvc)bpt\b)", r"\1 --set training-paths=2000", "a small training set"),
    (r"127\.0\.0\.1:50051", "127.0.0.1:${PORT}", "a free port instead of the default"),
    (r"127\.0\.0\.1:9464", "127.0.0.1:${STATUS_PORT}", "the same for the status page"),
    (r"(?<=lightloom-server)(?!.*--(?:listen|help|version))(?= |$)", " --listen 127.0.0.1:${PORT} --status 127.0.0.1:${STATUS_PORT}",
     "the defaults may be taken by somebody else's coordinator"),
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
    """Commands of [(number, line)]: continued lines are joined, and lines of a here-document or of an open quote stay together."""
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
    commands, marked, faults = [], [], []
    i, note, in_list = 0, None, False
    while i < len(lines):
        line = lines[i]
        fence = re.match(r"^(\s*)(```+|~~~+)\s*([\w-]*)", line)
        if fence:
            end = i + 1
            while end < len(lines) and not lines[end].strip().startswith(fence.group(2)):
                end += 1
            language = fence.group(3)
            block = [(n + 1, lines[n].removeprefix(fence.group(1))) for n in range(i + 1, end)]
            if note:
                marked.append((i + 1, note))
            elif language in ("sh", "bash", "shell", "console"):
                commands += join_lines(file, block)
            elif not language:
                faults.append(f"{file}:{i + 1}: a fenced block without a name; write ```sh for commands, ```text for others")
            i, note = end + 1, None
            continue
        blank_before = i == 0 or not lines[i - 1].strip() or NOT_RUN.search(lines[i - 1])
        if line.startswith("    ") and line.strip() and blank_before and not in_list:
            block = []
            while i < len(lines) and (lines[i].startswith("    ") or not lines[i].strip()):
                block.append((i + 1, lines[i][4:].rstrip()))
                i += 1
            if note:
                marked.append((block[0][0], note))
            elif any(is_command(text) for _, text in block):
                commands += join_lines(file, block)
            else:
                marked.append((block[0][0], "text"))
            note = None
            continue
        if in_list and line.startswith("    ") and blank_before and is_command(line):
            faults.append(f"{file}:{i + 1}: these commands belong to the list above them; write a line of text between, or a fence")
        found = NOT_RUN.search(line)
        if found:
            note = found.group(1)
        elif line.strip():
            note = None
        if re.match(r"^\s{0,3}(?:[-*+]|\d+[.)])\s", line):
            in_list = True
        elif line.strip() and not line.startswith(" "):
            in_list = False
        i += 1
    return commands, marked, faults


def tracked(root):
    """The files of the tree as they are now; without git, all that are not built."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=root, capture_output=True, text=True)
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
        for target in LINK.findall(line):
            path, _, anchor = target.partition("#")
            if re.match(r"^[a-z]+:", target):
                continue
            place = os.path.normpath(os.path.join(os.path.dirname(file), path)) if path else file
            if place not in known and place not in folders:
                faults.append(f"{file}:{number}: the link {target} leads nowhere")
            elif anchor and place.endswith(".md") and anchor not in anchors(root, place):
                faults.append(f"{file}:{number}: {place} has no heading #{anchor}")
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
        out.append("code=$?; echo \"@code $code\"; [ $code = 0 ] || exit 1")
    return "\n".join(out) + "\n"


def run_readme(file, commands, tree):
    """Faults. Prints each command with its seconds."""
    port, status_port = free_ports()
    logs = os.path.join(tree, "..", "logs-" + file.replace("/", "-"))
    home = os.path.join(tree, "..", "home")
    os.makedirs(logs), os.makedirs(home, exist_ok=True)
    environment = dict(os.environ, PORT=str(port), STATUS_PORT=str(status_port), LOGS=logs, HOME=home,
                       LIGHTLOOM_SERVER=f"127.0.0.1:{port}", PATH=os.path.join(tree, "build/release/bin") + ":" + os.environ["PATH"])
    environment.pop("XDG_CACHE_HOME", None)
    out_path = os.path.join(logs, "out")
    with open(out_path, "wb") as out:
        # A session of its own, so that nothing that a README started outlives it.
        shell = subprocess.Popen(["bash", "-c", worker_fix(script_of(commands))], cwd=tree, env=environment, stdin=subprocess.DEVNULL,
                                 stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
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
    faults, current, begin, said, codes = [], None, 0.0, [], {}
    for line in output.split("\n"):
        if started := re.match(r"@run (\d+) ([\d.,]+)", line):
            now = float(started.group(2).replace(",", "."))
            current, begin, said = int(started.group(1)), now, []
        elif line.startswith("@code ") and current is not None:
            codes[current] = int(line[6:])
            print(f"  {commands[current].where():28} {commands[current].reduced()[:150]}")
            if codes[current] != 0:
                faults.append(f"{commands[current].where()}: exit code {codes[current]}: {commands[current].reduced()}\n    " +
                              "\n    ".join(said[-15:]))
        elif line.startswith("@fault"):
            faults.append(f"{file}: a program ended with exit code {line[7:]}\n    " + "\n    ".join(output.split("\n")[-12:]))
        else:
            said.append(line)
    if timed_out:
        where = commands[current].where() if current is not None else file
        faults.append(f"{where}: not done after {TIMEOUT} s\n    " + "\n    ".join(said[-15:]))
    elif len(codes) < len(commands) and not faults:
        faults.append(f"{file}: the shell ended after {len(codes)} of {len(commands)} commands\n    " + "\n    ".join(said[-15:]))
    return faults


def copy_tree(root, files, binaries, target):
    for file in files:
        os.makedirs(os.path.dirname(os.path.join(target, file)), exist_ok=True)
        shutil.copy2(os.path.join(root, file), os.path.join(target, file), follow_symlinks=False)
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
        commands, marked, wrong = parse(file, lines)
        faults += wrong + check_text(ROOT, file, lines, files)
        plans.append((file, commands, marked))
        if arguments.list:
            for command in commands:
                print(f"{command.where():28} {command.reduced()}")
            for line, why in marked:
                print(f"{file}:{line}: {why}")
    if not arguments.list:
        with tempfile.TemporaryDirectory(prefix="lightloom-readme-") as scratch:
            clone = os.path.join(scratch, "clone")
            if arguments.clone:
                subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
                subprocess.run(["deploy/quickstart.sh"], cwd=clone, check=True)
            for number, (file, commands, marked) in enumerate(plans):
                begin = time.time()
                print(f"{file}: {len(commands)} commands, {len(marked)} marked blocks")
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
