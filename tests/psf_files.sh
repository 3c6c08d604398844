#!/bin/sh
# PSFs that others made, those of Piff and DAOPHOT by way of the Python package (rextract.psf_models), held against an evaluation of each file in NumPy or against an analytic profile, through the PSF
# that CHECKIMAGE_TYPE PSF writes; that one is read back by ourselves and by the real source-extractor. Files of Piff,
# WebbPSF and STScI are written here in their layouts; that of DAOPHOT is IRAF's own (tests/data/make_daophot.cl).
set -u
top=$(cd "${srcdir:-$(dirname "$0")/..}" && pwd)
. "$top/tests/lib.sh"
need rextract rextract-simulate
python=
for candidate in python3 /usr/bin/python3; do
    "$candidate" -c 'import astropy.io.fits, numpy, scipy' 2>/dev/null && python=$candidate && break
done
[ -n "$python" ] || {
    skip 'files of PSFs' 'python3 with astropy and scipy is not installed'
    finish
}
enter

cat >files.py <<'END'
"""files.py make | files.py compare NAME: PSF files of all kinds, and what they say on pixels of the tile."""
import sys

import numpy as np
from astropy.io import fits
from scipy.special import erf

W, H, TOP = 200, 180, sys.argv[1]
PLACES = [(1, 1), (100, 90), (200, 180), (31.5, 150), (180, 12)]  # FITS pixels


def gauss(side, step, sigma, dx=0.0, dy=0.0, pixel=0.0):
    """Of sum 1 in steps of `step` pixels of the tile, collected in squares of `pixel`."""
    def line(d):
        at = (np.arange(side) - (side - 1) / 2) * step - d
        if pixel == 0:
            return np.exp(-0.5 * (at / sigma) ** 2)
        edge = np.sqrt(0.5) / sigma
        return erf((at + pixel / 2) * edge) - erf((at - pixel / 2) * edge)
    image = np.outer(line(dy), line(dx))
    return image / image.sum()


def on_tile(side, step, sigma, dx=0.0, dy=0.0):
    """What pixels of the tile collect of gauss(side, step, sigma), cut where its frame ends."""
    return gauss(side, 1, sigma, dx, dy, 1.0)


def sigma_at(x, y):
    return 1.6 + 0.3 * (x / W) + 0.2 * (y / H) ** 2


def lanczos(d, n):
    return np.where(np.abs(d) < n, np.sinc(d) * np.sinc(d / n), 0)


# --- Piff ---

def sky(x, y, order=0):
    """u, v of a pixel (arcsec), and the derivatives: a rotated, distorted plane."""
    a, b = x - 90, y - 80
    u = 40 - 0.05 * a + 0.26 * b + 3e-5 * a * b
    v = -25 - 0.27 * a - 0.04 * b + 2e-5 * a * a
    jacobian = [[-0.05 + 3e-5 * b, 0.26 + 3e-5 * a], [-0.27 + 4e-5 * a, -0.04 + 0 * b]]
    return u, v, jacobian


SIDE, SCALE = 17, 0.3


def piff_terms(kind):
    """Powers of u and v (or x and y) with an image each."""
    powers = [(0, 0)] if kind == "mean" else [(i, j) for i in range(3) for j in range(3) if i + j <= 2]
    u0, v0 = (100, 90) if kind == "xy" else (40, -25)
    span = 100 if kind == "xy" else 30
    images = {}
    for i, j in powers:
        offsets = 0 if kind == "old" else 0.15 * i - 0.1 * j
        image = gauss(SIDE, SCALE, 0.42 + 0.05 * i, offsets, 0.5 * offsets) - (i + j > 0) * gauss(SIDE, SCALE, 0.42)
        images[i, j] = image * (0.3 / span) ** (i + j)
    if kind != "mean":
        images[0, 0] = images[0, 0] + 0 * (u0 + v0)
    return images


def piff_grid(kind, x, y):
    u, v, _ = sky(x, y)
    a, b = (x, y) if kind == "xy" else (u, v)
    return sum(image * a**i * b**j for (i, j), image in piff_terms(kind).items())


