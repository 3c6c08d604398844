#!/usr/bin/env python3
"""The paper's Figures 5 to 9 as they come out here: PNG files for docs/paper.md, and that page as a PDF.

    figures.py boxes CAMPAIGN NAME    PSNR and SSIM by FWHM and noise, of a restoration campaign's folder (Figure 5)
    figures.py examples CAMPAIGN NAME scenes inside and beyond the training, from its report.html (Figures 6, 7)
    figures.py pairs DATA FOLDER      galaxies of SDSS, restored, beside the deeper KiDS (Figure 8); FOLDER is worked in
    figures.py stars                  MagErr, recall and precision of the committed photometry campaigns (Figure 9)
    figures.py curves CAMPAIGN        precision and recall of the lists by seeing, of a campaign FLUXES (its rows.ecsv)
    figures.py pdf FILE               docs/paper.md, tables and figures, as one PDF (python3-markdown, weasyprint)

They are written to validation/results/figures. REXTRACT names the program (build/rextract). Needs astropy, scipy and matplotlib.
"""
import base64
import csv
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from astropy.io import fits
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import minimize

TOP = Path(__file__).resolve().parent.parent
RESULTS, FIGURES = TOP / "validation/results", TOP / "validation/results/figures"
STAMP = {"metadata": {"Software": None}}  # the same bytes from the same numbers
COLOUR = {"RL": "#c44e52", "NET": "#2c8a4b", "NONE": "#4c72b0", "RL_SSIM": "#dd9f3d"}


