#!/usr/bin/env python3
"""One stage or two: networks of twins.py on whole tiles, beside each other.

    stages.py FOLDER SEED [SEED ...]     FOLDER: that of twins.sh; SEEDs of tiles: below 1000 to choose by, from 1000 on final (ledger.py)

`base` has the supplied network's shape and losses; `deep` twice the multiplications (six blocks, two Richardson-Lucy steps);
`stages` a second network of the supplied shape that is given what the first one made and what is left of the data, too, with one
step after each: as much work as `deep`. On tiles of 512 x 512 pixels with the population and noise of detection.conf, 800 stars
or 500 galaxies and 60 stars per Mpixel, FWHM 2.5 to 8: PSNR and SSIM against the sharp scene (as quality/image_metrics.h has
them), of the image that is shown (nn/front.h), and the average precision of a list of sources of S/N above 5, found by sep on it
and ranked by their brightest pixel.

Writes summary.json and stages.md into FOLDER/stages. A training is one observation: the error of a difference is that of the
scatter between seeds within the three kinds (6 degrees of freedom). Needs python3 with torch, sep, scipy, skimage and astropy,
and a build (RX_BUILD_DIR)."""
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import sep
import torch
from astropy.io import fits
from scipy import stats
from scipy.spatial import cKDTree
from skimage.metrics import structural_similarity

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import ledger
import twins

KINDS, SEEING = ("base", "deep", "stages"), (2.5, 3, 4, 6, 8)
SCENES = {"stars": "-STAR_COUNT 800 -GALAXY_COUNT 0", "galaxies": "-STAR_COUNT 60 -GALAXY_COUNT 500"}
SKY, NOISE, SIDE, BORDER, ROOM = 0.87, 0.031, 512, 24, 640  # BORDER: not judged; ROOM: of the cyclic domain
POPULATION = (f"-IMAGE_SIZE {SIDE} -PIXEL_SCALE 0.396 -MAG_ZEROPOINT 22.5 -PSF_BETA 4.765 -SKY_LEVEL {SKY} -NOISE_SIGMA {NOISE} "
              "-STAR_MAG 15,23 -STAR_SLOPE 0.2 -GALAXY_MAG 16,23 -GALAXY_SLOPE 0.4 -VERBOSE_TYPE QUIET").split()
LEAST_SNR, DISTANCE, THRESHOLD = 5, 2.0, 0.5  # of the truth; of a match, pixels; of a detection's brightest pixel, noise units
HEADS = {"psnr": ("PSNR (dB)", 2), "ssim": ("SSIM", 4), "ap_stars": ("AP, stars", 4), "ap_galaxies": ("AP, galaxies", 4)}


def moffat(fwhm, beta=4.765, size=127, fine=11):
    """Integrated over pixels, sum 1."""
    at = (np.arange(size * fine) - (size * fine - 1) / 2) / fine
    alpha = fwhm / (2 * math.sqrt(2 ** (1 / beta) - 1))
    image = (1 + (at[:, None] ** 2 + at[None, :] ** 2) / alpha ** 2) ** -beta
    image = image.reshape(size, fine, size, fine).sum((1, 3))
    return image / image.sum()


