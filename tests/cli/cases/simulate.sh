# rextract-simulate: what is printed, refused, written, and left when something fails.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

small='-IMAGE_SIZE 64'
flat='-STAR_COUNT 0 -GALAXY_COUNT 0'

# simulates NAME: a case about this program.
simulates() {
    begin "rextract-simulate: $1"
    of rextract-simulate
}

# --- printed

simulates 'no argument'
says 2
expect_exactly 2 '^usage: rextract-simulate \[-c FILE\]'

simulates 'help'
prints 'rextract-simulate\(1\)'
expect_exactly 0 '' --help

simulates 'version'
prints '^Rextract version [0-9]+\.[0-9]+'
expect_exactly 0 '' -v

simulates 'default configuration'
prints '^STAR_COUNT +300 '
expect_exactly 0 '' -d

simulates 'extended configuration'
prints '^# Default extended configuration file for rextract-simulate'
expect_exactly 0 '' -dd

# --- refused on the command line

simulates 'a word that is no option'
expect 2 "^rextract-simulate: 'tile\.fits' is no option; .*rextract-simulate -h$" tile.fits

simulates 'no columns to print'
expect_exactly 2 "^rextract-simulate: unknown keyword '-dp'" -dp

simulates 'keyword without value'
expect_exactly 2 '^rextract-simulate: -SEED has no value' -SEED

simulates 'unknown keyword'
expect 2 "^rextract-simulate: unknown keyword '-STAR_CONT'; did you mean -STAR_COUNT\?$" -STAR_CONT 3

simulates 'keyword of another program'
expect 2 "unknown keyword '-DETECT_THRESH'" -DETECT_THRESH 3

simulates 'number that is none'
expect 2 "^rextract-simulate: -SEED: 'one' is not a number$" -SEED one

simulates 'number out of range'
expect 2 '^rextract-simulate: -IMAGE_SIZE: 4 is out of range, give 16 to 100000$' -IMAGE_SIZE 4

simulates 'number that is not whole'
expect 2 '^rextract-simulate: -SEED: 1\.5 is not a whole number$' -SEED 1.5

simulates 'word that is none'
expect 2 "unknown word 'MOFAT' \(did you mean MOFFAT\?\)" -PSF_TYPE MOFAT

simulates 'range the wrong way round'
expect 2 '^rextract-simulate: -STAR_MAG: 22 is above 18; give <from>,<to>$' -STAR_MAG 22,18

simulates 'detector without gain'
expect 2 '^rextract-simulate: -GAIN: 0 e-/ADU is no gain' -NOISE_TYPE CCD

simulates 'PSF measured on no tile'
expect 2 '^rextract-simulate: -PSF_TYPE: AUTO is measured on a real tile' -PSF_TYPE AUTO

simulates 'sky brighter than what pixels hold'
expect 2 '^rextract-simulate: -SATUR_LEVEL: 500 is not above SKY_LEVEL, 1000' -SATUR_LEVEL 500

simulates 'templates without a name'
expect 2 '^rextract-simulate: -TEMPLATE_NAME: is empty' -TEMPLATE_COUNT 10

# --- refused in a configuration file

simulates 'configuration that is not there'
expect 2 '^rextract-simulate: absent\.conf: cannot be opened: No such file' -c absent.conf

simulates 'configuration with an unknown keyword'
printf '# mine\nSEED 5\nSTAR_CONT 3\n' >my.conf
expect 2 "^rextract-simulate: my\.conf:3: unknown keyword 'STAR_CONT'; did you mean STAR_COUNT\?$" -c my.conf

simulates 'configuration with a range the wrong way round'
printf 'SEED 5\nGALAXY_MAG 20,19 # oops\n' >my.conf
expect 2 '^rextract-simulate: my\.conf:2: GALAXY_MAG: 20 is above 19' -c my.conf

simulates 'image given as configuration'
make_fits tile tile.fits
expect 2 '^rextract-simulate: tile\.fits' -c tile.fits

# --- inputs that cannot be used

