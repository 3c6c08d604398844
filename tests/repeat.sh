#!/bin/sh
# Visits of one simulated field: what rextract-survey -REPEAT says of them against what was simulated.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract rextract-simulate rextract-survey
enter
run() {
    p=$1
    shift
    OMP_NUM_THREADS=1 "$programs/$p" "$@" -VERBOSE_TYPE QUIET >>log 2>&1
}
catalogue() {
    image=$1
    name=$2
    shift 2
    run rextract "$image" -RESTORE_TYPE NONE -PARAMETERS_NAME param -MAG_ZEROPOINT 25 -SATUR_LEVEL 1e30 -SATUR_KEY NONE \
        -PHOT_APERTURES 20 -PSF_TYPE MOFFAT -PSF_FWHM 4 -BACK_TYPE MANUAL -BACK_VALUE 1000 -CATALOG_TYPE FITS_LDAC \
        -CATALOG_NAME "$name" "$@"
}
# `value FILE NAME TABLE WORD...`: what is named, of the first row in which the words stand; `value FILE NAME`: of the whole.
value() {
    /usr/bin/python3 - "$@" <<'PY'
import json
import sys
where, name, *words = sys.argv[1:]
found = json.load(open(where))
if words:
    found = [row for row in found[words[0]] if all(word in map(str, row.values()) for word in words[1:])][0]
value = found[name]
print(value["value"] if isinstance(value, dict) else value)
PY
}
near() { awk -v a="$1" -v b="$2" -v t="$3" 'BEGIN { if (a == "" || a - b > t || b - a > t) { print a, "is not", b, "+-", t; exit 1 } }'; }
/usr/bin/python3 -c '' 2>/dev/null || {
    skip "$script" 'python3 is not installed'
    finish
}

# Stars of magnitude 14 alone: an aperture of 20 pixels across holds 10^4.4 ADU with an error of 10 sqrt(314) = 177 ADU, 7.7 mmag. In the
# second visit it holds 0.1 mag more, so that the error is 7.0 mmag, 7.3 in the mean; positions are off by 0.18 cos(2.2 deg) arcsec.
printf '%s\n' NUMBER ALPHAWIN_J2000 DELTAWIN_J2000 MAG_APER MAGERR_APER MAG_AUTO MAGERR_AUTO CLASS_TEMPLATE FLAGS >param
stars="-SEED 26 -IMAGE_SIZE 1100 -STAR_COUNT 300 -STAR_MAG 14,14 -GALAXY_COUNT 0 -LEAST_DISTANCE 8 -TRUTH_NAME NONE"
# shellcheck disable=SC2086 # a list of arguments is meant
run rextract-simulate $stars -IMAGE_NAME a.fits && run rextract-simulate $stars -NOISE_SEED 27 -MAG_ZEROPOINT 25.1 \
    -SKY_CENTER 150.00005,2.2 -IMAGE_NAME b.fits && catalogue a.fits a.cat && catalogue b.fits b.cat
result 'two visits of a field of stars' $? log
cmp -s a.fits b.fits
[ $? -eq 1 ]
result 'they differ' $?
aper='-REPEAT_COLUMNS MAG_APER,MAGERR_APER -REPEAT_SNR 100 -REPEAT_OUTLIER 10'
# shellcheck disable=SC2086
run rextract-survey -REPEAT a.cat b.cat $aper -OUTPUT_NAME stars
result 'they are compared' $? log
pair="stars/summary.json zero_point repeat a.cat"
# shellcheck disable=SC2086
near "$(value $pair)" -0.1 0.003 >out
result 'the zero point is found' $? out
n=$(value stars/summary.json bright repeat a.cat)
{ [ "$n" -gt 200 ] || echo "$n pairs"; } >out
[ ! -s out ]
result 'most stars make pairs' $? out
# errors of PA1 from n pairs: 7.3 / sqrt(0.74 n), by rms 7.3 / sqrt(2 n), here 0.46 and 0.28
near "$(value stars/summary.json pa1 repeat a.cat)" 7.3 1.2 >out && near "$(value stars/summary.json pa1_rms repeat a.cat)" 7.3 0.8 >>out
result 'PA1 is the noise of the aperture' $? out
# erfc(10 / 7.3 / sqrt 2) = 0.17 +- 0.02
near "$(value stars/summary.json pf1 repeat a.cat)" 0.17 0.06 >out
result 'PF1 is the share beyond PA2' $? out
near "$(value stars/summary.json pull repeat a.cat)" 1 0.2 >out
result 'the errors are true' $? out
near "$(value stars/summary.json offset_east repeat a.cat)" 179.87 3 >out && near "$(value stars/summary.json offset_north repeat a.cat)" 0 3 >>out
result 'the offset of positions is found' $? out
near "$(value stars/summary.json found repeat a.cat)" 1 0.02 >out
result 'all stars are found again' $? out

