#!/bin/sh
# rextract -PLAN Y: what it prints, that it does nothing else, and that runs stay below it; what surveys cost.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
program=$programs/rextract
python=/usr/bin/python3
need rextract rextract-simulate tests/cli/make_model tests/cli/make_fits
if [ ! -x $python ]; then
    skip plans "$python is missing"
    finish
fi
enter

# says EXPRESSION: true of the JSON in `out`, whose tiles are `t` and whose sums are `a`
says() {
    $python -c "import json, sys; d = json.load(open('out')); t = d['tiles']; a = d['all']; sys.exit(not ($1))" 2>>err
}

plan() { "$program" -PLAN Y "$@" >out 2>err; }

for name in a b; do
    "$programs/rextract-simulate" -IMAGE_SIZE 96,64 -SEED 3 -IMAGE_NAME $name.fits -TRUTH_NAME '' -VERBOSE_TYPE QUIET || exit 2
done
mkdir work && mv a.fits b.fits work && cd work || exit 2
find . -type f -exec cksum {} + >../before
plan a.fits -RESTORE_TYPE NONE,RL -CATALOG_NAME a.cat -CHECKIMAGE_TYPE RESTORED -CHECKIMAGE_NAME r.fits -RECORD_NAME a.record
code=$?
[ $code = 0 ] && says 'len(t) == 1 and t[0]["pixels"] == 96 * 64 and t[0]["images"] == 1 and t[0]["memory_bytes"] > 1e7
    and t[0]["output_bytes"] == a["output_bytes"] > 2 * 4 * 96 * 64'
result 'a tile' $? err
rm -f out err
find . -type f -exec cksum {} + | diff ../before - >../log
result 'no file is written' $? ../log

# the page of a tile without a reference, alone and beside the report against one, and the VOTable
qa='a.fits -RESTORE_TYPE NONE,RL -CATALOG_TYPE NONE -QA_TYPE TILE -QA_NAME qa -WRITE_XML Y -XML_NAME run.xml'
# shellcheck disable=SC2086 # a list of arguments
plan $qa && cp out ../alone && plan $qa -REFERENCE_NAME a.fits && says 'a["output_bytes"] >
    json.load(open("../alone"))["all"]["output_bytes"]' && mkdir ../run &&
    (cd ../run && ln -s ../work/a.fits . && "$program" $qa -VERBOSE_TYPE QUIET) >err 2>&1 && $python - 2>err <<'END'
import json, os
made = sum(os.path.getsize(os.path.join(where, f)) for where, _, files in os.walk("../run") for f in files if f != "a.fits")
assert 0 < made < json.load(open("../alone"))["all"]["output_bytes"] < 100 * made, made
END
result 'the page of a tile and the VOTable' $? err

plan a.fits -PLAN_DENSITY 100 -NTHREADS 1 && cp out less && plan a.fits -PLAN_DENSITY 20000 -NTHREADS 8 && says 't[0]["threads"] == 8
    and t[0]["memory_bytes"] > json.load(open("less"))["all"]["memory_bytes"] and a["output_bytes"] > json.load(open("less"))["all"]["output_bytes"]'
result 'more sources and threads take more' $? err

# a variance that is taken by default costs what it costs when it is named, in both images
"$build/tests/cli/make_fits" calexp ../maps.fits
map='../maps.fits[VARIANCE]'
plan ../maps.fits -WEIGHT_TYPE MAP_VAR -WEIGHT_IMAGE "$map" && cp out ../named &&
    plan ../maps.fits,../maps.fits -WEIGHT_TYPE MAP_VAR,MAP_VAR -WEIGHT_IMAGE "$map,$map" && cp out ../both &&
    plan ../maps.fits,../maps.fits && says 'a["memory_bytes"] == json.load(open("../both"))["all"]["memory_bytes"]' &&
    plan ../maps.fits -WEIGHT_TYPE NONE && cp out ../without && plan ../maps.fits && says 't[0]["images"] == 1 and
    json.load(open("../without"))["all"]["memory_bytes"] < a["memory_bytes"] == json.load(open("../named"))["all"]["memory_bytes"]'
result 'maps beside the image in its file' $? err

