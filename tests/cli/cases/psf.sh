# How the PSF of a tile comes about, rung by rung, and what headers say of it.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

# stars IMAGE NUMBER ARGUMENT...: a tile of 200 x 200 pixels with about so many bright stars of FWHM 3
stars() {
    [ "$active" = 1 ] || return 0
    image=$1 count=$2
    shift 2
    "$programs/rextract-simulate" -IMAGE_NAME "$image" -IMAGE_SIZE 200 -GALAXY_COUNT 0 -STAR_COUNT $((25 * count)) -STAR_MAG 14,16 \
        -LEAST_DISTANCE 6 -PSF_FWHM 3 -SEED 3 -TRUTH_NAME '' -VERBOSE_TYPE QUIET "$@"
}

# facts PATTERN...: each is a line of the head of test.cat, which is an ASCII catalogue
facts() {
    for pattern in "$@"; do
        grep -Eq "^# $pattern\$" test.cat || echo "no line '$pattern' in test.cat" >>../err
    done
}

# rung ARGUMENTS PATTERN...
rung() {
    arguments=$1
    shift
    if [ "$active" = 1 ]; then
        leaves test.cat
        run tile.fits -c /dev/null -CATALOG_TYPE ASCII_HEAD -HEADER_FACTS ALL -VERBOSE_TYPE QUIET $arguments
        facts "$@"
        judge 0 ''
    fi
}

begin 'PSF of pixels'
stars tile.fits 60
rung '' 'RXPSF = AUTO: pixels .*' 'RXFWHM = (2\.9|3\.0).*' 'RXPSFHOW = PIXELS' 'RXPSFNST = [2-9][0-9]' 'RXPSFNRS = [0-9]+' \
    'RXPSFDEG = 0' 'RXPSFRAD = [0-9.]+' 'RXPSFOUT = [0-9.E-]+' 'RXPSFERR = 0\.00[0-9]*[1-9].*' 'RXPSFHID = 0\.00[0-9]*[1-9].*' 'RXPSFERX = 0\.[0-9]*[1-9].*' 'RXPSFEPX = [0-9]+' 'RXPSFEPY = [0-9]+' 'RXPSFCOG = -?0\.00.*' 'RXPSFCGR = [0-9.]+' \
    'RXPSFDT = -?0\.0.*' 'RXPSFDTE = 0\.0.*' 'RXPSFE1 = .*' 'RXPSFE1E = 0\.0.*' 'RXPSFE2 = .*' 'RXPSFE2E = 0\.0.*'

begin 'PSF of three stars'
stars tile.fits 4
rung '' 'RXPSFHOW = MOFFAT_BETA' 'RXPSFNST = [234]' 'RXPSFERR = 0\.05.*'

begin 'PSF of three stars, and PSF_FWHM'
stars tile.fits 4
rung '-PSF_FWHM 3.2' 'RXPSFHOW = STATED' 'RXPSF = .*FWHM 3\.2.*from PSF_FWHM' 'RXPSFERR = 0\.08.*'

begin 'PSF of pixels, and PSF_FWHM'
stars tile.fits 60
rung '-PSF_FWHM 3.2' 'RXFWHM = (2\.9|3\.0).*' 'RXPSFHOW = PIXELS'

begin 'PSF of one star'
stars tile.fits 1
rung '' 'RXPSFHOW = WIDTH' 'RXPSFNST = 1' 'RXPSFERR = 0\.3.*'

begin 'PSF of one star, and a stated seeing'
stars tile.fits 1
rung '-SEEING_FWHM 1.2' 'RXPSFHOW = STATED' 'RXPSF = .*FWHM 3\.030.*from SEEING_FWHM' 'RXPSFERR = 0\.08.*'

begin 'PSF of one star, and a file beside it that is no PSF'
stars tile.fits 1
[ "$active" = 0 ] || echo 'no PSF' >tile.psf
rung '' 'RXPSFHOW = WIDTH' 'RXPSFNST = 1'

