"""What the tests share: a tile of the repository, as a file and as arrays, and the program itself."""
import os
import shutil
import subprocess
import tempfile
import unittest
import warnings
from pathlib import Path

import numpy as np
from astropy.io import fits

SOURCES = Path(os.environ.get("srcdir") or Path(__file__).resolve().parents[2])
PROGRAM = os.environ.get("RX_PROGRAM") or shutil.which("rextract")
NETWORK = str(SOURCES / "config" / "psfnet.fits")
#: quick, and the same of the program and the package
KEYWORDS = {"RL_NITER": 6, "MAG_ZEROPOINT": 25, "PSF_TYPE": "MOFFAT", "PSF_FWHM": 4, "NTHREADS": 2}


def tile(side=192):
    """Part of the simulated tile: native float32 pixels, and its header."""
    with fits.open(SOURCES / "tests" / "data" / "sim.fits.fz") as file:
        header = file[1].header.copy()
        pixels = file[1].data[100:100 + side, 60:60 + side].astype(np.float32)
    header["CRPIX1"] -= 60
    header["CRPIX2"] -= 100
    for key in ("BZERO", "BSCALE", "BLANK"):
        header.remove(key, ignore_missing=True)
    return np.ascontiguousarray(pixels), header


class InFolder(unittest.TestCase):
    """Works in a folder of its own, with the tile in `tile.fits`."""

    @classmethod
    def setUpClass(cls):
        cls.pixels, cls.header = tile()

    def setUp(self):
        before, self.folder = os.getcwd(), tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder.name)
        quiet = warnings.catch_warnings()
        quiet.__enter__()
        self.addCleanup(quiet.__exit__, None, None, None)
        warnings.simplefilter("ignore")  # what is expected is asserted
        fits.writeto("tile.fits", self.pixels, self.header)

    def program(self, *arguments, **keywords):
        """Runs rextract; (exit code, last line of standard error)."""
        if PROGRAM is None:
            self.skipTest("no program rextract: RX_PROGRAM names none, and none is installed")
        command = [PROGRAM, *arguments]
        for name, value in keywords.items():
            command += [f"-{name}", str(value)]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        return done.returncode, (done.stderr.strip().splitlines() or [""])[-1]

    def assert_same(self, table, written):
        """Every value of a Table is that of a FITS table, to the bit."""
        self.assertEqual(table.colnames, written.names)
        for name in table.colnames:
            ours, theirs = np.asarray(table[name]), written[name]
            self.assertEqual(ours.dtype, theirs.dtype.newbyteorder("="), name)
            self.assertEqual(ours.shape, theirs.shape, name)
            self.assertEqual(ours.tobytes(), theirs.astype(ours.dtype).tobytes(), name)