simulates 'tile that is not there'
expect 3 '^rextract-simulate: absent\.fits: ' -INJECT_IMAGE absent.fits

simulates 'tile that is no FITS file'
echo text >tile.fits
expect 3 '^rextract-simulate: tile\.fits' -INJECT_IMAGE tile.fits

simulates 'tile that is a table'
make_fits table tile.fits
expect 3 '^rextract-simulate: tile\.fits' -INJECT_IMAGE tile.fits

simulates 'tile without a good pixel'
make_fits nan tile.fits
expect 3 '^rextract-simulate: tile\.fits' -INJECT_IMAGE tile.fits

simulates 'tile without stars for its PSF'
make_fits flat tile.fits
expect 3 '^rextract-simulate: tile\.fits.*too few stars to measure the PSF' -INJECT_IMAGE tile.fits -PSF_TYPE AUTO

simulates 'configuration of the stage that is not there'
make_fits tile tile.fits
expect 2 '^rextract-simulate: absent\.sex: cannot be opened' -INJECT_IMAGE tile.fits -INJECT_CONFIG absent.sex

simulates 'configuration of the stage with an unknown keyword'
make_fits tile tile.fits
printf 'GAIN 2\nDETECT_TRESH 3\n' >my.sex
expect 2 "^rextract-simulate: my\.sex:2: unknown keyword 'DETECT_TRESH'; did you mean DETECT_THRESH" -INJECT_IMAGE tile.fits -INJECT_CONFIG my.sex

simulates 'PSF that is not there'
expect 3 '^rextract-simulate: absent\.fits' $small -PSF_TYPE FILE -PSF_NAME absent.fits

simulates 'PSF of zeros'
make_fits psf-zero psf.fits
expect 3 '^rextract-simulate: psf\.fits' $small -PSF_TYPE FILE -PSF_NAME psf.fits

simulates 'PSF model that is none'
make_fits psf psf.fits
expect 3 '^rextract-simulate: psf\.fits' $small -PSF_TYPE PSFEX -PSF_NAME psf.fits

simulates 'templates that are not there'
expect 3 '^rextract-simulate: absent' $small -TEMPLATE_COUNT 100 -TEMPLATE_NAME absent

simulates 'templates in an empty folder'
mkdir cutouts
expect 3 '^rextract-simulate: cutouts' $small -TEMPLATE_COUNT 100 -TEMPLATE_NAME cutouts

simulates 'list of templates that names a missing file'
printf '# mine\nabsent.fits\n' >my.list
expect 3 'absent\.fits' $small -TEMPLATE_COUNT 100 -TEMPLATE_NAME @my.list

# --- outputs

simulates 'image and truth'
leaves sim.fits sim_truth.fits
expect 0 '' $small

simulates 'all outputs'
leaves a.fits b.fits c.cat d.fits
expect 0 '' $small -NOISE_TYPE CCD -GAIN 2 -BAD_COLUMNS 0.1 -IMAGE_NAME a.fits -SHARP_NAME b.fits -TRUTH_NAME c.cat -TRUTH_TYPE ASCII_HEAD -FLAG_NAME d.fits

simulates 'no truth wanted'
leaves sim.fits
expect 0 '' $small -TRUTH_NAME NONE

simulates 'a sky without objects'
leaves sim.fits sim_truth.fits
expect 0 '' $small $flat

simulates 'a configuration of its own dump'
leaves my.conf sim.fits sim_truth.fits
if [ "$active" = 1 ]; then
    "$program" -dd >my.conf
    expect 0 '' -c my.conf $small
fi

simulates 'a tile with objects added'
make_fits tile tile.fits
leaves sim.fits sim_truth.fits
expect 0 '' -INJECT_IMAGE tile.fits -PSF_FWHM 3 -GAIN 2 -STAR_COUNT 1000 -GALAXY_COUNT 0

simulates 'all images of a file with objects added'
make_fits extensions tile.fits
leaves sim.fits sim_truth.fits
expect 0 '' -INJECT_IMAGE tile.fits -PSF_FWHM 3 -GAIN 2 -STAR_COUNT 1000 -GALAXY_COUNT 0

