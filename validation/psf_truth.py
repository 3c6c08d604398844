"""PSFs that are known exactly, tiles of stars made of them, and how a PSF is judged (psf.py).

A truth is a profile (unit flux, FWHM 1) and how FWHM and ellipse vary over the tile. Stars are integrated over each pixel
by Gauss-Legendre quadrature, at their exact place, out to where 2e-4 of their light is left or their light falls
below 0.002 sigma of the sky: nothing is sampled, interpolated or cut in a way that a program could share.

    MOFFAT b     Moffat 1969, A&A 3, 455
    HALO         0.9 of the light in a Gaussian of FWHM 1, 0.1 in an exponential halo of scale length 1.5 FWHM
    KOLMOGOROV   Fourier transform of exp(-3.44 (x / 0.976)^(5/3)), x cycles per FWHM (Fried 1966, JOSA 56, 1372)
    SPIKES       0.96 of the light in a Moffat of beta 3.5, 0.04 in a cross of diffraction spikes, 30 degrees off the axes,
                 which fall off exponentially with 3 FWHM and are 0.5 FWHM wide
"""
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import j0

SKY, GAIN, SATURATION, ZEROPOINT = 1000.0, 10.0, 60000.0, 25.0  # ADU, e-/ADU, ADU, mag of 1 ADU
SIGMA = np.sqrt(SKY / GAIN)
SPIKE_LENGTH, SPIKE_WIDTH, SPIKE_ANGLE = 3.0, 0.5 / 2.3548, np.radians(30)


@lru_cache
def kolmogorov_table():
    """Density at radii 0, 0.005, ... 20 FWHM; beyond, it falls as r^(-11/3)."""
    nu = np.arange(0, 3.0, 5e-4)
    otf = np.exp(-3.44 * (nu / 0.976)**(5 / 3)) * nu
    r = np.arange(0, 20.0025, 0.005)
    return r, np.array([2 * np.pi * np.trapz(otf * j0(2 * np.pi * nu * x), nu) for x in r])


def moffat(rho2, beta):
    alpha2 = 0.25 / (2**(1 / beta) - 1)
    return (beta - 1) / (np.pi * alpha2) * (1 + rho2 / alpha2)**-beta


def radial(kind, rho2):
    """Round part of the profile at the squared radius (FWHM^2), light per FWHM^2."""
    name, *beta = kind.split()
    if name == "MOFFAT":
        return moffat(rho2, float(beta[0]))
    if name == "HALO":
        c, h = 4 * np.log(2), 1.5
        return 0.9 * c / np.pi * np.exp(-c * rho2) + 0.1 / (2 * np.pi * h * h) * np.exp(-np.sqrt(rho2) / h)
    if name == "KOLMOGOROV":
        r, table = kolmogorov_table()
        rho = np.sqrt(rho2)
        return np.where(rho < 20, np.interp(rho, r, table), table[-1] * np.maximum(rho / 20, 1)**(-11 / 3))
    return 0.96 * moffat(rho2, 3.5)


def spikes(kind, x, y):
    """Light of the spikes at offsets in FWHM."""
    if kind != "SPIKES":
        return 0.0
    u, v = x * np.cos(SPIKE_ANGLE) + y * np.sin(SPIKE_ANGLE), y * np.cos(SPIKE_ANGLE) - x * np.sin(SPIKE_ANGLE)
    across = 1 / (np.sqrt(2 * np.pi) * SPIKE_WIDTH) / (2 * SPIKE_LENGTH)
    return 0.02 * across * sum(np.exp(-abs(a) / SPIKE_LENGTH - 0.5 * (b / SPIKE_WIDTH)**2) for a, b in ((u, v), (v, u)))


