#!/usr/bin/env python3
"""What the paper's recipe is worth: the PSF network with its cycles and active learning, on informed and blind networks, with
several seeds each.

    recipes.py FOLDER SEED [EPOCHS]      SEED of the skies that judge: below 1000 to choose by, from 1000 on final (ledger.py)

FOLDER may hold networks that twins.sh trained on a GPU, on 26 times as many pixels: then they are judged as they are.

Trains {both networks with L_idt + L_rec + L_ffl, RESTORE alone} x {ACTIVE, UNIFORM} x {INFORMED, BLIND} with training seeds 1, 2
and 3, as many trainings at a time as there are cores, each on one thread; runs the campaigns restoration, detection and fluxes
on each model; writes recipes.md and summary.json. Started again after an interruption it goes on where it was.

EPOCHS (default 32) is that of ACTIVE, which by the paper's Eq. 4 takes about two thirds as many of an epoch's images for the
training as UNIFORM, so that this has two thirds of the epochs; how many images each cell has seen is in the page. Networks are of
the shapes of config/psfnet.fits and config/psfnet-blind.fits, images those of psfnet-ideal.train, 64 pixels a side: early in a
training, as one of the supplied length takes hours with both networks.

One number of one training is one observation: a factor's effect is the difference of means over six trainings each, its error
that of the scatter between seeds within the cells (8 degrees of freedom). RX_SIZE=tiny: does it work? RX_TRAIN, RX_VALIDATE: the
programs. Needs python3 with astropy and scipy."""
import concurrent.futures
import itertools
import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy import stats

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import ledger
from ablation import METRICS, common, holm, lines, samples, stars

TINY = os.environ.get("RX_SIZE") == "tiny"
SEEDS = (1, 2) if TINY else (1, 2, 3)
MODES = {"INFORMED": "-BLOCKS 2 -RL_STEPS 1", "BLIND": "-MODE BLIND -DECODER SUBPIXEL -BLOCKS 5 -RL_STEPS 0 -LOSS_FLOOR 3 -CLIP_IMAGE 0.5"}
NETWORKS = {"both": "-LOSS_IDT 1 -LOSS_IDT_PSF 1 -LOSS_REC 1 -LOSS_REC_PSF 1 -LOSS_FFL 1",
            "alone": "-LOSS_IDT 1 -LOSS_IDT_PSF 0 -LOSS_REC 0 -LOSS_REC_PSF 0 -LOSS_FFL 1"}
SELECTIONS = ("ACTIVE", "UNIFORM")
IMAGES = "-PATCH 48 -PATCH_MARGIN 8 -GRID 2,2 -BIN_IMAGES 20 -BATCH 4" if TINY else "-PATCH 64 -FIELD_PATCHES 4 -BIN_IMAGES 40"
CAMPAIGNS = {
    "restoration": "-EXAMPLES 0 " + ("-SCENES_FWHM 2 -SCENES_SIGMA 2 -FWHM_RANGE 3,4 -SIGMA_RANGE 2,3 -SCENE_SIDE 96" if TINY else
                                     "-SCENES_FWHM 10 -SCENES_SIGMA 5 -FWHM_RANGE 2,8 -SIGMA_RANGE 2,15"),
    "detection": "-SCENES STARS,GALAXIES " + ("-SCENE_TILES 1 -SEEING 2.5,4 -SIM.IMAGE_SIZE 192" if TINY else "-SCENE_TILES 3"),
    "fluxes": "-TILES 2 " + ("-SEEING 3 -MAGNITUDES 18,21,1 -STARS_PER_TILE 150 -SIM.IMAGE_SIZE 192" if TINY else "-SEEING 2.5,4,6"),
}
# An effect's sign: the first less the second.
EFFECTS = {"PSF network and cycles": lambda c: (1 if c[0] == "both" else -1), "active learning": lambda c: (1 if c[1] == "ACTIVE" else -1)}


def program(name):
    path = Path(os.environ.get({"rextract-train": "RX_TRAIN", "rextract-validate": "RX_VALIDATE"}[name], HERE.parents[1] / "build" / name))
    if not os.access(path, os.X_OK):
        sys.exit(f"recipes.py: {path} is missing; build first (./quickstart)")
    return str(path.resolve())


