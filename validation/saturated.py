#!/usr/bin/python3
"""How saturated stars come through a restorer, against RESTORE_TYPE NONE on the same tile.

    saturated.py TILE[.fits][.fz] SATURATION FOLDER RESTORER...

FOLDER holds what one run of rextract wrote with RESTORE_TYPE NONE,RESTORER,..., CATALOG_TYPE FITS_1.0,
CATALOG_NAME c.cat, CHECKIMAGE_TYPE SEGMENTATION, CHECKIMAGE_NAME s.fits, and with the columns NUMBER, X_IMAGE,
Y_IMAGE, FLAGS, MAG_AUTO, MAG_TEMPLATE and MAGERR_TEMPLATE. A saturated star is a source of NONE whose segment holds a saturated
pixel. For each restorer, one line a star that differs: sources inside the star's segment, inside the ring of
RING pixels around it (of NONE and of the restorer), the FLAGS of the one that is nearest to NONE's position,
and how much fainter that is. Exit status 1 where a star is not one source with FLAGS 4 within LIMITS, the template also
within its error.
"""
import sys

import numpy as np
from astropy.io import fits
from scipy.ndimage import binary_dilation

RING = 6
LIMITS = {"MAG_AUTO": 0.01, "MAG_TEMPLATE": 0.03}  # the other sources move a template by one or two hundredths


def image(name):
    with fits.open(name) as hdus:
        return next(hdu.data for hdu in hdus if hdu.data is not None and hdu.data.ndim == 2)


def catalogue(folder, restorer):
    with fits.open(f"{folder}/c_{restorer}.cat") as hdus:
        return hdus[1].data


def inside(table, footprint):
    x, y = (np.rint(table[c]).astype(int) - 1 for c in ("X_IMAGE", "Y_IMAGE"))
    height, width = footprint.shape
    return footprint[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]


def main(tile, saturation, folder, *restorers):
    pixels, segments = image(tile), image(f"{folder}/s_NONE.fits")
    none = catalogue(folder, "NONE")
    stars = [s for s in np.unique(segments[pixels >= float(saturation)]) if s > 0]
    wrong = 0
    for restorer in restorers:
        found, pieces, unflagged, off, extra = catalogue(folder, restorer), 0, 0, 0, 0
        for star in stars:
            row = none[none["NUMBER"] == star][0]
            footprint = segments == star
            ring = binary_dilation(footprint, iterations=RING) & ~footprint
            mine = found[inside(found, footprint)]
            rings = inside(none, ring).sum(), inside(found, ring).sum()
            distance = np.hypot(found["X_IMAGE"] - row["X_IMAGE"], found["Y_IMAGE"] - row["Y_IMAGE"])
            nearest = found[np.argmin(distance)]
            lost = [float(nearest[c]) - float(row[c]) for c in LIMITS]
            limits = LIMITS["MAG_AUTO"], max(LIMITS["MAG_TEMPLATE"], float(row["MAGERR_TEMPLATE"]))
            bad = (len(mine) != 1, not nearest["FLAGS"] & 4, any(abs(a) > limit for a, limit in zip(lost, limits)))
            pieces, unflagged, off = pieces + bad[0], unflagged + bad[1], off + bad[2]
            extra += max(0, int(rings[1]) - int(rings[0]))
            if any(bad) or rings[0] != rings[1]:
                print(f"{restorer} star {star} at {row['X_IMAGE']:.0f},{row['Y_IMAGE']:.0f} of"
                      f" {row['MAG_AUTO']:.2f} mag: {len(mine)} inside, {rings[0]}->{rings[1]} around,"
                      f" FLAGS {row['FLAGS']}->{nearest['FLAGS']}, fainter by {lost[0]:+.3f} (AUTO),"
                      f" {lost[1]:+.3f} (template) mag")
        print(f"{restorer}: {len(stars)} saturated stars, not one source {pieces}, without FLAGS 4 {unflagged},"
              f" too far off {off}, more sources around them {extra}")
        wrong += pieces + unflagged + off
    return wrong > 0


if __name__ == "__main__":
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
