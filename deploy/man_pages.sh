#!/usr/bin/env bash
# Writes the manual pages of the three programs, one for each command of `lightloom` included, from what their --help prints.
# Needs help2man.
#
#   deploy/man_pages.sh BIN OUT        programs in BIN, pages to OUT
set -euo pipefail

bin=$(cd "$1" && pwd)
mkdir -p "$2"
out=$(cd "$2" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# Defaults that depend on who asks are shown as anybody's.
export HOME='~'
unset XDG_CACHE_HOME LIGHTLOOM_TABLE_CACHE LIGHTLOOM_SERVER

# help2man keeps the lines of an example apart only where a prompt stands before them, and knows no lines that go on.
for program in lightloom lightloom-server lightloom-worker; do
    cat >"$work/$program" <<SCRIPT
#!/bin/sh
'$bin/$program' "\$@" | awk '
    example && /^    +-/ { sub(/^ +/, ""); sub(/ \\\\\$/, "", line); line = line " " \$0; next }
    example { print line; example = 0 }
    /^  lightloom[^ ]* / && substr(\$0, 3) !~ /  / { line = "  \$ " substr(\$0, 3); example = 1; next }
    { print }
    END { if (example) print line }'
SCRIPT
    chmod +x "$work/$program"
done
export PATH="$work:$PATH"
version=$("$bin/lightloom" --version)  # 0.1.0+DIGEST, perhaps behind the name
version=${version##* }

# page NAME COMMAND SEE_ALSO...
page() {
    local name=$1 command=$2 text
    shift 2
    {
        printf '[SEE ALSO]\n'
        printf '.BR %s (1),\n' "$@" | sed '$s/,$//'
    } >"$work/also"
    text=$($command --help)
    text=${text%%$'\n'*}
    help2man --no-info --section=1 --version-string="${version%%+*}" --name="${text%.}" --include="$work/also" "$command" |
        sed -e "s/^\.TH [^ ]*/.TH ${name^^}/" -e "s/^$command \\\\- /$name \\\\- /" |
        gzip -9n >"$out/$name.1.gz"
}

commands=$("$bin/lightloom" --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\+\).*/\1/p')
page lightloom lightloom lightloom-server lightloom-worker $(printf 'lightloom-%s ' $commands)
page lightloom-server lightloom-server lightloom lightloom-worker
page lightloom-worker lightloom-worker lightloom lightloom-server
for command in $commands; do
    page "lightloom-$command" "lightloom $command" lightloom
done
