#!/bin/sh
# The main job on real tiles: it succeeds, every output is the same for one thread and for two, restored pixels
# are finite wherever the input is good, and what the tile lacks (stars, coordinates, sky) loses no tile; and the log
# of a tile is short. Needs the real images: RX_SHARED_DATA.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract
need_data
enter

# run THREADS FOLDER IMAGE KEYWORDS...: all outputs into FOLDER
run() {
    threads=$1 folder=$2 image=$3
    shift 3
    mkdir "$folder" && (
        cd "$folder" && "$programs/rextract" "$image" -NTHREADS "$threads" -RESTORE_TYPE NONE,RL -RL_NITER 10 \
            -VERBOSE_TYPE QUIET -CATALOG_TYPE FITS_LDAC -CATALOG_NAME out.cat \
            -CHECKIMAGE_TYPE RESTORED,RESIDUAL,SEGMENTATION,APERTURES -CHECKIMAGE_NAME r.fits,d.fits,s.fits,a.fits "$@"
    )
}

# tile NAME IMAGE KEYWORDS...
tile() {
    name=$1 image=$2
    shift 2
    {
        run 1 "$name.1" "$image" "$@" && run 2 "$name.2" "$image" "$@" &&
            { diff -r "$name.1" "$name.2" || { echo 'two threads give other bytes than one' && false; }; } &&
            { [ "$(find "$name.1" -type f | wc -l)" -eq 10 ] || { echo 'not the ten outputs that were asked for' && false; }; }
    } >log 2>&1
    result "$name" $? log
    rm -rf "$name.1" "$name.2"
}

# short NAME IMAGE KEYWORDS...: with all that speaks, ten lines of 160 characters at most, what was written the last of them
short() {
    name=$1 image=$2
    shift 2
    "$programs/rextract" "$image" -RESTORE_TYPE NONE,RL,NET -NET_MODEL "$top/config/psfnet.fits" -RL_NITER 10 -PSF_TYPE AUTO \
        -FILTER_NAME "$top/config/default.conv" -PARAMETERS_NAME "$top/config/template.param" -CATALOG_TYPE FITS_LDAC \
        -CATALOG_NAME reference.cat -VERBOSE_TYPE QUIET "$@" >log 2>&1 &&
        "$programs/rextract" "$image" -RESTORE_TYPE NONE,RL,NET -NET_MODEL "$top/config/psfnet.fits" -RL_NITER 10 -PSF_TYPE AUTO \
            -FILTER_NAME "$top/config/default.conv" -PARAMETERS_NAME "$top/config/template.param" -CATALOG_TYPE FITS_LDAC \
            -CATALOG_NAME out.cat -CHECKIMAGE_TYPE RESTORED,SEGMENTATION -CHECKIMAGE_NAME r.fits,s.fits -RECORD_NAME record \
            -REFERENCE_NAME reference_NONE.cat -QA_NAME report -QA_FIGURES N "$@" >log 2>&1 &&
        awk 'length > 160 || NR > 10 { bad = 1 } { last = $0 } END { exit bad || last !~ /^rextract: written: out_NONE.cat/ }' log
    result "$name: at most ten lines" $? log
    rm -rf out* r_* s_* record report reference*
}

short eso "$data/fields/aligned_eso085-030-004.fit[1:560,150:682]" -SATUR_LEVEL 60000
short m67 "$data/fields/M6707HH.fits[1:400,1:400]" -SATUR_LEVEL 30000
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

finish
