#!/bin/sh
# What other programs make of our files: regions of DS9 beside the same columns as text, units and tables in astropy and
# STILTS. What is not installed is skipped.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
need rextract
tile=$top/tests/data/sim.fits.fz
enter
run() { "$programs/rextract" "$tile" -RESTORE_TYPE NONE -VERBOSE_TYPE QUIET "$@"; }

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
"$programs/rextract" -REPLAY sky.reg >log 2>&1
result 'a region file can be replayed' $? log

# --- tables ---

"$programs/rextract" -dp | sed 's/^#//' | grep -Ev 'ASSOC|IMAFLAGS|INJECTED|VIGNET|CLASS_STAR' >all.param
for type in FITS_1.0 FITS_LDAC ASCII_VOTABLE; do
    run -PARAMETERS_NAME all.param -CATALOG_TYPE $type -CATALOG_NAME $type.cat
done
if /usr/bin/python3 -c 'import astropy' 2>/dev/null; then
    /usr/bin/python3 -W error::UserWarning >log 2>&1 <<'END'
import warnings
import astropy.units as u
from astropy.io import fits
from astropy.table import Table

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
assert len(a) == len(b) == len(c) > 100
END
    result 'astropy reads all tables without a warning, their units too' $? log
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
finish
