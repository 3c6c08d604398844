#!/bin/sh
# The real psfex and scamp read the FITS_LDAC catalogue of a real tile, and psfex makes the same model of
# it as of SExtractor's own catalogue.
#   RX_PROGRAM      the rextract to test
#   RX_SHARED_DATA  folder of the real tiles
set -u
program=${RX_PROGRAM:-rextract}
data=${RX_SHARED_DATA:-}
passed=0
failed=0
skipped=0

finish() { # ends the script
    echo "$passed passed, $failed failed, $skipped skipped"
    [ "$failed" -eq 0 ]
    exit
}

skip() {
    echo "skipped: $1"
    skipped=$((skipped + 1))
}

verdict() { # text, command...
    text=$1
    shift
    if "$@"; then
        echo "passed: $text"
        passed=$((passed + 1))
    else
        echo "failed: $text"
        failed=$((failed + 1))
    fi
}

folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
packed=$data/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2
if [ -z "$data" ] || [ ! -f "$packed" ] || ! command -v bunzip2 >/dev/null; then
    skip "no SDSS frame in RX_SHARED_DATA"
    finish
fi
bunzip2 -c "$packed" >"$folder/frame.fits" || exit 1
conv=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)/config/default.conv
cd "$folder" || exit 1

for column in NUMBER 'VIGNET(35,35)' X_IMAGE Y_IMAGE FLUX_RADIUS SNR_WIN 'FLUX_APER(1)' 'FLUXERR_APER(1)' \
    ELONGATION FLAGS XWIN_IMAGE YWIN_IMAGE ERRAWIN_IMAGE ERRBWIN_IMAGE ERRTHETAWIN_IMAGE FLUX_AUTO \
    FLUXERR_AUTO X_WORLD Y_WORLD ERRA_WORLD ERRB_WORLD ERRTHETA_WORLD MAG_AUTO MAGERR_AUTO; do
    echo "$column"
done >wanted.param

extract() { # restorer, catalogue
    "$program" 'frame.fits[0]' -RESTORE_TYPE "$1" -FILTER_TYPE CONV -PARAMETERS_NAME wanted.param -CATALOG_TYPE FITS_LDAC \
        -CATALOG_NAME "$2" -MAG_ZEROPOINT 22.5 -GAIN 980 -PHOT_APERTURES 15 -VERBOSE_TYPE QUIET
}

model_fwhm() { # model file
    dd if="$1" bs=80 2>/dev/null | tr '\0' ' ' | fold -w 80 | sed -n 's/^PSF_FWHM= *\([0-9.Ee+-]*\).*/\1/p' | head -n 1
}

# SExtractor's catalogue of the same tile, with the same settings, must give the same model.
same_model() {
    source-extractor 'frame.fits[0]' -c /dev/null -PARAMETERS_NAME wanted.param -CATALOG_TYPE FITS_LDAC \
        -CATALOG_NAME theirs.cat -MAG_ZEROPOINT 22.5 -GAIN 980 -PHOT_APERTURES 15 -VERBOSE_TYPE QUIET \
        -FILTER_NAME "$conv" || return 1
    psfex_reads theirs.cat || return 1
    ours=$(model_fwhm frame.psf)
    theirs=$(model_fwhm theirs.psf)
    echo "PSF_FWHM: ours $ours, SExtractor's $theirs pixels"
    awk -v a="$ours" -v b="$theirs" 'BEGIN { exit !(a > 0 && b > 0 && a / b > 0.99 && a / b < 1.01) }'
}

psfex_reads() {
    psfex "$1" -c /dev/null -WRITE_XML N -CHECKPLOT_TYPE NONE -CHECKIMAGE_TYPE NONE -NTHREADS 1 \
        -SAMPLE_MINSN 20 -PSF_SUFFIX .psf >psfex.log 2>&1 || { cat psfex.log; return 1; }
}

# The catalogue is its own reference: what matters is that scamp takes the header and the columns.
scamp_reads() {
    scamp "$1" -c /dev/null -ASTREF_CATALOG FILE -ASTREFCAT_NAME "$1" -ASTREFCENT_KEYS X_WORLD,Y_WORLD \
        -ASTREFERR_KEYS ERRA_WORLD,ERRB_WORLD,ERRTHETA_WORLD -ASTREFMAG_KEY MAG_AUTO \
        -ASTREFMAGERR_KEY MAGERR_AUTO -DISTORT_DEGREES 1 -SOLVE_PHOTOM N -CHECKPLOT_TYPE NONE -WRITE_XML N \
        -NTHREADS 1 >scamp.log 2>&1 || { cat scamp.log; return 1; }
    grep -q '^CRVAL1' "${1%.cat}.head"
}

# A PSF that fits leaves residuals of the noise's own size: reduced chi2 near 1.
restored_with_model() {
    "$program" 'frame.fits[0]' -RESTORE_TYPE RL -PSF_TYPE PSFEX -PSF_NAME frame.psf -PARAMETERS_NAME wanted.param \
        -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -CATALOG_NAME restored.cat -GAIN 980 -SATUR_LEVEL 1e9 -VERBOSE_TYPE QUIET || return 1
    chi2=$(dd if=restored.cat bs=80 2>/dev/null | tr '\0' ' ' | fold -w 80 |
        sed -n 's/^RXCHI2 *= *\([0-9.]*\).*/\1/p' | head -n 1)
    echo "reduced chi2 with the psfex model: $chi2"
    [ "$(echo "$chi2" | awk '{ print ($1 > 0.9 && $1 < 1.1) }')" = 1 ]
}

verdict "rextract writes FITS_LDAC" extract NONE frame.cat
[ "$failed" -eq 0 ] || finish
if command -v psfex >/dev/null; then
    verdict "psfex models the stars of the catalogue" psfex_reads frame.cat
    verdict "Richardson-Lucy takes that model" restored_with_model
else
    skip "psfex is not installed"
fi
if command -v psfex >/dev/null && command -v source-extractor >/dev/null; then
    verdict "its model is the one it makes of SExtractor's catalogue" same_model
else
    skip "psfex or source-extractor is not installed"
fi
if command -v scamp >/dev/null; then
    verdict "scamp solves the field" scamp_reads frame.cat
else
    skip "scamp is not installed"
fi
finish
