"""The tiles that the scripts on noise and sky look at, and a run of the program on them (resampled.py,
low_frequencies.py, robustness.py).

RX_PROGRAM is the program (default: build/rextract, else rextract in the root), RX_MODEL the network's model (default:
config/psfnet.fits); rextract-simulate is the one beside the program. Keywords are those of validation/real/run.sh: gain,
zero point and saturation where the header lacks them, the PSF where the tile cannot tell it; all else has its default.
"""
import bz2
import os
import re
import shutil
import subprocess
import sys
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS
from scipy import ndimage
from scipy.spatial import cKDTree

warnings.filterwarnings("ignore")  # headers of old tiles are odd, and the program has its own say

TOP = Path(__file__).resolve().parent.parent
RESTORERS = ("NONE", "RL", "NET")
MARKS = 1 | 2  # FLAGS_RESTORE of src/data/sources.h: invented, shred
FLAGS = {1: "invented", 2: "shred", 4: "untested", 8: "added", 16: "other", 32: "unexplained", 64: "outside", 128: "structure",
         256: "sharp", 512: "light"}
COLUMNS = ("NUMBER X_IMAGE Y_IMAGE FLUX_AUTO FLUXERR_AUTO FWHM_IMAGE FLAGS FLAGS_RESTORE SNR_TEMPLATE CHI2_TEMPLATE "
           "FLUX_TEMPLATE FLUXERR_TEMPLATE")


@dataclass
class Tile:
    name: str
    kind: str
    pixels: np.ndarray
    header: fits.Header
    keywords: dict = field(default_factory=dict)
    weight: np.ndarray = None
    known: np.ndarray = None  # x, y (from 1) of what a catalogue from outside, or the simulator, says is there

    @property
    def mpixel(self):
        return self.pixels.size / 1e6

    def changed(self, name, pixels, **rest):
        return replace(self, name=name, pixels=pixels.astype(np.float32), **rest)


@dataclass
class Run:
    table: np.ndarray
    header: fits.Header
    images: dict
    said: list  # warnings of the log

    @property
    def marked(self):
        return (self.table["FLAGS_RESTORE"] & MARKS) > 0

    @property
    def positions(self):
        return np.column_stack([self.table["X_IMAGE"], self.table["Y_IMAGE"]]).astype(float)

    @property
    def fwhm(self):
        """Of the PSF (pixels), as restorers or templates had it; 0: not known."""
        return float(self.header.get("RXFWHM", self.header.get("RXTPFWHM", 0)))

    @property
    def reach(self):
        """What counts as the same place."""
        return max(2.0, self.fwhm)

    def cards(self):
        """What the header says of the tile: every RX card."""
        left_out = ("RXINPUT", "RXDIGEST", "RXINSUM")
        return {k: v for k, v in self.header.items() if k.startswith("RX") and k not in left_out}

    def flags(self):
        values = self.table["FLAGS_RESTORE"]
        names = {bit: FLAGS.get(bit, f"bit {bit}") for bit in 2 ** np.arange(16)}
        return {names[bit]: int((values & bit > 0).sum()) for bit in names if (values & bit > 0).any()}


