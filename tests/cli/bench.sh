#!/bin/sh
# The benchmark's comparison: a ratio that fell is named, one that is equal, better, or only unlucky is not; ratios that
# depend on the machine take no part; files that cannot be compared are refused.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
compare=$top/validation/bench/compare.py
if ! [ -x /usr/bin/python3 ]; then
    echo 'skipped: /usr/bin/python3 is missing'
    echo '0 passed, 0 failed, 1 skipped'
    exit 0
fi
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-bench-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 2
passed=0 failed=0

# bench FILE SIZE RL NET SECONDS: results of three rows, each ratio "lower, median, upper"
bench() {
    cat >"$1" <<END
{"size": "$2", "rows": [
 {"key": "rl", "what": "RL against another", "ratio": [$3], "compared": true},
 {"key": "net", "what": "NET against RL", "ratio": [$4], "compared": true},
 {"key": "seconds", "what": "seconds", "ratio": [$5], "compared": false}]}
END
}

# expect TITLE CODE PATTERN OLD NEW: exit code, and a pattern of a line that is printed
expect() {
    title=$1 code=$2 pattern=$3
    shift 3
    /usr/bin/python3 -B "$compare" "$@" >out 2>&1
    status=$?
    if [ $status -eq "$code" ] && grep -Eq -- "$pattern" out; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAILED: $title: exit code $status, expected $code and: $pattern"
        sed 's/^/    | /' out
    fi
}

bench old.json quick '3.9, 4, 4.1' '6, 6.1, 6.2' '2, 2, 2'
expect 'equal ratios' 0 '^2 ratios compared, 0 fell' old.json old.json
bench new.json quick '3.2, 3.5, 3.59' '6, 6.1, 6.2' '2, 2, 2'
expect 'a ratio that fell' 1 '^FELL to 88 %: RL against another: 4 committed, now 3\.5 ' old.json new.json
expect 'and no other' 1 '^2 ratios compared, 1 fell' old.json new.json
bench new.json quick '3.2, 3.5, 3.7' '6, 6.1, 6.2' '2, 2, 2'
expect 'a median that one bad run may explain' 0 '^2 ratios compared, 0 fell' old.json new.json
bench new.json quick '4.9, 5, 5.1' '5.5, 5.6, 5.7' '1, 1, 1'
expect 'better, a little worse, and seconds' 0 '^2 ratios compared, 0 fell' old.json new.json
sed '/"net"/d' old.json >new.json
expect 'a row that was not measured' 0 '^not measured: NET against RL' old.json new.json
bench new.json full '3.9, 4, 4.1' '6, 6.1, 6.2' '2, 2, 2'
expect 'another size' 3 'new\.json: a full run .* a quick run' old.json new.json
echo '{' >new.json
expect 'no results' 3 'new\.json: no results of the benchmark' old.json new.json
expect 'a missing file' 3 'missing\.json: no results' missing.json old.json
expect 'no files' 2 '^usage: compare\.py' old.json

echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
