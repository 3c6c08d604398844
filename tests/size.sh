#!/bin/sh
# How large the product is, room by room, against tests/size.tsv: nothing there grows, and what has shrunk is written down (--write)
# with the change that made it smaller, so that it stays so. A commit that has to raise a number edits the table and says why.
#
#   size.sh           compares, and prints the table with what differs
#   size.sh --write   lowers the table to what there is; raises nothing
#
# A room is a folder of src. Counted are its lines (.c, .h and .def), public functions and tables (what its headers declare,
# src/symbols.awk), and named numbers (NAME = 3.5 in capitals: thresholds, limits, sizes, constants). Keywords are rows of the
# keyword tables, facts rows of the table of facts, cards those of them that a header holds by default.
set -u
LC_ALL=C
export LC_ALL
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
table=$top/tests/size.tsv
cd "$top/src" || exit 2
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-size-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
trap 'exit 2' INT TERM HUP

files() {
    find "$1" -type f \( -name '*.c' -o -name '*.h' -o -name '*.def' \)
}

# shellcheck disable=SC2046 # names of our own, without spaces
for room in */; do
    room=${room%/}
    printf '%s\tlines\t%d\n' "$room" "$(cat $(files "$room") | wc -l)"
    printf '%s\tpublic\t%d\n' "$room" "$(find "$room" -name '*.h' -exec cat {} + | awk -f symbols.awk | wc -l)"
    printf '%s\tnumbers\t%d\n' "$room" "$(find "$room" -name '*.[ch]' -exec cat {} + |
        tr '\n' ' ' | grep -oE '\b[A-Z][A-Z0-9_]*(\[[^]]*\])? = [-({]?[0-9.]' | wc -l)"
done >"$scratch/rooms"
# shellcheck disable=SC2046
{
    awk -F '\t' '{ sum[$2] += $3 } END { for (kind in sum) printf "all\t%s\t%d\n", kind, sum[kind] }' "$scratch/rooms"
    cat "$scratch/rooms"
    printf 'all\tkeywords\t%d\n' "$(grep -hE '^ *(KEY|KEYWORD)\(' config/*.def | wc -l)"
    printf 'all\tcards\t%d\n' "$(grep -cE '^FACT\(.* HEADER, ' data/facts.def)"
    printf 'all\tfacts\t%d\n' "$(grep -cE '^(FACT|ESTIMATE)\(' data/facts.def)"
} | sort >"$scratch/now"

# A room that is not in the table has no place in it: it is written there by hand.
awk -F '\t' -v OFS='\t' '
    NR == FNR { now[$1 OFS $2] = $3; next }
    /^#/ { next }
    { key = $1 OFS $2; have = key in now ? now[key] : 0; seen[key] = 1
      if (have != $3) print $1, $2, $3, have }
    END { for (key in now) if (!(key in seen) && now[key] > 0) print key, 0, now[key] }' "$scratch/now" "$table" | sort >"$scratch/differs"

if [ "${1-}" = --write ]; then
    awk -F '\t' -v OFS='\t' '
        NR == FNR { now[$1 OFS $2] = $3; next }
        /^#/ { print; next }
        { key = $1 OFS $2; have = key in now ? now[key] : 0
          if (have > 0) print $1, $2, (have < $3 ? have : $3) }' "$scratch/now" "$table" >"$scratch/table" && cp "$scratch/table" "$table"
fi

grew=$(awk -F '\t' '$4 > $3' "$scratch/differs" | wc -l) shrank=$(awk -F '\t' '$4 < $3' "$scratch/differs" | wc -l)
if [ -s "$scratch/differs" ]; then
    echo 'room, what, in tests/size.tsv, now:'
    cat "$scratch/differs"
fi
[ "$grew" -eq 0 ] || echo "size.sh: $grew numbers grew: make the change smaller, or raise them in tests/size.tsv and say why in the commit"
[ "$shrank" -eq 0 ] || [ "${1-}" = --write ] || echo "size.sh: $shrank numbers shrank: tests/size.sh --write, so that they stay so"
[ "$grew" -eq 0 ] && { [ "$shrank" -eq 0 ] || [ "${1-}" = --write ]; } && echo '1 passed, 0 failed, 0 skipped' && exit 0
echo '0 passed, 1 failed, 0 skipped'
exit 1
