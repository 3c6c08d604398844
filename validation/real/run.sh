#!/bin/bash
# Every restorer on real sky: the SDSS/KiDS pairs in numbers and pictures, two dwarf galaxies of low surface brightness,
# and pictures of all other tiles (observed, restored, residual).
#
#   validation/real/run.sh [FOLDER]      into FOLDER (default: real-out): pairs.md, dwarfs.md, *.png
#
# RX_MODEL names the network's model (default: config/psfnet.fits; without one NET does not take part). Needs the data
# folder (RX_SHARED_DATA, or ../shared/data beside the sources), python3 with astropy and scipy, and bunzip2; pictures are
# drawn where matplotlib is installed.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_PROGRAM:-$top/build/rextract}
data=$(cd "${RX_SHARED_DATA:-$top/../shared/data}" && pwd)
out=${1:-real-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")
# shellcheck disable=SC2034 # for restorers.sh
modules='numpy astropy scipy'
restorers='' net=() python='' # set by the next line
# shellcheck source=/dev/null
. "$here/../restorers.sh"
mkdir -p "$out"
cd "$out"
export PYTHONWARNINGS=ignore

# tile NAME IMAGE OPTION...: NAME_<restorer>.cat, .fits (restored), _residual_ and _sky_<restorer>.fits
tile() {
    local name=$1 image=$2
    shift 2
    "$program" "$image" -RESTORE_TYPE "$restorers" "${net[@]}" -VERBOSE_TYPE QUIET -CATALOG_TYPE FITS_1.0 \
        -CATALOG_NAME "$name.cat" -PARAMETERS_NAME real.param -CHECKIMAGE_TYPE RESTORED,RESIDUAL,BACKGROUND \
        -CHECKIMAGE_NAME "$name.fits,${name}_residual.fits,${name}_sky.fits" "$@" ||
        echo "run.sh: $name failed" >&2
}
printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLUX_AUTO FLUXERR_AUTO FLUX_ISO FLAGS >real.param

# --- the same galaxies by SDSS and by KiDS: maggies, sky subtracted, noise maps
galaxies=()
for image in "$data"/pairs/SDSS/*fitim.fits; do
    g=$(basename "$image" fitim.fits)
    galaxies+=("$g")
    tile "pair_$g" "$image" -BACK_TYPE MANUAL -BACK_VALUE 0 -MAG_ZEROPOINT 0 -SATUR_LEVEL 1e9 -PSF_TYPE FILE \
        -PSF_NAME "$data/pairs/SDSS/${g}psfim.fits" -WEIGHT_TYPE MAP_RMS -RESCALE_WEIGHTS N \
        -WEIGHT_IMAGE "$data/pairs/SDSS/${g}sigma.fits"
done
"$python" "$here/pairs.py" "$data/pairs" "$restorers" "${galaxies[@]}" | tee pairs.md

# --- dwarf galaxies of low surface brightness: counts, sky not subtracted
for g in ic3478rss_256 vcc1512rss_cutout; do
    tile "dwarf_$g" "$data/sdss/galaxies/$g.fits" -GAIN 4.7 -SATUR_LEVEL 1e9 -BACK_SIZE 128 -PSF_TYPE FILE \
        -PSF_NAME "$data/sdss/galaxies/psf_moffat_35.fits"
done
"$python" "$here/dwarfs.py" "$data/sdss/galaxies" "$restorers" ic3478rss_256 vcc1512rss_cutout | tee dwarfs.md

# --- every other tile as a picture
bunzip2 -kc "$data/sdss/reprojected_sdss_r.fits.bz2" >reprojected_sdss_r.fits
bunzip2 -kc "$data/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2" >frame.fits
decam=$data/decam/c4d_171113_060340
odd=$data/odd/c4d_130105_065255
tile galaxies "$data/sextractor/galaxies.fits"
tile M67 "$data/fields/M6707HH.fits"
tile eso085-030 "$data/fields/aligned_eso085-030-004.fit"
tile spitzer "$data/fields/spitzer_example_image.fits"
tile M13 "$data/fields/M13_blue_0001.fits" -PSF_TYPE MOFFAT -PSF_FWHM 3
tile sdss-reprojected reprojected_sdss_r.fits
tile sdss-frame 'frame.fits[0]' -GAIN 987 -SATUR_LEVEL 1e9 -MAG_ZEROPOINT 22.5
tile decam "${decam}_ooi_r_ls9.N6.fits" -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE "${decam}_oow_r_ls9.N6.fits"
tile decam-a1 "${odd}_ooi_r_a1-N15.fits.fz" -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE "${odd}_oow_r_a1-N15.fits.fz"
for name in galaxies M67 eso085-030 spitzer M13 sdss-reprojected sdss-frame decam decam-a1; do
    [[ -f ${name}_NONE.fits ]] && "$python" "$here/picture.py" "$name" "$restorers" "$name.png"
done
echo "pictures: $out/*.png"
