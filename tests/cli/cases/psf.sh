# How the PSF of a tile comes about, rung by rung, and what headers say of it; PSF_LIBRARY.
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

begin 'PSF of six stars by PSF_TYPE MOFFAT_FIT'
stars tile.fits 7 -SEED 4
rung '-PSF_TYPE MOFFAT_FIT' 'RXPSFERR = 0\.04[0-9]*[1-9].*'

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

# --- PSF_LIBRARY

# models: two tiles of the same CCD have put their PSFs into library/
models() {
    [ "$active" = 1 ] || return 0
    if [ ! -d "$scratch/library" ]; then
        mkdir "$scratch/library"
        for i in 1 2; do
            stars "$scratch/model$i.fits" 60 -SEED "$i" -PSF_FWHM "3.$i" -SKY_CENTER "150.$i,2"
            "$rextract" "$scratch/model$i.fits" -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -PSF_LIBRARY "$scratch/library" \
                -PSF_LIBRARY_TYPE WRITE -VERBOSE_TYPE QUIET
        done
    fi
    cp -r "$scratch/library" library
}
read='-PSF_LIBRARY library'

begin 'PSF_LIBRARY for a tile of another size'
models
make_fits flat tile.fits
rung "$read -PSF_LIBRARY_MAX 1,180" 'RXREST = RL' 'RXPSFHOW = LIBRARY'

begin 'PSF_LIBRARY for another CCD'
models
make_fits flat tile.fits 'CCDNUM  = 3'
rung "$read -PSF_LIBRARY_MAX 1,180" 'RXREST = NONE'

begin 'PSF_LIBRARY for another filter'
models
make_fits flat tile.fits "FILTER  = 'r'"
rung "$read -PSF_LIBRARY_MAX 1,180" 'RXREST = NONE'

begin 'PSF_LIBRARY: the nearest model'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
rung "$read" 'RXREST = RL' 'RXPSFHOW = LIBRARY' 'RXPSFLIB = model2_0-[0-9a-f]{16}\.psf' 'RXPSFLDS = 0\.0199.*' 'RXPSFLN = 1' \
    'RXPSFNST = [2-9][0-9]' 'RXPSFERR = 0\.0[3-6].*' 'RXPSF = of PSF_LIBRARY: model2_0-.*, FWHM 3\.[12].* \+- 0\.(0[89]|1).*'

begin 'PSF_LIBRARY comes before SEEING_FWHM'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
rung "$read -SEEING_FWHM 2" 'RXPSFHOW = LIBRARY'

begin 'PSF_LIBRARY comes after PSF_FWHM'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
rung "$read -PSF_FWHM 4" 'RXPSFHOW = STATED'

begin 'PSF_LIBRARY comes before one star'
models
stars tile.fits 1 -SKY_CENTER 150.18,2
rung "$read" 'RXPSFHOW = LIBRARY'

begin 'PSF_LIBRARY comes after stars'
models
stars tile.fits 60 -SKY_CENTER 150.18,2
rung "$read" 'RXPSFHOW = PIXELS'

begin 'PSF_LIBRARY: none near enough, one star'
models
stars tile.fits 1 -SKY_CENTER 150.18,2
rung "$read -PSF_LIBRARY_MAX 1,0.01" 'RXPSFHOW = WIDTH'

begin 'PSF_LIBRARY: models are inputs of the run, and a replay takes them again'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
rung "$read" 'READ = [0-9a-f]{32} PSF_LIBRARY library/model1_0-.*\.psf' 'READ = [0-9a-f]{32} PSF_LIBRARY library/model2_0-.*\.psf'
expect 0 '' -REPLAY test.cat
stars near.fits 60 -SEED 3 -PSF_FWHM 3.5 -SKY_CENTER 150.18,2
if [ "$active" = 1 ]; then
    run near.fits -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -PSF_LIBRARY library -PSF_LIBRARY_TYPE WRITE -VERBOSE_TYPE QUIET
    cp test.cat first.cat
fi
rung "$read" 'RXPSFLIB = near_0-.*'
[ "$active" = 0 ] || rm library/model1_0-*.psf
expect 3 'library/model1_0-.*\.psf: is not there \(PSF_LIBRARY of the run that wrote first\.cat\)' -REPLAY first.cat

begin 'PSF_LIBRARY: no model that was read is replaced'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
[ "$active" = 0 ] || mv library/model2_0-*.psf library/two.psf
expect 2 'CHECKIMAGE_NAME library/two\.psf is also read, from the folder library; give the output another name' tile.fits -c /dev/null $read \
    -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME library/two.psf

