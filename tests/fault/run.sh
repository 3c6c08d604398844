#!/bin/sh
# Memory that runs out, anywhere: fault.c refuses one request after another, the first from each place in the program.
# RX_FAULT_LAST: up to which number every single one is tried (RX_FAULT_LAST=1000: minutes, with a case more).
# RX_FAULT_SHARE=n: one place in n. Then the same in all libraries, by refuse.c loaded before them, where a place is tried with that
# request refused and with all from there on: one place in ten, as every one (RX_FAULT_LIBRARIES=1) takes five minutes of a core.
# RX_FAULT_ONLY: a regular expression of the cases.
set -u
LC_ALL=C
export LC_ALL
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
. "$top/tests/lib.sh"
need rextract rextract-simulate tests/fault/fault tests/fault/fault_simulate tests/fault/fault_survey tests/cli/make_fits tests/cli/make_model
make_fits=$build/tests/cli/make_fits
make_model=$build/tests/cli/make_model
last=${RX_FAULT_LAST:-0}
enter
# What a run that is about to end still holds goes with it.
ASAN_OPTIONS=detect_leaks=0${ASAN_OPTIONS:+:$ASAN_OPTIONS}
TMPDIR=. # nothing must be left there
export ASAN_OPTIONS TMPDIR

# A sanitizer has to be the only one that stands before the C library's memory.
if grep -q __asan_init "$build/tests/fault/fault"; then
    skip 'memory refused in all libraries' 'a sanitizer takes the place of malloc()'
else
    ${CC:-cc} -O1 -shared -fPIC -o refuse.so "$top/tests/fault/refuse.c" -ldl 2>log || result 'refuse.c' 1 log
fi

# Coordinates with distortions have wcslib ask for the most.
"$make_fits" small tile.fits && "$make_fits" tile big.fits "CTYPE1  = 'RA---TAN-SIP'" "CTYPE2  = 'DEC--TAN-SIP'" 'CRVAL1  = 150.' \
    'CRVAL2  = 2.' 'CRPIX1  = 48.' 'CRPIX2  = 48.' 'CD1_1   = -1E-4' 'CD2_2   = 1E-4' "CUNIT1  = 'deg'" "CUNIT2  = 'deg'" \
    'A_ORDER = 2' 'B_ORDER = 2' 'A_2_0   = 1E-6' 'B_0_2   = 2E-6' && "$make_fits" ones weight.fits &&
    "$make_fits" table ref.fits && "$make_fits" psf psf.fits && mkdir folder &&
    "$make_model" model.fits TWO && "$make_fits" psf-large folder/galaxy_r.fits && "$make_fits" psf folder/galaxy_psf.fits || exit 2
# As small as holds enough stars for a PSF of pixels.
"$programs/rextract-simulate" -IMAGE_SIZE 64 -PSF_FWHM 3.05 -STAR_COUNT 14000 -STAR_MAG 15,17 -LEAST_DISTANCE 3 -SEED 2 -GALAXY_COUNT 0 \
    -IMAGE_NAME stars.fits -TRUTH_NAME NONE -VERBOSE_TYPE QUIET || exit 2
printf 'recall all >= 0.01\nbias_mag all in -3:3\n' >my.qa
printf 'DETECT_THRESH 2\nPHOT_APERTURES 3,5\n' >my.sex
printf 'CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >my.conv
printf 'NUMBER\nX_IMAGE\nMAG_AUTO\nVECTOR_ASSOC(2)\nVIGNET(5,5)\nALPHA_J2000\n' >my.param
printf '# ID X_IMAGE Y_IMAGE\na 20 30\nb 20 30\nc nan 1\n' >positions.list
printf 'NUMBER\nFLUX_TEMPLATE\nXTEMPLATE_IMAGE\nALPHATEMPLATE_J2000\nFLAGS_RESTORE\n' >template.param
printf '13.1 12.2 3.0\n37.0 12.0 4.0\n' >my.list
printf '../tile.fits\n' >tiles.list

# refuse NAME ARGUMENT... and refuse_simulate NAME ARGUMENT...: rextract and rextract-simulate
refuse() {
    refuse_of fault "$@" -NTHREADS 1
}

refuse_simulate() {
    refuse_of fault_simulate "$@" -SHARP_NAME s.fits -FLAG_NAME f.fits -NTHREADS 1
}

