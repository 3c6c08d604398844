# Configuration files: .sex, .param, .conv, .qa
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

none='-RESTORE_TYPE NONE'

begin 'configuration that is not there'
make_fits tile tile.fits
expect 2 '^rextract: absent\.sex: cannot be opened: No such file' tile.fits -c absent.sex

begin 'configuration that is a folder'
make_fits tile tile.fits
mkdir my.sex
expect 2 '^rextract: my\.sex: is a folder' tile.fits -c my.sex

begin 'configuration with an unknown keyword'
make_fits tile tile.fits
printf '# mine\nDETECT_MINAREA 5\nDETECT_TRESH 3 # sigmas\n' >my.sex
expect 2 "^rextract: my\.sex:3: unknown keyword 'DETECT_TRESH'; did you mean DETECT_THRESH\?$" tile.fits -c my.sex

begin 'default.sex is read where it is'
make_fits tile tile.fits
printf 'DETECT_MINAREA many\n' >default.sex
expect 2 "^rextract: default\.sex:1: DETECT_MINAREA: 'many' is not a number$" tile.fits

begin 'configuration that is binary'
make_fits tile tile.fits
printf 'CATALOG_NAME a\000b\n' >my.sex
expect 2 '^rextract: my\.sex: .*binary' tile.fits -c my.sex

begin 'image given as configuration'
make_fits tile tile.fits
expect 3 '^rextract: tile\.fits: holds no record of a run of rextract; give a FITS catalogue' tile.fits -c tile.fits

begin 'column file that is not there'
make_fits tile tile.fits
expect 2 'absent\.param' tile.fits $none -PARAMETERS_NAME absent.param

begin 'column file with an unknown column'
make_fits tile tile.fits
printf 'NUMBER\nMAG_ATUO\n' >my.param
expect 2 '^rextract: my\.param:2: .*MAG_ATUO.*MAG_AUTO' tile.fits $none -PARAMETERS_NAME my.param

begin 'a file that a column needs is asked for before the image is'
printf 'NUMBER\nCLASS_STAR\n' >my.param
expect 2 '^rextract: absent\.nnw: .*STARNNW_NAME or leave out CLASS_STAR' absent.fits $none -PARAMETERS_NAME my.param -STARNNW_NAME absent.nnw

begin 'filter that is not there'
make_fits tile tile.fits
expect 2 '^rextract: absent\.conv: cannot be opened' tile.fits $none -FILTER_NAME absent.conv

begin 'filter of zeros'
make_fits tile tile.fits
printf 'CONV NORM\n0 0 0\n' >my.conv
expect 2 '^rextract: my\.conv: the filter is zero' tile.fits $none -FILTER_NAME my.conv

begin 'gates that are not there'
make_fits tile tile.fits
make_fits table ref.fits
expect 2 'absent\.qa: cannot be opened' tile.fits $none -REFERENCE_NAME ref.fits -QA_GATES absent.qa

begin 'gates with an unknown metric'
make_fits tile tile.fits
make_fits table ref.fits
printf 'recal all >= 0.9\n' >my.qa
expect 2 "^rextract: my\.qa:1: unknown metric 'recal'; did you mean 'recall'" tile.fits $none -REFERENCE_NAME ref.fits -QA_GATES my.qa

begin 'the dump of -d as it is, in a folder without the files that it names'
make_fits tile tile.fits
"$rextract" -d >tile.sex
leaves test.cat
expect 0 '' tile.fits -c tile.sex -RESTORE_TYPE NONE

begin 'columns and filter beside the configuration file'
make_fits tile tile.fits
mkdir night
"$rextract" -d >night/tile.sex
echo NUMBER >night/default.param
printf 'CONV NORM\n1 2 1\n2 4 2\n1 2 1\n' >night/default.conv
leaves test.cat
says 4 # the PSF, what was found, the count, what was written
expect_exactly 0 'PARAMETERS_NAME default\.param is night/default\.param; FILTER_NAME default\.conv is night/default\.conv' tile.fits -c night/tile.sex -RESTORE_TYPE NONE

begin 'columns that are nowhere'
make_fits tile tile.fits
expect 2 '^rextract: other\.param: cannot be opened' tile.fits $none -PARAMETERS_NAME other.param

