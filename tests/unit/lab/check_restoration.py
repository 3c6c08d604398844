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
    for quantity in ("psnr", "ssim"):
        key = row["scene"], row["condition"], row["run"], quantity
        scores.setdefault(key, []).append(float(row[quantity]))
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
for cell in summary["cells"]:
    x = scores[cell["scene"], cell["condition"], cell["run"], cell["quantity"]]
    low, high = stats.t.interval(0.95, len(x) - 1, x.mean(), stats.sem(x))
    same("mean", cell["value"]["value"], x.mean())
    same("low", cell["value"]["low"], low)
    same("high", cell["value"]["high"], high)
    checked += 3
for box in summary["boxes"]:
    x = scores[box["scene"], box["condition"], box["run"], box["quantity"]]
    same("median", box["median"], np.median(x))
    same("q1", box["q1"], np.percentile(x, 25))
    same("q3", box["q3"], np.percentile(x, 75))
    checked += 3
for test in summary["contests"]:
    x = scores[test["scene"], test["condition"], test["first"], test["quantity"]]
    y = scores[test["scene"], test["condition"], test["second"], test["quantity"]]
    d = x - y
    # scores are written with 9 digits: p moves with t, by more where t is large
    if test["test"] == "paired t":
        paired = stats.ttest_rel(x, y)
        loose = 1e-6 * (1 + paired.statistic**2)
        same("t", test["statistic"], paired.statistic)
        same("p", test["p"], paired.pvalue, max(1e-5, loose))
        same("ln p", test["ln_p"], log(paired.pvalue), 1e-4)
        same("d_z", test["effect"], d.mean() / d.std(ddof=1))
        same("difference", test["difference"]["value"], d.mean())
        family = test["scene"], test["quantity"], test["first"], test["second"]
        families.setdefault(family, []).append((test, paired.pvalue, loose))
        checked += 5
    elif test["test"] == "two samples":
        two = stats.ttest_ind(x, y)
        same("t two", test["statistic"], two.statistic)
        same("p two", test["p"], two.pvalue, 1e-4)
        assert test["dof"] == 2 * len(x) - 2
        checked += 3
    elif test["test"] == "Wilcoxon":
        same("wilcoxon", test["p"], stats.wilcoxon(x, y).pvalue, 1e-5)
        checked += 1
    else:
        same("bootstrap", test["difference"]["value"], d.mean())
        assert test["difference"]["low"] < d.mean() < test["difference"]["high"]
        half = stats.t.ppf(0.975, len(x) - 1) * d.std(ddof=1) / len(x) ** 0.5
        same("bootstrap width", 0.5 * (test["difference"]["high"] - test["difference"]["low"]), half, 0.35)
        checked += 3
for members in families.values():
    for (test, p, loose), adjusted in zip(members, holm([p for _, p, _ in members])):
        same("holm", test["holm"], adjusted, max(1e-4, loose))
        better = test["first"] if test["difference"]["value"] > 0 else test["second"]
        assert test["winner"] == (None if adjusted >= 0.05 else better)
        checked += 2
for c in summary["paper"]:
    p = 2 * stats.t.sf(c["paper_t"], c["dof"])
    same("paper", c["p_from_t"], p, 1e-6)
    assert c["fits"] == (0.95 < c["paper_p"] / p < 1.05), c
    checked += 2
print("restoration: %d numbers agree" % checked)
assert checked > 500