refuse_of() {
    program=$1
    name=$2
    shift 2
    printf '%s\n' "$name" | grep -Eq -- "${RX_FAULT_ONLY:-.}" || return 0
    "$build/tests/fault/$program" "$last" "$scratch/$program.places" "$@" -VERBOSE_TYPE QUIET >log 2>&1
    result "$name" $?
    sed 's/^/    | /' log
    [ -e refuse.so ] || return 0
    for all in 0 1; do
        RX_FAULT_ALL=$all RX_FAULT_SHARE=$((${RX_FAULT_LIBRARIES:-10} * ${RX_FAULT_SHARE:-1})) LD_PRELOAD="$scratch/refuse.so" "$build/tests/fault/$program" 0 \
            "$scratch/$program.libraries.$all" "$@" -VERBOSE_TYPE QUIET >log 2>&1
        result "$name, in libraries$([ $all -eq 0 ] || echo ', all from there on')" $?
        sed 's/^/    | /' log
    done
}

refuse 'two restorers, check-images, report and gates' ../tile.fits -RESTORE_TYPE NONE,RL -RL_NITER 2 \
    -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_TYPE FITS_LDAC -CHECKIMAGE_TYPE RESTORED,SEGMENTATION,RESIDUAL \
    -CHECKIMAGE_NAME r.fits,s.fits,x.fits -REFERENCE_NAME ../ref.fits -QA_FIGURES N -QA_GATES ../my.qa
refuse 'configuration, columns, filter, weights and a list to associate with' ../big.fits -c ../my.sex -RL_NITER 2 \
    -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_TYPE ASCII_VOTABLE -PARAMETERS_NAME ../my.param -FILTER_NAME ../my.conv \
    -ASSOC_NAME ../my.list -ASSOC_PARAMS 1,2,3 -ASSOC_DATA 1,2 -ASSOCSELEC_TYPE ALL -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE ../weight.fits
refuse 'a PSF of stars' ../stars.fits -RL_NITER 2 -PSF_TYPE AUTO -CATALOG_TYPE ASCII
refuse 'blind restoration' ../tile.fits -RESTORE_TYPE RL_BLIND \
    -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_TYPE FITS_1.0
refuse 'a network of two stages, verified' ../tile.fits -RESTORE_TYPE NET -NET_MODEL ../model.fits -VERIFY_SEAMS Y -NET_BLOCK 32 \
    -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_TYPE FITS_1.0 -CHECKIMAGE_TYPE RESIDUAL -CHECKIMAGE_NAME x.fits
refuse 'two images' ../tile.fits,../tile.fits -RL_NITER 2 -PSF_TYPE MOFFAT -PSF_FWHM 3 -MEASURE_ON ORIGINAL \
    -CATALOG_TYPE ASCII
refuse 'templates, their images and covariances' ../tile.fits -RESTORE_TYPE NONE,RL -RL_NITER 2 -PSF_TYPE MOFFAT -PSF_FWHM 2.5 \
    -CATALOG_TYPE FITS_LDAC -PARAMETERS_NAME ../template.param -TEMPLATE_COVAR_NAME c.fits -PRECISION_TARGET 0.9 \
    -DETECT_THRESH 0.6 -CHECKIMAGE_TYPE TEMPLATE_RESIDUAL,TEMPLATE_CHI -CHECKIMAGE_NAME r.fits,x.fits
refuse 'templates of two images' ../tile.fits,../tile.fits -RESTORE_TYPE NONE -PSF_TYPE MOFFAT -PSF_FWHM 2.5 \
    -CATALOG_TYPE ASCII -PARAMETERS_NAME ../template.param -TEMPLATE_COVAR_NAME c.txt -POSITIONS_NAME ../positions.list

refuse 'a list of tiles' @../tiles.list -RESTORE_TYPE NONE -CATALOG_TYPE ASCII -CATALOG_NAME '{tile}.cat'
[ "$last" -eq 0 ] || refuse 'injected sources and their report' ../tile.fits -RESTORE_TYPE NONE -PSF_TYPE MOFFAT -PSF_FWHM 3 \
    -CATALOG_TYPE NONE -REFERENCE_NAME ../ref.fits -QA_NAME qa -SELF_CHECK Y -SELF_CHECK_COUNT 20 -SELF_CHECK_NAME check -QA_FIGURES N