def ecsv(path):
    return list(csv.DictReader(line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")))


def save(figure, name):
    FIGURES.mkdir(exist_ok=True)
    figure.savefig(FIGURES / f"{name}.png", dpi=64, bbox_inches="tight", **STAMP)
    plt.close(figure)


# --- Figure 5

def boxes(folder, name):
    values, runs = {}, ("RL_SSIM", "RL", "NET")
    for row in ecsv(Path(folder) / "rows.ecsv"):
        if row["table"] == "scene" and row["run"] in runs:
            for quantity in ("psnr", "ssim", "ssim_object"):
                values.setdefault((row["scene"], quantity, row["run"], row["condition"]), []).append(float(row[quantity]))
    figure, axes = plt.subplots(3, 2, figsize=(13, 10), gridspec_kw={"width_ratios": (13, 24)})
    for column, scene in enumerate(("FWHM", "noise")):
        bins = list(dict.fromkeys(key[3] for key in values if key[0] == scene))
        for axis, (quantity, label) in zip(axes[:, column], (("psnr", "PSNR (dB)"), ("ssim", "SSIM"), ("ssim_object", "SSIM on the object"))):
            for k, run in enumerate(runs):
                axis.boxplot([values[scene, quantity, run, b] for b in bins], positions=[float(b) + 0.27 * (k - 1) for b in bins], widths=0.24,
                             showfliers=False, patch_artist=True, boxprops={"facecolor": COLOUR[run], "lw": 0.4},
                             medianprops={"color": "k", "lw": 0.8}, whiskerprops={"lw": 0.5}, capprops={"lw": 0.5}, manage_ticks=False)
            axis.set_xticks([float(b) for b in bins], bins, fontsize=8)
            axis.set_ylabel(label)
            axis.set_xlabel("FWHM (pixels)" if scene == "FWHM" else "noise (the brightest pixel is 255)")
    axes[0, 1].legend(handles=[plt.Rectangle((0, 0), 1, 1, color=COLOUR[run]) for run in runs],
                      labels=["RL tuned for SSIM", "RL tuned for PSNR", "network"], fontsize=9)
    figure.suptitle(f"{name}: all test scenes of a bin, quartiles and what lies within 1.5 of their distance")
    figure.tight_layout()
    save(figure, f"boxes-{name}")


# --- Figures 6 and 7

def examples(folder, name):
    text = (Path(folder) / "report.html").read_text(encoding="utf-8")
    shown = {}
    for picture, caption in re.findall(r"data:image/png;base64,([A-Za-z0-9+/=]+)(?:(?!data:image/png).)*?<figcaption>([A-Z_]+)</figcaption>", text, re.S):
        shown.setdefault(caption, []).append(plt.imread(io.BytesIO(base64.b64decode(picture))))
    titles = re.findall(r"FWHM [0-9.]+ pixels, noise [0-9.]+", text)
    runs = [run for run in ("BLURRED", "RL_SSIM", "RL", "NET", "SHARP") if run in shown]
    titles = list(dict.fromkeys(titles))[:len(shown[runs[0]])]
    figure, axes = plt.subplots(len(titles), len(runs), figsize=(2.6 * len(runs), 2.7 * len(titles)))
    for line, title in zip(axes, titles):
        for axis, run in zip(line, runs):
            axis.imshow(shown[run][titles.index(title)], cmap="gray")
            axis.set_xticks([])
            axis.set_yticks([])
            axis.set_title(run if title == titles[0] else "", fontsize=10)
        line[0].set_ylabel(title, fontsize=8)
    figure.tight_layout()
    save(figure, f"examples-{name}")


# --- Figure 8

def rms_width(kernel):
    """Pixels, of a Gaussian as wide at half its peak."""
    area = (kernel > kernel.max() / 2).sum()
    return 2 * (area / np.pi)**0.5 / 2.3548


def fidelity(image, deep, inside):
    """PSNR, dB; the flux scale is free, as zero points differ by some per cent."""
    scale = (image[inside] * deep[inside]).sum() / (image[inside]**2).sum()
    mse = ((image * scale - deep)[inside]**2).mean()
    return 20 * np.log10(deep[inside].max()) - 10 * np.log10(mse) if mse > 0 else np.inf


def pairs(data, folder):
    """Each restored image beside KiDS, which is brought to its pixels. In the corner PSNR of a disk in the middle, through the Gaussian
    filter that is best for the image, as no two have the same PSF, and seconds of the whole program."""
    home, folder = Path(data) / "pairs", Path(folder)
    names = sorted(path.name[:-10] for path in (home / "SDSS").glob("*fitim.fits"))
    program = Path(os.environ.get("REXTRACT", TOP / "build/rextract")).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(len(names), 5, figsize=(13, 2.7 * len(names)))
    record = []
    for row, (line, name) in enumerate(zip(axes, names)):
        def read(survey, kind):
            with fits.open(home / survey / f"{name}{kind}.fits", ignore_missing_simple=True) as file:
                return np.array(file[0].data, float)
        sdss, sigma, kids = read("SDSS", "fitim"), read("SDSS", "sigma"), read("KiDS", "fitim")
        unit = np.median(sigma)  # a tile in units of its noise
        fits.writeto(folder / "tile.fits", (sdss / unit).astype("f4"), overwrite=True)
        kernel = np.clip(read("SDSS", "psfim"), 0, None)
        fits.writeto(folder / "psf.fits", (kernel / kernel.sum()).astype("f4"), overwrite=True)
        y, x = np.indices(sdss.shape, float)
        step = 0.339 / 0.2  # arcsec a pixel: the same centre and orientation (MANIFEST)
        inside = np.hypot(x - x.mean(), y - y.mean()) < 0.4 * min(sdss.shape)

        def brought(shift, image):
            at = [(v - (n - 1) / 2) * step + (m - 1) / 2 + s
                  for v, n, m, s in ((y, sdss.shape[0], kids.shape[0], shift[0]), (x, sdss.shape[1], kids.shape[1], shift[1]))]
            return map_coordinates(image, at, order=3, mode="nearest") * step**2 / unit
        seeing = [rms_width(read(survey, "psfim")) * pixel for survey, pixel in (("SDSS", step), ("KiDS", 1))]
        alike = gaussian_filter(kids, max(seeing[0]**2 - seeing[1]**2, 0)**0.5)  # frames are registered where both are as blurred
        shift = minimize(lambda v: ((brought(v, alike) - sdss / unit)[inside]**2).sum(), (0, 0), method="Nelder-Mead").x
        deep = brought(shift, kids)
        shown = [("SDSS", sdss / unit, None)]
        for title, keywords in (("RL", ["RL"]), ("psfnet-blind", ["NET", "-NET_MODEL", str(TOP / "config/psfnet-blind.fits"), "-RESTORE_FALLBACK", "N"]),
                                ("psfnet", ["NET", "-NET_MODEL", str(TOP / "config/psfnet.fits"), "-RESTORE_FALLBACK", "N"])):
            start = os.times()
            done = subprocess.run([str(program), "tile.fits", "-RESTORE_TYPE", *keywords, "-PSF_TYPE", "FILE", "-PSF_NAME", "psf.fits", "-CHECKIMAGE_TYPE",
                                   "RESTORED", "-CHECKIMAGE_NAME", "restored.fits", "-CATALOG_TYPE", "NONE", "-VERBOSE_TYPE", "QUIET",
                                   "-NTHREADS", "1"], cwd=folder, capture_output=True, text=True)
            end = os.times()
            if done.returncode:
                sys.exit(f"figures.py: {done.stderr}")
            shown.append((title, fits.getdata(folder / "restored.fits").astype(float), end.children_user - start.children_user))
        shown.append(("KiDS", deep, None))
        for axis, (title, image, seconds) in zip(line, shown):
            psnr, width = max((fidelity(gaussian_filter(image, w), deep, inside), w) for w in np.arange(0, 3, 0.1))
            axis.imshow(np.arcsinh(image / 3), cmap="gray", origin="lower", vmin=-0.5, vmax=np.arcsinh(deep[inside].max() / 3))
            words = "" if title == "KiDS" else f"{psnr:.1f} dB" + (f", {seconds:.2f} s" if seconds else "")
            axis.text(0.03, 0.97, words, color="w", fontsize=9, va="top", transform=axis.transAxes)
            axis.set_xticks([])
            axis.set_yticks([])
            axis.set_title("" if row else title, fontsize=10)
            if title != "KiDS":
                record.append({"galaxy": name, "image": title, "psnr_db": round(psnr, 2), "filter_pixels": round(2.3548 * width, 2), "user_s": None if seconds is None else round(seconds, 2)})
        line[0].set_ylabel(name, fontsize=9)
    figure.tight_layout()
    save(figure, "pairs")
    (FIGURES / "pairs.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    for title in dict.fromkeys(entry["image"] for entry in record):
        print(title, f"{np.mean([entry['psnr_db'] for entry in record if entry['image'] == title]):.2f} dB")


# --- Figure 9

def stars():
    figure, axes = plt.subplots(2, 3, figsize=(14, 8))
    for line, name in zip(axes, ("photometry", "photometry-sdss")):
        rows = ecsv(RESULTS / name / "cells.ecsv")
        for axis, (quantity, label) in zip(line, (("magerr", "MagErr (%)"), ("recall_p0.95", "recall at precision 0.95"), ("precision", "precision of the whole list"))):
            for run in ("NONE", "RL", "NET"):
                for kind, style in ((run, "-o"), (f"{run} TEMPLATE", "--")):
                    some = [(float(r["condition"]), float(r["value"])) for r in rows if (r["run"], r["quantity"]) == (kind, quantity)]
                    if some and (quantity == "magerr" or kind == run):
                        axis.plot(*zip(*some), style, color=COLOUR[run], ms=3, lw=1, label=kind)
            axis.set_yscale("log" if quantity == "magerr" else "linear")
            axis.set_xlabel("magnitude")
            axis.set_ylabel(f"{label}, {name}")
            axis.legend(fontsize=8)
    figure.tight_layout()
    save(figure, "stars")


def curves(folder):
    rows = ecsv(Path(folder) / "rows.ecsv")
    figure, axes = plt.subplots(2, 3, figsize=(14, 8), sharex=True, sharey=True)
    for axis, scene in zip(axes.flat, sorted({r["scene"] for r in rows}, key=lambda s: float(s.split()[1]))):
        for run in ("NONE", "RL", "NET"):
            of = [r for r in rows if (r["scene"], r["run"]) == (scene, run)]
            stars = [r for r in of if r["table"] == "object"]
            found = [(float(r["score"]), 1) for r in stars if r["score"] not in ("", "nan")]
            every = sorted(found + [(float(r["score"]), 0) for r in of if r["table"] == "false"], reverse=True)
            right = np.cumsum([one[1] for one in every])
            axis.plot(right / len(stars), right / np.arange(1, len(every) + 1), color=COLOUR[run], lw=1, label=run)
        axis.set(xlim=(0.6, 1), ylim=(0.6, 1.005), title=scene)
    for axis in axes[1]:
        axis.set_xlabel("recall, stars of magnitude 17 to 23")
    for axis in axes[:, 0]:
        axis.set_ylabel("precision")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    save(figure, "curves")


# --- the page as one PDF

STYLE = """@page { size: A4 landscape; margin: 12mm } body { font: 9pt sans-serif } table { border-collapse: collapse }
th, td { border: 0.3pt solid #888; padding: 1pt 3pt; vertical-align: top } img { max-width: 100%; max-height: 175mm }"""


def pdf(path):
    import markdown
    import weasyprint
    page = TOP / "docs/paper.md"
    text = markdown.markdown(page.read_text(encoding="utf-8"), extensions=["tables", "toc", "sane_lists"])
    text = re.sub(r'<a href="(?!#|http)[^"]*">(.*?)</a>', r"\1", text, flags=re.S)  # files beside the page are not in the PDF
    os.environ["SOURCE_DATE_EPOCH"] = "0"  # the same bytes from the same page
    weasyprint.HTML(string=f"<title>The paper beside this program</title><style>{STYLE}</style>{text}", base_url=str(page)).write_pdf(path)


if __name__ == "__main__":
    jobs = {"boxes": 2, "examples": 2, "pairs": 2, "stars": 0, "curves": 1, "pdf": 1}
    if len(sys.argv) < 2 or jobs.get(sys.argv[1]) != len(sys.argv) - 2:
        sys.exit(__doc__)
    globals()[sys.argv[1]](*sys.argv[2:])