class Program:
    """Runs of rextract in a folder, which keeps the last tile's files only."""

    def __init__(self, folder):
        places = [os.environ.get("RX_PROGRAM"), TOP / "build/rextract", TOP / "rextract"]
        self.path = next((Path(p).resolve() for p in places if p and Path(p).exists()), None)
        if self.path is None:
            sys.exit("no rextract; build first (./quickstart), or set RX_PROGRAM")
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        model = Path(os.environ.get("RX_MODEL", TOP / "config/psfnet.fits"))
        shutil.copy(model, self.folder / "psfnet.fits")  # named from inside the folder, so that no header holds a path
        (self.folder / "columns.param").write_text(COLUMNS.replace(" ", "\n") + "\n")
        (self.folder / "few.param").write_text("NUMBER\nX_IMAGE\nY_IMAGE\n")  # no templates

    def version(self):
        return subprocess.run([self.path, "-v"], capture_output=True, text=True).stdout.split("\n")[0]

    def call(self, program, arguments):
        done = subprocess.run([str(program), *map(str, arguments)], cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{program.name} {' '.join(map(str, arguments))}: exit status {done.returncode}\n{done.stderr}")
        return done.stderr

    def run(self, tile, restorers=RESTORERS, images=(), **keywords):
        """A Run for each restorer, with the check-images named."""
        fits.writeto(self.folder / "tile.fits", tile.pixels.astype(np.float32), tile.header, overwrite=True,
                     output_verify="silentfix")
        arguments = {"RESTORE_TYPE": ",".join(restorers), "NET_MODEL": "./psfnet.fits", "PARAMETERS_NAME": "columns.param",
                     "CATALOG_TYPE": "FITS_1.0", "CATALOG_NAME": "out.cat", **tile.keywords, **keywords}
        if tile.weight is not None:
            fits.writeto(self.folder / "weight.fits", tile.weight.astype(np.float32), overwrite=True)
            arguments |= {"WEIGHT_IMAGE": "weight.fits", "WEIGHT_TYPE": tile.keywords.get("WEIGHT_TYPE", "MAP_WEIGHT")}
        if images:
            files = [f"image{i}.fits" for i in range(len(images))]
            arguments |= {"CHECKIMAGE_TYPE": ",".join(images), "CHECKIMAGE_NAME": ",".join(files)}
        log = self.call(self.path, ["tile.fits[0]", *(a for k, v in arguments.items() for a in ("-" + k, v))])
        log = re.sub(r"/\S*/", "", log.replace("\nrextract:     ", " "))  # long lines go on in the next one; no folders
        said = sorted({re.sub(r"^rextract: warning: (tile\.fits\[0\]: )?", "", line) for line in log.splitlines()
                       if "warning" in line and "default.sex" not in line})
        runs = {}
        for r in restorers:
            end = f"_{r}" if len(restorers) > 1 else ""
            with fits.open(self.folder / f"out{end}.cat") as hdus:
                planes = {kind: fits.getdata(self.folder / f"image{i}{end}.fits").astype(float)
                          for i, kind in enumerate(images)}
                runs[r] = Run(np.array(hdus[1].data), hdus[1].header.copy(), planes, said)
        return runs

    def simulate(self, name, kind="simulated", **keywords):
        """A simulated tile that resembles an SDSS frame (validation/photometry.conf), with its truth."""
        base = {"IMAGE_SIZE": "1300,1000", "PIXEL_SCALE": 0.396, "MAG_ZEROPOINT": 22.5, "PSF_FWHM": 3.28, "SKY_LEVEL": 0.87,
                "NOISE_SIGMA": 0.031, "STAR_COUNT": 60, "STAR_MAG": "15,23", "STAR_SLOPE": 0.1, "GALAXY_COUNT": 200,
                "GALAXY_MAG": "16,23", "GALAXY_SLOPE": 0.4, "IMAGE_NAME": "sim.fits", "TRUTH_NAME": "truth.fits"}
        self.call(self.path.with_name("rextract-simulate"), [a for k, v in (base | keywords).items() for a in ("-" + k, v)])
        truth = fits.getdata(self.folder / "truth.fits", 1)
        pixels, header = fits.getdata(self.folder / "sim.fits", header=True)
        return Tile(name, kind, pixels.astype(np.float32), bare(header), {"MAG_ZEROPOINT": 22.5, "SATUR_LEVEL": 1e9},
                    known=np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]).astype(float))


def bare(header):
    """The header without what the simulator says of the PSF and noise: a real tile does not know."""
    return fits.Header([c for c in header.cards if not c.keyword.startswith("RX") and c.keyword not in
                        ("HISTORY", "COMMENT", "CHECKSUM", "DATASUM")])


def read(path):
    if path.suffix == ".bz2":
        return fits.HDUList.fromstring(bz2.decompress(path.read_bytes()))
    return fits.open(path, ignore_missing_simple=True)


USEFUL = re.compile(r"(CTYPE|CUNIT|CRVAL|CRPIX|CDELT|CROTA|CD\d|PC\d|PV\d|A_|B_|AP_|BP_|LONPOLE|LATPOLE|EQUINOX|RADE"
                    r"|GAIN|SATURATE|FWHM|EXPTIME|BUNIT|MAGZERO|TELESCOP|INSTRUME)")


def plain(path, name, kind, **keywords):
    hdus = read(path)
    hdu = next(h for h in hdus if h.data is not None and h.data.ndim == 2)
    header = hdu.header.copy()
    keep = [c for c in header.cards if USEFUL.match(c.keyword)]
    return Tile(name, kind, hdu.data.astype(np.float32), fits.Header(keep), {"PSF_TYPE": "AUTO", **keywords}), hdus


def sdss_frame(data):
    """The full SDSS frame, known: the deep Stripe 82 coadd and SDSS's own catalogue of the frame."""
    folder = data / "sdss/94-1-12"
    tile, hdus = plain(folder / "frame-r-000094-1-0012.fits.bz2", "SDSS frame", "as taken", SATUR_LEVEL=1e9,
                       MAG_ZEROPOINT=22.5)
    tile.keywords["GAIN"] = round(float(4.71 / np.median(hdus[1].data)), 3)  # electrons per count / nanomaggies per count
    rows = []
    for name in ("stripe82_coadd_catalog.fit", "photoObj-000094-1-0012.fits"):
        table = fits.getdata(folder / name, 1)
        rows.append((table["ra"], table["dec"]))
    ra, dec = map(np.concatenate, zip(*rows))
    return replace(tile, known=np.column_stack(WCS(hdus[0].header).all_world2pix(ra, dec, 1)))


