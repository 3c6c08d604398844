#!/bin/bash
# The validation campaigns, one command each:
#
#   validation/run.sh restoration|photometry|sdss [small|paper] [FOLDER [-KEYWORD VALUE ...]]
#
# Journal and report go into FOLDER (default: <campaign>-out), the report as FOLDER/<campaign>/report.html. Started
# again after an interruption it goes on where it was. `sdss` injects into a real frame and needs the data folder:
# RX_SHARED_DATA, or ../shared/data beside the sources, and bunzip2.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
top=$(cd "$here/.." && pwd)
program=${RX_VALIDATE:-$top/build/rextract-validate}
usage() {
    echo "run.sh: $1; usage: run.sh restoration|photometry|sdss [small|paper] [FOLDER [-KEYWORD VALUE ...]]" >&2
    exit 2
}
case ${1:-} in
restoration | photometry) name=$1 ;;
sdss) name=photometry-sdss ;;
*) usage "which campaign?" ;;
esac
case ${2:-small} in
small) size=SMALL ;;
paper) size=PAPER ;;
*) usage "$2 is no size" ;;
esac
out=${3:-$1-out}
[[ -x $program ]] || { echo "run.sh: $program is missing; build first (./quickstart)" >&2; exit 2; }
program=$(cd "$(dirname "$program")" && pwd)/$(basename "$program")
mkdir -p "$out"
# everything is named from inside the folder, so that the report holds no path of this machine
cp "$here/$name.conf" "$out"
if [[ $1 == sdss ]]; then
    frame=${RX_SHARED_DATA:-$top/../shared/data}/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2
    [[ -f $frame ]] || { echo "run.sh: $frame is missing; the SDSS frame is not part of this repository" >&2; exit 2; }
    [[ -f $out/frame.fits ]] || { bunzip2 -c "$frame" >"$out/frame.part" && mv "$out/frame.part" "$out/frame.fits"; }
fi
cd "$out"
exec "$program" -c "$name.conf" -SIZE "$size" "${@:4}"
