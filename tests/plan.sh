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
    and t[0]["cpu_seconds"] > 0 and [o["name"] for o in t[0]["outputs"]] == ["a_NONE.cat", "r_NONE.fits", "a_RL.cat",
    "r_RL.fits", "a.record"] and a["output_bytes"] == sum(o["bytes"] for o in t[0]["outputs"])'
result 'a tile' $? err
rm -f out err
find . -type f -exec cksum {} + | diff ../before - >../log
result 'no file is written' $? ../log

# the page of a tile without a reference, alone and beside the report against one, and the VOTable
qa='a.fits -RESTORE_TYPE NONE,RL -CATALOG_TYPE NONE -QA_TYPE TILE -QA_NAME qa -WRITE_XML Y -XML_NAME run.xml'
# shellcheck disable=SC2086 # a list of arguments
plan $qa && says '[o["name"] for o in t[0]["outputs"]] == ["qa", "run.xml"] and a["output_bytes"] == sum(o["bytes"] for o in t[0]["outputs"])' &&
    cp out ../alone && plan $qa -REFERENCE_NAME a.fits && says '[o["name"] for o in t[0]["outputs"]] == ["qa", "run.xml"]
    and t[0]["outputs"][0]["bytes"] > json.load(open("../alone"))["tiles"][0]["outputs"][0]["bytes"]' &&
    mkdir ../run && (cd ../run && ln -s ../work/a.fits . && "$program" $qa -VERBOSE_TYPE QUIET) >err 2>&1 && $python - 2>err <<'END'
import json, os
plan = {o["name"]: o["bytes"] for o in json.load(open("../alone"))["tiles"][0]["outputs"]}
page = sum(os.path.getsize(os.path.join("../run/qa", f)) for f in os.listdir("../run/qa"))
xml = os.path.getsize("../run/run.xml")
assert 0 < page < plan["qa"] and plan["run.xml"] / 10 < xml < plan["run.xml"], (page, xml, plan)
END
result 'the page of a tile and the VOTable' $? err

plan a.fits -PLAN_DENSITY 100 -NTHREADS 1 && cp out less && plan a.fits -PLAN_DENSITY 20000 -NTHREADS 8 && says 't[0]["threads"] == 8
    and t[0]["memory_bytes"] > json.load(open("less"))["all"]["memory_bytes"] and a["cpu_seconds"] > json.load(open("less"))["all"]["cpu_seconds"]'
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

# noise like the tile's, before the tile: at worst a window of 1024 x 1024, in time a quarter and more of a large tile; a
# copy of a small one, in memory
"$programs/rextract-simulate" -IMAGE_SIZE 1024 -STAR_COUNT 0 -GALAXY_COUNT 0 -IMAGE_NAME ../large.fits -TRUTH_NAME '' -VERBOSE_TYPE QUIET
net="-RESTORE_TYPE NET -NET_MODEL $top/config/psfnet.fits -PSF_TYPE MOFFAT -PSF_FWHM 3 -PLAN_DENSITY 1000 -NTHREADS 1"
# shellcheck disable=SC2086 # a list of arguments
plan ../large.fits $net -BLANK_CHECK 0 && cp out ../less && plan ../large.fits $net && says '
    1.5 < a["cpu_seconds"] / json.load(open("../less"))["all"]["cpu_seconds"] < 2.5 and
    10 * t[0]["pixels"] < a["memory_bytes"] - json.load(open("../less"))["all"]["memory_bytes"] < 30 * t[0]["pixels"]'
result 'the noise that NET looks at first' $? err
# shellcheck disable=SC2086
plan ../large.fits $net && cp out ../less && plan ../large.fits $net -RESTORE_TYPE AUTO && says '
    2 < a["cpu_seconds"] / json.load(open("../less"))["all"]["cpu_seconds"] < 10 and
    a["memory_bytes"] > json.load(open("../less"))["all"]["memory_bytes"]'
result 'AUTO takes the time of its choice' $? err

if $python - 2>err <<'END'
import numpy as np
from astropy.io import fits
y, x = np.mgrid[-10:11, -10:11]
g = [np.exp(-4 * np.log(2) * (x * x + y * y) / w**2) for w in (3.0, 3.2, 3.4, 3.6, 3.8, 4.0)]
g = [v / v.sum() for v in g]
basis = np.array([g[0]] + [v - g[0] for v in g[1:]], "f4")
t = fits.BinTableHDU.from_columns([fits.Column("PSF_MASK", f"{basis.size}E", dim="(21,21,6)", array=basis[None])], name="PSF_DATA")
t.header.update(POLNAXIS=2, POLNAME1="X_IMAGE", POLNAME2="Y_IMAGE", POLZERO1=48.0, POLZERO2=32.0, POLSCAL1=96.0, POLSCAL2=96.0, POLGRP1=1,
                POLGRP2=1, POLNGRP=1, POLDEG1=2, PSF_FWHM=3.0, PSF_SAMP=1.0, PSFNAXIS=3, PSFAXIS1=21, PSFAXIS2=21, PSFAXIS3=6)
t.writeto("../varying.psf")
END
then
    seconds() { $python -c "import json; print(json.load(open('$1'))['all']['cpu_seconds'])"; }
    same='a.fits -PLAN_DENSITY 1 -RL_NITER 1000'
    # shellcheck disable=SC2086 # a list of arguments
    plan $same -RESTORE_TYPE RL -PSF_TYPE MOFFAT -PSF_FWHM 3 && cp out less &&
        plan $same -RESTORE_TYPE RL -PSF_TYPE PSFEX -PSF_NAME ../varying.psf &&
        $python -c "import sys; sys.exit(not 2.5 < $(seconds out) / $(seconds less) < 4)" && says 'a["memory_bytes"] >
            json.load(open("less"))["all"]["memory_bytes"]'
    result 'six terms of a PSF take three and a half times the transforms' $? err
else
    skip 'a PSF that varies' 'no astropy'
fi

printf 'a.fits\nb.fits -RESTORE_TYPE RL_BLIND\n' >tiles.list
plan @tiles.list -RESTORE_TYPE NONE -CATALOG_NAME '{tile}.cat' && says 'len(t) == 2 and a["failed"] == 0
    and a["memory_bytes"] == t[1]["memory_bytes"] > t[0]["memory_bytes"]
    and abs(a["cpu_seconds"] - t[0]["cpu_seconds"] - t[1]["cpu_seconds"]) < 1e-6
    and a["output_bytes"] == t[0]["output_bytes"] + t[1]["output_bytes"] and t[1]["outputs"][0]["name"] == "b.cat"'
result 'a list' $? err
rm -f out err
find . -type f ! -name tiles.list ! -name less -exec cksum {} + | diff ../before - >../log
result 'no tile of a list is run' $? ../log

printf 'a.fits -PLAN_DENSITY 100\na.fits -PLAN_DENSITY 20000 -CATALOG_NAME dense.cat\n' >density.list
plan @density.list -CATALOG_NAME '{tile}.cat' && says 't[0]["sources"] < t[1]["sources"] and t[1]["outputs"][0]["name"] == "dense.cat"'
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

# under the address sanitizer memory is another matter, and time, too
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
