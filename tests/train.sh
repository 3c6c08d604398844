#!/bin/sh
# Training end to end, a tiny one: it learns; the model has the same bytes for one and two threads,
# after kill -9 at random moments and after a polite signal; checkpoints of other settings and
# foreign files are refused; what is written can be read.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
program=$programs/rextract-train
need rextract-train
enter

cat >tiny.conf <<'END'
EPOCHS          3
WIDTH           4
BLOCKS          1
PATCH           48
PATCH_MARGIN    8
FIELD_PATCHES   2
GRID            2,1
BIN_IMAGES      60
BATCH           4
RATE            0.005
LOSS_FFL        0.1
SIM.STAR_COUNT  3000
QA_FIGURES      N
END

# start NAME ARGUMENT...: in the background as process $job; NAME/model.fits, NAME.ck, NAME (folder), NAME.log.
start() {
    name=$1
    shift
    mkdir -p "$name.model"
    "$program" tiny.conf -MODEL_NAME "$name.model/model.fits" -CHECKPOINT_NAME "$name.ck" -OUTPUT_NAME "$name" \
        "$@" 2>"$name.log" &
    job=$!
}

# The same, to its end.
training() {
    start "$@"
    wait $job
}

# same NAME: is what it left that of the whole run?
same() {
    cmp "$1.model/model.fits" whole.model/model.fits && cmp "$1.ck" whole.ck && diff -r "$1" whole
}

begun=$(date +%s%N)
training whole -NTHREADS 1 -VERBOSE_TYPE FULL
result 'a whole training on one thread' $? whole.log
took=$(($(date +%s%N) - begun)) # ns
[ "$(grep -Ec ' steps: [0-9.]+ s for [0-9]+ images; making images: [0-9.]+ s for [0-9]+ images$' whole.log)" = 3 ]
result 'tells what steps and images cost, epoch by epoch' $? whole.log
[ -e whole/training.html ] && [ -e whole/dictionary.ecsv ] && [ -e whole/log.ecsv ]
result 'leaves a page and tables' $? whole.log

# of_log FOLDER COLUMN: the values of all epochs
of_log() {
    awk -F, -v name="$2" '/^#/ { next } !head { head = 1; for (i = 1; i <= NF; i++) if ($i == name) at = i; next }
        { print $at }' "$1/log.ecsv"
}
column() { of_log whole "$1" | tail -n 1; }
awk -v test="$(column test_loss)" -v input="$(column input_loss)" 'BEGIN { exit !(test > 0 && test < 0.8 * input) }'
result "the loss is below that of unrestored images: $(column test_loss) against $(column input_loss)" $? whole/log.ecsv
[ "$(grep -c '^[0-9]' whole/log.ecsv)" = 3 ] && [ "$(grep -c '^[0-9]' whole/dictionary.ecsv)" = 6 ]
result 'a row for every epoch and bin' $? whole/dictionary.ecsv

# of the last step of each epoch: a warm-up of 4 %, then half a cosine
awk -F, '/^[0-9]/ { n++; t = (n - 0.5 * (($3 - last) / 4 == int(($3 - last) / 4) ? 4 : ($3 - last) % 4) / ($3 - last)) / 3; last = $3
    rate = 0.0025 * (1 + cos(3.14159265 * (t - 0.04) / 0.96)); if ($4 < 0.9999 * rate || $4 > 1.0001 * rate) exit 1 }' whole/log.ecsv
