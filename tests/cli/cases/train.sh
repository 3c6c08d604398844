# rextract-train: what is printed, refused, and what a training leaves.
# shellcheck shell=sh disable=SC2154,SC2086 # variables of run.sh; lists of arguments are meant

# trains NAME: a case about this program.
trains() {
    begin "rextract-train: $1"
    of rextract-train
}

# A training of a second.
make_training() {
    cat "$top/tests/data/training.conf" >tiny.conf
}

# --- printed

trains 'no argument'
says 4
expect_exactly 2 '^usage: rextract-train \[-c\] FILE'

trains 'help'
prints 'rextract-train\(1\)'
expect_exactly 0 '' -h

trains 'version'
prints '^Rextract version [0-9]+\.[0-9]+'
expect_exactly 0 '' --version

trains 'default training'
prints '^BATCH +8 '
expect_exactly 0 '' -d

trains 'extended training'
prints '^SIM\.STAR_COUNT +300 '
expect_exactly 0 '' -dd

# --- refused on the command line

trains 'two training files'
expect 2 "^rextract-train: 'b\.conf' is one configuration file too many, after 'a\.conf'; give one$" a.conf b.conf

trains 'unknown keyword'
expect 2 "^rextract-train: unknown keyword '-EPOCH'; did you mean -EPOCHS\?$" -EPOCH 3

trains 'STAGE. has no place'
expect 2 "^rextract-train: unknown keyword '-STAGE\.GAIN'" -STAGE.GAIN 1

trains 'even kernel'
expect 2 '^rextract-train: -KERNELS: 4 is even; give odd numbers$' -KERNELS 3,4

trains 'odd image'
expect 2 '^rextract-train: -PATCH: 50 is no multiple of 4; give 52$' -PATCH 50

trains 'all margin'
expect 2 '^rextract-train: -PATCH_MARGIN: 16 leaves less than half of an image.s side of 64; give at most 15$' -PATCH 64 -PATCH_MARGIN 16

trains 'a keyword that is gone'
expect 2 'TRAIN_RANKS is no longer a keyword; all processes of mpiexec train; leave it out' -TRAIN_RANKS 2

trains 'a field that is too large'
expect 2 '^rextract-train: -FIELD_PATCHES: fields of 64 images of 512 pixels are too large; at most 32 are possible$' -PATCH 512 -FIELD_PATCHES 64

trains 'ranges the wrong way round'
expect 2 '^rextract-train: -FWHM_RANGE: 8 is above 2; give <from>,<to>$' -FWHM_RANGE 8,2

trains 'no loss'
expect 2 '^rextract-train: -LOSS_IDT: no term of the loss trains RESTORE' -LOSS_IDT 0 -LOSS_REC 0 -LOSS_REC_PSF 0 -LOSS_FFL 0

trains 'one name for two outputs'
expect 2 '^rextract-train: CHECKPOINT_NAME a\.fits is also MODEL_NAME; give each output its own name$' -MODEL_NAME a.fits -CHECKPOINT_NAME a.fits

trains 'nothing in the sky'
expect 2 '^rextract-train: -SIM\.STAR_COUNT: there are no stars' -SIM.STAR_COUNT 0 -SIM.GALAXY_COUNT 0

trains 'a real tile'
expect 2 '^rextract-train: -SIM\.INJECT_IMAGE: has no place in a training' -SIM.INJECT_IMAGE tile.fits

trains 'its own settings as an output'
make_training
expect 2 '^rextract-train: MODEL_NAME tiny\.conf is also read, as tiny\.conf; give the output another name$' tiny.conf -MODEL_NAME tiny.conf

trains 'a folder that cannot be made'
expect 4 '^rextract-train: /proc/no/model\.fits: ' -MODEL_NAME /proc/no/model.fits

trains 'templates that are not there'
make_training
expect '[34]' '^rextract-train: .*nowhere' tiny.conf -SIM.TEMPLATE_COUNT 10 -SIM.TEMPLATE_NAME nowhere

# --- -INFO

trains '-INFO without a model'
expect_exactly 2 '^rextract-train: -INFO has no value' -INFO

trains '-INFO of a file that is not there'
expect_exactly '[34]' '^rextract-train: none\.fits: ' -INFO none.fits

trains '-INFO of another file'
make_fits tile tile.fits
expect_exactly 3 '^rextract-train: tile\.fits.*model' -INFO tile.fits

# --- a training

trains 'outputs'
make_training
leaves trained.fits trained.checkpoint training
expect 0 '' tiny.conf

trains 'keywords set in vain'
make_training
leaves trained.fits trained.checkpoint training
says 4
expect_exactly 0 'SIM\.PSF_FWHM 3 has no effect in a' tiny.conf -SIM.PSF_FWHM 3 -MODE BLIND -TIKHONOV 0.1