def table(name, **columns):
    formats = {"f": "D", "i": "K", "U": "A"}
    made = []
    for key, value in columns.items():
        value = np.asarray(value)
        count = int(np.prod(value.shape[1:]))
        if value.dtype.kind == "U":
            width = value.dtype.itemsize // 4
            form = f"{count * width}A" if value.ndim > 1 else f"{width}A"
            dim = f"({width},{count})" if value.ndim > 1 else None
        else:
            form = f"{count}{formats[value.dtype.kind]}"
            dim = str(value.shape[:0:-1]).replace(" ", "") if value.ndim > 2 else None
        made.append(fits.Column(name=key, format=form, dim=dim, array=value))
    return fits.BinTableHDU.from_columns(made, name=name)


def piff(file, kind, prefix="psf", head=None):
    rng = np.random.default_rng(5)
    x, y = rng.uniform(1, W, 30), rng.uniform(1, H, 30)
    u, v, j = sky(x, y)
    tables = list(head or [])
    tables.append(table(prefix, type=["Simple"]))
    tables.append(table(prefix + "_stars", x=x, y=y, u=u, v=v, dudx=j[0][0] + 0 * x, dudy=j[0][1] + 0 * x,
                        dvdx=j[1][0] + 0 * x, dvdy=j[1][1] + 0 * x))
    model = dict(type=["PixelGrid"], scale=[SCALE], size=[SIDE])
    if kind != "old":
        model["interp"] = ["galsim.Lanczos(7, True, gsparams=galsim.GSParams(128,8192))"]
    tables.append(table(prefix + "_model", **model))
    images = piff_terms(kind)
    if kind == "rows":
        tables.append(table(prefix + "_interp", type=["Polynomial"], order=[2], poly_type=["poly"]))
        rows = [(p, i, j, image.ravel()[p]) for p in range(SIDE**2) for (i, j), image in images.items()]
        param, i, j, value = zip(*rows)
        solution = table(prefix + "_interp_solution", PARAM=param, U_EXPONENT=i, V_EXPONENT=j, COEFF=value)
        solution.header["NPARAM"] = SIDE**2
    elif kind == "mean":
        tables.append(table(prefix + "_interp", type=["Mean"]))
        solution = table(prefix + "_interp_solution", mean=images[0, 0].ravel())
    else:
        interp = dict(type=["BasisPolynomial"], order=[2])
        if kind == "xy":
            interp["keys"] = np.array([["y", "x"]])
        tables.append(table(prefix + "_interp", **interp))
        order = [(i, j) for i in range(3) for j in range(3) if i + j <= 2]
        if kind == "xy":  # the first key is y
            order = [(j, i) for i, j in order]
        q = np.array([images[p].ravel() for p in order]).T
        if kind == "old":  # without what sum 1 and centroid 0 determine
            keep = np.ones((SIDE, SIDE), bool)
            keep[SIDE // 2, SIDE // 2] = keep[SIDE // 2 + 1, SIDE // 2] = keep[SIDE // 2, SIDE // 2 + 1] = False
            q = q[keep.ravel()] / SCALE**2
        solution = table(prefix + "_interp_solution", q=q[None])
    tables.append(solution)
    if file is None:
        return tables
    fits.HDUList([fits.PrimaryHDU()] + tables).writeto(file, overwrite=True)


def piff_on_tile(kind, x, y, side):
    grid, n = piff_grid(kind, x, y), 3 if kind == "old" else 7
    middle = SIDE // 2
    if kind == "old":
        grid = grid / SCALE**2
        i, j = np.meshgrid(np.arange(SIDE) - middle, np.arange(SIDE) - middle)
        grid[middle, middle] = grid[middle + 1, middle] = grid[middle, middle + 1] = 0
        grid[middle + 1, middle], grid[middle, middle + 1] = -np.sum(j * grid), -np.sum(i * grid)
        grid[middle, middle] = 1 / SCALE**2 - grid.sum()
    (a, b), (c, d) = sky(x, y)[2]
    dy, dx = np.mgrid[:side, :side] - side // 2
    gu, gv = (a * dx + b * dy) / SCALE + middle, (c * dx + d * dy) / SCALE + middle
    at = np.arange(-12, SIDE + 12)
    wu, wv = (lanczos(g.ravel()[:, None] - at, n) for g in (gu, gv))
    wu, wv = (w[:, 12:-12] / w.sum(1)[:, None] for w in (wu, wv))
    return np.einsum("pj,ji,pi->p", wv, grid, wu).reshape(side, side)


# --- images and cubes ---

def mixture(x, y):
    """Exactly linear over the tile, at 4 samples a pixel, pixel response included."""
    return gauss(61, 0.25, 1.5, 0, 0, 1.0) * (1 - x / 400 - y / 500) + gauss(61, 0.25, 2.0, 0.3, 0, 1.0) * (
        x / 400) + gauss(61, 0.25, 1.2, 0, -0.2, 1.0) * (y / 500)


def cube_hdu(images):
    return fits.PrimaryHDU(np.array(images).astype("f4"))


def make():
    rng = np.random.default_rng(1)
    fits.writeto("blank.fits", rng.normal(100, 2, (H, W)).astype("f4"), overwrite=True)
    fits.writeto("large.fits", rng.normal(100, 2, (400, 400)).astype("f4"), overwrite=True)
    for kind in ("uv", "xy", "rows", "mean", "old"):
        piff(f"piff_{kind}.fits", kind)
    chips = [table("psf", type=["SingleChip"]), table("psf_chipnums", chipnums=[31, 7])]
    chips += piff(None, "uv", "psf_31") + piff(None, "xy", "psf_7")
    fits.HDUList([fits.PrimaryHDU()] + chips).writeto("chips.fits", overwrite=True)
    two = fits.HDUList([fits.PrimaryHDU()] + [fits.ImageHDU(rng.normal(100, 2, (H, W)).astype("f4")) for _ in range(2)])
    two.writeto("two.fits", overwrite=True)
    for step, side in ((4, 101), (4, 100), (5, 121), (3, 90), (2.5, 81)):
        hdu = cube_hdu(gauss(side, 1 / step, 1.3, 0.2, -0.1, 1 / step))
        hdu.header["OVERSAMP"] = step
        hdu.writeto(f"over_{step}_{side}.fits", overwrite=True)
    cube_hdu(gauss(101, 0.25, 1.3, 0.2, -0.1, 0.25)).writeto("silent.fits", overwrite=True)
    binned = cube_hdu(gauss(25, 1, 1.3, 0.2, -0.1, 1.0))
    binned.header["EXTNAME"], binned.header["OVERSAMP"] = "DET_DIST", 4
    binned.writeto("binned.fits", overwrite=True)
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(1, W, 5), np.linspace(1, H, 4)))
    places = fits.BinTableHDU.from_columns(
        [fits.Column("X_IMAGE", "D", array=x), fits.Column("Y_IMAGE", "E", array=y)])
    hdu = cube_hdu([gauss(31, 1, sigma_at(a, b), 0, 0, 1.0) * (1 + a / W) for a, b in zip(x, y)])
    fits.HDUList([hdu, places]).writeto("cube.fits", overwrite=True)
    jwst = cube_hdu([mixture(a, b) for a, b in zip(x, y)])
    jwst.header["OVERSAMP"], jwst.header["DET_SAMP"] = 4, 4
    for k, (a, b) in enumerate(zip(x, y)):
        jwst.header[f"DET_YX{k}"] = str((float(b) - 1, float(a) - 1))
    jwst.writeto("jwst.fits", overwrite=True)
    stsci = cube_hdu([mixture(a, b) for b in (1, 80, 180) for a in (1, 60, 130, 200)])
    stsci.header["NXPSFS"], stsci.header["NYPSFS"] = 4, 3
    for k, a in enumerate((1, 60, 130, 200)):
        stsci.header[f"IPSFX{k + 1:02d}"] = a
    for k, b in enumerate((1, 80, 180)):
        stsci.header[f"JPSFY{k + 1:02d}"] = b
    stsci.writeto("stsci.fits", overwrite=True)


