#!/usr/bin/env python3
"""Does the self check tell the truth of resampled tiles? Completeness and purity predicted, and as they are.

    resampled.py FOLDER_OF_DATA OUTPUT [COUNT]      COUNT: objects injected of each kind, 600

The SDSS frame and a simulated frame like it (2048 x 1489 pixels), as taken and resampled in the four ways of
validation/resampled.py, with NONE, RL and NET. SELF_CHECK injects stars, then galaxies, AMONG the tile's own sources.

Completeness: the truth is the share found of the deep Stripe 82 coadd's sources (reference.py), or of those simulated;
predicted is what the injected stars and galaxies of the bin lead to expect, weighed as the catalogue mixes them there,
with the range in which 95 % of the truths then lie (selfcheck/compare.py).
Purity: the truth is the share of the detections that are beside something real, one to one, in intervals of 95 %
(Clopper and Pearson); predicted is the share of new detections that was injected, pieces of sources counted out (RXSCNEW),
times the share of detections that is no noise peak (RXBLKP, BLANK_CHECK 2). The coadd ends too early for the deepest
lists: on the SDSS frame the truth is a lower bound, and only a prediction below its interval is wrong.
A row holds when Holm's p over the bins of all rows of its tile is above 0.05, and the purity as said. The rows of a tile are not
independent: they are lists of the same objects.
Into OUTPUT: selfcheck.md, selfcheck.json; exit status 1 where a row does not hold. What lies there is not made again.
"""
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
from astropy.io import fits
from astropy.table import Table

sys.path[:0] = [str(Path(__file__).parent.parent), str(Path(__file__).parent)]
import compare  # noqa: E402
import resampled  # noqa: E402
import tiles  # noqa: E402

BINS = [(18, 20), (20, 21), (21, 21.5), (21.5, 22), (22, 22.5)]
KINDS = {"stars": 0, "galaxies": 1}


def reference(program, data):
    """MAG of the coadd, and which of its sources are stars, by row."""
    folder = data / "sdss/94-1-12"
    (program.folder / "frame.fits").write_bytes(tiles.bz2.decompress(
        (folder / "frame-r-000094-1-0012.fits.bz2").read_bytes()))
    coadd = folder / "stripe82_coadd_catalog.fit"
    subprocess.run([sys.executable, Path(__file__).parent.parent / "sdss/reference.py", coadd, program.folder / "frame.fits",
                    "4.71", program.folder / "reference.fits"], check=True, stdout=subprocess.DEVNULL)
    return "RA,DEC,MAG", fits.getdata(coadd, 1)["probpsf"] > 0.5


def outcomes(table):
    """Of every source of the reference that counts: its magnitude, whether it was found, its row."""
    table = table[(table["state"] == "matched") | (table["state"] == "missed")]
    return np.asarray(table["mag_ref"]), np.asarray(table["state"] == "matched"), np.asarray(table["reference"]) - 1


def matches(program, folder, restorer):
    return Table.read(program.folder / folder / f"matches_{restorer}.ecsv", format="ascii.ecsv")


def purity(table, headers, bound):
    """Truth, prediction, and whether both agree."""
    real, false = int((table["state"] == "matched").sum()), int((table["state"] == "false").sum())
    low, high = compare.interval(real, real + false)
    injected, noise = ([headers[k][card + end] for end in ("", "L", "H")]
                       for k, card in (("stars", "RXSCNEW"), ("stars", "RXBLKP")))
    value, least, most = (a * b for a, b in zip(injected, noise))
    return {"truth": real / (real + false), "low": low, "high": high, "detections": real + false, "predicted": value,
            "from": least, "to": most, "holds": bool(most >= low and (bound or least <= high))}


def completeness(mag, found, star, injected):
    """A row for each bin and one of all, all kinds of source together, and p of each."""
    cells, p = [], []
    whole = compare.Sum()
    for low, high in BINS:
        one, mixed, variance = compare.Sum(), 0.0, 0.0
        k, n = compare.count(mag, found, np.ones(len(mag), bool), low, high)
        for kind, use in ("stars", star), ("galaxies", ~star):
            m, all_of = injected[kind], np.ones(len(injected[kind][0]), bool)
            q, error = compare.smoothed(*compare.count(m[0], m[1], all_of, low, high))
            part = compare.count(mag, found, use, low, high)[1] / n
            mixed += part * q
            variance += (part * error) ** 2
        for sum_of in (one, whole):
            sum_of.add(k, n, mixed, np.sqrt(variance))
        cells.append((k, n, one.row()))
        p.append(one.row()[2])
    cells.append((whole.found, whole.all, whole.row()))
    return cells, p + [whole.row()[2]]


