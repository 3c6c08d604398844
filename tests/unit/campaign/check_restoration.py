"""Every number of a restoration summary.json from scenes.ecsv again, by scipy: check_restoration.py FOLDER."""
import csv
import json
import sys
from math import isclose, log

import numpy as np
from scipy import stats

folder = sys.argv[1]
summary = json.load(open(folder + "/summary.json"))
rows = csv.DictReader(line for line in open(folder + "/scenes.ecsv") if not line.startswith("#"))
scores = {}
for row in rows:
    for metric in ("psnr", "ssim"):
        key = row["by"], float(row["low"]), row["method"], metric
        scores.setdefault(key, []).append(float(row[metric]))
scores = {key: np.array(values) for key, values in scores.items()}


def same(what, ours, theirs, rel=1e-6):
    assert ours is not None and isclose(ours, theirs, rel_tol=rel, abs_tol=1e-9), (what, ours, theirs)


def holm(p):
    order = np.argsort(p)
    adjusted, most = np.empty(len(p)), 0
    for rank, i in enumerate(order):
        most = max(most, min(1, (len(p) - rank) * p[i]))
        adjusted[i] = most
    return adjusted


checked = 0
families = {}
for b in summary["bins"]:
    for method in b["methods"]:
        for metric in ("psnr", "ssim"):
            x = scores[b["by"], b["low"], method["method"], metric]
            low, high = stats.t.interval(0.95, len(x) - 1, x.mean(), stats.sem(x))
            mean, box = method[metric]["mean"], method[metric]["box"]
            same("mean", mean["value"], x.mean())
            same("low", mean["low"], low)
            same("high", mean["high"], high)
            same("median", box["median"], np.median(x))
            same("q1", box["q1"], np.percentile(x, 25))
            same("q3", box["q3"], np.percentile(x, 75))
            checked += 6
    for duel in b["duels"]:
        x = scores[b["by"], b["low"], duel["first"], duel["metric"]]
        y = scores[b["by"], b["low"], duel["second"], duel["metric"]]
        paired, two, d = stats.ttest_rel(x, y), stats.ttest_ind(x, y), x - y
        # scores are written with 9 digits: p moves with t, by more where t is large
        loose = 1e-6 * (1 + paired.statistic**2)
        same("t", duel["paired"]["statistic"], paired.statistic)
        same("p", duel["paired"]["p"], paired.pvalue, max(1e-5, loose))
        same("ln p", duel["paired"]["ln_p"], log(paired.pvalue), 1e-4)
        same("d_z", duel["paired"]["effect"], d.mean() / d.std(ddof=1))
        same("difference", duel["paired"]["difference"]["value"], d.mean())
        same("t two", duel["two_sample"]["statistic"], two.statistic)
        same("p two", duel["two_sample"]["p"], two.pvalue, 1e-4)
        assert duel["two_sample"]["dof"] == 2 * len(x) - 2
        same("wilcoxon", duel["wilcoxon"]["p"], stats.wilcoxon(x, y).pvalue, 1e-5)
        same("bootstrap", duel["bootstrap"]["value"], d.mean())
        assert duel["bootstrap"]["low"] < d.mean() < duel["bootstrap"]["high"]
        half = stats.t.ppf(0.975, len(x) - 1) * d.std(ddof=1) / len(x) ** 0.5
        same("bootstrap width", 0.5 * (duel["bootstrap"]["high"] - duel["bootstrap"]["low"]), half, 0.35)
        family = b["by"], duel["metric"], duel["first"], duel["second"]
        families.setdefault(family, []).append((duel, paired.pvalue, loose))
        checked += 11
for members in families.values():
    for (duel, p, loose), adjusted in zip(members, holm([p for _, p, _ in members])):
        same("holm", duel["paired_holm"], adjusted, max(1e-4, loose))
        winner = 0 if adjusted >= 0.05 else 1 if duel["paired"]["difference"]["value"] > 0 else -1
        assert duel["winner"] == winner
        checked += 2
for table in summary["paper_tables"]:
    for c in table["columns"]:
        p = 2 * stats.t.sf(c["t"], table["dof"])
        same("paper", c["p_from_t"], p, 1e-6)
        assert c["fits"] == (0.95 < c["p"] / p < 1.05), c
        checked += 2
print("restoration: %d numbers agree" % checked)
assert checked > 500
