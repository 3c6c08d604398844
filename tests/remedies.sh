#!/bin/sh
# Each remedy that a message names is carried out, and must act: the cases of tests/remedies.txt, by tests/remedies.py, which
# says how they are written. RX_TEST_ONLY=REGEX: the cases alone whose command or remedy matches.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract rextract-simulate rextract-survey rextract-validate rextract-train tests/cli/make_fits tests/cli/make_model
command -v python3 >/dev/null || {
    skip 'remedies' 'python3 is not installed'
    finish
}
enter
none='rextract ../tile.fits -c /dev/null -RESTORE_TYPE NONE'
moffat="$none -PSF_TYPE MOFFAT -PSF_FWHM 3"
sky="rextract ../sky.fits -c /dev/null -RESTORE_TYPE NONE -MAG_ZEROPOINT_KEY MAGZERO"
simulate='rextract-simulate -IMAGE_SIZE 64'
validate='rextract-validate -c ../tiny.conf'
train='rextract-train -c ../training.conf'
few='-SELF_CHECK_COUNT 20'
export top none moffat sky simulate validate train few
PATH=$programs:$build/tests/cli:$PATH OMP_NUM_THREADS=1
export PATH OMP_NUM_THREADS

# What the cases read, one folder up, and how they begin.
cat "$top/tests/data/campaign.conf" - >tiny.conf <<'END'
MAGNITUDES     17,17,1
TILES          1,1
SCENE_TILES    1,1
STARS_PER_TILE 400
SIM.IMAGE_SIZE 128
END
cat "$top/tests/data/training.conf" >training.conf
make_fits tile tile.fits 'GAIN    = 10' && make_fits psf psf.fits && make_fits table table.fits && make_fits extensions two.fits 'GAIN    = 10' &&
    make_fits ones ones.fits && make_fits cube cube.fits && make_fits small small.fits && make_fits calexp calexp.fits && make_fits nan nan.fits && make_fits flat flat.fits &&
    { head -c 2880 two.fits && tail -c 40320 two.fits; } >second.fits &&
    make_model model.fits && rextract-simulate -IMAGE_SIZE 200 -SEED 3 -STAR_COUNT 3000 -STAR_MAG 14,20 -GALAXY_COUNT 500 -NOISE_SIGMA 5 -PSF_FWHM 3.5 \
    -MAG_ZEROPOINT 25 -GAIN 5 -IMAGE_NAME sky.fits -TRUTH_NAME sky.truth -WEIGHT_NAME w200.fits >log 2>&1 &&
    rextract-simulate -IMAGE_SIZE 300 -STAR_COUNT 600 -STAR_MAG 14,17 -GALAXY_COUNT 0 -LEAST_DISTANCE 5 -NOISE_SIGMA 5 -PSF_FWHM 3 -GAIN 5 -IMAGE_NAME many.fits \
        -TRUTH_NAME NONE >>log 2>&1
awk 'BEGIN { print "NNW 2 10 1"; for (i = 0; i < 10; i++) print 0; for (i = 0; i < 10; i++) print 1; for (i = 0; i < 11; i++) print 0; print "0 1" }' \
    >default.nnw
result 'inputs' $? log
[ "$failed" -eq 0 ] || finish
PYTHONDONTWRITEBYTECODE=1 python3 "$top/tests/remedies.py" "$top/src" "${1:-$top/tests/remedies.txt}" "$scratch"
