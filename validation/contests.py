#!/usr/bin/env python3
"""Tests between the runs of a campaign, and what became of the paper's claims and this program's goals.

    contests.py FOLDER     that rextract-validate wrote: contests.ecsv and claims.ecsv beside it; the verdicts are printed

Made from rows.ecsv (every scene, object, star and false detection, for every run), from cells.ecsv, and from the settings and
thresholds of summary.json. Contests of two runs are of the same things:

    RESTORATION  PSNR and each kind of SSIM of the scenes of a bin: Student's paired t, Wilcoxon's signed ranks, the paper's two
                 samples, and the bootstrapped interval of the mean difference
    PHOTOMETRY   stars found, on whole lists and at each precision of PRECISIONS: McNemar's exact test; 100 |F - F0| / F0 of the
                 stars that both found: paired t and Wilcoxon
    DETECTION    objects found, each run at its own cut for the first precision on that scene: McNemar

holm is p adjusted for the conditions of a scene (Holm 1979); a winner is named by paired t and McNemar where that is below 0.05.
A claim is reproduced, not reproduced (the other is clearly above somewhere), or undecided. What a test that decides nothing would have
found in 8 of 10 campaigns stands behind its condition.
Needs python3 with scipy.
"""
import csv
import json
import sys
from pathlib import Path

import numpy as np
from scipy import stats

CLEAR = 0.05
UNTESTED = "not tested here"
VERDICTS = {True: "reproduced", False: "not reproduced", None: "undecided"}
PRINTED = {"FWHM": (2, 4, 6, 8, 10, 12, 14), "noise": (2, 9, 12, 15, 18, 21, 23, 25)}  # columns of the paper's Tables 1 to 4
QUALITIES = ("psnr", "ssim", "ssim_wang", "ssim_object")
COLUMNS = ("scene", "condition", "quantity", "first", "second", "test", "difference", "low", "high", "statistic", "dof", "p", "holm",
           "winner", "effect", "only_first", "only_second")