simulates 'older outputs are replaced'
echo old >sim.fits
leaves sim.fits sim_truth.fits
expect 0 '' $small

simulates 'older outputs stay when the work fails'
make_fits nan tile.fits && echo old >sim.fits && echo old >sim_truth.fits
expect 3 '^rextract-simulate: tile\.fits' -INJECT_IMAGE tile.fits

simulates 'folder of the image that is not there'
expect 4 'absent/sim\.fits' $small -IMAGE_NAME absent/sim.fits

simulates 'truth that is a folder'
mkdir truth.fits
expect 2 'truth\.fits' $small -TRUTH_NAME truth.fits

simulates 'folder that cannot be written'
expect 4 '/proc/flags\.fits' $small -FLAG_NAME /proc/flags.fits

simulates 'two outputs of one name'
expect 2 'SHARP_NAME a\.fits is also IMAGE_NAME' $small -IMAGE_NAME a.fits -SHARP_NAME a.fits

simulates 'image that would replace the tile'
make_fits tile tile.fits
expect 2 'IMAGE_NAME \./tile\.fits is also read, as tile\.fits' -INJECT_IMAGE tile.fits -IMAGE_NAME ./tile.fits

simulates 'truth that would replace the configuration'
printf 'SEED 5\n' >my.conf
expect 2 'TRUTH_NAME my\.conf is also read' -c my.conf -TRUTH_NAME my.conf

simulates 'sharp reference that would replace the PSF'
make_fits psf psf.fits
expect 2 'SHARP_NAME psf\.fits is also read' -PSF_TYPE FILE -PSF_NAME psf.fits -SHARP_NAME psf.fits

simulates 'disk full at the image'
if [ "$active" = 1 ]; then
    list_files >../before
    (ulimit -f 16 && exec timeout 60 "$program" $small -VERBOSE_TYPE QUIET) >../out 2>../err
    echo $? >../code
    judge 4 'sim\.fits'
fi

simulates 'help to a full device'
if [ -c /dev/full ] && [ "$active" = 1 ]; then
    list_files >../before
    "$program" -h >/dev/full 2>../err
    echo $? >../code
    : >../out
    judge 4 '^rextract-simulate: standard output cannot be written'
else
    skip 'no /dev/full'
fi

simulates 'termination leaves nothing'
echo old >sim.fits
if [ "$active" = 1 ]; then
    list_files >../before
    timeout --foreground --preserve-status -s TERM 1 "$program" -IMAGE_SIZE 6000 -STAR_COUNT 20000 -VERBOSE_TYPE QUIET \
        >../out 2>../err </dev/null
    echo $? >../code
    judge 143 '^rextract-simulate: interrupted by a signal; nothing was written$'
fi

simulates 'same bytes for any number of threads, others for another seed or scene'
if [ "$active" = 1 ]; then
    list_files >../before
    for run in '-NTHREADS 1' '-NTHREADS 2' '-NTHREADS 3' '-SEED 2' '-SCENE_NUMBER 1'; do
        timeout 60 "$program" -IMAGE_SIZE 200,150 -NOISE_TYPE CCD -GAIN 2 -COSMIC_RAYS 500 -SHARP_NAME sharp.fits \
            -STAR_COUNT 3000 -GALAXY_COUNT 3000 -VERBOSE_TYPE QUIET $run
        echo $? >../code
        # without the headers, which name seed and scene
        cat sim.fits sharp.fits sim_truth.fits | tail -c +20000 | cksum
        rm -f sim.fits sharp.fits sim_truth.fits
    done >../sums 2>../err
    [ "$(head -n 3 ../sums | sort -u | wc -l)" = 1 ] || echo 'outputs depend on the number of threads' >>../err
    [ "$(sort -u ../sums | wc -l)" = 3 ] || echo 'outputs do not depend on seed and scene' >>../err
    : >../out
    judge 0 ''
fi
