#!/usr/bin/python3
"""Quality against time: NET with both supplied networks beside Richardson-Lucy, plain and accelerated, by its number of iterations.

    quality.py run FOLDER [SEED ...]    simulated tiles (seeds 401, 402): FOLDER/summary.json, page and figure
    quality.py page FOLDER              FOLDER/quality.md and quality.svg anew

REXTRACT and SIMULATE name the programs (default: those in build/). Nothing else should run meanwhile. Needs astropy, scipy, gnuplot.

What the columns mean

Tiles of 1024 x 1024 pixels, their lists and images are judged as by validation/iterations.py: average precision of the default
catalogue, PSNR of the restored image at the sharp truth's PSF. Seconds: of the restoration alone on one core, by the log, the least of
three runs of each tile, per Mpixel.
"""
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import crowded
import iterations
import ledger

MODELS = {"NET": "psfnet.fits", "fast NET": "psfnet-fast.fits"}
PLAIN, FAST = (5, 10, 20, 30, 50, 100, 200), (4, 6, 10, 18, 30, 50, 100)
REPEATS = 3
FIGURE = """set terminal svg size 1100,700 dynamic font 'sans-serif,12' background 'white'
set output 'quality.svg'
set multiplot layout 2,{n}
set logscale x
set xlabel 'seconds per Mpixel, one core'
set key bottom right
set grid
{plots}
"""


def jobs():
    """(series, label, arguments) of each point."""
    for name, model in MODELS.items():
        yield name, "", ("NET", "-NET_MODEL", crowded.TOP / "config" / model)
    for series, accelerate, numbers in (("RL", "N", PLAIN), ("accelerated RL", "Y", FAST)):
        for n in numbers:
            yield series, n, ("RL", "-RL_NITER", n, "-RL_ACCELERATE", accelerate)


def restore(folder, fwhm, arguments, *more):
    """Seconds of the restoration alone."""
    log = Path(folder) / "log"
    log.write_text("")
    iterations.extract(folder, fwhm, arguments, "-VERBOSE_TYPE", "FULL", *more)
    return float(re.findall(r"\]: \w+: seconds: restore ([0-9.]+)", log.read_text())[-1])


def campaign(out, *seeds):
    ledger.claim("quality", out, seeds)
    os.environ["RX_THREADS"] = "1"
    rows = []
    for seed in seeds or ("401", "402"):
        for fwhm in iterations.FWHMS:
            folder = os.path.abspath(f"{out}/{fwhm}-{seed}")
            os.makedirs(folder, exist_ok=True)
            iterations.make(folder, fwhm, seed)
            sharp = crowded.image(f"{folder}/sharp.fits")
            points = [{"seed": int(seed), "fwhm": fwhm, "series": series, "niter": n, "seconds": np.inf} for series, n, _ in jobs()]
            for repeat in range(1 + REPEATS):  # in turns: a machine that slows down does so for all; the first is not timed
                for row, (series, _, arguments) in zip(points, jobs()):
                    smooth = ("-RL_DENOISE", 2, "-RL_DENOISE_UNIT", "PIXEL") if repeat == 0 and series.endswith("RL") else ()
                    seconds = restore(folder, fwhm, arguments, *smooth) / 1.048576
                    if repeat > 0:
                        row["seconds"] = min(row["seconds"], seconds)
                    else:
                        image = crowded.image(f"{folder}/rl.fits")
                        row["psnr"] = iterations.psnr(image - np.median(image), sharp - np.median(sharp))
                    if repeat == 1:
                        row["ap"] = iterations.judge(folder, fwhm)["ap"]
            rows += points
            print(f"seed {seed}, FWHM {fwhm:g}: done", flush=True)
    crowded.keep(f"{out}/summary.json", rows)


def means(rows, fwhm):
    """[series, niter, seconds, AP, PSNR]: over the seeds, of seconds the least."""
    for series, n, _ in jobs():
        these = [r for r in rows if (r["fwhm"], r["series"], r["niter"]) == (fwhm, series, n)]
        if these:
            yield series, n, min(r["seconds"] for r in these), np.mean([r["ap"] for r in these]), np.mean([r["psnr"] for r in these])


def page(out):
    rows = json.loads((Path(out) / "summary.json").read_text())
    text = ["# Quality against time", "", f"Seeds {', '.join(map(str, sorted({r['seed'] for r in rows})))}.", "",
            "![PSNR and average precision against seconds](quality.svg)", ""]
    text += __doc__.split("What the columns mean")[1].strip().splitlines() + [""]
    plots = {"PSNR [dB]": [], "average precision": []}
    for fwhm in iterations.FWHMS:
        text += [f"## FWHM {fwhm:g} pixels", "", "| restorer | RL_NITER | seconds | AP | PSNR [dB] |", "| --- | --- | --- | --- | --- |"]
        lines = {}
        for series, n, seconds, ap, psnr in means(rows, fwhm):
            text.append(f"| {series} | {n} | {seconds:.3f} | {ap:.3f} | {psnr:.2f} |")
            lines.setdefault(series, []).append(f"{seconds:.5g} {psnr:.5g} {ap:.5g}")
        text.append("")
        for column, (what, those) in enumerate(plots.items()):
            blocks = "\n".join(f"${name} << EOD\n{chr(10).join(points)}\nEOD"
                               for name, points in zip(("a", "b", "c", "d"), lines.values()))
            drawn = ", ".join(f"${name} using 1:{column + 2} with linespoints pointtype 7 title '{series}'"
                              for name, series in zip(("a", "b", "c", "d"), lines))
            those.append(f"{blocks}\nset title 'FWHM {fwhm:g} pixels'\nset ylabel '{what}'\nplot {drawn}")
    (Path(out) / "quality.md").write_text("\n".join(text))
    script = FIGURE.format(n=len(iterations.FWHMS), plots="\n".join(one for those in plots.values() for one in those))
    subprocess.run(["gnuplot"], input=script, text=True, cwd=out, check=True)


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("run", "page"):
        sys.exit("usage: quality.py run FOLDER [SEED ...] | quality.py page FOLDER")
    if sys.argv[1] == "run":
        campaign(*sys.argv[2:])
    page(sys.argv[2])
