#!/usr/bin/python3
"""What resampling a tile does to the lists of sources, and what stacked, drizzled and photographic tiles give.

    resampled.py FOLDER_OF_DATA OUTPUT [TILE.fits KEYWORD=VALUE...]...

The SDSS frame, the DECam stamp, a simulated frame like SDSS's (1.3 Mpixel, truth known; also with its noise smoothed, rms
of a pixel unchanged) and every TILE given are resampled in four ways, shifted in both axes, CRPIX with them, and
restored and detected at default settings with NONE, RL and NET (see tiles.py). Into OUTPUT: resampled.md, summary.json.

    reference   the lists of the tile as taken by NONE, RL and NET, and what a catalogue knows: the deep Stripe 82 coadd
                and SDSS's photoObj, or the truth of the simulator. Where the truth is known it stands alone.
    false       a source that no mark of FLAGS_RESTORE (invented, shred) is on and that has nothing of the reference within
                2 pixels and within 1 FWHM (the larger of both). Of the tile as taken none is, by this, where the
                reference is its own lists.
    unknown     the same with the catalogue alone as reference: an upper bound, as it ends near r = 23.
    kept        share of the tile's own list as taken (same restorer) that is found again; without what is marked, and where
                there is a catalogue without what it does not know.
    recall      share of the catalogue that is found.
    negative    sources without a mark, per Mpixel, on the tile turned upside down (sky minus what is above it) with the PSF
                of the upright one, off its sources: what noise alone gives, with no reference at all.

    RXBLKR      what the program itself says of false ones per Mpixel (BLANK_CHECK), where it does; RXNFACT: of the noise of
                its matched filter, over that of independent pixels.
    lag 1       autocorrelation of neighbouring pixels beside the sources; factor: square root of the noise's power at
                frequency zero over the variance of a pixel (lags to 3 pixels, less the mean of lags 7 and 8).

A resampled tile holds where NET's false, unknown and negative sources are at most the larger of 10 per Mpixel and 1.5 times
those as taken, its recall is at least 0.97 of that as taken, and 0.97 of its list as taken are kept; exit status 1 where one
does not. One source on the DECam stamp is 10 per Mpixel.

Lists at low thresholds are no part of the reference: noise peaks of 1 sigma that resampling lifts over the threshold would
count as known. `hidden` (summary.json) is the share of the tile within reach of the reference, where a false source would
not be seen.
"""
import json
import sys
from pathlib import Path

import numpy as np
from scipy import ndimage

import tiles
from tiles import RESTORERS, near

LIMIT, FACTOR, LOST = 10, 1.5, 0.03  # false per Mpixel, times those of the tile as taken, share of recall


def lanczos(image, shift):
    taps = np.sinc(np.arange(-3, 4) - shift) * np.sinc((np.arange(-3, 4) - shift) / 3) * (abs(np.arange(-3, 4) - shift) < 3)
    for axis in (0, 1):
        image = ndimage.correlate1d(image, taps / taps.sum(), axis, mode="nearest")
    return image


def spline(order):
    return lambda image, shift: ndimage.shift(image, (-shift, -shift), order=order, mode="nearest")


# name: how, shift in x and y, pixels on either side that a pixel is made of
WAYS = {"cubic spline, 0.5 px": (spline(3), 0.5, 2), "bilinear, 0.25 px": (spline(1), 0.25, 1),
        "bilinear, 0.5 px": (spline(1), 0.5, 1), "Lanczos-3, 0.5 px": (lanczos, 0.5, 3)}


def resampled(tile, way):
    """Pixel i of the result is at i + shift of the tile. Whatever a bad pixel touches is bad."""
    how, shift, reach = WAYS[way]
    usable = np.isfinite(tile.pixels)
    pixels = how(np.where(usable, tile.pixels, np.median(tile.pixels[usable])).astype(float), shift)
    pixels[ndimage.minimum_filter(usable, 2 * reach + 1) == 0] = np.nan
    header, weight = tile.header.copy(), tile.weight
    for card in ("CRPIX1", "CRPIX2"):
        if card in header:
            header[card] -= shift
    if weight is not None:
        weight = np.where(ndimage.minimum_filter(weight, 2 * reach + 1) > 0, spline(1)(weight.astype(float), shift), 0)
    keywords, known = dict(tile.keywords), None if tile.known is None else tile.known - shift
    if "PSF_FWHM" in keywords and reach == 1:  # a PSF that is told: the variance of the kernel more
        keywords["PSF_FWHM"] = round(float(np.hypot(float(keywords["PSF_FWHM"]), 2.3548 * np.sqrt(shift * (1 - shift)))), 3)
    return tile.changed(tile.name, pixels, header=header, weight=weight, known=known, keywords=keywords), shift


