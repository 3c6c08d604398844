# Lists of tiles: what is done, what is told, and what no tile may do to another.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

none='-RESTORE_TYPE NONE'

begin 'a list of tiles'
make_fits tile a.fits
make_fits small b.fits
printf 'a.fits\n# not this one\nb.fits -CATALOG_TYPE FITS_LDAC\n' >tiles.list
leaves a.cat b.cat
expect 0 '' @tiles.list $none -CATALOG_NAME '{tile}.cat'

begin 'a tile that fails does not stop the others'
make_fits tile a.fits
make_fits tile c.fits
echo nonsense >b.fits
printf 'a.fits\nb.fits\nnot-there.fits\nc.fits\n' >tiles.list
leaves a.cat c.cat
expect 8 '^rextract: tiles\.list: 2 of 4 tiles failed; the others are done$' @tiles.list $none -CATALOG_NAME '{tile}.cat'

begin 'the summary names the tiles that fail'
make_fits tile a.fits
printf 'a.fits\nnot-there.fits\n' >tiles.list
leaves a.cat
says 10
expect_exactly 8 'rextract: line 2, exit status 3 after [0-9.]* s: failed: not-there\.fits: cannot be opened' @tiles.list \
    $none -CATALOG_NAME '{tile}.cat'

begin 'a list is checked before any tile begins'
make_fits tile a.fits
make_fits tile b.fits
printf 'a.fits\nb.fits -DETECT_TRESH 3\n' >tiles.list
expect 2 '^rextract: tiles\.list:2: unknown keyword .-DETECT_TRESH.; did you mean -DETECT_THRESH\?$' @tiles.list $none \
    -CATALOG_NAME '{tile}.cat'

begin 'a plan within a line of a list'
make_fits tile a.fits
make_fits tile b.fits
printf 'a.fits\n\nb.fits -Plan Y\n' >tiles.list
expect 2 '^rextract: tiles\.list:3: -Plan is of the whole list, not of one tile; give it on the command line$' @tiles.list $none \
    -CATALOG_NAME '{tile}.cat'

begin 'a plan within a line of a list that is planned'
make_fits tile a.fits
echo 'a.fits -PLAN N' >tiles.list
expect 2 '^rextract: tiles\.list:1: -PLAN is of the whole list' -PLAN Y @tiles.list $none -CATALOG_NAME '{tile}.cat'

begin 'two tiles of a list with one catalogue'
make_fits tile a.fits
make_fits tile b.fits
printf 'a.fits\nb.fits\n' >tiles.list
expect 2 '^rextract: tiles\.list:2: would write test\.cat, as would line 1; put \{tile\} into' @tiles.list $none

begin 'two tiles of a list with one catalogue, by other names'
make_fits tile a.fits
make_fits tile b.fits
mkdir in && ln -s ../both.cat in/link.cat && echo old >both.cat
printf 'a.fits -CATALOG_NAME ./both.cat\nb.fits -CATALOG_NAME in/link.cat\n' >tiles.list
expect 2 '^rextract: tiles\.list:2: would write in/link\.cat, as would line 1; put \{tile\} into' @tiles.list $none

begin 'a tile of a list that would replace what another one reads'
make_fits tile a.fits
make_fits tile b.fits
make_fits tile w.fits
printf 'a.fits -WEIGHT_TYPE MAP_RMS -WEIGHT_IMAGE w.fits[0]\nb.fits -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME ./w.fits\n' >tiles.list
expect 2 '^rextract: tiles\.list:2: would write \./w\.fits, which is read by line 1; put' @tiles.list $none -CATALOG_NAME '{tile}.cat'

begin 'a tile of a list that would replace the second image of another one'
make_fits tile a.fits
make_fits tile b.fits
printf 'a.fits,b.fits -CATALOG_NAME a.cat\na.fits -CATALOG_NAME b.fits\n' >tiles.list
expect 2 '^rextract: tiles\.list:2: would write b\.fits, the tile of line 1; put' @tiles.list $none

