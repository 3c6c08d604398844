#!/bin/bash
# Speed and memory of this build beside other programs, on this machine, as ratios.
#
#   validation/bench/run.sh [quick|full] [FOLDER] [-VERBOSE_TYPE FULL]
#   validation/bench/run.sh check [FOLDER]      quick, then against validation/results/bench/quick; exit 1: slower
#
# Into FOLDER (default: bench-out, of check bench-check-out): bench.json (each ratio with quartiles), bench.md (tables),
# bench.svg (figure).
#
# quick: tiles of 1 and 4 thousand pixels a side, 3 repeats, minutes on two cores; full: up to 16 thousand, some
# 20 minutes and more, 3.5 GB of disk and 14 GB of memory (where there is less, what does not fit is left out and named). Nothing
# else should run meanwhile.
# -VERBOSE_TYPE FULL also shows each layer of the network.
#
# RX_BUILD_DIR is the build (default: build/); `make bench` makes what it needs. Needs python3 (its standard library);
# source-extractor, psfex, siril, iraf with iraf-noao, python3-skimage, python3-sep, python3-photutils,
# python3-astropy and gnuplot take part where they are.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
build=$(realpath "${RX_BUILD_DIR:-$top/build}")
python=/usr/bin/python3
committed=$top/validation/results/bench/quick/bench.json

fail() {
    echo "run.sh: $1" >&2
    exit "$2"
}

size=full
case ${1-} in
quick | full | check)
    size=$1
    shift
    ;;
esac
out=bench-out
[[ $size != check ]] || out=bench-check-out
case ${1-} in
'' | -*) ;;
*)
    out=$1
    shift
    ;;
esac
verbose=()
if [[ $# -gt 0 ]]; then
    [[ $# -eq 2 && $1 == -VERBOSE_TYPE && $2 =~ ^(NORMAL|FULL)$ ]] ||
        fail "do not know $*; give quick, full or check, a folder, and -VERBOSE_TYPE FULL if wanted" 2
    [[ $2 == NORMAL ]] || verbose=(--layers)
fi
[[ -x $python ]] || fail "$python is missing; install the package python3" 4
for program in rextract rextract-simulate rextract-train validation/bench/limits; do
    [[ -x $build/$program ]] || fail "$build/$program is missing; run make bench, or name the build in RX_BUILD_DIR" 4
done
[[ $size != check || -r $committed ]] || fail "$committed is missing; nothing to compare with" 3
mkdir -p "$out"
out=$(realpath "$out")
# A signal must reach the one who knows of the tiles.
"$python" -B "$here/bench.py" --size "${size/check/quick}" --build "$build" --top "$top" --out "$out" "${verbose[@]}" &
child=$!
trap 'kill "$child"; wait "$child"; exit 143' INT TERM HUP
wait "$child"
[[ $size == check ]] || exit 0
"$python" -B "$here/compare.py" "$committed" "$out/bench.json"
