"""The numbers are those of the program; what goes in is read as it should be."""
import unittest
from pathlib import Path

import numpy as np
from astropy.io import fits
from astropy.nddata import (CCDData, InverseVariance, NDData, StdDevUncertainty, UnknownUncertainty,
                            VarianceUncertainty)
from astropy.wcs import WCS
from support import KEYWORDS, NETWORK, SOURCES, InFolder

import rextract


class AsTheProgram(InFolder):
    def catalogue(self, columns, **keywords):
        """What the program writes of the tile, with a restored image and a segmentation map."""
        Path("columns.param").write_text("\n".join(columns))
        code, said = self.program("tile.fits", PARAMETERS_NAME="columns.param", CATALOG_NAME="out.cat", CATALOG_TYPE="FITS_1.0",
                                  CHECKIMAGE_TYPE="RESTORED,SEGMENTATION", CHECKIMAGE_NAME="restored.fits,segments.fits",
                                  **{**KEYWORDS, **keywords})
        self.assertEqual(code, 0, said)
        return fits.getdata("out.cat", 1)

    def compare(self, columns, **keywords):
        written = self.catalogue(columns, **keywords)
        result = rextract.extract(self.pixels, header=self.header, columns=columns, **{**KEYWORDS, **keywords})
        self.assertGreater(len(written), 15)
        self.assert_same(result.table, written)
        np.testing.assert_array_equal(result.segments, fits.getdata("segments.fits"))
        restored, image = result.restored, fits.getdata("restored.fits")
        masked = np.isnan(image)  # the dead pixels of the tile, but for NONE
        self.assertTrue(np.all(restored[masked] == 0))
        np.testing.assert_allclose((restored + result.sky)[~masked], image[~masked], rtol=2e-7)
        return result

    def test_every_kind_of_column(self):
        result = self.compare(["NUMBER", "X_IMAGE", "ALPHA_J2000", "MAG_AUTO", "FLUX_APER(2)", "VIGNET(5,7)", "FLAGS",
                               "FLUX_RADIUS", "SNR_WIN"], PHOT_APERTURES="5,8")
        self.assertEqual(result.restorer, "RL")
        self.assertEqual(result.table["VIGNET"].shape[1:], (7, 5))
        self.assertEqual(str(result.table["ALPHA_J2000"].unit), "deg")
        self.assertEqual(result.table["MAG_AUTO"].meta["ucd"], "phot.mag;meta.main")
        self.assertEqual(result.table.meta["RXREST"], "RL")

    def test_templates_on_the_image_as_it_is(self):
        self.compare(["NUMBER", "FLUX_TEMPLATE", "FLUXERR_TEMPLATE", "P_REAL", "CLASS_TEMPLATE", "FLAGS_RESTORE"],
                     RESTORE_TYPE="NONE")

    def test_the_network(self):
        self.compare(["NUMBER", "X_IMAGE", "FLUX_AUTO", "FLAGS"], RESTORE_TYPE="NET", NET_MODEL=NETWORK)
        self.compare(["NUMBER", "X_IMAGE", "FLUX_AUTO", "FLAGS"], RESTORE_TYPE="AUTO", NET_MODEL=NETWORK)

    def test_a_file_by_the_same_keywords(self):
        self.catalogue(["NUMBER", "FLUX_AUTO"])
        rextract.run("tile.fits", PARAMETERS_NAME="columns.param", CATALOG_NAME="ours.cat", catalog_type="FITS_1.0",
                     **KEYWORDS)
        self.assertEqual(fits.getdata("ours.cat", 1).tobytes(), fits.getdata("out.cat", 1).tobytes())

    def test_a_configuration_file(self):
        Path("my.sex").write_text("RL_NITER 6\nDETECT_THRESH 4\nANALYSIS_THRESH 4\n")
        few = rextract.detect(self.pixels, header=self.header, config="my.sex", PSF_TYPE="MOFFAT", PSF_FWHM=4)
        same = rextract.detect(self.pixels, header=self.header, detect_thresh=4, ANALYSIS_THRESH=4.0, **KEYWORDS)
        many = rextract.detect(self.pixels, header=self.header, config="my.sex", DETECT_THRESH=1.5, **KEYWORDS)
        np.testing.assert_array_equal(few["FLUX_ISO"], same["FLUX_ISO"])
        self.assertGreater(len(many), len(few))


