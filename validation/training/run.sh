#!/bin/bash
# The models in the box, trained as they were:
#
#   validation/training/run.sh MODEL [FOLDER [-KEYWORD VALUE ...]]
#
# MODEL: psfnet, psfnet-fast, psfnet-deep, psfnet-blind, psfnet-paper, psfnet-paper-informed, psfnet-paper-long. psfnet begins with psfnet-fast.fits,
# that with psfnet-floor.fits, that with psfnet-skies.fits and that with psfnet-ideal.fits, psfnet-deep with psfnet-deep-ideal.fits,
# psfnet-blind with psfnet-blind-fields.fits, each trained first where FOLDER has none. psfnet, psfnet-fast, psfnet-floor, psfnet-skies
# and psfnet-deep want COSMOS galaxies: FOLDER/cosmos/train, else those of the data folder
# (RX_SHARED_DATA, or ../shared/data beside the sources; astropy).
#
# Everything goes into FOLDER (default: <MODEL>-out): the configuration, the model, the checkpoint, and the folder <MODEL>
# with log.ecsv, dictionary.ecsv and the page training.html. Started again after an interruption it goes on where it was;
# the model has the same bytes for any number of threads and interruptions. `-EPOCHS n` with a larger n goes on from a
# complete training. Under MPI: mpiexec -n 3 rextract-train <name>.train, inside FOLDER, gives the same bytes, too.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_TRAIN:-$top/build/rextract-train}
name=${1:-} recipe=${1:-} keywords=()
case $name in
psfnet | psfnet-fast | psfnet-floor | psfnet-skies | psfnet-ideal | psfnet-blind | psfnet-blind-fields | psfnet-paper | psfnet-paper-long) ;;
psfnet-deep) recipe=psfnet-skies keywords=(-BLOCKS 6 -RL_STEPS 2 -EPOCHS 168 -INIT_MODEL psfnet-deep-ideal.fits) ;;
psfnet-deep-ideal) recipe=psfnet-ideal keywords=(-BLOCKS 6 -RL_STEPS 2) ;;
psfnet-paper-informed) recipe=psfnet-paper keywords=(-MODE INFORMED) ;;
*)
    echo "run.sh: which model? usage: run.sh psfnet|psfnet-fast|psfnet-deep|psfnet-blind|psfnet-paper|psfnet-paper-informed" \
        "[FOLDER [-KEYWORD VALUE ...]]" >&2
    exit 2
    ;;
esac
out=${2:-$name-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")
mkdir -p "$out"
# everything is named from inside the folder: neither the model nor the tables hold a path of this machine
cp "$here/$recipe.train" "$out/$name.train"
if [[ $recipe =~ ^psfnet(-fast|-floor|-skies)?$ && ! -d $out/cosmos/train ]]; then
    python=$(for p in python3 /usr/bin/python3; do "$p" -c 'import astropy' 2>/dev/null && echo "$p" && break; done) ||
        { echo "run.sh: no python3 with astropy, which cuts COSMOS in two; install python3-astropy" >&2; exit 2; }
    "$python" "$here/stamps.py" "${RX_SHARED_DATA:-$top/../shared/data}/templates/cosmos" "$out/cosmos" >&2
fi
case $name in
psfnet) first=psfnet-fast ;;
psfnet-fast) first=psfnet-floor ;;
psfnet-floor) first=psfnet-skies ;;
psfnet-skies) first=psfnet-ideal ;;
psfnet-deep) first=psfnet-deep-ideal ;;
psfnet-blind) first=psfnet-blind-fields ;;
*) first= ;;
esac
[[ -z $first || -f $out/$first.fits ]] || "$0" "$first" "$out" "${@:3}"
cd "$out"
"$program" "$name.train" -MODEL_NAME "$name.fits" -OUTPUT_NAME "$name" -CHECKPOINT_NAME "$name.checkpoint" "${keywords[@]}" "${@:3}"
"$program" -INFO "$name.fits" | sed '/^$/,$d'
cat <<TEXT

To be the model in the box:
  RX_MODEL=$out/$name.fits validation/run.sh detection      and restoration, fluxes: is it better than the one there?
  cp $out/$name.fits config/$name.fits
  cp $out/$name.train $out/$name/*.ecsv validation/results/training/$name/
TEXT
