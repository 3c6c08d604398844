#!/bin/bash
# What template photometry costs: tiles of 4096 x 4096 pixels with more and more sources, with and without the template
# columns, wall clock seconds (the smaller of two runs) and peak memory. Nothing else should run meanwhile.
#
#   validation/template-time.sh [FOLDER]      into FOLDER (default: time-out): time.md
#
# RX_PROGRAM and RX_SIMULATE name the programs (default: those of build/). Needs GNU time (/usr/bin/time), about 1 GB of
# disk and 5 minutes.
set -euo pipefail
top=$(cd "$(dirname "$0")/.." && pwd)
program=$(realpath "${RX_PROGRAM:-$top/build/rextract}")
simulate=$(realpath "${RX_SIMULATE:-$top/build/rextract-simulate}")
out=${1:-time-out}
[[ -x /usr/bin/time ]] || { echo "template-time.sh: /usr/bin/time is missing; install the package time" >&2; exit 2; }
mkdir -p "$out"
cd "$out"
printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLUX_AUTO FLUXERR_AUTO >plain.param
{ cat plain.param; printf '%s\n' FLUX_TEMPLATE FLUXERR_TEMPLATE FLAGS_RESTORE; } >template.param
cp "$top/config/default.conv" .

# measure COLUMNS RESTORER: "seconds megabytes", the faster of two
measure() {
    local run best=''
    for run in 1 2; do
        /usr/bin/time -f '%e %M' -o "time$run" "$program" tile.fits -RESTORE_TYPE "$2" -PARAMETERS_NAME "$1.param" \
            -FILTER_NAME default.conv -NET_MODEL "$top/config/psfnet.fits" -PSF_TYPE MOFFAT -PSF_FWHM 4 -SATUR_LEVEL 1e9 \
            -CATALOG_NAME time.cat -CATALOG_TYPE FITS_1.0 -VERBOSE_TYPE QUIET
        best=$(printf '%s\n%s\n' "$best" "$(cat "time$run")" | grep . | sort -g | head -n 1)
    done
    awk '{ printf "%s %d", $1, $2 / 1024 }' <<<"$best"
}

{
    echo "| sources per Mpixel | restorer | found | without templates [s] | with [s] | difference per 1000 sources [s] | peak memory without, with [MB] |"
    echo "| --- | --- | --- | --- | --- | --- | --- |"
    for density in 350 1400; do
        "$simulate" -IMAGE_SIZE 4096 -SEED 1 -PSF_FWHM 4 -STAR_COUNT $((density / 2)) -GALAXY_COUNT $((density / 2)) \
            -STAR_MAG 16.5,22.5 -GALAXY_MAG 16.5,22.5 -STAR_SLOPE 0.1 -GALAXY_SLOPE 0.1 -MAG_ZEROPOINT 22.5 \
            -SKY_LEVEL 0.87 -NOISE_TYPE CCD -GAIN 987 -READ_NOISE 9 -IMAGE_NAME tile.fits -TRUTH_NAME NONE \
            -VERBOSE_TYPE QUIET
        for restorer in NONE NET; do
            read -r seconds memory <<<"$(measure plain "$restorer")"
            read -r with grown <<<"$(measure template "$restorer")"
            n=$(head -c 200000 time.cat | tr '\0' ' ' | grep -ao 'NAXIS2  = *[0-9]*' | tail -n 1 | grep -o '[0-9]*$')
            awk -v d="$density" -v r="$restorer" -v n="$n" -v a="$seconds" -v b="$with" -v m="$memory" -v g="$grown" \
                'BEGIN { printf "| %d | %s | %d | %.1f | %.1f | %.2f | %d, %d |\n", d, r, n, a, b, 1000 * (b - a) / n, m, g }'
        done
    done
} | tee time.md
rm -f tile.fits time.cat time1 time2
