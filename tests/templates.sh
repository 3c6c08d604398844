#!/bin/sh
# Template fluxes of blended stars against the same least-squares problem put together and solved by NumPy and SciPy:
# a PSF integrated by itself, all sources of the tile in one matrix, at the positions that the catalogue gives. Then crowds of stars
# and of stars and galaxies, which headers tell apart.
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
need rextract rextract-simulate
program=$programs/rextract
python=
for candidate in python3 /usr/bin/python3; do
    "$candidate" -c 'import astropy.io.fits, numpy, scipy.optimize' 2>/dev/null && python=$candidate && break
done
[ -n "$python" ] || {
    skip "$script" 'python3 with astropy and scipy is not installed'
    finish
}
enter

cat >fit.py <<'END'
import sys

import numpy as np
from astropy.io import fits
from scipy.optimize import lsq_linear

FWHM, BETA, SIDE, NOISE, SKY = 3.6, 4.765, 120, 5.0, 200.0
STARS = [(30.3, 31.2, 2e4), (34.6, 33.0, 9e3), (29.1, 36.5, 5e3), (84.7, 30.4, 4e3), (88.5, 32.2, 1.2e4),
         (60.2, 90.6, 8e3), (64.9, 91.3, 6e3), (67.6, 95.2, 1.5e4), (24.5, 88.1, 3e3)]
ALPHA = FWHM / 2 / np.sqrt(2 ** (1 / BETA) - 1)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(7)


def star(x, y):
    """A star of flux 1 integrated over every pixel by Gauss-Legendre quadrature."""
    j, i = np.mgrid[0:SIDE, 0:SIDE].astype(float)
    total = np.zeros((SIDE, SIDE))
    for u, a in zip(NODES, WEIGHTS):
        for v, b in zip(NODES, WEIGHTS):
            r2 = (i + u / 2 - x) ** 2 + (j + v / 2 - y) ** 2
            total += a * b / 4 * (1 + r2 / ALPHA ** 2) ** -BETA
    return total * (BETA - 1) / np.pi / ALPHA ** 2


def make():
    rng = np.random.Generator(np.random.PCG64(5))
    image = SKY + NOISE * rng.standard_normal((SIDE, SIDE))
    for x, y, flux in STARS:
        image += flux * star(x, y)
    fits.writeto("tile.fits", image.astype(np.float32))


def check():
    """The fluxes of SciPy within 1e-3 and a twentieth of the error, NumPy's errors within 3 %."""
    table = np.atleast_2d(np.loadtxt("out.cat"))
    x, y, flux, error, group = (table[:, k] for k in range(5))
    assert len(x) == len(STARS), len(x)
    data = fits.getdata("tile.fits") - fits.getdata("level.fits")
    weight = 1 / fits.getdata("rms.fits").astype(float)
    j, i = np.mgrid[0:SIDE, 0:SIDE]
    step, width = 0.01, 0.25 + 0.1 * FWHM
    fluxes, slopes, backgrounds, priors = [], [], [], []
    for k in range(len(x)):
        fluxes.append(star(x[k] - 1, y[k] - 1))
    for g in np.unique(group):
        members = np.flatnonzero(group == g)
        near = np.zeros((SIDE, SIDE))
        for k in members:
            near[np.hypot(i - x[k] + 1, j - y[k] + 1) < 2.5 * FWHM] = 1
            if len(members) > 1:
                for dx, dy in ((step, 0), (0, step)):
                    slope = star(x[k] - 1 + dx, y[k] - 1 + dy) - star(x[k] - 1 - dx, y[k] - 1 - dy)
                    slopes.append(flux[k] * slope / (2 * step))
        backgrounds.append(near)
        priors.append(np.mean(weight) / 0.02)

    def solve(columns, precision):
        a = np.array([(c * weight).ravel() for c in columns]).T
        a = np.vstack([a, np.diag(precision)[np.array(precision) > 0]])
        b = np.concatenate([(data * weight).ravel(), np.zeros(len(a) - data.size)])
        return a, lsq_linear(a, b, lsq_solver="exact").x

    n = len(x)
    _, found = solve(fluxes + backgrounds, [0] * n + priors)
    a, _ = solve(fluxes + slopes + backgrounds, [0] * n + [1 / width] * len(slopes) + priors)
    errors = np.sqrt(np.diag(np.linalg.inv(a.T @ a)))[:n]
    for k in range(n):
        print("%8.2f %8.2f  %10.2f %10.2f  %8.3f %8.3f" % (x[k], y[k], flux[k], found[k], error[k], errors[k]))
    assert (np.abs(found[:n] - flux) < 1e-3 * flux + 0.05 * error).all(), "fluxes"
    assert (np.abs(errors / error - 1) < 0.03).all(), "errors"
    assert max(np.bincount(group.astype(int))) == 3, "groups"
    truth = np.array([min(STARS, key=lambda s: np.hypot(s[0] - x[k] + 1, s[1] - y[k] + 1))[2] for k in range(n)])
    assert (np.abs(flux - truth) < 4 * error).all(), "truth"


