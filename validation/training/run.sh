#!/bin/bash
# The models in the box, trained as they were:
#
#   validation/training/run.sh psfnet|psfnet-fast|psfnet-blind|psfnet-survey [FOLDER [-KEYWORD VALUE ...]]
#
# Everything goes into FOLDER (default: <name>-out): the configuration, the model, the checkpoint, and the folder <name>
# with log.ecsv, dictionary.ecsv and the page training.html. Started again after an interruption it goes on where it was;
# the model has the same bytes for any number of threads and interruptions. `-EPOCHS n` with a larger n goes on from a
# complete training. Under MPI: mpiexec -n 3 rextract-train <name>.train, inside FOLDER, gives the same bytes, too.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_TRAIN:-$top/build/rextract-train}
case ${1:-} in
psfnet | psfnet-fast | psfnet-blind | psfnet-survey) name=$1 ;;
*)
    echo "run.sh: which model? usage: run.sh psfnet|psfnet-fast|psfnet-blind|psfnet-survey [FOLDER [-KEYWORD VALUE ...]]" >&2
    exit 2
    ;;
esac
out=${2:-$name-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")
mkdir -p "$out"
# everything is named from inside the folder: neither the model nor the tables hold a path of this machine
cp "$here/$name.train" "$out"
[[ $name != psfnet-survey ]] || cp "$top/config/psfnet.fits" "$out" # which it begins with
cd "$out"
"$program" "$name.train" "${@:3}"
"$program" -INFO "$name.fits" | sed '/^$/,$d'
cat <<TEXT

To be the model in the box:
  RX_MODEL=$out/$name.fits validation/run.sh detection      and restoration, fluxes: is it better than the one there?
  cp $out/$name.fits config/$name.fits
  cp $out/$name.train $out/$name/*.ecsv validation/results/training/$name/
TEXT
