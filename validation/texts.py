#!/usr/bin/env python3
"""The numbers in the texts, from the committed results.

usage: texts.py check                        do the texts say what the results say, and do their links lead somewhere?
                                             FILE:LINE of each word that differs
       texts.py write                        make them say it
       texts.py compare NAME FOLDER [DIGITS] results/NAME against a new run's folder, to DIGITS (4) digits
       texts.py take NAME FOLDER             results/NAME becomes that of a new run's folder

A block of a text between `<!-- numbers: NAME -->` and `<!-- end -->` is written by the function of that name below: change
its words there. Needs nothing but Python's own library. RX_TEXTS_TOP is another root than that of the sources.
"""
import csv
import functools
import difflib
import json
import os
import re
import statistics
import sys
import textwrap

TOP = os.environ.get("RX_TEXTS_TOP") or os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
TEXTS = ("README.md", "docs/validation.md", "docs/templates.md", "docs/network.md", "docs/noise.md", "docs/psf.md", "docs/crowded.md",
         "docs/robustness.md", "docs/bench.md", "docs/paper.md", "validation/selfcheck/README.md", "validation/sextractor/README.md")
MARK = re.compile(r"(^ *<!-- numbers: ([a-z-]+) -->\n)(.*?)(^ *<!-- end -->$)", re.M | re.S)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|\bnull\b|\bnan\b")


# --- what is read

def text_of(path):
    with open(os.path.join(TOP, path), encoding="utf-8") as file:
        return file.read()


@functools.lru_cache
def summary(name):
    return json.loads(text_of(f"validation/results/{name}.json"))


def rows_of(name, table, **keys):
    """The rows of a campaign's table that have these values."""
    rows = ecsv(f"{name}/{table}") if table in ("cells", "claims", "contests") else summary(f"{name}/summary")[table]
    return [row for row in rows if all(row[key] == value for key, value in keys.items())]


def number(name, scene, condition, run, quantity):
    return float(one(rows_of(name, "cells"), scene=scene, condition=condition, run=run, quantity=quantity)["value"])


def distinct(values):
    return list(dict.fromkeys(values))


def ecsv_rows(text):
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


@functools.lru_cache
def ecsv(name):
    return ecsv_rows(text_of(f"validation/results/{name}.ecsv"))


def tables(path):
    """The tables of a Markdown file: of each its lines, and its rows as dictionaries."""
    found = []
    for lines in re.findall(r"(?:^\|.*\|[ ]*\n)+", text_of(path), re.M):
        cells = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines.splitlines()]
        found.append((lines, [dict(zip(cells[0], row)) for row in cells[2:]]))
    return found


def page_table(name, *titles):
    """The rows of the table under these titles, one below the other, in the tables of a report."""
    text, at = text_of(f"validation/results/{name}/tables.md"), 0
    for title in titles:
        at = re.compile(rf"^#+ {re.escape(title)}$", re.M).search(text, at).end()
    lines = re.compile(r"(?:^\|.*\n)+", re.M).search(text, at)[0].splitlines()
    cells = [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]
    return [dict(zip(cells[0], row)) for row in cells[2:]]


def one(rows, **where):
    """The only row that has these values."""
    rows = [row for row in rows if all(row[key] == value for key, value in where.items())]
    if len(rows) != 1:
        raise LookupError(f"{len(rows)} rows with {where}")
    return rows[0]


# --- how it is written

def paragraph(words, indent=""):
    return textwrap.fill(" ".join(words.split()), 125, initial_indent=indent, subsequent_indent=indent,
                         break_long_words=False, break_on_hyphens=False) + "\n"


def item(words):
    return textwrap.fill(" ".join(words.split()), 125, initial_indent="- ", subsequent_indent="  ",
                         break_long_words=False, break_on_hyphens=False) + "\n"


def table(head, rows, indent=""):
    lines = [head, ["---"] * len(head)] + rows
    return "".join(f"{indent}| {' | '.join(line)} |\n".replace("|  |", "| |") for line in lines)


def span(values, form="{:.2f}"):
    low, high = form.format(min(values)), form.format(max(values))
    return low if low == high else f"{low} to {high}"


def listed(words):
    words = list(words)
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


# --- the blocks

def sdss_frame():
    auto, psfex = summary("sdss/AUTO"), summary("sdss/PSFEX")
    names = {"NONE": "as observed (NONE)", "RL": "Richardson-Lucy (RL)", "NET": "the network (NET)"}
    record = {entry["name"]: entry["value"] for entry in auto["record"]}
    own = ["GAIN", "MAG_ZEROPOINT", "SATUR_LEVEL"]
    other = set(record["SET"].split()) - set(own)
    files = {"RESTORE_TYPE", "NET_MODEL", "PSF_TYPE", "PSF_NAME", "CATALOG_NAME", "CHECKIMAGE_TYPE", "CHECKIMAGE_NAME",
             "REFERENCE_NAME", "MATCH_RADIUS", "MATCH_UNIT", "QA_NAME"}
    if other != files:
        raise LookupError(f"validation/sdss/run.sh sets other keywords than this text says: {sorted(other ^ files)}")
    fwhm = float(re.search(r"FWHM ([0-9.]+)", auto["runs"][1]["psf"])[1])
    everywhere = listed(f"{key} {float(record[key]):g}" for key in own)

    def quality(run):
        v = {key: run[key]["value"] for key in ("recall", "precision", "ap", "magerr", "bias_mag", "mag50")}
        return [f"{v['recall']:.3f}", f"{v['precision']:.3f}", f"{v['ap']:.3f}", f"{v['magerr']:.1f} %",
                f"{v['bias_mag']:+.3f} mag", f"r = {v['mag50']:.2f}"]

    rows = [[names[run["run"]], str(run["detections"])] + quality(run) for run in auto["runs"]]
    model = [[names[run["run"]] + ", psfex's PSF", str(run["detections"])] + quality(run) for run in psfex["runs"][1:]]
    return (paragraph(f"""`validation/sdss/run.sh` restores that frame ({auto["width"]} x {auto["height"]} pixels, FWHM
        {fwhm:.2f} pixels = {fwhm * auto["pixel_scale_arcsec"]:.1f} arcsec) and compares it with the catalogue of the
        much deeper coadd of the same sky ({auto["runs"][0]["references"]} sources that count, r to about 23; what lies
        fainter is missing there, so precision is a lower bound). Three keywords are set, as the frame, in
        nanomaggies, does not hold them: {everywhere}. The PSF is that of PSF_TYPE AUTO, below that the model which
        `psfex` makes from our own catalogue (PSF_TYPE PSFEX, varying across the frame); all else has its
        default.""") + "\n" +
            table(["", "detected", "recall", "precision", "average precision", "MagErr", "bias", "50 % complete at"],
                  rows + model) + "\n" +
            paragraph("""All three go to where the reference itself ends: how many of the additional detections are
        wrong this catalogue cannot tell (on the frame upside down there is one, [proposals](../validation/results/proposals/proposals.md)).
        MagErr is the mean of 100 |F - F0| / F0 over the matched sources, fainter ones among them."""))


def five():
    """README: the five numbers."""
    precision = 0.85
    recall = [f"{100 * max(float(row['recall']) for row in ecsv(f'sdss/pr_{run}') if float(row['precision']) >= precision):.0f}"
              for run in ("NONE", "RL", "NET")]
    ap = [f"{float(one(ecsv('proposals/cells'), scene='STARS', condition='FWHM 6', run=run, way=way, quantity='ap')['value']):.2f}"
          for run, way in (("MATCHED", "CONV"), ("NONE", "AUTO"), ("RL", "AUTO"), ("NET", "AUTO"))]
    stars = [row for row in page_table("fluxes-template", "FIELD", "Stars, isolated", "bias [mag]") if row["S/N"] == "10+"]
    auto, template = (max(abs(float(row[key].split()[0])) for row in stars) for key in ("NONE AUTO", "NET TEMPLATE"))
    same = [float(row["within 0.05 pixel"].rstrip(" %")) for row in tables("validation/sextractor/README.md")[0][1]]
    bench = {row["key"]: statistics.median(row["ratio"]) for row in json.loads(text_of("validation/results/bench/two-stages/bench.json"))["rows"]}
    return table(["what", "result", "more"], [
        ["Depth on a real SDSS frame: sources of a much deeper catalogue that are found",
         f"at equal precision, {100 * precision:.0f} %: {recall[0]} % on the frame as observed, {recall[1]} % with RL, {recall[2]} % with NET: the right filter "
         "finds what restoration does, except where sources blend (the catalogue itself is incomplete below r = 23)",
         "[an SDSS frame](docs/validation.md#an-sdss-frame)"],
        ["Lists of simulated stars, FWHM 6 pixels: average precision (1: all found, none false)",
         f"{ap[0]} unrestored, with a filter as wide as the PSF; decided by the original pixels {ap[1]} unrestored, {ap[2]} with RL, {ap[3]} with NET",
         "[proposals](validation/results/proposals/proposals.md)"],
        ["Magnitudes of isolated simulated stars, FWHM 2 to 8: largest median error",
         f"{auto:.3f} mag for FLUX_AUTO on the image as observed, {template:.3f} for template photometry with NET",
         "[templates](docs/templates.md)"],
        [f"Drop-in: sources of {len(same)} real tiles within 0.05 pixel of source-extractor's", f"{min(same):.1f} to {max(same):.0f} %",
         "[column by column](validation/sextractor/README.md)"],
        ["Speed on one core, beside scikit-image's Richardson-Lucy of 30 iterations",
         f"RL of 30 iterations {bench['rl-skimage-1']:.1f}, NET {bench['net-skimage-1']:.1f} times as fast", "[benchmark](docs/bench.md)"]])


def restoration_numbers():
    """Mean over the bins of each axis, by method and quality; and where one is above another."""
    def mean(axis, method, quality):
        return statistics.mean(float(row["value"]) for row in rows_of("restoration", "cells", scene=axis, run=method, quantity=quality))

    def wins(axis, winner, loser, quality):
        both = (winner, loser), (loser, winner)  # a contest stands there in one order
        return [(float(row["condition"]), abs(float(row["difference"]))) for first, second in both
                for row in rows_of("restoration", "contests", scene=axis, quantity=quality, first=first, second=second, winner=winner)]
    return mean, wins


def runs_of(values):
    """2, 3, 4, 7 as "2 to 4 and 7"."""
    groups = []
    for value in values:
        if groups and value == groups[-1][1] + 1:
            groups[-1][1] = value
        else:
            groups.append([value, value])
    return listed(f"{a:g}" if a == b else f"{a:g} {'and' if b == a + 1 else 'to'} {b:g}" for a, b in groups)