def name_of(mode, network, selection, seed):
    return f"{mode}-{network}-{selection}-{seed}".lower()


def run(folder, command):
    with open(folder / "log", "a", encoding="utf-8") as log:
        done = subprocess.run(command, cwd=folder, stdout=log, stderr=subprocess.STDOUT, env={**os.environ, "OMP_NUM_THREADS": "1"})
    if done.returncode:
        raise SystemExit(f"recipes.py: {' '.join(command[:2])} fails: see {folder / 'log'}")


def train(out, mode, network, selection, seed, epochs):
    folder = out / name_of(mode, network, selection, seed)
    folder.mkdir(exist_ok=True)
    if (folder / "trained").exists():
        return
    words = " ".join((MODES[mode], NETWORKS[network], IMAGES)).split()
    run(folder, [program("rextract-train"), "../ablation.train", "-SEED", str(seed), "-SELECTION", selection, "-EPOCHS",
                 str(epochs if selection == "ACTIVE" else round(0.66 * epochs)), *words, "-NTHREADS", "1"])
    (folder / "trained").touch()


def judge(out, name, seed):
    folder = out / name
    for campaign, words in CAMPAIGNS.items():
        if not (folder / campaign / "summary.json").exists():
            run(folder, [program("rextract-validate"), "-c", f"../{campaign}.conf", "-RESTORE_TYPE", "NET", "-SEED", str(seed), "-QA_FIGURES", "N",
                         "-VERBOSE_TYPE", "QUIET", "-NTHREADS", "1", *words.split()])