make() if sys.argv[1] == "make" else check()
END
"$python" fit.py make || exit 2
printf 'XTEMPLATE_IMAGE\nYTEMPLATE_IMAGE\nFLUX_TEMPLATE\nFLUXERR_TEMPLATE\nGROUP_TEMPLATE\n' >my.param
for kind in NONE RL; do
    rm -f out.cat level.fits rms.fits
    "$program" tile.fits -RESTORE_TYPE $kind -PSF_TYPE MOFFAT -PSF_FWHM 3.6 -PSF_BETA 4.765 -GAIN 0 -GAIN_KEY NONE \
        -PARAMETERS_NAME my.param -CATALOG_TYPE ASCII -CATALOG_NAME out.cat -TEMPLATE_TYPE POINT -TEMPLATE_BACKSIZE 0 \
        -TEMPLATE_PSFERR 0 -CHECKIMAGE_TYPE BACKGROUND,BACKGROUND_RMS -CHECKIMAGE_NAME level.fits,rms.fits \
        -VERBOSE_TYPE QUIET >log 2>&1 && "$python" fit.py check >>log 2>&1
    result "fluxes of $kind are those of SciPy" $? log
done

cat >crowd.py <<'END'
import sys

import numpy as np
from astropy.io import fits

low, high, least = map(float, sys.argv[1:])
truth, rows, header = fits.getdata("truth.fits", 1), fits.getdata("crowd.cat", 1), fits.getheader("crowd.cat", 1)
print("RXCROWD", header["RXCROWD"], "RXCROWDG", header["RXCROWDG"])
assert header["RXCROWD"] > 0.5 and low <= header["RXCROWDG"] <= high
bright = truth[(truth["TYPE"] == "GALAXY") & (truth["FLUX"] > 10)]
distance = np.hypot(rows["X_IMAGE"][None] - bright["X_IMAGE"][:, None], rows["Y_IMAGE"][None] - bright["Y_IMAGE"][:, None])
extended = rows["CLASS_TEMPLATE"][distance.argmin(1)][distance.min(1) < 1.5] < 0.5
print(len(extended), "galaxies, extended", extended.mean() if len(extended) else 1)
assert not len(extended) or extended.mean() > least
END
printf 'X_IMAGE\nY_IMAGE\nFLUX_TEMPLATE\nCLASS_TEMPLATE\n' >crowd.param
# crowd STARS GALAXIES LOW HIGH LEAST: RXCROWDG from LOW to HIGH, and more than LEAST of the bright galaxies are extended
crowd() {
    "$programs/rextract-simulate" -IMAGE_SIZE 320 -SEED 5 -PSF_FWHM 4 -STAR_COUNT "$1" -GALAXY_COUNT "$2" -STAR_MAG 16,21 \
        -GALAXY_MAG 16,21 -STAR_SLOPE 0.2 -GALAXY_SLOPE 0.2 -MAG_ZEROPOINT 22.5 -SKY_LEVEL 0.87 -NOISE_TYPE CCD -GAIN 987 -READ_NOISE 9 \
        -IMAGE_NAME crowd.fits -TRUTH_NAME truth.fits -VERBOSE_TYPE QUIET >log 2>&1 && "$program" crowd.fits -RESTORE_TYPE NONE \
        -PSF_TYPE MOFFAT -PSF_FWHM 4 -PARAMETERS_NAME crowd.param -CATALOG_TYPE FITS_1.0 -HEADER_FACTS ALL -CATALOG_NAME crowd.cat -VERBOSE_TYPE QUIET \
        >>log 2>&1 && "$python" crowd.py "$3" "$4" "$5" >>log 2>&1
    result "a crowd of $1 stars and $2 galaxies per Mpixel" $? log
    rm -f crowd.cat crowd.fits truth.fits
}
crowd 1400 0 0 0.1 0
crowd 700 700 0.5 1 0.6
finish
