#!/usr/bin/python3
"""What happens on what no restorer is made for, and what the program says when it meets it.

    unhandled.py OUTPUT

A simulated frame like SDSS's (tiles.py), and the same with one thing more; no mask, no weight map tells of it:

    fringes         a sinusoidal pattern of amplitude 2 sigma and period 30 pixels
    trail           a satellite's trail across the tile, 6 sigma high, as wide as the PSF
    ghost           an optical ghost: a ring of radius 200 and width 40 pixels, 1 sigma high
    cosmic rays     200 hits per Mpixel, tracks of 1 to 12 pixels of 10 to 100 sigma, sharp
    bad column      a column at half the sky and one 30 sigma above it

False is a source without one of the truth within 2 pixels and within 1 FWHM (the larger of both). Into OUTPUT:
unhandled.md, and summary.json with every RX card; the table shows those that the thing has moved by more than a tenth,
warnings that the frame itself does not have, and marks of FLAGS_RESTORE.
"""
import json
import re
import sys
from pathlib import Path

import numpy as np

import tiles
from tiles import RESTORERS, near

SIGMA = 0.031  # of a pixel of the simulated frame
SAID = ("RXCHI2", "RXLAWS", "RXLAWP", "RXSIGMA", "RXDSIG", "RXFWHM", "RXFLXW", "RXTPCHI2", "RXNFACT",
        "RXBLKR")  # figures that may tell of it


def fringes(x, y, rng):
    return 2 * np.sin(2 * np.pi * (x + 0.4 * y) / np.hypot(1, 0.4) / 30)


def trail(x, y, rng):
    distance = (y - 0.37 * x - 120) / np.hypot(1, 0.37)
    return 6 * np.exp(-distance ** 2 / 2 / 1.4 ** 2)


def ghost(x, y, rng):
    radius = np.hypot(x - x.max() / 2, y - y.max() / 2)
    return 1.0 * (abs(radius - 200) < 20)


def cosmic_rays(x, y, rng):
    out = np.zeros(x.shape)
    height, width = x.shape
    for _ in range(int(200 * x.size / 1e6)):
        x0, y0 = rng.uniform(0, (width, height))
        angle, length, level = rng.uniform(0, np.pi), rng.integers(1, 13), rng.uniform(10, 100)
        for step in range(length):
            u, v = int(x0 + step * np.cos(angle)), int(y0 + step * np.sin(angle))
            if 0 <= u < width and 0 <= v < height:
                out[v, u] = level
    return out


def bad_column(x, y, rng):
    return np.where(x == 400, -0.5 * 0.87 / SIGMA, np.where(x == 900, 30, 0))


THINGS = {"fringes": fringes, "trail": trail, "ghost": ghost, "cosmic rays": cosmic_rays, "bad column": bad_column}


def words(message):
    return re.sub(r"[-+0-9.]+", "", message)


def told(run, first):
    """Which figures of the header are off those of the frame without the thing."""
    cards, before = run.cards(), first.cards()
    figures = {k: (cards[k], before.get(k)) for k in cards}
    moved = [f"{k} {value:.3g} ({was:.3g})" for k, (value, was) in figures.items()
             if k in SAID and isinstance(value, float) and isinstance(was, (int, float)) and abs(value - was) > 0.1 * abs(was)]
    switched = [f"{k} {value} ({was})" for k, (value, was) in figures.items()
                if isinstance(value, (bool, str)) and value != was and k not in ("RXPSF", "RXVERS", "RXSETT")]
    return moved + switched


def main(output):
    output = Path(output)
    program = tiles.Program(output)
    tile = program.simulate("frame")
    y, x = np.indices(tile.pixels.shape).astype(float)
    head = ["tile", "run", "sources", "false per Mpixel, unmarked", "marked", "of the frame's kept", "FLAGS_RESTORE",
            "header", "log"]
    text = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    first, found = {}, {}
    for name in ("frame", *THINGS):
        more = THINGS[name](x, y, np.random.default_rng(1)) if name != "frame" else 0
        runs = program.run(tile.changed(name, tile.pixels + SIGMA * more))
        first = first or runs
        found[name] = {}
        for r in RESTORERS:
            run, frame = runs[r], first[r]
            radius = frame.reach
            false = ~near(run.positions, tile.known, radius)
            own = frame.positions[near(frame.positions, tile.known, radius)]
            said = [s for s in run.said if words(s) not in map(words, frame.said)]
            a = {"sources": len(run.table), "false unmarked": float((false & ~run.marked).sum() / tile.mpixel),
                 "false marked": float((false & run.marked).sum() / tile.mpixel),
                 "kept": float(near(own, run.positions, radius).mean()), "flags": run.flags(),
                 "moved": told(run, frame), "log": said, "cards": run.cards()}
            found[name][r] = a
            marks = ", ".join(f"{k} {n}" for k, n in a["flags"].items())
            text.append(f"| {name} | {r} | {a['sources']} | {a['false unmarked']:.0f} | {a['false marked']:.0f} | "
                        f"{a['kept']:.3f} | {marks} | {', '.join(a['moved'])} | {'<br>'.join(said)} |")
            print(text[-1], flush=True)
    (output / "unhandled.md").write_text(f"`{program.version()}`\n\n" + "\n".join(text) + "\n")
    summary = {"version": program.version(), "tiles": found}
    (output / "summary.json").write_text(json.dumps(summary, indent=1, default=str) + "\n")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
