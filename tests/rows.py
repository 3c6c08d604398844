"""The numbers of a campaign's summary.json from its rows.ecsv again, by scipy: rows.py FOLDER."""
import csv
import json
import math
import sys

import numpy as np
from scipy import stats

folder = sys.argv[1]
summary = json.load(open(folder + "/summary.json", encoding="utf-8"))
rows, cells, checked = {}, {}, 0


def lines(name):
    with open(f"{folder}/{name}.ecsv", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


for row in lines("rows"):
    rows.setdefault(tuple(row[key] for key in ("table", "scene", "condition", "run")), []).append(row)
for row in lines("cells"):
    cells[tuple(row[key] for key in ("scene", "condition", "run", "quantity"))] = \
        {key.removeprefix("value_"): float(row[key]) for key in ("value", "value_low", "value_high")} | {"setting": row["setting"]}


def values(table, scene, condition, run, column):
    return np.array([float(row[column]) for row in rows.get((table, scene, condition, run), ())])


def same(what, ours, theirs, rel=1e-5):
    global checked
    checked += 1
    ours, theirs = (math.nan if v is None else float(v) for v in (ours, theirs))
    assert ours == theirs or math.isnan(ours) and not math.isfinite(theirs) or math.isclose(ours, theirs, rel_tol=rel, abs_tol=2e-7), (what, ours, theirs)


def estimate(what, ours, value, low=None, high=None, rel=1e-5):
    same(what, ours["value"], value, rel)
    if low is not None:
        same(what + " low", ours["low"], low, rel)
        same(what + " high", ours["high"], high, rel)


def mean(what, ours, v):
    reach = stats.t.ppf(0.975, len(v) - 1) * stats.sem(v) if len(v) > 1 else math.nan
    estimate(what, ours, v.mean() if len(v) else math.nan, *(() if len(v) < 2 else (v.mean() - reach, v.mean() + reach)), rel=1e-4)


def share(what, ours, k, n):
    ends = stats.binomtest(int(k), int(n)).proportion_ci(0.95, "exact") if n else None
    estimate(what, ours, k / n if n else math.nan, *((ends.low, ends.high) if n else ()))


def rate(what, ours, k, extent):
    estimate(what, ours, k / extent, stats.chi2.ppf(0.025, 2 * k) / 2 / extent if k else 0, stats.chi2.ppf(0.975, 2 * k + 2) / 2 / extent)


def curve(scores, wrong):
    """Of falling score: score, right ones and false ones above it."""
    scores = scores[~np.isnan(scores)]
    return [(s, np.sum(scores >= s), np.sum(wrong >= s)) for s in sorted(set(scores) | set(wrong), reverse=True)]


def average_precision(points, n):
    ap, before = 0, 0
    for _, k, f in points:
        ap, before = ap + (k - before) / n * k / (k + f), k
    return ap


def cut(points, precision):
    return min((s for s, k, f in points if k >= precision * (k + f)), default=math.inf)


def spread(v):
    return 1.4826 * np.median(abs(v - np.median(v)))


def restoration():
    for (scene, condition, run, quantity), cell in cells.items():
        mean("mean", cell, values("scene", scene, condition, run, quantity))
        if run not in ("RL", "RL_SSIM"):
            continue
        tried = {}  # what RL is tuned to is the best of the scenes that are not in the test
        for row in rows["tuning", scene, condition, ""]:
            if float(row["niter"]) > 0 and float(row["threshold"]) < 0:
                tried.setdefault(row["number"], []).append((float(row["ssim" if run == "RL_SSIM" else "psnr"]), row["niter"]))
        best = max(tried.values(), key=lambda some: sum(value for value, _ in some))
        assert cell["setting"].startswith(f"RL_NITER {best[0][1]},"), (cell, best)


def photometry():
    runs = list(dict.fromkeys(key[2] for key in cells))
    fields = {}
    for one in summary["sets"]:
        fields.setdefault(one["scene"], []).append(one)
    for field, sets in fields.items():
        for run in runs:
            scores, wrong = (np.concatenate([values(table, field, s["condition"], run, "score") for s in sets]) for table in ("object", "false"))
            points, cuts = curve(scores, wrong), {}
            for c in (c for c in summary["cuts"] if (c["scene"], c["run"]) == (field, run)):
                whole = c["precision_from"] is None
                s = -math.inf if whole else cut(points, c["precision_from"])
                cuts[c["precision_from"]] = s
                if not whole:
                    same("threshold", c["score"], s)
                if s < math.inf:
                    share("precision", c["precision"], np.sum(scores >= s), np.sum(scores >= s) + np.sum(wrong >= s))
                share("recall", c["recall"], np.sum(scores >= s), len(scores))
            for s in sets:
                star = {key: values("object", field, s["condition"], run, key) for key in ("score", "ratio", "pull", "crowded")}
                false = values("false", field, s["condition"], run, "score")
                found, n = ~np.isnan(star["score"]), len(star["score"])
                percent, crowded, k = 100 * (star["ratio"] - 1)[found], star["crowded"][found] > 0, np.sum(found)
                ours = {key[3]: value for key, value in cells.items() if key[:3] == (field, s["condition"], run)}
                share("recall", ours["recall"], k, n)
                share("precision", ours["precision"], k, k + len(false))
                rate("false", ours["false"], len(false), s["mpixels"])
                share("blended", ours["blended"], np.sum(crowded), k)
                for precision in summary["precisions"]:
                    share("at precision", ours[f"recall_p{precision:g}"], np.sum(star["score"] >= cuts[precision]), n)
                estimate("ap", ours["ap"], average_precision(curve(star["score"], false), n))
                mean("magerr", ours["magerr"], abs(percent))
                mean("clean", ours["magerr_clean"], abs(percent[~crowded]))
                if k == 0:
                    continue
                ratio = star["ratio"][found]
                mag = -2.5 * np.log10(ratio[ratio > 0])
                for unit, v in (("percent", percent), ("mag", mag)):
                    estimate("bias", ours[f"bias_{unit}"], np.median(v))
                    estimate("scatter", ours[f"scatter_{unit}"], spread(v), rel=1e-4)
                pull = star["pull"][found]
                estimate("pull", ours["pull_median"], np.median(pull[~np.isnan(pull)]))


def detection():
    tuned = sorted({key[3] for key in rows if key[3].startswith("RL ")})
    for scene, condition in dict.fromkeys(key[:2] for key in cells):
        for run in dict.fromkeys(key[2] for key in cells if key[2] != "RL"):
            ours = {key[3]: c for key, c in cells.items() if key[:3] == (scene, condition, run)}
            both = [np.concatenate([values(t, s, condition, run, "score") for s in ("STARS", "GALAXIES")]) for t in ("object", "false")]
            points = curve(*both)
            first = cut(points, 0.95) if points else -math.inf
            found, wrong = (values(table, scene, condition, run, "score") for table in ("object", "false"))
            if scene == "PAIRS":
                apart = values("object", scene, condition, run, "apart")
                share("resolved", ours["resolved"], np.sum(found >= first), len(found))
                share("close", ours["resolved_close"], np.sum(found[apart < 0.75] >= first), np.sum(apart < 0.75))
                continue
            own, k = curve(found, wrong), np.sum(~np.isnan(found))
            estimate("ap", ours["ap"], average_precision(own, len(found)))
            for p in (0.95, 0.99):
                share("recall", ours[f"recall_p{p}"], np.sum(found >= cut(own, p)), len(found))
            snr = values("object", scene, condition, run, "true_snr")
            share("faint", ours["recall_snr5"], np.sum(found[snr < 10] >= cut(own, 0.95)), np.sum(snr < 10))
            share("recall", ours["recall"], k, len(found))
            share("precision", ours["precision"], k, k + len(wrong))
            rate("false", ours["false"], len(wrong), sum(float(row["mpixels"]) for row in rows["tile", scene, condition, ""]))
            ratio = values("object", scene, condition, run, "ratio")[~np.isnan(found)]
            mean("magerr", ours["magerr"], 100 * abs(ratio - 1))
        if tuned and scene in ("STARS", "GALAXIES"):  # RL at its best is the setting of the highest number
            lists = {run: [values(t, scene, condition, run, "score") for t in ("object", "false")] for run in tuned}
            aps = {run: average_precision(curve(*some), len(some[0])) for run, some in lists.items()}
            recalls = {run: np.mean(some[0] >= cut(curve(*some), 0.95)) for run, some in lists.items()}
            for key, numbers in ("ap", aps), ("recall_p0.95", recalls):
                best = cells[scene, condition, "RL", key]
                same("best", best["value"], max(numbers.values()))
                same("setting", best["value"], numbers[best["setting"]])


{"restoration": restoration, "photometry": photometry, "detection": detection}[summary["type"]]()
print(f"{summary['type']}: {checked} numbers agree")
assert checked > 100
