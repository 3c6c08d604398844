# SELF_CHECK and BLANK_CHECK: what is refused, and what they leave.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

known='-RESTORE_TYPE NONE -PSF_TYPE MOFFAT -PSF_FWHM 3'
check='-SELF_CHECK Y -SELF_CHECK_COUNT 40 -SELF_CHECK_DENSITY 1000 -QA_FIGURES N'

begin 'self check: one magnitude'
make_fits tile tile.fits
expect 2 '^rextract: -SELF_CHECK_MAG: has 1 item' tile.fits $known $check -SELF_CHECK_MAG 20

begin 'self check: magnitudes the wrong way round'
make_fits tile tile.fits
expect 2 '^rextract: -SELF_CHECK_MAG: 22 is above 20' tile.fits $known $check -SELF_CHECK_MAG 22,20

begin 'self check: too few objects'
make_fits tile tile.fits
expect 2 '^rextract: -SELF_CHECK_COUNT: 19 is out of range' tile.fits $known $check -SELF_CHECK_COUNT 19

begin 'self check: share above 1'
make_fits tile tile.fits
expect 2 '^rextract: -SELF_CHECK_GALAXIES: 50 is out of range, give -1 to 1' tile.fits $known $check -SELF_CHECK_GALAXIES 50

begin 'self check: share below 0 that is not -1'
make_fits tile tile.fits
expect 2 '^rextract: -SELF_CHECK_GALAXIES: -0\.5 is no share' tile.fits $known $check -SELF_CHECK_GALAXIES -0.5

begin 'self check: with a second image'
make_fits tile a.fits && make_fits tile b.fits
expect 2 '^rextract: SELF_CHECK and BLANK_CHECK speak of one image' a.fits,b.fits $known $check

begin 'blank check: with a second image'
make_fits tile a.fits && make_fits tile b.fits
expect 2 '^rextract: SELF_CHECK and BLANK_CHECK speak of one image' a.fits,b.fits $known -BLANK_CHECK 1

begin 'self check: radius in seconds of arc without a scale'
make_fits tile tile.fits
expect 2 '^rextract: tile\.fits.*MATCH_UNIT ARCSEC needs the pixel scale' tile.fits $known $check -MATCH_UNIT ARCSEC -PIXEL_SCALE 0

begin 'self check: report where a file is'
make_fits tile tile.fits && echo old >report
expect 2 '^rextract: report: is a file, a folder is written' tile.fits $known $check -SELF_CHECK_NAME report

begin 'self check: report in a folder with other things, before any work'
says 2 # no default.sex
make_fits tile tile.fits && mkdir report && echo mine >report/thesis.tex
expect_exactly 2 '^rextract: report: is a folder with other content' tile.fits $known $check -SELF_CHECK_NAME report -VERBOSE_TYPE FULL

begin 'self check: report in a folder that cannot be made, before any work'
says 2 # no default.sex
make_fits tile tile.fits
expect_exactly 4 '^rextract: /proc/absent/report: cannot be written' tile.fits $known $check -SELF_CHECK_NAME /proc/absent/report -VERBOSE_TYPE FULL

begin 'report: in a folder that cannot be made, before any work'
says 2 # no default.sex
make_fits tile tile.fits && make_fits table ref.fits
expect_exactly 4 '^rextract: /proc/absent/qa: cannot be written' tile.fits -RESTORE_TYPE NONE -REFERENCE_NAME ref.fits -QA_NAME /proc/absent/qa -VERBOSE_TYPE FULL

begin 'report: a reference without positions, before any work'
says 3 # no default.sex, the PSF
make_fits tile tile.fits && printf '# 1 NUMBER n\n# 2 MAG_AUTO m\n1 20\n' >ref.cat
expect_exactly 3 '^rextract: ref\.cat: ' tile.fits $known -RESTORE_TYPE RL -REFERENCE_NAME ref.cat -VERBOSE_TYPE NORMAL

begin 'self check: a tile without a good pixel'
make_fits nan tile.fits
expect 3 '^rextract: tile\.fits' tile.fits $known $check

begin 'self check: a tile of one pixel'
make_fits pixel tile.fits
leaves test.cat
expect 0 '' tile.fits $known $check -BLANK_CHECK 1