begin 'PSF file beside the image is an input of the run'
make_fits flat tile.fits && make_fits psf tile.psf
rung '-RL_NITER 2' 'RXPSFHOW = BESIDE' 'READ = [0-9a-f]{32} PSF_NAME tile\.psf'
expect 0 '' -REPLAY test.cat
expect 2 'CHECKIMAGE_NAME tile\.psf is also read, as tile\.psf' tile.fits -c /dev/null -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME tile.psf
[ "$active" = 0 ] || printf ' ' >>tile.psf
expect 3 'tile\.psf: has changed since it was read \(PSF_NAME of the run that wrote test\.cat\)' -REPLAY test.cat

begin 'PSF file beside the image that says no more than was stated'
stars tile.fits 1
write='tile.fits -c /dev/null -SEEING_FWHM 1.2 -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME tile.psf'
leaves tile.psf
expect 0 '' $write
expect 0 '' $write
leaves test.cat
talks 'tile\.psf beside it is passed over: Rextract made it .*RXPSFHOW STATED' tile.fits -SEEING_FWHM 1.2
rung '' 'RXPSFHOW = WIDTH' 'RXPSFNST = 1'

begin 'PSF_LIBRARY: a run that writes reads nothing'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
rung "$read -PSF_LIBRARY_TYPE WRITE" 'RXREST = NONE' 'RXWHY = its PSF is not known'

begin 'PSF_LIBRARY: the same bytes in any order, and nothing of a PSF that is in doubt'
models
stars tile.fits 8
if [ "$active" = 1 ]; then
    leaves first second library
    for round in first second; do
        rm -rf library && mkdir library
        order="$scratch/model2.fits tile.fits $scratch/model1.fits"
        [ $round = first ] || order="$scratch/model1.fits tile.fits $scratch/model2.fits"
        for image in $order; do
            run "$image" -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -PSF_LIBRARY library -PSF_LIBRARY_TYPE WRITE \
                -VERBOSE_TYPE QUIET
        done
        cp -r library $round
    done
    diff -r first second >>../err
    find second -name '*.psf' | grep -c . | grep -qx 2 || find second >>../err
    judge 0 ''
fi

begin 'PSF_LIBRARY: names of what is written'
stars tile.fits 60
if [ "$active" = 1 ]; then
    mkdir library
    leaves library
    run 'tile.fits[0]' -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -PSF_LIBRARY library -PSF_LIBRARY_TYPE WRITE -VERBOSE_TYPE QUIET
    for file in library/*; do
        echo "$file" | grep -Eqx 'library/tile_0-[0-9a-f]{16}\.psf' || echo "$file was written" >>../err
    done
    judge 0 ''
fi

begin 'PSF_LIBRARY that is not there'
make_fits tile tile.fits
expect 2 '^rextract: absent: cannot be read as PSF_LIBRARY: No such file or directory; give a folder that is there$' tile.fits \
    -PSF_LIBRARY absent

begin 'PSF_LIBRARY that is a file'
make_fits tile tile.fits
[ "$active" = 0 ] || echo 'no folder' >library
expect 2 '^rextract: library: is a file, and PSF_LIBRARY a folder of .psf files' tile.fits -PSF_LIBRARY library

begin 'model of PSF_LIBRARY beside the image'
models
stars tile.fits 0
[ "$active" = 0 ] || mv library/model1_0-*.psf tile.psf
rung '' 'RXPSFHOW = BESIDE' 'RXPSFERR = 0\.00[0-9]*[1-9].*'

begin 'model of PSF_LIBRARY by PSF_TYPE PSFEX'
models
stars tile.fits 0
[ "$active" = 0 ] || mv library/model1_0-*.psf my.psf
rung '-PSF_TYPE PSFEX -PSF_NAME my.psf' 'RXPSFERR = 0\.00[0-9]*[1-9].*'

begin 'PSF_LIBRARY_TYPE of another word'
make_fits tile tile.fits
expect 2 "^rextract: -PSF_LIBRARY_TYPE: unknown word 'BOTH'; give one of READ, WRITE$" tile.fits -PSF_LIBRARY_TYPE BOTH

begin 'PSF_LIBRARY_MAX of one number'
make_fits tile tile.fits
expect 2 '^rextract: -PSF_LIBRARY_MAX: ' tile.fits -PSF_LIBRARY_MAX 3

begin 'PSF_LIBRARY with a file that is no PSF'
models
stars tile.fits 0 -SKY_CENTER 150.18,2
[ "$active" = 0 ] || echo 'no FITS' >library/other.psf
rung "$read" 'RXPSFHOW = LIBRARY'

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
    grep -Eq '^PSF "PIXELS" "" [2-9][0-9] [0-9]+ 0\.0' tile.rec || echo 'no PSF in the record' >>../err
    grep -Eq '^RHO [0-9] [0-9]+ ' tile.rec || echo 'no RHO in the record' >>../err
    judge 5 'a quality gate FAILED'
fi