# name: place in the paper (Jia et al. 2023, MNRAS 527, 6581), what is claimed, when it counts as reproduced
CLAIMS = {
    "every bin": ("Section 3.2, Figure 5", "The network consistently outperforms RL under all PSFs and noise levels, by PSNR and by SSIM.",
                  "mean PSNR and mean SSIM (K .001, as the paper) of NET above those of one RL image in every bin, paired t, p adjusted by "
                  "Holm < 0.05"),
    "every bin, SSIM of Wang": ("Section 3.2, Figure 5", "The same with the SSIM of Wang et al. (2004), K1 .01 and K2 .03.",
                                "mean SSIM of NET above that of RL in every bin (as above)"),
    "every bin, SSIM of the object": ("Section 3.2, Figure 5", "The same with the paper's SSIM on the pixels of the object.",
                                      "mean SSIM over the brightest pixels with 90 % of the light (as above)"),
    "every bin, against the blur": ("Section 3.2, Figure 5", "The same against the RL that is tuned for SSIM, which is a blur.",
                                    "mean PSNR and mean SSIM of NET above those of RL_SSIM in every bin (as above)"),
    "all p < 0.05": ("Section 3.2, Tables 1 to 4",
                     "All t-tests between RL and the network have p below 0.05; no difference is rejected in all cases.",
                     "NET above RL with p of the two-sample t below 0.05 in all 30 columns, as printed (not adjusted)"),
    "noise": ("Section 3.2, Figure 5", "The advantage is significant where noise varies; the network is robust and stable with noisy data.",
              "NET above RL in every noise bin (as above), and its mean PSNR falls less than RL's from the first to the last"),
    "training range": ("Section 3.2, Figure 6", "Within the training range the network significantly enhances the images.",
                       "NET above the blurred images in every bin inside the training: its seeing, and its noise levels (on the model's "
                       "scale, of the blurred scene); PSNR and SSIM, paired t, Holm < 0.05"),
    "generalisation": ("Section 3.2, Figure 7",
                       "The network generalises: images of larger FWHM or higher noise than in training are restored, too.",
                       "NET above the blurred images and above RL in every other bin, PSNR and SSIM, paired t, Holm < 0.05"),
    "speed": ("Section 3.3, Figure 8", "The network needs about a tenth of the time of RL with a given PSF.",
              "not a matter of this campaign: its files hold no timings"),
    "no artificial features": ("Section 3.3", "Building on PSFs and deconvolution, the network in principle generates no artificial features.",
                               "not a matter of this campaign: PSNR and SSIM do not single out invented detail"),
    "restored better": ("Section 3.3, Figure 9", "Restored images, RL's included, show higher recall and precision.",
                        "for every restorer and field: completeness at equal precision above that of NONE (matched filter) at one "
                        "magnitude or more and below it at none (McNemar on the same stars, Holm < 0.05), at every precision compared; "
                        "a loss as large as the gain would have been found"),
    "network best": ("Section 3.3, Figure 9", "The data treated with the network have the highest recall and precision.",
                     "the same for NET against NONE and against RL"),
    "low S/N": ("Section 3.3, Figure 9",
                "The network significantly improves the detection of stars of low signal-to-noise ratio.",
                "NET above NONE and above RL at equal precision, for magnitudes of S/N below 10 (as above)"),
    "photometry": ("Section 3.3, Figure 9 (top)", "The network enhances the accuracy of photometry.",
                   "|error| of NET below that of NONE at one magnitude or more and above it at none (paired t on the stars both "
                   "found, Holm < 0.05); a loss as large as the gain would have been found"),
    "goal: above RL": ("a goal of this program", "The network restores better than RL with a Gaussian filter, tuned in RL's favour.",
                       "NET above RL, both metrics, in every bin inside the training range (paired t, Holm < 0.001) and in more than "
                       "half of the bins beyond it (Holm < 0.05)"),
    "goal: above RL_FLAT": ("a goal of this program", "It does so, too, where RL's sky is set flat by the best threshold.",
                            "the same against RL_FLAT"),
    "goal: detection": ("a goal of this program", "More is found on the network's images, at every seeing, of stars and of galaxies.",
                        "ap and recall at the first precision of NET above those of NONE, of the matched filter and of RL at its best, "
                        "for STARS and GALAXIES under every condition in which restorers are given the truth"),
    "goal: close pairs": ("a goal of this program", "The network tells twice as many close pairs apart as are told apart unrestored.",
                          "share of PAIRS resolved at the first precision's cut, NET at least twice that of NONE and of the matched "
                          "filter, at every seeing"),
    "goal: fluxes": ("a goal of this program", "Fluxes on the network's pixels are as good as RL's, and those of stars unbiased.",
                     "MagErr of NET at or below RL's at every magnitude; for S/N above 12 its median bias below 1 % and its scatter at "
                     "most 1.5 times that of NONE; on every simulated field on which restorers are given the truth"),
    "goal: templates": ("a goal of this program", "No flux is better than that of template photometry, whatever restored the shapes.",
                        "on the stars that every run found, MagErr of every restorer's TEMPLATE at or below the least of the other "
                        "fluxes, or above by less than 1.96 errors of the paired difference, at every magnitude of every simulated "
                        "field on which restorers are given the truth, and of every real one"),
}


def read(path):
    with open(path, encoding="utf-8") as file:
        yield from csv.DictReader(line for line in file if not line.startswith("#"))


class Campaign:
    def __init__(self, folder):
        self.summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        self.kind = self.summary["type"]
        self.cells = {(r["scene"], r["condition"], r["run"], r["quantity"]): r for r in read(folder / "cells.ecsv")}
        self.runs = list(dict.fromkeys(key[2] for key in self.cells))
        self.rows = {}  # table, scene, condition, run: a column each, in the order of the things
        for row in read(folder / "rows.ecsv"):
            self.rows.setdefault(tuple(row.pop(key) for key in ("table", "scene", "condition", "run")), []).append(row)

    def places(self):
        """Scenes and their conditions, in the order of the files."""
        return list(dict.fromkeys((scene, condition) for scene, condition, _, _ in self.cells))

    def values(self, table, scene, condition, run, column):
        return np.array([float(row[column]) for row in self.rows.get((table, scene, condition, run), ())])

    def number(self, scene, condition, run, quantity):
        cell = self.cells.get((scene, condition, run, quantity))
        return np.nan if cell is None else float(cell["value"])


def holm(p):
    order, adjusted, most = np.argsort(p), np.empty(len(p)), 0
    for rank, i in enumerate(order):
        most = adjusted[i] = max(most, min(1, (len(p) - rank) * p[i]))
    return adjusted


def found(only_first, only_second):
    p = min(1, 2 * stats.binom.cdf(min(only_first, only_second), only_first + only_second, 0.5)) if only_first + only_second else 1.0
    return {"test": "McNemar", "p": p, "only_first": only_first, "only_second": only_second}