def won(duels, unit):
    if not duels:
        return "nowhere"
    return f"by {span([d for _, d in duels], '{:.2f}' if unit == '' else '{:.1f}')}{unit} at {runs_of([x for x, _ in duels])}"


def verdict(name, claim):
    return one(rows_of(name, "claims"), claim=claim)["verdict"]


def restoration():
    mean, wins = restoration_numbers()
    bins = rows_of("restoration", "bins")
    by = {axis: rows_of("restoration", "bins", scene=axis) for axis in ("FWHM", "noise")}
    names = {"BLURRED": "blurred", "SMOOTHED": "through a filter", "RL": "RL", "RL_SSIM": "RL tuned for SSIM", "RL_FLAT": "RL, flat sky",
             "NET": "NET", "NET_FLAT": "NET, flat sky"}
    rows = [[words] + [f"{mean(axis, method, metric):.{digits}f}" for axis in by for metric, digits in (("psnr", 1), ("ssim", 2), ("ssim_object", 2))]
            for method, words in names.items()]
    sides = [f"{rows[0]['condition']} to {rows[-1]['condition']}" for rows in by.values()]

    def above(one, other, quality, unit=""):
        return f"by FWHM {won(wins('FWHM', one, other, quality), unit)}, by noise {won(wins('noise', one, other, quality), unit)}"
    return (item(f"""**Restoration**, {len(bins)} bins of {span([b["scenes"] for b in bins], "{:d}")} galaxy scenes: FWHM {sides[0]} pixels, and noise
        {sides[1]} of 255. One image of each restorer; all but NET are tuned, bin by bin, for PSNR (RL tuned for SSIM is one or two iterations and
        a wide blur). SSIM has the paper's K1 = K2 = 0.001, on the whole image and on the pixels of the object; means over the bins:""") + "\n" +
            table(["", *(f"{words} by {axis}" for axis in by for words in ("PSNR (dB)", "SSIM", "SSIM, object"))], rows, "  ") + "\n" +
            paragraph(f"""In PSNR NET is above RL (p adjusted by Holm < 0.05) {above("NET", "RL", "psnr", " dB")}; RL is above NET
        {above("RL", "NET", "psnr", " dB")}. In SSIM NET is above RL {above("NET", "RL", "ssim")}; RL above NET {above("RL", "NET", "ssim")}. On the object
        NET is above {above("NET", "RL", "ssim_object")}; RL {above("RL", "NET", "ssim_object")}. RL itself is above the tuned filter in PSNR
        {above("RL", "SMOOTHED", "psnr", " dB")}. What became of the paper's claims: [the paper](paper.md).""", "  "))


def detection():
    conditions = distinct(row["condition"] for row in rows_of("detection", "cells"))

    def over(scene, run, quantity, name="detection"):
        return [number(name, scene, condition, run, quantity) for condition in conditions]
    rows, lead = [], []
    for scene, words in ("STARS", "stars"), ("GALAXIES", "galaxies"):
        values = {run: over(scene, run, "ap") for run in ("MATCHED", "RL", "NET")}
        best = [max(column) for column in zip(*values.values())]
        lead += [net - max(others) for net, *others in zip(values["NET"], values["RL"], values["MATCHED"])]
        for run, row in values.items():
            rows.append([f"{words}: {run}"] + [f"**{v:.3f}**" if v == top else f"{v:.3f}" for v, top in zip(row, best)])
    pairs = {run: over("PAIRS", run, "resolved") for run in ("RL", "NET")}

    def equal(precision):
        """Of how many lists NET finds most at one precision, and where it does not."""
        found = {(scene, condition): [number("detection", scene, condition, run, f"recall_p{precision}") for run in ("MATCHED", "RL", "NET")]
                 for scene in ("STARS", "GALAXIES") for condition in conditions}
        less = [f"{scene.lower()} at {condition} ({row[2]:.2f} against {max(row[:2]):.2f})" for (scene, condition), row in found.items() if row[2] <= max(row[:2])]
        return f"{len(found) - len(less)} of {len(found)} lists" + (f", not of {listed(less)}" if less else "")
    blank = {run: over("BLANK", run, "false_cut", "pixels") for run in ("NONE", "RL", "NET")}
    light = [1 - value for value in over("OUTSKIRTS", "NET", "r2_snr0", "pixels")]
    bright = [1 - value for value in over("OUTSKIRTS", "NET", "r2_snr20", "pixels")]
    check = max(value for key in ("phases2", "phases4") for value in over("PLATEAU", "NET", key, "pixels"))
    resolved = listed(f"{v:.2f}" for v in pairs["NET"])
    seeing = [condition.removeprefix("FWHM ") for condition in conditions]
    return (item("""**Detection**, average precision on 512 x 512 pixels with 800 stars or 500 galaxies per Mpixel of S/N above 5,
        found within 2 pixels or half a FWHM, whichever is more. MATCHED is the unrestored image through a filter as wide as the PSF, RL the best of nine kinds *on these very
        tiles*:""") + "\n" + table(["FWHM (pixels)"] + seeing, rows, "  ") + "\n" +
            paragraph(f"""NET leads the better of the others by {span(lead, "{:.3f}")}, on the mean by {sum(lead) / len(lead):.3f}. At precision 0.95 NET finds most in {equal("0.95")}; at 0.99 in {equal("0.99")}. Of pairs half to one FWHM apart NET resolves {resolved} at these FWHM (RL at most
        {max(pairs["RL"]):.2f}). At the threshold of precision 0.99 it finds {span(blank["NET"], "{:.1f}")} false sources per Mpixel
        of blank sky (NONE {span(blank["NONE"], "{:.1f}")}, RL {span(blank["RL"], "{:.1f}")}). Of galaxies of S/N 5 to 10 it loses
        {100 * min(light):.0f} to {100 * max(light):.0f} % of the light within two half-light radii, of those of S/N above 20
        {100 * min(bright):.0f} to {100 * max(bright):.0f} %. Checkerboard on plateaus: at most {check:.0e} sigma.""", "  "))


def fluxes():
    fields = distinct(row["scene"] for row in rows_of("fluxes", "sets"))
    snr = {mag: [row["snr"] for row in rows_of("fluxes", "sets", condition=mag)]
           for mag in distinct(row["condition"] for row in rows_of("fluxes", "sets"))}
    mags = [mag for mag in snr if min(snr[mag]) > 9]

    def cell(run, mag):
        value = {key: statistics.median(number("fluxes", field, mag, run, key) for field in fields)
                 for key in ("magerr", "bias_percent", "scatter_percent")}
        return f"{value['magerr']:.2f}, {value['bias_percent']:+.1f}, {value['scatter_percent']:.2f}"
    rows = [[words] + [cell(run, mag) for mag in mags]
            for run, words in (("NONE", "unrestored: MagErr, bias, scatter (%)"), ("RL", "RL"), ("NET", "NET"))]
    stars = rows_of("fluxes", "sets")[0]["stars"]
    seeing = [field.removeprefix("FWHM ") for field in fields]
    return (item(f"""**Fluxes** (FLUX_AUTO) of {stars} isolated stars per magnitude and seeing; medians over FWHM {seeing[0]} to
        {seeing[-1]} of MagErr, bias and scatter:""") + "\n" +
            table(["S/N"] + [f"{min(snr[m]):.0f} to {max(snr[m]):.0f}" for m in mags], rows, "  "))


def photometry():
    sets = rows_of("photometry", "sets")
    names = ["NONE", "RL", "NET"]

    def recall(name, precision):
        return one(rows_of("photometry", "cuts"), run=name, precision_from=precision)["recall"]["value"]

    def magerr(row, name):
        return number("photometry", row["scene"], row["condition"], name, "magerr")
    rows = [[f"{row['mag']:g}", f"{row['snr']:.1f}"] +
            [f"{magerr(row, name):.2f}" for name in names + [f"{name} TEMPLATE" for name in names]] for row in sets[::2] + sets[-1:]]
    claims = ", ".join(f"*{verdict('photometry', claim)}* ({words})" for claim, words in
                       (("network best", "its network finds most"), ("low S/N", "most of all at low S/N"),
                        ("photometry", "its network's fluxes are better"), ("restored better", "all restored images are better")))
    return (item(f"""**Photometry**, {sum(row["stars"] for row in sets)} stars of magnitude {sets[0]["mag"]:g} to
        {sets[-1]["mag"]:g} on simulated tiles like an SDSS frame. At equal precision 0.95 NET finds
        {recall("NET", 0.95):.3f} of them, NONE {recall("NONE", 0.95):.3f}, RL {recall("RL", 0.95):.3f}; at 0.99 it is
        {recall("NET", 0.99):.3f}, {recall("NONE", 0.99):.3f} and {recall("RL", 0.99):.3f}. The paper's claims are {claims}.
        MagErr (%), of FLUX_AUTO and of templates with shapes from each:""") + "\n" +
            table(["magnitude", "S/N"] + [f"AUTO, {n}" for n in names] + [f"templates, {n}" for n in names], rows, "  "))


GALAXY_SNR = ("5-10", "10-20", "20-50", "50-100", "100-1000")


def galaxies_auto():
    """FLUX_AUTO of isolated galaxies on each restorer's image."""
    rows = [row for row in page_table("fluxes-template", "FIELD", "Galaxies, isolated", "bias [mag]") if row["S/N"] in GALAXY_SNR]
    bias = {run: {snr: [float(row[f"{run} AUTO"].split()[0]) for row in rows if row["S/N"] == snr] for snr in GALAXY_SNR} for run in ("NONE", "RL", "NET")}
    pairs = [(net, none) for snr in GALAXY_SNR for net, none in zip(bias["NET"][snr], bias["NONE"][snr])]
    held = sum(abs(net) <= abs(none) for net, none in pairs)
    seeing = distinct(row["condition"].removeprefix("FWHM ") for row in rows)
    return (item(f"""**Isolated galaxies** (fluxes-template), bias of MAG_AUTO in mag, means over FWHM {seeing[0]} to {seeing[-1]}. NET's is larger than that of the
        unrestored image, which is a goal missed, in {len(pairs) - held} of {len(pairs)} cases (a seeing, a bin of S/N), by
        {max(abs(net) - abs(none) for net, none in pairs):.2f} mag at most:""") + "\n" +
            table(["S/N", *bias], [[snr.replace("-", " to "), *(f"{statistics.mean(bias[run][snr]):+.3f}" for run in bias)] for snr in GALAXY_SNR], "  "))