# --- comparing ---

def written(file, x, y, extension=1):
    """A PSFEx model at a place, as GalSim's DES_PSFEx reads it, whose demands on the header are these."""
    hdu = fits.open(file)[extension]
    head, masks = hdu.header, hdu.data.field("PSF_MASK")[0]
    assert head["EXTNAME"] == "PSF_DATA" and head["POLNAXIS"] == 2 and head["POLNGRP"] == 1
    assert head["POLNAME1"] == "X_IMAGE" and head["POLNAME2"] == "Y_IMAGE"
    assert head["POLGRP1"] == head["POLGRP2"] == 1 and head["PSFNAXIS"] == 3
    degree = head["POLDEG1"]
    assert masks.shape == (head["PSFAXIS3"], head["PSFAXIS2"], head["PSFAXIS1"])
    assert head["PSFAXIS3"] == (degree + 1) * (degree + 2) // 2
    a, b = (x - head["POLZERO1"]) / head["POLSCAL1"], (y - head["POLZERO2"]) / head["POLSCAL2"]
    step = round(1 / head["PSF_SAMP"])  # 1 or 2, of which every second one is a pixel
    return np.tensordot([a**i * b**j for j in range(degree + 1) for i in range(degree + 1 - j)], masks, 1)[::step, ::step]


