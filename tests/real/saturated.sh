#!/bin/sh
# Saturated stars of a real tile under Richardson-Lucy and the network: each is one source with FLAGS 4, its AUTO
# and template magnitudes those of RESTORE_TYPE NONE within 0.01 and 0.03 mag, or the template's error
# (validation/saturated.py), and the templates' second look adds nothing to it. Needs the real images: RX_SHARED_DATA.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract
need_data astropy scipy
enter

# tile NAME IMAGE SATURATION KEYWORDS...
tile() {
    name=$1 image=$2 level=$3
    shift 3
    printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLAGS MAG_AUTO MAG_TEMPLATE MAGERR_TEMPLATE >columns.param
    "$programs/rextract" "$image" -RESTORE_TYPE NONE,RL,NET -NET_MODEL "$top/config/psfnet.fits" -VERBOSE_TYPE QUIET \
        -FILTER_NAME "$top/config/default.conv" -PARAMETERS_NAME columns.param -SATUR_LEVEL "$level" \
        -CATALOG_TYPE FITS_1.0 -CATALOG_NAME c.cat -CHECKIMAGE_TYPE SEGMENTATION,IDENTICAL \
        -CHECKIMAGE_NAME s.fits,i.fits "$@" >log 2>&1 &&
        /usr/bin/python3 -W ignore "$top/validation/saturated.py" i_NONE.fits "$level" . RL NET >log 2>&1
    result "$name" $? log
}

eso="$data/fields/aligned_eso085-030-004.fit[1:560,150:682]"
tile eso "$eso" 60000 -PSF_TYPE AUTO
tile eso-not-masked "$eso" 60000 -PSF_TYPE AUTO -MASK_SATURATED N
tile galaxies "$data/sextractor/galaxies.fits[600:1024,1:500]" 50000 -PSF_TYPE AUTO

finish
