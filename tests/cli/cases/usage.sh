# Command lines: what is printed, and what is refused.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

begin 'no argument'
says 7
expect_exactly 2 '^usage: rextract IMAGE'

begin 'help'
prints '^usage: rextract IMAGE'
expect_exactly 0 '' -h

begin 'long help'
prints 'rextract\.conf\(5\)'
expect_exactly 0 '' --help

begin 'version'
prints '^Rextract version [0-9]+\.[0-9]+'
expect_exactly 0 '' -v

begin 'long version'
prints '^Rextract version [0-9]+\.[0-9]+'
expect_exactly 0 '' --version

begin 'default configuration'
prints '^DETECT_THRESH +5\.0 '
expect_exactly 0 '' -d

begin 'extended configuration'
prints '^ASSOC_RADIUS +2\.0 '
expect_exactly 0 '' -dd

begin 'columns'
prints '^#?X_IMAGE '
expect_exactly 0 '' -dp

begin 'flags in words, in each column'
prints '^ +16  OTHER +not by the restorer'
expect_exactly 0 '' -FLAGS 19

begin 'flags in words, in one column, a bit without a meaning among them'
prints '^ +256  no flags of this column$'
expect_exactly 0 '' -FLAGS flags=261

begin 'all flags'
prints '^ +256  SHARP +no light of the sky'
expect_exactly 0 '' -FLAGS

begin 'an option of other programs'
expect_exactly 2 "^rextract: unknown keyword '--foo'; see rextract -h$" --foo

begin 'keyword and value in one word'
expect_exactly 2 'RESTORE_TYPE=RL: keyword and value are two words; give -RESTORE_TYPE RL$' -RESTORE_TYPE=RL

begin 'help by other names'
prints '^usage: rextract IMAGE'
expect_exactly 0 '' help
begin 'help with one dash'
prints '^usage: rextract IMAGE'
expect_exactly 0 '' -help

begin 'flags that are no number'
expect_exactly 2 "^rextract: 'FLAGS=-3' is no sum of flags; give one as -FLAGS 19" -FLAGS FLAGS=-3

begin 'flags of a column that is not there'
expect_exactly 2 "^rextract: 'FLUGS' is no column of flags" -FLAGS FLUGS=3

begin 'image without keyword value'
make_fits tile tile.fits
expect_exactly 2 '^rextract: -DETECT_THRESH has no value' tile.fits -DETECT_THRESH

begin 'keywords without image'
expect 2 '^rextract: no image is named' -DETECT_THRESH 3

begin 'three images'
expect 2 "'c\.fits' is one image too many" a.fits b.fits c.fits

begin 'empty image name'
expect 2 'an image name is empty' a.fits,

begin 'unknown keyword'
make_fits tile tile.fits
expect 2 "^rextract: unknown keyword '-DETECT_TRESH'; did you mean -DETECT_THRESH\?$" tile.fits -DETECT_TRESH 3

begin 'number that is none'
make_fits tile tile.fits
expect 2 "^rextract: -DETECT_MINAREA: 'five' is not a number$" tile.fits -DETECT_MINAREA five

begin 'restorer twice'
make_fits tile tile.fits
expect 2 'RESTORE_TYPE: NONE is named twice' tile.fits -RESTORE_TYPE NONE,none

begin 'photographic plates'
make_fits tile tile.fits
expect 2 'DETECT_TYPE: PHOTO' tile.fits -DETECT_TYPE PHOTO

begin 'fewer names than check-images'
make_fits tile tile.fits
expect 2 'CHECKIMAGE_NAME: names 1 file' tile.fits -CHECKIMAGE_TYPE BACKGROUND,OBJECTS -CHECKIMAGE_NAME a.fits

begin 'gates without reference'
make_fits tile tile.fits
expect 2 'QA_GATES: needs a reference catalogue' tile.fits -QA_GATES a.qa

begin 'control characters are not passed on'
expect 2 "unknown keyword '-A\?\[31mB'" tile.fits "-A$(printf '\033')[31mB" 1

# Each of several processes that know nothing of each other would do the whole job. COUNT RANK PROGRAM
among_three() {
    for rank in 0 1; do # one of them speaks
        begin "$3, number $rank among three processes by $1"
        of "$3"
        case $3 in rextract | rextract-survey) set -- "$1" "$2" "$3" tile.fits ;; *) set -- "$1" "$2" "$3" -SEED 1 ;; esac
        export "$1=3" "$2=$rank"
        pattern="^$3: is one of 3 processes that mpiexec started"
        [ $rank = 0 ] || pattern=''
        expect 2 "$pattern" "$4" ${5-}
        unset "$1" "$2"
    done
}
for crowd in rextract rextract-simulate rextract-validate rextract-train rextract-survey; do
    among_three OMPI_COMM_WORLD_SIZE OMPI_COMM_WORLD_RANK $crowd
done
among_three PMI_SIZE PMI_RANK rextract-simulate
among_three SLURM_STEP_NUM_TASKS PMIX_RANK rextract-simulate

begin 'one process of mpiexec is alone'
of rextract-simulate
leaves sim.fits sim_truth.fits
export PMI_SIZE=1 PMI_RANK=0
expect 0 '' -SEED 1 -IMAGE_SIZE 32
unset PMI_SIZE PMI_RANK

begin '-PLAN alone, before the image'
make_fits tile tile.fits
prints '"memory_bytes"'
expect 0 '' -PLAN tile.fits -RESTORE_TYPE NONE

begin '-PLAN alone, at the end'
make_fits tile tile.fits
prints '"memory_bytes"'
expect_exactly 0 '' tile.fits -RESTORE_TYPE NONE -VERBOSE_TYPE QUIET -PLAN

begin 'many images'
expect 2 'rextract @tiles\.list' a.fits b.fits c.fits d.fits

begin 'the last line says what was written'
make_fits tile tile.fits
says 4
leaves x.cat back.fits
expect_exactly 0 '^rextract: written: x\.cat, back\.fits$' tile.fits -RESTORE_TYPE NONE -CATALOG_NAME x.cat \
    -CHECKIMAGE_TYPE BACKGROUND -CHECKIMAGE_NAME back.fits

begin 'a catalogue as CSV'
make_fits tile tile.fits
expect 2 '^rextract: -CATALOG_TYPE: CSV is not written; give FITS_1\.0 or ASCII_VOTABLE' tile.fits -CATALOG_TYPE csv
