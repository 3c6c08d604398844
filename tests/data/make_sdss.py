#!/usr/bin/env python3
"""Makes sdss.fits.fz, the real tile of the tutorial, and sdss_deep.csv, deeper sources of the same sky (sdss.md).

    python3 make_sdss.py FOLDER [OUT]     needs numpy, scipy and astropy; never run by the build or the tests

FOLDER holds frame-r-000094-1-0012.fits.bz2 and stripe82_coadd_catalog.fit, as the repository named in sdss.md has them.

pixels     The frame is in nanomaggies, its sky taken off. Its HDU 1 (nanomaggies per count, column by column) and HDU 2 (the
           sky) lead back to the counts that the camera read: counts = frame / HDU 1 + sky, on the sky whole numbers to 0.05
           (the frame's floats have 10 bits, so that bright pixels are off by up to 0.1 %). 640 x 640 of them, a group of
           galaxies among stars, are kept as 16-bit integers, lossless RICE.
header     The world coordinates of the frame, moved; what else is useful of its cards and of HDU 3. GAIN is that of this
           CCD, MAGZERO that of the calibration: 22.5 - 2.5 log10(nanomaggies per count).
reference  RA, DEC (degrees) and MAG (r) of the coadd's sources inside the tile, as validation/sdss/reference.py has them: the
           PSF's magnitude of stars, of galaxies that of the two models by their shares. Those saturated in the coadd have none.
"""
import bz2
import io
import os
import sys

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS
from scipy.ndimage import map_coordinates

X, Y, SIZE = 890, 785, 640  # first pixel, from 0
GAIN = 4.71  # e-/count
KEPT = ("TELESCOP", "RUN", "CAMCOL", "FRAME", "RERUN", "FILTER", "EQUINOX", "CTYPE1", "CTYPE2", "CUNIT1", "CUNIT2",
        "CRVAL1", "CRVAL2", "CD1_1", "CD1_2", "CD2_1", "CD2_2")


def main(folder, out):
    with bz2.open(os.path.join(folder, "frame-r-000094-1-0012.fits.bz2")) as packed:
        frame, factor, sky, facts = (hdu.copy() for hdu in fits.open(io.BytesIO(packed.read())))
    sky = sky.data[0]
    rows, columns = np.meshgrid(sky["YINTERP"], sky["XINTERP"], indexing="ij")
    read = frame.data / factor.data + map_coordinates(sky["ALLSKY"], (rows, columns), order=1, mode="nearest")
    read = read[Y:Y + SIZE, X:X + SIZE]
    counts = np.rint(read)
    off = np.abs(read - counts)[counts < 200]
    assert off.max() < 0.05 and counts.max() < 32768, (off.max(), counts.max())

    header = fits.Header()
    header["OBJECT"] = ("SDSS frame-r-000094-1-0012, a cut", "see tests/data/sdss.md")
    for key in KEPT:
        header[key] = (frame.header[key], frame.header.comments[key])
    header["CRPIX1"] = frame.header["CRPIX1"] - X
    header["CRPIX2"] = frame.header["CRPIX2"] - Y
    header["RADESYS"] = "ICRS"
    header["MJD-OBS"] = (float(facts.data["MJD"][0]), "TAI")
    header["AIRMASS"] = float(facts.data["AIRMASS"][0])
    header["EXPTIME"] = (float(frame.header["EXPTIME"]), "s")
    header["BUNIT"] = "adu"
    header["GAIN"] = (GAIN, "e-/ADU")
    header["MAGZERO"] = (round(22.5 - 2.5 * np.log10(np.median(factor.data)), 4), "mag of 1 ADU in the whole exposure")
    tile = fits.CompImageHDU(counts.astype(np.int16), header, name="TILE", compression_type="RICE_1")
    fits.HDUList([fits.PrimaryHDU(), tile]).writeto(os.path.join(out, "sdss.fits.fz"), overwrite=True)

    deep = fits.getdata(os.path.join(folder, "stripe82_coadd_catalog.fit"), 1)
    share = deep["fracdev_r"].astype(float)
    model = -2.5 * np.log10(share * 10 ** (-0.4 * deep["devmag_r"]) + (1 - share) * 10 ** (-0.4 * deep["expmag_r"]))
    mag = np.where(deep["probpsf"] > 0.5, deep["psfmag_r"], model)
    x, y = WCS(header).all_world2pix(deep["ra"], deep["dec"], 0)
    inside = (np.minimum(x, y) > -0.5) & (np.maximum(x, y) < SIZE - 0.5) & (deep["is_saturated"] == 0)
    with open(os.path.join(out, "sdss_deep.csv"), "w", encoding="ascii") as file:
        file.write("RA,DEC,MAG\n")
        for i in np.flatnonzero(inside)[np.argsort(mag[inside], kind="stable")]:
            file.write(f"{deep['ra'][i]:.6f},{deep['dec'][i]:.6f},{mag[i]:.3f}\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else os.path.dirname(os.path.abspath(__file__)))