def campaigns():
    return "\n".join((restoration(), detection(), fluxes(), photometry(), galaxies_auto(), wrong_inputs(), real_sky()))


def biases(field, run):
    """Of FLUX_AUTO, per cent, at each magnitude of S/N above 12."""
    return [number("fluxes-errors", field, row["condition"], run, "bias_percent")
            for row in rows_of("fluxes-errors", "sets", scene=field) if row["snr"] > 12]


def wrong_inputs():
    """Restorers that take a wrong PSF, sky or noise for the true one: fluxes and lists at FWHM 4."""
    rows = []
    for field in distinct(row["scene"] for row in rows_of("fluxes-errors", "sets")):
        rows.append([field.partition(", ")[2] or "right"] + [span(biases(field, run), "{:+.1f}") for run in ("NONE", "RL", "NET")] +
                    [f"{number('detection-errors', scene, field, 'NET', 'ap'):.3f}" for scene in ("STARS", "GALAXIES")])
    return (item("""**A wrong PSF, sky or noise** (fluxes-errors, detection-errors; FWHM 4): bias of FLUX_AUTO, per cent, over stars of
        S/N above 12, and average precision of NET's lists:""") + "\n" +
            table(["what is wrong", "unrestored", "RL", "NET", "stars", "galaxies"], rows, "  "))


SCENES = {"BLANK": "blank sky", "RINGS": "around bright stars", "SHREDS": "in and around large bright galaxies",
          "FIELD": "among stars and galaxies"}


def spurious():
    rows = ecsv("invented/invented")
    seeing = distinct(row["condition"] for row in rows)

    def before_after(*where):
        row = one(rows, **dict(zip(("scene", "condition", "run"), where)))
        return f"{float(row['false_per_mpixel']):.1f} -> {float(row['false_per_mpixel_unmarked']):.1f}"

    def marked(scene, quantity):
        return [100 * float(row[quantity]) for row in rows if row["scene"] == scene]
    head = [""] + [f"{condition}: {run}" if run == "NONE" else run for condition in seeing for run in ("NONE", "RL", "NET")]
    body = [[words] + [before_after(scene, condition, run) for condition in seeing for run in ("NONE", "RL", "NET")]
            for scene, words in SCENES.items()]
    return (item("""**Spurious sources** (campaign `invented`; thresholds as deep as in `detection`): false detections per Mpixel, all -> those that
        FLAGS_RESTORE does not mark:""") + "\n" + table(head, body, "  ") + "\n" +
            paragraph(f"""True sources of S/N above 7 that are marked: around bright stars
        {span(marked("RINGS", "marked_above_7"), "{:.1f}")} %, of the galaxies {span(marked("SHREDS", "marked_above_7"), "{:.1f}")} %,
        in the fields {span(marked("FIELD", "marked_above_7"), "{:.1f}")} %; of S/N 5 to 7 there
        {span(marked("FIELD", "marked_5_7"), "{:.0f}")} %.""", "  "))


def templates_table():
    """Bias and scatter of isolated sources of S/N above 10 on simulated fields."""
    runs, body = ("NONE", "RL", "NET"), []
    for kind in ("Stars", "Galaxies"):
        bias, scatter = (page_table("fluxes-template", "FIELD", f"{kind}, isolated", quantity)
                         for quantity in ("bias [mag]", "scatter [mag]"))
        for row in (row for row in bias if row["S/N"] == "10+"):
            spread = one(scatter, condition=row["condition"], **{"S/N": "10+"})
            cells = [f"{float(row[key].split()[0]):+.3f} ({float(spread[key].split()[0]):.3f})"
                     for key in (f"{run} {flux}" for flux in ("AUTO", "TEMPLATE") for run in runs)]
            body.append([row["condition"].removeprefix("FWHM "), kind.lower()] + cells + [row["NET TEMPLATE"].split()[1].strip("()")])
    head = ["FWHM [pixels]", ""] + [f"{flux}, {name}" for flux in ("AUTO", "templates") for name in ("unrestored", "RL", "NET")]
    return table(head + ["sources (NET)"], body)


def template_goals():
    """The goals of the page, and how many numbers hold each, by the restorer that gives the shapes."""
    rows, body = page_table("fluxes-template", "Goals", "What was found"), []
    words = [row["claim or goal"] for row in page_table("fluxes-template", "Goals")]
    for goal, long in zip(dict.fromkeys(row["claim"] for row in rows), words, strict=True):
        cells = {row["restorer"]: f"{row['verdict']} ({row['what was found'].partition(' numbers')[0]})" for row in rows if row["claim"] == goal}
        body.append([long.partition(" (number:")[0]] + [cells[run] for run in ("NONE", "RL", "NET")])
    return (item("""**Goals** (campaign `fluxes-template`; fields of 200 stars and 200 galaxies per Mpixel): the goal, the verdict, and in how many cases
        (a seeing, a kind of object, a bin of S/N) it is met, for shapes from each restorer:""") + "\n" +
            table(["goal", "NONE", "RL", "NET"], body, "  ") + "\n" +
            paragraph("""Below 0.75 FWHM hardly a pair is resolved; an unresolved one is a single source with both fluxes.""", "  "))


def template_faint():
    """What is wrong with single faint sources: a star that may be a galaxy, and those that only noise brought into the list."""
    def bias(kind, bin_):
        rows = page_table("fluxes-template", "FIELD", f"{kind}, isolated", "bias [mag]")
        return span([float(row["NET TEMPLATE"].split()[0]) for row in rows if row["S/N"] == bin_], "{:+.3f}")
    photometry = summary("photometry/summary")
    at = photometry["sets"][-2]

    def value(quantity, run):
        return float(one(rows_of("photometry", "cells"), condition=at["condition"], run=run, quantity=quantity)["value"])
    return (item("""**Faint isolated sources** (the same fields, on NET's list): median of measured - true MAG_TEMPLATE, over the five seeings. A star
        that could be a galaxy has the mean of both fluxes, and so has a galaxy that could be a star:""") + "\n" +
            table(["S/N", "stars", "galaxies"], [[bin_.replace("-", " to ")] + [bias(kind, bin_) for kind in ("Stars", "Galaxies")]
                                                 for bin_ in ("5-10", "10-20", "20-50", "50-100")], "  ") + "\n" +
            paragraph(f"""At the limit only what noise made brighter is found, and MAG_TEMPLATE, which weighs pixels as the search does, has all of that:
        of the stars of S/N {at["snr"]:.1f} in campaign `photometry`, {100 * value("recall", "NET"):.0f} % of them found, it is
        {value("bias_mag", "NET TEMPLATE"):+.2f} mag off in the median, MAG_AUTO {value("bias_mag", "NET"):+.2f} with
        {value("scatter_mag", "NET") / value("scatter_mag", "NET TEMPLATE"):.1f} times its scatter. Completeness by injection (SELF_CHECK) is
        needed to correct for it.""", "  "))


def injected():
    rows = ecsv("fluxes-sdss/invented")
    runs = [one(rows, run=run) for run in ("NONE", "RL", "NET")]
    left = listed(f"{row['wrong_unmarked']} of {row['wrong']} ({row['run']})" for row in runs)
    lost = listed(f"{int(row['right']) - int(row['right_unmarked'])} of {row['right']}" for row in runs)
    return item(f"""**Injected into a real frame** (campaign `fluxes-sdss`; the SDSS frame, its PSF measured by PSF_TYPE AUTO): of the
        detections that are neither injected nor in the original frame, {left} stay unmarked; {lost} true ones are marked.
        Fluxes: [tables](../validation/results/fluxes-sdss/tables.md).""")


def real_sky():
    pairs, dwarfs = tables("validation/results/real/pairs.md")[0][1], tables("validation/results/real/dwarfs.md")[0][1]
    galaxies = list(dict.fromkeys(row["galaxy"] for row in pairs))

    def gain(other, key):
        return [float(one(pairs, galaxy=g, run="NET")[key]) - float(one(pairs, galaxy=g, run=other)[key]) for g in galaxies]

    def found(run):
        return sum(int(row["KiDS sources found"].split()[0]) for row in pairs if row["run"] == run)
    of = sum(int(row["KiDS sources found"].split()[2]) for row in pairs if row["run"] == "NET")
    best = sum(1 for a, b in zip(gain("NONE", "SSIM"), gain("RL", "SSIM")) if min(a, b) > 0)
    light = [(row["galaxy"].partition("rss")[0], 100 - 100 * float(row["20 to 40 px"])) for row in dwarfs if row["run"] == "NET"]
    return item(f"""**Real sky** ([pairs](../validation/results/real/pairs.md), [dwarfs](../validation/results/real/dwarfs.md)). Brought to KiDS's grid and seeing, SDSS images
        restored by NET have {span(gain("NONE", "PSNR (dB)"), "{:.1f}")} dB more PSNR than unrestored ones and
        {span(gain("RL", "PSNR (dB)"), "{:.1f}")} dB more than RL's; their SSIM is the highest of the three in {best} of {len(galaxies)}
        galaxies; NET finds {found("NET")} of {of} KiDS sources, NONE {found("NONE")}, RL {found("RL")}. Each filter is the best for
        the image. Of the light of dwarf galaxies of low surface brightness between 20 and 40 pixels NET loses
        {listed(f"{lost:.1f} % ({name})" for name, lost in light)}.""")


def template_scatter():
    """Least and largest robust scatter of MAG_AUTO and MAG_TEMPLATE against the coadd, r 16 to 20."""
    lines, _ = tables("validation/results/templates/sdss.md")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines.splitlines()[2:]]
    rows = [row for row in rows if 16 <= float(row[0].partition("..")[0]) < 20]
    return span([float(row[4]) for row in rows], "{:.3f}"), span([float(row[7]) for row in rows], "{:.3f}")


