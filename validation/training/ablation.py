"""The table of ablation.sh: every variant beside the base, on the same test scenes.

    ablation.py SIZE KEYWORDS NAME|TITLE ...   inside ablation.sh's folder; the first variant is the base;
                                               KEYWORDS: those that all variants were given

Writes ablation.md and ablation.ecsv. Differences are variant minus base over what both did: scenes (PSNR, SSIM), seeings
(average precision, recall), sets of stars of one magnitude and seeing (|bias|, scatter); paired t, adjusted by Holm for
the number of variants. The same base with another seed shows what the luck of a training is worth.
"""
import glob
import math
import os
import re
import statistics
import sys

import numpy as np
from astropy.table import Table
from scipy import stats

LEAST_STARS = 10  # of a set, for bias and scatter
CLASSES = [(5, 12), (12, 50), (50, math.inf)]  # S/N of the stars
PARTS = ("psf", "ffl", "active", "rl", "half", "double", "blind", "transposed", "subpixel", "plain", "stretched")


def class_name(low, high):
    return f"{low}" if high == math.inf else f"{low}_{high}"


# name: (heading, digits, 1 where more is better, -1 where less is)
METRICS = {
    "psnr": ("PSNR (dB)", 2, 1),
    "ssim": ("SSIM", 4, 1),
    "ap_stars": ("AP, stars", 3, 1),
    "ap_galaxies": ("AP, galaxies", 3, 1),
    "recall_stars": ("recall, stars", 3, 1),
    "recall_galaxies": ("recall, galaxies", 3, 1),
}
for limits in CLASSES:
    words = f"S/N {limits[0]} to {limits[1]}" if limits[1] < math.inf else f"S/N above {limits[0]}"
    METRICS[f"absbias_{class_name(*limits)}"] = (f"abs. bias (%), {words}", 2, -1)
    METRICS[f"scatter_{class_name(*limits)}"] = (f"scatter (%), {words}", 2, -1)


def table(path):
    return Table.read(path, format="ascii.ecsv")


def cost(name):
    """Of the training and of the model: what the table's last columns say."""
    with open(f"{name}/epochs") as file:
        folder = f"{name}/epochs-{file.read().strip()}"
    log, dictionary = table(f"{folder}/training/log.ecsv"), table(f"{folder}/training/dictionary.ecsv")
    with open(f"{name}/info.txt") as file:
        info = file.read()
    with open(f"{folder}/train.err") as file:
        # of an epoch that was interrupted or done twice, the last report
        speed = {int(n): float(s) for n, s in re.findall(r"epoch (\d+) of .*?; (\d+) images/s", file.read())}
    speeds = [s for s in speed.values() if s > 0]
    side = re.search(r"^PATCH (\d+)$", info, re.M)
    pixels = (int(side[1]) if side else 128) ** 2 * log["patches"][-1] / 1e6
    all_images = float(np.sum(dictionary["train"]) + np.sum(dictionary["test"]))
    return {
        "patches": int(log["patches"][-1]),
        "epochs": int(log["epoch"][-1]),
        "steps": int(log["steps"][-1]),
        "test_loss": float(log["test_loss"][-1]),
        "kmac": float(re.search(r"([\d.]+) thousand multiplications", info)[1]),
        "parameters": int(re.search(r"(\d+) parameters", info)[1]),
        "seconds_per_mpixel": all_images / statistics.median(speeds) / pixels if speeds else math.nan,
    }


def samples(name):
    """{metric: {what it was measured on: value}}, and {class: {set: signed bias}}, and the checkerboard: of all seeds in the folder
    (models.sh), or of the one there is."""
    parts = {folder: campaigns(folder) for folder in sorted(glob.glob(f"{name}/seed-*")) or [name]}

    def joined(of, names):
        return {n: {(os.path.relpath(folder, name), *key): value for folder, part in parts.items() for key, value in part[of][n].items()} for n in names}
    return joined(0, METRICS), joined(1, CLASSES), max(part[2] for part in parts.values())


def campaigns(name):
    """The same of the campaigns of one folder."""
    found = {metric: {} for metric in METRICS}
    scenes = table(f"{name}/restoration/rows.ecsv")
    for row in scenes[scenes["table"] == "scene"]:
        key = (str(row["scene"]), float(row["condition"]), int(row["tile"]))
        found["psnr"][key], found["ssim"][key] = float(row["psnr"]), float(row["ssim"])
    board = 0.0
    for row in table(f"{name}/detection/cells.ecsv"):
        scene = str(row["scene"]).lower()
        if row["quantity"] == "ap":
            found[f"ap_{scene}"][str(row["condition"]),] = float(row["value"])
        elif row["quantity"] == "recall_p0.95":
            found[f"recall_{scene}"][str(row["condition"]),] = float(row["value"])
        elif str(row["quantity"]).startswith("phases"):
            board = max(board, float(row["value"]))
    bias = {limits: {} for limits in CLASSES}
    snr = {(str(row["scene"]), str(row["condition"])): row["snr"] for row in table(f"{name}/fluxes/sets.ecsv")}
    for row in table(f"{name}/fluxes/cells.ecsv"):
        key = str(row["scene"]), str(row["condition"])
        for limits in (limits for limits in CLASSES if limits[0] <= snr[key] < limits[1]):
            if row["quantity"] == "bias_percent" and row["value_n"] >= LEAST_STARS:
                bias[limits][key] = float(row["value"])
                found[f"absbias_{class_name(*limits)}"][key] = abs(float(row["value"]))
            elif row["quantity"] == "scatter_percent" and row["value_n"] >= LEAST_STARS:
                found[f"scatter_{class_name(*limits)}"][key] = float(row["value"])
    return found, bias, board


