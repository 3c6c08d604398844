#!/bin/sh
# What other programs make of our files: the completion in bash, regions of DS9 beside the same columns as text, units and tables in astropy and
# STILTS. What is not installed is skipped.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
need rextract
tile=$top/tests/data/sim.fits.fz
enter
run() { "$programs/rextract" "$tile" -RESTORE_TYPE NONE -VERBOSE_TYPE QUIET "$@"; }

# --- completion of bash ---

if command -v bash >/dev/null; then
    bash -c '
        . "$1/completion/rextract"
        try() {
            wanted=$1
            shift
            COMP_WORDS=("$@")
            COMP_CWORD=$(($# - 1))
            _rextract "$1"
            [ "${COMPREPLY[*]}" = "$wanted" ] || { echo "$*: ${COMPREPLY[*]}, not $wanted"; exit 1; }
        }
        try "-CATALOG_TYPE" rextract tile.fits -CATALOG_TY
        try "FITS_1.0 FITS FITS_LDAC" /usr/bin/rextract tile.fits -CATALOG_TYPE F
        try "NONE,RL NONE,RL_BLIND" rextract tile.fits -RESTORE_TYPE NONE,R
        try "Y N" rextract-mpi @list -VERIFY_SEAMS ""
        try "-INFO" rextract-train -INF
        try "" rextract tile.fits -CATALOG_NAME ti' bash "$top" >log 2>&1
    result 'bash completes keywords, their words and lists of them' $? log
else
    skip 'completion of bash' 'bash is not installed'
fi

# --- regions ---

for column in NUMBER X_IMAGE Y_IMAGE A_IMAGE B_IMAGE THETA_IMAGE KRON_RADIUS ALPHA_J2000 DELTA_J2000 A_WORLD B_WORLD THETA_J2000 FLAGS; do
    echo "$column"
done >regions.param
echo NUMBER >number.param
run -PARAMETERS_NAME regions.param -CATALOG_TYPE ASCII -CATALOG_NAME sky.cat && run -PARAMETERS_NAME number.param -CATALOG_TYPE DS9 -CATALOG_NAME sky.reg
# Numbers in a line of regions: two of the place, two axes, angle; colour by flags; the source's number.
grep '^icrs;ellipse' sky.reg | sed 's/[^0-9.+-]*ellipse(//; s/["(),]/ /g; s/# color=//; s/text={//; s/}//' >sky.txt
paste -d' ' sky.cat sky.txt | awk '
    function near(a, b, tolerance) { if (a - b > tolerance || b - a > tolerance) { print NR ": " a " is not " b; bad = 1 } }
    {
        near($14, $8, 1e-6); near($15, $9, 1e-6)
        kron = $7 > 0 ? $7 : 3
        near($16, 3600 * $10 * kron, 0.005 * $16); near($17, 3600 * $11 * kron, 0.005 * $17); near($18, $12 + 90, 0.02)
        colour = $13 >= 4 ? "red" : $13 > 0 ? "yellow" : "green"
        if ($19 != colour) { print NR ": " $19; bad = 1 }
        near($20, $1, 0)
    }
    END { exit bad || NR < 100 }' >log
result 'regions are the ellipses of the catalogue on the sky' $? log
[ "$(grep -c 'tag={SATURATED}' sky.reg)" -gt 0 ] && [ "$(grep -c 'tag={SATURATED}' sky.reg)" -eq "$(awk 'int($13 / 4) % 2' sky.cat | wc -l)" ]
result 'flags are tags' $?
[ "$(wc -l <sky.cat)" -eq "$(wc -l <sky.txt)" ]
result 'one region for each source' $?
"$programs/rextract" -c sky.reg -CATALOG_NAME again.reg >log 2>&1
result 'a region file can be repeated' $? log

# --- tables ---

"$programs/rextract" -dp | sed 's/^#//' | grep -Ev 'ASSOC|IMAFLAGS|INJECTED|VIGNET|CLASS_STAR' >all.param
for type in FITS_1.0 FITS_LDAC ASCII_VOTABLE; do
    run -PARAMETERS_NAME all.param -CATALOG_TYPE $type -CATALOG_NAME $type.cat
done
if /usr/bin/python3 -c 'import astropy' 2>/dev/null; then
    /usr/bin/python3 -W error::UserWarning >log 2>&1 <<'END'
import warnings
import astropy.units as u
import numpy as np
from astropy.io import fits
from astropy.table import Table


def values(column):
    column = column.filled(np.nan) if hasattr(column, "filled") and column.dtype.kind == "f" else column
    return np.asarray(column, dtype=float).ravel()


with fits.open("FITS_1.0.cat") as hdus:
    hdus.verify("exception")
    units = [c.unit for c in hdus[1].columns if c.unit]
for unit in units:
    u.Unit(unit, format="fits", parse_strict="raise")
assert len(units) > 100
with warnings.catch_warnings():
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", ResourceWarning)
    a = Table.read("FITS_1.0.cat")
    b = Table.read("ASCII_VOTABLE.cat", format="votable")
    c = Table.read("FITS_LDAC.cat", hdu=2)
for name in a.colnames:
    for t in a, b, c:
        assert not isinstance(t[name].unit, u.UnrecognizedUnit), name
    assert (a[name].unit or u.one) == (b[name].unit or u.one), (name, a[name].unit, b[name].unit)
    for t in b, c:
        assert np.array_equal(values(a[name]), values(t[name]), equal_nan=True), name
assert len(a) == len(b) == len(c) > 100
END
    result 'astropy reads all tables alike without a warning, their units too' $? log
else
    skip 'tables in astropy' 'python3-astropy is not installed'
fi
if command -v stilts >/dev/null; then
    for table in FITS_1.0.cat 'FITS_LDAC.cat#2'; do
        stilts tpipe in="$table" ifmt=fits omode=count 2>&1
    done >log
    stilts tpipe in=ASCII_VOTABLE.cat ifmt=votable omode=count >>log 2>&1
    [ "$(sort -u log | wc -l)" -eq 1 ] && grep -q '^columns: [0-9]*  *rows: [0-9]*$' log
    result 'STILTS reads all tables alike, without a warning' $? log
    stilts votlint ASCII_VOTABLE.cat >log 2>&1 && [ ! -s log ]
    result 'votlint has nothing to say' $? log
else
    skip 'tables in STILTS' 'stilts is not installed'
fi

# --- references ---

if /usr/bin/python3 -c 'import astropy' 2>/dev/null; then
    /usr/bin/python3 - "$top" >log 2>&1 <<'END'
"""The truth of the tile under the names of surveys, as CSV, FITS and VOTable; Gaia's at the epoch 2016.0, with motions of up to
10 arcsec a year."""
import sys

import astropy.units as u
import numpy as np
from astropy.coordinates import SkyCoord
from astropy.io import fits
from astropy.table import Table
from astropy.time import Time

top = sys.argv[1]
with fits.open(top + "/tests/data/sim.fits.fz") as hdus:
    tile = [h for h in hdus if h.data is not None][0]
    tile.header["DATE-OBS"] = "2024-01-02T06:00:00"
    fits.writeto("tile.fits", tile.data, tile.header)
truth = Table.read(top + "/tests/data/sim_truth.fits")
ra, dec, mag = (np.array(truth[c]) for c in ("ALPHA_J2000", "DELTA_J2000", "MAG"))
rng = np.random.default_rng(1)
pm = rng.uniform(-1e4, 1e4, (2, len(ra)))
now = SkyCoord(ra * u.deg, dec * u.deg, pm_ra_cosdec=pm[0] * u.mas / u.yr, pm_dec=pm[1] * u.mas / u.yr, distance=1 * u.pc,
               radial_velocity=0 * u.km / u.s, obstime=Time("2024-01-02T06:00:00"))
then = now.apply_space_motion(new_obstime=Time(2016.0, format="jyear", scale="tcb"))
gaia = Table({"designation": ["Gaia DR3 %d" % i for i in range(len(ra))], "ra": then.ra.deg, "dec": then.dec.deg,
              "pmra": then.pm_ra_cosdec.to_value(u.mas / u.yr), "pmdec": then.pm_dec.to_value(u.mas / u.yr),
              "ref_epoch": np.full(len(ra), 2016.0), "phot_g_mean_mag": mag, "phot_g_mean_flux_over_error": 100 + 0 * mag,
              "phot_rp_mean_mag": mag - 0.5})
gaia.write("gaia.csv")
gaia.write("gaia.fits")
gaia.write("gaia.vot", format="votable")
Table({"raMean": ra, "decMean": dec, "gMeanPSFMag": mag + 0.7, "rMeanPSFMag": mag, "rMeanPSFMagErr": 0.01 + 0 * mag}).write("ps1.csv")
Table({"ra": ra, "dec": dec, "psfMag_g": mag + 0.7, "psfMag_r": mag, "psfMagErr_r": 0.01 + 0 * mag}).write("sdss.fits")
Table({"RA": ra, "DEC": dec, "MAG_AUTO_G": mag + 0.7, "MAG_AUTO_R": mag, "MAGERR_AUTO_R": 0.01 + 0 * mag}).write("des.vot", format="votable")
END
    result 'references of surveys are made' $? log
    for reference in "$top/tests/data/sim_truth.fits" gaia.csv gaia.fits gaia.vot ps1.csv sdss.fits des.vot; do
        "$programs/rextract" tile.fits -RESTORE_TYPE NONE -CATALOG_TYPE NONE -REFERENCE_NAME "$reference" -QA_NAME "qa_$(basename "$reference")" \
            -MAG_ZEROPOINT 25 -VERBOSE_TYPE QUIET
    done >log 2>&1
    /usr/bin/python3 - >>log 2>&1 <<'END'
import json

plain = json.load(open("qa_sim_truth.fits/summary.json"))["runs"][0]
assert plain["matched"] > 100
for name in "gaia.csv", "gaia.fits", "gaia.vot", "ps1.csv", "sdss.fits", "des.vot":
    d = json.load(open("qa_%s/summary.json" % name))
    run = d["runs"][0]
    assert run["matched"] == plain["matched"], (name, run["matched"], plain["matched"])
    for key in "bias_mag", "dx", "dy", "scatter_x":
        assert abs(run[key]["value"] - plain[key]["value"]) < 3e-4, (name, key, run[key]["value"] - plain[key]["value"])
    assert ("moved to 2024.002" in d["reference"]) == name.startswith("gaia"), d["reference"]
END
    result 'references of surveys in CSV, FITS and VOTable are the truth, moved to the epoch of the tile' $? log
else
    skip 'references of surveys' 'python3-astropy is not installed'
fi
finish