def paired(x, y):
    """Paired t and Wilcoxon; none without two differences that are not the same."""
    d = x - y
    if len(np.unique(d)) < 2:
        return []
    t, (low, high) = stats.ttest_rel(x, y), stats.t.interval(0.95, len(d) - 1, d.mean(), stats.sem(d))
    ranks = stats.wilcoxon(d[d != 0], correction=len(d) > 50)
    return [{"test": "paired t", "difference": d.mean(), "low": low, "high": high, "statistic": t.statistic, "dof": len(d) - 1,
             "p": t.pvalue, "effect": d.mean() / d.std(ddof=1)},
            {"test": "Wilcoxon", "statistic": ranks.statistic, "dof": np.count_nonzero(d), "p": ranks.pvalue}]


def cut_of(scores, wrong, precision):
    """The lowest score at which precision is at least that; infinite where it never is."""
    scores, wrong, best = np.sort(scores[~np.isnan(scores)]), np.sort(wrong), np.inf
    for s in np.unique(np.concatenate((scores, wrong))):
        right = len(scores) - np.searchsorted(scores, s)
        if right >= precision * (right + len(wrong) - np.searchsorted(wrong, s)):
            best = min(best, s)
    return best


# --- contests: (quantity, +1: more is better, -1: less, 0: no winner) and the tests, by pair and place

def restoration_contests(c):
    first = [("NET", "RL"), ("NET", "RL_SSIM"), ("NET", "RL_FLAT"), ("NET_FLAT", "RL_FLAT"), ("RL", "SMOOTHED"), ("RL", "BLURRED"), ("NET", "SMOOTHED")]
    pairs = first + [(a, "RL") for a in c.runs if a not in ("BLURRED", "SMOOTHED")] + [(a, "BLURRED") for a in c.runs]
    generator = np.random.default_rng(1)
    for a, b in dict.fromkeys((a, b) for a, b in pairs if a != b and {a, b} <= set(c.runs)):
        for scene, condition in c.places():
            for quantity in QUALITIES:
                x, y = (c.values("scene", scene, condition, run, quantity) for run in (a, b))
                both = np.isfinite(x) & np.isfinite(y)
                x, y = x[both], y[both]
                tests = paired(x, y)
                if tests:
                    two = stats.ttest_ind(x, y)
                    low, high = np.percentile((x - y)[generator.integers(0, len(x), (2000, len(x)))].mean(axis=1), (2.5, 97.5))
                    tests += [{"test": "two samples", "statistic": two.statistic, "dof": 2 * len(x) - 2, "p": two.pvalue},
                              {"test": "bootstrap", "difference": (x - y).mean(), "low": low, "high": high}]
                for test in tests:
                    yield a, b, scene, condition, quantity, test["test"] == "paired t", test


def photometry_contests(c):
    cuts = {(r["scene"], r["run"], r["precision_from"]): np.inf if r["score"] is None else r["score"] for r in c.summary["cuts"]}
    for i, a in enumerate(c.runs):
        for b in c.runs[:i]:
            for scene, condition in c.places():
                x, y = (c.values("object", scene, condition, run, "score") for run in (a, b))
                for precision in [None] + c.summary["precisions"]:
                    p, q = (~np.isnan(s) if precision is None else s >= cuts[scene, run, precision] for s, run in ((x, a), (y, b)))
                    yield (a, b, scene, condition, "found" if precision is None else f"found at precision {precision:g}", 1,
                           found(int(np.sum(p & ~q)), int(np.sum(q & ~p))))
                x, y = (100 * abs(c.values("object", scene, condition, run, "ratio") - 1) for run in (a, b))
                both = np.isfinite(x) & np.isfinite(y)
                for test in paired(x[both], y[both]):
                    yield a, b, scene, condition, "100 |F - F0| / F0", -(test["test"] == "paired t"), test


def detection_contests(c):
    hero = "NET" if "NET" in c.runs else "RL"
    recall = next((key[3] for key in c.cells if key[3].startswith("recall_p")), None)
    for rival in ("NONE", "MATCHED", "RL"):
        for scene, condition in c.places():
            if scene not in ("STARS", "GALAXIES") or rival == hero or recall is None or not {hero, rival} <= set(c.runs):
                continue
            finds = []
            for run in (hero, rival):
                setting = c.cells[scene, condition, run, recall]["setting"] or run
                scores, wrong = (c.values(table, scene, condition, setting, "score") for table in ("object", "false"))
                finds.append(scores >= cut_of(scores, wrong, float(recall.removeprefix("recall_p"))))
            yield (hero, rival, scene, condition, "found at the first precision", 0,
                   found(int(np.sum(finds[0] & ~finds[1])), int(np.sum(finds[1] & ~finds[0]))))


