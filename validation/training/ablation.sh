#!/bin/bash
# What each part of the network and of its training buys, at an equal number of training images: networks that differ in
# one thing from a base (ablation.train), on the same test scenes.
#
#   validation/training/ablation.sh [tiny|small|long [FOLDER [-KEYWORD VALUE ...]]]
#
# Into FOLDER (default: ablation-out): ablation.md and ablation.ecsv, and a folder for each variant with its trainings
# (epochs-<n>) and the campaigns on its model. Started again after an interruption it goes on where it was. Keywords of
# rextract-train go to every variant.
#
#   tiny   does it work? networks that have learned nothing, in half a minute
#   small  minutes to an hour on two cores: 64-pixel images, 16 epochs
#   long   hours on two cores: the images of psfnet.train, 60 epochs
#
# EPOCHS=n trains the base for n epochs instead. VARIANTS="base ffl ..." does these only (base is the first). The base's
# number of training images is the measure: active learning itself decides how many of an epoch's images are for the
# training, so a variant that has over 4 % more or fewer is trained anew with another number of epochs.
#
# Needs python3 with astropy and scipy for the table.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
trainer=${RX_TRAIN:-$top/build/rextract-train}
validate=${RX_VALIDATE:-$top/build/rextract-validate}
size=${1:-small}
out=${2:-ablation-out}

# NAME|what it is|keywords
variants=(
    'base|the base|'
    'seed|the base with another seed|-SEED 2'
    'psf|neither PSF network nor cycles|-LOSS_IDT_PSF 0 -LOSS_REC 0 -LOSS_REC_PSF 0'
    'ffl|no focal frequency loss|-LOSS_FFL 0'
    'active|no active learning|-SELECTION UNIFORM'
    'rl|no RL step|-RL_STEPS 0'
    'rl1|one RL step|-RL_STEPS 1'
    'half|half the width|-WIDTH 4'
    'double|double the width|-WIDTH 16'
    'blind|blind (no RL step either)|-MODE BLIND'
    'transposed|transposed decoder|-DECODER TRANSPOSED'
    'subpixel|sub-pixel decoder|-DECODER SUBPIXEL'
    'plain|loss in plain flux|-LOSS_TYPE PLAIN'
    'stretched|loss in stretched flux|-LOSS_TYPE STRETCHED'
)
# shellcheck disable=SC2054 # commas are inside of values
case $size in
tiny)
    epochs=8
    training=(-PATCH 48 -PATCH_MARGIN 8 -GRID 3,1 -BIN_IMAGES 20 -BLOCKS 1 -BATCH 4)
    restoration=(-SCENES_FWHM 2 -SCENES_SIGMA 2 -FWHM_RANGE 3,4 -SIGMA_RANGE 2,3 -SCENE_SIDE 96)
    detection=(-SCENE_TILES 1 -SEEING 2.5,4 -SIM.IMAGE_SIZE 192)
    fluxes=(-TILES 2 -SEEING 3 -MAGNITUDES 18,21,1 -STARS_PER_TILE 150 -SIM.IMAGE_SIZE 192)
    ;;
small)
    epochs=16
    training=(-PATCH 64 -FIELD_PATCHES 4 -BIN_IMAGES 40)
    restoration=(-SCENES_FWHM 10 -SCENES_SIGMA 5 -FWHM_RANGE 2,8 -SIGMA_RANGE 2,15)
    detection=(-SCENE_TILES 3 -SEEING 2.5,3,4,5,6,8)
    fluxes=(-TILES 2 -SEEING 2.5,4,6)
    ;;
long)
    epochs=60
    training=(-PATCH 128 -BIN_IMAGES 40)
    restoration=(-SCENES_FWHM 20 -SCENES_SIGMA 20 -FWHM_RANGE 2,8 -SIGMA_RANGE 2,15)
    detection=(-SCENE_TILES 12 -SEEING 2.5,3,4,5,6,8)
    fluxes=(-TILES 8 -SEEING 2.5,3,4,5,6,8)
    ;;
*)
    echo "ablation.sh: $size is no size; usage: ablation.sh [tiny|small|long [FOLDER [-KEYWORD VALUE ...]]]" >&2
    exit 2
    ;;
