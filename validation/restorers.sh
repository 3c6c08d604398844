# shellcheck shell=bash disable=SC2034,SC2154
# To be sourced: which restorers the scripts on real sky compare. NET takes part with the model of RX_MODEL, else with
# config/psfnet.fits; where there is neither, the others are compared without it. Sets `restorers` (a list for
# RESTORE_TYPE), `net` (arguments of rextract) and `python`; needs `top`, the root of the sources, `out`, the folder to
# work in, and `modules`, what python3 has to have.
restorers=NONE,RL
net=()
model=${RX_MODEL:-$top/config/psfnet.fits}
if [[ -f $model ]]; then
    restorers=NONE,RL,NET
    net=(-NET_MODEL psfnet.fits)
    mkdir -p "$out"
    cp "$model" "$out/psfnet.fits" # named from inside the folder, so that no report holds a path of this machine
elif [[ -n ${RX_MODEL:-} ]]; then
    echo "RX_MODEL $model is missing" >&2
    exit 2
else
    echo "there is no model ($model); NET does not take part" >&2
fi
python=
for candidate in python3 /usr/bin/python3; do # the first one that has what the script uses
    if "$candidate" -c "import ${modules// /, }" 2>/dev/null; then python=$candidate && break; fi
done
[[ -n $python ]] || { echo "no python3 with $modules; install python3-${modules// / python3-}" >&2; exit 2; }
