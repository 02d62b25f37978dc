#!/bin/sh
# Libraries that compute light must not call libm functions whose implementation glibc picks by CPU: their last bits differ
# from host to host, and a merged image must not depend on which worker rendered which unit.
# Usage: light_math_symbols.sh ARCHIVE...
set -eu
functions='sin cos tan sincos asin acos atan atan2 sinh cosh tanh asinh acosh atanh exp exp2 exp10 expm1 log log2 log10 log1p
pow cbrt hypot erf erfc tgamma lgamma fma'
pattern=''
for f in $functions; do pattern="$pattern|$f|${f}f|${f}l|__${f}_finite|__${f}f_finite"; done
bad=0
for archive in "$@"; do
    [ -f "$archive" ] || { echo "$archive does not exist"; exit 1; }
    found=$(nm -u "$archive" | awk '{ sub(/@.*/, "", $2); print $2 }' | grep -E -x "${pattern#|}" | sort -u | tr '\n' ' ' || true)
    if [ -n "$found" ]; then
        echo "$archive calls $found- use common/core/math.h instead"
        bad=1
    fi
done
exit $bad
