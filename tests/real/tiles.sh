#!/bin/sh
# The main job on real tiles: it succeeds, every output is the same for one thread and for two, restored pixels
# are finite wherever the input is good, and what the tile lacks (stars, coordinates, sky) loses no tile.
# Needs the real images: RX_SHARED_DATA.
set -u
: "${RX_PROGRAM:?the rextract to test}"
data=${RX_SHARED_DATA:-}
if [ -z "$data" ] || [ ! -d "$data" ]; then
    echo "skipped: RX_SHARED_DATA names no folder of real tiles"
    echo "0 passed, 0 failed, 1 skipped"
    exit 0
fi
scratch=$(mktemp -d "${TMPDIR:-/tmp}/rextract-real-XXXXXX") || exit 2
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 2
passed=0 failed=0

# run THREADS FOLDER IMAGE KEYWORDS...: all outputs into FOLDER
run() {
    threads=$1 folder=$2 image=$3
    shift 3
    mkdir "$folder" && (
        cd "$folder" && OMP_NUM_THREADS=$threads "$RX_PROGRAM" "$image" -RESTORE_TYPE NONE,RL -RL_NITER 10 \
            -VERBOSE_TYPE QUIET -CATALOG_TYPE FITS_LDAC -CATALOG_NAME out.cat \
            -CHECKIMAGE_TYPE RESTORED,RESIDUAL,SEGMENTATION,APERTURES -CHECKIMAGE_NAME r.fits,d.fits,s.fits,a.fits "$@"
    )
}

# tile NAME IMAGE KEYWORDS...
tile() {
    name=$1 image=$2
    shift 2
    if ! run 1 "$name.1" "$image" "$@"; then
        echo "not ok - $name: the run failed"
        failed=$((failed + 1))
    elif ! run 2 "$name.2" "$image" "$@" || ! diff -r "$name.1" "$name.2"; then
        echo "not ok - $name: two threads give other bytes than one"
        failed=$((failed + 1))
    elif [ "$(find "$name.1" -type f | wc -l)" -ne 10 ]; then
        echo "not ok - $name: not the ten outputs that were asked for"
        failed=$((failed + 1))
    else
        echo "ok - $name"
        passed=$((passed + 1))
    fi
    rm -rf "$name.1" "$name.2"
}

tile galaxies "$data/sextractor/galaxies.fits[1:400,1:400]" -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE "$data/sextractor/galaxies.weight.fits[1:400,1:400]"
tile psfex "$data/sextractor/galaxies.fits[300:700,1:400]" -PSF_TYPE PSFEX -PSF_NAME "$data/sextractor/default.psf"
# the template fit, which the check-images ask for
templates="RESTORED,TEMPLATE_RESIDUAL,TEMPLATE_MODEL,TEMPLATE_CHI"
tile templates "$data/sextractor/galaxies.fits[300:700,300:700]" -PSF_TYPE PSFEX -PSF_NAME "$data/sextractor/default.psf" \
    -CHECKIMAGE_TYPE "$templates"
tile templates-crowded-nan "$data/fields/spitzer_example_image.fits[1:150,1:150]" -CHECKIMAGE_TYPE "$templates"
tile templates-no-stars "$data/fields/M13_blue_0001.fits[1:400,1:400]" -CHECKIMAGE_TYPE "$templates"
tile crowded-nan "$data/fields/spitzer_example_image.fits[1:400,1:400]"
tile no-stars "$data/fields/M13_blue_0001.fits[1:400,1:400]"
tile unsigned-vignetted "$data/fields/aligned_eso085-030-004.fit[1:500,1:400]" -SATUR_LEVEL 60000
tile compressed "$data/odd/c4d_130105_065255_ooi_r_a1-N15.fits.fz" -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE "$data/odd/c4d_130105_065255_oow_r_a1-N15.fits.fz"
tile gzipped-tpv "$data/wcs/tpv.fits.gz"
tile multi-extension "$data/wcs/test_multiF.fits.fz"
tile blank "$data/wcs/blankimg.fits"
tile vector-psf "$data/decam/c4d_171113_060340_ooi_r_ls9.N6.fits" -PSF_TYPE PSFEX \
    -PSF_NAME "$data/decam/c4d_171113_060340_ooi_r_ls9-psfex.fits"

echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