def images_of(out, name):
    """Training images that it has seen."""
    rows = [line for line in (out / name / "training/log.ecsv").read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return int(dict(zip(rows[0].split(","), rows[-1].split(",")))["patches"])


def analyse(values):
    """values: {(network, selection): one number of each seed}. Effects with error, p, and the scatter between seeds."""
    within = sum(np.sum((np.array(v) - np.mean(v)) ** 2) for v in values.values())
    freedom = sum(len(v) - 1 for v in values.values())
    sigma = math.sqrt(within / freedom)
    found = {}
    for effect, sign in EFFECTS.items():
        sides = {s: np.concatenate([v for c, v in values.items() if sign(c) == s]) for s in (1, -1)}
        difference = float(np.mean(sides[1]) - np.mean(sides[-1]))
        error = sigma * math.sqrt(sum(1 / len(side) for side in sides.values()))
        p = 2 * float(stats.t.sf(abs(difference) / error, freedom)) if error > 0 else float(difference == 0)
        found[effect] = {"difference": difference, "error": error, "p": p}
    return found, sigma


def gather(out):
    """{metric: {mode: {"cells", "effects", "sigma"}}}; p_holm: adjusted for all effects of all metrics."""
    cells = list(itertools.product(MODES, NETWORKS, SELECTIONS, SEEDS))
    os.chdir(out)  # samples() reads from the folder of all models
    measured = {cell: samples(name_of(*cell))[0] for cell in cells}
    found = {}
    for metric in METRICS:
        keys = common([one[metric] for one in measured.values()])
        if not keys:
            continue
        found[metric] = {"n": len(keys)}
        for mode in MODES:
            values = {(n, s): [float(np.mean([measured[mode, n, s, seed][metric][k] for k in keys])) for seed in SEEDS]
                      for n in NETWORKS for s in SELECTIONS}
            effects, sigma = analyse(values)
            found[metric][mode] = {"cells": {" ".join(c): v for c, v in values.items()}, "effects": effects, "sigma": sigma}
    adjusted = holm({(metric, mode, effect): found[metric][mode]["effects"][effect]["p"] for metric in found for mode in MODES for effect in EFFECTS})
    for (metric, mode, effect), p in adjusted.items():
        found[metric][mode]["effects"][effect]["p_holm"] = p
    return found


def report(found, images, twins):
    side = twins or IMAGES.split()[1]
    seen = min(images.values()), max(images.values())
    yield "# The paper's recipe against RESTORE alone"
    yield ""
    yield (f"Networks of {seen[0] if seen[0] == seen[1] else f'{seen[0]} to {seen[1]}'} training images of {side} x {side} pixels"
           f"{', trained by twins.py on a GPU,' if twins else ','} {len(SEEDS)} seeds a cell: "
           "mean over the seeds ± their scatter; then each factor's effect ± its error, a training being one observation; \\* \\*\\* "
           "\\*\\*\\*: p < 0.05, 0.01, 0.001, adjusted by Holm for all effects of both tables.")
    yield ""
    for part in (list(METRICS)[:6], list(METRICS)[6:]):
        part = [metric for metric in part if metric in found]
        body = []
        for mode in MODES:
            for network, selection in itertools.product(NETWORKS, SELECTIONS):
                of = [images[mode, network, selection, seed] for seed in SEEDS]
                row = [f"{mode}, {'both networks' if network == 'both' else 'RESTORE alone'}, {selection}{'' if twins else f' ({min(of)} to {max(of)} images)'}"]
                for metric in part:
                    values, digits = found[metric][mode]["cells"][f"{network} {selection}"], METRICS[metric][1]
                    row.append(f"{np.mean(values):.{digits}f} ± {np.std(values, ddof=1):.{digits}f}")
                body.append(row)
            for effect in EFFECTS:
                row = [f"{mode}: {effect}"]
                for metric in part:
                    one, digits = found[metric][mode]["effects"][effect], METRICS[metric][1]
                    row.append(f"{one['difference']:+.{digits}f} ± {one['error']:.{digits}f}{stars(one['p_holm'])}")
                body.append(row)
        yield from lines(["", *(METRICS[m][0] for m in part)], body)
    yield "PSNR and SSIM: restoration.conf inside the training range. AP, recall at precision 0.95: detection.conf. Fluxes on restored pixels: fluxes.conf."
    yield ""
    yield "## Read"
    yield ""
    for mode, effect in itertools.product(MODES, EFFECTS):
        better, worse = [], []
        for metric, (heading, digits, sign) in METRICS.items():
            one = found.get(metric, {}).get(mode, {}).get("effects", {}).get(effect)
            if one and one["p_holm"] < 0.05:
                (better if one["difference"] * sign > 0 else worse).append(f"{heading} {one['difference']:+.{digits}f}")
        said = [f"{word}: {'; '.join(each)}" for word, each in (("better", better), ("worse", worse)) if each]
        yield f"- **{mode}, {effect}**: {'. '.join(said) if said else 'no difference beyond the luck of the seed'}."
    yield ""


def main():
    if not 3 <= len(sys.argv) <= 4 or not all(a.isdigit() for a in sys.argv[2:]):
        sys.exit(__doc__)
    out, seed, epochs = Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 8 if TINY else 32
    cells = list(itertools.product(MODES, NETWORKS, SELECTIONS, SEEDS))
    out.mkdir(parents=True, exist_ok=True)
    for source in (HERE / "ablation.train", *(HERE.parent / f"{campaign}.conf" for campaign in CAMPAIGNS)):
        shutil.copy(source, out)
    twins = (out / "twins").read_text(encoding="utf-8").strip() if (out / "twins").exists() else ""  # the side of their images
    settings = json.dumps([seed, epochs, SEEDS, MODES, NETWORKS, twins or IMAGES, CAMPAIGNS])
    if (out / "settings").exists() and (out / "settings").read_text(encoding="utf-8") != settings:
        sys.exit(f"recipes.py: {out} was begun with other settings; take another folder")
    (out / "settings").write_text(settings, encoding="utf-8")
    # those of many steps first
    cells.sort(key=lambda cell: (cell[1] != "both", cell[3]))
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda cell: train(out, *cell, epochs), [] if twins else cells))
        ledger.claim("recipes", out, [seed])
        list(pool.map(lambda cell: judge(out, name_of(*cell), seed), cells))
    images = {cell: images_of(out, name_of(*cell)) for cell in cells}
    found = gather(out)
    Path("recipes.md").write_text("\n".join(report(found, images, twins)), encoding="utf-8")
    summary = {"seed": seed, "images": {"least": min(images.values()), "most": max(images.values())}, "epochs": None if twins else epochs, "metrics": found}
    Path("summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