@dataclass(frozen=True)
class Truth:
    kind: str
    fwhm: float  # pixels, geometric mean of both axes before pixel integration, at the tile's centre
    ellipticity: float = 0.0  # 1 - b/a there, at 25 degrees
    varies: str = "CONSTANT"  # LINEAR, QUADRATIC, CORNER
    side: int = 1024

    def shape(self, x, y):
        """FWHM (pixels), 1 - b/a, angle (radians) at a place of the tile (pixels from 0)."""
        u, v = 2 * x / (self.side - 1) - 1, 2 * y / (self.side - 1) - 1
        fwhm, e = self.fwhm, self.ellipticity * np.exp(2j * np.radians(25))
        if self.varies == "LINEAR":  # a tilted focal plane
            fwhm, e = fwhm * (1 + 0.08 * u - 0.05 * v), e + 0.05 * u + 0.04j * v
        elif self.varies == "QUADRATIC":  # a curved one, with radial astigmatism
            fwhm, e = fwhm * (1 + 0.08 * (u * u + v * v)), e + 0.05 * (u + 1j * v)**2
        elif self.varies == "CORNER":  # good but for one corner
            bad = np.exp(-((u - 1)**2 + (v - 1)**2) / (2 * 0.45**2))
            fwhm, e = fwhm * (1 + 0.3 * bad), e + 0.15j * bad
        return fwhm, min(abs(e), 0.6), 0.5 * np.angle(e)

    def density(self, x, y, shape):
        """Light per square pixel of a star of flux 1, at offsets in pixels."""
        fwhm, e, angle = shape
        c, s, q = np.cos(angle), np.sin(angle), 1 - e
        rho2 = ((c * x + s * y)**2 * q + (c * y - s * x)**2 / q) / fwhm**2
        return (radial(self.kind, rho2) + spikes(self.kind, x / fwhm, y / fwhm)) / fwhm**2

    def stamp(self, x, y, radius, dx=0.0, dy=0.0):
        """Pixels of a star of flux 1 at the tile's place (x, y), centred (dx, dy) off the middle one; (2 radius + 1)^2."""
        shape = self.shape(x, y)
        pixels = quadrature(lambda u, v: self.density(u, v, shape), radius, dx, dy, 2)
        core = int(min(radius, np.ceil(2.5 * shape[0] + 1)))
        inner = slice(radius - core, radius + core + 1)
        pixels[inner, inner] = quadrature(lambda u, v: self.density(u, v, shape), core, dx, dy,
                                          4 if shape[0] > 2.2 else 7)
        return pixels

    @lru_cache
    def reaches(self):
        """Radii (pixels), light beyond them, and the density there (the higher one, along a spike)."""
        r = np.arange(1, 40 * self.fwhm) + 0.5
        fine = np.arange(0, 200, 0.01)
        light = 2 * np.pi * fine * radial(self.kind, fine**2) * 0.01
        share = light.sum() + (0.04 if self.kind == "SPIKES" else 0)
        beyond = share - np.interp(r / self.fwhm, fine, np.cumsum(light))
        if self.kind == "SPIKES":
            beyond -= 0.04 * (1 - np.exp(-r / self.fwhm / SPIKE_LENGTH))
        along = spikes(self.kind, r / self.fwhm * np.cos(SPIKE_ANGLE), r / self.fwhm * np.sin(SPIKE_ANGLE))
        return r, beyond, (radial(self.kind, (r / self.fwhm)**2) + along) / self.fwhm**2

    def radius(self, flux):
        r, beyond, density = self.reaches()
        enough = (beyond < 2e-4) | (flux * density < 0.002 * SIGMA)
        return int(np.ceil(r[np.argmax(enough)] if enough.any() else r[-1]))


def quadrature(density, radius, dx, dy, order):
    """Integral over each pixel."""
    at, weight = np.polynomial.legendre.leggauss(order)
    axis = (np.arange(-radius, radius + 1)[:, None] + 0.5 * at).ravel()
    values = density(axis[None, :] - dx, axis[:, None] - dy)
    side = 2 * radius + 1
    return np.einsum("iajb,a,b->ij", values.reshape(side, order, side, order), weight / 2, weight / 2)


def draw(truth, x, y, flux):
    """Stars at pixels from 0, without sky and noise."""
    side = truth.side
    image = np.zeros((side, side))
    for a, b, f in zip(x, y, flux):
        i, j, radius = int(round(a)), int(round(b)), truth.radius(f)
        x0, x1, y0, y1 = max(i - radius, 0), min(i + radius + 1, side), max(j - radius, 0), min(j + radius + 1, side)
        piece = truth.stamp(a, b, radius, a - i, b - j)
        image[y0:y1, x0:x1] += f * piece[y0 - j + radius:y1 - j + radius, x0 - i + radius:x1 - i + radius]
    return image


def expose(light, rng):
    """Photons of light and sky, cut at the saturation."""
    level = light + SKY
    return np.minimum(level + rng.standard_normal(level.shape) * np.sqrt(level / GAIN), SATURATION).astype(np.float32)


def stars(truth, density, rng):
    """Places and fluxes: from S/N 5 to twice what saturates, N(> F) ~ F^-0.6."""
    n = max(int(round(density * truth.side**2 / 1e6)), 1)
    middle = truth.stamp(truth.side / 2, truth.side / 2, int(4 * truth.fwhm + 2))
    low, high = 5 * SIGMA / np.sqrt((middle**2).sum()), 2 * (SATURATION - SKY) / middle.max()
    share = rng.random(n) * (1 - (high / low)**-0.6)
    return rng.uniform(0, truth.side - 1, n), rng.uniform(0, truth.side - 1, n), low * (1 - share)**(-1 / 0.6)


