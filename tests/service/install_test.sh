#!/usr/bin/env bash
# What is installed works: the installed program renders, every command has a manual page, bash and zsh complete exactly the options
# that help shows, and the Debian package holds the installed files and names the libraries that it needs.
# Usage: install_test.sh SOURCE_DIR BUILD_DIR
set -euo pipefail

source=$1 build=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
    echo "install_test: $*" >&2
    exit 1
}

prefix=$work/root/usr
cmake --install "$build" --prefix "$prefix" >"$work/install.log" 2>&1 || { cat "$work/install.log"; fail "cmake --install failed"; }
export PATH="$prefix/bin:$PATH"
programs="lightloom lightloom-server lightloom-worker"
for program in $programs; do
    [ "$(command -v "$program")" = "$prefix/bin/$program" ] || fail "$program is not installed"
    "$program" --help >/dev/null || fail "$program does not start"
done
lightloom render "$source/tests/scenes/furnace-sphere.pbrt" --resolution 16x16 --spp 1 -q -o "$work/image.exr"
[ -s "$work/image.exr" ] || fail "no image"

# The names of options, one to a line, as help shows them.
shown() { "$@" --help | sed -n 's/^  \(-[^ ]*\).*/\1/p' | tr , '\n' | sort; }
bash_offers() {
    bash -c '
        source "$1"
        shift
        COMP_WORDS=("$@" -) COMP_CWORD=$#
        "_$1" "$1" - "${!#}"
        printf "%s\n" "${COMPREPLY[@]}"' - "$prefix/share/bash-completion/completions/$1" "$@" | sort
}
zsh_offers() { # the specifications of the command or, without one, of the program
    sed -n "/^ *_arguments/,/[^\\\\]$/p" <<<"$(if [ $# -gt 1 ]; then sed -n "/^ *$2)$/,/;;$/p" "$zsh/_$1"; else sed '/case \$state/q' "$zsh/_$1"; fi)" |
        sed -n "s/^ *'\(([^)]*)\|\*\)\(-[A-Za-z0-9-]*\).*/\2/p" | sort
}
same() { # WHAT EXPECTED OFFERED
    [ "$2" = "$3" ] || { diff <(echo "$2") <(echo "$3") >&2; fail "$1 differs from help"; }
}
commands=$(lightloom --help | sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\+\).*/\1/p')
[ "$(wc -w <<<"$commands")" -ge 12 ] || fail "help lists few commands: $commands"
zsh=$prefix/share/zsh/site-functions
[ -d "$zsh" ] || zsh=$prefix/share/zsh/vendor-completions
check_options() {
    same "bash's completion of $*" "$(shown "$@")" "$(bash_offers "$@")"
    same "zsh's completion of $*" "$(shown "$@")" "$(zsh_offers "$@")"
}
for program in $programs; do
    check_options "$program"
    if command -v zsh >/dev/null; then zsh -n "$zsh/_$program" || fail "zsh does not read _$program"; fi
done
for command in $commands; do check_options lightloom "$command"; done
same "bash's list of commands" "$(sort <<<"$commands")" \
    "$(bash -c "source $prefix/share/bash-completion/completions/lightloom
        COMP_WORDS=(lightloom '') COMP_CWORD=1; _lightloom lightloom '' lightloom; printf '%s\n' \"\${COMPREPLY[@]}\"" | sort)"
same "zsh's list of commands" "$(sort <<<"$commands")" "$(sed -n "/commands=(/,/_describe/s/^ *'\([a-z]*\):.*/\1/p" "$zsh/_lightloom" | sort)"

if command -v help2man >/dev/null; then
    for page in $programs $(printf 'lightloom-%s ' $commands); do
        gzip -dc "$prefix/share/man/man1/$page.1.gz" | grep -q '^\.SH SYNOPSIS' || fail "no manual page $page"
    done
fi

if ! command -v dpkg-shlibdeps >/dev/null; then
    echo "no dpkg-dev here: the package is not tested"
    exit 0
fi
(cd "$build" && cpack -G DEB -B "$work/package") >"$work/cpack.log" 2>&1 || { cat "$work/cpack.log"; fail "cpack failed"; }
package=$(echo "$work"/package/lightloom_*.deb)
same "the package's list of files" "$(cd "$work/root" && find . -type f | sort)" \
    "$(dpkg-deb --fsys-tarfile "$package" | tar -t | grep -v '/$' | sort)"
for library in libembree3 libopenexr libgrpc++ libtbb; do
    dpkg-deb -f "$package" Depends | grep -q "$library" || fail "the package does not depend on $library"
done
