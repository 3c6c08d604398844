#!/bin/sh
# Calls of the system that fail, and kills, at every moment: trouble.c strikes one call after another of whole runs.
# RX_TROUBLE_STEP: the distance of the calls that are struck (1: every one, minutes). RX_TROUBLE_SHARE=n: n times that of each case.
# RX_TROUBLE_ONLY: a regular expression of the cases.
set -u
LC_ALL=C
export LC_ALL
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
. "$top/tests/lib.sh"
need rextract rextract-simulate rextract-survey rextract-validate rextract-train tests/fault/trouble tests/cli/make_fits
make_fits=$build/tests/cli/make_fits
trouble=$build/tests/fault/trouble
enter
ASAN_OPTIONS=detect_leaks=0${ASAN_OPTIONS:+:$ASAN_OPTIONS}
TMPDIR=. # nothing must be left there
export ASAN_OPTIONS TMPDIR
strikes=0

"$make_fits" small tile.fits && "$make_fits" table ref.fits || exit 2
printf 'recall all >= 0.01\nbias_mag all in -3:3\n' >my.qa
printf 'NUMBER\nFLUX_TEMPLATE\nXTEMPLATE_IMAGE\n' >template.param
printf '../tile.fits\n' >tiles.list
"$programs/rextract" tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -RECORD_NAME all.records -REFERENCE_NAME ref.fits \
    -QA_NAME qa -QA_FIGURES N -VERBOSE_TYPE QUIET || exit 2

mkdir made
(cd made && "$programs/rextract" ../tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -CATALOG_NAME x.cat -CHECKIMAGE_TYPE \
    SEGMENTATION -CHECKIMAGE_NAME s.fits -VERBOSE_TYPE QUIET) || exit 2
cat >campaign.conf <<'END'
CAMPAIGN_TYPE RESTORATION
RESTORE_TYPE  NONE
SCENES_FWHM   2
SCENES_SIGMA  2
SCENE_SIDE    64
FWHM_RANGE    2,4
EXAMPLES      1
QA_FIGURES    N
JOURNAL_NAME  journal
OUTPUT_NAME   report
END
cat >train.conf <<'END'
EPOCHS          2
WIDTH           4
BLOCKS          1
PATCH           32
PATCH_MARGIN    7
FIELD_PATCHES   1
GRID            1,1
BIN_IMAGES      12
BATCH           2
QA_FIGURES      N
MODEL_NAME      model.fits
CHECKPOINT_NAME checkpoint
OUTPUT_NAME     training
END

# struck NAME STEP PROGRAM ARGUMENT...: with every STEP-th call, or $RX_TROUBLE_STEP, of each kind of trouble. The older
# outputs come from another threshold or seed, as the variable older says; none where it is -.
struck() {
    name=$1 step=${RX_TROUBLE_STEP:-$(($2 * ${RX_TROUBLE_SHARE:-1}))} program=$programs/$3
    shift 3
    printf '%s\n' "$name" | grep -Eq -- "${RX_TROUBLE_ONLY:-.}" || return 0
    rm -rf old new
    mkdir old
    # shellcheck disable=SC2086 # a list of arguments
    { [ "$older" = - ] || (cd old && "$program" "$@" $older); } >log 2>&1 && cp -a old new && (cd new && "$program" "$@") >>log 2>&1 || {
        result "$name: an undisturbed run" 1 log
        return 0
    }
    for kind in ENOSPC FULL EIO EINTR SHORT KILL; do
        strikes=$((strikes + 3))
        first=$((1 + strikes % (step < 8 ? step : 8)))
        "$trouble" $kind $first "$step" "$program" "$@" >said 2>&1
        code=$?
        if [ $code -eq 77 ]; then
            skip "$name, $kind" 'the kernel hands no calls over (seccomp)'
        else
            result "$name, $kind, first $first, step $step" $code
        fi
        [ -z "${RX_TROUBLE_STEP-}" ] && [ $code -eq 0 ] || sed 's/^/    | /' said
    done
}

older='-DETECT_THRESH 5'
quiet='-VERBOSE_TYPE QUIET -NTHREADS 1'
# shellcheck disable=SC2086 # lists of arguments
{
    struck 'FITS_LDAC, check-images, report, record' 29 rextract ../tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE FITS_LDAC \
        -CHECKIMAGE_TYPE RESTORED,SEGMENTATION -CHECKIMAGE_NAME r.fits,s.fits -REFERENCE_NAME ../ref.fits -QA_NAME qa \
        -QA_FIGURES N -QA_GATES ../my.qa -RECORD_NAME record.txt $quiet
    struck 'VOTable, templates and their covariances' 41 rextract ../tile.fits -RESTORE_TYPE NONE -PSF_TYPE MOFFAT \
        -PSF_FWHM 2.5 -CATALOG_TYPE ASCII_VOTABLE -PARAMETERS_NAME ../template.param -TEMPLATE_COVAR_NAME c.xml $quiet
    struck 'ASCII_HEAD, two restorers' 37 rextract ../tile.fits -RESTORE_TYPE NONE,RL -RL_NITER 2 -PSF_TYPE MOFFAT \
        -PSF_FWHM 3 -CATALOG_TYPE ASCII_HEAD $quiet
    struck 'a list of tiles' 37 rextract @../tiles.list -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -CATALOG_NAME %.cat $quiet
    if command -v gnuplot >/dev/null; then
        struck 'report with figures' 97 rextract ../tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -REFERENCE_NAME \
            ../ref.fits -QA_NAME qa $quiet
    else
        skip 'report with figures' 'no gnuplot'
    fi
    older='-MAG_RANGE 10,20'
    struck 'the roll-up of a survey' 23 rextract-survey ../all.records -OUTPUT_NAME survey -MERGED_NAME all -QA_FIGURES N \
        -VERBOSE_TYPE QUIET
    older='-SEED 7'
    struck 'a simulated field' 37 rextract-simulate -IMAGE_SIZE 48 -STAR_COUNT 3000 -GALAXY_COUNT 0 -PSF_FWHM 3 -IMAGE_NAME \
        i.fits -SHARP_NAME s.fits -FLAG_NAME f.fits -TRUTH_NAME t.fits $quiet
    older='-SEED 7 -JOURNAL_NAME ../older.journal'
    struck 'a campaign' 61 rextract-validate ../campaign.conf $quiet
    older='-EPOCHS 1'
    struck 'a training that goes on' 61 rextract-train ../train.conf $quiet
    older=-
    struck 'a run repeated' 61 rextract -c ../made/x.cat -CATALOG_NAME x.cat -CHECKIMAGE_NAME s.fits $quiet
}

finish
