#!/usr/bin/env python3
"""stamps.py COSMOS OUT: a folder of GalSim's RealGalaxy layout (catalogue, images, PSFs), shared out into OUT/train and
OUT/test: of three galaxies that follow each other in the catalogue the first is kept for tests. Both are folders for
SIM.TEMPLATE_NAME and TEMPLATE_NAME."""
import os
import shutil
import sys

from astropy.io import fits

source, out = sys.argv[1:]
tables = []
for name in sorted(os.listdir(source)):
    with fits.open(os.path.join(source, name)) as file:
        for hdu in file[1:]:
            if isinstance(hdu, fits.BinTableHDU) and {"GAL_FILENAME", "GAL_HDU"} <= set(hdu.columns.names):
                tables.append((name, hdu.copy()))
if not tables:
    sys.exit(f"stamps.py: {source}: no table with GAL_FILENAME and GAL_HDU")
catalogue, table = max(tables, key=lambda t: len(t[1].columns.names))
for kind, keep in (("train", lambda i: i % 3 != 0), ("test", lambda i: i % 3 == 0)):
    folder = os.path.join(out, kind)
    os.makedirs(folder, exist_ok=True)
    rows = [i for i in range(len(table.data)) if keep(i)]
    fits.BinTableHDU(table.data[rows]).writeto(os.path.join(folder, catalogue), overwrite=True)
    columns = [c for c in ("GAL_FILENAME", "PSF_FILENAME") if c in table.columns.names]
    for name in sorted({str(row).strip() for c in columns for row in table.data[c]}):
        shutil.copy(os.path.join(source, name), folder)
    print(f"{folder}: {len(rows)} galaxies")
