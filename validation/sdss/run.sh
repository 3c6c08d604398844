#!/bin/bash
# The QA report of a real tile: SDSS frame r-000094-1-0012 (Stripe 82) against the deep coadd of the same sky, NONE,
# RL and NET (model: RX_MODEL, or config/psfnet.fits where there is one), with the PSF measured from the tile
# (PSF_TYPE AUTO) and with the model that the real psfex makes from our own catalogue (PSF_TYPE PSFEX).
#
#   validation/sdss/run.sh [FOLDER]      reports into FOLDER (default: sdss-out)
#
# Needs the data folder (RX_SHARED_DATA, or ../shared/data beside the sources), psfex, python3-astropy, bunzip2.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_PROGRAM:-$top/build/rextract}
data=${RX_SHARED_DATA:-$top/../shared/data}/sdss/94-1-12
out=${1:-sdss-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
[[ -d $data ]] || { echo "run.sh: $data is missing; the SDSS frame is not part of this repository" >&2; exit 2; }
# shellcheck disable=SC2034 # for restorers.sh
modules='numpy astropy'
restorers='' net=() python='' # set by the next line
# shellcheck source=/dev/null
. "$here/../restorers.sh"
mkdir -p "$out"
cd "$out"
bunzip2 -kc "$data/frame-r-000094-1-0012.fits.bz2" >frame.fits
gain=$("$python" "$here/reference.py" "$data/stripe82_coadd_catalog.fit" frame.fits 4.71 reference.fits)

# the camera saturates far above what this frame holds; SATUR_LEVEL is in nanomaggies here
common=(-GAIN "$gain" -MAG_ZEROPOINT 22.5 -SATUR_LEVEL 1e9)
cat >psfex.param <<'PARAM'
VIGNET(35,35)
X_IMAGE
Y_IMAGE
FLUX_RADIUS
SNR_WIN
FLUX_APER(1)
FLUXERR_APER(1)
ELONGATION
FLAGS
PARAM
"$program" 'frame.fits[0]' "${common[@]}" -RESTORE_TYPE NONE -CATALOG_TYPE FITS_LDAC -CATALOG_NAME stars.cat \
    -PARAMETERS_NAME psfex.param -PHOT_APERTURES 12
psfex stars.cat -PSF_SUFFIX .psf -PSFVAR_DEGREES 1 -CHECKPLOT_TYPE NONE -CHECKIMAGE_TYPE NONE -WRITE_XML N \
    -SAMPLE_MINSN 20 -VERBOSE_TYPE QUIET

for psf in AUTO PSFEX; do
    "$program" 'frame.fits[0]' "${common[@]}" -RESTORE_TYPE "$restorers" "${net[@]}" -PSF_TYPE "$psf" -PSF_NAME stars.psf \
        -CATALOG_NAME "$psf.cat" -CHECKIMAGE_TYPE RESTORED,RESIDUAL -CHECKIMAGE_NAME "$psf.fits,${psf}_residual.fits" \
        -REFERENCE_NAME reference.fits -MATCH_RADIUS 1 -MATCH_UNIT ARCSEC -QA_NAME "qa_$psf"
    echo "report: $out/qa_$psf/report.html"
done
