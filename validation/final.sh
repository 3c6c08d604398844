#!/bin/bash
# Judging: campaigns on one final seed (ledger.py), by the commit as it stands.
#
#   validation/final.sh SEED FOLDER [NAME...]      run NAME... (default: all of them), one after the other
#   validation/final.sh take FOLDER                what is complete in FOLDER becomes validation/results; then texts.py write
#
# Names are those of validation/results. Started again it goes on where it was. Those that need the data folder skip without it.
# SIZE=paper: campaigns with as many scenes as the paper has.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/.." && pwd)
names=(restoration restoration-real restoration-fast restoration-blind restoration-paper restoration-paper-long restoration-paper-informed detection detection-errors photometry photometry-sdss
    fluxes fluxes-errors robustness preal quality)
usage="final.sh: usage: final.sh SEED FOLDER [NAME...] | take FOLDER; names: ${names[*]}"
[[ $# -ge 2 ]] || { echo "$usage" >&2; exit 2; }
python=$(for p in python3 /usr/bin/python3; do "$p" -c 'import astropy, scipy' 2>/dev/null && echo "$p" && break; done) ||
    { echo "final.sh: no python3 with astropy and scipy; install python3-astropy and python3-scipy" >&2; exit 2; }
size=${SIZE:-small}
data=${RX_SHARED_DATA:-$top/../shared/data}

# run NAME SEED FOLDER
run() {
    case $1 in
    restoration-real) "$here/run.sh" restoration-real "$size" "$3" -SEED "$2" ;;
    restoration-*) RX_MODEL=$top/config/psfnet-${1#*-}.fits "$here/run.sh" restoration "$size" "$3" -SEED "$2" ;;
    photometry-sdss) "$here/run.sh" sdss "$size" "$3" -SEED "$2" ;;
    robustness) "$python" "$here/robustness.py" "$3" "$2" ;;
    preal) "$python" "$here/preal.py" "$3" "$2,$(($2 + 1)),$(($2 + 2))" ;;
    quality) "$python" "$here/bench/quality.py" run "$3" "$2" ;;
    *) "$here/run.sh" "$1" "$size" "$3" -SEED "$2" ;;
    esac
}

if [[ $1 == take ]]; then
    for name in "${names[@]}"; do
        folder=$2/$name
        [[ $name != restoration-* ]] || folder=$folder/restoration
        [[ ! -f $2/$name/complete ]] || "$python" "$here/texts.py" take "$name" "$folder"
    done
    exit
fi
mkdir -p "$2"
out=$(cd "$2" && pwd)
for name in "${@:3}"; do
    [[ " ${names[*]} " == *" $name "* ]] || { echo "$usage" >&2; exit 2; }
done
for name in "${@:3}" $([[ $# -gt 2 ]] || echo "${names[@]}"); do
    case $name in restoration-real | photometry-sdss) [[ -d $data ]] || { echo "final.sh: $name skips: no data folder" >&2; continue; } ;; esac
    if [[ -f $out/$name/complete ]]; then
        [[ $(<"$out/$name/complete") == "seed $1, $size, "* ]] ||
            { echo "final.sh: $out/$name is of $(<"$out/$name/complete"); take another folder" >&2; exit 2; }
        continue
    fi
    echo "final.sh: $name" >&2
    start=$SECONDS
    run "$name" "$1" "$out/$name"
    for rows in "$out/$name"/*/rows.ecsv; do
        [[ ! -f $rows ]] || "$python" "$here/contests.py" "$(dirname "$rows")"
    done
    echo "seed $1, $size, $((SECONDS - start)) s" >"$out/$name/complete"
done
