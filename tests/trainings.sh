#!/bin/sh
# validation/training/run.sh on tiny networks: models come out.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
RX_TRAIN=$programs/rextract-train
export RX_TRAIN
enter

for name in psfnet-fast psfnet psfnet-deep psfnet-blind psfnet-paper; do
    mkdir -p $name/cosmos/train # without real galaxies
    [ $name != psfnet ] || cp psfnet-fast/psfnet-fast.fits $name # what it begins with, made already
    "$top/validation/training/run.sh" $name $name -EPOCHS 1 -PATCH 48 -PATCH_MARGIN 8 -FWHM_RANGE 2,4 -GRID 1,1 -BIN_IMAGES 16 \
        -BLOCKS 1 -SIM.TEMPLATE_COUNT 0 -QA_FIGURES N >$name.log 2>&1 && [ -e $name/$name/training.html ]
    result "$name is trained" $? $name.log
    "$RX_TRAIN" -INFO $name/$name.fits >$name.info 2>&1
    case $name in *blind | *paper) mode=BLIND ;; *) mode=INFORMED ;; esac
    grep -q "^Mode  *$mode" $name.info
    result "$name has its mode" $? $name.info
done
"$top/validation/training/run.sh" nothing >log 2>&1
[ $? -eq 2 ] && grep -q 'which model' log
result 'an unknown model is refused' $? log

finish
