#!/bin/bash
# The self check on every real tile: the table "Every real tile" of README.md, on standard output.
#
#   validation/selfcheck/tiles.sh [FOLDER]      catalogues into FOLDER (default: selfcheck-tiles-out)
#
# Needs the data folder (RX_SHARED_DATA, or ../shared/data beside the sources), python3-astropy, bunzip2.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_PROGRAM:-$top/build/rextract}
data=$(cd "${RX_SHARED_DATA:-$top/../shared/data}" && pwd)
out=${1:-selfcheck-tiles-out}
[[ -x $program ]] || { echo "tiles.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
python=
for candidate in python3 /usr/bin/python3; do # the first one that has astropy
    if "$candidate" -c 'import astropy' 2>/dev/null; then python=$candidate && break; fi
done
[[ -n $python ]] || { echo "tiles.sh: no python3 with astropy; install python3-astropy" >&2; exit 2; }
mkdir -p "$out"
cd "$out"
bunzip2 -kc "$data/sdss/reprojected_sdss_r.fits.bz2" >reprojected_sdss_r.fits
decam=$data/decam/c4d_171113_060340
echo '| tile | run | 50 % | of new ones injected | wide, mag | scale, mag | false detections per Mpixel |'
echo '| --- | --- | --- | --- | --- | --- | --- |'

# tile TITLE IMAGE OPTION...
tile() {
    local title=$1 image=$2
    shift 2
    "$program" "$image" -RESTORE_TYPE NONE,RL -CATALOG_NAME tile.cat -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -VERBOSE_TYPE QUIET \
        -SELF_CHECK Y -SELF_CHECK_GALAXIES 0 -SELF_CHECK_COUNT 200 -BLANK_CHECK 2 "$@"
    "$python" - "$title" <<'END'
import sys
from astropy.io import fits
for run in ("NONE", "RL"):
    header = fits.getheader(f"tile_{run}.cat", 1)
    def told(key, form):
        if key not in header:
            return "not known"
        ends = [form % header[key + end] if key + end in header else "" for end in "LH"]
        return (form % header[key]) + " (" + "..".join(ends) + ")"
    cells = [sys.argv[1], run, told("RXSC50", "%.2f"), told("RXSCNEW", "%.3f"), told("RXSCWID", "%.4f"),
             told("RXSCAP", "%.4f"), told("RXBLKR", "%.3g")]
    print("| " + " | ".join(cells) + " |")
END
}

tile sextractor/galaxies "$data/sextractor/galaxies.fits"
tile fields/M6707HH "$data/fields/M6707HH.fits"
tile fields/aligned_eso085-030-004 "$data/fields/aligned_eso085-030-004.fit"
tile fields/spitzer_example_image "$data/fields/spitzer_example_image.fits"
tile 'fields/sep_image (PSF_FWHM 2)' "$data/fields/sep_image.fits" -PSF_TYPE MOFFAT -PSF_FWHM 2
tile 'fields/M13_blue_0001 (PSF_FWHM 3)' "$data/fields/M13_blue_0001.fits" -PSF_TYPE MOFFAT -PSF_FWHM 3
tile sdss/reprojected_sdss_r reprojected_sdss_r.fits
tile 'decam/c4d_171113 r (weights)' "${decam}_ooi_r_ls9.N6.fits" -WEIGHT_TYPE MAP_WEIGHT \
    -WEIGHT_IMAGE "${decam}_oow_r_ls9.N6.fits"
