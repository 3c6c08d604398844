#!/bin/sh
# Every fuzz target on its seeds and on damaged copies of them, with the compiler at hand; a process each, so
# that one that crashes does not hide the others. RX_FUZZ_COPIES: damaged copies of each seed; RX_FUZZ_HEADERS:
# headers with other cards.
set -u
build=${RX_BUILD_DIR:?} source=${srcdir:?}
passed=0 failed=0
folder=$(mktemp -d) || exit 2
trap 'rm -rf "$folder"' EXIT
LSAN_OPTIONS="suppressions=$source/tests/fuzz/lsan.supp:print_suppressions=0"
ASAN_OPTIONS="allocator_may_return_null=1:${ASAN_OPTIONS:-}"
export LSAN_OPTIONS ASAN_OPTIONS

result() { # TITLE STATUS
    if [ "$2" -eq 0 ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAIL: $1"
        tail -n 40 "$folder/errors"
    fi
}

"$build/tests/fuzz/seeds" "$folder" "$source/tests/fuzz/texts" 2>"$folder/errors"
result "every target has seeds" $?
cd "$folder" || exit 2
for target in $(sed -n 's/^TARGET(\([a-z]*\),.*/\1/p' "$source/tests/fuzz/targets.def"); do
    "$build/tests/fuzz/replay" -m "${RX_FUZZ_COPIES:-10}" "$folder" "$target" 2>"$folder/errors"
    result "damaged bytes are refused, or read as what they are: $target" $?
done
"$build/tests/fuzz/headers" -n "${RX_FUZZ_HEADERS:-10000}" "$folder" 2>"$folder/errors"
result "cards are read by cfitsio as by us, or refused" $?
echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
