#!/bin/bash
# Nothing that a catalogue's rows or a check-image's pixels hold changes unawares: real tiles and simulated ones by every restorer, all
# columns and check-images, templates included, as digests; and the tiles themselves that rextract-simulate makes. Headers are not
# looked at.
#
#   same-bytes.sh                     the few of tests/same-bytes.tsv, which holds for one class of machines; skipped on others
#   same-bytes.sh --write             writes that table: with a change that is meant to change numbers, and says so
#   same-bytes.sh --against FOLDER    every tile, by the programs of this build and by those in FOLDER, the build of another version;
#                                     columns and images that differ are named, as are those that only one of them has
#   RX_TEST_ONLY='EXPRESSION'         of these, the tiles whose name matches
#
# Needs the real images: RX_SHARED_DATA; and astropy.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract rextract-simulate
need_data astropy
mode=${1-} before=''
if [ "$mode" = --against ]; then
    before=$(cd "$2" && pwd) && [ -x "$before/rextract" ] || { echo "$script: $2 holds no rextract" >&2; exit 2; }
fi
table=$top/tests/same-bytes.tsv
class="$(uname -m) $(grep -m 1 '^flags' /proc/cpuinfo | tr ' ' '\n' | grep -E '^(avx|avx2|fma|avx512.*)$' | sort | tr '\n' ' '); $(
    getconf GNU_LIBC_VERSION)"
[ "$mode" != '' ] || [ "$(sed -n 's/^# class: //p' "$table")" = "$class" ] || {
    skip 'same bytes' "tests/same-bytes.tsv is of another class of machines than $class"
    finish
}
enter

export PYTHONWARNINGS=ignore
images='BACKGROUND BACKGROUND_RMS MINIBACKGROUND MINIBACK_RMS -BACKGROUND FILTERED OBJECTS -OBJECTS RESTORED RESIDUAL SUPPORT
SEGMENTATION APERTURES TEMPLATE_MODEL TEMPLATE_RESIDUAL TEMPLATE_CHI PSF'
types=$(echo $images | tr ' ' ',') names=$(echo $images | sed 's/[^ ]*/image&.fits/g' | tr ' ' ',')

# What the files of a folder hold: a line for each column of its tables and each image, with a digest.
cat >digest.py <<'PY'
import glob
import hashlib
import sys

import numpy as np
from astropy.io import fits


def digest(values):
    return hashlib.md5(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]


for path in sorted(glob.glob("*.cat") + glob.glob("*.fits")):
    for k, hdu in enumerate(fits.open(path, memmap=False)):
        if isinstance(hdu, fits.BinTableHDU):
            for column in hdu.columns.names:
                print(path, k, column, len(hdu.data), digest(hdu.data[column]), sep="\t")
        elif hdu.data is not None:
            print(path, k, *hdu.data.shape, digest(hdu.data), sep="\t")
PY

# digests FOLDER COMMAND...: runs it there; its exit code and what it wrote, on standard output.
digests() {
    mkdir "$1" && cd "$1" || exit 2
    shift
    "$@" >../log 2>&1
    echo "exit $?"
    /usr/bin/python3 ../digest.py 2>/dev/null
    cd ..
}

# Columns that need nothing but a tile.
"$programs/rextract" -dp | sed -n 's/^#\([A-Z0-9_]*\).*/\1/p' |
    grep -vE 'ASSOC|VIGNET|CLASS_STAR|INJECTED|IMAFLAGS|FLAGS_ISO' >all.param

# extract PROGRAMS RESTORERS IMAGE KEYWORDS...
extract() {
    p=$1 restorers=$2 image=$3
    shift 3
    grep -xFf <("$p/rextract" -dp | sed -n 's/^#\([A-Z0-9_]*\).*/\1/p') ../all.param >columns.param
    "$p/rextract" "$image" -RESTORE_TYPE "$restorers" -NET_MODEL "$top/config/psfnet.fits" -FILTER_NAME "$top/config/default.conv" \
        -PARAMETERS_NAME columns.param -CATALOG_TYPE FITS_1.0 -CATALOG_NAME out.cat -VERBOSE_TYPE QUIET \
        -CHECKIMAGE_TYPE "$types" -CHECKIMAGE_NAME "$names" "$@"
}

# simulate PROGRAMS KEYWORDS...
simulate() {
    p=$1
    shift
    "$p/rextract-simulate" -IMAGE_NAME tile.fits -TRUTH_NAME truth.fits -VERBOSE_TYPE QUIET "$@"
}

# compare NAME HOW ...: HOW is extract or simulate, and takes the rest
compare() {
    name=$1 how=$2
    shift 2
    if [ -n "${RX_TEST_ONLY:-}" ]; then
        echo "$name" | grep -qE "$RX_TEST_ONLY" || return 0
    fi
    digests now "$how" "$programs" "$@" >now.tsv
    case $mode in
    --against) digests earlier "$how" "$before" "$@" >earlier.tsv && diff earlier.tsv now.tsv >differences ;;
    --write) printf '%s\t%s\n' "$name" "$(md5sum <now.tsv | cut -c1-32)" >>written ;;
    *) grep -qxF "$name$(printf '\t')$(md5sum <now.tsv | cut -c1-32)" "$table" >differences ;;
    esac
    result "$name" $? differences
    rm -rf now earlier differences
}