def templates_sky():
    cells = tables("validation/results/templates/chi2.md")[0][1]
    tiles = list(dict.fromkeys(row["tile"] for row in cells))
    off = {tile: [float(row["cells"]) for row in cells if row["tile"] == tile] for tile in tiles}
    fine = [tile for tile in tiles if all(abs(value - 1) < 0.0601 for value in off[tile])]
    auto, template = template_scatter()
    precision = re.search(r"MAG_TEMPLATE NET: precision ([0-9.]+), (\d+) marked .*?, (\d+) of them matched; precision without them "
                          r"([0-9.]+)", text_of("validation/results/templates/sdss.md"))
    rest = listed(f"{tile} ({span(values)})" for tile, values in off.items() if tile not in fine)
    return item(f"""**Real sky** ([chi2](../validation/results/templates/chi2.md); pictures of
        [galaxies.fits](../validation/results/templates/galaxies.png), [the SDSS frame](../validation/results/templates/sdss-frame.png),
        [ESO 085-030](../validation/results/templates/eso085-030.png) and [M67](../validation/results/templates/M67.png)). The median over cells
        of 32 x 32 pixels of the residual's chi2, away from masked and saturated pixels, is within 0.06 of 1 on {len(fine)} of
        {len(tiles)} tiles with every restorer; on the others it is: {rest}. Against the deep coadd of the SDSS frame
        ([table](../validation/results/templates/sdss.md)) the scatter of MAG_TEMPLATE at r 16 to 20 is {template} mag (FLUX_AUTO {auto}). In NET's list there
        {precision[2]} are marked, {precision[3]} of them known to the coadd: precision {precision[1]} with, {precision[4]} without
        them.""")


def models():
    about, tests, flux = (tables("validation/results/models/models.md")[n][1] for n in range(3))
    names = ("psfnet", "psfnet-fast", "psfnet-one", "psfnet-floor", "psfnet-skies", "psfnet-deep", "psfnet-deep-ideal")
    base, fast, _, floor, skies, deep, ideal = (one(tests, model=name) for name in names)
    images = {name: one(about, model=name)["training images"] for name in names}
    read = dict(re.findall(r"^- \*\*(.*?)\*\*: (.*)\.$", text_of("validation/results/models/models.md"), re.M))
    short = {name: one(flux, model=name)["scatter (%), S/N above 50"].split()[0] for name in names}

    biases = {name: listed(one(flux, model=name)[f"bias (%), S/N {span}"].split()[0] for span in ("5 to 12", "12 to 50", "above 50"))
              for name in ("psfnet-fast", "psfnet-floor")}
    wrong = {name: listed(one(flux, model=name)[f"abs. bias, S/N {span}"].split()[0] for span in ("5 to 12", "12 to 50", "above 50"))
             for name in names[:2]}

    def pair(key, model, other):
        return f"{model[key].split()[0]} ({other[key].split()[0]})"

    def pairs(model, other):
        return f"""PSNR {pair("PSNR (dB)", model, other)} dB, SSIM {pair("SSIM", model, other)}, average precision of stars
        {pair("AP, stars", model, other)} and of galaxies {pair("AP, galaxies", model, other)}, recall at precision 0.95
        {pair("recall, stars", model, other)} and {pair("recall, galaxies", model, other)}"""
    return "\n".join((item(f"""**Skies as surveys deliver them.** `config/psfnet-fast.fits` first learned ideal skies, then, with
        {images["psfnet-skies"]} images (psfnet-skies), noise correlated by smoothing, resampling and drizzling, uneven noise, skies that are
        off, dark structure, cosmic rays, halos, PSFs given wrongly, galaxies of COSMOS. That costs nothing on ideal scenes
        ([table](../validation/results/models/models.md), inside the range of the training): a deeper network before and, in brackets,
        after the second part has {pairs(ideal, deep)}. One seed of each; differences that are significant have stars in the table."""),
        item(f"""**A quieter sky.** {images["psfnet-floor"]} images more (psfnet-floor) were restored from a deconvolved copy that holds less noise (TIKHONOV 0.1
        for 0.02), bright, large galaxies were among them, and errors counted relative to the light from 3 sigma on, not from 10
        (LOSS_FLOOR). Before and, in brackets, after that: {pairs(skies, floor)}. One seed."""),
        item(f"""**As much light as there is.** A loss of pixels sees mostly where light lies, by fractions of a pixel. The next
        {images["psfnet-fast"]} images, the last of psfnet-fast, had a term for how much there is (LOSS_LIGHT 30), and more resampled noise. Bias of stars' fluxes at
        S/N 5 to 12, 12 to 50 and above, mean over seeings, before: {biases["psfnet-floor"]} %, after: {biases["psfnet-fast"]} %. Before and,
        in brackets, after: {pairs(floor, fast)}. One seed."""),
        item(f"""**Two stages.** `config/psfnet.fits` went on from there for {images["psfnet"]} images, with a second network and LOSS_FFL 1 in place of
        LOSS_LIGHT, which made PSNR and SSIM of two stages worse than of one ([table](../validation/results/stages/longer.md)). In brackets psfnet-fast: {pairs(base, fast)}; bias of
        stars, whatever its sign, {wrong["psfnet"]} ({wrong["psfnet-fast"]}) % in the three classes. What is significant, psfnet-fast beside psfnet:
        {read["psfnet-fast"]}. One stage that went on with the same losses for {images["psfnet-one"]} images, half as many (psfnet-one), beside psfnet:
        {read["psfnet-one"]}. Which of stages and length did it this does not show. Seven seeds of skies, one of each training."""),
        item(f"""**How deep.** A stage has two residual blocks and one Richardson-Lucy step. Six blocks and two steps, twice the
        multiplications (psfnet-deep, trained like psfnet-skies, {images["psfnet-deep"]} images), have {pairs(deep, skies)}; in brackets psfnet-skies;
        scatter of bright stars is {short["psfnet-deep"]} ({short["psfnet-skies"]}) %. One seed of each, not trained for equally long. Of three seeds trained
        alike the deeper one gains {stage_difference(summary("stages/summary")["differences"], "deep - base")}.""")))


RECIPE_METRICS = {"psnr": ("PSNR", "dB", 1, 1), "ssim": ("SSIM", "", 3, 1), "ap_stars": ("average precision of stars", "", 3, 1),
                  "ap_galaxies": ("average precision of galaxies", "", 3, 1), "recall_stars": ("recall of stars", "", 3, 1),
                  "recall_galaxies": ("recall of galaxies", "", 3, 1), "absbias_5_12": ("bias of stars of S/N 5 to 12", "%", 1, -1),
                  "absbias_12_50": ("bias of stars of S/N 12 to 50", "%", 1, -1), "absbias_50": ("bias of brighter stars", "%", 1, -1),
                  "scatter_5_12": ("scatter of stars of S/N 5 to 12", "%", 1, -1), "scatter_12_50": ("scatter at S/N 12 to 50", "%", 1, -1),
                  "scatter_50": ("scatter of brighter stars", "%", 1, -1)}


def recipe_effects(found):
    said = []
    for mode in ("INFORMED", "BLIND"):
        for effect in ("PSF network and cycles", "active learning"):
            sides = {1: [], -1: []}
            for metric, (words, unit, digits, sign) in RECIPE_METRICS.items():
                effects = found["metrics"].get(metric, {}).get(mode, {}).get("effects", {})
                if effects and effects[effect]["p_holm"] < 0.05:
                    difference = effects[effect]["difference"]
                    sides[1 if difference * sign > 0 else -1].append(f"{words} {difference:+.{digits}f} {unit}".strip())
            parts = [f"{word} {listed(sides[side])}" for side, word in ((1, "better"), (-1, "worse")) if sides[side]]
            said.append(f'{mode}, {effect}: {"; ".join(parts) if parts else "no difference beyond the luck of the seed"}.')
    return " ".join(said)


def stage_difference(found, pair):
    words = {"psnr": ("PSNR", " dB", 1), "ssim": ("SSIM", "", 4), "ap_stars": ("average precision of stars", "", 4), "ap_galaxies": ("of galaxies", "", 4)}
    return listed([f"{name} {found[metric][pair]['difference']:+.{digits}f} ± {found[metric][pair]['error']:.{digits}f}{unit}"
                   for metric, (name, unit, digits) in words.items()])


def bracketed(cell):
    """What stands in brackets behind a value, without its stars."""
    return re.search(r"\(([-+][\d.]+)", cell)[1]


def longer_stages():
    """Two stages begun from the network of one, beside it: with its losses after a training and one more, and with others."""
    (_, shapes), (_, found), (_, fluxes), *_ = tables("validation/results/stages/longer.md")
    said = [f"PSNR {bracketed(row['PSNR (dB)'])} dB, SSIM {bracketed(row['SSIM'])}, average precision of stars {bracketed(row['AP, stars'])} and of galaxies "
            f"{bracketed(row['AP, galaxies'])}" for row in found[1:]]
    first, further, other = (shape["training images"] for shape in shapes[1:])
    bias = listed([f"{fluxes[-1][column].split()[0]} % ({fluxes[0][column]} %) {where}" for column, where in (
        ("abs. bias, S/N 5 to 12", "at S/N 5 to 12"), ("abs. bias, S/N 12 to 50", "at 12 to 50"), ("abs. bias, S/N above 50", "above"))])
    return (f"Begun from psfnet-fast, with its losses, and trained on for {first} images, they differ from it by {said[0]}; after {further} more, in "
            f"smaller batches and at a lower rate, {said[1]}. With LOSS_FFL 1 and LOSS_LIGHT 0, after {other} images, they do by {said[2]}, and the bias of stars, whatever "
            f"its sign, is {bias} ([table](../validation/results/stages/longer.md); one seed of the training, judged on one seed of skies): `psfnet.fits`")


def in_campaigns():
    """Two stages, three seeds, less one seed of one, in the campaigns."""
    tests = tables("validation/results/stages/models.md")[1][1]
    base, others = tests[0], tests[1:]

    def gain(key):
        return statistics.mean(float(row[key].split()[0]) for row in others) - float(base[key].split()[0])
    return (f"PSNR {gain('PSNR (dB)'):+.1f} dB, SSIM {gain('SSIM'):+.3f}, average precision of stars {gain('AP, stars'):+.3f} and of galaxies "
            f"{gain('AP, galaxies'):+.3f}, means of three seeds")


def recipes():
    """What the PSF network with its cycles, active learning and a second stage buy, beyond the luck of the seed."""
    early, late, stages = summary("recipes/summary"), summary("twins/summary"), summary("stages/summary")
    return "\n".join((
        item(f"""**The paper's recipe**: its PSF network with the cycles, all losses with weight 1, and active learning, against RESTORE alone
        and images of all kinds alike, three seeds each, a training being one observation. After {late["images"]["least"]} images of 128 x 128 pixels, by twins
        of the trainer on a GPU ([table](../validation/results/twins/recipes.md)): {recipe_effects(late)} Early in a training, after
        {early["images"]["least"]} to {early["images"]["most"]} images of 64 x 64 pixels by the trainer itself
        ([table](../validation/results/recipes/recipes.md)): {recipe_effects(early)}"""),
        item(f"""**Two stages**: a second network of the same shape goes on from what the first made and from what that leaves of the data (STAGES 2).
        Over three seeds, {stages["images"]} images each and {stages["tiles"]} tiles ([table](../validation/results/stages/stages.md)), two stages less one of
        psfnet-fast's shape: {stage_difference(stages["differences"], "stages - base")}; less one of as much work, six blocks and two steps:
        {stage_difference(stages["differences"], "stages - deep")}. At equal work SSIM is higher, the rest within the luck of the seed. In the
        campaigns ([table](../validation/results/stages/models.md)) they gain over one stage {in_campaigns()} (of which PSNR and SSIM are significant). {longer_stages()}.""")))


