#!/bin/bash
# The validation campaigns, one command each:
#
#   validation/run.sh CAMPAIGN [small|paper] [FOLDER [-KEYWORD VALUE ...]]
#
# restoration, restoration-real, photometry, sdss, detection, detection-errors, fluxes, fluxes-errors; robustness
# [FOLDER [SEED]] is robustness.py. NET takes part with the model of RX_MODEL, else with
# config/psfnet.fits; where there is neither, the other restorers compete without it.
#
# Journal and report go into FOLDER (default: <campaign>-out), the report as FOLDER/<campaign>/report.html. Started
# again after an interruption it goes on where it was. `sdss` injects into a real frame,
# restoration-real takes galaxies of COSMOS; they need the data folder: RX_SHARED_DATA, or ../shared/data beside the sources, and bunzip2.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/.." && pwd)
program=${RX_VALIDATE:-$top/build/rextract-validate}
usage() {
    echo "run.sh: $1; usage: run.sh CAMPAIGN [small|paper] [FOLDER [-KEYWORD VALUE ...]]" >&2
    echo "campaigns: restoration restoration-real photometry sdss detection detection-errors fluxes fluxes-errors" >&2
    echo "    robustness [FOLDER [SEED]]" >&2
    exit 2
}
if [[ ${1:-} == robustness ]]; then
    python=$(for p in python3 /usr/bin/python3; do "$p" -c 'import astropy, scipy' 2>/dev/null && echo "$p" && break; done) ||
        { echo "run.sh: no python3 with astropy and scipy; install python3-astropy and python3-scipy" >&2; exit 2; }
    exec "$python" "$here/robustness.py" "${2:-robustness-out}" "${@:3}"
fi
case ${1:-} in
restoration | restoration-real | photometry | detection | detection-errors | fluxes | fluxes-errors) name=$1 ;;
sdss) name=photometry-sdss ;;
*) usage "which campaign?" ;;
esac
case ${2:-small} in
small) size=SMALL ;;
paper) size=PAPER ;;
*) usage "$2 is no size" ;;
esac
out=${3:-$1-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")
# a final seed is run once, with the settings of the commit (ledger.py)
seed=$(sed -n 's/^SEED  *\([0-9]*\).*/\1/p' "$here/$name.conf")
for ((i = 4; i < $#; i++)); do
    [[ ${!i} != -SEED ]] || { ((i++)); seed=${!i}; }
done
[[ ${seed:-1} -lt 1000 ]] ||
    python3 "$here/ledger.py" claim "$1${RX_MODEL:+ $(basename "$RX_MODEL" .fits)}" "$out" "$seed" "${@:4}"
mkdir -p "$out"
# everything is named from inside the folder, so that the report holds no path of this machine
cp "$here/$name.conf" "$out"
if [[ $1 == sdss ]]; then
    frame=${RX_SHARED_DATA:-$top/../shared/data}/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2
    [[ -f $frame ]] || { echo "run.sh: $frame is missing; the SDSS frame is not part of this repository" >&2; exit 2; }
    [[ -f $out/frame.fits ]] || { bunzip2 -c "$frame" >"$out/frame.part" && mv "$out/frame.part" "$out/frame.fits"; }
fi
if [[ $1 == restoration-real && ! -d $out/cosmos ]]; then
    galaxies=${RX_SHARED_DATA:-$top/../shared/data}/templates/cosmos
    [[ -d $galaxies ]] || { echo "run.sh: $galaxies is missing; the COSMOS galaxies are not part of this repository" >&2; exit 2; }
    python=$(for p in python3 /usr/bin/python3; do "$p" -c 'import astropy' 2>/dev/null && echo "$p" && break; done) ||
        { echo "run.sh: no python3 with astropy; install python3-astropy" >&2; exit 2; }
    rm -rf "$out/cosmos.part"
    "$python" "$here/training/stamps.py" "$galaxies" "$out/cosmos.part" >&2 && mv "$out/cosmos.part" "$out/cosmos"
fi
model=${RX_MODEL:-$top/config/psfnet.fits}
restorers=()
if [[ -f $model ]]; then
    cp "$model" "$out/psfnet.fits"
    restorers=(-STAGE.NET_MODEL ./psfnet.fits)
elif [[ -n ${RX_MODEL:-} ]]; then
    echo "run.sh: RX_MODEL $model is missing" >&2
    exit 2
else
    echo "run.sh: there is no model ($model); NET does not take part" >&2
    restorers=(-RESTORE_TYPE "NONE,RL")
fi
cd "$out"
status=0
"$program" -c "$name.conf" -SIZE "$size" "${restorers[@]}" "${@:4}" || status=$?
# The report names the model that it speaks of.
if [[ -f psfnet.fits && -f $name/summary.json ]] && grep -q 'model [^"]*, digest ' "$name/summary.json"; then
    digest=$("$(dirname "$program")/rextract-train" -INFO psfnet.fits | sed -n '1s/.*, digest //p')
    grep -q ", digest $digest\"" "$name/summary.json" ||
        { echo "run.sh: $out/$name/summary.json is not of $model (digest $digest)" >&2; exit 1; }
fi
exit "$status"
