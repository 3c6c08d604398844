#!/bin/sh
# librextract.so exports what its installed headers declare, as the compiler reads them, and nothing else.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
build=${RX_BUILD_DIR:-$top}
library=$build/.libs/librextract.so
scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT
skip() {
    echo "$1"
    echo '0 passed, 0 failed, 1 skipped'
    exit 77
}

[ -e "$library" ] || skip 'no shared library was built'
command -v nm >/dev/null || skip 'no nm'
cc=$(sed -n 's/^CC = //p' "$build/Makefile" | head -n 1)
cd "$top" || exit 2
cat src/*/local.mk | sed -e ':more' -e '/\\$/{N;s/\\\n//;b more' -e '}' | sed -n 's/^rx_[a-z]*_HEADERS *= *//p' |
    tr -s ' \t' '\n\n' | sed -n 's,^src/\(.*\.h\)$,#include "\1",p' >"$scratch/all.c"
# gcc tells the prototypes that it has seen, each with its file.
# shellcheck disable=SC2086 # a compiler and its flags
$cc -std=c11 -Isrc -fsyntax-only -aux-info "$scratch/seen" "$scratch/all.c" 2>/dev/null || skip "$cc has no -aux-info"
sed -n 's,^/\* src/[^*]*\*/ extern [^(]*[ *]\(rx_[A-Za-z0-9_]*\) (.*,\1,p' "$scratch/seen" | LC_ALL=C sort -u >"$scratch/declared"
nm -D --defined-only "$library" | awk '{ print $NF }' | LC_ALL=C sort -u >"$scratch/exported"

failed=0
LC_ALL=C comm -23 "$scratch/declared" "$scratch/exported" | sed 's/$/ is declared in an installed header and not exported/' >"$scratch/wrong"
LC_ALL=C comm -13 "$scratch/declared" "$scratch/exported" | sed 's/$/ is exported and in no installed header/' >>"$scratch/wrong"
grep -o 'rx_[a-z_0-9]*()' man/rextract.3 | sed 's/()$//' | LC_ALL=C sort -u | LC_ALL=C comm -23 - "$scratch/declared" |
    sed 's/$/ is in rextract(3) and in no installed header/' >>"$scratch/wrong"
# In C++ a function outside of RX_BEGIN_DECLS .. RX_END_DECLS is another one.
sed 's,#include "\(.*\)",src/\1,' "$scratch/all.c" | while read -r header; do
    [ "$header" = src/base/extern.h ] || awk '/^RX_BEGIN_DECLS$/ { begun = FNR } /^RX_END_DECLS$/ { ended = FNR }
        /^#include/ { included = FNR }
        END { if (!begun || ended < begun || included > begun)
                  print FILENAME ": RX_BEGIN_DECLS .. RX_END_DECLS do not hold its declarations" }' "$header"
done >>"$scratch/wrong"
head -n 20 "$scratch/wrong"
declared=$(wc -l <"$scratch/declared")
[ "$declared" -gt 0 ] || { echo 'no function was found in the headers'; exit 2; }
[ -s "$scratch/wrong" ] && failed=1
echo "$declared functions are declared"
echo "$((1 - failed)) passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
