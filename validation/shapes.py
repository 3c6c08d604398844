#!/usr/bin/python3
"""Shapes of galaxies after restoration: a published benchmark of deconvolution for weak lensing, built again.

    shapes.py FOLDER [SEED [GALAXIES]]     seed 51, 100 galaxies

After Li & Alexander (2023, MNRAS 522, L31; code and results: github.com/Lukeli0425/Galaxy-Deconv, as of 2023-01-31). Stamps of 48 x 48 pixels of 0.2
arcsec, drawn and convolved at 0.05; PSF of an atmosphere (Kolmogorov, FWHM 0.45 to 0.95 arcsec, ellipticity 0.01 to 0.03) and of a telescope with
aberrations; galaxies turned, sheared by 0.01 to 0.05, magnified by up to 1.1; a sky of 10 to 50 photons; S/N sqrt(sum of squares of the unblurred
image) / sigma. The shape of an image is that of Fourier Power Function Shapelets (Li et al. 2018, MNRAS 481, 4445; moments as in its version 3, weight
of sigma 0.6 arcsec): ellipticity over response, about pixel (24, 24). The error is | |g| - |g of the unblurred image| |, at most 1; its median is what
was published. |dg|: the same of the vector.

SERSIC: profiles fitted to COSMOS galaxies (templates/cosmos_sersics_sample_N300_cleaned.asc) in the place of the images to 23.5 mag, which are not at hand; their
|g| is multiplied by 0.65, with which the median |g| of the unblurred images is the published 0.15. REAL: those images of templates/cosmos (to 26 mag,
with their noise) that no network was trained on. "none" and "RL 10" are made as published (RL from the observed image, periodic, its PSF half a pixel
off), and say how far the rest can be compared. Ours are runs of the program on one tile for each galaxy, its seven S/N in it, sky between them: PSF
given, all else as it is by default; image of RL and NET, shape divided by the transfer function of the PSF it has left; "fit": the profile of the
columns SPHEROID_*. "divided": the observed image by the PSF's transfer function. RX_PROGRAM and RX_MODEL as in tiles.py; RX_SHARED_DATA.
"""
import math
import os
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from astropy.io import fits
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates

import ledger
import tiles

SIDE, SCALE, FINE = 48, 0.2, 4
SN = (20, 40, 60, 80, 100, 150, 200)
SHOWN = 60
EDGE = 16  # pixels of sky around each stamp of a tile
WEIGHT = 0.6 / SCALE  # sigma of the moments' weight, pixels
PUBLISHED = {"none": (.0805, .0619, .0627, .0655, .0652, .0718, .0684), "RL 10": (.1145, .0579, .0448, .0407, .0324, .0316, .0310),
             "ShapeNet": (.0766, .0534, .0410, .0300, .0276, .0207, .0225), "ADMM 8": (.0656, .0523, .0383, .0295, .0251, .0188, .0175)}


def frequencies(side, step):
    f = np.fft.fftfreq(side, step)
    return f[None, :], f[:, None]


# The shape


