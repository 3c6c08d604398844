#!/bin/sh
# No byte of any output depends on the number of threads or on which of them does what: every restorer, template
# photometry, all images, constant and varying PSFs; and -c OUTPUT finds the same bytes each time. Threads that wait
# passively are woken in another order each time, the more so where they are more than the processors.
# shellcheck disable=SC3045 # dash and bash have ulimit -s
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
program=$programs/rextract
need rextract rextract-simulate rextract-validate rextract-train tests/cli/make_model tests/cli/make_fits
enter
OMP_WAIT_POLICY=passive
export OMP_WAIT_POLICY
blends=$top/tests/data/sim.fits.fz

"$build/tests/cli/make_model" model.fits || exit 2
python=
for candidate in python3 /usr/bin/python3; do
    "$candidate" -c 'import astropy.io.fits, numpy' 2>/dev/null && python=$candidate && break
done
# A PSFEx model whose width goes with the place on a tile of 512 pixels.
[ -z "$python" ] || "$python" - <<'END' || exit 2
import numpy as np
from astropy.io import fits
y, x = np.mgrid[-15:16, -15:16]
def gauss(fwhm):
    g = np.exp(-4 * np.log(2) * (x * x + y * y) / fwhm**2)
    return g / g.sum()
basis = np.array([gauss(3.0), gauss(3.5) - gauss(3.0), gauss(3.2) - gauss(3.0)], "f4")
t = fits.BinTableHDU.from_columns([fits.Column("PSF_MASK", f"{basis.size}E", dim="(31,31,3)", array=basis[None])], name="PSF_DATA")
t.header.update(POLNAXIS=2, POLNAME1="X_IMAGE", POLNAME2="Y_IMAGE", POLZERO1=256.0, POLZERO2=256.0, POLSCAL1=512.0, POLSCAL2=512.0,
                POLGRP1=1, POLGRP2=1, POLNGRP=1, POLDEG1=1, PSF_FWHM=3.0, PSF_SAMP=1.0, PSFNAXIS=3, PSFAXIS1=31, PSFAXIS2=31, PSFAXIS3=3)
t.writeto("varying.psf")
END

# run FOLDER THREADS TILE ARGUMENT...: catalogues with templates in FOLDER
run() {
    folder=$1 threads=$2 tile=$3
    shift 3
    mkdir "$folder"
    # glibc fills fresh memory with MALLOC_PERTURB_: what was not set first would show as other bytes
    (cd "$folder" && MALLOC_PERTURB_=$((1 + threads * 15)) "$program" "$tile" -NTHREADS "$threads" \
        -c "$top/config/default.sex" -PARAMETERS_NAME "$top/config/template.param" -FILTER N -CATALOG_NAME sim.cat \
        -CATALOG_TYPE FITS_LDAC -VERBOSE_TYPE QUIET "$@") >"$folder.log" 2>&1
}

# same TITLE RUNS THREADS TILE ARGUMENT...: as with one thread, with each of the THREADS, RUNS times over
same() {
    title=$1 runs=$2 several=$3
    shift 3
    rm -rf ./one* ./other*
    run one 1 "$@"
    code=$?
    [ $code -eq 0 ] || cat one.log >>difference
    for threads in $several; do
        left=$runs
        while [ "$left" -gt 0 ] && [ $code -eq 0 ]; do
            rm -rf other
            run other "$threads" "$@" && diff -r one other >difference 2>&1
            code=$?
            left=$((left - 1))
        done
    done
    result "$title" $code difference
    : >difference
}
: >difference

moffat='-PSF_TYPE MOFFAT -PSF_FWHM 3'
images='-TEMPLATE_COVAR_NAME covariances.fits -CHECKIMAGE_TYPE
    RESTORED,RESIDUAL,SUPPORT,TEMPLATE_RESIDUAL,TEMPLATE_MODEL,TEMPLATE_CHI,BACKGROUND,BACKGROUND_RMS,SEGMENTATION,OBJECTS,APERTURES
    -CHECKIMAGE_NAME 1.fits,2.fits,3.fits,4.fits,5.fits,6.fits,7.fits,8.fits,9.fits,10.fits,11.fits'
few='-RL_NITER 10'
# shellcheck disable=SC2086 # lists of arguments
{
    same 'templates after Richardson-Lucy, 16 threads, eight times' 8 16 "$blends" -RESTORE_TYPE RL $moffat
    for restorer in NONE RL RL_BLIND NET; do
        case $restorer in RL_BLIND) several='2 7' ;; *) several='2 7 16' ;; esac
        same "$restorer, templates and all images" 1 "$several" "${blends}[101:260,101:260]" -RESTORE_TYPE $restorer \
            -NET_MODEL ../model.fits $moffat $few $images -REFERENCE_NAME "$top/tests/data/sim_truth.fits" -QA_FIGURES N
    done
    if [ -n "$python" ]; then
        for restorer in RL NET; do
            same "$restorer behind a PSF that varies, templates" 2 '3 16' "${blends}[101:260,101:260]" -RESTORE_TYPE $restorer \
                -NET_MODEL ../model.fits -PSF_TYPE PSFEX -PSF_NAME ../varying.psf $few
        done
    else
        skip 'a PSF that varies' 'no python3 with astropy'
    fi

    rm -rf one
    run one 16 "${blends}[101:260,101:260]" -RESTORE_TYPE RL $moffat
    code=$?
    for _ in 1 2 3 4 5 6 7 8 9 10; do
        [ $code -eq 0 ] && "$program" -c one/sim.cat -CATALOG_NAME again.cat -NTHREADS 16 -VERBOSE_TYPE QUIET >one.log 2>&1
        code=$?
    done
    result 'a run with templates repeated ten times with 16 threads' $code one.log
}

