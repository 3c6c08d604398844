#!/bin/sh
# The unit tests, and one tile through every restorer, under valgrind's memcheck: no read of what was not set or is
# not ours, no memory that is lost. Not part of `make check`, for it takes hours: `make check-valgrind`, or
#
#   RX_BUILD_DIR=BUILD tests/valgrind.sh [TEST...]    unit tests as base/test_text; io/, a folder of them; tiles
#
# RX_TIMEOUT is the limit of a test in seconds (600); one that needs longer is skipped. What it finds is in valgrind.log of
# the build.
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
export srcdir="$top" RX_BUILD_DIR="$build" RX_SHARED_DATA="${RX_SHARED_DATA-}" OMP_WAIT_POLICY=passive OMP_NUM_THREADS=2
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

# check TITLE COMMAND...
check() {
    title=$1
    shift
    timeout -k 10 "${RX_TIMEOUT:-600}" valgrind -q --error-exitcode=67 --leak-check=full --show-leak-kinds=definite \
        --errors-for-leak-kinds=definite --suppressions="$scratch/known" --log-file="$scratch/%p.log" "$@" >"$scratch/out" 2>&1
    code=$?
    if [ $code = 124 ] || [ $code = 137 ]; then
        skipped=$((skipped + 1))
        echo "skipped: $title takes too long"
    elif [ $code = 0 ] && [ -z "$(find "$scratch" -name '*.log' -size +0)" ]; then
        passed=$((passed + 1))
    else
        failed=$((failed + 1))
        echo "FAILED: $title, exit code $code" | tee -a "$log"
        cat "$scratch"/*.log "$scratch/out" >>"$log"
    fi
    rm -f "$scratch"/*.log
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
        check "$test" "./$test"
    done 3<"$scratch/tests"
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
