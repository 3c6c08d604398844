#!/usr/bin/python3
"""Whether a restorer keeps what a tile holds at low frequencies: above the sky and below it.

    low_frequencies.py FOLDER_OF_DATA OUTPUT

Nebulous, cluster and empty tiles (tiles.py), and a simulated frame with dark clouds of known depth. For RL and NET the
means of boxes of 32 x 32 pixels of

    difference  the restored image minus the input, in units of the noise of a pixel (RXSIGMA), against
    above       the input minus the mesh of BACK_SIZE, in the same units.

White noise alone gives box means of 1/32 = 0.031 in the input; a restored image may follow it or not, and `rms` shows
that, so the mean over boxes and the slope of difference on above tell what is kept: 0 all of it, -1 nothing, the mesh
instead. Restoring moves light of sources across the border of a box: quiet boxes have no pixel above 8 sigma within 8
pixels. `below` are quiet boxes more than 3/32 sigma under the mesh, `over` those as much above it; slopes are through the
origin. Boxes with a bad pixel are left out. Exit status 1 where the mean over quiet boxes is beyond 0.02 sigma.

Into OUTPUT: low_frequencies.md, summary.json, and a picture of each tile with dark structure: input, then restored by RL
and what that changed, the same of NET, smoothed by a Gaussian of FWHM 16 pixels (grey: -1 to 1 sigma; changes -0.5 to 0.5).
"""
import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image
from scipy import ndimage

import tiles

SIDE, BRIGHT, NEAR, FAR = 32, 8, 8, 3 / 32
LIMIT = 0.02  # sigma, of the mean


def chosen(program, data):
    """Tiles, and whether a picture is made."""
    fields, wide = data / "fields", {"SATUR_LEVEL": 1e9}
    simulated = program.simulate("dark clouds", kind="simulated, nebulous")
    height, width = simulated.pixels.shape
    rng = np.random.default_rng(3)
    clouds = ndimage.gaussian_filter(rng.standard_normal((height, width)), 16)
    clouds = np.clip(clouds / clouds.std() - 1, 0, 2)  # a sixth of the tile, 0 to 2 sigma deep, tens of pixels wide
    return [
        (simulated.changed(simulated.name, simulated.pixels - 0.031 * clouds), True),
        (tiles.plain(fields / "spitzer_example_image.fits", "Spitzer IRAC", "nebulous", PSF_TYPE="MOFFAT", PSF_FWHM=2,
                     **wide)[0], True),
        (tiles.plain(fields / "aligned_eso085-030-004.fit", "ESO 085-030", "nebulous")[0], False),
        (tiles.plain(data / "templates/hst_147246_masknoise.fits", "HST COSMOS spiral", "nebulous", PSF_TYPE="FILE",
                     PSF_NAME=data / "templates/hst_147246_psf.fits", **wide)[0], True),
        (tiles.plain(fields / "M6707HH.fits", "M67", "cluster")[0], True),
        (tiles.plain(fields / "M13_blue_0001.fits", "M13", "cluster", PSF_TYPE="MOFFAT", PSF_FWHM=3)[0], True),
        (tiles.plain(data / "sextractor/galaxies.fits", "galaxies", "empty")[0], False),
        (tiles.sdss_frame(data), False),
        (program.simulate("simulated frame"), False),
    ]