# Thresholds and noise, as the catalogue states them: TITLE, PATTERN of a line, ARGUMENT...
catalogue_says() {
    begin "$1"
    pattern=$2
    shift 2
    make_fits tile tile.fits
    printf 'RESTORE_TYPE NONE\nDETECT_MINAREA 3\n' >plain.sex
    printf 'RESTORE_TYPE NONE\nTHRESH_TYPE SIGNIFICANCE\n' >named.sex
    printf 'CONV NORM\n1 1\n1 1\n' >noise.conv
    if [ "$active" = 1 ]; then
        leaves test.cat
        run tile.fits -RESTORE_TYPE NONE -HEADER_FACTS ALL -VERBOSE_TYPE QUIET "$@"
        grep -Eq -- "$pattern" test.cat || echo "test.cat does not say $pattern" >>../err
        judge 0 ''
    fi
}
catalogue_says 'sky: in two passes by default' '^# BACK_PASSES = 2$'
catalogue_says "sky of a survey's file without restoration" '^# BACK_PASSES = 1$' -c plain.sex
catalogue_says "sky of a survey's file, named on the command line" '^# BACK_PASSES = 2$' -c plain.sex -BACK_PASSES 2
catalogue_says 'thresholds: the default knows correlated noise' '^# THRESH_TYPE = SIGNIFICANCE$'
catalogue_says "thresholds of a survey's file without restoration" '^# THRESH_TYPE = RELATIVE$' -c plain.sex
catalogue_says "thresholds of a survey's file that names them" '^# THRESH_TYPE = SIGNIFICANCE$' -c named.sex
catalogue_says "thresholds of a survey's file, named on the command line" '^# THRESH_TYPE = SIGNIFICANCE$' -c plain.sex -THRESH_TYPE SIGNIFICANCE
catalogue_says 'noise of a kernel' '^# RXNFACT = 2\.0*$' -FILTER_TYPE CONV -NOISE_CORRELATION FILE -NOISE_KERNEL_NAME noise.conv
catalogue_says 'noise that is stated as white' '^# RXNCOR = WHITE$' -NOISE_CORRELATION WHITE

begin 'noise of a kernel that is not named'
make_fits tile tile.fits
expect 2 '^rextract: NOISE_CORRELATION FILE needs NOISE_KERNEL_NAME' tile.fits $none -NOISE_CORRELATION FILE

begin 'noise of a kernel that is not there'
make_fits tile tile.fits
expect 2 '^rextract: absent\.conv: cannot be opened' tile.fits $none -NOISE_CORRELATION FILE -NOISE_KERNEL_NAME absent.conv

begin 'keywords given in vain, with what each needs'
make_fits tile tile.fits
printf 'X_IMAGE\n' >my.param
leaves test.cat
talks 'warning: PSF_NAME a\.psf has no effect without PSF_TYPE FILE or PSFEX; ASSOC_NAME a\.list has no effect without column VECTOR_ASSOC' \
    tile.fits $none -PARAMETERS_NAME my.param -PSF_NAME a.psf -ASSOC_NAME a.list

begin 'keywords that have no effect for the same reason'
make_fits tile tile.fits
leaves test.cat
talks 'PSF_TYPE MOFFAT has no effect without RESTORE_TYPE RL[^;]*; PSF_NAME a has no [^;]*; PSF_FWHM 3 has no effect without RESTORE_TYPE RL[^;]*; nor has PSF_SIZE 51 ' \
    tile.fits $none -FILTER_TYPE CONV -PSF_TYPE MOFFAT -PSF_NAME a -PSF_FWHM 3 -PSF_SIZE 51

begin 'keywords of a list that count for one of its tiles'
make_fits tile tile.fits
cp tile.fits b.fits
printf 'tile.fits\nb.fits -BACKPHOTO_TYPE LOCAL\n' >my.list
leaves tile.cat b.cat
talks 'warning: BACK_VALUE 3 has no effect without BACK_TYPE MANUAL tile 1 of 2' @my.list $none -CATALOG_NAME '{tile}.cat' -BACKPHOTO_THICK 30 -BACK_VALUE 3