def study(program, tile, columns, star, count):
    rows = []
    for way in ("as taken", *resampled.WAYS):
        kept = program.folder / f"{tile.name}, {way}.json"
        if kept.exists():
            rows += json.loads(kept.read_text())
            continue
        image = tile if way == "as taken" else resampled.resampled(tile, way)[0]
        common = {"PARAMETERS_NAME": "few.param", "SELF_CHECK": "Y", "SELF_CHECK_COUNT": count, "SELF_CHECK_MAG": "17.5,23"}
        runs = {}
        for kind, share in KINDS.items():
            more = {"REFERENCE_NAME": "reference.fits", "REFERENCE_COLUMNS": columns, "QA_NAME": "qa", "MATCH_RADIUS": 1,
                    "MATCH_UNIT": "ARCSEC", "BLANK_CHECK": 2} if kind == "stars" else {"MATCH_RADIUS": 1, "MATCH_UNIT": "ARCSEC"}
            runs[kind] = program.run(image, **common, **more, SELF_CHECK_GALAXIES=share, SELF_CHECK_NAME=kind)
        for r in tiles.RESTORERS:
            table = matches(program, "qa", r)
            mag, found, row = outcomes(table)
            injected = {k: outcomes(matches(program, k, r)) for k in KINDS}
            cells, p = completeness(mag, found, star[row], injected)
            rows.append({"tile": tile.name, "way": way, "restorer": r, "cells": cells, "p": p,
                         "limit": runs["stars"][r].header["RXSCLIM"], "noise": runs["stars"][r].header["RXNFACT"],
                         "purity": purity(table, {k: runs[k][r].header for k in KINDS}, tile.kind != "simulated")})
            print(line(rows[-1]), flush=True)
        kept.write_text(json.dumps(rows[-len(tiles.RESTORERS):], default=float))
    for a, p in zip(rows, np.reshape(compare.holm(np.ravel([a["p"] for a in rows])), (len(rows), -1))):
        a["holm"] = float(p.min())
        a["holds"] = bool(a["holm"] > 0.05 and a["purity"]["holds"])
    return rows


HEAD = ["tile", "way", "run", "RXNFACT", *(f"{low:g}-{high:g}" for low, high in BINS), f"{BINS[0][0]:g}-{BINS[-1][1]:g}",
        "least p (Holm)", "purity", "predicted", ""]


def line(a):
    pure = a["purity"]
    cells = [a["tile"], a["way"], a["restorer"], f"{a['noise']:.2f}", *(f"{k / n:.3f}, {row[1]}" for k, n, row in a["cells"]),
             f"{a['holm']:.2g}" if "holm" in a else "", f"{pure['truth']:.3f} ({pure['low']:.3f}..{pure['high']:.3f})",
             f"{pure['predicted']:.3f} ({pure['from']:.3f}..{pure['to']:.3f})",
             {True: "holds", False: "does not hold"}.get(a.get("holds"), "")]
    return "| " + " | ".join(cells) + " |"


def main(data, output, count="600"):
    data = Path(data).resolve()
    program = tiles.Program(output)
    rows = []
    columns, star = reference(program, data)
    rows += study(program, tiles.sdss_frame(data), columns, star, count)
    frame = program.simulate("simulated frame", IMAGE_SIZE="2048,1489", SEED=20)
    truth = fits.getdata(program.folder / "truth.fits", 1)
    (program.folder / "reference.fits").write_bytes((program.folder / "truth.fits").read_bytes())
    rows += study(program, frame, "ALPHA_J2000,DELTA_J2000,MAG", np.char.strip(truth["TYPE"]) == "STAR", count)
    wrong = sum(not a["holds"] for a in rows)
    ranges = [(k / n, *map(float, re.search(r"\((.*)\.\.(.*)\)", row[1]).groups())) for a in rows for k, n, row in a["cells"]]
    within = sum(low - 5e-4 <= share <= high + 5e-4 for share, low, high in ranges)
    table = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD), *map(line, rows)]
    text = [f"`{program.version()}`, `validation/selfcheck/resampled.py`, {count} objects of each kind; completeness: found of "
            "the catalogue's, predicted (95 %)\n", *table, "", f"{len(rows) - wrong} of {len(rows)} rows hold; {within} of {len(ranges)} "
            "completenesses lie in the range of 95 %."]
    (program.folder / "selfcheck.md").write_text("\n".join(text) + "\n")
    (program.folder / "selfcheck.json").write_text(json.dumps({"version": program.version(), "count": int(count), "rows": rows},
                                                              indent=1, default=float) + "\n")
    return int(wrong > 0)


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