def templates_found():
    return "\n".join((template_goals(), template_faint(), spurious(), injected(), templates_sky()))


def selfcheck():
    rows = tables("validation/results/selfcheck/comparison.md")[0][1]
    everything = max((row["r"] for row in rows), key=lambda r: float(r.split("-")[1]) - float(r.split("-")[0]))

    def counts(run):
        row = one(rows, run=run, r=everything, of="all")
        found, of = row["found of the catalogue's"].split()[0].split("/")
        return found, of, f"{float(row['found of the injected'].split()[0]) * int(of):.0f}"
    return rows, everything, {run: counts(run) for run in ("NONE", "RL")}


def selfcheck_short():
    rows, magnitudes, count = selfcheck()
    least = min(float(row["p (Holm)"]) for row in rows)
    if least < 0.05:
        raise LookupError("the self check differs from the coadd: this text has to say where")
    low, high = magnitudes.split("-")
    (a, of, b), (c, _, d) = count["NONE"], count["RL"]
    return paragraph(f"""On the same frame the completeness that SELF_CHECK finds by injection was compared with the true one, against the deep
        catalogue: in none of {len(rows)} comparisons (r {low} to {high}, stars, galaxies, all) do they differ significantly. NONE
        finds {a} of {of} catalogue sources where injection predicts {b}; RL {c} where it predicts {d}.""")


def selfcheck_result():
    rows, magnitudes, count = selfcheck()
    galaxies = {run: [one(rows, run=run, r=magnitudes, of="galaxies")[f"found of the {whose}"].partition(" (")[0].split()[-1]
                      for whose in ("catalogue's", "injected")] for run in ("NONE", "RL")}
    (a, of, b), (c, _, d) = count["NONE"], count["RL"]
    least = min(float(row["p (Holm)"]) for row in rows)
    return (f"Result: in none of the {len(rows)} comparisons is the difference significant (smallest p after Holm's correction {least:.2g}). "
            f"Of the catalogue's galaxies somewhat fewer are found than of the injected ones ({galaxies['NONE'][0]} against "
            f"{galaxies['NONE'][1]} for NONE, {galaxies['RL'][0]} against {galaxies['RL'][1]} for RL): their sizes have a longer tail. "
            f"Of its stars slightly more are found than of the injected ones: a star blended with something is not called a star. In "
            f'"all" the two meet: {a} of {of} found by NONE, {b} expected; {c} by RL, {d} expected.\n')


def selfcheck_table():
    return tables("validation/results/selfcheck/comparison.md")[0][0]


def selfcheck_fluxes():
    return tables("validation/results/selfcheck/comparison.md")[1][0]


def resampled():
    """The SDSS frame under four ways of resampling, and the goals that the other tiles miss."""
    results = summary("resampled/summary")
    rows = [row for row in results["resampled"] if row["tile"] == "SDSS frame" and row["restorer"] in ("RL", "NET")]

    def line(row):
        return [row["way"], row["restorer"], str(row["sources"]), f"{row['false']:.0f}", f"{row['kept']:.2f}", f"{row['recall']:.3f}",
                f"{float(row['cards']['RXNFACT']):.2f}"]
    missed = [f"{v['tile']}, {v['way']}" for v in results["verdicts"] if not v["holds"]]
    return (table(["", "", "sources", "false per Mpixel", "kept", "recall", "RXNFACT"], [line(row) for row in rows]) + "\n" +
            paragraph(f"""([all tiles](../validation/results/resampled/resampled.md).)
        Of {len(results["verdicts"])} resampled tiles {len(results["verdicts"]) - len(missed)} meet the goal: at most 10 false per
        Mpixel or 1.5 times those as taken, 0.97 of the recall and of the list. Those that miss it: {"; ".join(missed)}."""))


def psf():
    """The PSF of the tile against known truths: medians over the tiles, by PSF_TYPE."""
    tiles = [row for row in summary("psf/truth") if "failed" not in row]
    names = {"AUTO": "PSF_TYPE AUTO", "PSFEX": "psfex's model"}

    def middle(way, value):
        return statistics.median(value(row) for row in tiles if row["way"] == way)

    def line(way, words):
        mags = [abs(row["mag"]) for row in tiles if row["way"] == way and row.get("mag") is not None]
        pulls = [abs(pull) for row in tiles if row["way"] == way for pull in row.get("pulls", [])]
        return [words, str(sum(row["way"] == way for row in tiles)), f"{1000 * middle(way, lambda row: abs(row['dT/T'])):.1f}",
                f"{1000 * middle(way, lambda row: row['dT/T rms']):.1f}", f"{100 * middle(way, lambda row: row['residual']):.2f}",
                f"{100 * middle(way, lambda row: abs(row['growth missed'])):.2f}", f"{statistics.median(mags):.4f}",
                f"{middle(way, lambda row: abs(row['predicted corner mag'])):.3f}", f"{1.4826 * statistics.median(pulls):.2f}"]
    kinds = len({row["case"] for row in tiles})
    return (paragraph(f"""Simulated tiles of {kinds} known PSFs: Moffats, Gaussian with an exponential halo,
        Kolmogorov, diffraction spikes, constant and varying over the tile, FWHM 1.5 to 8 pixels, 20 to 20,000 stars per Mpixel; medians
        over the tiles of the size of each error, without noise on a grid of places, and of bright stars' template fluxes:""") + "\n" +
            table(["", "tiles", "dT/T (1e-3)", "its rms over the tile", "residual (%)", "growth (%)", "MAG_TEMPLATE (mag)",
                   "at the worst corner", "pulls' width"],
                  [line(way, words) for way, words in names.items() if any(row["way"] == way for row in tiles)]))


def crowded():
    """How many cells hold each goal beside ALLSTAR, and recall at precision 0.95 by density and FWHM."""
    found = summary("crowded/summary")
    cells, programs = found["cells"], ("NONE", "NET", "ALLSTAR")
    whole = [name for name, row in cells.items() if set(programs) <= set(row)]

    def at95(name):
        row = cells.get(name, {})
        return " / ".join(f"{row[by]['at95']:.2f}" if by in row else "-" for by in programs)
    densities = [d for d in ("500", "2000", "8000", "20000") if any(name.startswith(d + "-") for name in cells)]
    kinds = [k for k in ("2.5", "4", "6", "4G", "4V", "4VG") if any(f"{d}-{k}" in cells for d in densities)]
    peer = f" (ALLSTAR's tiles of seed {found['allstar']}, drawn in the same way)" if "allstar" in found else ""
    text = (paragraph(f"""Seed {found["seed"]}{peer}: stars of S/N 5 to 3000, beside IRAF's ALLSTAR in two passes, its PSF and
        parameters chosen for it ([all columns and bins](../validation/results/crowded/crowded.md)). Recall at precision 0.95,
        NONE / NET / ALLSTAR, by stars per Mpixel and FWHM (G: a fifth are galaxies, V: the PSF varies):""") + "\n" +
            table(["", *kinds], [[d] + [at95(f"{d}-{k}") for k in kinds] for d in densities]) + "\n" +
            paragraph(f"""Of {len(whole)} cells that all three have, this program's goals are held:""") + "\n" +
            table(["goal", "NONE", "NET"], [[goal] + [f"{v[by]['held']} of {v[by]['of']}" for by in ("NONE", "NET")]
                                            for goal, v in found["goals"].items()]))
    if "large" in found:
        v = found["large"]
        text += "\n" + paragraph(f"""100,000 stars on 4096 x 4096 pixels ({v["restorer"]}): {v["cpu"]:.0f} CPU seconds, {v["gigabytes"]:.1f} GB.""")
    return text


def close_pairs():
    """Of pairs whose brighter star has S/N 50 to 200: resolved, error of the ratio, and what is marked of the rest."""
    body = []
    for way, rows in summary("crowded/summary")["pairs"].items():
        for ratio in (1.0, 0.5, 0.2):
            these = [one(rows, low=50, ratio=ratio, apart=apart) for apart in (0.5, 0.75, 1.0)]
            body.append([way, f"{ratio:g}"] + [", ".join("-" if v is None else f"{v:.2f}" for v in (r["resolved"], r["error"], r["marked"]))
                                               for r in these])
    return table(["", "flux ratio", "0.5 FWHM", "0.75 FWHM", "1 FWHM"], body)


def put_in():
    """Completeness and bias of stars of S/N 30 to 100 put into real tiles, in the inner and outer quarter."""
    rows, body = summary("crowded/summary")["real"]["rings"], []
    for tile, by in dict.fromkeys((row["tile"], row["by"]) for row in rows):
        rings = [row for row in rows if (row["tile"], row["by"]) == (tile, by)]
        body.append([tile, by, str(rings[0]["sources"]), f"{rings[0]['chi2']:.2f}"] +
                    [f"{r['30']['complete']:.2f}, {r['30']['bias']:+.3f}, {r['30']['scatter']:.3f}" for r in (rings[0], rings[-1])])
    return table(["tile", "", "sources", "chi2", "inner quarter", "outer quarter"], body)


def sdss_coadd():
    """The SDSS frame with CROWDING AUTO and N: matched, not matched, magnitudes."""
    body = []
    for row in summary("crowded/summary")["coadd"]:
        body.append([f"{row['by']}, {row['crowding']}", str(row["sources"]), str(row["matched"]), f"{row['false_bright']:.3f}"] +
                    [f"{b['bias']:+.3f}, {b['scatter']:.3f} ({b['n']})" for b in row["bins"]])
    bins = [f"r {b['low']} to {b['high']}" for b in summary("crowded/summary")["coadd"][0]["bins"]]
    return table(["", "sources", "matched", "not in the coadd", *bins], body)


