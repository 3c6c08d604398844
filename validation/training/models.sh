#!/bin/bash
# What one network does beside another: the campaigns restoration, detection (without pairs and errors) and fluxes on each
# of the models, on the same scenes, for the network alone.
#
#   validation/training/models.sh FOLDER MODEL MODEL...     the first is what the others are compared with
#   validation/training/models.sh out config/psfnet.fits psfnet-deep.fits
#
# Into FOLDER: models.md, and a folder for each model with its campaigns. Started again after an interruption it goes on
# where it was. Half a minute for each model and seed on two cores. SEEDS='11 12 13': of the skies (default: 1), below 1000, as
# models are chosen by this. SIZE=tiny: does it work?
#
# Needs python3 with astropy and scipy for the table.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
trainer=${RX_TRAIN:-$top/build/rextract-train}
validate=${RX_VALIDATE:-$top/build/rextract-validate}
if [[ $# -lt 3 ]]; then
    echo "models.sh: usage: models.sh FOLDER MODEL MODEL..." >&2
    exit 2
fi
case ${SIZE:-small} in
small)
    restoration=(-EXAMPLES 0 -FWHM_RANGE '2,8' -SIGMA_RANGE '2,15')
    detection=(-SCENES 'STARS,GALAXIES,PLATEAU')
    fluxes=()
    ;;
tiny)
    restoration=(-EXAMPLES 0 -SCENES_FWHM 2 -SCENES_SIGMA 2 -FWHM_RANGE '3,4' -SIGMA_RANGE '2,3' -SCENE_SIDE 96)
    detection=(-SCENES 'STARS,GALAXIES,PLATEAU' -SCENE_TILES 1 -SEEING '2.5,4' -SIM.IMAGE_SIZE 192)
    fluxes=(-TILES 2 -SEEING 3 -MAGNITUDES '18,21,1' -STARS_PER_TILE 150 -SIM.IMAGE_SIZE 192)
    ;;
*) echo "models.sh: ${SIZE} is no size" >&2 && exit 2 ;;
esac
for seed in ${SEEDS:-1}; do
    [[ $seed =~ ^[0-9]{1,3}$ ]] || { echo "models.sh: SEEDS has $seed; models are chosen by seeds below 1000" >&2; exit 2; }
done
for program in "$trainer" "$validate"; do
    [[ -x $program ]] || { echo "models.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
done
for model in "${@:2}"; do
    [[ -f $model ]] || { echo "models.sh: $model is missing" >&2; exit 2; }
done
trainer=$(realpath "$trainer") validate=$(realpath "$validate")
python=
for candidate in python3 /usr/bin/python3; do
    if "$candidate" -c 'import astropy, numpy, scipy' 2>/dev/null; then python=$candidate && break; fi
done
[[ -n $python ]] || { echo "models.sh: no python3 with astropy and scipy; install python3-astropy and python3-scipy" >&2; exit 2; }

out=$1 names=()
mkdir -p "$out"
cp "$top/validation/"{restoration,detection,fluxes}.conf "$out"
for model in "${@:2}"; do
    name=$(basename "$model" .fits)
    [[ " ${names[*]-} " != *" $name "* ]] || { echo "models.sh: two models are named $name" >&2; exit 2; }
    names+=("$name")
    mkdir -p "$out/$name"
    "$trainer" -INFO "$model" >"$out/$name/info.txt"
    for seed in ${SEEDS:-1}; do
        common=(-RESTORE_TYPE NET -SEED "$seed" -QA_FIGURES N -VERBOSE_TYPE QUIET)
        mkdir -p "$out/$name/seed-$seed"
        cp "$model" "$out/$name/seed-$seed/psfnet.fits"
        (
            cd "$out/$name/seed-$seed"
            "$validate" -c ../../restoration.conf "${common[@]}" "${restoration[@]}"
            "$validate" -c ../../detection.conf "${common[@]}" "${detection[@]}"
            "$validate" -c ../../fluxes.conf "${common[@]}" "${fluxes[@]}"
        )
    done
done
cd "$out"
"$python" -B "$here/models.py" "${names[@]}"
cat models.md
