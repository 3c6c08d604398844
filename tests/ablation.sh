#!/bin/sh
# The scripts of validation/training on tiny networks: models come out, variants have as many training images as the
# base, the table says what the campaigns measured, and a second run changes nothing.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
RX_TRAIN=$programs/rextract-train RX_VALIDATE=$programs/rextract-validate
export RX_TRAIN RX_VALIDATE
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

# column FILE NAME ROW: of an ECSV table
column() {
    awk -F, -v name="$2" -v row="$3" '/^#/ { next } !at { for (i = 1; i <= NF; i++) if ($i == name) at = i; next }
        ++n == row { print $at }' "$1"
}

# psnr FOLDER: mean over its scenes, by another way than the script's
psnr() {
    awk -F, '/^#/ { next } !head { head = 1; for (i = 1; i <= NF; i++) if ($i == "psnr") at = i; next }
        $1 == "\"scene\"" { sum += $at; n++ } END { printf "%.6f\n", sum / n }' "$1/restoration/rows.ecsv"
}

ablation() {
    VARIANTS="active half" "$top/validation/training/ablation.sh" tiny small >table 2>log
}

if python3 -c 'import astropy, numpy, scipy' 2>/dev/null || /usr/bin/python3 -c 'import astropy, numpy, scipy' 2>/dev/null; then
    ablation
    result 'variants are trained and compared' $? log
    cp small/ablation.ecsv first.ecsv
    base=$(column first.ecsv patches 1)
    for row in 2 3; do
        n=$(column first.ecsv patches $row)
        awk -v n="$n" -v base="$base" 'BEGIN { exit !(n > 0.9 * base && n < 1.1 * base) }'
        result "variant $row: $n training images, the base $base" $? first.ecsv
    done
    said=$(column first.ecsv psnr_diff 3)
    awk -v said="$said" -v half="$(psnr small/half)" -v base="$(psnr small/base)" \
        'BEGIN { d = said - (half - base); exit !(said != 0 && d < 1e-4 && d > -1e-4) }'
    result "difference of PSNR: $said, $(psnr small/half) - $(psnr small/base)" $? first.ecsv
    [ "$(column first.ecsv parameters 3)" -lt "$(column first.ecsv parameters 1)" ]
    result 'half the width has fewer parameters' $? first.ecsv
    grep -q '^| half the width | ' table && grep -q '^- \*\*no active learning\*\*' table
    result 'the table is in words, too' $? table
    rm small/half/psfnet.fits small/ablation.md
    ablation && cmp first.ecsv small/ablation.ecsv >>log 2>&1
    result 'a second run changes nothing' $? log
    "$top/validation/training/ablation.sh" huge other >log 2>&1
    [ $? -eq 2 ] && [ ! -e other ]
    result 'an unknown size is refused' $? log
    SEEDS='1 2' SIZE=tiny "$top/validation/training/models.sh" models psfnet/psfnet.fits psfnet-deep/psfnet-deep.fits >table 2>log
    result 'models are compared' $? log
    mean_psnr() { echo "$(psnr "models/$1/seed-1") $(psnr "models/$1/seed-2")" | awk '{ printf "%.6f\n", ($1 + $2) / 2 }'; }
    said=$(sed -n 's/^| psfnet-deep | [0-9.-]* (\([-+0-9.]*\)[\\*]*) | .*/\1/p' models/models.md | head -n 1)
    awk -v said="$said" -v deep="$(mean_psnr psfnet-deep)" -v base="$(mean_psnr psfnet)" \
        'BEGIN { d = said - (deep - base); exit !(said != "" && d < 0.006 && d > -0.006) }'
    result "difference of their PSNR: $said, $(mean_psnr psfnet-deep) - $(mean_psnr psfnet) on two seeds" $? models/models.md
    SEEDS='1 1000' "$top/validation/training/models.sh" models psfnet/psfnet.fits psfnet-deep/psfnet-deep.fits >log 2>&1
    [ $? -eq 2 ] && grep -q 'SEEDS has 1000' log
    result 'none is chosen by a final seed' $? log
    "$top/validation/training/models.sh" models psfnet/psfnet.fits absent.fits >log 2>&1
    [ $? -eq 2 ] && grep -q 'absent.fits is missing' log
    result 'a model that is missing is named' $? log
else
    skip 'the table' 'no python3 with astropy and scipy'
fi
finish