def preal():
    """Mean P_REAL and the share of these detections that is real."""
    found, injected, body = summary("preal/preal"), summary("preal/injected"), []
    rows = [row for row in found["reliability"] if row.get("mode") != "TILE"]
    for row in rows:
        bins = [b for b in row["bins"] if b["p"] >= 0.4]
        parts = [[b for b in bins if low <= b["p"] < high] for low, high in ((0.4, 0.6), (0.6, 0.8), (0.8, 0.9), (0.9, 1.01))]
        body.append([row["cell"]] + [f"{p[0]['p']:.2f}: {p[0]['real']:.2f} ({p[0]['n']})" if p else "-" for p in parts])
    some = [b for row in rows for b in row["bins"] if b["n"] >= 20 and b["p"] >= 0.5]
    marked = [row["marked_5"] for row in rows]
    return (paragraph(f"""Seeds {found["seeds"][0]} to {found["seeds"][-1]}, isolated sources and crowds of DENSITY-FWHM (T: no star below S/N 5; H: two thirds
        galaxies; C: a coadd), unrestored: mean P_REAL, the share of these detections that is real, and how many they are. Of bins of 20 detections and more above
        0.5 P_REAL is off by {max(abs(b["p"] - b["real"]) for b in some):.2f} at most, and in {sum(b["low"] <= b["p"] <= b["high"] for b in some)} of {len(some)} the
        share's interval at 95 % holds it. Real ones of S/N above 5 that are marked: {100 * min(marked):.1f} to {100 * max(marked):.1f} %.""") + "\n" +
            paragraph("Fluxes within MAGERR_INJECTED and MAGERR95_INJECTED (S/N 3 to 80; goals 0.68 and 0.95; seeds "
                      f"{injected['seeds'][0]} to {injected['seeds'][-1]}): " + ", ".join(
                f"{row['cell']} {row['rows'][-1]['68']:.3f} and {row['rows'][-1]['95']:.3f}" for row in injected["coverage"]) + ".") + "\n" +
            table(["", "0.4 to 0.6", "0.6 to 0.8", "0.8 to 0.9", "0.9 to 1"], body))


def robustness():
    found = summary("robustness/summary")
    cells, limits = found["cells"], found["limits"]
    silent = [c for c in cells if c["silent"]]
    said = [c for c in cells if c["said"]]

    def value(c):
        words = [f"{c['recall']:.2f}" if c["recall"] is not None else "-", f"{c['false']:.0f}",
                 f"{100 * c['bias']:+.1f}" if c["bias"] is not None else "-", f"{c['pull']:.1f}" if c["pull"] is not None else "-"]
        verdict = "" if not c["off"] else f"; **silent: {', '.join(c['off'])}**" if c["silent"] else f"; off: {', '.join(c['off'])}"
        return " / ".join(words) + verdict + (f"; says {', '.join(c['said'])}" if c["said"] else "")

    rows = [[f"{a['kind']}: {a['departure']}", a["what"], *(value(one(cells, departure=a["departure"], restorer=r)) for r in
             ("NONE", "RL", "NET"))] for a in cells[::3]]
    return (paragraph(f"""**{len(silent)} silent failure{"s" * (found["silent"] != 1)}** among {len(cells)} cells (goal 0); {found["off"]} cells are off a limit, the
        others of these say so themselves. {sum(c["right"] for c in said)} of {len(said)} words are right (goal 0.7). Seed {found["seed"]}.""") + "\n" +
            "".join(item(f"{name}: {limit[0]:g}, {limit[1]}.") for name, limit in limits.items()) + "\n" +
            "Each cell: recall / false per Mpixel / bias of templates in % / width of their pulls.\n\n" +
            table(["departure", "what", "NONE", "RL", "NET"], rows))


def limits():
    right, *wrong = (biases(f"FWHM 4{error}", "NET") for error in ("", ", PSF -5 %", ", PSF +5 %"))
    changes = [abs(b - a) for row in wrong for a, b in zip(right, row)]
    faint = [100 - 100 * float(row["value"])
             for row in rows_of("pixels", "cells", scene="OUTSKIRTS", run="NET", quantity="r2_snr0")]
    dwarfs = tables("validation/results/real/dwarfs.md")[0][1]
    light = max(100 - 100 * float(row["20 to 40 px"]) for row in dwarfs if row["run"] == "NET")
    bright = [row["condition"] for row in rows_of("photometry", "sets") if row["snr"] > 10]
    stars = [number("photometry", scene, c, "NET", "bias_percent") for c in bright
             for scene in {row["scene"] for row in rows_of("photometry", "sets")}]
    seeings = [number("fluxes", row["scene"], row["condition"], "NET", "bias_percent") for row in rows_of("fluxes", "sets") if row["snr"] > 10]
    return (item(f"""NET was trained on simulated skies, each with some of what surveys deliver (correlated noise, halos, PSFs given wrongly, skies that are
        off or dark, galaxies of COSMOS, up to some 20,000 stars per Mpixel), hardly one in twenty without any of it. What differs from all of these it does not know: the domain
        guard looks at FWHM, brightness and the correlation of the noise, and [the matrix](robustness.md) has what other departures do. A PSF that is
        5 % off changes fluxes by up to {max(changes):.0f} % ([more](validation.md#campaigns)).""") +
            item(f"""NET gives the mean of what could be there: sources near the noise come out fainter than they are, galaxies of S/N 5 to 10
        by {min(faint):.0f} to {max(faint):.0f} %, outskirts of dwarf galaxies by up to {light:.1f} %, and structure below the noise can be
        spurious or smoothed away. On blank sky it can find more than the unrestored image does (BLANK_CHECK).""") +
            item(f"""FLUX_AUTO of stars of S/N above 10 on NET's image is off by {min(stars):+.1f} to {max(stars):+.1f} % at the seeing of `photometry`, and by
        {min(seeings):+.1f} to {max(seeings):+.1f} % over those of `fluxes` ([campaigns](validation.md#campaigns)). Each tile's own scale is measured (RXFLXW), and a warning says where it is off by more than 1 %;
        templates, fitted on the untouched pixels, do not have this error."""))


def speed():
    """What the benchmark does not hold, by the row's key."""
    sizes = {size: json.loads(text_of(f"validation/results/bench/{size}/bench.json")) for size in ("full", "avx2", "two-stages")}
    rows = {size: {row["key"]: row for row in bench["rows"]} for size, bench in sizes.items()}

    def tally(size):
        judged = [row for row in rows[size].values() if row["target"] is not None]
        return f"{sum(row['held'] for row in judged)} of {len(judged)}"

    def ratios(keys, percent=False, size="full"):
        values = [statistics.median(rows[size][key]["ratio"]) for key in keys.split()]
        return listed(f"{100 * v:.0f}" if percent else f"{v:.1f}" for v in values) + (" %" if percent else "")

    def share(net, size="full"):
        names = [f"{net}-conv-{kind}-{cores}" for kind in ("F32", "BF16") for cores in (1, 2)]
        return ratios(" ".join(name for name in names if name in rows[size]), True, size)

    def iterations(net, cores, size="full"):
        return ratios(" ".join(f"{net}-rl{n}-{cores}" for n in (20, 30, 50, 100)), False, size)
    def extraction(cores):
        return listed(f"{statistics.median(rows['full'][f'none-sex-{kind}-{cores}']['ratio']):.1f}" for kind in
                      ("1k-sparse", "1k-crowded", "4k-sparse", "4k-crowded", "8k-sparse", "8k-crowded"))

    def per_thousand(kind):
        return f"{statistics.median(rows['full'][f'template-seconds-{kind}']['ours']) / 20:.2f}"
    def memory(size):
        return listed(f"{1 / statistics.median(rows[size][f'memory-{kind}-16k']['ratio']):.2f}" for kind in ("RL", "NET"))
    own = statistics.median(rows["full"]["net-conv-F32-1"]["ours"])
    transforms = [8e-3 * sizes["full"]["limits"][f"fft_{side}_1_ms"] / own for side in (1024, 1152)]
    around = [1 / statistics.median(rows["full"][f"net-around-F32-{cores}"]["ratio"]) for cores in (1, 2)]
    return (paragraph(f"""{tally("full")} targets are met on {sizes["full"]["processor"]} ([tables](../validation/results/bench/full/bench.md)). An
        earlier program, whose default network had twice the multiplications and whose targets were lower, met {tally("avx2")} on
        {sizes["avx2"]["processor"]} ([tables](../validation/results/bench/avx2/bench.md)). With the two stages of psfnet.fits it met {tally("two-stages")} on
        {sizes["two-stages"]["processor"]}, a virtual machine that shares its processor and where the first use of memory is dear, which
        sparse tiles feel most ([tables](../validation/results/bench/two-stages/bench.md)): there NET takes 1/{iterations("net", 1, "two-stages").replace(", ", ", 1/").replace(" and ", " and 1/")} of the
        time of 20, 30, 50 and 100 plain iterations on one core. What is missed, and why:""") + "\n" +
            item(f"""**Without restoration against source-extractor** (in place of 2 times on one core, 3.2 times on two), on tiles of 1, 4 and
        8 thousand pixels a side, sparse and crowded: {extraction(1)}, and on two cores {extraction(2)}. The sky is measured twice, the noise's
        correlation and the digest of the pixels once, which weigh most on sparse tiles (`-VERBOSE_TYPE FULL` shows each step).""") +
            item(f"""**Templates** (in place of 0.5 s for 1,000 sources on one core): {per_thousand("NONE")} s on the sources of NONE,
        {per_thousand("NET")} on those of NET, of a crowded tile. There the residual is searched up to eight times, and after each time all
        that is near what came or went is fitted again: point, profile and pair, with sky and noise between.
        CROWDING N leaves that out.""") +
            item(f"""**Around the network** (in place of 1.35 times its own time): {listed(f"{v:.1f}" for v in around)} times on one core
        and two, f32. The eight transforms of the deconvolved copy (2), the Richardson-Lucy step (4) and reblurring (2) alone are {transforms[0]:.2f}
        (1024 x 1024 pixels) to {transforms[1]:.2f} (1152 x 1152, with what reaches in) of the network's time; noise units, filling, the sky at low
        frequency, chi2 and memory are the rest.""") +
            item(f"""**The network's share of the convolution peak** (in place of 80 %): {share("net")} of f32 on one and two
        cores, then of bf16; of the earlier one with AVX2 alone {share("net", "avx2")}. A tile is
        worked on with its surroundings, in one block per core, where two cores do them twice at the seam. What is not multiplication
        (interpolation, edges, rows going in and out of the cache) does not become faster with the peak. In bfloat16 the first layer
        stays in float, for the sake of bright stars.""") +
            item(f"""**NET against Richardson-Lucy** (in place of 5 times), one core: {iterations("net", 1)} times faster than 20, 30, 50
        and 100 plain iterations; two cores {iterations("net", 2)}; with AVX2 alone, one core, {iterations("net", 1, "avx2")}. (Scikit-image's of 30 iterations takes {ratios("net-skimage-1 net-skimage-2")} times as
        long, 10 wanted.) What stands around the network bounds this: the deconvolved copy, the Richardson-Lucy step, noise units, filling, reblurring, the
        sky at low frequency and memory (`rextract -VERBOSE_TYPE FULL` shows them).""") +
            item(f"""**Two cores** instead of one (in place of 1.8 times): NET {ratios("net-scaling")}, the whole stage {ratios("stage-scaling")}: pages that the system clears while it hands them out, start-up, matching and tables of the
        report are not shared out.""") +
            item(f"""**Richardson-Lucy against scikit-image's** (in place of 3 and 5, one and two cores): {ratios("rl-skimage-1 rl-skimage-2")},
        with AVX2 alone {ratios("rl-skimage-1 rl-skimage-2", False, "avx2")}. An iteration takes {listed(f"{1 / statistics.median(rows['full'][f'rl-blur-{n}']['ratio']):.2f}" for n in (1, 2))}
        times the transforms that it makes (1.1 wanted), and **siril's**, which has Gaussian PSFs alone, {ratios("rl-siril-1 rl-siril-2")} of our time.""") +
            item(f"""**Growth.** {listed(f"{1 / statistics.median(row['ratio']):.1f}" for key, row in rows["full"].items() if key.startswith("growth-"))}
        times from the least to the most seconds per Mpixel (in place of 1.15; NONE, RL, NET, NONE with templates): small tiles cost more, as
        libraries have to be loaded and the noise's correlation takes its time; Richardson-Lucy above 2^26 pixels makes its data anew in each
        iteration, to save memory; templates grow with page faults. **Memory** of RL and NET on 16k is
        {memory("full")} of what is allowed; with two stages, whose second reads two planes more, {memory("two-stages")}.""") +
            item(f"""**A training step** (in place of 60 % of the peak) ran at {ratios("training-conv", True)}, with AVX2 alone at
        {ratios("training-conv", True, "avx2")}: most of it are convolutions of few channels, forward and backward."""))