def signal_to_noise(truth, flux):
    """Of an ideal fit of the flux alone."""
    middle = truth.stamp(truth.side / 2, truth.side / 2, int(4 * truth.fwhm + 2))
    return flux / np.sqrt(SIGMA**2 / (middle**2).sum() + flux / GAIN)


def limits(truth, x, y, flux):
    """Cramer and Rao's bound, 1 sigma, of the mean over the tile of dT/T and of the ellipticities, from stars with flux, place,
    size and ellipse free, profile and neighbours known; size and ellipse are polynomials over the tile of the truth's degree
    (4 for a bad corner). No method does better."""
    half, (fwhm, e, angle) = int(np.ceil(4 * truth.fwhm + 2)), truth.shape(truth.side / 2, truth.side / 2)

    def stamp(s=0.0, e1=0.0, e2=0.0, dx=0.0, dy=0.0):
        k = e * np.exp(2j * angle) + e1 + 1j * e2
        shape = fwhm * np.exp(s), abs(k), 0.5 * np.angle(k)
        return quadrature(lambda u, v: truth.density(u, v, shape), half, dx, dy, 4 if fwhm > 2.2 else 7)

    h, plain = 1e-3, stamp()
    steps = [{name: h} for name in ("dx", "dy", "s", "e1", "e2")]
    slopes = [(stamp(**a) - stamp(**{k: -v for k, v in a.items()})) / (2 * h) for a in steps]
    change = np.array([(np.array(moments(plain + h * d, truth.fwhm)) - moments(plain, truth.fwhm)) / h for d in slopes[2:]]).T
    change[0] /= moments(plain, truth.fwhm)[0]

    def information(f):
        g = np.array([plain, *(f * d for d in slopes)]).reshape(6, -1)
        a = g / (SIGMA**2 + f * plain.ravel() / GAIN) @ g.T
        return a[3:, 3:] - a[3:, :3] @ np.linalg.solve(a[:3, :3], a[:3, 3:])

    grid = np.geomspace(flux.min(), flux.max(), 12)
    known = np.array([information(f) for f in grid])
    each = np.array([[np.interp(np.log(flux), np.log(grid), known[:, a, b]) for b in range(3)] for a in range(3)])
    degree = {"CONSTANT": 0, "LINEAR": 1, "QUADRATIC": 2, "CORNER": 4}[truth.varies]
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]

    def terms(u, v):
        return np.array([np.polynomial.legendre.legval(u, [0] * i + [1]) * np.polynomial.legendre.legval(v, [0] * j + [1])
                         for i, j in powers])

    at = terms(2 * x / (truth.side - 1) - 1, 2 * y / (truth.side - 1) - 1)
    n, axis = len(powers), (np.arange(12) + 0.5) / 6 - 1
    covariance = np.linalg.inv(np.einsum("in,jn,abn->iajb", at, at, each).reshape(3 * n, 3 * n)).reshape(n, 3, n, 3)
    mean = terms(np.tile(axis, 12), np.repeat(axis, 12)).mean(1)
    size, e1, e2 = np.sqrt(np.diag(change @ np.einsum("i,iajb,j->ab", mean, covariance, mean) @ change.T))
    return {"limit dT/T": size, "limit de": max(e1, e2)}


# --- judging a PSF

def moments(stamp, weight_fwhm):
    """T, e1, e2 with a round Gaussian weight of that FWHM (fixed), the weight taken off as if all were Gaussian: the
    inverse covariance less that of the weight (Hirata and Seljak 2003, MNRAS 343, 459, have it adapted)."""
    half = stamp.shape[0] // 2
    axis, s2 = np.arange(-half, half + 1.0), (weight_fwhm / 2.3548)**2
    w = np.exp(-0.5 * axis**2 / s2)
    p = stamp * w[:, None] * w[None, :]
    total = p.sum()
    x, y = (p.sum(0) @ axis) / total, (p.sum(1) @ axis) / total
    u, v = axis - x, axis - y
    xx, yy, xy = (p.sum(0) @ u**2) / total, (p.sum(1) @ v**2) / total, (v @ p @ u) / total
    c = np.linalg.inv(np.linalg.inv([[xx, xy], [xy, yy]]) - np.eye(2) / s2)
    t = c[0, 0] + c[1, 1]
    return t, (c[0, 0] - c[1, 1]) / t, 2 * c[0, 1] / t


def common(a, b):
    """Both stamps on the larger one's frame."""
    half = max(a.shape[0], b.shape[0]) // 2
    return [np.pad(s, half - s.shape[0] // 2) for s in (a, b)]


def growth(stamp, radii):
    """Light within the radii (pixels)."""
    half = stamp.shape[0] // 2
    r = np.hypot(*np.mgrid[-half:half + 1, -half:half + 1])
    return np.array([stamp[r <= a].sum() for a in radii])