def wanted(name, x, y, side):
    if name.startswith("piff_"):
        return piff_on_tile(name[5:], x, y, side)
    if name in ("chips1", "chips2"):
        return piff_on_tile("uv" if name == "chips1" else "xy", x, y, side)
    if name.startswith("over_") or name in ("silent", "binned"):
        return gauss(side, 1, 1.3, 0.2, -0.1, 1.0)
    if name == "silent_n":  # interpolated only
        return gauss(side, 1, 1.3, 0.2, -0.1, 0.25)
    if name == "cube":
        return gauss(side, 1, sigma_at(x, y), 0, 0, 1.0)
    if name in ("jwst", "stsci"):
        half = side // 2
        return np.pad(mixture(x, y), 4)[34 - 4 * half:35 + 4 * half:4, 34 - 4 * half:35 + 4 * half:4]
    if name == "daophot":
        return fits.getdata(f"{TOP}/tests/data/daophot_{x:.0f}_{y:.0f}.fits").astype(float)
    raise SystemExit(f"nothing is known of {name}")


def compare(name, limit):
    worst = 0
    for x, y in [(30, 50), (350, 380)] if name == "daophot" else PLACES:
        found = written(f"{name}.psf", x, y, 2 if name == "chips2" else 1)
        want = wanted(name, x, y, found.shape[0])
        if want.shape[0] > found.shape[0]:  # the border, where nothing is
            edge = (want.shape[0] - found.shape[0]) // 2
            want = want[edge:-edge, edge:-edge]
        want = want / want.sum()
        worst = max(worst, abs(found - want).max() / want.max(), abs(found.sum() - 1))
    print(f"{name}: {worst:.2g} of the peak, at most {limit:g}")
    raise SystemExit(not worst < limit)