def amdahl():
    """Efficiencies that the serial CPU seconds allow."""
    measured = summary("bench/amdahl")
    rows = []
    for name, steps in measured["kinds"].items():
        serial, both = (sum(step[k] for step in steps.values()) for k in (0, 1))
        share = serial / both
        largest = sorted(steps, key=lambda step: -steps[step][0])[:2]
        rows.append([name, f"{both:.2f}", f"{serial:.2f}", f"{100 * share:.0f} %",
                     *(f"{100 / (n * share + 1 - share):.0f} %" for n in (2, 4, 8)),
                     listed(f"{step} {steps[step][0]:.2f}" for step in largest)])
    return (paragraph(f"""CPU seconds on a crowded tile of {measured["side"]} x {measured["side"]} pixels, in all and outside what threads share, and
        the efficiency on 2, 4 and 8 cores that Amdahl's law leaves:""") + "\n" +
            table(["", "all [s]", "serial [s]", "share", "2 cores", "4", "8", "most of it [s]"], rows))


def cores():
    """Seconds by the clock on more and more cores."""
    measured = summary("bench/cores")
    rows = []
    for name, runs in measured["kinds"].items():
        numbers = sorted((n for n in runs if n != "side"), key=int)
        one, most = runs["1"], runs[numbers[-1]]
        lost = {step: most["steps"][step] - one["steps"][step] / int(numbers[-1]) for step in most["steps"]}
        worst = sorted(lost, key=lambda step: -lost[step])[:2]
        rows.append([name, f"{runs['side']}", *(f"{runs[n]['seconds']:.2f}" for n in numbers),
                     *(f"{100 * one['seconds'] / runs[n]['seconds'] / int(n):.0f} %" for n in numbers[1:]),
                     listed(f"{step} {lost[step]:.2f}" for step in worst)])
    return (paragraph(f"""By the clock, on {measured["cores"]} cores of {measured["processor"]} without other work: seconds of a crowded tile on
        {listed(numbers)} cores, and efficiency. Last, the steps where most of the seconds on {numbers[-1]} are that would not be there if all were
        shared out:""") + "\n" +
            table(["", "pixels", *(f"{n} [s]" for n in numbers), *numbers[1:], f"lost on {numbers[-1]} [s]"], rows))


def against_time():
    """Both networks beside the best Richardson-Lucy, whatever time that takes, and beside those that take no longer."""
    rows, every = [], summary("quality/summary")
    for fwhm in sorted({run["fwhm"] for run in every}):
        runs = [run for run in every if run["fwhm"] == fwhm]
        rl = [run for run in runs if run["series"].endswith("RL")]
        for net, model in ((run, model) for series, model in (("NET", "psfnet"), ("fast NET", "psfnet-fast")) for run in runs if run["series"] == series):
            brief = [run for run in rl if run["seconds"] <= net["seconds"]]
            cells = [f"{net[what]:{form}} ({max(run[what] for run in brief):{form}}, {max(run[what] for run in rl):{form}})"
                     for what, form in (("ap", ".3f"), ("psnr", ".1f"))]
            rows.append([f"{fwhm:g}", model, f"{net['seconds']:.2f}", *cells])
    return table(["FWHM", "network", "s per Mpixel", "average precision (RL in that time, RL at its best)", "PSNR in dB (the same)"], rows)


# Networks by the campaign of their restorations; the paper's kind first.
NETWORKS = {"restoration-blind": "psfnet-blind", "restoration-paper": "psfnet-paper", "restoration-paper-long": "psfnet-paper-long",
            "restoration-paper-informed": "psfnet-paper-informed", "restoration": "psfnet", "restoration-fast": "psfnet-fast", "restoration-real": "psfnet, galaxies of COSMOS"}
LISTS = ("photometry", "photometry-sdss", "fluxes", "fluxes-errors", "detection", "detection-errors")


def claims_of(campaigns):
    """The paper's claims that these test, in its order: of each its row, and the verdicts by campaign."""
    rows, verdicts = {}, {}
    for name in campaigns:
        for row in rows_of(name, "claims"):
            if not row["claim"].startswith("goal") and row["verdict"] != "not tested here":
                rows.setdefault(row["claim"], row)
                verdicts.setdefault(row["claim"], {})[name] = row["verdict"]
    return rows, verdicts


def said_in_paper(row):
    return [f'{row["place"]}: {row["words"]}', row["reproduced_when"].replace("|", "\\|")]


def paper():
    """The paper's claims on restored images, network by network."""
    rows, verdicts = claims_of(NETWORKS)
    return table(["the paper", "counts as reproduced when", *NETWORKS.values()],
                 [said_in_paper(row) + [verdicts[name].get(campaign, "") for campaign in NETWORKS] for name, row in rows.items()])


def paper_lists():
    """The paper's claims on lists and fluxes of stars, campaign by campaign."""
    rows, verdicts = claims_of(LISTS)
    named = [campaign for campaign in LISTS if any(campaign in found for found in verdicts.values())]
    return table(["the paper", "counts as reproduced when", *named],
                 [said_in_paper(row) + [verdicts[name].get(campaign, "") for campaign in named] for name, row in rows.items()])


def paper_networks():
    """What each network's images are beside others."""
    return "\n".join(beside_rl(model, name) for name, model in NETWORKS.items())


QUALITIES = {"psnr": ("PSNR (dB)", "{:+.1f}"), "ssim": ("SSIM, the paper's K", "{:+.2f}"), "ssim_wang": ("SSIM, K of Wang et al.", "{:+.2f}"),
             "ssim_object": ("SSIM on the object", "{:+.2f}")}


def beside_rl(model, name):
    bins = rows_of(name, "bins")

    def duels(second, quality, first="NET"):
        rows = rows_of(name, "contests", first=first, second=second, quantity=quality)
        return [row for row in rows if row["test"] == "paired t"]

    def against(second, first="NET"):
        cells = []
        for quality, (_, form) in QUALITIES.items():
            found = duels(second, quality, first)
            winners = [row["winner"] for row in found]
            cells.append(f'{span([float(row["difference"]) for row in found], form)}; {winners.count(first)} : {winners.count(second)}')
        return cells

    def won_by(winner, quality):
        found = [row for row in duels("RL", quality) if row["winner"] == winner]
        return "at " + "; ".join(f'{scene} {runs_of([float(row["condition"]) for row in found if row["scene"] == scene])}'
                                 for scene in dict.fromkeys(row["scene"] for row in found)) if found else "nowhere"
    names = {"RL": "RL, true PSF, tuned for PSNR", "RL_SSIM": "RL tuned for SSIM: a blur", "RL_FLAT": "RL with its sky set flat",
             "SMOOTHED": "no deconvolution: a tuned filter", "BLURRED": "the blurred images"}
    rows = [[words, *against(second)] for second, words in names.items()]
    rows.insert(3, ["the skies of both set flat", *against("RL_FLAT", "NET_FLAT")])
    return (paragraph(f"""**{model}**, the {len(bins)} bins of {span([b["scenes"] for b in bins], "{:d}")} scenes of `{name}`, seed
        {summary(f"{name}/summary")["seed"]}: range over the bins of the mean difference to the
        others, and in how many bins the network is clearly above and clearly below:""") + "\n" +
            table(["against", *(words for words, _ in QUALITIES.values())], rows) + "\n" +
            paragraph(f"""Below RL in PSNR {won_by('RL', 'psnr')}, in the paper's SSIM {won_by('RL', 'ssim')}, on the object {won_by('RL', 'ssim_object')}."""))


# t of the paper's Tables 1 to 4, and the quantile of Student's t that makes errors of the intervals of bins of 70 and 40 scenes
PRINTED = {("Table 1: SSIM by FWHM", "FWHM", "ssim"): {2: 17.97, 4: 20.46, 6: 17.57, 8: 20.27, 10: 20.76, 12: 18.79, 14: 24.56},
           ("Table 2: PSNR by FWHM", "FWHM", "psnr"): {2: 49.69, 4: 73.94, 6: 56.31, 8: 75.21, 10: 76.49, 12: 68.05, 14: 110.96},
           ("Table 3: SSIM by noise", "noise", "ssim"): {2: 1.70, 9: 17.81, 12: 26.46, 15: 32.40, 18: 32.12, 21: 40.43, 23: 40.60, 25: 43.98},
           ("Table 4: PSNR by noise", "noise", "psnr"): {2: 6.66, 9: 34.76, 12: 42.52, 15: 39.62, 18: 43.38, 21: 50.09, 23: 47.96, 25: 59.78}}
STUDENT = {70: 1.994945, 40: 2.022691}


