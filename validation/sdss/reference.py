#!/usr/bin/env python3
"""The SDSS Stripe 82 coadd catalogue as a reference for one frame: RA, DEC, MAG (r).

Stars (probpsf > 0.5) have their PSF magnitude, galaxies the flux-weighted mixture of the de Vaucouleurs and the
exponential model (SDSS's cmodel). Sources saturated in the coadd get no magnitude (NaN): they count neither as
found nor as missed. Also prints the frame's gain in electrons per nanomaggy, from its calibration
vector (HDU 1: nanomaggies per count) and the camera's gain in electrons per count.

usage: reference.py COADD.fit FRAME.fits CAMERA_GAIN OUT.fits
"""
import sys

import numpy as np
from astropy.io import fits

coadd, frame, camera_gain, out = sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4]
rows = fits.getdata(coadd, 1)
model = -2.5 * np.log10(rows["fracdev_r"] * 10 ** (-0.4 * rows["devmag_r"].astype(float))
                        + (1 - rows["fracdev_r"]) * 10 ** (-0.4 * rows["expmag_r"].astype(float)))
mag = np.where(rows["probpsf"] > 0.5, rows["psfmag_r"], model)
mag = np.where(rows["is_saturated"] == 0, mag, np.nan)
columns = [fits.Column("RA", "D", "deg", array=rows["ra"]), fits.Column("DEC", "D", "deg", array=rows["dec"]),
           fits.Column("MAG", "D", "mag", array=mag)]
fits.BinTableHDU.from_columns(columns).writeto(out, overwrite=True)
print("%.4f" % (camera_gain / np.median(fits.getdata(frame, 1))))
