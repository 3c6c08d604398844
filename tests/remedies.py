"""remedies.py SRC TABLE FOLDER: each remedy that a message names is carried out, and must act.

The texts are the strings of SRC that say what to do: 'give ...', another imperative, or 'KEYWORD VALUE lets ...'. TABLE has the
cases, each of lines that begin with

    $  the command that brings the message about (sh, in a folder of its own below FOLDER, where the inputs are)
    >  the remedy as it must be found in what that command says, a regular expression
    +  what a user makes of it, in an empty folder, \\1 being the first group of what was said and '...' the command of $; the
       message must then be gone and the exit code 0. Several lines are several remedies.
    =  instead of 0, the exit code after the remedies of this case
    ?  what must hold after each remedy, a command

and the texts without a case, each under the reason:

    !  a reason
    -  the beginning of a text

A text is covered when the line that > matches is one of its lines, with anything for what is formatted. The test fails for a
text that has neither case nor reason, and for a reason whose text has a case or is gone."""

import math
import os
import random
import re
import shutil
import struct
import subprocess
import sys

TOKEN = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\'|\s+|\w+|#[ \t]*include[^\n]*|.', re.S)
VERBS = "add|choose|copy|keep|leave|let|lower|mark|multiply|name|pick|put|raise|replace|say|see|set|state|subtract|take|use|write"
REMEDY = re.compile(
    rf"(?:(?:^|[;:(,] ?)(?:give|see)|[;:(,?] (?:If so, )?(?:{VERBS})|; (?:a [a-z]+er )?(?:%s|[A-Z][A-Z_]+[A-Z])(?: \S+)? (?:lets|leaves|takes|may)|with VERBOSE_TYPE|has no effect without) \S"
)
FORMAT = re.compile(r"%[-+ #0]*(?:\*|\d+)?(?:\.(?:\*|\d+)?)?(?:hh|h|ll|l|z|j|t|L)?[a-zA-Z]")


def strings(path):
    """String literals of a file, neighbouring ones joined, with their lines."""
    line, start, text = 1, 0, None
    for token in TOKEN.findall(open(path, encoding="utf-8").read()):
        if token[0] == '"':
            if text is None:
                start, text = line, ""
            text += token[1:-1]
        elif text is not None and re.match(r"PRI\w+$", token):
            text += "d"  # the conversion of a fixed width
        elif not (token.isspace() or token.startswith(("/*", "//"))):
            if text is not None:
                yield start, text
            text = None
        line += token.count("\n")


def pattern(text):
    """What a line of that text looks like."""
    text = text.replace('\\"', '"').replace("\\n", "").replace("%%", "\0")
    return re.compile(".*".join(re.escape(part.replace("\0", "%")) for part in FORMAT.split(text)))


def texts(source):
    """What names a remedy, and where; not in it are scripts of gnuplot ("set ..."), usages, and prose of pages."""
    found = {}
    for folder, _, names in sorted(os.walk(source)):
        for name in sorted(names):
            if name.endswith((".c", ".h")):
                path = os.path.join(folder, name)
                for line, text in strings(path):
                    if REMEDY.search(text) and not text.startswith(("set ", "\\n")) and "<b>" not in text:
                        found.setdefault(text, f"{os.path.relpath(path, source)}:{line}")
    return found


def table(path):
    cases, reasons, reason = [], [], None
    for number, line in enumerate(open(path, encoding="utf-8"), 1):
        mark, rest = line[:2].strip(), line[2:].rstrip("\n")
        if mark == "$":
            cases.append({"line": number, "$": rest, "+": [], "=": 0, "?": None})
        elif mark in (">", "=", "?"):
            cases[-1][mark] = int(rest) if mark == "=" else rest
        elif mark == "+":
            cases[-1]["+"].append(rest)
        elif mark == "!":
            reason = rest
        elif mark == "-":
            reasons.append((rest, reason, number))
    return cases, reasons


def shell(command, folder):
    done = subprocess.run(["sh", "-c", command], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120)
    return done.returncode, done.stdout.decode("utf-8", "replace")


def indent(text):
    return "".join(f"\n    | {line}" for line in text.splitlines()[-12:])


def run(command, scratch):
    """Exit code and what is said, in lines as they were before they were folded, of a command in an empty folder."""
    folder = os.path.join(scratch, "case")
    shutil.rmtree(folder, ignore_errors=True)
    os.mkdir(folder)
    code, said = shell(command, folder)
    return code, re.sub(r"\nrextract[a-z-]*:     (?=\S)", " ", said)