begin 'a tile of a list that would replace the list'
make_fits tile a.fits
echo 'a.fits -RECORD_NAME ./tiles.list' >tiles.list
expect 2 '^rextract: tiles\.list:1: would write \./tiles\.list, this list itself; give the output another name$' @tiles.list $none

begin 'gates of a list'
make_fits tile a.fits
make_fits tile b.fits
make_fits table ref.fits
echo 'bias_mag all >= 3' >my.qa
printf 'a.fits\nb.fits\n' >tiles.list
leaves a.cat b.cat a_qa b_qa
expect 5 '^rextract: tiles\.list: a quality gate FAILED for 2 of 2 tiles$' @tiles.list $none -CATALOG_NAME '{tile}.cat' \
    -REFERENCE_NAME ref.fits -QA_NAME '{tile}_qa' -QA_GATES my.qa -QA_FIGURES N

begin 'a list and an image'
make_fits tile a.fits
echo a.fits >tiles.list
expect 2 'one image too many' @tiles.list a.fits $none

begin 'a list without a name'
expect 2 'the name of the list is empty; give @FILE' @ $none

begin 'a list that is not there'
expect 3 '^rextract: tiles\.list: ' @tiles.list $none

begin 'a list without tiles'
echo '# none' >tiles.list
expect 3 '^rextract: tiles\.list: lists no tile; give an image per line$' @tiles.list $none

begin 'the name of the tile in the names of outputs'
mkdir night
make_fits tile night/m31.fits
leaves m31.cat m31-sky.fits
expect 0 '' night/m31.fits $none -CATALOG_NAME '{tile}.cat' -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME '{tile}-sky.fits'

begin 'control characters in the names of a list'
printf 'a\033[31m.fits\n' >tiles.list
expect 8 '^rextract: tiles\.list: 1 of 1 tiles failed' @tiles.list $none -CATALOG_NAME '{tile}.cat'

begin 'a signal in the second tile of a list'
make_fits tile a.fits
make_fits large b.fits
printf 'a.fits -RESTORE_TYPE NONE\nb.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 -RL_NITER 100000\n' >tiles.list
leaves a.cat
if [ "$active" = 1 ]; then
    list_files >../before
    timeout --foreground --preserve-status -s TERM 2 "$program" @tiles.list -CATALOG_NAME '{tile}.cat' -VERBOSE_TYPE QUIET \
        >../out 2>../err </dev/null
    echo $? >../code
    judge 143 '^rextract: tiles\.list: interrupted by a signal; 1 of 2 tiles had ended before$'
fi

begin 'records from a pipe that are to be merged'
of rextract-survey
mkfifo records
expect 3 '^rextract-survey: records: is no file, and MERGED_NAME has to read it twice; give a file$' records -MERGED_NAME all.records

begin 'records that are to be merged into their own file'
of rextract-survey
printf 'a.record\n' >list
: >a.record
expect 2 '^rextract-survey: MERGED_NAME \./a\.record is also read, as a\.record; give the output another name$' @list -MERGED_NAME ./a.record

begin 'repeatability is the Python package'
of rextract-survey
expect 2 '^rextract-survey: -REPEAT is no longer a keyword; compare visits by repeatability\(\) of the Python package' -REPEAT Y a.cat b.cat

begin 'the summary counts the tiles that another restorer did'
make_fits tile a.fits
make_fits tile b.fits
make_fits tile c.fits
make_model model.fits
printf 'a.fits\nb.fits -PSF_FWHM 1\nc.fits -RESTORE_TYPE NONE,NET -PSF_FWHM 1\n' >tiles.list
leaves a.cat b.cat c_NONE.cat c_NET.cat
if [ "$active" = 1 ]; then
    run @tiles.list -RESTORE_TYPE NET -NET_MODEL model.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 -CATALOG_NAME '{tile}.cat'
    grep -E '3 tiles in ' ../err >../summary
    mv ../summary ../err
    said=1
    judge 0 '3 fine, 0 failed, .*, 0 not begun, 2 by another restorer$'
fi