class Shape:
    """g1, g2 of an image about pixel (24, 24) and a shift, by the moments of its Fourier transform over that of a PSF."""

    def __init__(self):
        self.fx, self.fy = frequencies(SIDE, 1)
        z = 2 * np.pi * WEIGHT * (self.fx + 1j * self.fy)
        square, weight = np.abs(z)**2, np.exp(-np.abs(z)**2 / 2)
        self.m00, self.m22, self.m40 = weight, -weight * z**2 / math.sqrt(2), weight * (1 - 2 * square + square**2 / 2)

    def __call__(self, image, transfer=1, shift=0):
        f = np.fft.fft2(image - image.min()) * np.exp(2j * np.pi * (self.fx + self.fy) * (SIDE // 2 + shift)) / transfer
        m00, m22, m40 = ((f * m).sum() / SIDE**2 / SCALE**2 for m in (self.m00, self.m22, self.m40))
        e = np.array([m22.real, m22.imag]) / (m00.real + 1)
        return e / ((m00 - m40).real / (m00.real + 1) + 2 * e[0]**2) * math.sqrt(2)

    def gauss(self, fwhm):
        return np.exp(-(np.pi * fwhm)**2 * (self.fx**2 + self.fy**2) / (4 * math.log(2)))


# The sky


def optics(rng, diameter_waves, fx, fy):
    """Transfer function of a telescope of that lambda / D (arcsec): the pupil's autocorrelation."""
    n = 64
    y, x = np.mgrid[-n:n, -n:n] / (n / 2) + 0  # the pupil has radius 1: half of the grid
    r2 = x**2 + y**2
    c = dict(defocus=rng.normal(0, .36), astig1=rng.normal(0, .07), astig2=rng.normal(0, .07), coma1=rng.normal(0, .07), coma2=rng.normal(0, .07),
             spher=rng.normal(0, .07), tre1=rng.normal(0, .07), tre2=rng.normal(0, .07))
    wave = (c["defocus"] * math.sqrt(3) * (2 * r2 - 1) + math.sqrt(6) * (c["astig1"] * 2 * x * y + c["astig2"] * (x**2 - y**2))
            + math.sqrt(8) * (3 * r2 - 2) * (c["coma1"] * y + c["coma2"] * x) + math.sqrt(8) * (c["tre1"] * (3 * x**2 * y - y**3) + c["tre2"] * (x**3 - 3 * x * y**2))
            + math.sqrt(5) * c["spher"] * (6 * r2**2 - 6 * r2 + 1))
    pupil = np.where((r2 <= 1) & (r2 >= rng.uniform(.1, .5)**2), np.exp(2j * np.pi * wave), 0)
    power = np.abs(np.fft.fft2(pupil, (4 * n, 4 * n)))**2
    otf = np.fft.fftshift(np.fft.ifft2(power))
    otf = otf / otf[2 * n, 2 * n]
    at = [2 * n + f * diameter_waves * n for f in np.broadcast_arrays(fy, fx)]  # a shift of D is n steps of the grid
    return map_coordinates(otf.real, at, order=1) + 1j * map_coordinates(otf.imag, at, order=1)


SEEING = np.linspace(.45, .95, 101)
SEEING_ODDS = np.maximum(CubicSpline([.45, .55, .65, .75, .85, .95], [0, 20, 17, 13, 9, 0], bc_type="natural")(SEEING), 0)


def psf_transfer(rng, fx, fy):
    """Of a PSF at the origin, at frequencies of 1/arcsec."""
    fwhm = rng.choice(SEEING, p=SEEING_ODDS / SEEING_ODDS.sum()) + rng.uniform(-.0025, .0025)
    e, beta = rng.uniform(.01, .03), rng.uniform(0, 2 * np.pi)
    g = e / (1 + math.sqrt(1 - e * e))  # of a distortion, the shear
    g1, g2 = g * math.cos(2 * beta), g * math.sin(2 * beta)
    ux, uy = ((1 + g1) * fx + g2 * fy) / math.sqrt(1 - g * g), (g2 * fx + (1 - g1) * fy) / math.sqrt(1 - g * g)
    r0 = .975865 / fwhm  # over lambda, 1/arcsec
    return np.exp(-6.8839 / 2 * (np.hypot(ux, uy) / r0)**(5 / 3)) * optics(rng, rng.uniform(.013, .083), fx, fy)


def matrix(rng):
    """Turned, sheared and magnified: from the sky's place to the galaxy's own."""
    theta, beta = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    g = math.sqrt(rng.uniform(.01**2, .05**2))  # its density grows with g
    g1, g2, mu = g * math.cos(2 * beta), g * math.sin(2 * beta), rng.uniform(1, 1.1)
    shear = np.array([[1 + g1, g2], [g2, 1 - g1]]) / math.sqrt(1 - g * g) * math.sqrt(mu)
    turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
    return np.linalg.inv(shear @ turn)


def sersic(index, radius, ratio, theta):
    """Surface brightness at places (arcsec); radius of half the light, major axis."""
    b = 2 * index - 1 / 3 + 4 / (405 * index) + 46 / (25515 * index**2)  # Ciotti & Bertin (1999)
    c, s = math.cos(theta), math.sin(theta)
    return lambda x, y: np.exp(-b * (np.hypot(c * x + s * y, (c * y - s * x) / ratio) / radius)**(1 / index))


def drawn(profile, to_own, at, transfer):
    """Of SIDE * FINE pixels, from a grid 4 times as fine, through a transfer function (the Hubble telescope's)."""
    n, step = SIDE * FINE * 4, SCALE / FINE / 4
    p = (np.arange(n) - (n - 1) / 2) * step
    x, y = p[None, :] - at[0], p[:, None] - at[1]
    image = profile(to_own[0, 0] * x + to_own[0, 1] * y, to_own[1, 0] * x + to_own[1, 1] * y)
    fx, fy = frequencies(n, step)
    image = np.fft.ifft2(np.fft.fft2(image) * transfer(fx, fy)).real
    return image.reshape(n // 4, 4, n // 4, 4).mean((1, 3))


def sersics(data):
    table = np.loadtxt(data / "templates/cosmos_sersics_sample_N300_cleaned.asc")
    hubble = lambda fx, fy: np.exp(-(np.pi * .11)**2 * (fx**2 + fy**2) / (4 * math.log(2)))  # FWHM 0.11 arcsec

    def draw(k, rng, at):
        _, index, radius, g, angle = table[rng.integers(len(table))][:5]
        ratio = (1 - .65 * g) / (1 + .65 * g)
        return drawn(sersic(index, radius / math.sqrt(ratio), ratio, angle / 2), matrix(rng), at, hubble)
    return draw


def real(data):
    folder = data / "templates/cosmos"
    table = fits.getdata(folder / "real_galaxy_catalog_26_extension_example.fits", 1)
    images = fits.open(folder / "real_galaxy_images_extension.fits")
    held = [i for i in range(len(table)) if i % 3 == 0]  # as training/stamps.py has it

    def draw(k, rng, at):
        row = table[held[k % len(held)]]
        stamp = np.array(images[int(row["GAL_HDU"])].data, float)
        scale, (h, w) = float(row["PIXEL_SCALE"]), stamp.shape
        profile = lambda x, y: map_coordinates(stamp, [y / scale + (h - 1) / 2, x / scale + (w - 1) / 2], order=3)
        return drawn(profile, matrix(rng), at, lambda fx, fy: 1)
    return draw


def coarse(image):
    n = len(image) // FINE
    return image.reshape(n, FINE, n, FINE).mean((1, 3))


def scene(draw, k, rng):
    """Unblurred and blurred, of S/N 1 where sigma is 1, and the transfer function of the PSF at frequencies of the fine grid."""
    fx, fy = frequencies(SIDE * FINE, SCALE / FINE)
    psf = psf_transfer(rng, fx, fy)
    fine = draw(k, rng, rng.uniform(-1, 1, 2) * SCALE / FINE)
    fine /= math.sqrt((coarse(fine)**2).sum())
    shift = np.exp(1j * np.pi * (fx + fy) * SCALE / FINE)  # as published: the convolution moves it by half a fine pixel
    return coarse(fine), coarse(np.fft.ifft2(np.fft.fft2(fine) * psf * shift).real), psf


def stamp_of(transfer, side):
    """The PSF in the middle of a stamp, in coarse pixels (fine ones averaged)."""
    fx, fy = frequencies(SIDE * FINE, SCALE / FINE)
    middle = (side * FINE - 1) / 2
    image = np.fft.ifft2(transfer * np.exp(-2j * np.pi * SCALE / FINE * (fx + fy) * middle)).real
    image = coarse(image[:side * FINE, :side * FINE])
    return image / image.sum()


def richardson_lucy(image, psf, iterations):
    otf = np.fft.fft2(np.roll(psf, (-(SIDE // 2), ) * 2, (0, 1)))
    through = lambda x, t: np.fft.ifft2(np.fft.fft2(x) * t).real
    x = image.copy()
    for _ in range(iterations):
        x = x * through(image / through(x, otf), otf.conj())
    return x


# The program

COLUMNS = "SPHEROID_REFF_IMAGE SPHEROID_SERSICN SPHEROID_ASPECT_IMAGE SPHEROID_THETA_IMAGE"
LEFT = {"RL": lambda fwhm: 0.8 * fwhm, "NET": lambda fwhm: 2.0}  # FWHM of the Gaussian that the restored image has left (RL_DENOISE; the network's output), pixels


def cells(n):
    step = SIDE + 2 * EDGE
    return [(slice(j // 4 * step + EDGE, j // 4 * step + EDGE + SIDE), slice(j % 4 * step + EDGE, j % 4 * step + EDGE + SIDE)) for j in range(n)]


def fitted(run, cell):
    """Image of the fitted profile of the source next to the middle of a stamp; None: there is none."""
    t, middle = run.table, np.array([cell[1].start, cell[0].start]) + SIDE / 2
    if not len(t):
        return None
    distance = np.hypot(*(run.positions - 1 - middle).T)
    s = t[distance.argmin()]
    if distance.min() > 5 or not s["SPHEROID_REFF_IMAGE"] > 0:
        return None
    ratio, at = float(s["SPHEROID_ASPECT_IMAGE"]), (run.positions[distance.argmin()] - 1 - [cell[1].start, cell[0].start] - (SIDE - 1) / 2) * SCALE
    profile = sersic(float(s["SPHEROID_SERSICN"]), float(s["SPHEROID_REFF_IMAGE"]) * SCALE, ratio, math.radians(float(s["SPHEROID_THETA_IMAGE"])))
    image = coarse(drawn(profile, np.eye(2), at, lambda fx, fy: 1))
    return image / image.max() * 1e4


def one(program, shape, draw, k, rng):
    """Of one galaxy: {row: g1, g2 by S/N}."""
    truth, seen, transfer = scene(draw, k, rng)
    sky = rng.uniform(10, 50)
    read = rng.uniform(.05, .15)
    sigma = math.sqrt(sky + read**2)
    psf, centred = stamp_of(transfer, SIDE), np.fft.fft2(np.fft.ifftshift(np.pad(stamp_of(transfer, SIDE - 1), (1, 0))))
    tile = rng.poisson(sky, (2 * (SIDE + 2 * EDGE), 4 * (SIDE + 2 * EDGE))).astype(float)
    g = {name: [] for name in ("truth", "none", "divided", "RL 10", "RL", "NET", "fit")}
    for sn, cell in zip(SN, cells(len(SN))):
        light = sn * sigma * seen
        tile[cell] = np.maximum(0, rng.poisson(np.maximum(light + sky, 0)) + rng.normal(0, read, seen.shape))
        g["truth"].append(shape(sn * sigma * truth))
        g["none"].append(shape(tile[cell]))
        g["divided"].append(shape(tile[cell], centred))
        g["RL 10"].append(shape(richardson_lucy(tile[cell], psf, 10)))
    fits.writeto(program.folder / "psf.fits", stamp_of(transfer, SIDE - 1).astype(np.float32), overwrite=True)
    runs = program.run(tiles.Tile("shapes", "simulated", tile, fits.Header()), ("RL", "NET"), ("RESTORED", ), PSF_TYPE="FILE", PSF_NAME="psf.fits", GAIN=1, SATUR_LEVEL=1e9,
                       PIXEL_SCALE=SCALE, NTHREADS=1)
    for sn, cell in zip(SN, cells(len(SN))):
        for r, run in runs.items():
            g[r].append(shape(run.images["RESTORED"][cell], shape.gauss(LEFT[r](run.fwhm)), -1 / 8))
        image = fitted(runs["NET"], cell)
        g["fit"].append([1, 0] if image is None else shape(image, 1, -1 / 8))
        if sn == SHOWN and len(program.shown) < 6:
            program.shown.append([truth, tile[cell], *(run.images["RESTORED"][cell] for run in runs.values()), 0 * truth if image is None else image])
    return g


def picture(path, rows):
    figure, axes = plt.subplots(len(rows), 5, figsize=(7.5, 1.5 * len(rows)))
    for line, images in zip(axes, rows):
        for axis, image in zip(line, images):
            axis.imshow(np.arcsinh(10 * (image - np.median(image)) / (image - np.median(image)).max()), origin="lower", cmap="gray", vmin=-1, vmax=3)
            axis.set_axis_off()
    for axis, title in zip(axes[0], ("unblurred", f"observed, S/N {SHOWN}", "RL", "NET", "fit")):
        axis.set_title(title, fontsize=8)
    figure.tight_layout(pad=0.3)
    figure.savefig(path, dpi=80, metadata={"Software": None})
    plt.close(figure)


def main():
    folder, seed = os.path.abspath(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 51
    count = int(sys.argv[3]) if len(sys.argv) > 3 else 100
    ledger.claim("shapes", folder, [seed])
    tiles.COLUMNS += " " + COLUMNS
    os.environ["OMP_NUM_THREADS"] = "1"
    program, shape, data = tiles.Program(folder), Shape(), Path(os.environ.get("RX_SHARED_DATA", tiles.TOP.parent / "shared/data"))
    text, result = ["# Shapes after restoration", "", f"`validation/shapes.py`, seed {seed}, {count} galaxies. Median error of |g|, by S/N; in brackets of the vector."], {}
    for name, population in (("SERSIC", sersics), ("REAL", real)):
        draw, began, program.shown = population(data), time.time(), []
        g = [one(program, shape, draw, k, np.random.default_rng([seed, k])) for k in range(count)]
        g = {row: np.array([x[row] for x in g], float) for row in g[0]}
        picture(f"{folder}/{name.lower()}.png", program.shown)
        size = np.hypot(*np.moveaxis(g["truth"], 2, 0))
        result[name] = {"|g| of the truth": float(np.median(size))}
        text += ["", f"{name}: median |g| of the unblurred {np.median(size):.3f}; {(time.time() - began) / count:.2f} s a galaxy on one core, all rows.", "", "| | " + " | ".join(map(str, SN)) + " |",
                 "| --- " * (len(SN) + 1) + "|"]
        for row, values in g.items():
            if row != "truth":
                error = np.minimum(np.abs(np.hypot(*np.moveaxis(values, 2, 0)) - size), 1)
                vector = np.minimum(np.hypot(*np.moveaxis(values - g["truth"], 2, 0)), 1)
                result[name][row] = {"error": np.median(error, 0).tolist(), "vector": np.median(vector, 0).tolist()}
                text.append(f"| {row} | " + " | ".join(f"{a:.4f} ({b:.3f})" for a, b in zip(np.median(error, 0), np.median(vector, 0))) + " |")
        text += [f"| {row}, published | " + " | ".join(f"{v:.4f}" for v in values) + " |" for row, values in PUBLISHED.items()]
    ledger.store(folder, "shapes", text, result)


if __name__ == "__main__":
    main()