def paper_tables():
    """t of two samples, NET against RL, as the paper prints it."""
    def t_of(name, scene, quantity, condition):
        net, rl = (one(rows_of(name, "cells"), scene=scene, condition=str(condition), run=run, quantity=quantity) for run in ("NET", "RL"))
        errors = [(float(row["value_high"]) - float(row["value_low"])) / 2 / STUDENT[int(row["value_n"])] for row in (net, rl)]
        return (float(net["value"]) - float(rl["value"])) / sum(error ** 2 for error in errors) ** 0.5
    lines = []
    for (title, scene, quantity), printed in PRINTED.items():
        rows = [["the paper", *(f"{value:.2f}" for value in printed.values())]]
        rows += [[NETWORKS[name], *(f"{t_of(name, scene, quantity, bin):.2f}" for bin in printed)] for name in ("restoration-blind", "restoration-paper-long", "restoration")]
        lines.append(table([title, *map(str, printed)], rows))
    return "\n".join(lines)


def paper_speed():
    def shares(size):
        rows = {row["key"]: row for row in json.loads(text_of(f"validation/results/bench/{size}/bench.json"))["rows"]}
        faster = [statistics.median(rows[f"net-rl{n}-1"]["ratio"]) for n in (20, 30, 50, 100)]
        return faster[1], listed(f"1/{ratio:.1f}" for ratio in faster)
    (two, two_stages), (_, one_stage) = shares("two-stages"), shares("full")
    every = summary("quality/summary")

    def seconds(series, niter=""):
        return {run["fwhm"]: run["seconds"] for run in every if run["series"] == series and run["niter"] == niter}
    default, nets = seconds("accelerated RL", 18), {"psfnet": seconds("NET"), "psfnet-fast": seconds("fast NET")}
    beside = {model: span([times[fwhm] / default[fwhm] for fwhm in default]) for model, times in nets.items()}
    best = {key: max(run[key] for run in every if run["series"].endswith("RL") and run["fwhm"] == 4) for key in ("psnr", "ap")}
    return paragraph(f"""**Speed** (Section 3.3, Figure 8: a tenth of the time of RL with a given PSF). On one core, the same for both,
        psfnet takes {two_stages} of the time of 20, 30, 50 and 100 plain iterations: *{"reproduced" if two >= 10 else "not reproduced"}* at the 30 that
        were the default. A network of one stage, like psfnet-fast, takes {one_stage} on another machine ([benchmarks](bench.md)). Beside today's default,
        18 accelerated iterations, psfnet takes {beside["psfnet"]} times as long, psfnet-fast {beside["psfnet-fast"]} times. At equal quality there is no ratio: no number of
        iterations reaches either network (at FWHM 4 at best {best["psnr"]:.1f} dB and average precision {best["ap"]:.2f} by CONV;
        [quality against time](bench.md#quality-against-time)). The paper's two programs ran on different hardware.""")


BLOCKS = {function.__name__.replace("_", "-"): function for function in (
    five, sdss_frame, campaigns, selfcheck_short, selfcheck_result, selfcheck_table, selfcheck_fluxes, templates_table,
    templates_found, models, recipes, limits, robustness, resampled, psf, crowded, close_pairs, put_in,
    sdss_coadd, preal, speed, amdahl, cores, against_time, paper, paper_lists, paper_networks, paper_tables, paper_speed)}


# --- check and write

def differences(path, line, found, expected):
    """What a reader would see as different: words, with the line of each."""
    words = [(word, line + i) for i, row in enumerate(found.splitlines()) for word in row.split()]
    new = expected.split()
    if [word for word, _ in words] == new:
        return [f"{path}:{line}: the same words on other lines"]
    out = []
    for kind, a, b, c, d in difflib.SequenceMatcher(None, [word for word, _ in words], new, False).get_opcodes():
        if kind != "equal":
            where = words[min(a, len(words) - 1)][1] if words else line
            out.append(f'{path}:{where}: found "{" ".join(w for w, _ in words[a:b])}", expected "{" ".join(new[c:d])}"')
    return out


def texts(write):
    """What is wrong: blocks that cannot be made and, unless they are written, those that are not what the results say."""
    wrong, stale, seen = [], [], set()
    for path in TEXTS:
        text = text_of(path)

        def renew(match, path=path, text=text):
            head, name, found, tail = match.groups()
            line = text.count("\n", 0, match.start()) + 1
            try:
                expected = BLOCKS[name]()
            except (LookupError, TypeError, ValueError, OSError) as error:
                wrong.append(f"{path}:{line}: block {name} cannot be made: {error!r}")
                return match[0]
            if found != expected:
                stale.extend(differences(path, line + 1, found, expected))
            return head + expected + tail

        new = MARK.sub(renew, text)
        marked = re.findall(r"^ *<!-- numbers: ([a-z-]+) -->$", text, re.M)
        seen.update(marked)
        if len(marked) != len(MARK.findall(text)):
            wrong.append(f"{path}: a block without its end")
        if write and new != text:
            with open(os.path.join(TOP, path), "w", encoding="utf-8") as file:
                file.write(new)
            print(f"{path}: renewed")
    wrong.extend(f"validation/texts.py: no text has the block {name}" for name in sorted(set(BLOCKS) - seen))
    return wrong if write else wrong + stale


def dead_links():
    """Relative links of the texts to a file or a title that is not there."""
    wrong = []
    pages = tuple(f"docs/{name}" for name in sorted(os.listdir(os.path.join(TOP, "docs"))) if name.endswith(".md"))
    for path in dict.fromkeys(TEXTS + pages + ("PROMISES.md", "CONTRIBUTING.md", "validation/README.md", "validation/results/README.md",
                                               "tests/data/sdss.md")):
        for line, words in enumerate(text_of(path).splitlines(), 1):
            for link in re.findall(r"\]\((?!https?:)([^)]+)\)", words):
                file, _, title = link.partition("#")
                there = os.path.normpath(os.path.join(os.path.dirname(path), file)) if file else path
                titles = ([re.sub(r"[^\w -]", "", found.lower()).replace(" ", "-")
                           for found in re.findall(r"^#+ (.*)$", text_of(there), re.M)] if title else [""]) \
                    if os.path.exists(os.path.join(TOP, there)) else []
                if title not in titles:
                    wrong.append(f"{path}:{line}: {link} leads nowhere")
    return wrong


# --- committed results and new ones

def leaves(value, path=""):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from leaves(inner, f"{path}/{key}")
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from leaves(inner, f"{path}/{i}")
    else:
        yield path, value


def numbers_of(path):
    """Path or line, and value, of everything in a result that can be compared."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if path.endswith(".json"):
        return {key: value for key, value in leaves(json.loads(text)) if not key.startswith("/record/")}
    words = [(f"line {i + 1}, word {j + 1}", word) for i, line in enumerate(text.splitlines()) if not line.startswith("#")
             for j, word in enumerate(re.split(r"[,|\s]+", line))]
    return {place: float(word) if NUMBER.fullmatch(word) and word != "null" else word for place, word in words}


def agree(a, b, digits):
    if isinstance(a, float) and isinstance(b, (int, float)) or isinstance(b, float) and isinstance(a, (int, float)):
        return a == b or a != a and b != b or abs(a - b) <= 10.0 ** -digits * max(abs(a), abs(b), 0.1)
    return a == b


def committed(name, folder):
    """Files of results/NAME that can be compared and taken, each with that of the new run."""
    home = os.path.join(TOP, "validation/results", name)
    if not os.path.isdir(folder):
        raise SystemExit(f"texts.py: {folder} is no folder")
    for file in sorted(os.listdir(home)) if os.path.isdir(home) else ("summary.json",):
        places = [os.path.join(folder, *path) for path in ((name, file), (file,), ("..", file), ("qa_" + file[:-5], "summary.json"), ("qa_AUTO", file))]
        yield os.path.join(home, file), next((place for place in places if os.path.isfile(place)), None)


def compare(name, folder, digits):
    wrong = 0
    for old, new in committed(name, folder):
        if not old.endswith((".json", ".ecsv", ".md")) or os.path.basename(old) == "contests.ecsv":
            continue
        if not new:
            print(f"{os.path.basename(old)}: not in {folder}")
            continue
        a, b = numbers_of(old), numbers_of(new)
        off = [key for key in a if key not in b or not agree(a[key], b[key], digits)] + [key for key in b if key not in a]
        wrong += len(off)
        print(f"{os.path.basename(old)}: {len(a)} values, {len(off)} differ in {digits} digits")
        for key in off[:10]:
            print(f"    {key}: {a.get(key)}, now {b.get(key)}")
    return 1 if wrong else 0


USED = ("scene", "condition", "quantity", "first", "second", "test", "difference", "low", "high", "holm", "winner")


def used(path):
    """A table of tests without what no text quotes: kept are paired t of restored images with what they are set against."""
    rows = ecsv_rows(open(path, encoding="utf-8").read())
    kept = [[row[key] for key in USED] for row in rows
            if row["test"] == "paired t" and (row["first"].startswith("NET") or (row["first"], row["second"]) == ("RL", "SMOOTHED"))]
    numbers = {"difference", "low", "high", "holm"}
    head = "".join(f"# - {{name: {key}, datatype: {'float64' if key in numbers else 'string'}}}\n" for key in USED)
    body = "".join(",".join(f"{float(cell):.6g}" if key in numbers else f'"{cell}"' for key, cell in zip(USED, row)) + "\n" for row in kept)
    return f"# %ECSV 1.0\n# ---\n# delimiter: ','\n# datatype:\n{head}# schema: astropy-2.0\n{','.join(USED)}\n{body}"


def take(name, folder):
    for old, new in committed(name, folder):
        if not new:
            continue
        text = used(new) if name.startswith("restoration") and old.endswith("contests.ecsv") else open(new, encoding="utf-8").read()
        if open(old, encoding="utf-8").read() != text:
            with open(old, "w", encoding="utf-8") as file:
                file.write(text)
            print(f"{os.path.relpath(old, TOP)}: renewed")
    return 0


def main(arguments):
    if arguments in (["check"], ["write"]):
        wrong = texts(arguments == ["write"]) + dead_links()
        print("\n".join(wrong) if wrong else f"{len(BLOCKS)} blocks: fine")
        return 1 if wrong else 0
    if len(arguments) in (3, 4) and arguments[0] == "compare":
        return compare(arguments[1], arguments[2], int(arguments[3]) if len(arguments) == 4 else 4)
    if len(arguments) == 3 and arguments[0] == "take":
        return take(*arguments[1:])
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