def contests(c):
    rows, families = [], {}
    for a, b, scene, condition, quantity, better, test in globals()[f"{c.kind}_contests"](c):
        row = dict.fromkeys(COLUMNS, "") | {"scene": scene, "condition": condition, "quantity": quantity, "first": a, "second": b} | test
        rows.append(row)
        if better or test["test"] == "Wilcoxon":
            families.setdefault((scene, quantity, a, b, test["test"]), []).append((row, better))
    for members in families.values():
        for (row, better), adjusted in zip(members, holm([row["p"] for row, _ in members])):
            row["holm"] = adjusted
            if adjusted < CLEAR and better:
                more = row["only_first"] > row["only_second"] if row["test"] == "McNemar" else row["difference"] > 0
                row["winner"] = row["first"] if more == (better > 0) else row["second"]
    return rows


# --- claims

def duel(rows, a, b, test, where=lambda row: True):
    """Contests of two runs in either order, and of each +1: a wins, -1: b, 0: neither."""
    some = [row for row in rows if {row["first"], row["second"]} == {a, b} and row["test"] == test and where(row)]
    return [(row, (row["winner"] == a) - (row["winner"] == b)) for row in some]


def findable(row):
    """The difference that this test finds in 8 of 10 campaigns: of means, or of objects that only one has found."""
    if row["test"] == "McNemar":
        return stats.norm.ppf((1 - CLEAR / 2, 0.8)).sum() * (row["only_first"] + row["only_second"]) ** 0.5
    error = (row["high"] - row["low"]) / 2 / stats.t.ppf(0.975, row["dof"])
    return stats.t.ppf((1 - CLEAR / 2, 0.8), row["dof"]).sum() * error


def difference(row):
    return abs(row["only_first"] - row["only_second"] if row["test"] == "McNemar" else row["difference"])


def everywhere(duels):
    """Is a above in all of them? None: nobody knows."""
    if not duels:
        return UNTESTED
    if any(won < 0 for _, won in duels):
        return False
    return True if all(won > 0 for _, won in duels) else None


def somewhere(duels):
    """Is a above in one or more of them and below in none, where a loss as large as that gain would have been found?"""
    gains = [difference(row) for row, won in duels if won > 0]
    if not gains or any(won < 0 for _, won in duels):
        return False
    return True if all(won or findable(row) <= max(gains) for row, won in duels) else None


def both(*outcomes):
    tested = [outcome for outcome in outcomes if outcome is not UNTESTED]
    return UNTESTED if not tested else False if False in tested else None if None in tested else True


def said(duels, a, b):
    """By groups: "NET against RL, psnr of FWHM: better at 2, 3; undecided at 4 (0.31 would have been found)." """
    groups = {}
    for row, wins in duels:
        place = row["condition"] + ("" if wins else f" ({findable(row):.3g} would have been found)")
        groups.setdefault((row["quantity"], row["scene"]), {1: [], -1: [], 0: []})[wins].append(place)
    return " ".join(f"{a} against {b}, {quantity} of {scene}: " +
                    "; ".join(f"{word} at {', '.join(at[wins])}" for wins, word in ((1, "better"), (-1, "worse"), (0, "undecided"))
                              if at[wins]) + "." for (quantity, scene), at in groups.items())


