#!/bin/sh
# The build id covers every source that computes light, and the test of the math symbols every library that does: both take their
# lists from what the build links, and this looks at the object files instead. From the objects of what renders and of what reads
# scenes it follows undefined symbols to the objects that define them, through all of our libraries.
# Usage: light_sources.sh SOURCE_DIR BUILD_DIR START_ARCHIVE... -- LIGHT_ARCHIVE... -- ALL_ARCHIVE...
set -eu
sources=$1 build=$2
shift 2
list=$build/common/work/light_sources.txt
[ -s "$list" ] || { echo "$list is missing or empty"; exit 1; }
starts='' light='' all='' part=starts
for argument in "$@"; do
    case $argument in
    --) if [ $part = starts ]; then part=light; else part=all; fi ;;
    *)
        [ -f "$argument" ] || { echo "$argument does not exist"; exit 1; }
        eval "$part=\"\$$part\$argument
\""
        ;;
    esac
done

# ARCHIVE:OBJECT of everything that light needs.
reached=$(printf '%s' "$all" | while read -r archive; do nm -A "$archive"; done 2>/dev/null | STARTS=$starts awk '
    # archive:object:address type symbol, or archive:object: U symbol
    {
        split($1, place, ":")
        object = place[1] ":" place[2]
        type = $(NF - 1); symbol = $NF
        if (type == "U") needs[object] = needs[object] " " symbol
        else if (type ~ /^[TDBRSG]$/) definer[symbol] = object
        objects[object] = place[1]
    }
    END {
        count = split(ENVIRON["STARTS"], list, "\n")
        for (i = 1; i <= count; ++i) start[list[i]] = 1
        for (object in objects) if (objects[object] in start) { reached[object] = 1; queue[++last] = object }
        for (next_one = 1; next_one <= last; ++next_one) {
            count = split(needs[queue[next_one]], symbols, " ")
            for (i = 1; i <= count; ++i) {
                if (!(symbols[i] in definer)) continue
                object = definer[symbols[i]]
                if (!(object in reached)) { reached[object] = 1; queue[++last] = object }
            }
        }
        for (object in reached) print object
    }' | sort)
[ "$(printf '%s\n' "$reached" | wc -l)" -gt 20 ] || { echo "nm shows hardly any objects"; exit 1; }

bad=0
for object in $reached; do
    archive=${object%%:*} member=${object#*:}
    folder=${archive#"$build"/}
    source=${folder%/*}/${member%.o}
    if ! grep -q -x "$source" "$list"; then
        echo "$source computes light, but the build id does not cover it"
        bad=1
    fi
    if ! printf '%s' "$light" | grep -q -x "$archive"; then
        echo "$archive computes light, but nothing looks at its math symbols"
        bad=1
    fi
done
# The other way round: all that a covered source includes is covered.
while read -r source; do
    for header in $(sed -n 's/^#include "\(common\/[^"]*\)".*/\1/p' "$sources/$source"); do
        grep -q -x "$header" "$list" && continue
        echo "$source includes $header, but the build id does not cover it"
        bad=1
    done
done <"$list"
exit $bad
