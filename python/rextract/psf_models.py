"""PSF models of Piff and of IRAF's DAOPHOT as a file that PSF_TYPE FILE reads.

    python3 -m rextract.psf_models MODEL OUT.fits [IMAGE.fits]

OUT.fits holds, for each chip of MODEL, a table PSF_DATA as psfex writes it: a cube of images, the terms of a polynomial of
the position, on pixels of the image or finer, the light that pixels collect included. IMAGE.fits is the image that the
PSF is for, whose size says where the polynomial must hold; without it that is the range of the model's stars.

Piff (Jarvis et al. 2021, MNRAS 501, 1282): PixelGrid, interpolated by Polynomial, BasisPolynomial or Mean. A grid in the
tangent plane, u and v in arcsec, each value a polynomial of the position:

    PSF(x, y; dx, dy) = grid(J (dx, dy) / scale),  grid[j][i] = sum_k coefficient[j][i][k] basis_k(u, v)

by Lanczos interpolation. A Piff file keeps the world coordinates as a Python object; what they say, (u, v) and their
derivatives J by (x, y), stands in its list of stars as well: a polynomial of degree 3, or less with few stars.

DAOPHOT (Stetson 1987, PASP 99, 191): a profile in the header, and what the stars have beyond it as tables in steps of
half a pixel, which vary with the position (VARORDER):

    PSF(dx, dy) = PSFHEIGH profile(dx, dy) + sum_k term_k(X, Y) table_k(dx, dy),  X = (x - 1) / PSFX - 1
    terms: 1; X, Y; (3 X^2 - 1) / 2, X Y, (3 Y^2 - 1) / 2

numpy and astropy are all that this module needs.
"""
from __future__ import annotations

import os
import sys
import warnings

import numpy as np
from astropy.io import fits

MAX_DEGREE = 8  # of a polynomial that Rextract reads
GOOD = 1e-4  # of the peak: the lowest degree that misses no place by more is taken
LOCAL = 40.0  # pixels: rings in a detector move stars by some 0.02 arcsec, their derivatives by some 5e-4 arcsec a pixel


def powers(degree):
    """Of a polynomial's terms, in the order of PSFEx."""
    return [(i, j) for j in range(degree + 1) for i in range(degree + 1 - j)]


def lanczos_weights(position, order):
    """First pixel and weights [2 order] of each position, of sum 1."""
    first = np.floor(position).astype(int) - order + 1
    d = position[..., None] - (first[..., None] + np.arange(2 * order))
    weights = np.where(np.abs(d) < order, np.sinc(d) * np.sinc(d / order), 0.0)
    return first, weights / weights.sum(-1, keepdims=True)


def lanczos(image, x, y, order):
    """image at the positions (x, y), 0 outside of it."""
    side = len(image)
    left, across = lanczos_weights(x, order)
    low, up = lanczos_weights(y, order)
    value = np.zeros(x.shape)
    for j in range(2 * order):
        for i in range(2 * order):
            row, column = low + j, left + i
            inside = (row >= 0) & (row < side) & (column >= 0) & (column < side)
            value[inside] += (up[..., j] * across[..., i])[inside] * image[row[inside], column[inside]]
    return value


# --- Piff ---

def refuse(what, word):
    return ValueError(f"a Piff file with {what} '{word}', of which only PixelGrid with polynomials of the position is "
                      "read; write it as images, or for PSFEx's readers")


def table_of(hdus, name):
    for hdu in hdus:
        if isinstance(hdu, fits.BinTableHDU) and hdu.name.lower() == name and len(hdu.data) > 0:
            return hdu
    raise ValueError(f"no table {name}: not a Piff file, or a damaged one")


def word_of(hdu, column, element=0):
    """Text of a column's element in the first row, None without it."""
    if column not in hdu.columns.names:
        return None
    values = np.atleast_1d(hdu.data[column][0])
    return str(values[element]).strip() if element < len(values) else None


def whole_of(name, value, low, high):
    if not low <= value <= high or value != int(value):
        raise ValueError(f"{name} = {value:g} of the Piff file is not in {low} to {high}")
    return int(value)