def restoration_claims(c, rows):
    bins = {(r["scene"], r["condition"]): r for r in c.summary["bins"]}
    inside = {key: bool(r["inside_training"]) and not r["fainter_than_fields"] for key, r in bins.items()}

    def wins(rival, where=lambda row: True, qualities=("psnr", "ssim")):
        duels = duel(rows, "NET", rival, "paired t", lambda row: row["quantity"] in qualities and where(row))
        return everywhere(duels), said(duels, "NET", rival)

    def fall(run):
        noise = [condition for scene, condition in bins if scene == "noise"]
        return c.number("noise", noise[0], run, "psnr") - c.number("noise", noise[-1], run, "psnr") if noise else np.nan
    rival, own = {"NET", "RL"} <= set(c.runs), {"NET", "BLURRED"} <= set(c.runs)
    if rival:
        yield "every bin", *wins("RL")
        for quality, name in ("ssim_wang", "SSIM of Wang"), ("ssim_object", "SSIM of the object"):
            yield f"every bin, {name}", *wins("RL", qualities=(quality,))
        if "RL_SSIM" in c.runs:
            yield "every bin, against the blur", *wins("RL_SSIM")
        printed = [r for r in rows if (r["first"], r["second"], r["test"]) == ("NET", "RL", "two samples") and
                   r["quantity"] in ("psnr", "ssim") and float(r["condition"]) in PRINTED[r["scene"]]]
        below = sum(r["p"] < CLEAR and r["statistic"] > 0 for r in printed)
        yield ("all p < 0.05", len(printed) == below > 0,
               f"NET above RL with p below 0.05 in {below} of the {len(printed)} printed columns that have a bin here.")
        won, words = wins("RL", lambda row: row["scene"] == "noise")
        yield "noise", both(won, bool(fall("NET") < fall("RL"))), f"{words} PSNR falls by {fall('NET'):.2f} dB (NET) and {fall('RL'):.2f} dB (RL)."
    if own:
        yield "training range", *wins("BLURRED", lambda row: inside[row["scene"], row["condition"]])
        found = [wins(name, lambda row: not inside[row["scene"], row["condition"]]) for name in ("BLURRED", "RL") if name in c.runs]
        yield "generalisation", both(*(won for won, _ in found)), " ".join(words for _, words in found)
    yield "speed", UNTESTED, ""
    yield "no artificial features", UNTESTED, ""
    for name, other in ("goal: above RL", "RL"), ("goal: above RL_FLAT", "RL_FLAT"):
        duels = duel(rows, "NET", other, "paired t") if {"NET", other} <= set(c.runs) else []
        in_it = [row["holm"] < 0.001 and won > 0 for row, won in duels if inside[row["scene"], row["condition"]]]
        out = [won > 0 for row, won in duels if not inside[row["scene"], row["condition"]]]
        if duels:
            yield (name, all(in_it) and (not out or 2 * sum(out) > len(out)),
                   f"p below 0.001 in {sum(in_it)} of {len(in_it)} bins inside the training, above in {sum(out)} of {len(out)} outside "
                   f"of it. {said(duels, 'NET', other)}")


def photometry_claims(c, rows):
    sets = {(r["scene"], r["condition"]): r for r in c.summary["sets"]}
    # an error that restorers were given is in the field's name
    true = {scene: not any(word in scene for word in ("PSF ", "sky ", "noise ")) for scene, _ in sets}
    lists = [run for run in c.runs if not run.endswith(" TEMPLATE")]

    def beats(a, b, errors=False, low=False):
        """Somewhere above and nowhere below, in every group."""
        def where(row):
            return (true[row["scene"]] and (not low or sets[row["scene"], row["condition"]]["snr"] < 10) and
                    (row["quantity"].startswith("100") if errors else row["quantity"].startswith("found at")))
        groups = {}
        duels = duel(rows, a, b, "paired t" if errors else "McNemar", where)
        for row, won in duels:
            groups.setdefault((row["scene"], row["quantity"]), []).append((row, won))
        return both(*map(somewhere, groups.values())), said(duels, a, b)
    for name, duels, how in (("restored better", [(run, "NONE") for run in lists if run != "NONE"], {}),
                             ("network best", [("NET", run) for run in lists if run != "NET"], {}),
                             ("low S/N", [("NET", run) for run in lists if run != "NET"], {"low": True}),
                             ("photometry", [("NET", "NONE")], {"errors": True})):
        if ("NONE" if name == "restored better" else "NET") in lists and duels and all(b in lists for _, b in duels):
            outcomes = [beats(a, b, **how) for a, b in duels]
            yield name, both(*(won for won, _ in outcomes)), " ".join(words for _, words in outcomes)
    yield "speed", UNTESTED, ""
    if {"NET", "RL", "NONE"} <= set(lists):
        held, words = [], []
        for (scene, mag), one in sets.items():
            if not true[scene]:
                continue
            magerr, rl, bias = (c.number(scene, mag, run, key) for run, key in (("NET", "magerr"), ("RL", "magerr"), ("NET", "bias_percent")))
            scatter = c.number(scene, mag, "NET", "scatter_percent") / c.number(scene, mag, "NONE", "scatter_percent")
            held.append(not magerr > rl and (one["snr"] <= 12 or (abs(bias) < 1 and scatter <= 1.5)))
            if not held[-1]:
                words.append(f"Field {scene}, magnitude {mag}: MagErr {magerr:.2f} % (RL {rl:.2f} %), bias {bias:.2f} %, "
                             f"scatter {scatter:.2f} times NONE's.")
        if held:
            yield "goal: fluxes", all(held), " ".join(words)
    if len(lists) < len(c.runs):
        held, words = [], []
        for scene, mag in sets:
            errors = {run: 100 * abs(c.values("object", scene, mag, run, "ratio") - 1) for run in c.runs}
            common = np.all([np.isfinite(e) for e in errors.values()], axis=0)
            for run in [run for run in c.runs if run not in lists and true[scene]]:
                worse = []
                for other in lists:
                    d = (errors[run] - errors[other])[common]
                    if len(d) >= 2 and d.mean() > 1.96 * d.std() / (len(d) - 1) ** 0.5:
                        worse.append(f"Field {scene}, magnitude {mag}: {run} {errors[run][common].mean():.2f} %, "
                                     f"{other} {errors[other][common].mean():.2f} %.")
                held.append(not worse)
                words += worse
        if held:
            yield "goal: templates", all(held), " ".join(words + [f"Held in {sum(held)} of {len(held)} sets of stars."])