def common(sets):
    """What all variants measured, so that means are of the same things."""
    return sorted(set.intersection(*(set(s) for s in sets)))


def mean(values):
    return float(np.mean(values)) if len(values) else math.nan


def compare(first, second):
    """Mean difference, its 95 % interval, p of the paired t."""
    d = np.asarray(first) - np.asarray(second)
    if len(d) < 2:
        return mean(d), math.nan, math.nan, math.nan
    error = float(np.std(d, ddof=1)) / math.sqrt(len(d))
    if error == 0:
        return float(d[0]), float(d[0]), float(d[0]), 1.0 if d[0] == 0 else 0.0
    reach = float(stats.t.ppf(0.975, len(d) - 1)) * error
    p = 2 * float(stats.t.sf(abs(np.mean(d)) / error, len(d) - 1))
    return float(np.mean(d)), float(np.mean(d)) - reach, float(np.mean(d)) + reach, p


def holm(ps):
    adjusted, largest = dict(ps), 0.0
    known = sorted((p, name) for name, p in ps.items() if not math.isnan(p))
    for i, (p, name) in enumerate(known):
        largest = max(largest, min(1.0, p * (len(known) - i)))
        adjusted[name] = largest
    return adjusted


def gather(variants, cost_of=cost):
    rows = {name: {"variant": name, "title": title, **cost_of(name)} for name, title in variants}
    measured = {name: samples(name) for name in rows}
    base = variants[0][0]
    for metric in METRICS:
        keys = common([measured[name][0][metric] for name in rows])
        values = {name: [measured[name][0][metric][k] for k in keys] for name in rows}
        ps = {}
        for name, row in rows.items():
            row[metric], row[f"{metric}_n"] = mean(values[name]), len(keys)
            parts = compare(values[name], values[base])
            for part, value in zip(("diff", "diff_low", "diff_high", "p"), parts):
                row[f"{metric}_{part}"] = math.nan if name == base else value
            if name != base:
                ps[name] = parts[3]
        for name, p in holm(ps).items():
            rows[name][f"{metric}_p_holm"] = p
        rows[base][f"{metric}_p_holm"] = math.nan
    for limits in CLASSES:
        keys = common([measured[name][1][limits] for name in rows])
        for name, row in rows.items():
            row[f"bias_{class_name(*limits)}"] = mean([measured[name][1][limits][k] for k in keys])
    for name, row in rows.items():
        row["checkerboard"] = measured[name][2]
    return rows


def stars(p):
    return "" if not p < 0.05 else "\\*" if p >= 0.01 else "\\*\\*" if p >= 0.001 else "\\*\\*\\*"


def cell(row, metric):
    digits = METRICS[metric][1]
    if math.isnan(row[metric]):
        return "-"
    text = f"{row[metric]:.{digits}f}"
    if math.isnan(row[f"{metric}_diff"]):
        return text
    return f"{text} ({row[f'{metric}_diff']:+.{digits}f}{stars(row[f'{metric}_p_holm'])})"


def lines(heads, body):
    yield "| " + " | ".join(heads) + " |"
    yield "| " + " | ".join("---" for _ in heads) + " |"
    for row in body:
        yield "| " + " | ".join(row) + " |"
    yield ""


def quality(rows, what="variant"):
    """The tables of what the models do, a row each."""
    heads = [what, *(METRICS[m][0] for m in list(METRICS)[:6])]
    yield from lines(heads, ([r["title"], *(cell(r, m) for m in list(METRICS)[:6])] for r in rows.values()))
    yield ("PSNR and SSIM: restoration.conf, means over the scenes inside the training range. AP: average precision, and "
           "recall at precision 0.95: detection.conf, means over the seeings.")
    yield ""
    heads, body = [what], [[r["title"]] for r in rows.values()]
    for limits in CLASSES:
        name = class_name(*limits)
        words = f"S/N {limits[0]} to {limits[1]}" if limits[1] < math.inf else f"S/N above {limits[0]}"
        heads += [f"bias (%), {words}", f"abs. bias, {words}", f"scatter (%), {words}"]
        for line, r in zip(body, rows.values()):
            bias = r[f"bias_{name}"]
            line += ["-" if math.isnan(bias) else f"{bias:+.2f}", cell(r, f"absbias_{name}"), cell(r, f"scatter_{name}")]
    yield from lines(heads, body)
    yield (f"Fluxes of stars on restored pixels: fluxes.conf, means over sets (one magnitude, one seeing) of which every "
           f"{what} found {LEAST_STARS} stars or more; bias of a set: median of (F - F0) / F0.")
    yield ""