def boxes(image):
    """Means of whole boxes; NaN where one has a bad pixel."""
    height, width = (n // SIDE for n in image.shape)
    return image[:height * SIDE, :width * SIDE].reshape(height, SIDE, width, SIDE).mean(axis=(1, 3))


def slope(x, y):
    return float((x * y).sum() / (x * x).sum()) if len(x) else None


def told(run, restored, above, sigma):
    """Numbers of a restorer: restored minus input, box by box."""
    difference, over = boxes((restored - run.images["IDENTICAL"]) / sigma), boxes(above / sigma)
    peak = ndimage.maximum_filter(np.nan_to_num(above / sigma, nan=np.inf), 2 * NEAR + 1)
    bright = boxes((peak > BRIGHT).astype(float)) > 0
    usable = np.isfinite(difference) & np.isfinite(over)
    out = {}
    for name, part in (("all", usable), ("quiet", usable & ~bright), ("below", usable & ~bright & (over < -FAR)),
                       ("over", usable & ~bright & (over > FAR))):
        d, a = difference[part], over[part]
        worst = np.argsort(-abs(d))[:3]
        where = np.argwhere(part)
        out[name] = {"boxes": int(part.sum()), "slope": slope(a, d)} | (
            {"mean": None, "rms": None, "above": None, "worst": []} if not len(d) else
            {"mean": float(d.mean()), "error": float(d.std() / np.sqrt(len(d))), "rms": float(np.sqrt((d * d).mean())),
             "above": float(a.mean()), "worst": [
                 {"x": int(where[i][1] * SIDE + SIDE // 2), "y": int(where[i][0] * SIDE + SIDE // 2),
                  "difference": float(d[i]), "above": float(a[i])} for i in worst]})
    residual = boxes(run.images["RESIDUAL"])
    part = usable & ~bright & np.isfinite(residual)
    out["residual"] = float(np.sqrt((residual[part] ** 2).mean())) if part.any() else None
    return out


def grey(image, span):
    return np.uint8(255 * np.clip(np.nan_to_num(image) / (2 * span) + 0.5, 0, 1))[::-1]


def picture(path, above, differences):
    """Input, then for each restorer its image and what it changed."""
    smooth = lambda image: ndimage.gaussian_filter(np.nan_to_num(np.clip(image, -BRIGHT, BRIGHT)), 16 / 2.3548)
    panels = [grey(smooth(above), 1)]
    for d in differences:
        panels += [grey(smooth(above + d), 1), grey(smooth(d), 0.5)]
    gap = np.full((panels[0].shape[0], 8), 255, np.uint8)
    Image.fromarray(np.hstack([p for panel in panels for p in (panel, gap)][:-1])).save(path)


def number(value, form="%+.3f"):
    return "" if value is None else form % value


def lines(tile, restorer, told_):
    for part in ("all", "quiet", "below", "over"):
        a = told_[part]
        worst = ", ".join(f"{w['difference']:+.2f} ({w['x']},{w['y']})" for w in a["worst"][:2])
        yield (f"| {tile.name} | {tile.kind} | {restorer} | {part} | {a['boxes']} | {number(a['above'])} | "
               f"{number(a['mean'])} | {number(a['rms'], '%.3f')} | {number(a['slope'])} | {worst} |")


HEAD = ["tile", "what", "run", "boxes", "number", "mean above", "mean difference", "rms difference", "slope", "worst (x,y)"]


def main(data, output):
    data, output = Path(data).resolve(), Path(output)
    program = tiles.Program(output)
    text = ["| " + " | ".join(HEAD) + " |", "| --- " * len(HEAD) + "|"]
    print("\n".join(text))
    found, holds = {}, True
    for tile, pictured in chosen(program, data):
        runs = program.run(tile, images=("RESTORED", "IDENTICAL", "-BACKGROUND", "RESIDUAL"), PARAMETERS_NAME="few.param")
        above, sigma = runs["NONE"].images["-BACKGROUND"], runs["NONE"].header["RXSIGMA"]
        bad = ~np.isfinite(tile.pixels)
        above[bad] = np.nan
        changes = []
        for r in ("RL", "NET"):
            run = runs[r]
            restored = np.where(bad, np.nan, run.images["RESTORED"])
            a = told(run, restored, above, sigma)
            found.setdefault(tile.name, {})[r] = a | {"kind": tile.kind, "said": run.said, "cards": run.cards()}
            changes.append((restored - run.images["IDENTICAL"]) / sigma)
            text += (new := list(lines(tile, r, a)))
            print("\n".join(new), flush=True)
            holds &= a["quiet"]["mean"] is None or abs(a["quiet"]["mean"]) <= LIMIT
        if pictured:
            picture(output / f"{tile.name.replace(' ', '_')}.png", above / sigma, changes)
    (output / "low_frequencies.md").write_text(f"`{program.version()}`\n\n" + "\n".join(text) + "\n")
    summary = {"version": program.version(), "tiles": found}
    (output / "summary.json").write_text(json.dumps(summary, indent=1, default=str) + "\n")
    return not holds


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
