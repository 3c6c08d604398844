"""Visits of one simulated field, and what rextract.survey.repeatability says of them against what was simulated."""
import math
import unittest
import warnings

import numpy as np
from astropy.io import fits
from astropy.table import Table

import rextract
from rextract.survey import repeatability
from support import InFolder

SIDE, NOISE, FLUX = 1000, 10.0, 10**4.4  # ADU; of a star of magnitude 14 at zero point 25
APERTURE = ("MAG_APER", "MAGERR_APER")
BRIGHT = {"columns": APERTURE, "snr": 100, "outlier": 10}
COLUMNS = ["ALPHAWIN_J2000", "DELTAWIN_J2000", *APERTURE, "MAG_AUTO", "MAGERR_AUTO", "CLASS_TEMPLATE", "FLAGS"]


def header(east=0.0):
    """One pixel is one arcsec; `east`: the coordinates are off by so much, in deg of right ascension."""
    return fits.Header({"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": 150 + east, "CRVAL2": 2.2, "CRPIX1": SIDE / 2,
                        "CRPIX2": SIDE / 2, "CDELT1": -1 / 3600, "CDELT2": 1 / 3600})


def field(fluxes, seed, apart=30):
    """Stars on a jittered grid, FWHM 4, without noise."""
    draw, n = np.random.default_rng(seed), SIDE // apart - 1
    pixels = np.full((SIDE, SIDE), 1000.0)
    y, x = np.mgrid[-12:13, -12:13]
    for k, flux in zip(range(n * n), fluxes):
        cx, cy = (apart * (1 + i) + draw.uniform(-apart / 6, apart / 6) for i in divmod(k, n))
        ix, iy = round(cx), round(cy)
        star = np.exp(-4 * math.log(2) / 16 * ((x - cx + ix) ** 2 + (y - cy + iy) ** 2))
        pixels[iy - 12:iy + 13, ix - 12:ix + 13] += flux * star / star.sum()
    return pixels


