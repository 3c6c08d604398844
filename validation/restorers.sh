# shellcheck shell=bash disable=SC2034
# To be sourced: which restorers the scripts on real sky compare. NET takes part with the model of RX_MODEL, else with
# config/psfnet.fits; where there is neither, the others are compared without it. Sets `restorers` (a list for
# RESTORE_TYPE) and `net` (arguments of rextract); needs `top`, the root of the sources.
restorers=NONE,RL
net=()
model=${RX_MODEL:-$top/config/psfnet.fits}
if [[ -f $model ]]; then
    model=$(cd "$(dirname "$model")" && pwd)/$(basename "$model")
    restorers=NONE,RL,NET
    net=(-NET_MODEL "$model")
elif [[ -n ${RX_MODEL:-} ]]; then
    echo "RX_MODEL $model is missing" >&2
    exit 2
else
    echo "there is no model ($model); NET does not take part" >&2
fi
python=
for candidate in python3 /usr/bin/python3; do # the first one that has what the scripts use
    if "$candidate" -c 'import astropy, numpy, scipy, matplotlib' 2>/dev/null; then python=$candidate && break; fi
done
[[ -n $python ]] || { echo "no python3 with astropy, scipy and matplotlib; install python3-astropy, python3-scipy and" \
    "python3-matplotlib" >&2; exit 2; }