def layout(name, count):
    """The cards that readers of PSFEx's models ask for (SExtractor's psf.c, galsim's DES_PSFEx): two variables in one group,
    positions of FITS, (d + 1)(d + 2) / 2 images of an odd side, an effective PSF whose light is PSF_SAMP^-2."""
    hdu = fits.open(name)[1]
    head = hdu.header
    one = all(head[key] == 1 for key in ("POLNGRP", "POLGRP1", "POLGRP2")) and head["POLNAXIS"] == 2 and head["PSFNAXIS"] == 3
    names = head["POLNAME1"] == "X_IMAGE" and head["POLNAME2"] == "Y_IMAGE"
    degree, axes = head["POLDEG1"], [head[f"PSFAXIS{i}"] for i in (3, 2, 1)]
    masks = hdu.data["PSF_MASK"][0].reshape(axes).astype(float)
    x, y = 10.0, 20.0
    a, b = (x - head["POLZERO1"]) / head["POLSCAL1"], (y - head["POLZERO2"]) / head["POLSCAL2"]
    image = np.tensordot([a**i * b**j for j in range(degree + 1) for i in range(degree + 1 - j)], masks, 1)
    light, peak = image.sum() * head["PSF_SAMP"] ** 2, np.unravel_index(image.argmax(), image.shape)
    print(name, degree, axes, "light", light, "peak at", peak, head["PSF_SAMP"])
    raise SystemExit(not (one and names and axes[0] == (degree + 1) * (degree + 2) // 2 and axes[1] % 2 == 1 and axes[1] == axes[2]
                          and abs(light - 1) < 5e-3 and peak == (axes[1] // 2, axes[1] // 2) and head["PSF_SAMP"] == 1 / count))


def same(one, two, limit):
    """Two models say the same everywhere."""
    worst = max(abs(written(one, x, y) - written(two, x, y)).max() / written(two, x, y).max() for x, y in PLACES)
    print(f"{one} and {two}: {worst:.2g} of the peak, at most {limit:g}")
    raise SystemExit(not worst < limit)


GAUSS = dict(FUNCTION="gauss", VARORDER=0, NPARS=2, PAR1=1.0, PAR2=1.0, PSFHEIGH=1.0)
DAOPHOT = [
    (dict(FUNCTION="gauss", VARORDER=0), "no NPARS: not a PSF as IRAF's DAOPHOT writes it"),
    (GAUSS | dict(FUNCTION="cosine"), "FUNCTION 'cosine' of the DAOPHOT PSF is none of"),
    (GAUSS | dict(VARORDER=9), "VARORDER = 9 of the DAOPHOT PSF is not in -1 to 2"),
    (GAUSS | dict(VARORDER=2), "1 tables of 15 x 15 in a DAOPHOT PSF of VARORDER 2, which has 6"),
    (GAUSS | dict(VARORDER=-1), "no PSFRAD"),
    (GAUSS | dict(VARORDER=-1, PSFRAD=1e20), "a radius of 1e+20 pixels of the DAOPHOT PSF cannot be right"),
    (GAUSS | dict(FEXPAND=True), "the DAOPHOT PSF was made with fexpand"),
    (GAUSS | dict(PAR1=0.0), "PAR1 = 0 of the DAOPHOT PSF is not in"),
    (GAUSS | dict(PSFHEIGH=-1.0), "PSFHEIGH = -1 of the DAOPHOT PSF"),
    (GAUSS | dict(), "the tables of the DAOPHOT PSF hold values that are not numbers"),
    (GAUSS | dict(FUNCTION="lorentz", NPARS=3, PAR3=-2.0), "PAR3 = -2 of the DAOPHOT PSF opens the ellipse"),
]


def spoil():
    """Good files with one thing wrong, and what is to be said of each."""
    def change(name, hdu, column, value):
        def do(hdus):
            data = hdus[hdu].data
            if np.ndim(data[column]) > 1:
                data[column].flat[7] = value
            else:
                data[column][0] = value
        return name, do

    def without(name, *hdus):
        return name, lambda all: [all.__delitem__(h) for h in hdus]

    wrong = [
        (change("piff_uv", "psf_model", "type", "Moffat"), "model 'Moffat', of which only PixelGrid"),
        (change("piff_uv", "psf_model", "interp", "Cubic()"), "the interpolant 'Cubic()'"),
        (change("piff_uv", "psf_model", "interp", "Lanczos(99)"), "the interpolant 'Lanczos(99)'"),
        (change("piff_uv", "psf_model", "size", 10**9), "size = 1e+09 of the Piff file is not in 3 to 511"),
        (change("piff_uv", "psf_model", "size", 16), "no 256 x 6 coefficients q"),
        (change("piff_uv", "psf_model", "scale", np.nan), "scale = nan"),
        (change("piff_uv", "psf_model", "scale", 200), "cannot be right; was it made from this tile?"),
        (change("piff_uv", "psf_interp", "type", "GPInterp"), "the interpolation 'GPInterp'"),
        (change("piff_uv", "psf_interp", "order", 4000), "order = 4000"),
        (change("piff_uv", "psf_interp", "order", -1), "order = -1"),
        (change("piff_uv", "psf_interp_solution", "q", np.inf), "of the Piff file's grid is not a number"),
        (change("piff_uv", "psf_stars", "u", np.nan), "do not say where the sky is"),
        (change("piff_uv", "psf_stars", "v", 1e9), "do not say where the sky is"),
        (change("piff_uv", "psf", "type", "Sum"), "a PSF of the type 'Sum'"),
        (change("piff_xy", "psf_interp", "keys", "z"), "keys of the polynomial"),
        (change("piff_rows", "psf_interp_solution", "PARAM", 10**6), "row 1 of psf_interp_solution, value 1e+06"),
        (change("piff_rows", "psf_interp_solution", "U_EXPONENT", 99), "with powers 99"),
        (change("piff_rows", "psf_interp", "poly_type", "cheb"), "polynomials of the type 'cheb'"),
        (change("chips", "psf_chipnums", "chipnums", 12), "no table psf_12"),
        (without("piff_uv", "psf_stars"), "no table psf_stars"),
        (without("piff_uv", "psf_interp_solution"), "no table psf_interp_solution"),
        (change("cube", 1, "X_IMAGE", np.nan), "row 1 of the table of places holds no position"),
        (("cube", lambda h: h[0].data.__setitem__((3, 4, 5), np.nan)), "pixel (6,5) of plane 4 of the PSF image is not"),
        (("cube", lambda h: h[0].data.__setitem__(3, 0)), "the PSF image of plane 4 sums to 0"),
        (("cube", lambda h: h.__setitem__(0, cube_hdu(h[0].data[:7]))), "7 PSFs with a table of 20 places"),
        (without("cube", 1), "20 PSFs in a cube, and nothing says where"),
    ]
    for k, ((name, do), said) in enumerate(wrong):
        with fits.open(f"{name}.fits", memmap=False) as hdus:
            if name == "piff_xy":  # both keys
                hdus["psf_interp"].data["keys"][0][:] = "z"
            else:
                do(hdus)
            hdus.writeto(f"wrong{k}.fits", overwrite=True)
        print(f"wrong{k}.fits|{said}|{name}")
    for k, (head, said) in enumerate(DAOPHOT):
        hdu = cube_hdu(np.full((15, 15), np.nan if "not numbers" in said else 1.0)) if "PSFRAD" not in said else fits.PrimaryHDU()
        if "radius" in said:
            hdu = fits.PrimaryHDU()
        hdu.header.update(dict(PSFX=40.0, PSFY=40.0) | head)
        hdu.writeto(f"daophot{k}.fits", overwrite=True)
        print(f"daophot{k}.fits|{said}|daophot")
    for name in ("piff_uv", "cube", "piff_rows"):  # cut off anywhere
        whole = open(f"{name}.fits", "rb").read()
        for share in (0.2, 0.5, 0.8, 0.9):
            open(f"cut_{name}_{share}.fits", "wb").write(whole[:int(share * len(whole))])
            print(f"cut_{name}_{share}.fits||{name}")


def fluxes(ours, theirs, truth, limit):
    """Fluxes of SExtractor with the PSF that we wrote, and ours, of isolated stars of S/N above 200."""
    o, s, t = (fits.getdata(f, 1) for f in (ours, theirs, truth))
    rows = []
    for star in t:
        gap = np.sort(np.hypot(t["X_IMAGE"] - star["X_IMAGE"], t["Y_IMAGE"] - star["Y_IMAGE"]))[1]
        found = []
        for c in (o, s):
            d = np.hypot(c["X_IMAGE"] - star["X_IMAGE"], c["Y_IMAGE"] - star["Y_IMAGE"])
            found.append(c[d.argmin()] if len(d) and d.min() < 1 else None)
        inside = 25 < star["X_IMAGE"] < 675 and 25 < star["Y_IMAGE"] < 675
        if gap > 15 and inside and None not in found and found[0]["FLUX_TEMPLATE"] > 200 * found[0]["FLUXERR_TEMPLATE"]:
            rows.append((found[1]["FLUX_PSF"] / found[0]["FLUX_TEMPLATE"] - 1,
                         found[1]["FLUX_POINTSOURCE"] / found[0]["FLUX_TEMPLATE"] - 1, found[1]["SPREAD_MODEL"],
                         found[0]["FLUX_TEMPLATE"] / star["FLUX"] - 1))
    rows = np.array(rows)
    print(len(rows), "stars; mean", rows.mean(0), "largest", abs(rows).max(0))
    raise SystemExit(not (len(rows) >= 8 and (abs(rows.mean(0)) < (limit, limit, 2e-4, 8e-3)).all()
                          and (abs(rows).max(0)[:3] < (3 * limit, 3 * limit, 1e-3)).all()))


if sys.argv[2] == "make":
    make()
elif sys.argv[2] == "spoil":
    spoil()
elif sys.argv[2] == "fluxes":
    fluxes(*sys.argv[3:6], float(sys.argv[6]))
elif sys.argv[2] == "field":  # the PSF of a tile of 700 pixels that varies and has wings
    width = float(sys.argv[3])
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(1, 700, 5), np.linspace(1, 700, 5)))
    sigma = [width * (1.6 + 0.3 * a / 700 + 0.2 * (b / 700) ** 2) for a, b in zip(x, y)]
    cube = cube_hdu([0.9 * gauss(41, 1, s, 0, 0, 1.0) + 0.1 * gauss(41, 1, 2.2 * s, 0, 0, 1.0) for s in sigma])
    places = fits.BinTableHDU.from_columns([fits.Column("X", "D", array=x), fits.Column("Y", "D", array=y)])
    fits.HDUList([cube, places]).writeto("field.fits", overwrite=True)
elif sys.argv[2] == "layout":
    layout(sys.argv[3], int(sys.argv[4]))
elif sys.argv[2] == "same":
    same(sys.argv[3], sys.argv[4], float(sys.argv[5]))
else:
    compare(sys.argv[3], float(sys.argv[4]))
END
files() { "$python" -W ignore files.py "$top" "$@"; }
files make || exit 2

# psf NAME TILE ARGUMENT...: the PSF of a file, as NAME.psf
psf() {
    name=$1 tile=$2
    shift 2
    "$programs/rextract" "$tile" -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF \
        -CHECKIMAGE_NAME "$name.psf" -PSF_TYPE FILE "$@" >"$name.log" 2>&1
}

# holds NAME LIMIT WHAT TILE ARGUMENT...
holds() {
    name=$1 limit=$2 what=$3
    shift 3
    psf "$name" "$@" && ! grep -q warning "$name.log" && files compare "$name" "$limit" >>"$name.log" 2>&1
    result "$what" $? "$name.log"
}
# models MODEL OUT [IMAGE]: what the Python package makes of a model of Piff or DAOPHOT
models() { "$python" -W ignore "$top/python/rextract/psf_models.py" "$@" >models.log 2>&1 || cat models.log >&2; }
models "$top/tests/data/daophot.psf.fits" daophot.model.fits large.fits
holds daophot 1e-4 "DAOPHOT's penny2 with VARORDER 2 is IRAF's seepsf" large.fits -PSF_NAME daophot.model.fits
for kind in uv xy rows mean old; do
    models piff_$kind.fits piff_$kind.model.fits blank.fits
    holds piff_$kind 2e-4 "Piff's PixelGrid, $kind" blank.fits -PSF_NAME piff_$kind.model.fits
done
models chips.fits chips.model.fits two.fits
holds chips1 2e-4 'the first of several chips' two.fits -PSF_NAME chips.model.fits
cp piff_uv.psf with_image.psf && models piff_uv.fits stars.model.fits && psf piff_uv blank.fits -PSF_NAME stars.model.fits && files compare piff_uv 2e-4 >stars.log 2>&1
result 'a Piff model without its image: the range of its stars' $? stars.log
cp with_image.psf piff_uv.psf
cp chips1.psf chips2.psf && files compare chips2 2e-4 >chips2.log 2>&1
result 'the second of several chips' $? chips2.log
for kind in 4_101 4_100 5_121 3_90; do
    holds over_$kind 3e-4 "an image of ${kind%_*} samples a pixel, ${kind#*_} wide, is integrated over pixels" blank.fits -PSF_NAME over_$kind.fits
done
holds over_2.5_81 3e-3 'an image of 2.5 samples a pixel' blank.fits -PSF_NAME over_2.5_81.fits
holds silent 3e-4 'PSF_SAMPLING where the header says nothing' blank.fits -PSF_NAME silent.fits -PSF_SAMPLING 4
holds silent_n 1e-4 'PSF_INTEGRATE N' blank.fits -PSF_NAME silent.fits -PSF_SAMPLING 4 -PSF_INTEGRATE N
holds binned 1e-5 'an image that is binned already' blank.fits -PSF_NAME binned.fits
holds cube 2e-3 'a cube with a table of places, between them' blank.fits -PSF_NAME cube.fits
holds jwst 1e-5 "WebbPSF's grid" blank.fits -PSF_NAME jwst.fits
holds stsci 1e-5 "STScI's grid of effective PSFs" blank.fits -PSF_NAME stsci.fits

# what is written is read back the same, by either word
psf again blank.fits -PSF_TYPE PSFEX -PSF_NAME piff_uv.psf && files same again.psf piff_uv.psf 2e-6 >>again.log 2>&1
result 'what is written is read back the same' $? again.log
psf either blank.fits -PSF_NAME piff_uv.psf && files same either.psf again.psf 1e-12 >>either.log 2>&1
result 'PSF_TYPE FILE reads a PSFEx model' $? either.log
# files with one thing wrong: one line that says what, and never a PSF
files spoil >wrong.list || exit 2
ok=0
while IFS='|' read -r file said name; do
    case $name in
    cube)
        psf broken blank.fits -PSF_NAME "$file" -VERBOSE_TYPE QUIET
        code=$? whose=rextract
        ;;
    *)
        "$python" -W ignore "$top/python/rextract/psf_models.py" "$file" broken.fits blank.fits >broken.log 2>&1
        code=$? whose=rextract.psf_models
        ;;
    esac
    [ $code -eq 3 ] && [ "$(wc -l <broken.log)" -eq 1 ] && grep -qF "$whose: $file" broken.log && grep -qF -- "$said" broken.log &&
        [ ! -e broken.fits ] && continue
    ok=1
    echo "$file: exit $code, expected 3 and '$said'" >>wrong.log
    cat broken.log >>wrong.log
