#!/usr/bin/python3
"""Which tiles the program says the network was not made for, and whether rightly.

    domain.py FOLDER_OF_DATA OUTPUT

NET, RL and NONE at default settings (tiles.py) on real tiles as they are, the SDSS frame resampled, and simulated ones
like it: as many sources as it has, few, none, one star of 1e5 sigma alone, noise smoothed by Gaussians of FWHM 1, 2 and
2.35 pixels (rms of a pixel unchanged), and a frame with a dark cloud 1 sigma deep. Into OUTPUT: domain.md, summary.json.

    noise       RXNETNOI, the noise level of the tile (src/nn/noise_level.h); factor: RXNFACT, wide: RXNWIDE
    warned      RXNETIN F and why, RXNOISOK F, a dark sky; marked: sources with FLAGS_RESTORE 64, 128
    false       of the simulated ones: sources per Mpixel that no mark of invented ones is on and that are not of the
                truth; recall: share of the truth that is found, by NONE, RL and NET
    RXBLKR      false per Mpixel of the tile's own noise by the program's account; RXUNEX: share of cells not explained
"""
import json
import sys
from pathlib import Path

import numpy as np
from scipy import ndimage

import tiles
from resampled import WAYS, resampled
from tiles import RESTORERS, near

SIGMA, FWHM = 0.031, {"PSF_TYPE": "MOFFAT", "PSF_FWHM": 3.28}


def simulated(program):
    """(tile, what it is made for)"""
    rng = np.random.default_rng(2)

    def simulate(name, **keywords):
        tile = program.simulate(name, **keywords)
        return tile.changed(name, tile.pixels, keywords=tile.keywords | FWHM)

    frame = simulate("simulated frame")
    yield frame
    yield simulate("simulated, 5 stars, 15 galaxies", STAR_COUNT=5, GALAXY_COUNT=15)
    yield simulate("simulated, faint alone (21 to 24 mag)", STAR_MAG="21,24", GALAXY_MAG="21,24", STAR_COUNT=200)
    empty = simulate("simulated, nothing", STAR_COUNT=0, GALAXY_COUNT=0)
    yield empty
    y, x = np.indices(empty.pixels.shape)
    star = (1 + (np.hypot(x - 650, y - 500) / 2.9) ** 2) ** -3.5  # Moffat of FWHM 3.28
    yield empty.changed("simulated, one star of 1e5 sigma", empty.pixels + 1e5 * SIGMA * star, known=np.array([[651., 501.]]))
    light = simulate("", NOISE_TYPE="NONE")
    for fwhm in (1, 2, 2.3548):
        noise = ndimage.gaussian_filter(rng.standard_normal(light.pixels.shape), fwhm / 2.3548, mode="wrap")
        yield light.changed(f"simulated, noise of FWHM {fwhm:.3g} px", light.pixels + SIGMA * noise / noise.std())
    cloud = np.exp(-(((x - 400) / 110) ** 2 + ((y - 600) / 60) ** 2) / 2)
    yield frame.changed("simulated, a dark cloud", frame.pixels - SIGMA * cloud, keywords=frame.keywords | {
        "BACK_TYPE": "MANUAL", "BACK_VALUE": 0.87})


def real(data):
    frame = tiles.sdss_frame(data)
    yield frame
    for way in WAYS:
        tile, _ = resampled(frame, way)
        yield tile.changed(f"{frame.name}, {way}", tile.pixels)
    yield tiles.decam(data)
    yield from tiles.others(data)
    yield from (tiles.plain(path, path.stem, "photographic")[0] for path in sorted((data / "wcs").glob("1904-66_*.fits")))


def main(data, output):
    output = Path(output)
    program = tiles.Program(output)
    head = ["tile", "done by", "FWHM", "noise", "factor", "wide", "warned", "marked", "false: NONE, RL, NET", "recall: NONE, RL, NET",
            "RXBLKR", "RXUNEX", "RXDARK"]
    text, rows = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"], []
    for tile, known in [(t, True) for t in simulated(program)] + [(t, False) for t in real(Path(data))]:
        runs = program.run(tile)
        run, h = runs["NET"], runs["NET"].header
        false, recall = [], []
        for r in RESTORERS if known else ():
            far = ~near(runs[r].positions, tile.known, runs[r].reach) & ~runs[r].marked
            false.append(f"{far.sum() / tile.mpixel:.0f}")
            recall.append(f"{near(tile.known, runs[r].positions, runs[r].reach).mean():.3f}" if len(tile.known) else "")
        warned = ([h["RXNETWHY"]] if h.get("RXNETIN") in (False, "F") else []) + ["structure"] * (h.get("RXNOISOK") in (False, "F")) + [
            "dark sky" for s in run.said if "lie below the sky" in s]
        marks = run.flags()
        figure = lambda key, form: format(h[key], form) if isinstance(h.get(key), (int, float)) else ""
        row = [tile.name, h["RXREST"], figure("RXNETFW", ".2f"), figure("RXNETNOI", ".2f"), figure("RXNFACT", ".2f"),
               figure("RXNWIDE", ".2f"), "; ".join(warned), f"{marks.get('outside', 0)}, {marks.get('structure', 0)} of {len(run.table)}",
               ", ".join(false), ", ".join(recall), figure("RXBLKR", ".1f"), figure("RXUNEX", ".3f"), figure("RXDARK", ".3f")]
        rows.append(dict(zip(head, row)))
        text.append("| " + " | ".join(row) + " |")
        print(text[-1], flush=True)
    (output / "domain.md").write_text(f"`{program.version()}`\n\n" + "\n".join(text) + "\n")
    (output / "summary.json").write_text(json.dumps({"version": program.version(), "tiles": rows}, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