def smoothed(program, fwhm):
    """The simulated tile with noise that a Gaussian has smoothed, of the same rms."""
    tile = program.simulate(f"simulated, noise of FWHM {fwhm:.3g} px", NOISE_TYPE="NONE")
    noise = ndimage.gaussian_filter(np.random.default_rng(1).standard_normal(tile.pixels.shape), fwhm / 2.3548, mode="wrap")
    return tile.changed(tile.name, tile.pixels + 0.031 * noise / noise.std())


def negative(program, tile, runs):
    """Sources per Mpixel that the noise gives: the tile upside down, off the sources of the upright one."""
    above = runs["NONE"].images["-BACKGROUND"]
    sources = ndimage.binary_dilation(runs["NET"].images["SEGMENTATION"] > 0, iterations=8)
    usable = np.isfinite(above) & ~sources
    keywords = dict(tile.keywords, GAIN=0, PSF_TYPE=tile.keywords.get("PSF_TYPE", "AUTO"))
    if keywords["PSF_TYPE"] == "AUTO":
        keywords |= {"PSF_TYPE": "MOFFAT", "PSF_FWHM": runs["NONE"].fwhm or 3}
    noise = np.where(np.isfinite(above), -np.minimum(above, 5 * above[usable].std()), np.nan)
    header = tile.header.copy()
    header.remove("GAIN", ignore_missing=True)
    found = program.run(tile.changed(tile.name, noise, header=header, keywords=keywords))
    rates = {}
    for r, run in found.items():
        x, y = np.clip(np.rint(run.positions).astype(int) - 1, 0, np.array(above.shape[::-1]) - 1).T
        rates[r] = float((usable[y, x] & ~run.marked).sum() / (usable.sum() / 1e6))
    return rates


def row(tile, way, restorer, run, reference, own, radius, upside):
    """One line of the table; own: positions of the tile as taken, by the same restorer."""
    unmarked = ~run.marked
    known = tile.known
    out = {"tile": tile.name, "way": way, "restorer": restorer, "sources": len(run.table), "marked": int(run.marked.sum()),
           "flags": run.flags(), "false": float((unmarked & ~near(run.positions, reference, radius)).sum() / tile.mpixel),
           "kept": float(near(own, run.positions, radius).mean()) if len(own) else None, "negative": upside[restorer],
           "cards": run.cards(), "said": run.said}
    if known is not None:
        inside = np.all((known > 1) & (known < np.array(tile.pixels.shape[::-1])), axis=1)
        out["unknown"] = float((unmarked & ~near(run.positions, known, radius)).sum() / tile.mpixel)
        out["recall"] = float(near(known[inside], run.positions, radius).mean())
    return out


def study(program, tile):
    """The tile as taken, and resampled: rows of the table."""
    rows = []
    for way in ("as taken", *WAYS):
        image, shift = (tile, 0) if way == "as taken" else resampled(tile, way)
        runs = program.run(image, images=("-BACKGROUND", "SEGMENTATION"))
        facts = tiles.noise_facts(runs["NONE"])
        if not rows:
            radius, lists = runs["NONE"].reach, {r: runs[r].positions for r in RESTORERS}
            own = {r: lists[r][~runs[r].marked] for r in RESTORERS}
            if tile.known is not None:
                own = {r: a[near(a, tile.known, radius)] for r, a in own.items()}
            truth = tile.kind == "simulated"
            catalogue = [] if tile.known is None else [tile.known]
            reference = tile.known if truth else np.vstack([*lists.values(), *catalogue])
            grid = np.indices(tile.pixels.shape)[::-1].reshape(2, -1).T[::7] + 1.0
            hidden = float(near(grid, reference, radius).mean())
        upside = negative(program, image, runs)
        for r in RESTORERS:
            rows.append(row(image, way, r, runs[r], reference - shift, own[r] - shift, radius, upside)
                        | {"noise": facts, "radius": radius, "hidden": hidden})
        print("\n".join(line(a) for a in rows[-3:]), flush=True)
    return rows