def detection_claims(c, rows):
    true = [(scene, condition) for scene, condition in c.places() if "," not in condition]
    names = [next((key[3] for key in c.cells if key[3].startswith(word)), None) for word in ("ap", "recall_p")]
    if "NET" not in c.runs:
        return
    held, words = [], []
    for rival in [run for run in ("NONE", "MATCHED", "RL") if run in c.runs]:
        numbers = [(name, place, *(c.number(*place, run, name) for run in ("NET", rival)))
                   for place in true if place[0] in ("STARS", "GALAXIES") for name in names if name]
        less = [f"{name} of {place[0]} at {place[1]} ({own:.3f} against {other:.3f})" for name, place, own, other in numbers if not own > other]
        sure = [row["only_first"] > row["only_second"] and row["p"] < CLEAR for row in rows
                if row["second"] == rival and (row["scene"], row["condition"]) in true]
        held += [not less] if numbers else []
        words.append(f"NET against {rival}: above in {len(numbers) - len(less)} of {len(numbers)} numbers; more objects found, McNemar's "
                     f"p below 0.05, in {sum(sure)} of {len(sure)} lists" + (f"; not above: {', '.join(less)}" if less else "") + ".")
    if held:
        yield "goal: detection", all(held), " ".join(words)
    held, words = [], []
    for place in [place for place in true if place[0] == "PAIRS" and "NONE" in c.runs]:
        own, other = c.number(*place, "NET", "resolved"), np.fmax(*(c.number(*place, run, "resolved") for run in ("MATCHED", "NONE")))
        held.append(own > 0 and own >= 2 * other)
        words.append(f"{place[1]}: {own:.3f} against {other:.3f}.")
    if held:
        yield "goal: close pairs", all(held), " ".join(words)


# --- files

def write(path, columns, rows):
    """ECSV: numbers with nine digits, everything else quoted."""
    def cell(value):
        return f"{value:.9g}" if isinstance(value, (int, float)) else json.dumps(value, ensure_ascii=False).replace('\\"', '""')
    numbers = {name for name in columns if any(isinstance(row[name], (int, float)) for row in rows)}
    types = [f"# - {{name: {name}, datatype: {'float64' if name in numbers else 'string'}}}\n" for name in columns]
    path.write_text("# %ECSV 1.0\n# ---\n# delimiter: ','\n# datatype:\n" + "".join(types) + "# schema: astropy-2.0\n" + ",".join(columns) +
                    "\n" + "".join(",".join(cell(row[name]) for name in columns) + "\n" for row in rows), encoding="utf-8")


def main(folder):
    c = Campaign(folder)
    rows = contests(c)
    claims = [{"claim": name, "words": CLAIMS[name][1], "place": CLAIMS[name][0], "reproduced_when": CLAIMS[name][2],
               "verdict": VERDICTS.get(held, held), "found": words}
              for name, held, words in globals()[f"{c.kind}_claims"](c, rows)]
    write(folder.parent / "contests.ecsv", COLUMNS, rows)  # the folder is the program's, and replaced by it only as it was
    write(folder.parent / "claims.ecsv", ("claim", "words", "place", "reproduced_when", "verdict", "found"), claims)
    for row in claims:
        print(f"{row['claim']:24} {row['verdict']}")


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    main(Path(sys.argv[1]).absolute())