# every NAME HOW ...: what only --against compares
every() {
    [ "$mode" = --against ] && compare "$@"
}

compare galaxies extract NONE,RL,NET "$data/sextractor/galaxies.fits[301:620,401:720]" -GAIN 1.5 -SATUR_LEVEL 40000
compare decam extract NONE,RL "$data/decam/c4d_171113_060340_ooi_r_ls9.N6.fits[1:200,1:200]" -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE "$data/decam/c4d_171113_060340_oow_r_ls9.N6.fits[1:200,1:200]"
compare simulated-ccd simulate -IMAGE_SIZE 256 -SEED 3 -STAR_COUNT 8000 -STAR_MAG 17,24 -GALAXY_COUNT 500 -PAIR_SHARE 0.3 \
    -NOISE_TYPE CCD -GAIN 2 -BAD_COLUMNS 0.01 -COSMIC_RAYS 200 -SATUR_LEVEL 30000 -PSF_VARIATION 0.2 -PSF_RATIO 0.8 -FLAG_NAME flag.fits
compare simulated-coadd simulate -IMAGE_SIZE 256 -SEED 4 -PSF_FWHM 3.5 -GALAXY_COUNT 3000 -COADD_TYPE DRIZZLE -COADD_UNEVEN 0.5 \
    -WEIGHT_NAME weight.fits -SHARP_NAME sharp.fits

every M67 extract NONE,RL,NET "$data/fields/M6707HH.fits[300:800,300:800]" -SATUR_LEVEL 30000
every spitzer extract NONE,RL,NET "$data/fields/spitzer_example_image.fits[301:500,201:400]"
every M13 extract NONE,RL,NET "$data/fields/M13_blue_0001.fits[400:900,300:700]" -PSF_TYPE MOFFAT -PSF_FWHM 3
every eso extract NONE,RL,NET "$data/fields/aligned_eso085-030-004.fit[200:700,150:650]" -SATUR_LEVEL 60000
every sep extract NONE,RL,NET "$data/fields/sep_image.fits"
every galaxies-psfex extract NONE,RL,NET "$data/sextractor/galaxies.fits[1:600,1:600]" -PSF_TYPE PSFEX -PSF_NAME "$data/sextractor/default.psf" \
    -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE "$data/sextractor/galaxies.weight.fits[1:600,1:600]"
every galaxies-auto extract AUTO,RL_BLIND "$data/sextractor/galaxies.fits[1:400,1:400]"
every galaxies-check extract NONE,RL,NET "$data/sextractor/galaxies.fits[600:1000,600:1000]" -SELF_CHECK Y -PRECISION_TARGET 0.9
every galaxies-two extract NONE,RL "$data/sextractor/galaxies.fits,$data/sextractor/galaxies.fits" -PSF_TYPE PSFEX \
    -PSF_NAME "$data/sextractor/default.psf"
bunzip2 -kc "$data/sdss/reprojected_sdss_r.fits.bz2" >reprojected.fits
bunzip2 -kc "$data/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2" >frame.fits
every sdss-reprojected extract NONE,RL,NET ../reprojected.fits
every sdss-frame extract NONE,RL,NET '../frame.fits[0][1:700,1:700]' -GAIN 987 -SATUR_LEVEL 1e9 -MAG_ZEROPOINT 22.5
every decam-a1 extract NONE,RL,NET "$data/odd/c4d_130105_065255_ooi_r_a1-N15.fits.fz" -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE "$data/odd/c4d_130105_065255_oow_r_a1-N15.fits.fz"
every decam-flags extract NONE,RL,NET "$data/decam/c4d_171113_060340_ooi_r_ls9.N6.fits" -PSF_TYPE PSFEX \
    -PSF_NAME "$data/decam/c4d_171113_060340_ooi_r_ls9-psfex.fits"
for image in "$data"/pairs/*/*fitim.fits "$data"/sdss/galaxies/*_*.fits "$data"/wcs/*.f* "$data"/reports/*; do
    name=${image#"$data"/}
    every "$name" extract NONE,RL "$image"
done
every simulated-lanczos simulate -IMAGE_SIZE 300 -SEED 5 -CLUSTERING 0.5 -COADD_TYPE LANCZOS
every simulated-templates simulate -IMAGE_SIZE 300 -SEED 6 -TEMPLATE_NAME "$data/templates/cosmos" -TEMPLATE_COUNT 500 -GALAXY_TYPE SPIRAL
every simulated-injection simulate -INJECT_IMAGE "$data/fields/sep_image.fits" -PSF_TYPE AUTO -SEED 7 -STAR_COUNT 3000 -GALAXY_COUNT 3000
if [ "$mode" = --write ]; then
    { sed '/^[^#]/d; /^# class/d' "$table" 2>/dev/null || :; echo "# class: $class"; cat written; } >table && cp table "$table"
fi
finish