esac
epochs=${EPOCHS:-$epochs}
python=
for candidate in python3 /usr/bin/python3; do # the first one that has what the table needs
    if "$candidate" -c 'import astropy, numpy, scipy' 2>/dev/null; then python=$candidate && break; fi
done
[[ -n $python ]] || { echo "ablation.sh: no python3 with astropy and scipy; install python3-astropy and" \
    "python3-scipy" >&2; exit 2; }
for program in "$trainer" "$validate"; do
    [[ -x $program ]] || { echo "ablation.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
done
trainer=$(cd "$(dirname "$trainer")" && pwd)/$(basename "$trainer")
validate=$(cd "$(dirname "$validate")" && pwd)/$(basename "$validate")
mkdir -p "$out"
cd "$out"
cp "$here/ablation.train" "$here/../restoration.conf" "$here/../detection.conf" "$here/../fluxes.conf" .

# trained FOLDER: number of training images; of FOLDER's first epoch, when uniform: trained FOLDER 1
trained() {
    awk -F, -v epoch="${2:-}" '/^#/ { next } !at { for (i = 1; i <= NF; i++) if ($i == "patches") at = i; next }
        epoch == "" || $1 == epoch { n = $at } END { print n }' "$1/training/log.ecsv"
}

# train NAME EPOCHS KEYWORD...: NAME/epochs-EPOCHS
train() {
    local folder=$1/epochs-$2
    mkdir -p "$folder"
    (cd "$folder" && "$trainer" ../../ablation.train -EPOCHS "$2" "${training[@]}" "${@:3}" 2>>train.err) ||
        { tail -n 3 "$folder/train.err" >&2; exit 1; }
}

# nearest A B C: A B / C, rounded
nearest() {
    awk -v a="$1" -v b="$2" -v c="$3" 'BEGIN { printf "%d\n", a * b / c + 0.5 }'
}

# One variant: trained with as many images as the base, then through the campaigns.
one() {
    local name=$1 n=$epochs next tries=0
    shift
    if [[ $name != base ]]; then
        # uniform: 9/10 of an epoch's images less 10 are for the training, of the base's first epoch 1/2
        [[ " $* " != *" UNIFORM "* ]] || n=$(nearest "$images" 5 "$((9 * $(trained "base/epochs-$epochs" 1)))")
        while train "$name" "$n" "$@"; do
            next=$(nearest "$n" "$images" "$(trained "$name/epochs-$n")")
            awk -v a="$(trained "$name/epochs-$n")" -v b="$images" 'BEGIN { exit !((a / b - 1)^2 > 0.04^2) }' || break
            [[ $next != "$n" && $tries -lt 3 ]] || break
            n=$next tries=$((tries + 1))
        done
    else
        train base "$n" "$@"
    fi
    echo "$n" >"$name/epochs"
    cp "$name/epochs-$n/psfnet.fits" "$name/psfnet.fits"
    "$trainer" -INFO "$name/psfnet.fits" >"$name/info.txt"
    local common=(-RESTORE_TYPE NET -QA_FIGURES N -VERBOSE_TYPE QUIET)
    (
        cd "$name"
        "$validate" -c ../restoration.conf "${common[@]}" -EXAMPLES 0 "${restoration[@]}"
        "$validate" -c ../detection.conf "${common[@]}" -SCENES STARS,GALAXIES,PLATEAU "${detection[@]}"
        "$validate" -c ../fluxes.conf "${common[@]}" "${fluxes[@]}"
    )
}

images=0 list=()
for variant in "${variants[@]}"; do
    IFS='|' read -r name title keywords <<<"$variant"
    [[ " base ${VARIANTS:-$name} " == *" $name "* ]] || continue
    echo "ablation.sh: $name ($title)" >&2
    # the variant's own keywords come last and win
    read -r -a words <<<"$keywords"
    one "$name" "${@:3}" "${words[@]}"
    [[ $name != base ]] || images=$(trained "base/epochs-$epochs")
    list+=("$name|$title")
done
"$python" "$here/ablation.py" "$size" "${*:3}" "${list[@]}"
cat ablation.md
