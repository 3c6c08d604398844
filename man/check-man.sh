#!/bin/sh
# The keyword and column lists of the pages are those of the tables, and mandoc has nothing to say about the
# pages. `check-man.sh --write` brings the pages up to date.
set -u
top=${srcdir:-$(dirname "$0")/..}
build=${RX_BUILD_DIR:-$top}
make_man=$build/man/make_man
scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT
passed=0 failed=0 skipped=0

for list in keywords columns facts simulate validate train survey FLAGS FLAGS_WEIGHT FLAGS_WIN FLAGS_MEASURE FLAGS_TEMPLATE FLAGS_RESTORE completion; do
    if ! "$make_man" "$list" >"$scratch/$list"; then
        echo "$make_man cannot be run"
        exit 2
    fi
done

# Examples as roff text.
for example in find.c find.cc; do
    sed -e 's/\\/\\e/g' -e 's/-/\\-/g' -e "s/'/\\\\(aq/g" -e 's/\^/\\(ha/g' -e 's/~/\\(ti/g' -e 's/`/\\(ga/g' -e 's/^\./\\\&./' \
        "$top/tests/examples/$example" >"$scratch/$example"
done

# The page with its lists as the tables have them, and its examples.
fill() {
    awk -v folder="$scratch" '
        /^(\.\\"|#) end of / { inside = 0 }
        !inside { print }
        /^(\.\\"|#) made from the (table of|file) / {
            inside = 1
            file = folder "/" $NF
            while ((getline line < file) > 0) print line
        }' "$1"
}

for name in man/rextract.1 man/rextract.conf.5 man/rextract-simulate.1 man/rextract-validate.1 man/rextract-train.1 man/rextract-survey.1 \
    man/rextract.3 completion/rextract; do
    page=$top/$name
    fill "$page" >"$scratch/page"
    if [ "${1-}" = --write ]; then
        cmp -s "$scratch/page" "$page" || cp "$scratch/page" "$page"
    elif diff -u "$page" "$scratch/page"; then
        passed=$((passed + 1))
    else
        echo "$name is not what the tables or examples say; run man/check-man.sh --write"
        failed=$((failed + 1))
    fi
done
[ "${1-}" != --write ] || exit 0
for name in rextract.1 rextract.3 rextract.conf.5 rextract-simulate.1 rextract-validate.1 rextract-train.1 rextract-survey.1; do
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
# For a browser (make html): a page each, in an index, and no link to a page that is not there.
if command -v mandoc >/dev/null; then
    mkdir "$scratch/html"
    html=$(cd "$top" && pwd)
    (cd "$scratch" && top=$html sh "$html/man/html.sh" man/rextract.1 man/rextract.3 man/rextract.conf.5 man/rextract-simulate.1 \
        man/rextract-validate.1 man/rextract-train.1 man/rextract-survey.1) >"$scratch/made" 2>&1 || echo 'man/html.sh fails' >>"$scratch/made"
    cat "$scratch"/html/*.html | grep -o 'href="[^"#][^"#]*' | sed 's/href="//' | sort -u >"$scratch/links"
    while read -r link; do [ -s "$scratch/html/$link" ] || echo "no page $link"; done <"$scratch/links" >>"$scratch/made"
    [ "$(grep -c 'html$' "$scratch/links")" -eq 7 ] || echo "not 7 pages are linked" >>"$scratch/made"
    cat "$scratch/made"
    if [ -s "$scratch/made" ]; then failed=$((failed + 1)); else passed=$((passed + 1)); fi
else
    skipped=$((skipped + 1))
fi
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
