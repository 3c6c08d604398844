#!/bin/sh
# The unit tests, tiles through the program, and the tests of whole programs under the thread sanitizer. Not part of
# `make check`, for it takes a build of its own and hours: `make check-tsan`, or
#
#   tests/tsan.sh [TEST...]    in an empty folder, where it builds; unit tests as base/test_text; par/, a folder; tiles;
#                              scripts as sim.sh or cli/run.sh
#
# RX_TIMEOUT is the limit of a unit test or tile in seconds (1800); one that needs longer is skipped.
# gcc's OpenMP library hides its barriers from the sanitizer, which then sees races that are none. So clang builds,
# with LLVM's library, whose tool Archer tells the sanitizer of them (Debian: clang, libomp-dev). That both work is tried
# first, with a race and without one. What is found is in report.* of the folder.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
clang=${CLANG:-clang}
command -v "$clang" >/dev/null || { echo 'tsan.sh: install clang and libomp-dev'; exit 77; }
here=$PWD
passed=0 failed=0 skipped=0
export TSAN_OPTIONS="ignore_noninstrumented_modules=1 exitcode=66 allocator_may_return_null=1 log_path=$here/report"
# The sanitizer's own memory is a file, so that it does not bear the limit on files that stands for a full disk.
export RX_TEST_NOT='disk full' OMP_WAIT_POLICY=passive
export srcdir="$top" RX_BUILD_DIR="$here" RX_PROGRAM="$here/rextract" RX_SHARED_DATA="${RX_SHARED_DATA-}"

# LLVM's library (14), watched by Archer, looks at the first thread that it has known: where that is a generator that has
# ended it crashes. So the main thread shall be the first, in every program that has the library.
cat >first.c <<'first'
#pragma weak omp_get_max_threads
int omp_get_max_threads(void);
__attribute__((constructor)) static void first(void)
{
    if (omp_get_max_threads)
        omp_get_max_threads();
}
first
"$clang" -shared -fPIC -o first.so first.c || exit 2
with_first() {
    LD_PRELOAD=$here/first.so "$@"
}

# A sum with and without a race, between two loops that a barrier parts.
cat >try.c <<'try'
#include <stdio.h>
int main(void)
{
    static int a[1000];
    int sum = 0;
#pragma omp parallel num_threads(2)
    {
#pragma omp for
        for (int i = 0; i < 1000; i++)
            a[i] = i;
#ifdef RACE
#pragma omp for
#else
#pragma omp for reduction(+ : sum)
#endif
        for (int i = 0; i < 1000; i++)
            sum += a[999 - i];
    }
    return printf("%d\n", sum) < 0;
}
try
"$clang" -g -O1 -fopenmp -fsanitize=thread -o try try.c && "$clang" -g -O1 -fopenmp -fsanitize=thread -DRACE -o race try.c ||
    { echo 'tsan.sh: install libomp-dev'; exit 77; }
with_first ./try >/dev/null || { echo 'tsan.sh: Archer is not there: races are seen that are none'; exit 2; }
with_first ./race >/dev/null 2>&1 && { echo 'tsan.sh: a race is not seen'; exit 2; }

cat >ended.c <<'ended'
#include <pthread.h>
#include <stddef.h>
static void *work(void *sum)
{
#pragma omp critical
    ++*(int *)sum;
    return NULL;
}
int main(void)
{
    int sum = 0;
    pthread_t thread;
    return pthread_create(&thread, NULL, work, &sum) || pthread_join(thread, NULL) || work(&sum) != NULL || sum != 2;
}
ended
"$clang" -g -O1 -fopenmp -fsanitize=thread -pthread -o ended ended.c || exit 2
with_first ./ended || { echo 'tsan.sh: the OpenMP library does not bear threads that have ended'; exit 2; }
rm -f report.*

# clang does not say that it sanitizes, as gcc does
[ -f Makefile ] || "$top/configure" CC="$clang" CFLAGS='-O1 -g -fsanitize=thread -D__SANITIZE_THREAD__' LDFLAGS=-fsanitize=thread --disable-shared \
    --without-mpi >configure.log 2>&1 || { tail configure.log; exit 2; }
make check TESTS= >make.log 2>&1 || { tail make.log; exit 2; }

# check TITLE COMMAND...
check() {
    title=$1
    shift
    with_first "$@" >out 2>&1
    code=$?
    if [ -n "$(find . -maxdepth 1 -name 'report.*')" ] || { [ $code != 0 ] && [ $code != 77 ] && [ $code != 124 ]; }; then
        failed=$((failed + 1))
        echo "FAILED: $title, exit code $code"
        grep -h 'SUMMARY' report.* 2>/dev/null | sort | uniq -c
        grep -A 5 -e '^FAILED' -e 'FAILED  ' out
        mkdir -p found
        find . -maxdepth 1 -name 'report.*' -exec mv {} found ';'
    elif [ $code = 0 ]; then
        passed=$((passed + 1))
    else
        skipped=$((skipped + 1))
        echo "skipped: $title$([ $code != 124 ] || echo ' takes too long')"
    fi
}

limited() {
    name=$1
    shift
    check "$name" timeout "${RX_TIMEOUT:-1800}" "$@"
}

tiles() {
    set -- ./rextract -c "$top/config/default.sex" -PARAMETERS_NAME "$top/config/default.param" -FILTER_NAME "$top/config/default.conv" \
        -CATALOG_TYPE FITS_LDAC -CATALOG_NAME out.cat -PSF_TYPE MOFFAT -PSF_FWHM 3 -NTHREADS 4 -RL_NITER 5 \
        "$top/tests/data/sim.fits.fz"
    limited 'Richardson-Lucy' "$@" -RESTORE_TYPE NONE,RL -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME b.fits -REFERENCE_NAME \
        "$top/tests/data/sim_truth.fits" -QA_NAME qa
    limited 'blind Richardson-Lucy' "$@" -RESTORE_TYPE RL_BLIND
    limited 'the network, BLIND' "$@" -RESTORE_TYPE NET -NET_MODEL "$top/config/psfnet-blind.fits"
    limited 'the network, INFORMED' "$@" -RESTORE_TYPE NET -NET_MODEL "$top/config/psfnet.fits"
    limited 'templates' "$@" -RESTORE_TYPE NONE -PARAMETERS_NAME "$top/config/template.param"
    limited 'self check' "$@" -RESTORE_TYPE NONE -SELF_CHECK Y -SELF_CHECK_NAME check
}

[ $# -gt 0 ] || set -- / tiles cli/run.sh sim.sh simulate.sh templates.sh campaign.sh train.sh
for wanted; do
    case $wanted in
    tiles) tiles ;;
    *.sh) check "$wanted" sh "$top/tests/$wanted" ;;
    *)
        find tests/unit -type f -name 'test_*' -perm -100 | sort | grep -- "/${wanted#/}" >list
        while read -r test <&3; do
            limited "$test" "./$test"
        done 3<list
        ;;
    esac
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