class WhatGoesIn(InFolder):
    def measure(self, image, **keywords):
        return rextract.measure(image, columns=["X_IMAGE", "FLUX_AUTO", "MASKED_FRACTION"], RESTORE_TYPE="NONE",
                                **{**KEYWORDS, **keywords})

    def assert_equal(self, a, b):
        for name in a.colnames:
            np.testing.assert_array_equal(a[name], b[name])

    def test_pixels_are_not_copied(self):
        result = rextract.restore(self.pixels, **KEYWORDS)
        library = int(rextract._library.ffi.cast("uintptr_t", result._memory.c.detect.tile.pixels))
        self.assertEqual(library, self.pixels.ctypes.data)
        one, other = np.asarray(result), result.restored
        self.assertEqual(one.ctypes.data, other.ctypes.data)
        self.assertFalse(one.flags.writeable)
        self.assertEqual(one.dtype, np.float32)

    def test_views_outlive_the_result(self):
        result = rextract.restore(self.pixels, **KEYWORDS)
        pixels, psf = np.asarray(result), result.psf
        before = pixels.copy()
        del result
        again = [rextract.restore(self.pixels, **KEYWORDS) for _ in range(2)]  # takes what was freed, had it been
        np.testing.assert_array_equal(pixels, before)
        self.assertAlmostEqual(float(psf(50, 50).sum()), 1.0, places=5)
        del again

    def test_any_array_of_numbers(self):
        expected = self.measure(self.pixels)
        for other in (self.pixels.astype(">f4"), self.pixels.astype(np.float64), np.asfortranarray(self.pixels),
                      np.repeat(self.pixels, 2, axis=1)[:, ::2], fits.PrimaryHDU(self.pixels)):
            self.assert_equal(self.measure(other), expected)

    def test_headers(self):
        whole = rextract.measure(self.pixels, columns=["ALPHA_J2000"], header=self.header, **KEYWORDS)
        by_wcs = rextract.measure(self.pixels, columns=["ALPHA_J2000"], header=WCS(self.header), **KEYWORDS)
        with fits.open("tile.fits") as file:
            hdu = rextract.measure(file[0], columns=["ALPHA_J2000"], **KEYWORDS)
        ccd = rextract.measure(CCDData.read("tile.fits", unit="adu"), columns=["ALPHA_J2000"], **KEYWORDS)
        without = rextract.measure(self.pixels, columns=["ALPHA_J2000"], **KEYWORDS)
        np.testing.assert_array_equal(whole["ALPHA_J2000"], hdu["ALPHA_J2000"])
        np.testing.assert_allclose(whole["ALPHA_J2000"], ccd["ALPHA_J2000"], rtol=0, atol=1e-9)
        # a WCS has no GAIN: nothing else than the sky is compared
        self.assertLess(abs(np.median(by_wcs["ALPHA_J2000"]) - np.median(whole["ALPHA_J2000"])), 0.01)
        self.assertTrue(np.all(np.isnan(without["ALPHA_J2000"])))

    def test_masks_and_not_a_number(self):
        bad = np.zeros(self.pixels.shape, dtype=bool)
        bad[30:150, 30:120] = True
        holes = np.where(bad, np.nan, self.pixels).astype(np.float32)
        expected = self.measure(self.pixels, mask=bad)
        self.assertLess(len(expected), len(self.measure(self.pixels)))
        self.assert_equal(self.measure(holes), expected)
        self.assertTrue(np.isnan(holes[50, 50]))
        self.assert_equal(self.measure(np.ma.MaskedArray(self.pixels, bad)), expected)
        self.assert_equal(self.measure(rextract.Image(self.pixels, mask=bad)), expected)

    def test_nddata(self):
        noise = np.full(self.pixels.shape, 5.0)
        noise[:60] *= 3
        bad = np.zeros(self.pixels.shape, dtype=bool)
        bad[30:150, 30:120] = True
        kinds = {"MAP_RMS": StdDevUncertainty(noise), "MAP_VAR": VarianceUncertainty(noise ** 2),
                 "MAP_IVAR": InverseVariance(noise ** -2)}
        for kind, uncertainty in kinds.items():
            expected = self.measure(self.pixels, weight=uncertainty.array, WEIGHT_TYPE=kind, mask=bad)
            self.assert_equal(self.measure(CCDData(self.pixels, unit="adu", uncertainty=uncertainty, mask=bad)), expected)
            self.assert_equal(self.measure(NDData(self.pixels, uncertainty=type(uncertainty)(uncertainty.array), mask=bad)), expected)
        meta = {"GAIN": 2.5, "history": ["a", "b"], "a long keyword": 1, "object": object()}
        sky = WCS(self.header)
        for image in (CCDData(self.pixels, unit="adu", meta=meta, wcs=sky), NDData(self.pixels, meta=meta, wcs=sky)):
            result = rextract.extract(image, columns=["ALPHA_J2000", "FLUXERR_AUTO"], RESTORE_TYPE="NONE", **KEYWORDS)
            same = rextract.extract(self.pixels, header=sky, GAIN=2.5, columns=["ALPHA_J2000", "FLUXERR_AUTO"],
                                    RESTORE_TYPE="NONE", **KEYWORDS)
            self.assert_equal(result.table, same.table)
        with self.assertRaisesRegex(rextract.UsageError, "set it to None"):
            self.measure(NDData(self.pixels, uncertainty=UnknownUncertainty(noise)))

    def test_files_are_not_images(self):
        for name in ("tile.fits", Path("tile.fits")):
            with self.assertRaisesRegex(rextract.UsageError, r"rextract.run\(\) reads files"):
                self.measure(name)
        with fits.open("tile.fits") as file, self.assertRaisesRegex(rextract.UsageError, "one of its HDUs"):
            self.measure(file)

    def test_weights(self):
        weight = np.ones_like(self.pixels)
        weight[:60] = 0
        fits.writeto("weight.fits", weight)
        Path("columns.param").write_text("X_IMAGE\nFLUX_AUTO\nMASKED_FRACTION\n")
        code, said = self.program("tile.fits", PARAMETERS_NAME="columns.param", CATALOG_NAME="out.cat", CATALOG_TYPE="FITS_1.0",
                                  RESTORE_TYPE="NONE", WEIGHT_TYPE="MAP_WEIGHT", WEIGHT_IMAGE="weight.fits", **KEYWORDS)
        self.assertEqual(code, 0, said)
        self.assert_same(self.measure(self.pixels, weight=weight, header=self.header), fits.getdata("out.cat", 1))

    def test_two_images(self):
        other = self.pixels + np.float32(50)
        fits.writeto("other.fits", other, self.header)
        Path("columns.param").write_text("X_IMAGE\nFLUX_AUTO\nFLUX_TEMPLATE\n")
        code, said = self.program("tile.fits,other.fits", PARAMETERS_NAME="columns.param", CATALOG_NAME="out.cat",
                                  CATALOG_TYPE="FITS_1.0", **KEYWORDS)
        self.assertEqual(code, 0, said)
        table = rextract.measure(other, header=self.header, detection=rextract.Image(self.pixels, header=self.header),
                                 columns=["X_IMAGE", "FLUX_AUTO", "FLUX_TEMPLATE"], **KEYWORDS)
        self.assert_same(table, fits.getdata("out.cat", 1))

    def test_a_psf_measured_once(self):
        psf = rextract.psf(self.pixels, header=self.header)
        self.assertAlmostEqual(psf.fwhm, 4.0, delta=0.4)  # of two stars: two of its errors
        self.assertEqual(psf(10.0, 20.0).shape, (psf.size, psf.size))
        self.assertAlmostEqual(float(psf(10.0, 20.0).sum()), 1.0, places=5)
        self.assertEqual(psf.stars.shape, (psf.nstars, 2))
        self.assertGreater(psf.nstars, 1)
        self.assertEqual(psf.facts["RXPSFNST"], psf.nstars)
        given = rextract.restore(self.pixels, psf=psf, RL_NITER=4)
        self.assertEqual(given.psf.fwhm, psf.fwhm)
        as_array = rextract.restore(self.pixels, psf=psf(96, 96), RL_NITER=4)
        self.assertAlmostEqual(as_array.psf.fwhm, psf.fwhm, delta=0.01)
        np.testing.assert_allclose(as_array.restored, given.restored, atol=0.5)

    def test_sky_and_noise(self):
        result = rextract.restore(self.pixels, **KEYWORDS)
        self.assertEqual(result.sky.shape, self.pixels.shape)
        self.assertAlmostEqual(float(np.median(result.sky)), 150.0, delta=1.0)
        self.assertAlmostEqual(float(np.median(result.noise)), 8.8, delta=0.5)

    def test_self_check(self):
        check = rextract.self_check(self.pixels, header=self.header, SELF_CHECK_COUNT=80, **KEYWORDS)
        self.assertEqual((check.n, len(check.injected)), (80, 80))
        self.assertEqual(check.found, int(np.sum(check.injected["FOUND"])))
        bins = check.completeness(1.0)
        self.assertEqual(int(bins["INJECTED"].sum()), 80)
        self.assertGreater(bins["SHARE"][0], bins["SHARE"][-1])
        self.assertLess(check.mag50[1], check.mag50[0])
        found = check.injected[check.injected["FOUND"] == 1]
        self.assertLess(abs(float(np.median(found["MAG_FOUND"] - found["MAG"]))), 0.3)

    def test_default_columns_of_each_call(self):
        keywords = {**KEYWORDS, "RESTORE_TYPE": "NONE"}
        for call, column in ((rextract.detect, "ISOAREA_IMAGE"), (rextract.measure, "MAG_AUTO"),
                             (rextract.templates, "P_REAL")):
            table = call(self.pixels, **keywords)
            self.assertGreater(len(table), 5)
            self.assertIn(column, table.colnames)
        self.assertEqual(rextract.detect(self.pixels, columns="NUMBER", **keywords).colnames, ["NUMBER"])


if __name__ == "__main__":
    unittest.main()
