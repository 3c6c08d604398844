"""Numbers of a photometry summary.json from the raw stars again: check_photometry.py FOLDER (with its raw.csv:
field,set,run,kind,score,ratio,pull,crowded; kind 1 star, 0 false)."""
import csv
import json
import sys
from math import inf, isclose, nan

import numpy as np
from scipy import stats

folder = sys.argv[1]
summary = json.load(open(folder + "/summary.json"))
stars, false = {}, {}
for row in csv.reader(open(folder + "/raw.csv")):
    key = int(row[0]), int(row[1]), int(row[2])
    if row[3] == "1":
        stars.setdefault(key, []).append([float(v) for v in row[4:8]])
    else:
        false.setdefault(key, []).append(float(row[4]))
stars = {key: np.array(values) for key, values in stars.items()}
names = [run["name"] for run in summary["runs"]]
checked = 0


def same(what, ours, theirs, rel=1e-6):
    global checked
    checked += 1
    if ours is None or not isclose(ours, theirs, rel_tol=rel, abs_tol=1e-9):
        raise AssertionError((what, ours, theirs))


def share(what, ours, k, n):
    if n == 0:
        assert ours["value"] is None
        return
    ci = stats.binomtest(int(k), int(n)).proportion_ci(0.95, "exact")
    same(what, ours["value"], k / n)
    same(what + " low", ours["low"], ci.low)
    same(what + " high", ours["high"], ci.high)


def holm(p):
    order = np.argsort(p, kind="stable")
    adjusted, most = np.empty(len(p)), 0
    for rank, i in enumerate(order):
        most = max(most, min(1, (len(p) - rank) * p[i]))
        adjusted[i] = most
    return adjusted


def mcnemar(b, c):
    return stats.binomtest(int(b), int(b + c)).pvalue if b + c > 0 else 1.0


def average_precision(found, wrong, n):
    ap, before = 0, 0
    for s in sorted(set(found) | set(wrong), reverse=True):
        k, f = np.sum(found >= s), np.sum(wrong >= s)
        ap += (k / n - before) * k / (k + f)
        before = k / n
    return ap


def threshold(field, run, wanted):
    sets = [k for f, k, r in stars if f == field and r == run]
    found = np.concatenate([stars[field, k, run][:, 0] for k in sets])
    found = found[~np.isnan(found)]
    wrong = np.concatenate([false[field, k, run] for k in sets])
    best = inf
    for s in sorted(set(found) | set(wrong), reverse=True):
        k = np.sum(found >= s)
        if k / (k + np.sum(wrong >= s)) >= wanted:
            best = s
    return best


def rows(table, **keys):
    return [row for row in summary[table] if all(row[key] == value for key, value in keys.items())]


