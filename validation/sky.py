#!/usr/bin/python3
"""How far the sky that the program takes off is from the truth, with BACK_PASSES 1 and 2.

    sky.py OUTPUT

Simulated frames like tiles.py's (1.3 Mpixel, FWHM 3.28 pixels, noise 0.031), stars of magnitude 15 to 24 and galaxies of 16
to 24 in several densities; the noise of a pixel is that of a star of 25.2. `steps`: rounded to a fifth of the noise, as the
counts of a detector are. Of three frames each: mean of (sky taken off - truth) over all pixels and rms around that mean, in
units of the noise, and the noise measured over the true one. The seeds served no choice. Exit status 1 where the second
pass leaves more than half of what is off, and more than 0.005. Into OUTPUT: sky.md, summary.json.
"""
import json
import sys
from pathlib import Path

import numpy as np

import tiles

SKY, NOISE, STEP, SEEDS, LEAST = 0.87, 0.031, 0.2, (601, 602, 603), 0.005
SCENES = [(0, 0, 0), (100, 100, 0), (300, 300, 0), (1000, 1000, 0), (3000, 3000, 0), (300, 6000, 0), (0, 0, STEP), (300, 300, STEP)]


def measured(program, tile, passes):
    run = program.run(tile, ("NONE",), ("BACKGROUND", "BACKGROUND_RMS"), PARAMETERS_NAME="few.param", BACK_PASSES=passes)["NONE"]
    off = (run.images["BACKGROUND"] - SKY) / NOISE
    return off.mean(), off.std(), np.median(run.images["BACKGROUND_RMS"]) / NOISE


def main(output):
    program = tiles.Program(output)
    head = ["stars, galaxies per Mpixel", "passes", "sky - truth", "rms around it", "noise / truth"]
    text = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    found, holds = {}, True
    for stars, galaxies, step in SCENES:
        name = f"{stars}, {galaxies}" + (", steps" if step else "")
        frames = [program.simulate(name, SEED=seed, STAR_COUNT=stars, STAR_MAG="15,24", STAR_SLOPE=0.2,
                                   GALAXY_COUNT=galaxies, GALAXY_MAG="16,24") for seed in SEEDS]
        if step:
            frames = [f.changed(f.name, np.round(f.pixels / (step * NOISE)) * step * NOISE) for f in frames]
        for passes in (1, 2):
            mean, rms, noise = np.mean([measured(program, f, passes) for f in frames], axis=0)
            found.setdefault(name, {})[passes] = {"mean": mean, "rms": rms, "noise": noise}
            text.append(f"| {name} | {passes} | {mean:+.4f} | {rms:.3f} | {noise:.3f} |")
        holds &= abs(found[name][2]["mean"]) <= max(LEAST, abs(found[name][1]["mean"]) / 2)
    print("\n".join(text))
    (Path(output) / "sky.md").write_text(f"`{program.version()}`\n\n" + "\n".join(text) + "\n")
    (Path(output) / "summary.json").write_text(json.dumps({"version": program.version(), "scenes": found}, indent=1) + "\n")
    return not holds


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1]))
