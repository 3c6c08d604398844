#!/bin/sh
# The sum over all tests of a build folder as one plain line: "N passed, N failed, N skipped".
#   count.sh BUILDFOLDER
# Reads what tests/driver.sh left in the .trs files. No result at all counts as a failure.
set -u
find "$1" -name '*.trs' -exec cat {} + 2>/dev/null | awk '
    /^:test-result: PASS/ { passed++ }
    /^:test-result: SKIP/ { skipped++ }
    /^:test-result: (FAIL|ERROR)/ { failed++ }
    END {
        if (passed + skipped + failed == 0) failed = 1
        printf "%d passed, %d failed, %d skipped\n", passed, failed, skipped
    }'
