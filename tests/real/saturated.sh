#!/bin/sh
# Saturated stars of a real tile under Richardson-Lucy and the network: each is one source with FLAGS 4, its AUTO
# and template magnitudes those of RESTORE_TYPE NONE within 0.01 and 0.02 mag (validation/saturated.py), and the
# templates' second look adds nothing to it. Needs the real images: RX_SHARED_DATA.
set -u
: "${RX_PROGRAM:?the rextract to test}" "${srcdir:?where the sources are}"
data=${RX_SHARED_DATA:-}
if [ -z "$data" ] || [ ! -d "$data" ] || ! /usr/bin/python3 -c 'import astropy, scipy' 2>/dev/null; then
    echo "skipped: RX_SHARED_DATA names no folder of real tiles, or python3 has no astropy and scipy"
    echo "0 passed, 0 failed, 1 skipped"
    exit 0
fi
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-saturated-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 2
passed=0 failed=0

# tile NAME IMAGE SATURATION KEYWORDS...
tile() {
    name=$1 image=$2 level=$3
    shift 3
    printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLAGS MAG_AUTO MAG_TEMPLATE >columns.param
    if ! "$RX_PROGRAM" "$image" -RESTORE_TYPE NONE,RL,NET -NET_MODEL "$srcdir/config/psfnet.fits" -VERBOSE_TYPE QUIET \
        -FILTER_NAME "$srcdir/config/default.conv" -PARAMETERS_NAME columns.param -SATUR_LEVEL "$level" \
        -CATALOG_TYPE FITS_1.0 -CATALOG_NAME c.cat -CHECKIMAGE_TYPE SEGMENTATION,IDENTICAL \
        -CHECKIMAGE_NAME s.fits,i.fits "$@" >log 2>&1; then
        cat log
        echo "not ok - $name: the run failed"
        failed=$((failed + 1))
    elif ! /usr/bin/python3 -W ignore "$srcdir/validation/saturated.py" i_NONE.fits "$level" . RL NET >log 2>&1; then
        cat log
        echo "not ok - $name: not as NONE has them"
        failed=$((failed + 1))
    else
        tail -n 1 log
        echo "ok - $name"
        passed=$((passed + 1))
    fi
}

eso="$data/fields/aligned_eso085-030-004.fit[1:560,150:682]"
tile eso "$eso" 60000 -PSF_TYPE AUTO
tile eso-not-masked "$eso" 60000 -PSF_TYPE AUTO -MASK_SATURATED N
tile galaxies "$data/sextractor/galaxies.fits[600:1024,1:500]" 50000 -PSF_TYPE AUTO

echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
