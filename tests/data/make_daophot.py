"""Twelve stars whose PSF varies over 400 x 400 pixels: stars.fits and stars.coo for make_daophot.cl."""
import numpy as np
from astropy.io import fits

rng = np.random.default_rng(7)
y, x = np.mgrid[:400, :400]
image = rng.normal(100, 1, x.shape)
with open("stars.coo", "w") as coo:
    for k in range(12):
        sx, sy = 50 + 100 * (k % 4) + rng.uniform(-0.5, 0.5), 60 + 140 * (k // 4) + rng.uniform(-0.5, 0.5)
        fwhm = 3 + 0.8 * sx / 400 + 0.4 * (sy / 400) ** 2
        alpha = fwhm / 2 / np.sqrt(2 ** (1 / 3) - 1)
        r2 = (x - sx) ** 2 + ((y - sy) * (1 + 0.15 * sx / 400)) ** 2
        image += 3000 * (1 + k % 3) * (1 + r2 / alpha**2) ** -3
        coo.write(f"{sx + 1:.3f} {sy + 1:.3f}\n")
fits.writeto("stars.fits", image.astype("f4"), overwrite=True)
