#!/bin/sh
# Every test that PROMISES.md names is there, and every promise names one.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
page=$top/PROMISES.md
failed=0 named=0
scratch=$(mktemp) || exit 2
trap 'rm -f "$scratch"' EXIT

# `FILE: "WORDS"`: FILE exists and holds WORDS as a title; in a unit test as a function that is run.
grep -o '`tests/[^`]*: "[^"`]*"`' "$page" | tr -d '`' >"$scratch"
while IFS= read -r line; do
    file=${line%%: \"*} words=${line#*: \"}
    words=${words%\"}
    named=$((named + 1))
    case $file in
    *.c) pattern="cmocka_unit_test[a-z_]*\\(${words}[,)]" ;;
    *) pattern=$(printf '%s' "$words" | sed 's/[][\.*^$+?(){}|]/\\&/g') ;;
    esac
    [ -f "$top/$file" ] && grep -Eq -- "$pattern" "$top/$file" && continue
    failed=$((failed + 1))
    echo "FAILED: PROMISES.md names $file: \"$words\", which is not there"
done <"$scratch"

# A promise is a row of the table, its tests stand in the same row; a row of bold words alone is a heading.
awk '/^\| / && !/^\| (---|promise|\*\*[A-Za-z ]*\*\* \|)/ && !/`tests\//' "$page" >"$scratch"
while IFS= read -r item; do
    failed=$((failed + 1))
    echo "FAILED: no test is named for: $item"
done <"$scratch"
[ "$named" -gt 0 ] || { echo 'PROMISES.md names no test'; exit 2; }
echo "$((named > failed ? named - failed : 0)) passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
