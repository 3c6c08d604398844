#!/usr/bin/env python3
"""Makes sim.fits.fz and sim_truth.fits, the simulated tile of the quickstart and of the tests.

    python3 make_sim.py [folder]          needs numpy and astropy; never run by the build or the tests

Recipe (every number that is not drawn stands in the block of constants below):

scene     512 x 512 pixels of 0.4 arcsec, TAN, turned by 3 degrees. 170 stars and 80 galaxies at uniform
          positions, at least 5 pixels from each other, centres up to the border. Magnitudes follow
          dN/dm ~ 10^(0.25 m), stars 13 to 18.75, galaxies 15 to 18.75; three more stars of 10.6 to 11.2
          saturate. MAG = 25 - 2.5 log10(FLUX), FLUX the total flux in ADU over the infinite plane.
galaxies  Sersic profiles of index 1 (two of three) or 2.5, half-light radius 10^(0.2 + 0.13 (18.75 - m))
          pixels with a scatter of 0.1 dex (at most 8), axis ratio 0.35 to 1, any angle; b_n after Ciotti
          & Bertin (1999, A&A 352, 447).
PSF       Moffat, FWHM 4 pixels, beta 4.765, round: I(r) = (beta - 1)/(pi a^2) (1 + r^2/a^2)^-beta with
          a = FWHM/(2 sqrt(2^(1/beta) - 1)). Integrated over the pixel: the mean of 7 x 7 samples in it.
          Galaxies are sampled on the same fine grid, convolved there with the PSF, then averaged; their
          flux is normalised on the stamp.
noise     sky 150 ADU, gain 2 e-/ADU, read noise 5 e-: Poisson of (sky + objects) * gain plus a Gaussian,
          divided by the gain: 9.0 ADU on the sky. Values above SATURATE (12000 ADU) are cut there.
pixels    rounded to 16-bit integers (step 1 ADU = 0.11 sky sigma: adds 0.05 % to the noise), lossless RICE.
          Bad: half a column, a block of 3 x 3 and 15 single pixels hold BLANK (-32768).
truth     X_IMAGE, Y_IMAGE (FITS counting), ALPHA_J2000, DELTA_J2000, MAG, FLUX, TYPE (STAR, GALAXY), and for
          galaxies FLUX_RADIUS (intrinsic half-light, pixels), SERSIC, AXIS_RATIO, THETA (degrees).

The random numbers are numpy's PCG64 with the seed below.
"""
import os
import sys

import numpy as np
from astropy.io import fits
from astropy.table import Table
from astropy.wcs import WCS

SEED = 20240311
SIZE = 512
ZEROPOINT = 25.0
SKY, GAIN, READ_NOISE, SATURATE, BLANK = 150.0, 2.0, 5.0, 12000.0, -32768
FWHM, BETA = 4.0, 4.765
FINE = 7
STARS, GALAXIES, NEAREST = 170, 80, 5.0


def moffat(x, y):
    """Moffat of unit total flux, per square pixel."""
    a = FWHM / (2 * np.sqrt(2 ** (1 / BETA) - 1))
    return (BETA - 1) / (np.pi * a * a) * (1 + (x * x + y * y) / (a * a)) ** -BETA


def fine_grid(x, y, half):
    """Fine sample positions around the pixel of (x, y), relative to (x, y), and the stamp's first pixel."""
    x0, y0 = int(round(x)) - half, int(round(y)) - half
    steps = (np.arange((2 * half + 1) * FINE) + 0.5) / FINE - 0.5
    return steps + x0 - x, steps + y0 - y, x0, y0


def pixels_of(fine):
    n = fine.shape[0] // FINE
    return fine.reshape(n, FINE, n, FINE).mean(axis=(1, 3))


def star(x, y, half):
    dx, dy, x0, y0 = fine_grid(x, y, half)
    return pixels_of(moffat(dx[None, :], dy[:, None])), x0, y0


def galaxy(x, y, half, radius, n, ratio, theta):
    dx, dy, x0, y0 = fine_grid(x, y, half)
    b = 2 * n - 1 / 3 + 4 / (405 * n) + 46 / (25515 * n * n)
    along = dx[None, :] * np.cos(theta) + dy[:, None] * np.sin(theta)
    across = dy[:, None] * np.cos(theta) - dx[None, :] * np.sin(theta)
    r = np.sqrt((along**2 * ratio + across**2 / ratio) + (0.3 / FINE) ** 2)
    profile = np.exp(-b * (r / radius) ** (1 / n))
    middle = (np.arange(2 * profile.shape[0]) - profile.shape[0]) / FINE
    psf = np.fft.ifftshift(moffat(middle[None, :], middle[:, None]))
    shape = psf.shape
    blurred = np.fft.irfft2(np.fft.rfft2(profile, shape) * np.fft.rfft2(psf), shape)
    stamp = pixels_of(blurred[: profile.shape[0], : profile.shape[1]])
    return stamp / stamp.sum(), x0, y0


def add(image, stamp, x0, y0, flux):
    n = stamp.shape[0]
    ya, yb, xa, xb = max(y0, 0), min(y0 + n, SIZE), max(x0, 0), min(x0 + n, SIZE)
    if ya < yb and xa < xb:
        image[ya:yb, xa:xb] += flux * stamp[ya - y0 : yb - y0, xa - x0 : xb - x0]


