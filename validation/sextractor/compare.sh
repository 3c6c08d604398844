#!/bin/sh
# The real source-extractor and `rextract -RESTORE_TYPE NONE` with the same files on the same tiles:
# a table per column as markdown on standard output, exit 1 when a limit is broken.
#
# usage: validation/sextractor/compare.sh [DATA]
#   DATA         folder of the real tiles (default: $RX_SHARED_DATA, else ../shared/data beside the checkout)
#   $RX_PROGRAM  the program (default: build/rextract)
#   $PYTHON      a python3 with astropy, numpy, scipy
set -eu
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
data=${1:-${RX_SHARED_DATA:-$root/../shared/data}}
python=${PYTHON:-/usr/bin/python3}
share=${SEXTRACTOR_SHARE:-/usr/share/source-extractor}
program=${RX_PROGRAM:-$root/build/rextract}
for need in source-extractor "$program" "$python" bunzip2; do
    command -v "$need" >/dev/null || { echo "compare.sh: $need is missing" >&2; exit 4; }
done
[ -d "$data" ] || { echo "compare.sh: no folder $data; give the folder of the real tiles" >&2; exit 3; }
data=$(cd "$data" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM
cd "$work"
source-extractor -d >default.sex

# run NAME IMAGE [OPTION...]: both programs, catalogues NAME.sex.fits and NAME.rx.fits
run() {
    name=$1 image=$2
    shift 2
    [ -f "$image" ] || { echo "compare.sh: $image is missing" >&2; exit 3; }
    set -- "$image" -c default.sex -PARAMETERS_NAME "$here/compare.param" -FILTER_NAME "$share/default.conv" \
        -STARNNW_NAME "$share/default.nnw" -PHOT_APERTURES 5,12 -PHOT_FLUXFRAC 0.5,0.8 -CATALOG_TYPE FITS_1.0 \
        -VERBOSE_TYPE QUIET "$@"
    source-extractor "$@" -CATALOG_NAME "$name.sex.fits" >"$name.log" 2>&1 || { cat "$name.log" >&2; exit 4; }
    "$program" "$@" -RESTORE_TYPE NONE -CATALOG_NAME "$name.rx.fits"
    tiles="$tiles $name"
}

tiles=
run galaxies "$data/sextractor/galaxies.fits"
run galaxies-weight "$data/sextractor/galaxies.fits" -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE "$data/sextractor/galaxies.weight.fits"
run M67 "$data/fields/M6707HH.fits"
run ESO085-030 "$data/fields/aligned_eso085-030-004.fit"
run spitzer "$data/fields/spitzer_example_image.fits"
run M13 "$data/fields/M13_blue_0001.fits"
bunzip2 -c "$data/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2" >frame.fits
run sdss-94-1-12 "$work/frame.fits"
# shellcheck disable=SC2086
"$python" "$here/compare.py" $tiles
