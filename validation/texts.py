#!/usr/bin/env python3
"""The numbers in the texts, from the committed results.

usage: texts.py check                        do the texts say what the results say? FILE:LINE of each word that differs
       texts.py write                        make them say it
       texts.py compare NAME FOLDER [DIGITS] results/NAME against a new run's folder, to DIGITS (4) digits
       texts.py take NAME FOLDER             results/NAME becomes that of a new run's folder

A block of a text between `<!-- numbers: NAME -->` and `<!-- end -->` is written by the function of that name below: change
its words there. Needs nothing but Python's own library. RX_TEXTS_TOP is another root than that of the sources.
"""
import csv
import difflib
import json
import math
import os
import re
import shutil
import statistics
import sys
import textwrap

TOP = os.environ.get("RX_TEXTS_TOP") or os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
TEXTS = ("README.md", "PROMISES.md", "validation/README.md", "validation/results/README.md",
         "validation/selfcheck/README.md", "validation/sextractor/README.md")
MARK = re.compile(r"(^ *<!-- numbers: ([a-z-]+) -->\n)(.*?)(^ *<!-- end -->$)", re.M | re.S)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|\bnull\b|\bnan\b")


# --- what is read

def text_of(path):
    with open(os.path.join(TOP, path), encoding="utf-8") as file:
        return file.read()


def summary(name):
    return json.loads(text_of(f"validation/results/{name}.json"))


def ecsv(name):
    lines = [line for line in text_of(f"validation/results/{name}.ecsv").splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def tables(path):
    """The tables of a Markdown file: of each its lines, and its rows as dictionaries."""
    found = []
    for lines in re.findall(r"(?:^\|.*\|[ ]*\n)+", text_of(path), re.M):
        cells = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in lines.splitlines()]
        found.append((lines, [dict(zip(cells[0], row)) for row in cells[2:]]))
    return found


def one(rows, **wanted):
    """The only row that has these values."""
    rows = [row for row in rows if all(row[key] == value for key, value in wanted.items())]
    if len(rows) != 1:
        raise LookupError(f"{len(rows)} rows with {wanted}")
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
        v = {key: run["all"][key]["value"] for key in ("recall", "precision", "ap", "magerr", "bias_mag", "mag50")}
        return [f"{v['recall']:.3f}", f"{v['precision']:.3f}", f"{v['ap']:.3f}", f"{v['magerr']:.1f} %",
                f"{v['bias_mag']:+.3f} mag", f"r = {v['mag50']:.2f}"]

    rows = [[names[run["name"]], str(run["detections"])] + quality(run) for run in auto["runs"]]
    model = [[names[run["name"]] + ", psfex's PSF", str(run["detections"])] + quality(run) for run in psfex["runs"][1:]]
    return (paragraph(f"""`validation/sdss/run.sh` restores that frame ({auto["width"]} x {auto["height"]} pixels, FWHM
        {fwhm:.2f} pixels = {fwhm * auto["pixel_scale_arcsec"]:.1f} arcsec) and compares it with the catalogue of the
        much deeper coadd of the same sky ({auto["runs"][0]["references"]} sources that count, r to about 23; what lies
        fainter is missing there, so precision is a lower bound). Three keywords are set, as the frame, in
        nanomaggies, does not hold them: {everywhere}. The PSF is that of PSF_TYPE AUTO, below that the model which
        `psfex` makes from our own catalogue (PSF_TYPE PSFEX, varying across the frame); all else has its
        default.""") + "\n" +
            table(["", "detected", "recall", "precision", "average precision", "MagErr", "bias", "50 % complete at"],
                  rows + model) + "\n" +
            paragraph("""NET goes deeper, to where the reference itself ends: how many of its additional detections are
        wrong this catalogue cannot tell. MagErr is the mean of 100 |F - F0| / F0 over the matched sources, NET's fainter
        ones among them."""))


def sextractor_table():
    return tables("validation/sextractor/README.md")[0][0]


BLOCKS = {name.replace("_", "-"): function for name, function in (
    ("sdss_frame", sdss_frame), ("sextractor_table", sextractor_table))}


# --- check and write

def differences(path, line, found, wanted):
    """What a reader would see as different: words, with the line of each."""
    words = [(word, line + i) for i, row in enumerate(found.splitlines()) for word in row.split()]
    new = wanted.split()
    if [word for word, _ in words] == new:
        return [f"{path}:{line}: the same words on other lines"]
    out = []
    for kind, a, b, c, d in difflib.SequenceMatcher(None, [word for word, _ in words], new, False).get_opcodes():
        if kind != "equal":
            where = words[min(a, len(words) - 1)][1] if words else line
            out.append(f'{path}:{where}: found "{" ".join(w for w, _ in words[a:b])}", wanted "{" ".join(new[c:d])}"')
    return out


def texts(write):
    wrong, seen = [], set()
    for path in TEXTS:
        text = text_of(path)

        def renew(match, path=path, text=text):
            head, name, found, tail = match.groups()
            if name not in BLOCKS:
                wrong.append(f"{path}:{text.count(chr(10), 0, match.start()) + 1}: there is no block {name}")
                return match[0]
            seen.add(name)
            wanted = BLOCKS[name]()
            if found != wanted:
                wrong.extend(differences(path, text.count("\n", 0, match.start()) + 2, found, wanted))
            return head + wanted + tail

        new = MARK.sub(renew, text)
        left = len(re.findall(r"<!-- numbers:", text)) - len(MARK.findall(text))
        if left:
            wrong.append(f"{path}: {left} block without its end")
        if write and new != text:
            with open(os.path.join(TOP, path), "w", encoding="utf-8") as file:
                file.write(new)
            print(f"{path}: renewed")
    wrong.extend(f"validation/texts.py: no text has the block {name}" for name in sorted(set(BLOCKS) - seen))
    if write:
        return [line for line in wrong if "found" not in line and "other lines" not in line]
    return wrong


def main(arguments):
    if arguments in (["check"], ["write"]):
        wrong = texts(arguments == ["write"])
        print("\n".join(wrong) if wrong else f"{len(BLOCKS)} blocks: fine")
        return 1 if wrong else 0
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
