#!/bin/sh
# The same files and tiles to the real source-extractor and to rextract -RESTORE_TYPE NONE: validation/sextractor says
# what must agree and how closely.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/../..}" && pwd)
if [ -z "${RX_SHARED_DATA:-}" ] || [ ! -d "${RX_SHARED_DATA:-}" ]; then
    echo "skipped: RX_SHARED_DATA names no folder of real tiles"
    exit 77
fi
for need in source-extractor /usr/bin/python3 bunzip2; do
    command -v "$need" >/dev/null || { echo "skipped: $need is not installed"; exit 77; }
done
/usr/bin/python3 -c 'import astropy, scipy' 2>/dev/null || { echo "skipped: python3-astropy or python3-scipy is missing"; exit 77; }
sh "$top/validation/sextractor/compare.sh" "$RX_SHARED_DATA"