def try_case(case, patterns, scratch):
    """What is wrong with a case, or None; and the texts it covers."""
    command = case["$"]
    _, said = run(command, scratch)
    lines = [(line, re.search(case[">"], line)) for line in said.splitlines()]
    lines = [(line, match) for line, match in lines if match]
    covered = {text for text, form in patterns.items() if any(form.search(line) for line, _ in lines)}
    if not covered:
        return f"does not say '{case['>']}' by a text of the sources: {command}{indent(said)}", covered
    for remedy in case["+"]:
        then = re.sub(r"\\([1-9])", lambda group: lines[0][1].group(int(group[1])) or "", remedy).replace("...", command)
        code, after = run(then, scratch)
        where = f"{then}, after: {lines[0][0]}"
        for text in covered:
            if any(patterns[text].search(line) for line in after.splitlines()):
                return f"the message stays: {where}{indent(after)}", covered
        if code != case["="]:
            return f"exit code {code}: {where}{indent(after)}", covered
        if case["?"] and shell(case["?"], os.path.join(scratch, "case"))[0] != 0:
            return f"not so: {case['?']}: {where}{indent(after)}", covered
    return None, covered


def fits(*hdus):
    """A FITS file of images and tables, each ({card: value}, bytes of its data)."""
    text = b""
    for cards, data in hdus:
        lines = [f"{key:8}= " + (f"'{value:8}'" if isinstance(value, str) and value != "T" else str(value).rjust(20)) for key, value in cards.items()]
        text += "".join(f"{line:80}" for line in lines + ["END"]).encode().ljust(-(-80 * (len(lines) + 1) // 2880) * 2880)
        text += data.ljust(-(-len(data) // 2880) * 2880, b"\0")
    return text


def image(pixels, *axes, **more):
    cards = {"SIMPLE": "T", "BITPIX": -32, "NAXIS": len(axes)} | {f"NAXIS{i + 1}": n for i, n in enumerate(axes)} | more
    return cards, struct.pack(f">{len(pixels)}f", *pixels)


def positions(rows):
    cards = {"XTENSION": "BINTABLE", "BITPIX": 8, "NAXIS": 2, "NAXIS1": 8, "NAXIS2": len(rows), "PCOUNT": 0, "GCOUNT": 1, "TFIELDS": 2}
    cards |= {"TTYPE1": "x", "TFORM1": "E", "TTYPE2": "y", "TFORM2": "E"}
    return cards, b"".join(struct.pack(">2f", *row) for row in rows)


def make_inputs(folder):
    """Tiles that something is wrong with, all made of sky.fits (200 x 200 pixels, sky 1000, noise 5), and PSFs."""

    def write(name, *hdus):
        with open(os.path.join(folder, name), "wb") as file:
            file.write(fits(*hdus))

    with open(os.path.join(folder, "sky.fits"), "rb") as file:
        content = file.read()
    start = 2880 * (re.search(rb"END {77}", content).start() // 2880 + 1)
    side = 200
    sky = struct.unpack(f">{side * side}f", content[start : start + 4 * side * side])
    tile = {"MAGZERO": 25, "GAIN": 5}
    write("deep.fits", image([-3000 if i % 1777 == 0 else p for i, p in enumerate(sky)], side, side, **tile))
    write("deep_w.fits", image([0 if i % 1777 == 0 else 1 for i in range(side * side)], side, side))
    write("plateau.fits", image([min(p, 1400) for p in sky], side, side, **tile))
    flags = struct.pack(f">{side * side}q", *[2**40 if i == 5 else 0 for i in range(side * side)])
    write("flags.fits", ({"SIMPLE": "T", "BITPIX": 64, "NAXIS": 2, "NAXIS1": side, "NAXIS2": side}, flags))
    flags = struct.pack(f">{side * side}i", *[1] * side * side)
    write("flags32.fits", ({"SIMPLE": "T", "BITPIX": 32, "NAXIS": 2, "NAXIS1": side, "NAXIS2": side}, flags))
    write("single.fits", image([100 + (i * 7919 % 61 if i % 17 == 0 else 0) for i in range(side * side)], side, side, GAIN=1))
    write("rms.fits", image([1] * side * side, side, side))
    write("soft.fits", image([1000 + 400 * (1 - math.exp((1000 - p) / 400)) if p > 1000 else p for p in sky], side, side, **tile))
    faint = struct.pack(f">{side * side}d", *[1e-42 * (p - 900) for p in sky])
    write("faint.fits", ({"SIMPLE": "T", "BITPIX": -64, "NAXIS": 2, "NAXIS1": side, "NAXIS2": side}, faint))
    wcs = {"CTYPE1": "RA---TAN", "CTYPE2": "DEC--TAN", "CRVAL1": 150.0, "CRVAL2": 2.2, "CRPIX1": 100.0, "CRPIX2": 100.0}
    wcs |= {"CDELT1": -0.00011, "CDELT2": 0.00011}
    cards, data = image(sky, side, side, PCOUNT=0, GCOUNT=1, **tile, **wcs)
    extension = {"XTENSION": "IMAGE"} | {key: value for key, value in cards.items() if key != "SIMPLE"}
    half = extension | {"EXTNAME": "VARIANCE", "NAXIS2": side // 2}
    good = extension | {"EXTNAME": "MASK", "BITPIX": 32}
    write("half.fits", ({"SIMPLE": "T", "BITPIX": 8, "NAXIS": 0}, b""), (extension | {"EXTNAME": "IMAGE"}, data), (good, bytes(len(data))),
          (half, data[: len(data) // 2]))
    draw = random.Random(1)
    noise = [1000 + draw.gauss(0, 5) for _ in sky]

    def objects(*placed):  # of (x, y, FWHM, peak)
        pixels = list(noise)
        for x, y, fwhm, peak in placed:
            for v in range(y - 15, y + 16):
                for u in range(x - 15, x + 16):
                    pixels[v * side + u] += peak * math.exp(-2.7726 * ((u - x) ** 2 + (v - y) ** 2) / fwhm**2)
        return image(pixels, side, side, **tile)

    write("smooth.fits", objects((50, 50, 4, 3000)))
    write("unlike.fits", objects((50, 50, 3, 500), (150, 150, 5, 500)))
    grid = [(20 + 30 * (k % 6), 20 + 30 * (k // 6), 5 if k % 3 == 0 else 3, 1000 + 100 * k) for k in range(36)]
    write("sizes.fits", objects(*grid))
    for name, fwhm in ("wide.list", 5), ("stars.list", 3):
        with open(os.path.join(folder, name), "w") as file:
            file.write("# 1 X_IMAGE\n# 2 Y_IMAGE\n" + "".join(f"{x + 1} {y + 1}\n" for x, y, width, _ in grid if width == fwhm))
    gauss = [math.exp(-2.7726 * ((i % 15 - 7) ** 2 + (i // 15 - 7) ** 2) / 9) for i in range(225)]
    cube = image(gauss + gauss, 15, 15, 2)
    write("psfs.fits", cube)
    write("psfs_one.fits", cube, positions([(10, 10)]))
    write("psfs_nan.fits", cube, positions([(10, 10), (float("nan"), 20)]))
    write("psfs_two.fits", cube, positions([(10, 10), (150, 150)]))
    hollow = [p - (1 if abs(i % 15 - 7) < 2 and abs(i // 15 - 7) < 2 else 0) for i, p in enumerate(gauss)]
    write("hollow.fits", image(hollow, 15, 15))


def main(source, table_name, scratch):
    make_inputs(scratch)
    known = texts(source)
    patterns = {text: pattern(text) for text in known}
    cases, reasons = table(table_name)
    only = os.environ.get("RX_TEST_ONLY")
    wrong, covered, passed = [], set(), 0
    for case in cases:
        if only and not re.search(only, case["$"] + case[">"]):
            continue
        start = os.times()
        complaint, found = try_case(case, patterns, scratch)
        covered |= found
        if os.environ.get("RX_TEST_SLOW"):
            end = os.times()
            print(f"{end[2] + end[3] - start[2] - start[3]:.2f}", case["line"], case["$"])
        passed += complaint is None
        if complaint:
            wrong.append(f"line {case['line']}: {complaint}")
    excused = set()
    for start, reason, line in reasons:
        matching = {text for text in known if text.startswith(start)}
        excused |= matching
        if not matching:
            wrong.append(f"line {line}: no text begins so: {start}")
        elif matching & covered and not only:
            wrong.append(f"line {line}: it has a case: {start}")
    if not only:
        for text in sorted(known.keys() - covered - excused, key=known.get):
            wrong.append(f"{known[text]}: neither a case nor a reason: {text}")
    for complaint in wrong:
        print("FAILED:", complaint)
    print(f"{len(known)} texts name a remedy: {len(covered)} were followed by {passed} cases, {len(excused)} have a reason")
    print(f"{passed} passed, {len(wrong)} failed, 0 skipped")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