done <wrong.list
result 'files with one thing wrong are refused, each by a line that says it' $ok wrong.log

# what other readers ask for, of a wide PSF that varies and of a narrow one; and of a PSF that was measured
files layout piff_uv.psf 1 >layout.log 2>&1
result 'cards for the readers of PSFEx models: PSF_SAMP 1' $? layout.log
for width in 3.3 2.2; do
    { "$programs/rextract-simulate" -c /dev/null -IMAGE_NAME auto.fits -TRUTH_NAME auto_truth.fits -IMAGE_SIZE 700 -PSF_FWHM $width -PSF_RATIO 0.9 \
        -STAR_COUNT 250 -STAR_MAG 13,18 -GALAXY_COUNT 0 -NOISE_SIGMA 5 &&
        "$programs/rextract" auto.fits -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE NONE -CHECKIMAGE_TYPE PSF \
            -CHECKIMAGE_NAME auto_$width.psf && files layout auto_$width.psf "$([ $width = 2.2 ] && echo 2 || echo 1)"; } >layout.log 2>&1
    result "cards of a measured PSF of FWHM $width" $? layout.log
done

# the PSF of a tile for the real SExtractor, from its own simulation
if command -v source-extractor >/dev/null; then
    printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLUX_TEMPLATE FLUXERR_TEMPLATE >ours.param
    printf '%s\n' NUMBER X_IMAGE Y_IMAGE FLUX_PSF FLUX_POINTSOURCE SPREAD_MODEL >theirs.param
    for width in '1.0 2e-3' '0.45 4e-3'; do
        { files field "${width% *}" && "$programs/rextract-simulate" -c /dev/null -IMAGE_SIZE 700 -PSF_TYPE FILE -PSF_NAME field.fits -STAR_COUNT 250 \
            -STAR_MAG 13,19 -GALAXY_COUNT 0 -NOISE_SIGMA 5 &&
            "$programs/rextract" sim.fits -c /dev/null -RESTORE_TYPE NONE -PSF_TYPE FILE -PSF_NAME field.fits -CATALOG_TYPE FITS_1.0 \
                -CATALOG_NAME ours.fits -PARAMETERS_NAME ours.param -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME field.psf &&
            source-extractor sim.fits -c /dev/null -PARAMETERS_NAME theirs.param -FILTER N \
                -PSF_NAME field.psf -CATALOG_TYPE FITS_1.0 -CATALOG_NAME theirs.fits -DETECT_THRESH 5 -VERBOSE_TYPE QUIET &&
            files fluxes ours.fits theirs.fits sim_truth.fits "${width#* }"; } >sextractor.log 2>&1
        result "SExtractor reads the PSF: FLUX_PSF and FLUX_POINTSOURCE are our FLUX_TEMPLATE, width and limit $width" $? sextractor.log
    done
    { "$programs/rextract" auto.fits -c /dev/null -RESTORE_TYPE NONE -CATALOG_TYPE FITS_1.0 -CATALOG_NAME ours.fits -PARAMETERS_NAME ours.param &&
        source-extractor auto.fits -c /dev/null -PARAMETERS_NAME theirs.param -FILTER N -PSF_NAME auto_2.2.psf -CATALOG_TYPE FITS_1.0 \
            -CATALOG_NAME theirs.fits -DETECT_THRESH 5 -VERBOSE_TYPE QUIET &&
        files fluxes ours.fits theirs.fits auto_truth.fits 5e-3; } >sextractor.log 2>&1
    result 'SExtractor reads a measured PSF, FWHM 2.2' $? sextractor.log
else
    skip 'the PSF in SExtractor' 'source-extractor is not installed'
fi

# a run with it can be repeated, byte by byte
"$programs/rextract" two.fits -c /dev/null -RESTORE_TYPE NONE -PSF_TYPE FILE -PSF_NAME chips.model.fits -CATALOG_NAME c.fits -CATALOG_TYPE FITS_1.0 \
    -CHECKIMAGE_TYPE PSF -CHECKIMAGE_NAME two.psf >record.log 2>&1 && "$programs/rextract" -c two.psf -CATALOG_NAME again.fits -CHECKIMAGE_NAME again.psf >>record.log 2>&1
result 'the record of a PSF repeats it' $? record.log
finish
