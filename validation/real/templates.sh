#!/bin/bash
# Template photometry on real sky: what the templates leave of every tile, in numbers (chi2 of the pixels they cover) and
# pictures (original, model, residual), and magnitudes on an SDSS frame against the deep coadd of the same sky.
#
#   validation/real/templates.sh [FOLDER]      into FOLDER (default: templates-out): chi2.md, sdss.md, *.png
#
# RX_MODEL names the network's model (default: config/psfnet.fits; without one NET does not take part). Needs the data
# folder (RX_SHARED_DATA, or ../shared/data beside the sources), psfex, python3 with astropy and scipy, bunzip2; pictures
# are drawn where matplotlib is installed.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_PROGRAM:-$top/build/rextract}
data=$(cd "${RX_SHARED_DATA:-$top/../shared/data}" && pwd)
out=${1:-templates-out}
[[ -x $program ]] || { echo "templates.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")
# shellcheck disable=SC2034 # for restorers.sh
modules='numpy astropy scipy'
restorers='' net=() python='' # set by the next line
# shellcheck source=/dev/null
. "$here/../restorers.sh"
mkdir -p "$out"
cd "$out"
export PYTHONWARNINGS=ignore
printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLUX_AUTO FLUXERR_AUTO FLUX_TEMPLATE FLUXERR_TEMPLATE SNR_TEMPLATE CHI2_TEMPLATE \
    BLEND_TEMPLATE CLASS_TEMPLATE FLAGS FLAGS_TEMPLATE FLAGS_RESTORE >templates.param

names=()
# tile NAME IMAGE OPTION...: NAME_<restorer>.cat, _image_, _model_, _residual_ and _chi_<restorer>.fits
tile() {
    local name=$1 image=$2
    shift 2
    names+=("$name")
    "$program" "$image" -RESTORE_TYPE "$restorers" "${net[@]}" -VERBOSE_TYPE QUIET -CATALOG_TYPE FITS_1.0 \
        -CATALOG_NAME "$name.cat" -PARAMETERS_NAME templates.param \
        -CHECKIMAGE_TYPE IDENTICAL,-BACKGROUND,TEMPLATE_MODEL,TEMPLATE_RESIDUAL,TEMPLATE_CHI \
        -CHECKIMAGE_NAME "${name}_raw.fits,${name}_image.fits,${name}_model.fits,${name}_residual.fits,${name}_chi.fits" \
        "$@" || echo "templates.sh: $name failed" >&2
}
bunzip2 -kc "$data/sdss/reprojected_sdss_r.fits.bz2" >reprojected_sdss_r.fits
bunzip2 -kc "$data/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2" >frame.fits
decam=$data/decam/c4d_171113_060340
odd=$data/odd/c4d_130105_065255
tile galaxies "$data/sextractor/galaxies.fits" -PSF_TYPE PSFEX -PSF_NAME "$data/sextractor/default.psf"
tile galaxies-auto "$data/sextractor/galaxies.fits"
tile M67 "$data/fields/M6707HH.fits"
tile eso085-030 "$data/fields/aligned_eso085-030-004.fit"
tile spitzer "$data/fields/spitzer_example_image.fits"
tile M13 "$data/fields/M13_blue_0001.fits" -PSF_TYPE MOFFAT -PSF_FWHM 3
tile sdss-reprojected reprojected_sdss_r.fits
tile sdss-frame 'frame.fits[0]' -GAIN 987 -SATUR_LEVEL 1e9 -MAG_ZEROPOINT 22.5
tile decam "${decam}_ooi_r_ls9.N6.fits" -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE "${decam}_oow_r_ls9.N6.fits"
tile decam-a1 "${odd}_ooi_r_a1-N15.fits.fz" -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE "${odd}_oow_r_a1-N15.fits.fz"
"$python" "$here/templates.py" chi2 "$restorers" "${names[@]}" | tee chi2.md
for name in "${names[@]}"; do
    [[ -f ${name}_model_NONE.fits ]] && "$python" "$here/templates.py" picture "$restorers" "$name" "$name.png"
done

# --- the SDSS frame against the deep coadd, PSF model by psfex from our own catalogue
gain=$("$python" "$here/../sdss/reference.py" "$data/sdss/94-1-12/stripe82_coadd_catalog.fit" frame.fits 4.71 reference.fits)
common=(-GAIN "$gain" -MAG_ZEROPOINT 22.5 -SATUR_LEVEL 1e9)
printf '%s\n' 'VIGNET(35,35)' X_IMAGE Y_IMAGE FLUX_RADIUS SNR_WIN 'FLUX_APER(1)' 'FLUXERR_APER(1)' ELONGATION FLAGS >psfex.param
"$program" 'frame.fits[0]' "${common[@]}" -VERBOSE_TYPE QUIET -RESTORE_TYPE NONE -CATALOG_TYPE FITS_LDAC \
    -CATALOG_NAME stars.cat -PARAMETERS_NAME psfex.param -PHOT_APERTURES 12
psfex stars.cat -PSF_SUFFIX .psf -PSFVAR_DEGREES 1 -CHECKPLOT_TYPE NONE -CHECKIMAGE_TYPE NONE -WRITE_XML N \
    -SAMPLE_MINSN 20 -VERBOSE_TYPE QUIET
for mag in MAG_AUTO MAG_TEMPLATE; do
    "$program" 'frame.fits[0]' "${common[@]}" -VERBOSE_TYPE QUIET -RESTORE_TYPE "$restorers" "${net[@]}" -PSF_TYPE PSFEX \
        -PSF_NAME stars.psf -CATALOG_NAME "sdss_$mag.cat" -PARAMETERS_NAME templates.param -REFERENCE_NAME reference.fits \
        -MATCH_RADIUS 1 -MATCH_UNIT ARCSEC -QA_MAG "$mag" -QA_MAG_RANGE 15,23,1 -QA_NAME "qa_$mag"
done
"$python" "$here/templates.py" sdss "$restorers" qa_MAG_AUTO qa_MAG_TEMPLATE | tee sdss.md
echo "pictures: $out/*.png; reports: $out/qa_*/report.html"