def as_it_is(program, tile):
    runs = program.run(tile, images=("-BACKGROUND", "SEGMENTATION"))
    facts, upside = tiles.noise_facts(runs["NONE"]), negative(program, tile, runs)
    rows = [{"tile": tile.name, "way": tile.kind, "restorer": r, "sources": len(run.table), "marked": int(run.marked.sum()),
             "flags": run.flags(), "negative": upside[r], "cards": run.cards(), "said": run.said, "noise": facts,
             "mpixel": tile.mpixel} for r, run in runs.items()]
    print("\n".join(line(a) for a in rows), flush=True)
    return rows


def number(value, form):
    return "" if value is None else form % value


def line(a):
    """A row of the table: what is not known is empty."""
    cells = [a["tile"], a["way"], a["restorer"], a["sources"], a["marked"],
             *(number(a.get(k), "%.0f") for k in ("false", "unknown", "negative")),
             *(number(a.get(k), "%.3f") for k in ("kept", "recall")),
             number(a["cards"].get("RXBLKR"), "%.3g"), number(a["cards"].get("RXNFACT"), "%.2f"),
             *(number(a["noise"].get(k), "%.2f") for k in ("lag 1", "factor"))]
    return "| " + " | ".join(map(str, cells)) + " |"


HEAD = ["tile", "way", "run", "sources", "marked", "false per Mpixel", "unknown per Mpixel", "negative per Mpixel",
        "kept", "recall", "RXBLKR", "RXNFACT", "lag 1", "factor"]


def verdicts(rows):
    """Of NET on every resampled tile."""
    out = []
    taken = {a["tile"]: a for a in rows if a["way"] == "as taken" and a["restorer"] == "NET"}
    for a in (a for a in rows if a["way"] in WAYS and a["restorer"] == "NET"):
        first = taken[a["tile"]]
        false = {k: (a[k], max(LIMIT, FACTOR * first[k])) for k in ("false", "unknown", "negative") if k in a}
        wrong = [f"{k} {value:.0f} per Mpixel, limit {limit:.0f}" for k, (value, limit) in false.items() if value > limit]
        if "recall" in a and a["recall"] < (1 - LOST) * first["recall"]:
            wrong.append(f"recall {a['recall']:.3f}, as taken {first['recall']:.3f}")
        if a["kept"] < 1 - LOST:
            wrong.append(f"keeps {a['kept']:.3f}")
        out.append({"tile": a["tile"], "way": a["way"], "holds": not wrong, "wrong": wrong})
    return out


def main(data, output, *more):
    data, output = Path(data).resolve(), Path(output)
    program = tiles.Program(output)
    simulated = program.simulate("simulated frame")
    frames = [tiles.sdss_frame(data), tiles.decam(data), simulated]
    for argument in more:
        if "=" in argument:
            frames[-1].keywords.update([argument.split("=", 1)])
        else:
            frames.append(tiles.plain(Path(argument), Path(argument).stem, "given")[0])
    table = ["| " + " | ".join(HEAD) + " |", "|" + " --- |" * len(HEAD)]
    print("\n".join(table))
    rows = [a for tile in frames for a in study(program, tile)]
    smooth = [a for fwhm in (1, 2.3548) for a in as_truth(program, smoothed(program, fwhm))]
    rest = [a for tile in tiles.others(data) for a in as_it_is(program, tile)]
    judged = verdicts(rows)
    everything = rows + smooth + rest
    text = [f"`{program.version()}`\n", *table, *map(line, everything), "",
            "| tile | way | NET |", "| --- | --- | --- |",
            *(f"| {v['tile']} | {v['way']} | {'; '.join(v['wrong']) or 'holds'} |" for v in judged), "",
            "| tile | what the log warns of |", "| --- | --- |",
            *sorted({f"| {a['tile']}, {a['way']} | {'<br>'.join(a['said'])} |" for a in everything if a["said"]})]
    (output / "resampled.md").write_text("\n".join(text) + "\n")
    summary = {"version": program.version(), "resampled": rows, "smoothed": smooth, "as they are": rest, "verdicts": judged}
    (output / "summary.json").write_text(json.dumps(summary, indent=1, default=str) + "\n")
    return not all(v["holds"] for v in judged)


def as_truth(program, tile):
    runs = program.run(tile, images=("-BACKGROUND", "SEGMENTATION"))
    facts, upside = tiles.noise_facts(runs["NONE"]), negative(program, tile, runs)
    radius = runs["NONE"].reach
    rows = [row(tile, "as simulated", r, runs[r], tile.known, np.empty((0, 2)), radius, upside)
            | {"noise": facts, "radius": radius} for r in RESTORERS]
    print("\n".join(line(a) for a in rows), flush=True)
    return rows


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