class World:
    """u and v (arcsec) as polynomials of the FITS position."""

    def __init__(self, stars, scale, prefix):
        data = stars.data
        columns = stars.columns.names
        if not {"x", "y", "u", "v"} <= set(columns):
            raise ValueError(f"no columns x, y, u and v in {prefix}_stars: a damaged Piff file")
        x, y = (np.asarray(data[c], float) for c in "xy")
        self.low, self.high = (x.min(), y.min()), (x.max(), y.max())
        self.zero = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
        self.span = max(1.0, 0.5 * max(np.ptp(x), np.ptp(y)))
        local = "dudx" in columns
        numbers = len(x) * (3 if local else 1)
        # twice as many numbers as terms, but for the plane that one star with its derivatives gives
        degree = 3 if numbers >= 20 else 2 if numbers >= 12 else 1
        self.powers = [(d - j, j) for d in range(degree + 1) for j in range(d + 1)]
        terms = self.terms(x, y)
        matrix = np.concatenate([terms[0]] + ([LOCAL * terms[1], LOCAL * terms[2]] if local else []))
        self.of, worst = [], 0.0
        for axis in "uv":
            values = [np.asarray(data[axis], float)]
            if local:
                values += [LOCAL * np.asarray(data[f"d{axis}d{by}"], float) for by in "xy"]
            values = np.concatenate(values)
            if not (np.isfinite(matrix).all() and np.isfinite(values).all()):
                worst = np.inf
                break
            self.of.append(np.linalg.lstsq(matrix, values, rcond=None)[0])
            worst = max(worst, np.abs(values - matrix @ self.of[-1])[:len(x)].max())
        if not worst <= scale:
            raise ValueError(f"x, y, u and v of the {len(x)} stars in {prefix}_stars do not say where the sky is on the "
                             "pixels; make the Piff file again")

    def terms(self, x, y):
        """The terms at places, and their derivatives by x and y, each [places][terms]."""
        a, b = (np.atleast_1d(x) - self.zero[0]) / self.span, (np.atleast_1d(y) - self.zero[1]) / self.span
        return [np.stack(column, -1) for column in (
            [a**i * b**j for i, j in self.powers],
            [i * a**max(i - 1, 0) * b**j / self.span for i, j in self.powers],
            [j * a**i * b**max(j - 1, 0) / self.span for i, j in self.powers])]

    def at(self, x, y):
        """(u, v) of a place, and J = ((du/dx, du/dy), (dv/dx, dv/dy))."""
        terms = [t[0] for t in self.terms(x, y)]
        return ([float(of @ terms[0]) for of in self.of],
                np.array([[of @ terms[1], of @ terms[2]] for of in self.of]))


