#!/bin/sh
# No function is defined twice: once inline in a header, and once more, perhaps otherwise, in a source file. Which of them a caller
# gets would depend on what the compiler inlines, and the same sources would compute two kinds of light. Least is inlined in the
# builds with sanitizers, so that these see most.
# Usage: one_definition.sh ARCHIVE...
set -eu
for archive in "$@"; do
    [ -f "$archive" ] || { echo "$archive does not exist"; exit 1; }
done
symbols=$(nm "$@")
[ -n "$symbols" ] || { echo "nm shows no symbol"; exit 1; }
twice=$(printf '%s\n' "$symbols" | awk 'NF == 3 && ($2 == "T" || $2 == "W") { print $2, $3 }' | sort -u |
        awk '{ kinds[$2] = kinds[$2] $1 } END { for (name in kinds) if (kinds[name] ~ /T/ && kinds[name] ~ /W/) print name }' |
        c++filt | sort)
if [ -n "$twice" ]; then
    printf 'defined both inline and in a source file:\n%s\n' "$twice"
    exit 1
fi