result 'the rate falls as it should' $? whole/log.ecsv
"$program" -INFO whole.model/model.fits >info 2>info.err && grep -q '^Training  *3 epochs' info && grep -q '^WIDTH 4$' info
result '-INFO tells what the model is' $? info
host=$(hostname)
[ ${#host} -ge 6 ] || host=$scratch # a short name may stand in a checksum by chance
! grep -q -F -e "$scratch" -e "$host" whole/training.html whole.model/model.fits
result 'nothing of this machine is in it' $? info

training threads -NTHREADS 2
same threads >difference 2>&1
result 'two threads: the same bytes' $? difference

# noise and skies as surveys deliver them
surveys="-EPOCHS 1 -FWHM_RANGE 2,5 -SMOOTHED_NOISE 0.3 -RESAMPLED_NOISE 0.3 -UNEVEN_NOISE 0.5 -SKY_OFFSETS 0.5 -SKY_WAVES 0.5
    -DARK_SKY 0.5 -DEFECTS 0.5 -PSF_ERRORS 0.5 -PSF_HALOS 0.5"
# shellcheck disable=SC2086 # a list
training survey $surveys -NTHREADS 1
result 'a training on what surveys deliver' $? survey.log
# shellcheck disable=SC2086 # a list
training surveys $surveys -NTHREADS 2
cmp survey.ck surveys.ck >difference 2>&1
result 'has the same bytes for two threads' $? difference
"$program" -INFO survey.model/model.fits >info 2>&1 && grep -q '^DARK_SKY 0.5$' info && ! grep -q SMOOTHED_FWHM info
result 'and its model says what it was trained on' $? info
training refused -SMOOTHED_NOISE 0.6 -RESAMPLED_NOISE 0.6
[ $? -eq 2 ] && grep -q 'RESAMPLED_NOISE: 0.6 and SMOOTHED_NOISE 0.6 are more than all images; give at most 0.4' refused.log
result 'more correlated noise than images is refused' $? refused.log

# killed: at random moments, until it is complete; the first two come before a training as fast as the whole one ends
hits=0 kills=0
while [ $kills -lt 6 ]; do
    start killed -NTHREADS 2
    sleep "$(awk -v seed="$(date +%N)" -v took="$took" 'BEGIN { srand(seed); printf "%.3f", 1e-9 * took * (0.05 + 0.2 * rand()) }')"
    kill -9 $job 2>/dev/null
    wait $job 2>/dev/null
    [ $? -eq 137 ] && hits=$((hits + 1))
    kills=$((kills + 1))
done
[ $hits -ge 2 ]
result "$hits of 6 kills struck" $? killed.log
training killed -NTHREADS 2
result 'goes on after kills' $? killed.log
same killed >difference 2>&1
result 'to the same bytes' $? difference
find . -name '.*.rx-*' >leftovers
[ ! -s leftovers ]
result 'nothing is left of the killed runs' $? leftovers

# a polite signal, once the work has begun: the state within the epoch is kept
start polite -NTHREADS 1 -VERBOSE_TYPE FULL
tries=0
while ! grep -q 'parameters' polite.log 2>/dev/null && [ $tries -lt 400 ]; do
    sleep 0.02
    tries=$((tries + 1))
done
sleep 0.3
kill -TERM $job
wait $job
[ $? -eq 143 ] && grep -q 'command goes on from there' polite.log && [ -e polite.ck ]
result 'a signal ends the training after its step' $? polite.log
training polite -NTHREADS 2
grep -q 'goes on' polite.log
result 'which then goes on' $? polite.log
same polite >difference 2>&1
result 'to the same bytes' $? difference

# complete: nothing more to do, what is lost comes back
rm -r whole.model/model.fits
cp -r whole before
training whole -NTHREADS 1
result 'a complete training writes its model again' $? whole.log
cmp whole.model/model.fits threads.model/model.fits >difference 2>&1 && diff -r before whole >>difference 2>&1
result 'with the same bytes' $? difference

# more epochs are an order to go on; other settings are another training
training whole -EPOCHS 4
[ $? -eq 0 ] && [ "$(grep -c '^[0-9]' whole/log.ecsv)" = 4 ]
result 'more epochs go on from a complete training' $? whole.log
training killed -RATE 0.001
[ $? -eq 2 ] && grep -q 'RATE 0.005, now it is RATE 0.001' killed.log
result 'a checkpoint of other settings is refused by name' $? killed.log
echo 'not ours' >letter.ck
training letter
[ $? -eq 2 ] && [ "$(cat letter.ck)" = 'not ours' ]
result 'a file that is no checkpoint is refused and left alone' $? letter.log
mkdir full && echo mine >full/thesis
training full
[ $? -eq 2 ] && [ "$(cat full/thesis)" = mine ] && [ ! -e full.ck ]
result 'a folder of somebody else is refused before the work' $? full.log

# while it goes on its model says so
start going -EPOCHS 100000
tries=0
until [ -e going.model/model.fits ] || [ $tries -ge 400 ]; do
    sleep 0.05
    tries=$((tries + 1))
done
kill -TERM $job
wait $job
"$program" -INFO going.model/model.fits 2>&1 | grep -q 'has not ended' &&
    ! "$program" -INFO whole.model/model.fits 2>&1 | grep -q 'has not ended'
result 'a model of a training that has not ended says so' $? going.log

# a rate that no network survives
training wild -RATE 1 -CLIP 0 -WARMUP 0 -EPOCHS 2 -LOSS_TYPE PLAIN
[ $? -eq 3 ] && grep -q 'lower RATE' wild.log && grep -q 'begins again with half the rate' wild.log
result 'a training that diverges goes back, then gives up and says so' $? wild.log

# with the image alone, and both networks
training blind -MODE BLIND -EPOCHS 1 -SELECTION UNIFORM
result 'BLIND' $? blind.log
"$program" -INFO blind.model/model.fits >info 2>&1 && grep -q BLIND info
result 'is said by -INFO' $? info

# a second stage, that goes on from a model of one
stages="-STAGES 2 -INIT_MODEL whole.model/model.fits -EPOCHS 2 -RATE 0.002"
# shellcheck disable=SC2086 # a list
training stages $stages -NTHREADS 1
"$program" -INFO stages.model/model.fits >info 2>&1 && grep -q '^SECOND ' info && grep -q 'after each stage' info
result 'a second stage' $? info
# shellcheck disable=SC2086 # a list
start again $stages -NTHREADS 2
sleep 1
kill -9 $job 2>/dev/null
wait $job 2>/dev/null
# shellcheck disable=SC2086 # a list
training again $stages -NTHREADS 2
cmp again.model/model.fits stages.model/model.fits >difference 2>&1
result 'has the same bytes after kill -9, on two threads' $? difference
"$programs/rextract-simulate" -IMAGE_SIZE 200 -PSF_FWHM 4 -IMAGE_NAME tile.fits -TRUTH_NAME NONE -VERBOSE_TYPE QUIET &&
    "$programs/rextract" tile.fits -RESTORE_TYPE NET -NET_MODEL ./stages.model/model.fits -PSF_TYPE MOFFAT -PSF_FWHM 4 -VERIFY_SEAMS Y -BLANK_CHECK 0 -HEADER_FACTS ALL \
        -CATALOG_TYPE FITS_1.0 -CATALOG_NAME stages.cat -VERBOSE_TYPE QUIET >net.log 2>&1 && grep -aq ' stages, each ' stages.cat
result 'restores a tile, and header says so' $? net.log

# a training whose last epoch is not its best, on two validation images: of several seeds the first
short="-EPOCHS 20 -BIN_IMAGES 20 -VALIDATION_IMAGES 1 -SELECTION UNIFORM -RATE 0.03 -FIELD_USES 40 -LOSS_IDT_PSF 0 -LOSS_REC 0
    -LOSS_REC_PSF 0"
for seed in 6 2 5 7 8; do
    rm -rf best best.ck
    # shellcheck disable=SC2086 # a list
    training best $short -SEED $seed -PATIENCE 0
    best=$(of_log best validation | awk 'NR == 1 || $1 < least { least = $1; at = NR } END { print at }')
    [ "$best" -ge 18 ] || break
done
[ "$best" -lt 18 ] && [ "$(of_log best validation | wc -l)" = 20 ] &&
    "$program" -INFO best.model/model.fits 2>&1 | grep -q "^Training  *20 epochs.* parameters of epoch $best\$"
result "the model is that of the best epoch, $best" $? best.log
training judged $short -SEED 1 -INIT_MODEL best.model/model.fits -EPOCHS 1 -RATE 1e-9
awk -v least="$(of_log best validation | sort -g | head -n 1)" -v found="$(of_log judged validation)" \
    'BEGIN { exit !(found > 0.9999 * least && found < 1.0001 * least) }'
result 'and has its loss, on validation images that no SEED changes' $? judged.log
training patient $short -SEED $seed -PATIENCE 2
[ "$(of_log patient validation | wc -l)" = 19 ] && grep -q 'no improvement, stopped after 19 epochs' patient.log &&
    "$program" -INFO patient.model/model.fits 2>&1 | grep -q " epoch $best\$"
result 'PATIENCE counts where the rate is low: epochs 18 and 19 of 20' $? patient.log

# begun with the networks of another training: better from the first epoch on than fresh ones, other shapes are refused
# shellcheck disable=SC2086 # a list
training begun $short -SEED $seed -INIT_MODEL best.model/model.fits -EPOCHS 1 -RATE 0.0005
[ $? -eq 0 ] && awk -v a="$(of_log begun test_loss)" -v b="$(of_log best test_loss | head -n 1)" 'BEGIN { exit !(a < 0.8 * b) }'
result 'a training begins where another one ended' $? begun.log
"$program" -INFO begun.model/model.fits 2>&1 | grep -q 'INIT_MODEL *model.fits'
result 'and says so in its model, without the folder' $? begun.log
training wider -INIT_MODEL whole.model/model.fits -WIDTH 8
[ $? -eq 2 ] && grep -q 'model.fits: its network has another shape; set WIDTH' wider.log
result 'a model of another shape is refused' $? wider.log
training other -INIT_MODEL whole.model/model.fits -MODE BLIND
[ $? -eq 2 ] && grep -q 'a model of MODE INFORMED cannot begin a training of MODE BLIND' other.log
result 'or of another mode' $? other.log
training single -INIT_MODEL stages.model/model.fits
[ $? -eq 2 ] && grep -q 'model.fits: its network has two stages, made for each other; set STAGES 2' single.log
result 'nor do two stages become one' $? single.log
training missing -INIT_MODEL nowhere.fits
[ $? -ne 0 ] && grep -q 'nowhere.fits' missing.log
result 'a model that is not there is named' $? missing.log

# an output that is blurrier than every input
training blunt -TARGET_FWHM 5 -FWHM_RANGE 2,4
[ $? -eq 2 ] && grep -q 'TARGET_FWHM 5: no PSF of FWHM_RANGE 2,4 is wider' blunt.log
result 'a target PSF wider than all is refused' $? blunt.log

finish