def magnitudes(rng, n, low, high, slope=0.25):
    u = rng.random(n)
    return np.log10(10 ** (slope * low) + u * (10 ** (slope * high) - 10 ** (slope * low))) / slope


def positions(rng, n):
    chosen = []
    while len(chosen) < n:
        p = rng.uniform(-0.5, SIZE - 0.5, 2)
        if all(np.hypot(*(p - q)) >= NEAREST for q in chosen):
            chosen.append(p)
    return np.array(chosen)


def header_of(wcs):
    header = wcs.to_header()
    del header["MJDREF"]
    header["OBJECT"] = ("simulated tile", "see tests/data/make_sim.py")
    header["FILTER"] = "r"
    header["BUNIT"] = "adu"
    header["EXPTIME"] = (60.0, "s")
    header["GAIN"] = (GAIN, "e-/ADU")
    header["RDNOISE"] = (READ_NOISE, "e-")
    header["SATURATE"] = (SATURATE, "ADU")
    header["MAGZERO"] = (ZEROPOINT, "mag of 1 ADU in the whole exposure")
    header["PSFFWHM"] = (FWHM, "pixels, Moffat")
    header["PSFBETA"] = (BETA, "Moffat exponent")
    return header


def main(folder):
    rng = np.random.Generator(np.random.PCG64(SEED))
    wcs = WCS(naxis=2)
    scale, turn = 0.4 / 3600, np.radians(3)
    wcs.wcs.ctype = "RA---TAN", "DEC--TAN"
    wcs.wcs.crval, wcs.wcs.crpix = (150.1, 2.2), (256.5, 256.5)
    wcs.wcs.cd = scale * np.array([[-np.cos(turn), np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    wcs.wcs.radesys = "ICRS"

    mag = np.concatenate([[10.6, 10.9, 11.2], magnitudes(rng, STARS - 3, 13.0, 18.75),
                          magnitudes(rng, GALAXIES, 15.0, 18.75)])
    flux = 10 ** (0.4 * (ZEROPOINT - mag))
    xy = positions(rng, mag.size)
    kind = np.array(["STAR"] * STARS + ["GALAXY"] * GALAXIES)
    radius, sersic, ratio, theta = np.zeros((4, mag.size))
    image = np.zeros((SIZE, SIZE))
    for i in range(mag.size):
        if kind[i] == "STAR":
            stamp, x0, y0 = star(*xy[i], 90 if mag[i] < 13 else 45)
        else:
            sersic[i] = rng.choice([1.0, 1.0, 2.5])
            radius[i] = min(10 ** (0.2 + 0.13 * (18.75 - mag[i]) + 0.1 * rng.standard_normal()), 8.0)
            ratio[i], theta[i] = rng.uniform(0.35, 1.0), rng.uniform(-np.pi / 2, np.pi / 2)
            stamp, x0, y0 = galaxy(*xy[i], 60, radius[i], sersic[i], ratio[i], theta[i])
        add(image, stamp, x0, y0, flux[i])

    electrons = rng.poisson((image + SKY) * GAIN) + READ_NOISE * rng.standard_normal(image.shape)
    data = np.rint(np.minimum(electrons / GAIN, SATURATE)).astype(np.int16)
    data[200:456, 333] = BLANK
    data[97:100, 141:144] = BLANK
    for x, y in rng.integers(0, SIZE, (15, 2)):
        data[y, x] = BLANK

    header = header_of(wcs)
    header["BLANK"] = (BLANK, "no data")
    tile = fits.CompImageHDU(data, header, name="TILE", compression_type="RICE_1")
    fits.HDUList([fits.PrimaryHDU(), tile]).writeto(os.path.join(folder, "sim.fits.fz"), overwrite=True,
                                                    checksum=False)

    order = np.argsort(mag, kind="stable")
    sky = wcs.all_pix2world(xy, 0)
    truth = Table({"X_IMAGE": xy[:, 0] + 1, "Y_IMAGE": xy[:, 1] + 1, "ALPHA_J2000": sky[:, 0],
                   "DELTA_J2000": sky[:, 1], "MAG": mag, "FLUX": flux, "TYPE": kind,
                   "FLUX_RADIUS": radius.astype("f4"), "SERSIC": sersic.astype("f4"),
                   "AXIS_RATIO": ratio.astype("f4"), "THETA": np.degrees(theta).astype("f4")})[order]
    for name, unit in {"X_IMAGE": "pixel", "Y_IMAGE": "pixel", "ALPHA_J2000": "deg", "DELTA_J2000": "deg",
                       "MAG": "mag", "FLUX": "adu", "FLUX_RADIUS": "pixel", "THETA": "deg"}.items():
        truth[name].unit = unit
    table = fits.table_to_hdu(truth)
    table.name = "TRUTH"
    fits.HDUList([fits.PrimaryHDU(), table]).writeto(os.path.join(folder, "sim_truth.fits"), overwrite=True)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else os.path.dirname(os.path.abspath(__file__)))
