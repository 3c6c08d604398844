#!/bin/bash
# Trainings on a GPU, dozens at a time, for questions that take days on two cores: is the paper's recipe worth its time, are two
# stages better than one?
#
#   validation/training/twins.sh prepare FOLDER [FIELDS]    training images of three seeds, 800 x FIELDS (50) each, and first networks
#   validation/training/twins.sh check FOLDER               loss and gradients of twins.py beside the trainer's
#   validation/training/twins.sh train FOLDER [SECONDS]     on a GPU with 40 GB; 490 seconds of an H100 are 92,000 images each
#   validation/training/twins.sh models FOLDER              FOLDER/models/NAME.fits, and a folder of each cell in FOLDER/recipes
#
# Then `recipes.py FOLDER/recipes SEED` and `stages.py FOLDER SEED` judge them. 120,000 images take 33 GB and 16 cores two minutes.
# Needs a build of the sources (./quickstart), COSMOS galaxies as run.sh does, and python3 with torch (the first that has it; TWINS_PYTHON).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
build=${RX_BUILD_DIR:-$top/build}
what=${1:-} out=${2:-}
[[ -n $out ]] || { sed -n '2,/^set/{/^#/s/^# \{0,1\}//p}' "$0" >&2; exit 2; }
mkdir -p "$out"
out=$(cd "$out" && pwd)
both=(-LOSS_IDT 1 -LOSS_IDT_PSF 1 -LOSS_REC 1 -LOSS_REC_PSF 1 -LOSS_FFL 1)
# shellcheck disable=SC2034 # by name, below
alone=(-LOSS_IDT 1 -LOSS_IDT_PSF 0 -LOSS_REC 0 -LOSS_REC_PSF 0 -LOSS_FFL 1)
python=${TWINS_PYTHON:-}
for candidate in python3 /usr/bin/python3; do
    [[ -n $python ]] || ! "$candidate" -c 'import torch' 2>/dev/null || python=$candidate
done

# twins KEYWORDS...: that of twins.c, in FOLDER, by the settings of psfnet-fast.train (blind ones by those of psfnet-blind.train)
twins() {
    local settings=base.train
    [[ $1 != blind ]] || settings=blind.train
    (cd "$out" && rm -f "$TWINS_OUT" && ./twins "$settings" "${@:2}")
}

make_program() {

    [[ -f $build/.libs/librextract-train.a ]] || { echo "twins.sh: $build has no librextract-train.a; build first (./quickstart)" >&2; exit 2; }
    "${CC:-gcc}" -O2 -std=gnu11 -fopenmp -I"$build" -I"$top/src" -include "$build/configuration.h" "$here/twins.c" "$build/src/programs/program.o" \
        -o "$out/twins" -Wl,--as-needed "$build"/.libs/librextract-{train,lab}.a "$build/.libs/librextract-all.a" \
        -lcfitsio -lwcs -lfftw3f -lgsl -lgslcblas -lexpat -lz -lsep -lxxhash -lm
    for model in psfnet-fast psfnet-blind; do
        # networks begin anew, whatever the supplied ones begin with
        sed '/^INIT_MODEL/d' "$here/$model.train" >"$out/$([[ $model == psfnet-fast ]] && echo base || echo blind).train"
    done
}

case $what in
prepare)
    make_program
    if [[ ! -d $out/cosmos/train ]]; then
        /usr/bin/python3 "$here/stamps.py" "${RX_SHARED_DATA:-$top/../shared/data}/templates/cosmos" "$out/cosmos" >&2
    fi
    mkdir -p "$out/first"
    for seed in 1 2 3; do
        export TWINS_DO=first
        TWINS_OUT=first/informed-$seed twins base "${both[@]}" -SEED $seed
        TWINS_OUT=first/stages-$seed twins base -SEED $seed
        TWINS_OUT=first/deep-$seed twins base -BLOCKS 6 -RL_STEPS 2 -SEED $seed
        TWINS_OUT=first/blind-$seed twins blind "${both[@]}" -SEED $seed
        TWINS_DO=images FIELDS=${3:-50} TWINS_OUT=$seed.images twins base -SEED $seed -NTHREADS "$(nproc)"
    done
    TWINS_DO=images TEST=1 FIELDS=24 TWINS_OUT=test.images twins base -SEED 77 -NTHREADS "$(nproc)"
    ;;
check)
    for mode in informed blind; do
        for image in 3 77 150; do
            TWINS_DO=loss TWINS_OUT=check TWINS_IN=1.images AT=$image \
                twins $mode "${both[@]}" -LOSS_LIGHT 30 -SEED 1 >"$out/check.loss"
            "$python" "$here/twins.py" check "$out" "${mode^^}" "$out/check.loss" "$out/check" $image
        done
    done
    ;;
train)
    [[ -n $python ]] || { echo "twins.sh: no python3 with torch; install python3-torch" >&2; exit 2; }
    "$python" "$here/twins.py" train "$out" "${3:-490}"
    ;;
models)
    make_program
    export TWINS_DO=model IMAGES
    IMAGES=$(<"$out/trained/images")
    mkdir -p "$out/recipes" "$out/models"
    echo 128 >"$out/recipes/twins" # pixels a side
    for mode in informed blind; do
        for network in both alone; do
            declare -n losses=$network
            for selection in active uniform; do
                for seed in 1 2 3; do
                    name=$mode-$network-$selection-$seed cell=$out/recipes/$mode-$network-$selection-$seed
                    mkdir -p "$cell/training"
                    TWINS_IN=trained/$name TWINS_OUT=$cell/psfnet.fits twins $mode "${losses[@]}" -SELECTION "${selection^^}" -SEED $seed
                    printf '# %%ECSV 1.0\nepoch,patches\n1,%d\n' "$IMAGES" >"$cell/training/log.ecsv"
                done
            done
        done
    done
    for seed in 1 2 3; do
        TWINS_IN=trained/base-$seed TWINS_OUT=models/base-$seed.fits twins base -SEED $seed
        TWINS_IN=trained/deep-$seed TWINS_OUT=models/deep-$seed.fits twins base -BLOCKS 6 -RL_STEPS 2 -SEED $seed
        TWINS_IN=trained/stages-$seed TWINS_OUT=models/stages-$seed.fits twins base -STAGES 2 -SEED $seed
    done
    ;;
*) echo "twins.sh: prepare, check, train or models?" >&2 && exit 2 ;;
esac
