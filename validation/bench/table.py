"""Rows of the benchmark: from samples to bench.json, bench.md and bench.svg."""
import json
import math
import os
import shutil
import subprocess

from machine import median, quartiles

FIGURE = """set terminal svg size 1000,{height} dynamic font 'sans-serif,12' background 'white'
set output 'bench.svg'
set logscale x
set xrange [{least}:{most}]
set yrange [{bottom}:0.5]
set ytics ({names}) font ',11'
set xtics font ',11'
set grid xtics
set lmargin at screen {left:.3f}
set xlabel 'measured / target'
set style fill solid 0.8 noborder
set arrow from 1, graph 0 to 1, graph 1 nohead lw 2 lc rgb '#444444'
plot 'figure.dat' using (1):($1):(($2 < 1) ? $2 : 1):(($2 < 1) ? 1 : $2):($1 - 0.35):($1 + 0.35):\\
    (($2 < 1) ? 0xd08040 : 0x4080b0) with boxxyerror lc rgb variable notitle,\\
  '' using 2:($1):3:4 with xerrorbars pt 7 ps 0.4 lc rgb '#222222' notitle
"""


class Row:
    """One number that is judged, or only told.

    ratios: one of each repeat, larger is better; compared by compare.py unless `compared` is False (what depends on
    the machine's speed). target: the least ratio, None where there is none. shape: how it is shown, "times",
    "percent", or "inverse" (1/ratio: how many times as long, or as much). ours, other: samples of what the
    ratio is made of, in `unit`.
    """

    def __init__(self, key, what, ratios, target=None, shape="times", ours=(), other=(), unit="s", compared=True,
                 note=""):
        self.key, self.what, self.ratios, self.target, self.shape = key, what, list(ratios), target, shape
        self.ours, self.other, self.unit, self.compared, self.note = list(ours), list(other), unit, compared, note
        self.group = ""

    def held(self):
        if self.target is None:
            return None
        return median(self.ratios) >= self.target

    def show(self, ratio):
        value = 1 / ratio if self.shape == "inverse" else ratio
        if self.shape == "percent":
            return f"{100 * value:.0f} %"
        return f"{value:.1f}" if value >= 10 else f"{value:.2f}"

    def measured(self):
        low, middle, high = quartiles(self.ratios)
        if self.shape == "inverse":
            low, high = high, low
        spread = f" ({self.show(low)} to {self.show(high)})" if len(self.ratios) > 1 else ""
        return self.show(middle) + spread

    def wanted(self):
        if self.target is None:
            return ""
        return ("at most " if self.shape == "inverse" else "at least ") + self.show(self.target)

    def verdict(self):
        if self.target is None:
            return ""
        if self.held():
            return "held"
        return "not held" if quartiles(self.ratios)[2] < self.target else "not held, within the spread"

    def record(self):
        low, middle, high = quartiles(self.ratios)
        record = {"key": self.key, "group": self.group, "what": self.what, "ratio": [low, middle, high],
                  "repeats": len(self.ratios), "target": self.target, "held": self.held(), "shape": self.shape,
                  "compared": self.compared, "unit": self.unit}
        for name in ("ours", "other"):
            if getattr(self, name):
                record[name] = list(quartiles(getattr(self, name)))
        if self.note:
            record["note"] = self.note
        return record


def number(value):
    """Four digits: more would only make two runs look more different than they are."""
    if isinstance(value, float):
        return float(f"{value:.4g}")
    if isinstance(value, list):
        return [number(one) for one in value]
    return value


def write_json(name, head, rows):
    """A line per row, so that a diff can be read."""
    with open(name, "w", encoding="utf-8") as file:
        file.write("{\n")
        for key, value in head.items():
            if isinstance(value, dict):
                value = {k: number(v) for k, v in value.items()}
            file.write(f" {json.dumps(key)}: {json.dumps(value)},\n")
        lines = [json.dumps({k: number(v) for k, v in row.record().items()}) for row in rows]
        file.write(' "rows": [\n  ' + ",\n  ".join(lines) + "\n ]\n}\n")


def amount(samples, unit):
    if not samples:
        return ""
    value = median(samples)
    digits = f"{value:.3f}" if value < 1 else f"{value:.2f}" if value < 100 else f"{value:.0f}"
    return f"{digits} {unit}"


def group_table(rows):
    yield "| | ours | other or limit | ratio (quartiles) | target | |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for row in rows:
        note = f" ({row.note})" if row.note else ""
        yield (f"| {row.what}{note} | {amount(row.ours, row.unit)} | {amount(row.other, row.unit)} | {row.measured()} "
               f"| {row.wanted()} | {row.verdict()} |")


def write_markdown(name, head, rows, extras, groups):
    """groups: titles in their order; extras: {group: [lines]} that stand below its table."""
    judged = [row for row in rows if row.target is not None]
    lines = [f"# Speed: {head['size']} run", "",
             f"{head['processor']}, {head['cores']} core(s) used, medians of the repeats. "
             f"{sum(row.held() for row in judged)} of {len(judged)} targets held.", "",
             "![Measured over target](bench.svg)", ""]
    for title, list_of in (("Not there", head["missing"]), ("Left out", head["skipped"])):
        if list_of:
            lines += [f"{title}: " + "; ".join(list_of) + ".", ""]
    for group in groups:
        own = [row for row in rows if row.group == group]
        if own or extras.get(group):
            lines += [f"## {group}", ""]
        if own:
            lines += list(group_table(own)) + [""]
        if extras.get(group):
            lines += extras[group] + [""]
    with open(name, "w", encoding="utf-8") as file:
        file.write("\n".join(lines).rstrip("\n") + "\n")


def draw(folder, rows):
    """Bars of measured over target, one a row that has one. Returns what is wrong, None when drawn."""
    judged = [row for row in rows if row.target is not None]
    if not judged:
        return "no row has a target"
    if shutil.which("gnuplot") is None:
        return "gnuplot is missing"
    scaled = [[ratio / row.target for ratio in quartiles(row.ratios)] for row in judged]
    with open(os.path.join(folder, "figure.dat"), "w", encoding="ascii") as file:
        for i, (low, middle, high) in enumerate(scaled):
            file.write(f"{-i} {middle:.5g} {low:.5g} {high:.5g}\n")
    names = ", ".join(f'"{row.what}" {-i}'.replace("_", " ") for i, row in enumerate(judged))
    left = min(0.6, 0.0062 * max(len(row.what) for row in judged))  # gnuplot itself leaves too much room
    script = FIGURE.format(left=left, height=90 + 17 * len(judged), names=names, bottom=0.5 - len(judged),
                           least=10 ** math.floor(math.log10(min(one[0] for one in scaled))),
                           most=10 ** math.ceil(math.log10(max(2, max(one[2] for one in scaled)))))
    done = subprocess.run(["gnuplot"], input=script, text=True, cwd=folder, capture_output=True, check=False)
    os.remove(os.path.join(folder, "figure.dat"))
    return done.stderr.strip().splitlines()[-1] if done.returncode else None
