#!/bin/sh
# Runs one test for `make check` and counts its cases (automake: "Custom test drivers").
#
# A test tells its cases in one of three ways: TAP lines as cmocka writes them ("ok 1 - name",
# "not ok 2 - name", "not ok 3 # SKIP name"; any number of groups), a closing line
# "N passed, N failed, N skipped", or its exit code alone (77: skipped). However it counts, a test
# that ends in failure without a failed case, or before all planned cases ran, is an error. What took long has its seconds in the
# line that is printed, so that who waits for the suite sees for what; cases that failed are named after it.
set -u

while [ $# -gt 0 ]; do
    case $1 in
    --test-name) name=$2; shift 2 ;;
    --log-file) log=$2; shift 2 ;;
    --trs-file) trs=$2; shift 2 ;;
    --color-tests | --expect-failure | --enable-hard-errors) shift 2 ;;
    --) shift; break ;;
    *) echo "driver.sh: unknown option $1" >&2; exit 2 ;;
    esac
done

begun=$(date +%s)
"$@" >"$log" 2>&1 </dev/null
code=$?

awk -v code="$code" -v seconds=$(($(date +%s) - begun)) -v name="$name" -v trs="$trs" '
    /^1\.\.[0-9]+$/ { planned += substr($0, 4); tap = 1 }
    /^(not )?ok [0-9]+ # SKIP/ { skipped++; ran++; next }
    /^ok [0-9]+/ { passed++; ran++ }
    /^not ok [0-9]+/ { failed++; ran++ }
    /^not ok [0-9]+/ || /^FAILED: / { complaints = complaints "\n    " $0 }
    /^[0-9]+ passed, [0-9]+ failed, [0-9]+ skipped$/ { closing = $0 }
    END {
        if (!tap && closing != "") {
            split(closing, word, " ")
            passed = word[1]; failed = word[3]; skipped = word[5]
        } else if (!tap) {
            passed = (code == 0); skipped = (code == 77); failed = (code != 0 && code != 77)
        }
        error = ""
        if (tap && ran != planned)
            error = "stopped after " ran + 0 " of " planned " cases, exit code " code
        else if (code != 0 && code != 77 && failed + 0 == 0)
            error = "exit code " code " though no case failed"
        for (i = 0; i < passed; i++) print ":test-result: PASS" > trs
        for (i = 0; i < skipped; i++) print ":test-result: SKIP" > trs
        for (i = 0; i < failed; i++) print ":test-result: FAIL" > trs
        if (error != "") print ":test-result: ERROR " error > trs
        result = error != "" ? "ERROR" : failed > 0 ? "FAIL" : passed > 0 ? "PASS" : "SKIP"
        print ":global-test-result: " result > trs
        print ":recheck: " (result == "FAIL" || result == "ERROR" ? "yes" : "no") > trs
        print ":copy-in-global-log: " (result == "FAIL" || result == "ERROR" ? "yes" : "no") > trs
        text = passed + 0 " passed"
        if (failed > 0) text = text ", " failed " failed"
        if (skipped > 0) text = text ", " skipped " skipped"
        if (error != "") text = text ", " error
        if (seconds >= 10) text = text ", " seconds " s"
        print result ": " name " (" text ")" complaints
    }' "$log"
