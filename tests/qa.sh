#!/bin/sh
# The page of a tile and the VOTable of a run, which need no reference, and the page of a survey that links to it.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
# shellcheck source=tests/lib.sh
. "$top/tests/lib.sh"
need rextract rextract-simulate rextract-survey
enter
run() {
    p=$1
    shift
    OMP_NUM_THREADS=1 "$programs/$p" "$@" -VERBOSE_TYPE "${verbose:-QUIET}" >>log 2>&1
}

# Stars and galaxies, one elongated PSF, a block of dead pixels.
run rextract-simulate -IMAGE_NAME tile.fits -TRUTH_NAME truth.cat -IMAGE_SIZE 400,360 -SEED 3 -PSF_FWHM 3.5 -MAG_ZEROPOINT 25 -STAR_COUNT 3000 -STAR_MAG 14,20 -GALAXY_COUNT 500 -NOISE_SIGMA 5
result 'a tile is simulated' $? log
printf '%s\n' NUMBER XWIN_IMAGE FLUX_AUTO FLUX_TEMPLATE FLAGS FLAGS_WEIGHT FLAGS_WIN FLAGS_MEASURE FLAGS_TEMPLATE FLAGS_RESTORE >flags.param
tile="tile.fits -MAG_ZEROPOINT 25 -RESTORE_TYPE NONE,RL -RL_NITER 5 -QA_TYPE TILE -WRITE_XML Y"
# shellcheck disable=SC2086 # a list of arguments is meant
run rextract $tile -QA_NAME qa -XML_NAME run.xml -CATALOG_NAME a.cat -RECORD_NAME tile.record -PARAMETERS_NAME flags.param
result 'its page is written without a reference' $? log
mkdir three && ln -s ../tile.fits ../flags.param three
# shellcheck disable=SC2086
(cd three && OMP_NUM_THREADS=3 "$programs/rextract" $tile -NTHREADS 3 -QA_NAME qa -XML_NAME run.xml -CATALOG_NAME a.cat \
    -RECORD_NAME tile.record -PARAMETERS_NAME flags.param -VERBOSE_TYPE QUIET) >>log 2>&1
cmp three/qa/tile.html qa/tile.html >>log && cmp three/qa/tile.json qa/tile.json >>log && cmp three/tile.record tile.record >>log
result 'it is the same for any number of threads' $? log
cmp three/run.xml run.xml >>log
result 'so is the VOTable' $? log

[ ! -e qa/report.html ] && [ -s qa/tile.json ] && [ -s qa/tile_stars.ecsv ]
result 'no report against a reference stands beside it' $?
[ "$(wc -c <qa/tile.html)" -lt 1000000 ]
result 'the page is below 1 MB' $?
if command -v gnuplot >/dev/null; then
    for title in 'Seeing and ellipticity of the PSF' 'Seeing and ellipticity of stars' Sky Noise 'RL: what the model leaves' 'NONE: star locus' \
        'RL: star locus' Counts 'Noise of pixels without sources'; do
        grep -q "<title>$title</title>" qa/tile.html || echo "no figure $title" >>missing
    done
    [ "$(grep -c 'NUMBER [0-9]* at .* original | RL' qa/tile.html)" -eq 15 ] || echo 'not 15 cut-outs' >>missing
    [ "$(grep -c '<figure' qa/tile.html)" -eq "$(grep '^<title>' qa/tile.html | grep -vc '^<title>Tile: ')" ] || echo 'a figure without a title' >>missing
    [ ! -e missing ]
    result 'every figure is there and has its text' $? missing
else
    skip 'figures' 'gnuplot is not installed'
