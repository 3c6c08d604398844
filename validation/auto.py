#!/usr/bin/env python3
"""What RESTORE_TYPE AUTO takes, beside what NONE, RL and NET find on the same tile.

usage: auto.py FOLDER [SEED [DATA]]      into FOLDER: summary.json, after every tile

SEED (101) makes the simulated skies, some of the departures of robustness.py; there
score = (objects found - false sources) / objects, of objects of S/N 5 and more by the truth. DATA is the folder of real
tiles (RX_SHARED_DATA, or ../shared/data beside the sources), of which only the choice is reported.
"""
import json
import os
import sys
from pathlib import Path

import ledger
import robustness
import tiles
from tiles import RESTORERS, near

SKIES = ("none", "Lanczos", "smoothed 4", "halo", "undersampled", "x10")
DEEP = 5


def choice(run):
    """What AUTO took and why, from its header."""
    cards = run.cards()
    of = {}
    for k in (1, 2, 3):
        own = {name: cards[f"RXAU{k}{letter}"] for name, letter in
               (("found", "F"), ("spurious", "S"), ("bias", "B"), ("scatter", "D"), ("raised", "T"), ("out", "O"))
               if f"RXAU{k}{letter}" in cards}
        of[cards.get(f"RXAU{k}", "?")] = own
    return {"took": cards["RXREST"], "why": cards["RXWHY"], "injected": cards["RXAUN"], "of": of}


def score(run, at, judged, reach, side):
    """Of one catalogue against all places that are known, `judged` of which are to be found."""
    inside = robustness.inside(run.positions, side)
    found = near(at[judged], run.positions, reach)
    false = int((~near(run.positions, at, reach) & inside).sum())
    return {"objects": int(judged.sum()), "found": int(found.sum()), "false": false,
            "score": float(f"{(found.sum() - false) / judged.sum():.4g}")}


def main(folder, seed, data):
    ledger.claim("auto", folder, [seed])
    program, rows = tiles.Program(folder), []
    (program.folder / "auto.param").write_text("NUMBER\nX_IMAGE\nY_IMAGE\nMAG_AUTO\n")  # no templates

    def add(tile, known, kind):
        runs = program.run(tile, (*RESTORERS, "AUTO"), PARAMETERS_NAME="auto.param", NTHREADS=1)
        row = {"tile": tile.name, "kind": kind, **choice(runs["AUTO"])}
        if known is not None:
            row["score"] = {r: score(runs[r], *known) for r in RESTORERS}
        rows.append(row)
        print(row, flush=True)
        (program.folder / "summary.json").write_text(json.dumps({"version": program.version(), "seed": seed, "rows": rows}, indent=1) + "\n")

    for departure in robustness.DEPARTURES:
        if departure.name in SKIES:
            tile, truth, width = robustness.expose(program, departure, seed, 0)
            at, _, snr, _, _ = robustness.objects(truth, width, tile.pixels)
            judged = (snr > DEEP) & robustness.inside(at, len(tile.pixels))
            add(tile, (at, judged, max(2.0, 2.3548 * width), len(tile.pixels)), departure.what)
    if not data.is_dir():
        return
    for tile in tiles.others(data):
        add(tile, None, tile.kind)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    shared = Path(os.environ.get("RX_SHARED_DATA", tiles.TOP / "../shared/data"))
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 101, Path(sys.argv[3]) if len(sys.argv) > 3 else shared)
