#!/bin/bash
# Does the self check tell the truth? SDSS frame r-000094-1-0012 (Stripe 82): completeness found by injecting objects
# into the frame, against completeness from the deep coadd catalogue of the same sky, per magnitude r 18 to 22.
# Stars are compared with injected stars, galaxies with injected galaxies, and all with the two mixed as the
# catalogue has them; the last needs no star/galaxy separation.
#
#   validation/selfcheck/run.sh [FOLDER]      reports and comparison.md into FOLDER (default: selfcheck-out)
#
# COUNT: objects injected of each kind (default 4000).
# Needs the data folder (RX_SHARED_DATA, or ../shared/data beside the sources), python3-astropy, bunzip2.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/../.." && pwd)
program=${RX_PROGRAM:-$top/build/rextract}
data=${RX_SHARED_DATA:-$top/../shared/data}/sdss/94-1-12
out=${1:-selfcheck-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
[[ -d $data ]] || { echo "run.sh: $data is missing; the SDSS frame is not part of this repository" >&2; exit 2; }
python=
for candidate in python3 /usr/bin/python3; do # the first one that has astropy
    if "$candidate" -c 'import astropy, numpy' 2>/dev/null; then python=$candidate && break; fi
done
[[ -n $python ]] || { echo "run.sh: no python3 with astropy; install python3-astropy" >&2; exit 2; }
mkdir -p "$out"
cd "$out"
bunzip2 -kc "$data/frame-r-000094-1-0012.fits.bz2" >frame.fits
gain=$("$python" "$here/../sdss/reference.py" "$data/stripe82_coadd_catalog.fit" frame.fits 4.71 reference.fits)

# the camera saturates far above what this frame holds; SATUR_LEVEL is in nanomaggies here
common=(-GAIN "$gain" -MAG_ZEROPOINT 22.5 -SATUR_LEVEL 1e9 -RESTORE_TYPE "NONE,RL" -PSF_TYPE AUTO
    -MATCH_RADIUS 1 -MATCH_UNIT ARCSEC -CATALOG_TYPE FITS_LDAC -SELF_CHECK Y -SELF_CHECK_COUNT "${COUNT:-4000}"
    -SELF_CHECK_MAG "17.5,22.5")
"$program" 'frame.fits[0]' "${common[@]}" -REFERENCE_NAME reference.fits -QA_NAME qa \
    -CATALOG_NAME stars.cat -SELF_CHECK_GALAXIES 0 -SELF_CHECK_NAME stars
"$program" 'frame.fits[0]' "${common[@]}" -CATALOG_NAME galaxies.cat -SELF_CHECK_GALAXIES 1 -SELF_CHECK_NAME galaxies
"$python" "$here/compare.py" "$data/stripe82_coadd_catalog.fit" . >comparison.md
cat comparison.md