# Threads that the system does not make: OpenMP's runtime would end the process. The limit is of those that live.
cat >few.c <<'END'
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
int pthread_create(pthread_t *thread, const pthread_attr_t *how, void *(*run)(void *), void *user)
{
    int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    *(void **)&real = dlsym(RTLD_NEXT, "pthread_create");
    int n = -2; /* . and .. */
    DIR *dir = opendir("/proc/self/task");
    while (dir != NULL && readdir(dir) != NULL)
        n++;
    if (dir != NULL)
        closedir(dir);
    return n < atoi(getenv("RX_MOST_THREADS")) ? real(thread, how, run, user) : EAGAIN;
}
END
${CC:-cc} -shared -fPIC -o few.so few.c 2>few.log || cat few.log

# limited MOST PROGRAM ARGUMENT...: with so many threads
limited() {
    most=$1
    shift
    ASAN_OPTIONS="verify_asan_link_order=0${ASAN_OPTIONS:+:$ASAN_OPTIONS}" RX_MOST_THREADS=$most LD_PRELOAD=$scratch/few.so "$@"
}

"$build/tests/cli/make_fits" tile a.fits && "$build/tests/cli/make_fits" small b.fits && printf '../a.fits\n../b.fits\n' >tiles.list || exit 2
list="@../tiles.list -c $top/config/default.sex -FILTER N -RESTORE_TYPE RL -RL_NITER 5 $moffat -PARAMETERS_NAME
    $top/config/template.param -CATALOG_NAME {tile}.cat -CATALOG_TYPE FITS_1.0 -NTHREADS"
mkdir alone
# shellcheck disable=SC2086 # a list of arguments
(cd alone && "$program" $list 1) >alone.log 2>&1
for most in 1 2 5; do
    rm -rf limited
    mkdir limited
    # shellcheck disable=SC2086
    (cd limited && limited $most "$program" $list 8) >limited.log 2>&1 &&
        [ "$(grep -c "8 threads cannot be made here; going on with $(((most + 1) / 2))" limited.log)" = 2 ] && diff -r alone limited >>limited.log
    result "a list where $most of 8 threads can be made" $? limited.log
done
# Small stacks: of threads, and of all.
# shellcheck disable=SC2086
for restorer in NONE RL RL_BLIND NET; do
    run small-$restorer 3 "$scratch/a.fits" -RESTORE_TYPE $restorer -NET_MODEL ../model.fits $moffat $few -SELF_CHECK Y -SELF_CHECK_COUNT 20 \
        -SELF_CHECK_NAME check -QA_FIGURES N &&
        (ulimit -s 512 && OMP_STACKSIZE=128k run smaller-$restorer 3 "$scratch/a.fits" -RESTORE_TYPE $restorer -NET_MODEL ../model.fits \
            $moffat $few -SELF_CHECK Y -SELF_CHECK_COUNT 20 -SELF_CHECK_NAME check -QA_FIGURES N) &&
        diff -r small-$restorer smaller-$restorer >>smaller-$restorer.log
    result "$restorer with templates and a self check on stacks of 128 kB" $? smaller-$restorer.log
done
(ulimit -s 512 && OMP_STACKSIZE=128k "$programs/rextract-simulate" -IMAGE_SIZE 64 -STAR_COUNT 3000 -GALAXY_COUNT 3000 -IMAGE_NAME i.fits \
    -SHARP_NAME s.fits -FLAG_NAME f.fits -TRUTH_NAME t.fits -NTHREADS 3) >small.log 2>&1
result 'rextract-simulate on stacks of 128 kB' $? small.log
(ulimit -s 512 && OMP_STACKSIZE=128k "$programs/rextract-validate" -CAMPAIGN_TYPE RESTORATION -SCENES_FWHM 2 -SCENES_SIGMA 2 -SCENE_SIDE 64 \
    -FWHM_RANGE 3,3 -SIGMA_RANGE 5,5 -TUNE_SCENES 1 -TUNE_NITER 5 -TUNE_FILTER 0,0.5 -QA_FIGURES N -OUTPUT_NAME campaign \
    -JOURNAL_NAME journal -NTHREADS 3) >small.log 2>&1
result 'rextract-validate on stacks of 128 kB' $? small.log
(ulimit -s 512 && OMP_STACKSIZE=128k "$programs/rextract-train" -EPOCHS 1 -WIDTH 4 -BLOCKS 1 -PATCH 48 -PATCH_MARGIN 8 -FIELD_PATCHES 2 \
    -GRID 1,1 -BIN_IMAGES 16 -QA_FIGURES N -NTHREADS 3) >small.log 2>&1
result 'rextract-train on stacks of 128 kB' $? small.log
limited 2 "$programs/rextract-simulate" -IMAGE_SIZE 64 -STAR_COUNT 3000 -IMAGE_NAME i.fits -SHARP_NAME s.fits -FLAG_NAME f.fits \
    -TRUTH_NAME t.fits -NTHREADS 8 >limited.log 2>&1 && grep -q 'going on with 1' limited.log
result 'rextract-simulate where 2 of 8 threads can be made' $? limited.log

finish