def decam(data):
    path = data / "decam/c4d_171113_060340"
    tile, _ = plain(Path(f"{path}_ooi_r_ls9.N6.fits"), "DECam stamp", "as taken", PSF_TYPE="MOFFAT",
                    PSF_FWHM=4.023)  # of the header
    return replace(tile, weight=plain(Path(f"{path}_oow_r_ls9.N6.fits"), "", "")[0].pixels)


def pair(data, survey, galaxy, kind):
    """A cut-out of a stack: maggies, sky subtracted, with its noise map."""
    path = data / "pairs" / survey / galaxy
    tile, _ = plain(Path(f"{path}fitim.fits"), f"{survey} {galaxy}", kind, BACK_TYPE="MANUAL", BACK_VALUE=0,
                    MAG_ZEROPOINT=0, SATUR_LEVEL=1e9, GAIN=0, PSF_TYPE="FILE", PSF_NAME=f"{path}psfim.fits",
                    WEIGHT_TYPE="MAP_RMS", RESCALE_WEIGHTS="N")
    tile.header.remove("GAIN", ignore_missing=True)
    sigma = fits.getdata(f"{path}sigma.fits").astype(np.float32)
    return replace(tile, weight=sigma) if sigma.shape == tile.pixels.shape else None


def others(data):
    """Tiles that are looked at as they are: (name, what it is)."""
    fields, wide = data / "fields", {"SATUR_LEVEL": 1e9}
    return [
        plain(data / "sdss/reprojected_sdss_r.fits.bz2", "SDSS reprojected", "stacked", MAG_ZEROPOINT=22.5, **wide)[0],
        plain(fields / "aligned_eso085-030-004.fit", "ESO 085-030", "stacked")[0],
        *(t for g in ("G265911", "G266035", "G266662") for s in ("KiDS", "SDSS") if (t := pair(data, s, g, "stacked"))),
        plain(data / "templates/hst_147246_masknoise.fits", "HST COSMOS spiral", "drizzled", PSF_TYPE="FILE",
              PSF_NAME=data / "templates/hst_147246_psf.fits", **wide)[0],
        plain(fields / "spitzer_example_image.fits", "Spitzer IRAC", "mosaic", **wide)[0],
        plain(fields / "M6707HH.fits", "M67", "photographic")[0],
        plain(fields / "M13_blue_0001.fits", "M13", "as taken", PSF_TYPE="MOFFAT", PSF_FWHM=3)[0],
        plain(data / "sextractor/galaxies.fits", "galaxies", "as taken")[0],
    ]


def autocorrelation(image, usable, lags=8):
    """Of the usable pixels' deviations, clipped at 4 sigma: (2 lags + 1)^2 numbers, 1 in the middle."""
    values = np.where(usable, image, np.nan)
    center, spread = np.nanmedian(values), 1.4826 * np.nanmedian(abs(values - np.nanmedian(values)))
    good = np.isfinite(values) & (abs(values - center) < 4 * spread)
    values = np.where(good, values - (values[good].mean() if good.any() else 0), 0)
    out = np.zeros((2 * lags + 1,) * 2)
    height, width = values.shape
    for dy in range(lags + 1):
        for dx in range(-lags, lags + 1):
            a = np.s_[:height - dy, max(0, -dx):width - max(0, dx)]
            b = np.s_[dy:, max(0, dx):width + min(0, dx)]
            both = good[a] & good[b]
            out[lags + dy, lags + dx] = out[lags - dy, lags - dx] = (values[a] * values[b])[both].mean()
    return out / out[lags, lags]


def noise_facts(run):
    """Of a run with -BACKGROUND and SEGMENTATION: the noise beside the sources."""
    above = run.images["-BACKGROUND"]
    empty = ~ndimage.binary_dilation(run.images["SEGMENTATION"] > 0, iterations=4) & np.isfinite(above) & (above != 0)
    if empty.sum() < 2000:
        return {"empty": int(empty.sum())}
    rho, mid = autocorrelation(above, empty), 8
    far = (rho.sum() - rho[2:15, 2:15].sum()) / (17 ** 2 - 13 ** 2)  # of lags of 7 and 8: sky and faint sources, not noise
    core = rho[mid - 3:mid + 4, mid - 3:mid + 4] - far
    spread = np.median(abs(above[empty] - np.median(above[empty])))
    return {"empty": int(empty.sum()), "sigma": 1.4826 * float(spread),
            "lag 1": float((rho[mid, mid + 1] + rho[mid + 1, mid]) / 2),
            "factor": float(np.sqrt(max(core.sum(), 0) / (1 - far)))}


def near(positions, reference, radius):
    """Which positions have one of the reference within the radius."""
    if len(reference) == 0 or len(positions) == 0:
        return np.zeros(len(positions), bool)
    return np.isfinite(cKDTree(reference).query(positions, distance_upper_bound=radius)[0])