begin 'PSF of six stars'
stars tile.fits 7 -SEED 4
rung '' 'RXPSFHOW = MOFFAT' 'RXPSFNST = [567]' 'RXPSFERR = 0\.04[0-9]*[1-9].*'

begin 'PSF without stars or words'
make_fits flat tile.fits
rung '' 'RXREST = NONE' 'RXASKED = RL' 'RXWHY = its PSF is not known'

begin 'PSF in plain ASCII has no head'
stars tile.fits 60
leaves test.cat
expect 0 '' tile.fits -c /dev/null -CATALOG_TYPE ASCII

begin 'PSF file beside the image is an input of the run'
make_fits flat tile.fits && make_fits psf tile.psf
rung '-RL_NITER 2' 'RXPSFHOW = BESIDE' 'READ = [0-9a-f]{32} PSF_NAME tile\.psf'
leaves again.cat
expect 0 '' -c test.cat -CATALOG_NAME again.cat
expect 2 'CHECKIMAGE_NAME tile\.psf is also read, as tile\.psf' tile.fits -c /dev/null -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME tile.psf
[ "$active" = 0 ] || printf ' ' >>tile.psf
expect 3 'tile\.psf: is not what the run that wrote test\.cat read \(PSF_NAME\)' -c test.cat -CATALOG_NAME again.cat

begin 'PSF file beside the image that says no more than was stated'
stars tile.fits 1
write='tile.fits -c /dev/null -SEEING_FWHM 1.2 -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME tile.psf'
leaves tile.psf
expect 0 '' $write
expect 0 '' $write
leaves test.cat
talks 'tile\.psf beside it is passed over: Rextract made it .*RXPSFHOW STATED' tile.fits -SEEING_FWHM 1.2
rung '' 'RXPSFHOW = WIDTH' 'RXPSFNST = 1'

begin 'measured PSF beside the image'
stars model.fits 60 -SEED 1
stars tile.fits 0
[ "$active" = 0 ] || run model.fits -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME tile.psf -VERBOSE_TYPE QUIET
rung '' 'RXPSFHOW = BESIDE' 'RXPSFERR = 0\.00[0-9]*[1-9].*'

begin 'measured PSF of another tile by PSF_TYPE PSFEX'
stars model.fits 60 -SEED 1
stars tile.fits 0
[ "$active" = 0 ] || run model.fits -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME my.psf -VERBOSE_TYPE QUIET
rung '-PSF_TYPE PSFEX -PSF_NAME my.psf' 'RXPSFERR = 0\.00[0-9]*[1-9].*'

# --- report and record

begin 'PSF in report, gates and record'
stars tile.fits 60 -TRUTH_NAME truth.fits
leaves report tile.rec
if [ "$active" = 1 ]; then
    printf 'psf_dt all in -0.1:0.1\npsf_growth all in -0.05:0.05\npsf_de1 all in 0.5:0.6\n' >my.qa
    run tile.fits -c /dev/null -RESTORE_TYPE NONE,RL -REFERENCE_NAME truth.fits -QA_NAME report -QA_FIGURES N -QA_GATES my.qa \
        -RECORD_NAME tile.rec -MAG_ZEROPOINT 25 -CATALOG_TYPE NONE -VERBOSE_TYPE QUIET
    grep -q '"psf": {"how": "PIXELS"\|"how": "PIXELS"' report/summary.json || echo 'no PSF in summary.json' >>../err
    for file in psf_stars psf_growth; do
        [ "$(grep -vc '^#' report/$file.ecsv)" -ge 6 ] || echo "$file.ecsv has no rows" >>../err
    done
    grep -q '<h2 id="psf">' report/report.html || echo 'no PSF in report.html' >>../err
    grep -Eq '^PSF "PIXELS" [2-9][0-9] [0-9]+ 0\.0' tile.rec || echo 'no PSF in the record' >>../err
    grep -Eq '^RHO [0-9] [0-9]+ ' tile.rec || echo 'no RHO in the record' >>../err
    judge 5 'a quality gate FAILED'
fi
