#!/bin/sh
# The keyword and column lists of rextract.conf(5) are those of the tables, and mandoc has nothing to say
# about the pages. `check-man.sh --write` brings the page up to date.
set -u
top=${srcdir:-$(dirname "$0")/..}
build=${RX_BUILD_DIR:-$top}
page=$top/man/rextract.conf.5
make_man=$build/man/make_man
scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT
passed=0 failed=0 skipped=0

if ! "$make_man" keywords >"$scratch/keywords" || ! "$make_man" columns >"$scratch/columns"; then
    echo "$make_man cannot be run"
    exit 2
fi
awk -v folder="$scratch" '
    /^\.\\" end of / { inside = 0 }
    !inside { print }
    /^\.\\" made from the table of / {
        inside = 1
        file = folder "/" $NF
        while ((getline line < file) > 0) print line
    }' "$page" >"$scratch/page"

if [ "${1-}" = --write ]; then
    cp "$scratch/page" "$page"
    exit
fi
if diff -u "$page" "$scratch/page"; then
    passed=1
else
    echo "man/rextract.conf.5 is not what the tables say; run man/check-man.sh --write"
    failed=1
fi
for name in rextract.1 rextract.conf.5; do
    if ! command -v mandoc >/dev/null; then
        skipped=$((skipped + 1))
        continue
    fi
    # A page without a date is meant: it is the same in every build.
    mandoc -T lint -W warning "$top/man/$name" | grep -v 'missing date' >"$scratch/lint"
    cat "$scratch/lint"
    if [ -s "$scratch/lint" ]; then
        failed=$((failed + 1))
    else
        passed=$((passed + 1))
    fi
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
