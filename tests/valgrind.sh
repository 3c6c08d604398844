#!/bin/sh
# The unit tests, and one tile through every restorer, under valgrind's memcheck: no read of what was not set or is
# not ours, no memory that is lost. Not part of `make check`, for it takes hours: `make check-valgrind`, or
#
#   RX_BUILD_DIR=BUILD tests/valgrind.sh [TEST...]    unit tests as base/test_text; io/, a folder of them; tiles
#
# RX_TIMEOUT is the limit of a test in seconds (600). Of a unit test that needs longer the cases that are left are run one
# by one, each with that limit; those that need longer still are skipped, and named. What it finds is in valgrind.log of the
# build.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
build=$(cd "${RX_BUILD_DIR:-.}" && pwd)
command -v valgrind >/dev/null || { echo 'valgrind.sh: install valgrind'; exit 77; }
[ -x "$build/tests/unit/base/test_text" ] || { echo "valgrind.sh: no tests in $build; run make check TESTS= there"; exit 2; }
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-valgrind-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
trap 'exit 2' INT TERM HUP
log=$build/valgrind.log
passed=0 failed=0 skipped=0
export srcdir="$top" RX_BUILD_DIR="$build" RX_SHARED_DATA="${RX_SHARED_DATA-}" CMOCKA_MESSAGE_OUTPUT=TAP OMP_WAIT_POLICY=passive OMP_NUM_THREADS=2
: >"$log"

# sep_extract() 1.2.1 loses two arrays a call (tests/lsan.supp).
cat >"$scratch/known" <<'known'
{
   sep_extract
   Memcheck:Leak
   ...
   obj:*libsep.so*
}
known

# One case of a unit test alone: cmocka has a filter, but no way to set it from outside.
cat >"$scratch/only.c" <<'only'
#include <stdlib.h>
void cmocka_set_test_filter(const char *pattern);
__attribute__((constructor)) static void only(void)
{
    cmocka_set_test_filter(getenv("RX_CASE"));
}
only
${CC:-cc} -shared -fPIC -o "$scratch/only.so" "$scratch/only.c" -lcmocka || exit 2

# watched COMMAND...: its exit code; what it says goes to $scratch/out, a line at a time
watched() {
    timeout -k 10 "${RX_TIMEOUT:-600}" stdbuf -oL valgrind -q --error-exitcode=67 --leak-check=full --show-leak-kinds=definite \
        --errors-for-leak-kinds=definite --suppressions="$scratch/known" --log-file="$scratch/%p.log" "$@" >"$scratch/out" 2>&1
}

# judge TITLE CODE
judge() {
    if [ -n "$(find "$scratch" -name '*.log' -size +0)" ] || { [ "$2" != 0 ] && [ "$2" != 124 ] && [ "$2" != 137 ]; }; then
        failed=$((failed + 1))
        echo "FAILED: $1, exit code $2" | tee -a "$log"
        cat "$scratch"/*.log "$scratch/out" >>"$log"
    elif [ "$2" = 0 ]; then
        passed=$((passed + 1))
    else
        skipped=$((skipped + 1))
        echo "skipped: $1 takes too long"
    fi
    rm -f "$scratch"/*.log
}

# check TITLE COMMAND...
check() {
    title=$1
    shift
    watched "$@"
    judge "$title" $?
}

# check_unit TEST
check_unit() {
    watched "./$1"
    code=$?
    if { [ $code != 124 ] && [ $code != 137 ]; } || [ -n "$(find "$scratch" -name '*.log' -size +0)" ]; then
        judge "$1" $code
        return
    fi
    rm -f "$scratch"/*.log
    sed -n 's/^ok [0-9]* - //p' "$scratch/out" >"$scratch/done"
    # the first word in parentheses of each line of the lists of cases
    sed -n '/cmocka_run/d;/struct CMUnitTest/,/};/s/[A-Za-z_]*(\([A-Za-z0-9_]*\)[,)][^(]*/\n\1\n/gp' "$top/$1.c" | grep '^[A-Za-z]' >"$scratch/cases"
    [ "$(wc -l <"$scratch/cases")" != 1 ] || { judge "$1" $code; return; }
    echo "$1 takes too long: $(wc -l <"$scratch/done") of $(wc -l <"$scratch/cases") cases are done, the others one by one"
    while read -r name <&4; do
        ! grep -qx "$name" "$scratch/done" || continue
        RX_CASE=$name LD_PRELOAD=$scratch/only.so watched "./$1"
        code=$?
        [ $code != 0 ] || grep -Eq "^(ok 1 - $name|not ok 1 # SKIP.*)\$" "$scratch/out" || code=2 # no such case
        judge "$1: $name" $code
    done 4<"$scratch/cases"
}

tiles() {
    (cd "$scratch" && "$build/tests/cli/make_fits" tile tile.fits && "$build/tests/cli/make_fits" small small.fits &&
        "$build/tests/cli/make_fits" table ref.fits) || exit 2
    cd "$scratch" || exit 2
    set -- "$build/rextract" tile.fits -c "$top/config/default.sex" -PARAMETERS_NAME "$top/config/default.param" -FILTER N \
        -CATALOG_TYPE FITS_LDAC -PSF_TYPE MOFFAT -PSF_FWHM 3 -REFERENCE_NAME ref.fits -QA_FIGURES N -RL_NITER 5
    check 'a tile as it is' "$@" -RESTORE_TYPE NONE -CATALOG_TYPE ASCII_VOTABLE
    check 'Richardson-Lucy' "$@" -RESTORE_TYPE RL -CHECKIMAGE_TYPE RESTORED -CHECKIMAGE_NAME r.fits
    check 'blind Richardson-Lucy' "$@" -RESTORE_TYPE RL_BLIND
    check 'templates' "$@" -RESTORE_TYPE NONE -PARAMETERS_NAME "$top/config/template.param"
    shift 2
    set -- "$build/rextract" "$top/tests/data/sim.fits.fz[101:164,101:164]" "$@"
    check 'templates of a restored tile' "$@" -RESTORE_TYPE RL -PARAMETERS_NAME "$top/config/template.param"
    shift 2
    set -- "$build/rextract" small.fits "$@" # 64 x 48 pixels
    check 'the network, BLIND' "$@" -RESTORE_TYPE NET -NET_MODEL "$top/config/psfnet-blind.fits"
    check 'the network, INFORMED' "$@" -RESTORE_TYPE NET -NET_MODEL "$top/config/psfnet.fits"
    check 'a compressed tile' "$build/rextract" "$top/tests/data/sim.fits.fz[1:100,1:100]" -RESTORE_TYPE NONE
    cd "$build" || exit 2
}

[ $# -gt 0 ] || set -- / tiles
cd "$build" || exit 2
for wanted; do
    [ "$wanted" != tiles ] || { tiles; continue; }
    find tests/unit -type f -name 'test_*' -perm -100 | sort | grep -- "/${wanted#/}" >"$scratch/tests"
    while read -r test <&3; do
        check_unit "$test"
    done 3<"$scratch/tests"
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