fields = list(dict.fromkeys(row["scene"] for row in summary["sets"]))
for f, field in enumerate(fields):
    sets = rows("sets", scene=field)
    cuts = {}
    for r, name in enumerate(names):
        whole = [c for c in rows("cuts", scene=field, run=name) if c["precision_from"] is None][0]
        equal = [c for c in rows("cuts", scene=field, run=name) if c["precision_from"] is not None]
        cuts[r] = [threshold(f, r, c["precision_from"]) for c in equal]
        for c, mine in zip(equal, cuts[r]):
            same("threshold", c["score"], mine)
        count = sum(len(false[f, k, r]) for k in range(len(sets)))
        area = sum(s["mpixels"] for s in sets)
        same("false per Mpixel", whole["false_per_mpixel"]["value"], count / area)
        same("its limit", whole["false_per_mpixel"]["high"], stats.chi2.ppf(0.975, 2 * count + 2) / 2 / area)
    for k, s in enumerate(sets):
        for r, name in enumerate(names):
            cells = rows("cells", scene=field, condition=s["condition"], run=name)
            ours = {cell["quantity"]: cell["value"] for cell in cells}
            data, wrong = stars[f, k, r], np.array(false[f, k, r])
            found = data[~np.isnan(data[:, 0])]
            share("recall", ours["recall"], len(found), len(data))
            share("precision", ours["precision"], len(found), len(found) + len(wrong))
            share("blended", ours["blended"], np.sum(found[:, 3] > 0), len(found))
            for precision, cut in zip(summary["precisions"], cuts[r]):
                share("completeness", ours["recall_p%g" % precision], np.sum(found[:, 0] >= cut), len(data))
            same("ap", ours["ap"]["value"], average_precision(found[:, 0], wrong, len(data)))
            if len(found) == 0:
                continue
            percent = 100 * (found[:, 1] - 1)
            same("magerr", ours["magerr"]["value"], np.abs(percent).mean())
            clean = np.abs(percent[found[:, 3] == 0])
            if len(clean) > 0:
                same("magerr_clean", ours["magerr_clean"]["value"], clean.mean())
            for unit, values in (("percent", percent), ("mag", -2.5 * np.log10(found[:, 1][found[:, 1] > 0]))):
                same("bias", ours["bias_" + unit]["value"], np.median(values), 1e-5)
                mad = 1.4826 * np.median(np.abs(values - np.median(values)))
                same("scatter", ours["scatter_" + unit]["value"], mad, 1e-4)
            same("pull", ours["pull_median"]["value"], np.median(found[:, 2]), 1e-5)
    for first, second in dict.fromkeys((c["first"], c["second"]) for c in rows("contests", scene=field)):
        a, b = names.index(first), names.index(second)

        def tests(quantity, test):
            both = rows("contests", scene=field, first=first, second=second, quantity=quantity, test=test)
            return {row["condition"]: row for row in both}
        found = tests("found", "McNemar")
        cut = tests("found at precision %g" % summary["precisions"][0], "McNemar")
        paired, ranks = (tests("100 |F - F0| / F0", test) for test in ("paired t", "Wilcoxon"))
        p_found, p_error, p_cut = [], [], []
        for k, s in enumerate(sets):
            mag = s["condition"]
            x, y = stars[f, k, a], stars[f, k, b]
            in_x, in_y = ~np.isnan(x[:, 0]), ~np.isnan(y[:, 0])
            assert found[mag]["only_first"] == np.sum(in_x & ~in_y)
            p_found.append(mcnemar(np.sum(in_x & ~in_y), np.sum(in_y & ~in_x)))
            same("mcnemar", found[mag]["p"], p_found[-1], 1e-5)
            in_x, in_y = x[:, 0] >= cuts[a][0], y[:, 0] >= cuts[b][0]
            p_cut.append(mcnemar(np.sum(in_x & ~in_y), np.sum(in_y & ~in_x)))
            same("mcnemar at precision", cut[mag]["p"], p_cut[-1], 1e-5)
            both = ~np.isnan(x[:, 1]) & ~np.isnan(y[:, 1])
            ex, ey = 100 * np.abs(x[both, 1] - 1), 100 * np.abs(y[both, 1] - 1)
            p_error.append(nan)
            if len(ex) > 1:
                t = stats.ttest_rel(ex, ey)
                p_error[-1] = t.pvalue
                same("t", paired[mag]["statistic"], t.statistic, 1e-5)
                same("wilcoxon", ranks[mag]["p"], stats.wilcoxon(ex, ey, correction=len(ex) > 50).pvalue, 1e-4)
        for s, p, q in zip(sets, holm(p_found), holm(p_cut)):
            same("holm", found[s["condition"]]["holm"], p, 1e-5)
            same("holm at precision", cut[s["condition"]]["holm"], q, 1e-5)
        known = [i for i, p in enumerate(p_error) if p == p]
        for i, p in zip(known, holm([p_error[i] for i in known])):
            same("holm of errors", paired[sets[i]["condition"]]["holm"], p, 1e-4)
print("photometry: %d numbers agree" % checked)
assert checked > 500