def verdicts(rows, base, parts=PARTS):
    """One sentence for each variant, by the rule in the text."""
    luck = rows.get("seed")
    for name, row in rows.items():
        if name not in parts:
            continue
        better, worse = [], []
        for metric, (heading, digits, sign) in METRICS.items():
            difference = row[f"{metric}_diff"]
            if not row[f"{metric}_p_holm"] < 0.05:
                continue
            if luck and not abs(difference) > abs(luck[f"{metric}_diff"]):
                continue
            (better if difference * sign > 0 else worse).append(f"{heading} {difference:+.{digits}f}")
        said = [f"better: {'; '.join(better)}"] if better else []
        said += [f"worse: {'; '.join(worse)}"] if worse else []
        yield f"- **{row['title']}**: {'. '.join(said) if said else 'no difference that counts'}."
    yield ""


def report(size, keywords, rows, base):
    uneven = max(abs(row["patches"] / rows[base]["patches"] - 1) for row in rows.values())
    yield f"# What each part buys ({size})"
    yield ""
    yield ("The base (ablation.train) has every part of the paper, is informed and ends in an RL step"
           + (f"; all networks have {keywords} besides" if keywords else "")
           + f". It has seen {rows[base]['patches']} training images in {rows[base]['steps']} steps; every other network "
           f"differs from it in one thing and has seen as many (within {100 * uneven:.1f} %). In brackets: difference to the "
           "base, paired over the same scenes, seeings or sets of stars; \\* \\*\\* \\*\\*\\*: p < 0.05, 0.01, 0.001, "
           "adjusted by Holm for the variants.")
    yield ""
    yield from quality(rows)
    yield from lines(
        ["variant", "training images", "epochs", "thousand MAC per pixel", "parameters", "training, s per Mpixel",
         "checkerboard (sigma)"],
        ([r["title"], str(r["patches"]), str(r["epochs"]), f"{r['kmac']:.1f}", str(r["parameters"]),
          f"{r['seconds_per_mpixel']:.2f}", f"{r['checkerboard']:.2g}"] for r in rows.values()))
    yield ("Training: wall-clock time on the machine that did it, its other work included, tests of every epoch included. "
           "Checkerboard: largest difference between phases on a bright plateau.")
    yield ""
    yield "## Read"
    yield ""
    yield ("A difference counts where p < 0.05 after Holm"
           + (" and where it is larger than that between two seeds of the base." if "seed" in rows else "."))
    yield ""
    yield from verdicts(rows, base)


HELP = {
    "variant": "name of its folder",
    "title": "what differs from the base",
    "patches": "training images",
    "epochs": "of the training",
    "steps": "of the optimiser",
    "test_loss": "of the last epoch, in the variant's own loss",
    "kmac": "thousand multiplications per pixel, RESTORE",
    "parameters": "of RESTORE",
    "seconds_per_mpixel": "of training, wall clock, tests of every epoch included",
    "checkerboard": "largest difference between phases on a bright plateau (sky sigmas)",
}
ENDS = {
    "_diff": "mean paired difference to the base",
    "_diff_low": "lower end of its 95 % interval",
    "_diff_high": "upper end of its 95 % interval",
    "_p": "of the paired t, two-sided",
    "_p_holm": "adjusted for the variants",
    "_n": "scenes, seeings or sets of stars",
}


def described(name):
    if name in HELP:
        return HELP[name]
    if name.startswith("bias_"):
        return "mean over sets of the median of 100 (F - F0) / F0"
    for metric, (heading, _, _) in METRICS.items():
        if name == metric:
            return heading
        if name.startswith(metric) and name[len(metric):] in ENDS:
            return f"{heading}: {ENDS[name[len(metric):]]}"
    return ""


def rounded(value):
    return float(f"{value:.9g}") if isinstance(value, float) else value


def main():
    size, keywords, variants = sys.argv[1], sys.argv[2], [word.split("|", 1) for word in sys.argv[3:]]
    rows, base = gather(variants), variants[0][0]
    with open("ablation.md", "w") as file:
        file.write("\n".join(report(size, keywords, rows, base)))
    names = list(rows[base])
    out = Table({n: [rounded(row[n]) for row in rows.values()] for n in names}, names=names)
    for name in names:
        out[name].description = described(name)
    out.meta["title"] = f"what each part buys ({size})"
    out.meta["keywords"] = keywords
    out.meta["differences"] = "variant minus base, paired; p: paired t; p_holm: adjusted for the variants"
    out.write("ablation.ecsv", format="ascii.ecsv", delimiter=",", overwrite=True)


if __name__ == "__main__":
    main()
