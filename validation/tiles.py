"""Tiles, simulated and real, and a run of the program on them (pixels.py, psf.py, robustness.py).

RX_PROGRAM is the program (default: build/rextract, else rextract in the root), RX_MODEL the network's model (default:
config/psfnet.fits); rextract-simulate is the one beside the program. Keywords are those of validation/restorers.sh: gain,
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
from scipy.spatial import cKDTree

warnings.filterwarnings("ignore")  # headers of old tiles are odd, and the program has its own say

TOP = Path(__file__).resolve().parent.parent
RESTORERS = ("NONE", "RL", "NET")
MARKS = 1 | 2  # FLAGS_RESTORE of src/data/sources.h: invented, shred
FLAGS = {1: "invented", 2: "shred", 4: "untested", 8: "added", 16: "other", 32: "unexplained", 64: "outside", 128: "structure",
         256: "sharp"}
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
                     "CATALOG_TYPE": "FITS_1.0", "HEADER_FACTS": "ALL", "CATALOG_NAME": "out.cat", **tile.keywords, **keywords}
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


def near(positions, reference, radius):
    """Which positions have one of the reference within the radius."""
    if len(reference) == 0 or len(positions) == 0:
        return np.zeros(len(positions), bool)
    return np.isfinite(cKDTree(reference).query(positions, distance_upper_bound=radius)[0])
