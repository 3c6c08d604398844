#!/usr/bin/python3
"""What RESTORE_TYPE AUTO takes, beside what NONE, RL and NET find on the same tile.

    auto.py FOLDER [SEED [NAME[,NAME...]]]      seed 81, all skies

Skies: the departures of robustness.py, and twelve pieces of the SDSS frame, of 512 x 496 pixels, against the deep coadd of the same sky.
score = (objects found - false sources) / objects, of objects of S/N 5 and more by the truth, of magnitude 22.5 and less on the frame; sources with FLAGS_RESTORE
1 or 2 do not count. A choice is right where no other restorer's score is higher by more than two errors, the root of the number of
objects that one of them alone finds and of the false sources of both. FOLDER gets auto.md and auto.json. RX_PROGRAM, RX_MODEL as in tiles.py.
"""
import os
import sys
import time

import numpy as np
from astropy.io import fits

import ledger
import robustness
import tiles
from tiles import MARKS, RESTORERS, near

DEEP, LIMIT, PIECES = 5, 22.5, (4, 3)
CARDS = ("RXREST", "RXWHY", "RXMODEL", "RXFLXOK", "RXMISFIT", "RXDARK")


def simulated(program, seed, names):
    for departure in robustness.DEPARTURES:
        if departure.tiles == 1 and (not names or departure.name in names):
            tile, truth, width = robustness.expose(program, departure, seed, 0)
            at, _, snr, _, _ = robustness.objects(truth, width, tile.pixels)
            yield tile, departure.what or departure.name, at, snr > DEEP, max(2.0, 2.3548 * width)


def frame(names):
    data = tiles.Path(os.environ.get("RX_SHARED_DATA", tiles.TOP / "../shared/data"))
    if not data.is_dir() or (names and "SDSS" not in names):
        return
    whole = tiles.sdss_frame(data)
    deep = fits.getdata(data / "sdss/94-1-12/stripe82_coadd_catalog.fit", 1)
    magnitude = np.full(len(whole.known), 99.0)  # of what other catalogues have: there, but not to be found
    magnitude[:len(deep)] = deep["psfmag_r"]
    w, h = whole.pixels.shape[1] // PIECES[0], whole.pixels.shape[0] // PIECES[1]
    for k in range(PIECES[0] * PIECES[1]):
        x, y = k % PIECES[0] * w, k // PIECES[0] * h
        tile = whole.changed(f"SDSS {k + 1}", whole.pixels[y:y + h, x:x + w])
        tile.header = fits.Header()
        yield tile, "real frame", whole.known - [x, y], magnitude < LIMIT, 3.3


def counts(run, at, wanted, reach, shape):
    """Of the wanted objects inside, which are found; how many sources are false."""
    positions = run.positions[(run.table["FLAGS_RESTORE"] & MARKS) == 0]
    inside = lambda p: ((p > robustness.EDGE) & (p < np.array(shape[::-1]) - robustness.EDGE)).all(1)
    here = wanted & inside(at)
    return near(at[here], positions, reach), int((~near(positions, at, reach) & inside(positions)).sum())


def ahead(a, b):
    """By how many errors."""
    differ = (a[0] != b[0]).sum() + a[1] + b[1]
    return (a[0].sum() - a[1] - b[0].sum() + b[1]) / np.sqrt(max(differ, 1))


def main(folder, seed, names):
    ledger.claim("auto", folder, [seed])
    program, rows = tiles.Program(folder), []
    (program.folder / "auto.param").write_text("NUMBER\nX_IMAGE\nY_IMAGE\nMAG_AUTO\nFLAGS_RESTORE\n")  # no templates
    for tile, what, at, wanted, reach in (*simulated(program, seed, names), *frame(names)):
        runs, seconds = {}, {}
        for r in (*RESTORERS, "AUTO"):
            begun = time.time()
            runs |= program.run(tile, (r, ), PARAMETERS_NAME="auto.param", NTHREADS=1)
            seconds[r] = round(time.time() - begun, 2)
        of = {r: counts(runs[r], at, wanted, reach, tile.pixels.shape) for r in RESTORERS}
        took = runs["AUTO"].cards()["RXREST"]
        n = max(len(of["NONE"][0]), 1)
        row = {"tile": tile.name, "what": what, "took": took, "seconds": seconds, "objects": n, "of": {r: [int(of[r][0].sum()), of[r][1]] for r in RESTORERS},
               "behind": max(ahead(of[r], of[took]) for r in RESTORERS), "cards": {r: {c: run.cards()[c] for c in CARDS if c in run.cards()} for r, run in runs.items()}}
        rows.append(row)
        print(row["tile"], took, row["of"], f"{row['behind']:.1f}", row["cards"]["AUTO"].get("RXWHY"), flush=True)
    right = [row["behind"] <= 2 for row in rows]
    text = ["# RESTORE_TYPE AUTO", "", f"`validation/auto.py`, seed {seed}. Of {len(rows)} skies the choice is right on {sum(right)}. Found / false; in bold what AUTO took; seconds of AUTO over those "
            "of what it took.", "", "| sky | | objects | NONE | RL | NET | right | seconds |", "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for row, fine in zip(rows, right):
        cells = [f"{'**' * (r == row['took'])}{row['of'][r][0]} / {row['of'][r][1]}{'**' * (r == row['took'])}" for r in RESTORERS]
        text.append(f"| {row['tile']} | {row['what']} | {row['objects']} | {' | '.join(cells)} | {'yes' if fine else 'no'} | {row['seconds']['AUTO'] / row['seconds'][row['took']]:.1f} |")
    ledger.store(folder, "auto", text, {"seed": seed, "rows": rows})


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 81, sys.argv[3].split(",") if len(sys.argv) > 3 else [])