"$programs/rextract" tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -RECORD_NAME all.records -REFERENCE_NAME ref.fits \
    -QA_NAME qa -QA_FIGURES N -VERBOSE_TYPE QUIET || exit 2
refuse_of fault_survey 'the roll-up of a survey' ../all.records -OUTPUT_NAME survey -MERGED_NAME all -QA_FIGURES N
mkdir made && (cd made && "$programs/rextract" ../tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -CATALOG_NAME x.cat \
    -CHECKIMAGE_TYPE SEGMENTATION -CHECKIMAGE_NAME s.fits -VERBOSE_TYPE QUIET)
refuse 'a run repeated' -c ../made/x.cat -CATALOG_NAME x.cat -CHECKIMAGE_NAME s.fits

refuse_simulate 'a simulated field' -IMAGE_SIZE 64,48 -STAR_COUNT 3000 -GALAXY_COUNT 3000 -PSF_FWHM 3 \
    -TRUTH_TYPE ASCII_HEAD
refuse_simulate 'a PSF that varies, the noise of a detector, pairs and distances' -IMAGE_SIZE 64 -STAR_COUNT 3000 \
    -GALAXY_COUNT 3000 -PSF_FWHM 3 -PSF_RATIO 0.8 -PSF_VARIATION 0.2 -NOISE_TYPE CCD -GAIN 2 -SKY_LEVEL 100 \
    -SATUR_LEVEL 4000 -BAD_COLUMNS 0.05 -COSMIC_RAYS 3000 -LEAST_DISTANCE 1 -PAIR_SHARE 0.3 -TRUTH_TYPE ASCII_VOTABLE
refuse_simulate 'templates' -IMAGE_SIZE 48 -STAR_COUNT 0 -GALAXY_COUNT 0 -PSF_TYPE FILE -PSF_NAME ../psf.fits \
    -TEMPLATE_NAME ../folder -TEMPLATE_COUNT 3000 -TEMPLATE_SCALE 0.1
refuse_simulate 'injection away from the sources' -INJECT_IMAGE ../big.fits -PSF_FWHM 3 -STAR_COUNT 500 \
    -INJECT_PLACE AWAY -INJECT_DISTANCE 1 -TRUTH_TYPE FITS_LDAC
refuse_simulate 'injection with a configuration' -INJECT_IMAGE ../big.fits -PSF_FWHM 3 -INJECT_CONFIG ../my.sex

# ladder: a limit of memory, from what the program cannot be loaded with to more than it takes. Each step ends with status 4
# and one line, or with the same bytes.
ladder() {
    mkdir free limited
    set -- "$programs/rextract" ../big.fits -RESTORE_TYPE RL,NET -RL_NITER 3 -NET_MODEL ../model.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 \
        -CATALOG_TYPE FITS_LDAC -PARAMETERS_NAME ../template.param -NTHREADS 2 -VERBOSE_TYPE QUIET
    (cd free && "$@") >log 2>&1 || return 1
    wrong=0 refused=0
    for megabytes in 28 34 38 42 45 46 48 52 64 120; do
        # shellcheck disable=SC3045 # dash and bash have ulimit -v
        (cd limited && ulimit -v $((1024 * megabytes)) && "$@") >said 2>&1
        code=$?
        if [ $code -eq 0 ] && diff -r free limited >/dev/null && [ ! -s said ]; then
            :
        elif [ $code -eq 4 ] && [ "$(wc -l <said)" -eq 1 ] && grep -q memory said && [ -z "$(ls -A limited)" ]; then
            refused=$((refused + 1))
        elif [ $code -ne 127 ]; then # the loader's
            echo "$megabytes MB: exit code $code: $(ls -A limited) $(cat said)" && wrong=$((wrong + 1))
        fi
        find limited -mindepth 1 -delete
    done
    echo "$refused steps refused"
    [ $wrong -eq 0 ]
} >ladder.log 2>&1
# shellcheck disable=SC3045 # dash and bash have ulimit -v
if [ -e refuse.so ] && printf 'a ladder of limits\n' | grep -Eq -- "${RX_FAULT_ONLY:-.}"; then
    ladder
    result 'a ladder of limits' $?
    sed 's/^/    | /' ladder.log
fi

finish
