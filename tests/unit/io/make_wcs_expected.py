#!/usr/bin/python3
"""Makes wcs_expected.inc: sky positions of real headers by astropy, for test_wcs.c.

usage: make_wcs_expected.py DATA_FOLDER > wcs_expected.inc

Columns: file, HDU, x, y (pixels from 0), longitude, latitude in the frame of the header,
right ascension and declination at J2000 (FK5 and ICRS held for the same), all in degrees.
"""
import sys
import warnings

import numpy as np
from astropy.coordinates import FK5, Galactic, SkyCoord
from astropy.io import fits
from astropy.wcs import WCS

FILES = [
    ("wcs/1904-66_ARC.fits", 0), ("wcs/1904-66_HPX.fits", 0), ("wcs/1904-66_STG.fits", 0),
    ("wcs/1904-66_TAN.fits", 0), ("wcs/1904-66_TSC.fits", 0), ("wcs/1904-66_ZEA.fits", 0),
    ("wcs/1904-66_ZPN.fits", 0), ("wcs/sipsample.fits", 0), ("wcs/tnx.fits", 0), ("wcs/tpv.fits.gz", 0),
    ("fields/M6707HH.fits", 0), ("fields/spitzer_example_image.fits", 0),
    ("sdss/94-1-12/frame-r-000094-1-0012.fits.bz2", 0), ("sdss/reprojected_sdss_r.fits.bz2", 0),
    ("decam/c4d_171113_060340_ooi_r_ls9.N6.fits", 1), ("psfex/decam-520206-S16-image-sub.fits", 1),
    ("odd/c4d_130105_065255_ooi_r_a1-N15.fits.fz", 1),
]

warnings.simplefilter("ignore")
print("/* made by make_wcs_expected.py; do not edit */")
for name, hdu in FILES:
    with fits.open(sys.argv[1] + "/" + name) as f:
        header = f[hdu].header
        wcs = WCS(header)
        nx, ny = header["NAXIS1"], header["NAXIS2"]
        for x, y in [((nx - 1) / 2, (ny - 1) / 2), (0.25 * nx, 0.375 * ny), (0.8125 * nx, 0.625 * ny)]:
            lon, lat = wcs.all_pix2world(x, y, 0)
            ra, dec = lon, lat
            if wcs.wcs.lngtyp == "GLON":
                c = SkyCoord(lon, lat, unit="deg", frame=Galactic).transform_to(FK5(equinox="J2000"))
                ra, dec = c.ra.deg, c.dec.deg
            if np.isfinite(lon):
                print('{"%s", %d, %.17g, %.17g, %.13f, %.13f, %.13f, %.13f},' % (name, hdu, x, y, lon, lat, ra, dec))
