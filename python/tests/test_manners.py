"""Errors, warnings, progress, threads, memory; flags and Parquet."""
import gc
import logging
import os
import signal
import sys
import threading
import time
import unittest
import warnings
from pathlib import Path
from unittest import mock

import numpy as np
from support import KEYWORDS, InFolder

import rextract

try:
    import pyarrow.parquet
except ImportError:
    pyarrow = None


class Errors(InFolder):
    def assert_words(self, kind, call, *arguments, **keywords):
        """An exception of that class, with the program's exit code and words."""
        with self.assertRaises(kind) as caught:
            call()
        code, said = self.program(*arguments, **keywords)
        self.assertEqual(code, kind.status)
        self.assertEqual("rextract: " + str(caught.exception), said)
        return caught.exception

    def test_words_of_the_program(self):
        self.assert_words(rextract.UsageError, lambda: rextract.measure(self.pixels, DETECT_TRESH=3), "tile.fits",
                          DETECT_TRESH=3)
        self.assert_words(rextract.UsageError, lambda: rextract.measure(self.pixels, restore_type="BEST"), "tile.fits",
                          RESTORE_TYPE="BEST")
        err = self.assert_words(rextract.InputError, lambda: rextract.run("none.fits"), "none.fits")
        self.assertEqual((err.where, err.hdu, err.line), ("none.fits", None, None))
        Path("bad.sex").write_text("\nDETECT_THRESH many\n")
        err = self.assert_words(rextract.UsageError, lambda: rextract.measure(self.pixels, config="bad.sex"), "tile.fits", "-c",
                                "bad.sex")
        self.assertEqual((err.where, err.line), ("bad.sex", 2))
        self.assert_words(rextract.ResourceError, lambda: rextract.run("tile.fits", CATALOG_NAME="/proc/folder/out.cat"),
                          "tile.fits", CATALOG_NAME="/proc/folder/out.cat")

    def test_not_restored(self):
        flat = np.random.default_rng(1).normal(100, 5, (128, 128)).astype(np.float32)
        with self.assertRaises(rextract.NotRestoredError) as caught, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rextract.restore(flat, RESTORE_FALLBACK=False, name="flat")
        self.assertEqual(caught.exception.where, "flat")
        with self.assertRaises(rextract.InputError), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rextract.psf(flat)
        with self.assertRaisesRegex(rextract.InputError, "PSF is not known"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rextract.self_check(flat)

    def test_a_gate(self):
        from astropy.table import Table
        Table({"X_IMAGE": [10.0, 20.0], "Y_IMAGE": [10.0, 20.0], "MAG": [10.0, 10.0]}).write("truth.fits")
        Path("strict.qa").write_text("recall * >= 0.99 0.0\n")
        keywords = {"REFERENCE_NAME": "truth.fits", "QA_GATES": "strict.qa", "QA_FIGURES": "N", **KEYWORDS}
        code, said = self.program("tile.fits", **keywords)
        with self.assertRaises(rextract.Error) as caught:
            rextract.run("tile.fits", **{**keywords, "QA_FIGURES": False})
        self.assertEqual(caught.exception.status, code)
        self.assertEqual("rextract: " + str(caught.exception), said)

    def test_shapes(self):
        for bad in (self.pixels[0], np.empty((0, 5)), np.zeros((2, 3, 4)), self.pixels * 1j):
            with self.assertRaises(rextract.UsageError):
                rextract.measure(bad)
        with self.assertRaisesRegex(rextract.UsageError, "mask.*shape"):
            rextract.measure(self.pixels, mask=np.zeros((3, 3)))
        with self.assertRaisesRegex(rextract.UsageError, "upper and in lower"):
            rextract.measure(self.pixels, DETECT_THRESH=2, detect_thresh=3)
        with self.assertRaisesRegex(rextract.UsageError, "XYZ"):
            rextract.measure(self.pixels, columns=["XYZ"])
        with self.assertRaisesRegex(rextract.InputError, "NaN"):
            rextract.measure(np.full((50, 60), np.nan))
        with self.assertRaisesRegex(rextract.UsageError, "NUL"):
            rextract.run("a\0b.fits")
        with self.assertRaises(rextract.UsageError):
            rextract.run("@tiles.list")

    def test_every_class_has_its_code(self):
        kinds = [kind for kind in vars(rextract).values()
                 if isinstance(kind, type) and issubclass(kind, rextract.Error) and kind is not rextract.Error]
        self.assertEqual(sorted(kind.status for kind in kinds), list(range(2, 11)))

    def test_warnings_and_log(self):
        flat = np.random.default_rng(2).normal(100, 5, (128, 128)).astype(np.float32)
        with self.assertWarnsRegex(rextract.RextractWarning, "flat") as caught:
            result = rextract.restore(flat, name="flat")
        self.assertEqual(caught.filename, __file__)
        self.assertEqual(result.restorer, "NONE")
        self.assertIn("RXWHY", result.facts)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with self.assertRaises(rextract.RextractWarning):
                rextract.restore(flat)
        with self.assertLogs("rextract", logging.DEBUG) as log:
            rextract.restore(self.pixels, **KEYWORDS)
        self.assertTrue(any("seconds" in line for line in log.output))


class WhileItRuns(InFolder):
    def test_progress_rises(self):
        heard = []
        rextract.restore(self.pixels, progress=lambda what, done: heard.append((what, done)), **KEYWORDS)
        done = [share for _, share in heard]
        self.assertEqual(done, sorted(done))
        self.assertEqual(done[-1], 1.0)
        self.assertIn("restoration", [what for what, _ in heard])

    def test_an_exception_ends_the_call(self):
        def fails(what, done):
            if what == "restoration":
                raise KeyError("mine")
        with self.assertRaisesRegex(KeyError, "mine"):
            rextract.restore(self.pixels, progress=fails, **{**KEYWORDS, "RL_NITER": 100000})

    def test_stop(self):
        end = time.monotonic() + 0.5
        with self.assertRaises(rextract.Interrupted):
            rextract.restore(self.pixels, stop=lambda: time.monotonic() > end, **{**KEYWORDS, "RL_NITER": 100000})

    def test_ctrl_c(self):
        before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
        self.addCleanup(signal.signal, signal.SIGINT, before)
        timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
        self.addCleanup(timer.cancel)
        with self.assertRaises(KeyboardInterrupt):
            rextract.restore(self.pixels, progress=lambda what, done: what == "restoration" and not timer.ident and timer.start(),
                             **{**KEYWORDS, "RL_NITER": 100000})
        timer.join()

    def test_other_threads_run(self):
        """A thread counts while the library works, which a held lock would not let it, and ends the call by that."""
        counted = []

        def count():
            while len(counted) < 20:
                counted.append(time.monotonic())
                time.sleep(0.01)
        thread = threading.Thread(target=count)
        begun = time.monotonic()
        thread.start()
        with self.assertRaises(rextract.Interrupted):
            rextract.restore(self.pixels, stop=lambda: len(counted) >= 20 or time.monotonic() > begun + 60,
                             **{**KEYWORDS, "RL_NITER": 100000})
        thread.join()
        self.assertLess(counted[-1], begun + 60)

    def test_two_calls_at_once(self):
        expected = rextract.extract(self.pixels, header=self.header, **KEYWORDS)
        met, results = threading.Barrier(2, timeout=120), [None, None]
        where = [set(), set()]

        def work(k):
            def progress(what, done):
                where[k].add(threading.get_ident())
                if what == "restoration" and done == 0.1:
                    met.wait()  # both are in the midst of it
            results[k] = rextract.extract(self.pixels, header=self.header, progress=progress, **KEYWORDS)
        threads = [threading.Thread(target=work, args=(k,)) for k in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertFalse(met.broken)
        for k, result in enumerate(results):
            np.testing.assert_array_equal(result.restored, expected.restored)
            for name in expected.table.colnames:
                np.testing.assert_array_equal(result.table[name], expected.table[name])
            self.assertEqual(where[k], {threads[k].ident})  # callbacks come in the thread that called

    def test_files_at_once(self):
        def work(k):
            rextract.run("tile.fits", CATALOG_NAME=f"{k}.cat", **KEYWORDS)
        threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        rows = [[line for line in Path(f"{k}.cat").read_text().splitlines() if line[0] != "#"] for k in range(4)]
        self.assertGreater(len(rows[0]), 15)
        for k in range(1, 4):
            self.assertEqual(rows[k], rows[0])


def resident():
    """Bytes of memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@unittest.skipUnless(Path("/proc/self/statm").exists(), "no /proc")
class Memory(InFolder):
    def calls(self, n, pixels, psf):
        def fails(what, done):
            raise KeyError
        for i in range(n):
            result = rextract.extract(pixels, header=self.header, psf=psf, columns=["X_IMAGE", "FLUX_AUTO"],
                                      progress=lambda what, done: None, **{**KEYWORDS, "RL_NITER": 2})
            np.asarray(result).sum(), result.segments.max(), result.sky
            for refused in ({"DETECT_TRESH": 1}, {"progress": fails}):
                try:
                    rextract.extract(pixels, RESTORE_TYPE="NONE", **refused)
                except (rextract.UsageError, KeyError):
                    pass

    def test_200_calls_leave_nothing(self):
        pixels = np.ascontiguousarray(self.pixels[:96, :96])
        psf = rextract.psf(pixels, PSF_TYPE="MOFFAT", PSF_FWHM=4)
        self.calls(60, pixels, psf)  # until the heap has the size that it keeps
        gc.collect()
        held, count = resident(), sys.getrefcount(pixels)
        self.calls(200, pixels, psf)
        gc.collect()
        self.assertEqual(sys.getrefcount(pixels), count)
        # a plane of float32 that stayed with each call would be 7.4 MB, a mask 1.8 MB
        self.assertLess(resident() - held, 1.5e6)


class Flags(unittest.TestCase):
    def test_sextractor(self):
        self.assertEqual([flag.name for flag in rextract.decode_flags(19)], ["CROWDED", "MERGED", "APERTURE"])
        self.assertEqual(rextract.decode_flags(0), [])
        self.assertEqual(rextract.decode_flags(np.int16(4))[0].meaning, "at least one pixel is saturated")

    def test_ours(self):
        self.assertEqual([flag.bit for flag in rextract.decode_flags(129, "flags_restore")], [1, 128])
        self.assertEqual(rextract.decode_flags(128, "FLAGS_TEMPLATE")[0].name, "EXTRA")

    def test_what_is_none(self):
        for value, column in ((256, "FLAGS"), (-1, "FLAGS"), (4, "FLAGS_WEIGHT"), (1, "MAG_AUTO")):
            with self.assertRaises(rextract.UsageError):
                rextract.decode_flags(value, column)


class Parquet(InFolder):
    @unittest.skipIf(pyarrow is None, "pyarrow is not installed")
    def test_units_and_facts(self):
        import json
        table = rextract.measure(self.pixels, header=self.header, columns=["NUMBER", "MAG_AUTO", "FLUX_APER(2)", "ALPHA_J2000"],
                                 PHOT_APERTURES=[5, 8], **KEYWORDS)
        rextract.to_parquet(table, "out.parquet")
        read = pyarrow.parquet.read_table("out.parquet")
        self.assertEqual(read.num_rows, len(table))
        field = read.schema.field("MAG_AUTO")
        self.assertEqual(field.metadata[b"unit"], b"mag")
        self.assertEqual(field.metadata[b"ucd"], b"phot.mag;meta.main")
        self.assertIn(b"Kron", field.metadata[b"description"])
        self.assertEqual(json.loads(read.schema.metadata[b"rextract"])["RXREST"], "RL")
        np.testing.assert_array_equal(read["FLUX_APER"].to_pylist(), table["FLUX_APER"])
        np.testing.assert_array_equal(read["ALPHA_J2000"].to_numpy(), table["ALPHA_J2000"])

    def test_what_pyarrow_is_given(self):
        """By one that stands in for it and notes it down."""
        given = mock.MagicMock()
        given.array.side_effect = lambda values, mask: mock.Mock(values=values, mask=mask, type=values.dtype)
        given.FixedSizeListArray.from_arrays.side_effect = lambda data, n: mock.Mock(values=data.values, n=n, type="list")
        table = rextract.measure(self.pixels, header=self.header, columns=["MAG_AUTO", "FLUX_APER(2)"], PHOT_APERTURES=[5, 8],
                                 **KEYWORDS)
        table["SWAPPED"] = np.ma.MaskedArray(np.arange(len(table), dtype=">f8"), np.arange(len(table)) == 1)
        with mock.patch.dict(sys.modules, {"pyarrow": given, "pyarrow.parquet": given.parquet}):
            rextract.to_parquet(table, "out.parquet", compression="zstd")
            with self.assertRaisesRegex(rextract.UsageError, "VIGNET"):
                rextract.to_parquet(rextract.measure(self.pixels, columns=["VIGNET(3,3)"], **KEYWORDS), "out.parquet")
        fields = {call.args[0]: call.kwargs["metadata"] for call in given.field.call_args_list}
        self.assertEqual(fields["MAG_AUTO"]["unit"], "mag")
        self.assertIn("Kron", fields["MAG_AUTO"]["description"])
        self.assertEqual(fields["SWAPPED"], {})
        arrays = given.Table.from_arrays.call_args.args[0]
        self.assertEqual([array.values.dtype.isnative for array in arrays], [True] * 3)
        self.assertEqual((arrays[1].n, arrays[1].values.size), (2, 2 * len(table)))
        self.assertEqual(list(np.flatnonzero(arrays[2].mask)), [1])
        self.assertEqual(given.parquet.write_table.call_args.kwargs, {"compression": "zstd"})
        self.assertIn('"RXREST": "RL"', given.schema.call_args.kwargs["metadata"]["rextract"])

    @unittest.skipIf(pyarrow is not None, "pyarrow is installed")
    def test_without_pyarrow(self):
        with self.assertRaisesRegex(ImportError, "pip install pyarrow"):
            rextract.to_parquet(rextract.detect(self.pixels, **KEYWORDS), "out.parquet")
        self.assertFalse(Path("out.parquet").exists())


if __name__ == "__main__":
    unittest.main()