fi
# the verdict comes before all sections
[ "$(grep -n 'class="v ' qa/tile.html | head -n 1 | cut -d: -f1)" -lt "$(grep -n '<h2' qa/tile.html | head -n 1 | cut -d: -f1)" ]
result 'the verdict stands first' $?

# What is wrong with a tile is said: pixels far below the sky, and a noise map that is half of what it should be.
if /usr/bin/python3 -c 'import astropy, numpy' 2>/dev/null; then
    cat >check.py <<'PY'
import json
import re
import sys
import warnings

import numpy as np
from astropy.io import fits, votable

what = sys.argv[1]
if what == "break":
    with fits.open("tile.fits") as hdus:
        pixels = hdus[0].data
        rms = 1.4826 * np.median(np.abs(pixels - np.median(pixels)))
        hdus[0].data[::40, ::40] -= 20 * rms
        hdus.writeto("broken.fits")
        fits.writeto("rms.fits", np.full(pixels.shape, 0.5 * rms, "f4"))
        hdus[0].data = (3 * rms * np.rint(hdus[0].data / (3 * rms))).astype("f4")
        hdus.writeto("rounded.fits")
elif what == "keys":
    keys = {r["key"] for r in json.load(open(sys.argv[2]))["remarks"]}
    sys.exit(0 if set(sys.argv[3:]) <= keys else f"remarks are {keys}")
elif what == "numbers":
    numbers = {r["quantity"]: r for r in json.load(open("qa/tile.json"))["numbers"]}
    assert all(r["unit"] or r["quantity"] in ("noise_width", "noise_neighbours", "noise_neighbours_y", "noise_factor") for r in numbers.values())
    # one FWHM in page, log and header: the PSF's before the pixels widen it
    assert abs(numbers["psf_fwhm"]["value"] - 3.5) < 0.15, numbers["psf_fwhm"]
    header = re.search(r"RXPSF = .* FWHM ([0-9.]+) ", open(sys.argv[2], errors="replace").read()).group(1)
    assert abs(numbers["psf_fwhm"]["value"] - float(header)) < 0.001, (header, numbers["psf_fwhm"])
    assert numbers["psf_ellipticity"]["value"] < 0.06, numbers["psf_ellipticity"]
    assert abs(numbers["noise_width"]["value"] - 1) < 0.05, numbers["noise_width"]
    assert abs(numbers["pixel_scale"]["value"] - 0.396) < 1e-5, numbers["pixel_scale"]  # of the WCS, PIXEL_SCALE is 1
elif what == "flags":  # of the catalogues against those that are named, both ways
    names = ["FLAGS", "FLAGS_WEIGHT", "FLAGS_WIN", "FLAGS_MEASURE", "FLAGS_TEMPLATE", "FLAGS_RESTORE"]
    folder, catalog = sys.argv[2:4]
    page = json.load(open(folder + "/tile.json"))
    said = {(r["run"], r["column"], r["bit"]): r["sources"] for r in page["flags"]}
    found = {}
    for run in [r["run"] for r in page["runs"]]:
        lines = [l.split() for l in open(catalog.replace(".cat", f"_{run}.cat"))]
        columns = {l[2]: int(l[1]) - 1 for l in lines if l[0] == "#" and l[1].isdigit()}
        rows = [l for l in lines if l[0] != "#"]
        for name in names:
            values = np.array([int(r[columns[name]]) for r in rows]) if name in columns else np.zeros(0, int)
            for bit in 1 << np.arange(8):
                n = int(np.count_nonzero(values & bit))
                if n > 0 and not (name == "FLAGS_RESTORE" and bit == 4 and n == len(rows)):
                    found[run, name, int(bit)] = n
    assert said == found, sorted(set(said.items()) ^ set(found.items()))
    assert {c for _, c, _ in said} >= set(sys.argv[4:]), said
    assert all(0 < r["share"] <= 100 for r in page["flags"])
elif what == "fallback":  # RL was done by NONE
    runs = {r["run"]: r for r in json.load(open("empty/tile.json"))["runs"]}
    assert runs["NONE"]["not_explained"] == runs["RL"]["not_explained"] == 0, runs
    assert runs["AUTO"]["taken"] == "NONE" and "PSF" in runs["AUTO"]["why"] and not runs["RL"]["taken"], runs
    assert any(l.startswith('TOOK "NONE" ') for l in open("empty.record"))
elif what == "unfitted":
    columns = {r["column"] for r in json.load(open(sys.argv[2] + "/tile.json"))["flags"]}
    assert "FLAGS" in columns and not columns & {"FLAGS_TEMPLATE", "FLAGS_RESTORE"}, columns
elif what == "model":  # in page, VOTable and record
    runs = {r["run"]: r["not_explained"] / 100 for r in json.load(open("qa/tile.json"))["runs"]}
    images = votable.parse("run.xml").resources[0].resources[0].tables[0].to_table()
    assert all(0 <= v < 0.1 for v in runs.values()), runs
    assert all(abs(row["Not_Explained"] - runs[row["Restorer"]]) < 1e-6 for row in images), images["Not_Explained"]
    guard = [l.split() for l in open("tile.record") if l.startswith("GUARD ")]
    assert abs(float(guard[-1][3]) - runs["RL"]) < 1e-6, guard
elif what == "warnings":
    quiet, said = ([str(t) for t in votable.parse(name).resources[0].resources[0].tables[1].to_table()["Text"]] for name in sys.argv[2:4])
    log = open("said").read().replace("\nrextract:     ", " ")
    assert len(said) > 0 and said == quiet, (said, quiet)
    assert all("warning: " + text in log for text in said), said
    assert any(sys.argv[4] in text for text in said), said
else:
    warnings.simplefilter("error")
    file = votable.parse("run.xml", verify="exception")
    meta, config = file.resources[0].resources
    params = {p.name: p for p in meta.params}
    assert params["Software"].value == "Rextract" and params["NImages"].value == 1
    images, said = (t.to_table() for t in meta.tables)
    assert list(images["Restorer"]) == ["NONE", "RL"]
    assert str(images["Depth"].unit) == "mag" and meta.tables[0].get_field_by_id_or_name("FWHM").ucd == "instr.obsty.seeing"
    for run in images:
        rows = [l for l in open(f"a_{run['Restorer']}.cat") if not l.startswith("#")]
        assert len(rows) == run["NSextracted"] > 0
    assert {"WRITE_XML", "RESTORE_TYPE", "READ"} <= {p.name for p in config.params}
    assert said.colnames == ["Text"] and all(len(text) > 0 for text in said["Text"])
PY
    /usr/bin/python3 check.py numbers a_RL.cat >out 2>&1
    result 'numbers have units, and are those of the simulation' $? out
    /usr/bin/python3 check.py xml >out 2>&1
    result 'the VOTable is valid, with counts, units, UCDs and keywords' $? out
    /usr/bin/python3 check.py break && run rextract broken.fits -MAG_ZEROPOINT 25 -RESTORE_TYPE NONE -QA_TYPE TILE -QA_NAME broken -CATALOG_NAME b.cat \
        -WEIGHT_TYPE MAP_RMS -WEIGHT_IMAGE rms.fits -QA_FIGURES N -PARAMETERS_NAME flags.param
    /usr/bin/python3 check.py keys broken/tile.json noise holes >out 2>&1
    result 'dead pixels and a wrong noise map are named' $? out
    run rextract rounded.fits -MAG_ZEROPOINT 25 -RESTORE_TYPE NONE -PSF_TYPE MOFFAT -PSF_FWHM 3.5 -QA_TYPE TILE -QA_NAME rounded \
        -CATALOG_NAME s.cat -QA_FIGURES N -PARAMETERS_NAME flags.param
    /usr/bin/python3 check.py keys rounded/tile.json noise >out 2>&1
    result 'rounded values are named' $? out
    /usr/bin/python3 check.py flags qa a.cat FLAGS FLAGS_WIN FLAGS_MEASURE FLAGS_TEMPLATE FLAGS_RESTORE >out 2>&1
    result 'flags are those of the catalogue' $? out
    printf '%s\n' NUMBER XWIN_IMAGE FLAGS FLAGS_WIN >few.param
    run rextract tile.fits -RESTORE_TYPE NONE,RL -RL_NITER 2 -QA_TYPE TILE -QA_NAME few -CATALOG_NAME few.cat -QA_FIGURES N -PARAMETERS_NAME few.param &&
        /usr/bin/python3 check.py unfitted few >out 2>&1
    result 'nor is there a word of a fit that was not made' $? out
    # nothing is there to make a PSF of
    run rextract-simulate -IMAGE_NAME empty.fits -TRUTH_NAME '' -IMAGE_SIZE 200 -SEED 5 -STAR_COUNT 0 -GALAXY_COUNT 0
    empty="empty.fits -RESTORE_TYPE NONE,AUTO,RL -NET_MODEL $top/config/psfnet.fits -QA_TYPE TILE -QA_FIGURES N -CATALOG_TYPE NONE -WRITE_XML Y"
    # shellcheck disable=SC2086 # a list of arguments is meant
    run rextract $empty -QA_FIGURES Y -QA_NAME empty -RECORD_NAME empty.record -XML_NAME empty.xml && : >log &&
        verbose=NORMAL run rextract $empty -QA_NAME empty_said -XML_NAME said.xml && cp log said
    /usr/bin/python3 check.py warnings empty.xml said.xml 'RL: done by NONE' >out 2>&1
    result 'warnings are in the VOTable, whatever is shown' $? out
    /usr/bin/python3 check.py model >out 2>&1 && /usr/bin/python3 check.py fallback >out 2>&1
    result 'each restorer says what its model does not explain' $? out
else
    skip 'numbers and VOTable' 'python3 with astropy is not installed'
fi

grep -o 'remark(q, "[a-z0-9]*"' "$top/src/quality/tile_quality.c" | cut -d'"' -f2 | sort -u >keys
sed -n '/^| key in tile.json/,/^$/s/^| \([a-z0-9, ]*\) | [WL].*/\1/p' "$top/docs/qa.md" | tr -s ', ' '\n' | sort -u >documented
[ -s keys ] && diff keys documented >out
result 'each remark has its row in docs/qa.md' $? out

grep -q '^STATE .* [0-9]* [0-9]*$' tile.record && grep -q '^PAGE "qa/tile.html"$' tile.record
result 'the record holds the state and the page' $? tile.record
mkdir nights
run rextract-survey tile.record -OUTPUT_NAME nights/all && grep -q '<a href="../../qa/tile.html">' nights/all/report.html &&
    [ -e nights/all/../../qa/tile.html ]
result 'the survey links to it' $? log
rm -r qa
run rextract-survey tile.record -OUTPUT_NAME nights/all && ! grep -q tile.html nights/all/report.html
result 'where the page is gone there is no link' $? log
finish
