#!/usr/bin/python3
"""What a whole survey costs, from the committed benchmark: validation/cost/cost.py [BENCH.md] >PAGE

Pixels of a survey come from published numbers, named below; seconds per Mpixel (1e6 pixels) on one core, and memory, from the
tables of validation/results/bench/full/bench.md. validation/results/cost/cost.md is its output. Standard library only.
"""
import os
import re
import sys

HERE = os.path.dirname(os.path.realpath(__file__))
BENCH = os.path.join(HERE, "..", "results", "bench", "full", "bench.md")
TILE = 4096 * 4096 / 1e6  # Mpixel, of the benchmark's whole stage and templates
DAY = 24.0  # hours
READ = 4.0  # bytes per pixel, a 32-bit float image
IMAGE = 4.0  # bytes per pixel, a restored image where it is kept
SOURCES, ROW = 1000, 200  # sources per Mpixel, bytes of a catalogue's row: what is written without images


def from_area(square_degrees, scale, images):
    """Pixels, of so many images of each place, from arcsec per pixel."""
    return square_degrees * (3600 / scale) ** 2 * images


SURVEYS = [
    ("SDSS, r band, 14,555 deg2", from_area(14555, 0.396, 1),
     "14,555 deg2 once, 0.396 arcsec a pixel; overlaps and repeats not counted",
     "area: abstract of Aihara et al. 2011, ApJS 193, 29; pixels: ssc.spitzer.caltech.edu/fls/extragal/sdss_prop_mosaic.html, and a "
     "field of 2048 pixels is 13 arcmin wide: www.sdss4.org/dr17/imaging/imaging_basics"),
    ("LSST, one night", 800 * 3.2e9,
     "800 visits, one image of 3.2e9 pixels each",
     "visits: README of github.com/lsst/rubin_sim, an average; pixels: abstract of Ivezic et al. 2019, ApJ 873, 111. That 10,000 deg2 in "
     "three nights, 9.6 deg2 a field, twice a night (ibid.) are 694"),
    ("CSST, seven bands, 17,500 deg2", from_area(17500, 0.074, 18),
     "17,500 deg2, 0.074 arcsec a pixel, 18 exposures of each place: NUV and y 4, u, g, r, i, z 2",
     "area: english.nao.cas.cn/research/researchdivisions/spacescience/202103/t20210321_265683.html; pixels: "
     "docs/source/sls/algorithm.rst of github.com/hypergravity/csst-doc-msc; exposures: as many as a filter has detectors, each of "
     "which passes over the place, csst/msc/backbone.py of github.com/csster/csst. With its 12 spectroscopic detectors and 2 bytes a "
     "pixel these are 2.5 PB; the page of the area says more than 3"),
]


class Bench:
    """Numbers of the page, by the first cell of their row."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in file if line.startswith("|")]
        self.rows = rows

    def numbers(self, first, cells):
        """Of the only row that begins with `first` and has so many cells."""
        found = [row for row in self.rows if row[0] == first and len(row) == cells]
        if len(found) != 1:
            raise SystemExit(f"cost.py: {len(found)} rows '{first}' of {cells} cells in the benchmark, 1 was expected")
        return [float(re.match(r"[0-9.]+", cell).group()) if re.match(r"[0-9]", cell) else None for cell in found[0][1:]]

    def step(self, name):
        """Seconds per Mpixel on one core."""
        return self.numbers(name, 4)[0] / TILE

    def way(self, kind):
        return sum(self.step(f"{kind} {part}") for part in ("restore", "detect", "measure"))

    def templates(self):
        """Sources, and the same of what they add, on one core."""
        found, without, full = self.numbers("NET", 6)[:3]
        return found / TILE, (full - without) / TILE

    def memory(self, what):
        return self.numbers(f"peak memory, {what}, 4k, over what is allowed", 6)[0]


def costs(bench):
    """(name, core seconds per Mpixel, MB) of each way to run it."""
    common = bench.step("read") + bench.step("background")
    psf = bench.step("NONE detect") + bench.step("NONE measure")
    return [("NONE", common + bench.way("NONE"), bench.memory("NONE")),
            ("RL", common + psf + bench.way("RL"), bench.memory("RL")),
            ("NET", common + psf + bench.way("NET"), bench.memory("NET")),
            ("NET and templates", common + psf + bench.way("NET") + bench.templates()[1], None)]


def page(bench):
    ways = costs(bench)
    found, _ = bench.templates()
    lines = ["# What a whole survey costs", "",
             "Written by `validation/cost/cost.py` from the [benchmark](../bench/full/bench.md): one tile to a core, of the kind of "
             "processor named there, at any time as many tiles as there are cores. Calculated, not run. NET is a network of one stage, as psfnet-fast.fits; [psfnet.fits takes longer](../../../docs/bench.md#quality-against-time).", "",
             "| | core seconds per Mpixel | memory of a process, 4096 x 4096 pixels |", "| --- | --- | --- |"]
    for name, seconds, memory in ways:
        lines.append(f"| {name} | {seconds:.3f} | {f'{memory:.0f} MB' if memory else 'see -PLAN'} |")
    lines += ["", "Seconds are those of the steps of a run on one core (table *The whole stage*): reading and background, restoration, "
              f"detection and measurement, on a tile where {found:.0f} sources per Mpixel are found (the SDSS frame of "
              "docs/validation.md: 193, unrestored): where there are fewer it takes less. For the PSF measured from the tile's stars one more detection and measurement is counted; the report against a "
              "reference catalogue is left out.", "",
              "| survey | pixels | | core hours | cores for one day | read, one day | written, the same with restored images |",
              "| --- | --- | --- | --- | --- | --- | --- |"]
    for survey, pixels, _, _ in SURVEYS:
        for i, (name, seconds, _) in enumerate(ways):
            hours = pixels / 1e6 * seconds / 3600
            plain = pixels * SOURCES * 1e-6 * ROW
            rate = pixels * READ / (DAY * 3600)
            images = f", {(plain + pixels * IMAGE) / 1e12:,.1f} TB" if name != "NONE" else ""
            lines.append(f"| {survey if i == 0 else ''} | {f'{pixels:.3g}' if i == 0 else ''} | {name} | {hours:,.0f} | "
                         f"{hours / DAY:,.1f} | {rate / 1e6:,.0f} MB/s | "
                         f"{plain / 1e12:,.2f} TB{images} |")
    lines += ["", f"Read: {READ:g} bytes a pixel. Written: catalogues with an assumed {SOURCES} sources per Mpixel of {ROW} bytes each, and {IMAGE:g} bytes "
              "a pixel where restored images are kept.", "", "| survey | pixels from | source |", "| --- | --- | --- |"]
    lines += [f"| {survey} | {how} | {source} |" for survey, _, how, source in SURVEYS]
    survey, pixels, how, _ = SURVEYS[0]
    name, seconds, _ = ways[2]
    lines += ["", f"A row by hand: {survey}, {name}: 14555 * (3600 / 0.396)^2 = {pixels:.4g} pixels = {pixels / 1e6:,.0f} Mpixel; times "
              f"{seconds:.4f} s = {pixels / 1e6 * seconds:.4g} s = {pixels / 1e6 * seconds / 3600:,.0f} core hours, "
              f"{pixels / 1e6 * seconds / 3600 / DAY:.1f} cores for one day."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(page(Bench(sys.argv[1] if len(sys.argv) > 1 else BENCH)))