begin 'self check: catalogue alone'
make_fits tile tile.fits
leaves test.cat
expect 0 '' tile.fits $known $check

begin 'self check: with a report, of galaxies away from sources'
make_fits tile tile.fits
leaves test.cat report
expect 0 '' tile.fits $known $check -SELF_CHECK_NAME report -SELF_CHECK_GALAXIES 1

begin 'self check: key figures in the header, the sources as without it'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        timeout 60 "$program" tile.fits $known -CATALOG_TYPE ASCII -CATALOG_NAME plain.cat -VERBOSE_TYPE QUIET &&
            timeout 60 "$program" tile.fits $known $check -BLANK_CHECK 1 -CATALOG_TYPE ASCII -CATALOG_NAME checked.cat -VERBOSE_TYPE QUIET &&
            timeout 60 "$program" tile.fits $known $check -BLANK_CHECK 1 -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -CATALOG_NAME checked.fits -VERBOSE_TYPE QUIET
        echo $? >../code
        cmp plain.cat checked.cat
        for card in RXSCN RXSCFND RXBLKN RXBLKU; do
            tr -d '\000' <checked.fits | grep -q "$card *=" || echo "no $card in the header"
        done
        rm -f plain.cat checked.cat checked.fits
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'self check: same bytes for any number of threads'
make_fits extensions tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    for threads in 1 3; do
        timeout 60 "$program" tile.fits -NTHREADS $threads -PSF_TYPE MOFFAT -PSF_FWHM 3 -RL_NITER 5 $check \
            -BLANK_CHECK 2 -CATALOG_TYPE FITS_LDAC -SELF_CHECK_NAME report -VERBOSE_TYPE QUIET
        echo $? >../code
        cat test.cat report_?/summary.json report_?/*.ecsv | cksum
        [ -s report_1/report.html ] && [ -s report_2/report.html ] || echo "no report of each image"
        rm -rf test.cat report_?
    done >../sums 2>../err
    [ "$(sort -u ../sums | wc -l)" = 1 ] || echo 'outputs depend on the number of threads' >>../err
    : >../out
    judge 0 ''
fi

# --- RESTORE_TYPE AUTO

auto="-RESTORE_TYPE AUTO -NET_MODEL $top/config/psfnet.fits -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL"
begin 'AUTO: without a PSF it is NONE, and says why'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    timeout 60 "$program" tile.fits $auto -PSF_TYPE AUTO -PSF_MINSNR 1e6 -VERBOSE_TYPE QUIET >../out 2>../err
    echo $? >../code
    for card in "RXREST  = 'NONE" "RXASKED = 'AUTO" "RXWHY   = 'NET: the PSF is not known; RL: the PSF"; do
        tr -d '\000' <test.cat | grep -a -q "$card" || echo "no $card in the header" >>../err
    done
    leaves test.cat
    judge 0 ''
fi

begin 'AUTO: a PSF too narrow to be restored is left alone'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    timeout 60 "$program" tile.fits $auto -PSF_TYPE MOFFAT -PSF_FWHM 1 -VERBOSE_TYPE QUIET >../out 2>../err
    echo $? >../code
    for card in "RXREST  = 'NONE" "RXWHY   = 'NET: FWHM 1"; do
        tr -d '\000' <test.cat | grep -a -q "$card" || echo "no $card in the header" >>../err
    done
    leaves test.cat
    judge 0 ''
fi

begin 'AUTO: the same for any number of threads, and as the restorer that it took'
make_fits tile tile.fits
if [ "$active" = 1 ]; then
    list_files >../before
    {
        for threads in 1 4; do
            timeout 60 "$program" tile.fits $auto -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_TYPE ASCII_HEAD -NTHREADS $threads \
                -CATALOG_NAME $threads.cat -VERBOSE_TYPE QUIET || echo failed
        done
        taken=$(sed -n 's/^# RXREST = //p' 1.cat)
        timeout 60 "$program" tile.fits $auto -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_TYPE ASCII_HEAD -RESTORE_TYPE "$taken" \
            -CATALOG_NAME it.cat -VERBOSE_TYPE QUIET
        echo $? >../code
        timeout 60 "$program" -c 1.cat -CATALOG_NAME again.cat -VERBOSE_TYPE QUIET || echo 'not made again'
        for file in 1 4 it; do
            grep -v '^#' $file.cat >$file.rows
        done
        [ -s 1.rows ] || echo 'nothing to compare'
        cmp 1.rows 4.rows
        cmp 1.rows it.rows
        rm -f ./*.cat ./*.rows
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'AUTO: not where restorers compete'
of rextract-validate
expect 2 'RESTORE_TYPE AUTO is for single tiles' -CAMPAIGN_TYPE DETECTION -SIZE SMALL -RESTORE_TYPE NONE,AUTO -OUTPUT_NAME out

# --- what checks say of the sources: P_REAL, MAGERR_INJECTED

begin 'errors from injected objects without injecting'
make_fits tile tile.fits && printf 'NUMBER\nMAGERR_INJECTED\n' >my.param
expect 2 '^rextract: MAGERR_INJECTED and MAGERR95_INJECTED come from objects that SELF_CHECK injects; give SELF_CHECK Y' \
    tile.fits $known -PARAMETERS_NAME my.param

begin 'errors from injected objects, and probabilities, the same for any number of threads'
make_fits tile tile.fits && printf 'NUMBER\nP_REAL\nMAGERR_TEMPLATE\nMAGERR_INJECTED\nMAGERR95_INJECTED\n' >my.param
if [ "$active" = 1 ]; then
    list_files >../before
    {
        for threads in 1 3; do
            timeout 300 "$program" tile.fits $known $check -CROWDING N -SELF_CHECK_COUNT 60 -BLANK_CHECK 1 -PARAMETERS_NAME my.param \
                -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -CATALOG_NAME $threads.cat -NTHREADS $threads -VERBOSE_TYPE QUIET || echo 'failed'
        done
        echo 0 >../code
        tail -c 2880 1.cat >../one # the rows; the header names NTHREADS
        tail -c 2880 3.cat | cmp ../one -
        tr -d '\000' <1.cat | grep -a -q 'RXSCERN' || echo 'no RXSCERN'
        rm -f 1.cat 3.cat
    } >../err 2>&1
    : >../out
    judge 0 ''
fi

begin 'what is dropped with a blank check is what is flagged by it'
make_fits tile tile.fits && printf 'NUMBER\nX_IMAGE\nFLUX_TEMPLATE\nP_REAL\n' >my.param
if [ "$active" = 1 ]; then
    list_files >../before
    code=0
    for target in 0 0.5; do
        timeout 300 "$program" tile.fits $known -PARAMETERS_NAME my.param -CATALOG_TYPE ASCII -CATALOG_NAME $target.cat -TEMPLATE_TYPE POINT \
            -CROWDING N -DETECT_THRESH 0.6 -DETECT_MINAREA 2 -BLANK_CHECK 6 -PRECISION_TARGET $target -VERBOSE_TYPE QUIET >>../out 2>>../err || code=$?
    done
    echo $code >../code
    awk '$4 >= 0.5' 0.cat | cut -c 11- >../kept
    cut -c 11- 0.5.cat | diff ../kept - >>../err
    if [ "$(wc -l <../kept)" -le 4 ] || [ "$(wc -l <../kept)" -ge "$(($(wc -l <0.cat) - 4))" ]; then wc -l ../kept 0.cat >>../err; fi
    leaves 0.cat 0.5.cat
    judge 0 ''
fi

begin 'errors from injected objects are numbers, the wider the surer'
make_fits tile tile.fits && printf 'P_REAL\nSNR_TEMPLATE\nMAGERR_INJECTED\nMAGERR95_INJECTED\n' >my.param
if [ "$active" = 1 ]; then
    list_files >../before
    timeout 300 "$program" tile.fits $known $check -SELF_CHECK_COUNT 60 -PARAMETERS_NAME my.param -CATALOG_TYPE ASCII \
        -CATALOG_NAME test.cat -VERBOSE_TYPE QUIET >../out 2>../err
    echo $? >../code
    awk '!($1 >= 0 && $1 <= 1) { print "P_REAL", $0 }
         $3 != "nan" { n++; if (!($3 > 0 && $4 > $3)) print }
         END { if (!n) print "no errors" }' test.cat >>../err
    leaves test.cat
    judge 0 ''
fi