def relative(psf, delta=1e-4):
    """K' of nn/deblur.h."""
    n = 192
    plane = np.zeros((n, n))
    plane[:psf.shape[0], :psf.shape[1]] = psf
    target = twins.target_spectrum(n).numpy()
    wave = np.fft.rfft2(np.roll(plane, (-(psf.shape[0] // 2),) * 2, (0, 1))) * (1 + delta) * target / (target ** 2 + delta)
    stamp = np.roll(np.fft.irfft2(wave, s=(n, n)), (twins.KERNEL // 2,) * 2, (0, 1))[:twins.KERNEL, :twins.KERNEL]
    return torch.tensor((stamp / stamp.sum()).astype(np.float32))[None, None]


def tile_of(folder, scene, seeing, seed):
    base = folder / f"{scene}-{seeing}-{seed}"
    program = Path(os.environ.get("RX_BUILD_DIR", HERE.parents[1] / "build")) / "rextract-simulate"
    subprocess.run([program, "-SEED", str(seed), "-PSF_FWHM", str(seeing), "-IMAGE_NAME", f"{base}.fits", "-SHARP_NAME", f"{base}-sharp.fits",
                    "-TRUTH_NAME", f"{base}-truth.fits", *POPULATION, *SCENES[scene].split()], check=True)
    psf, truth = moffat(seeing), fits.getdata(f"{base}-truth.fits", 1)
    # a matched filter's noise in pixels; of a galaxy that of a Gaussian as wide as both
    of_star = 1 / np.sum(psf ** 2)
    width = seeing ** 2 + (2 * truth["FLUX_RADIUS"].astype(float)) ** 2
    snr = truth["FLUX"] / (NOISE * np.sqrt(of_star * width / seeing ** 2))
    x = torch.zeros(1, 1, ROOM, ROOM)
    inside = torch.zeros(1, 1, ROOM, ROOM)
    x[0, 0, :SIDE, :SIDE] = torch.tensor(((fits.getdata(f"{base}.fits") - SKY) / NOISE).astype(np.float32))
    inside[0, 0, :SIDE, :SIDE] = 1
    stamp = relative(psf)
    image = {"k": twins.spectrum(stamp, ROOM), "k_sum": stamp.sum().view(1, 1, 1, 1), "channel": torch.full((1, 1, 1, 1), (seeing - 5) / 3)}
    return {"image": image, "x": x, "w": twins.tikhonov(image["k"], x), "inside": inside, "sharp": fits.getdata(f"{base}-sharp.fits").astype(float) / NOISE,
            "at": np.stack([truth["X_IMAGE"] - 1, truth["Y_IMAGE"] - 1], 1), "snr": snr}


def shown(f):
    v = np.maximum(f, -0.5)
    t = np.clip((np.abs(v) - 0.1) / 0.1, 0, 1)
    return v * t * t * (3 - 2 * t)


def precision(image, tile):
    """Average precision; what is of a truth below LEAST_SNR counts neither way, nor what is within BORDER."""
    found = sep.extract(np.ascontiguousarray(image), THRESHOLD, minarea=1, filter_kernel=None, deblend_nthresh=32, deblend_cont=0.005, clean=False)
    within = lambda at: np.all((at >= BORDER) & (at < SIDE - BORDER), axis=1)
    at = np.stack([found["xpeak"], found["ypeak"]], 1).astype(float)
    rank = np.argsort(-found["peak"], kind="stable")
    tree, taken, hits, kinds = cKDTree(tile["at"]), set(), 0, []
    for i in rank:
        near = sorted((math.dist(at[i], tile["at"][j]), j) for j in tree.query_ball_point(at[i], DISTANCE) if j not in taken)
        near.sort(key=lambda pair: tile["snr"][pair[1]] < LEAST_SNR)  # those that count first
        if near:
            j = near[0][1]
            taken.add(j)
            if tile["snr"][j] >= LEAST_SNR and within(tile["at"][j:j + 1])[0]:
                kinds.append(1)
        elif within(at[i:i + 1])[0]:
            kinds.append(0)
    whole = int(np.sum(within(tile["at"]) & (tile["snr"] >= LEAST_SNR)))
    total = 0.0
    for n, kind in enumerate(kinds, 1):
        hits += kind
        total += kind * hits / n
    return total / whole


def judged(training, tile):
    with torch.no_grad():
        made = training.restore(tile["image"], tile["x"], tile["w"], tile["inside"])[-1][0, 0, :SIDE, :SIDE].numpy()
    image, cut = shown(made), (slice(BORDER, -BORDER),) * 2
    a, b = image[cut].astype(float), tile["sharp"][cut]
    span = b.max() - b.min()
    return {"psnr": 20 * math.log10(b.max() / math.sqrt(np.mean((a - b) ** 2))), "ap": precision(image, tile),
            "ssim": structural_similarity(a, b, data_range=span, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, K1=0.001, K2=0.001)}


def trained(folder):
    """{kind: [training of each seed]}"""
    found = {kind: [] for kind in KINDS}
    for seed in twins.SEEDS:
        for kind, words in (("base", {}), ("deep", {"blocks": 6, "rl_steps": 2}), ("stages", {"stages": 2})):
            first = folder / f"first/{'deep' if kind == 'deep' else 'stages'}-{seed}"
            one = twins.Training(f"{kind}-{seed}", seed, first, **words)
            one.parameters = [torch.tensor(np.fromfile(folder / f"trained/{kind}-{seed}.{part}", np.float32)) for part in ("restore", "second")[:len(one.nets)]]
            found[kind].append(one)
    return found


def differences(values):
    """values: {kind: one number of each seed}: each against base, with its error and p."""
    freedom = sum(len(v) - 1 for v in values.values())
    sigma = math.sqrt(sum(np.sum((np.array(v) - np.mean(v)) ** 2) for v in values.values()) / freedom)
    found = {}
    for one, other in (("deep", "base"), ("stages", "base"), ("stages", "deep")):
        difference = float(np.mean(values[one]) - np.mean(values[other]))
        error = sigma * math.sqrt(1 / len(values[one]) + 1 / len(values[other]))
        found[f"{one} - {other}"] = {"difference": difference, "error": error, "p": 2 * float(stats.t.sf(abs(difference) / error, freedom))}
    return found


def report(summary):
    yield "# One stage or two"
    yield ""
    yield (f"Twins of the supplied network (twins.py), {summary['images']} training images of 128 x 128 pixels, three seeds: mean ± scatter of the seeds over "
           f"{summary['tiles']} tiles of 512 x 512 pixels; then differences ± error, \\* \\*\\* \\*\\*\\*: p < 0.05, 0.01, 0.001, a training being one observation.")
    yield ""
    yield "| | " + " | ".join(head for head, _ in HEADS.values()) + " |"
    yield "| --- |" + " --- |" * len(HEADS)
    names = {"base": "base: one stage, 4.4 kMAC, one step", "deep": "deep: one stage, 9.0 kMAC, two steps", "stages": "stages: two networks, 9.1 kMAC, a step after each"}
    for kind in KINDS:
        cells = [f"{np.mean(summary['values'][m][kind]):.{d}f} ± {np.std(summary['values'][m][kind], ddof=1):.{d}f}" for m, (_, d) in HEADS.items()]
        yield f"| {names[kind]} | " + " | ".join(cells) + " |"
    for pair in summary["differences"]["psnr"]:
        cells = []
        for m, (_, d) in HEADS.items():
            one = summary["differences"][m][pair]
            stars = "\\*" * sum(one["p"] < limit for limit in (0.05, 0.01, 0.001))
            cells.append(f"{one['difference']:+.{d}f} ± {one['error']:.{d}f}{stars}")
        yield f"| {pair} | " + " | ".join(cells) + " |"
    yield ""
    yield "| FWHM | " + " | ".join(f"{HEADS[m][0]}: {kind}" for m in HEADS for kind in KINDS) + " |"
    yield "| --- |" + " --- |" * (len(HEADS) * len(KINDS))
    for seeing in SEEING:
        cells = [f"{summary['by_seeing'][str(seeing)][m][kind]:.{min(d, 3)}f}" for m, (_, d) in HEADS.items() for kind in KINDS]
        yield f"| {seeing:g} | " + " | ".join(cells) + " |"
    yield ""


def main():
    if len(sys.argv) < 3 or not all(word.isdigit() for word in sys.argv[2:]):
        sys.exit(__doc__)
    folder, seeds = Path(sys.argv[1]).resolve(), [int(word) for word in sys.argv[2:]]
    out, everyone = folder / "stages", trained(folder)
    out.mkdir(exist_ok=True)
    ledger.claim("stages", out, seeds)
    twins.TARGETS[ROOM] = twins.target_spectrum(ROOM)
    rows = []
    for scene in SCENES:
        for seeing in SEEING:
            for seed in seeds:
                tile = tile_of(out, scene, seeing, seed)
                for kind in KINDS:
                    for number, training in enumerate(everyone[kind]):
                        rows.append({"scene": scene, "seeing": seeing, "seed": seed, "kind": kind, "training": number, **judged(training, tile)})

    def mean(metric, kind, **where):
        name, scene = metric.split("_") if "_" in metric else (metric, None)
        picked = [r[name] for r in rows if r["kind"] == kind and (scene is None or r["scene"] == scene) and all(r[k] == v for k, v in where.items())]
        return float(np.mean(picked))

    values = {m: {kind: [mean(m, kind, training=i) for i in range(len(twins.SEEDS))] for kind in KINDS} for m in HEADS}
    summary = {"seeds": seeds, "tiles": len(SCENES) * len(SEEING) * len(seeds), "images": int((folder / "trained/images").read_text(encoding="utf-8")), "values": values,
               "differences": {m: differences(v) for m, v in values.items()},
               "by_seeing": {str(s): {m: {kind: mean(m, kind, seeing=s) for kind in KINDS} for m in HEADS} for s in SEEING}}
    (out / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    (out / "stages.md").write_text("\n".join(report(summary)), encoding="utf-8")


if __name__ == "__main__":
    main()