class Piff:
    """The model of one chip."""

    name = "Piff model"

    def __init__(self, hdus, prefix):
        kind = word_of(table_of(hdus, prefix), "type") or ""
        if not kind.startswith("Simple"):
            raise refuse("a PSF of the type", kind)
        self.read_grid(table_of(hdus, prefix + "_model"))
        self.read_polynomial(table_of(hdus, prefix + "_interp"), table_of(hdus, prefix + "_interp_solution"), prefix)
        self.world = World(table_of(hdus, prefix + "_stars"), self.scale, prefix)
        self.degree = max(i + j for i, j in self.powers)
        self.range = self.world.low, self.world.high

    def read_grid(self, hdu):
        kind = word_of(hdu, "type")
        if kind != "PixelGrid":
            raise refuse("the model", kind)
        self.side = whole_of("size", float(hdu.data["size"][0]), 3, 511)
        self.scale = float(hdu.data["scale"][0])
        if not 1e-4 < self.scale < 1e4:
            raise ValueError(f"scale = {self.scale:g} of the Piff file cannot be right")
        interp = word_of(hdu, "interp")
        order = (interp or "Lanczos(3").partition("Lanczos(")[2].partition(")")[0].partition(",")[0]  # 3: it says none
        self.order = int(order) if order.strip().isdigit() else 0
        if not 1 <= self.order <= 12:
            raise refuse("the interpolant", interp)

    def read_polynomial(self, interp, solution, prefix):
        kind = word_of(interp, "type")
        if kind not in ("BasisPolynomial", "Polynomial", "Mean"):
            raise refuse("the interpolation", kind)
        if kind != "BasisPolynomial" and word_of(interp, "poly_type") not in (None, "", "poly"):
            raise refuse("polynomials of the type", word_of(interp, "poly_type"))
        n = self.side**2
        q = np.asarray(solution.data["q"][0], float) if kind == "BasisPolynomial" and "q" in solution.columns.names else None
        if kind == "BasisPolynomial":
            given = len(q) if q is not None and q.ndim == 2 else n
        else:
            given = solution.header.get("NPARAM", len(solution.data) if kind == "Mean" else n)
        # before Piff 1.0 the files left out what sum 1 and centroid 0 determine
        self.lacking = n - given if given in (n - 1, n - 3) else 0
        n -= self.lacking
        self.by_pixels = False
        if kind == "BasisPolynomial":
            self.read_basis(interp, q, n, prefix)
        else:
            self.read_rows(solution, kind == "Mean", n, prefix)
        wrong = np.argwhere(~np.isfinite(self.grid))
        if len(wrong):
            raise ValueError(f"value {wrong[0][0] + 1} of the Piff file's grid is not a number; make it again")

    def read_basis(self, interp, q, n, prefix):
        """Orders and keys of BasisPolynomial: what varies in its arrays fastest is the second key."""
        keys = [word_of(interp, "keys", i) or "uv"[i] for i in range(2)]
        if word_of(interp, "keys", 2):
            raise refuse("a third key", word_of(interp, "keys", 2))
        if sorted(keys) not in (["u", "v"], ["x", "y"]):
            raise refuse("keys of the polynomial other than u, v and x, y:", keys[0])
        self.by_pixels = "x" in keys
        orders = np.atleast_1d(interp.data["order"][0])
        order = [whole_of("order", float(orders[min(i, len(orders) - 1)]), 0, MAX_DEGREE) for i in range(2)]
        most = max(order)
        if "max_order" in interp.columns.names:
            most = whole_of("max_order", float(interp.data["max_order"][0]), 0, 2 * MAX_DEGREE)
        self.powers = [(i, j) for i in range(order[0] + 1) for j in range(order[1] + 1) if i + j <= most]
        if max(i + j for i, j in self.powers) > MAX_DEGREE:
            raise ValueError(f"the polynomial of the Piff file is of degree {max(i + j for i, j in self.powers)}, "
                             f"{MAX_DEGREE} at most can be read")
        if q is None or q.size != n * len(self.powers):
            raise ValueError(f"no {n} x {len(self.powers)} coefficients q in {prefix}_interp_solution, as size and order "
                             "ask for: a damaged Piff file")
        self.grid = q.reshape(n, len(self.powers))
        if keys[0] in "vy":
            self.powers = [(j, i) for i, j in self.powers]

    def read_rows(self, solution, mean, n, prefix):
        """Polynomial: a row for each coefficient; Mean: for each value."""
        data = solution.data
        rows = len(data)
        param, i, j = ((np.arange(rows), np.zeros(rows), np.zeros(rows)) if mean else
                       (np.asarray(data[c], float) for c in ("PARAM", "U_EXPONENT", "V_EXPONENT")))
        good = (param >= 0) & (param < n) & (i >= 0) & (j >= 0) & (i + j <= MAX_DEGREE)
        if not good.all():
            row = int(np.argmin(good))
            raise ValueError(f"row {row + 1} of {prefix}_interp_solution, value {param[row]:g} with powers {i[row]:g} and "
                             f"{j[row]:g}: not of a grid of {n} values with a polynomial of degree {MAX_DEGREE} at most")
        self.powers = sorted({(0, 0)} | set(zip(i.astype(int).tolist(), j.astype(int).tolist())))
        self.grid = np.zeros((n, len(self.powers)))
        term = [self.powers.index(power) for power in zip(i.astype(int), j.astype(int))]
        self.grid[param.astype(int), term] = data["mean" if mean else "COEFF"]

    def fit_to(self, width, height):
        """Stamps for pixels of that image: their side, and how many samples a pixel the grid knows."""
        jacobian = self.world.at(0.5 * (width + 1), 0.5 * (height + 1))[1]
        pixel = np.sqrt(abs(np.linalg.det(jacobian)))
        half = 0.5 * (self.side + 1) * self.scale / pixel if pixel > 0 else 0.0
        if not 1 <= half <= 2047:
            raise ValueError(f"a grid of {self.side} x {self.scale:g} arcsec on pixels of {pixel:g} arcsec of the tile "
                             "cannot be right; was it made from this tile?")
        return 2 * int(half) + 1, int(pixel / self.scale + 0.1)

    def grid_at(self, place):
        values = self.grid @ np.array([place[0]**i * place[1]**j for i, j in self.powers])
        if not self.lacking:
            return values.reshape(self.side, self.side)
        middle = self.side // 2
        grid = np.zeros((self.side, self.side))
        given = np.ones((self.side, self.side), bool)
        given[middle, middle] = False
        if self.lacking > 1:
            given[middle + 1, middle] = given[middle, middle + 1] = False
        grid[given] = values
        offset = np.arange(self.side) - middle
        if self.lacking > 1:
            grid[middle, middle + 1], grid[middle + 1, middle] = -(grid @ offset).sum(), -(offset @ grid).sum()
        grid[middle, middle] = 1 / self.scale**2 - grid.sum()
        return grid

    def draw(self, x, y, half, fine):
        place, jacobian = self.world.at(x, y)
        dy, dx = np.mgrid[-half:half + 1, -half:half + 1]
        u, v = (self.side // 2 + (j[0] * dx + j[1] * dy) / self.scale / fine for j in jacobian)
        return lanczos(self.grid_at((x, y) if self.by_pixels else place), u, v, self.order)


def piff_models(hdus):
    kind = word_of(table_of(hdus, "psf"), "type") or ""
    if kind.startswith("Simple"):
        return [Piff(hdus, "psf")]
    if not kind.startswith("SingleChip"):
        raise refuse("a PSF of the type", kind)
    return [Piff(hdus, f"psf_{int(chip)}") for chip in np.ravel(table_of(hdus, "psf_chipnums").data["chipnums"])]


# --- DAOPHOT ---

# h, k: half widths at half maximum, PAR1 and PAR2; s = (x/h)^2 + (y/k)^2; p the other parameters
PROFILES = {
    "gauss": (2, lambda s, xy, hk, p: np.exp2(-s) / hk),
    "moffat15": (3, lambda s, xy, hk, p: 0.5 * (1 + 0.5874011 * (s + p[0] * xy))**-1.5 / hk),
    "moffat25": (3, lambda s, xy, hk, p: 1.5 * (1 + 0.3195079 * (s + p[0] * xy))**-2.5 / hk),
    "lorentz": (3, lambda s, xy, hk, p: 1 / (1 + s + p[0] * xy)),
    "penny1": (4, lambda s, xy, hk, p: p[0] * np.exp2(-(s + p[1] * xy)) + (1 - p[0]) / (1 + s)),
    "penny2": (5, lambda s, xy, hk, p: p[0] * np.exp2(-(s + p[1] * xy)) + (1 - p[0]) / (1 + s + p[2] * xy)),
}


class Daophot:
    """The profile is the mean over a pixel, by 4 x 4 Gauss-Legendre points, as DAOPHOT's (which takes fewer in the wings)."""

    name = "DAOPHOT model"

    def __init__(self, header, data):
        self.header = header
        self.profile = str(header["FUNCTION"]).strip().lower()
        if self.profile not in PROFILES:
            raise ValueError(f"FUNCTION '{self.profile}' of the DAOPHOT PSF is none of {', '.join(PROFILES)}")
        count = PROFILES[self.profile][0]
        self.need("NPARS", count, 6)
        self.par = [self.need(f"PAR{i + 1}", 0.05 if i < 2 else -1e30, 1000.0 if i < 2 else 1e30) for i in range(count)]
        for i in range(3 if self.profile.startswith("penny") else 2, count):
            if not abs(self.par[i]) * self.par[0] * self.par[1] < 2:
                raise ValueError(f"PAR{i + 1} = {self.par[i]:g} of the DAOPHOT PSF opens the ellipse of PAR1 = "
                                 f"{self.par[0]:g} and PAR2 = {self.par[1]:g}; make it again")
        self.height, self.middle = self.need("PSFHEIGH", 1e-30, 1e30), [self.need(k, 1e-3, 1e30) for k in ("PSFX", "PSFY")]
        order = int(self.need("VARORDER", -1, 2))
        if str(header.get("FEXPAND", "")).startswith("T"):
            raise ValueError("the DAOPHOT PSF was made with fexpand, which is not read; make it without")
        count = (0, 1, 3, 6)[order + 1]
        if order < 0:
            self.tables, self.radius = np.zeros((0, 1, 1)), self.need("PSFRAD", 0, 1e30) / header.get("SCALE", 1.0)
        else:
            tables = np.zeros((0, 0, 0)) if data is None else np.asarray(data, float)
            self.tables = tables[None] if tables.ndim == 2 else tables
            planes, rows, columns = self.tables.shape
            if planes != count or rows != columns or rows % 2 == 0:
                raise ValueError(f"{planes} tables of {columns} x {rows} in a DAOPHOT PSF of VARORDER {order}, which has "
                                 f"{count}, square and odd")
            if not np.isfinite(self.tables).all():
                raise ValueError("the tables of the DAOPHOT PSF hold values that are not numbers; make it again")
            self.radius = 0.5 * (0.5 * (columns - 1) - 1)
        if not 1 <= self.radius <= 2047:
            raise ValueError(f"a radius of {self.radius:g} pixels of the DAOPHOT PSF cannot be right; make it with another "
                             "psfrad")
        self.degree = max(order, 0)
        self.range = (1.0, 1.0), tuple(2 * m for m in self.middle)  # PSFX, PSFY: the middle of the image

    def need(self, key, low, high):
        if not isinstance(self.header.get(key), (int, float)) or isinstance(self.header[key], bool):
            raise ValueError(f"no {key}: not a PSF as IRAF's DAOPHOT writes it")
        if not low <= self.header[key] <= high:
            raise ValueError(f"{key} = {self.header[key]:g} of the DAOPHOT PSF is not in {low:g} to {high:g}")
        return float(self.header[key])

    def fit_to(self, width, height):
        return 2 * int(self.radius) + 1, 2

    def draw(self, x, y, half, fine):
        h, k, *rest = self.par
        dy, dx = np.mgrid[-half:half + 1, -half:half + 1]
        value = np.zeros(dx.shape)
        points, weights = np.polynomial.legendre.leggauss(4)
        for b, up in zip(points / 2, weights / 2):
            for a, across in zip(points / 2, weights / 2):
                at = dx / fine + a, dy / fine + b
                value += up * across * PROFILES[self.profile][1]((at[0] / h)**2 + (at[1] / k)**2, at[0] * at[1], h * k, rest)
        value *= self.height
        u, v = (x - 1) / self.middle[0] - 1, (y - 1) / self.middle[1] - 1
        side, step = self.tables.shape[-1], 2 // fine
        columns = np.clip(side // 2 + step * np.arange(-half, half + 1), 0, side - 1)
        for term, table in zip((1, u, v, 1.5 * u * u - 0.5, u * v, 1.5 * v * v - 0.5), self.tables):
            value += term * table[np.ix_(columns, columns)]
        return np.where(dx * dx + dy * dy < (fine * self.radius)**2, value, 0.0)


# --- the polynomial on pixels ---

def stamp_of(model, x, y, half, fine, first=None):
    """The PSF at a FITS position, its sum over whole pixels 1, and what that was."""
    stamp = model.draw(x, y, half, fine)
    sum_ = stamp[half % fine::fine, half % fine::fine].sum()
    if not (np.isfinite(sum_) and sum_ > 0.05 * (first or 0.0) and (first is not None or sum_ > 0)):
        raise ValueError(f"the {model.name} sums to {sum_:g} at pixel ({x:.0f},{y:.0f}) of the tile; was it made from this "
                         "tile, and from enough stars?")
    return stamp / sum_, sum_


def project(model, width, height):
    """PSF_DATA of a chip: the polynomial through the stamps at Chebyshev points of the image, of the lowest degree that
    is good to GOOD there."""
    size, finest = model.fit_to(width, height)
    fine = 4 if finest >= 4 else 2 if finest >= 2 else 1
    half = fine * (size // 2)
    zero = 0.5 * (width + 1), 0.5 * (height + 1)
    places = 1 if model.degree == 0 and isinstance(model, Daophot) else MAX_DEGREE + 3
    nodes = 0.5 * np.cos(np.pi * (np.arange(places) + 0.5) / places)
    a, b = (grid.ravel() for grid in np.meshgrid(nodes, nodes))
    stamps, first = [], None
    for u, v in zip(a, b):
        stamp, sum_ = stamp_of(model, zero[0] + u * width, zero[1] + v * height, half, fine, first)
        first = sum_ if first is None else first
        stamps.append(stamp.ravel())
    stamps = np.array(stamps)
    for degree in range(model.degree, MAX_DEGREE + 1 if places > 1 else model.degree + 1):
        matrix = np.stack([a**i * b**j for i, j in powers(degree)], -1)
        images = np.linalg.lstsq(matrix, stamps, rcond=None)[0]
        misfit = (np.abs(stamps - matrix @ images).max(1) / stamps.max(1)).max()
        if misfit < GOOD:
            break
    if misfit > 0.01:
        warnings.warn(f"the {model.name} varies more than a polynomial of the tile can follow: it is met to "
                      f"{100 * misfit:.1f} % of the peak only")
    (low, high), beyond = model.range, 0.0
    for axis, length in enumerate((width, height)):
        span = high[axis] - low[axis]
        beyond = max([beyond] + ([(low[axis] - 1) / span, (length - high[axis]) / span] if span > 0 else []))
    if beyond > 0.5 and model.degree > 0:
        warnings.warn(f"the image reaches {100 * beyond:.0f} % of the range of the stars of the {model.name} beyond it")
    side = 2 * half + 1
    mask = images.reshape(len(images), side, side).astype("f4")
    middle = mask[0]
    column = fits.Column("PSF_MASK", f"{mask.size}E", dim=f"({side},{side},{len(mask)})", array=mask[None])
    hdu = fits.BinTableHDU.from_columns([column], name="PSF_DATA")
    fwhm = 2 * np.sqrt((middle > 0.5 * middle.max()).sum() / np.pi) / fine
    hdu.header.update({
        "LOADED": 0, "ACCEPTED": 0, "CHI2": 0.0, "POLNAXIS": 2, "POLGRP1": 1, "POLNAME1": "X_IMAGE", "POLZERO1": zero[0],
        "POLSCAL1": float(width), "POLGRP2": 1, "POLNAME2": "Y_IMAGE", "POLZERO2": zero[1], "POLSCAL2": float(height),
        "POLNGRP": 1, "POLDEG1": degree, "PSF_FWHM": round(float(fwhm), 3), "PSF_SAMP": 1.0 / fine, "PSFNAXIS": 3,
        "PSFAXIS1": side, "PSFAXIS2": side, "PSFAXIS3": len(mask)})
    return hdu


def models_of(path):
    """The models of a file, one of each chip."""
    with fits.open(path, memmap=False) as hdus:
        header = hdus[0].header
        if "FUNCTION" in header and "VARORDER" in header:
            return [Daophot(header, hdus[0].data)]
        return piff_models(hdus)


def sizes_of(image):
    """(width, height) of each image of a FITS file, or of the one shape (height, width)."""
    if not isinstance(image, (str, os.PathLike)):
        return [(int(image[1]), int(image[0]))]
    with fits.open(image) as hdus:
        sizes = [hdu.shape[::-1] for hdu in hdus if hdu.is_image and len(hdu.shape) == 2]
    if not sizes:
        raise ValueError(f"{image} holds no image; give the one that the PSF is for")
    return sizes


def psf_cube(model, out, image=None):
    """Write the PSF model of Piff or DAOPHOT in the file `model` as `out`, for PSF_TYPE FILE.

    image: name of the FITS image that it is for, or its shape (height, width); None: where the model's stars are. Chips
    are taken in the order of the images of that file. Errors: ValueError, OSError, with the name of the file.
    """
    if os.path.exists(out) and os.path.samefile(model, out):
        raise ValueError(f"{out} is also read, as the model; give the output another name")
    sizes = None if image is None else sizes_of(image)
    try:
        hdus = []
        for k, chip in enumerate(models_of(model)):
            high = chip.range[1]
            width, height = (int(np.ceil(high[0])), int(np.ceil(high[1]))) if sizes is None else sizes[min(k, len(sizes) - 1)]
            hdus.append(project(chip, max(width, 1), max(height, 1)))
    except (ValueError, TypeError, KeyError, IndexError, OSError, fits.VerifyError) as error:
        raise ValueError(f"{model}: {error.args[0] if error.args else 'cannot be read'}") from error
    temporary = f"{out}.{os.getpid()}.part"
    try:
        fits.HDUList([fits.PrimaryHDU()] + hdus).writeto(temporary, overwrite=True)
        os.replace(temporary, out)
    finally:
        if os.path.exists(temporary):
            os.unlink(temporary)


def main(arguments):
    if not 2 <= len(arguments) <= 3 or arguments[0].startswith("-"):
        print("usage: python3 -m rextract.psf_models MODEL OUT.fits [IMAGE.fits]", file=sys.stderr)
        return 2
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", fits.verify.VerifyWarning)
            psf_cube(*arguments)
    except (ValueError, OSError) as error:
        print(f"rextract.psf_models: {' '.join(str(error).split())}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