"$programs/rextract-simulate" -IMAGE_SIZE 1024 -STAR_COUNT 0 -GALAXY_COUNT 0 -IMAGE_NAME ../large.fits -TRUTH_NAME '' -VERBOSE_TYPE QUIET
net="-RESTORE_TYPE NET -NET_MODEL $top/config/psfnet.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 -PLAN_DENSITY 1000 -NTHREADS 1"
# shellcheck disable=SC2086 # a list of arguments
plan ../large.fits $net && cp out ../less && plan ../large.fits $net -RESTORE_TYPE AUTO && says '
    a["memory_bytes"] == json.load(open("../less"))["all"]["memory_bytes"]'
result 'AUTO takes the memory of the network' $? err

printf 'a.fits\nb.fits -RESTORE_TYPE RL_BLIND\n' >tiles.list
plan @tiles.list -RESTORE_TYPE NONE -CATALOG_NAME '{tile}.cat' && says 'len(t) == 2 and a["failed"] == 0
    and a["memory_bytes"] == t[1]["memory_bytes"] > t[0]["memory_bytes"]
    and a["output_bytes"] == t[0]["output_bytes"] + t[1]["output_bytes"] and t[1]["image"] == "b.fits"'
result 'a list' $? err
rm -f out err
find . -type f ! -name tiles.list ! -name less -exec cksum {} + | diff ../before - >../log
result 'no tile of a list is run' $? ../log

printf 'a.fits -PLAN_DENSITY 100\na.fits -PLAN_DENSITY 20000 -CATALOG_NAME dense.cat\n' >density.list
plan @density.list -CATALOG_NAME '{tile}.cat' && says 't[0]["sources"] < t[1]["sources"]'
result 'tiles of a list with their own density' $? err
printf 'a.fits\nb.fits -NO_SUCH_KEY 1\n' >bad.list
plan @bad.list -CATALOG_NAME '{tile}.cat'
[ $? = 2 ] && [ ! -s out ] && grep -q 'bad.list:2: unknown keyword' err
result 'a list that is wrong is not planned' $? err

echo missing.fits >>tiles.list
plan @tiles.list -RESTORE_TYPE NONE -CATALOG_NAME '{tile}.cat'
[ $? = 8 ] && grep -q '1 of 3 tiles cannot be planned' err && says 'a["failed"] == 1 and a["tiles"] == 3 and "cannot be opened" in t[2]["error"]
    and "memory_bytes" not in t[2]'
result 'a tile of a list that is not there' $? err
plan missing.fits
[ $? = 3 ] && [ ! -s out ] && grep -q 'missing.fits: cannot be opened' err
result 'a tile that is not there' $? err
head -c 20000 a.fits >cut.fits
plan cut.fits
[ $? = 3 ] && [ ! -s out ]
result 'a tile that is cut off' $? err
plan a.fits -DETECT_TRESH 3
[ $? = 2 ] && [ ! -s out ]
result 'a keyword that is wrong' $? err

# under the address sanitizer memory is another matter
sky=
grep -q __asan_init "$program" && sky=o128
if [ -z "$sky" ]; then
    "$build/tests/cli/make_model" ../wide.fits WIDE
    "$programs/rextract-simulate" -IMAGE_SIZE 256 -IMAGE_NAME ../middle.fits -TRUTH_NAME '' -VERBOSE_TYPE QUIET
    net='../middle.fits -RESTORE_TYPE NET -NET_MODEL ../wide.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 -NTHREADS 2'
    # shellcheck disable=SC2086 # a list of arguments
    plan $net && $python - $net 2>err <<END
import json, os, subprocess, sys
run = subprocess.Popen(["$program", *sys.argv[1:], "-CATALOG_NAME", "wide.cat", "-VERBOSE_TYPE", "QUIET"])
_, status, usage = os.wait4(run.pid, 0)
plan = json.load(open("out"))["all"]
assert status == 0 and 1024 * usage.ru_maxrss < plan["memory_bytes"], (status, usage.ru_maxrss, plan)
END
    result 'a model four times as wide as the one that is supplied' $? err
fi
RX_BUILD_DIR=$programs $python "$top/validation/bench/plan.py" small $sky >log 2>&1 && ! grep -q '^0 runs' log
result 'runs stay below their plans' $? log

$python "$top/validation/cost/cost.py" >cost.md 2>err && diff "$top/validation/results/cost/cost.md" cost.md >>err
result 'what surveys cost is that of the committed benchmark' $? err

finish