# Other formats have no image's header, and give the same pairs.
for type in ASCII_HEAD FITS_1.0 ASCII_VOTABLE; do
    # shellcheck disable=SC2086
    catalogue a.fits a.$type -CATALOG_TYPE $type && run rextract-survey -REPEAT Y a.$type b.cat $aper -QA_FIGURES N -OUTPUT_NAME $type &&
        near "$(value $type/summary.json bright repeat b.cat)" "$n" 0 >out
    result "a catalogue of $type" $? out
done

# A visit that sees half of the field, and one of which half is masked: what the other half holds is not missed.
catalogue 'b.fits[1:550,*]' half.cat
# shellcheck disable=SC2086
run rextract-survey -REPEAT a.cat half.cat $aper -QA_FIGURES N -OUTPUT_NAME half && near "$(value half/summary.json found repeat a.cat)" 1 0.03 >out
result 'what lies outside of a visit is not missed' $? out
seen=$(value half/summary.json seen limits points) whole=$(value stars/summary.json seen limits points)
{ [ "$seen" -gt $((whole / 3)) ] && [ "$seen" -lt $((whole * 2 / 3)) ] || echo "$seen of $whole"; } >out
[ ! -s out ]
result 'half of the sources count' $? out
if /usr/bin/python3 -c 'import astropy' 2>/dev/null; then
    /usr/bin/python3 -c '
from astropy.io import fits
image = fits.open("b.fits")
image[0].data[:, 550:] = 0
image.writeto("weight.fits")'
    catalogue b.fits masked.cat -WEIGHT_TYPE MAP_WEIGHT -WEIGHT_IMAGE weight.fits
    # shellcheck disable=SC2086
    run rextract-survey -REPEAT a.cat masked.cat $aper -QA_FIGURES N -OUTPUT_NAME blind &&
        near "$(value blind/summary.json found repeat a.cat)" 0.66 0.1 >out
    result 'without its weight map a masked visit looks incomplete' $? out
    # shellcheck disable=SC2086
    run rextract-survey -REPEAT a.cat masked.cat $aper -WEIGHT_IMAGE NONE,weight.fits -QA_FIGURES N -OUTPUT_NAME masked &&
        near "$(value masked/summary.json found repeat a.cat)" 1 0.03 >out
    result 'with it it does not' $? out
else
    skip 'weight maps' 'python3 has no astropy'
fi

# Three visits: all pairs, one row each.
# shellcheck disable=SC2086
run rextract-simulate $stars -NOISE_SEED 28 -IMAGE_NAME c.fits && catalogue c.fits c.cat &&
    run rextract-survey a.cat b.cat c.cat -REPEAT $aper -OUTPUT_NAME three
near "$(value three/summary.json pairs_of_visits)" 3 0 >out && near "$(value three/summary.json zero_point repeat b.cat c.cat)" 0.1 0.003 >>out &&
    near "$(value three/summary.json pa1 repeat all)" 7.4 0.8 >>out
result 'three visits make three pairs' $? out
near "$(value three/summary.json east repeat all)" "$(value stars/summary.json east repeat all)" 0.6 >out
result 'each pair has its own offset' $? out

# Faint stars: 90 % are found again where 90 % of the truth are found, on the scale of the first visit.
faint="-SEED 26 -IMAGE_SIZE 1100 -STAR_COUNT 1000 -STAR_MAG 16,20 -STAR_SLOPE 0.2 -GALAXY_COUNT 0 -LEAST_DISTANCE 3"
# shellcheck disable=SC2086
run rextract-simulate $faint -IMAGE_NAME d.fits -TRUTH_NAME d.truth && run rextract-simulate $faint -NOISE_SEED 27 -IMAGE_NAME e.fits -TRUTH_NAME NONE &&
    catalogue d.fits d.cat -REFERENCE_NAME d.truth -QA_NAME qa -QA_FIGURES N && catalogue e.fits e.cat -MAG_ZEROPOINT 27 && run rextract-survey -REPEAT d.cat e.cat -OUTPUT_NAME faint
result 'two visits of faint stars' $? log
for share in 90 50; do
    near "$(value faint/summary.json mag$share limits points)" "$(value qa/summary.json mag$share runs NONE)" 0.3 >out
    result "where $share % are found again $share % of the truth are found" $? out
done
finish