class Repeatability(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # an aperture of 20 pixels across holds 10^4.4 ADU with an error of 10 sqrt(314) = 177 ADU, 7.7 mmag. In the second visit it holds
        # 0.1 mag more, so that the error is 7.0 mmag, 7.3 in the mean; positions are off by 0.18 cos(2.2 deg) arcsec
        stars = field([FLUX] * 400, 26, 45) - 1000
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cls.skies = [(gain * stars + 1000 + np.random.default_rng(seed).normal(0, NOISE, stars.shape)).astype("f4")
                         for gain, seed in ((1, 1), (10**0.04, 2), (1, 3))]
            cls.headers = [header(), header(0.00005), header()]
            cls.a, cls.b, cls.c = (cls.catalogue(*visit) for visit in zip(cls.skies, cls.headers))

    keywords = {"RESTORE_TYPE": "NONE", "MAG_ZEROPOINT": 25, "PHOT_APERTURES": 20, "PSF_TYPE": "MOFFAT", "PSF_FWHM": 4,
                "BACK_TYPE": "MANUAL", "BACK_VALUE": 1000}

    @classmethod
    def catalogue(cls, pixels, head, **more):
        return rextract.measure(pixels, header=head, columns=COLUMNS, **{**cls.keywords, **more})

    def test_errors_of_bright_stars(self):
        """PA1, PF1, pulls and offsets are those of the noise and of what was shifted."""
        found = repeatability([self.a, self.b], **BRIGHT)
        row = found.pairs[1]
        self.assertGreater(row["bright"], 350)
        self.assertAlmostEqual(row["zero_point"], -0.1, delta=0.003)
        # errors of PA1 from n pairs: 7.3 / sqrt(0.74 n), by rms 7.3 / sqrt(2 n), here 0.42 and 0.26
        self.assertAlmostEqual(row["pa1"], 7.3, delta=1.2)
        self.assertAlmostEqual(row["pa1_rms"], 7.3, delta=0.8)
        self.assertAlmostEqual(row["claimed"], 7.3, delta=0.8)
        self.assertTrue(row["pa1_low"] < row["pa1"] < row["pa1_high"] < row["pa1"] + 3)
        self.assertAlmostEqual(row["pf1"], 0.17, delta=0.06)  # erfc(10 / 7.3 / sqrt 2)
        self.assertAlmostEqual(row["pull"], 1, delta=0.2)
        self.assertAlmostEqual(row["offset_east"], 179.87, delta=3)
        self.assertAlmostEqual(row["offset_north"], 0, delta=3)
        self.assertGreater(row["found"], 0.98)
        self.assertGreater(row["separations"], 1000)
        self.assertLess(abs(row["am1"] / row["east"] - math.sqrt(2)), 0.3)
        self.assertEqual(row["chance"], 0)
        self.assertEqual(str(found.pairs["pa1"].unit), "mmag")

    def test_three_visits(self):
        """All pairs, a row each and one of them all; each pair has its own offset."""
        found = repeatability([self.a, self.b, self.c], **BRIGHT)
        two = repeatability([self.a, self.b], **BRIGHT)
        self.assertEqual(len(found.pairs), 4)
        self.assertAlmostEqual(found.pairs[3]["zero_point"], 0.1, delta=0.003)
        self.assertAlmostEqual(found.pairs[0]["pa1"], 7.4, delta=0.8)
        self.assertAlmostEqual(found.pairs[0]["east"], two.pairs[0]["east"], delta=0.6)
        self.assertEqual(found.pairs[0]["matched"], sum(found.pairs["matched"][1:]))
        self.assertEqual([str(name) for name in found.visits["catalogue"]], ["visit 1", "visit 2", "visit 3"])

    def write(self, *numbers):
        for k in numbers:
            fits.writeto(f"{k}.fits", self.skies[k], self.headers[k])
        with open("param", "w") as file:
            file.write("\n".join(COLUMNS))

    def run_program(self, image, name, form):
        code, line = self.program(image, PARAMETERS_NAME="param", CATALOG_TYPE=form, CATALOG_NAME=name, **self.keywords)
        self.assertEqual(code, 0, line)

    def test_formats(self):
        """Catalogues of every format make the same pairs; FITS_LDAC says what the image sees."""
        self.write(0)
        wanted = repeatability([self.a, self.b], **BRIGHT).pairs[1]
        for form in ("FITS_LDAC", "FITS_1.0", "ASCII_HEAD", "ASCII_VOTABLE"):
            with self.subTest(form):
                self.run_program("0.fits", f"{form}.cat", form)
                found = repeatability([f"{form}.cat", self.b], **BRIGHT)
                self.assertEqual(found.pairs[1]["bright"], wanted["bright"])
                self.assertAlmostEqual(found.pairs[1]["pa1"], wanted["pa1"], delta=0.3)
                self.assertEqual(found.visits["footprint"][0], "size and world coordinates of its image" if form == "FITS_LDAC"
                                 else "hull of its sources")

    def test_half_a_field(self):
        """What lies outside of a visit is not missed, by its header and by the hull of its sources."""
        self.write(0, 1)
        self.run_program("0.fits", "a.cat", "FITS_LDAC")
        for form in ("FITS_LDAC", "FITS_1.0"):
            self.run_program(f"1.fits[1:{SIDE // 2},*]", form, form)
            found = repeatability(["a.cat", form], **BRIGHT)
            self.assertGreater(found.pairs[0]["found"], 0.97)
            whole = repeatability([self.a, self.b], **BRIGHT).limits[0]["seen"]
            self.assertTrue(whole / 3 < found.limits[0]["seen"] < whole * 2 / 3)

    def test_weight_map(self):
        """A masked visit looks incomplete without its weight map, and not with it."""
        weight = np.ones((SIDE, SIDE), "f4")
        weight[:, SIDE // 2:] = 0
        masked = rextract.measure(self.skies[1], header=self.headers[1], weight=weight, columns=COLUMNS, WEIGHT_TYPE="MAP_WEIGHT",
                                  **self.keywords)
        self.assertLess(len(masked), 0.6 * len(self.b))
        maps = [None, fits.ImageHDU(weight, self.headers[1])]
        self.assertGreater(repeatability([self.a, masked], weights=maps, **BRIGHT).pairs[0]["found"], 0.97)
        wide = masked.copy()  # without a map it sees the hull of its sources, here that of the whole field
        for k in (int(np.argmax(self.b["ALPHAWIN_J2000"] + s * self.b["DELTAWIN_J2000"])) for s in (-1, 1)):
            wide.add_row(self.b[k])
        for k in (int(np.argmin(self.b["ALPHAWIN_J2000"] + s * self.b["DELTAWIN_J2000"])) for s in (-1, 1)):
            wide.add_row(self.b[k])
        self.assertAlmostEqual(repeatability([self.a, wide], **BRIGHT).pairs[0]["found"], 0.66, delta=0.1)

    def test_faint_stars(self):
        """As many are found again as of those that were simulated, on the scale of the first visit."""
        mag = np.random.default_rng(4).uniform(17, 20.5, 1100)
        stars = field(10 ** (0.4 * (25 - mag)), 27)
        tables = [self.catalogue((stars + np.random.default_rng(seed).normal(0, NOISE, stars.shape)).astype("f4"), header(),
                                 MAG_ZEROPOINT=zero) for seed, zero in ((5, 25), (6, 27))]
        apart, n = 30, SIDE // 30 - 1
        draw, place = np.random.default_rng(27), []
        for k in range(n * n):
            place.append([apart * (1 + i) + draw.uniform(-apart / 6, apart / 6) for i in divmod(k, n)])
        from astropy.wcs import WCS
        x, y = WCS(header()).all_world2pix(tables[0]["ALPHAWIN_J2000"], tables[0]["DELTAWIN_J2000"], 0)
        place, simulated = np.array(place), mag[:n * n]
        found = np.array([np.hypot(x - px, y - py).min() < 3 for px, py in place])
        limits = repeatability(tables).limits
        for share in (90, 50):
            edges = np.arange(17, 20.6, 0.25)
            shares = np.array([found[(simulated >= low) & (simulated < low + 0.25)].mean() for low in edges[:-1]])
            true = edges[:-1][np.flatnonzero(shares >= share / 100)[-1]] + 0.25
            row = limits[0]
            self.assertAlmostEqual(row[f"mag{share}"], true, delta=0.4)
            self.assertTrue(row[f"mag{share}_low"] <= row[f"mag{share}"] <= row[f"mag{share}_high"])

    def test_what_is_written(self):
        numbers = repeatability([self.a, self.b], **BRIGHT)
        numbers.write("repeat")
        again = Table.read("repeat/pairs.ecsv")
        self.assertEqual(list(again["matched"]), list(numbers.pairs["matched"]))
        self.assertEqual(str(again["offset_east"].unit), "mas")

    def test_errors(self):
        table = self.a
        far = table.copy()
        far["ALPHAWIN_J2000"] += 20
        bare, plain = table.copy(), table.copy()
        bare.remove_column("DELTAWIN_J2000")
        plain.remove_columns([*APERTURE, "MAG_AUTO", "MAGERR_AUTO"])
        less = table.copy()
        less.remove_column("MAG_AUTO")
        flagged = table.copy()
        flagged["FLAGS"] = 1
        ones = np.ones((200, 200))
        for error, text, visits, keywords in (
                (rextract.UsageError, "1 named; give two catalogues or more", [table], {}),
                (rextract.UsageError, "a.cat is named twice; give each visit once", ["a.cat", "a.cat"], {}),
                (rextract.UsageError, "columns are two", [table, table], {"columns": ["MAG_AUTO"]}),
                (rextract.UsageError, "weights has 1 of 2 maps", [table, table], {"weights": [None]}),
                (rextract.InputError, "absent.cat: cannot be read: No such file", ["absent.cat", table], {}),
                (rextract.InputError, "no column of positions on the sky", [bare, table], {}),
                (rextract.InputError, "has no columns MAG_PSF and MAGERR_PSF; name existing ones", [table, table],
                 {"columns": ["MAG_PSF", "MAGERR_PSF"]}),
                (rextract.InputError, "has no magnitudes with errors", [plain, table], {}),
                (rextract.InputError, "has no column MAG_AUTO, which the first visit has", [table, less], {}),
                (rextract.InputError, "none of the 2 visits sees a source of another one", [table, far], {}),
                (rextract.InputError, "the visits overlap, but no source", [table, flagged], {}),
                (rextract.InputError, "has no world coordinates", [table, table], {"weights": [ones, ones]})):
            with self.subTest(text), self.assertRaisesRegex(error, text):
                repeatability(visits, **keywords)
        without = [one.copy() for one in (self.a, self.b)]
        for one in without:
            one.remove_column("CLASS_TEMPLATE")
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            self.assertGreater(repeatability(without, **BRIGHT).pairs[0]["bright"], 350)
        self.assertIn("all sources count as point sources", str(said[0].message))

    def test_matches_are_one_to_one_and_nearest_first(self):
        from rextract.survey import _match
        a = np.array([[0.0, 0.9, 10.0, math.nan], [0.0, 0.0, 0.0, 0.0]])
        b = np.array([[0.5, 0.8, 20.0, 11.0], [0.0, 0.0, 0.0, 0.0]])
        self.assertEqual(_match(a, b, 1.0).tolist(), [0, 1, 3, -1])


if __name__ == "__main__":
    unittest.main()
