#!/usr/bin/python3
"""Does rextract -PLAN Y hold? Runs of all kinds, the peak memory of each beside its plan.

    validation/bench/plan.py [small|full] [CASE...]
    validation/bench/plan.py measure RUNS.json [small|full] [CASE...]   the same, and each run into a file
    validation/bench/plan.py fit RUNS.json [MARGIN]                     the table of src/stage/plan.c anew, from such a file

small: tiles of 128, 256 and 700 pixels, some seconds; full: up to 4096 pixels and 16 threads, ordinary and crowded tiles,
up to half an hour on two cores. CASE: only those whose line has one of these words.

A line per run: peak resident memory, the plan at the default PLAN_DENSITY (at what was found, where that is more) and at 1000
sources per Mpixel, each over what was measured; size of all outputs over the plan. Exit status 1 when memory or outputs were above
the plan. fit (numpy, scipy) makes the least table that is above every
run by MARGIN (1.1); run it on what `measure` of full gave on a quiet machine, then `full` again. RX_BUILD_DIR is the build (default: build/). Needs nothing else but Python and
the build; fpack (Debian: libcfitsio-bin) for a compressed tile.
"""
import gzip
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile

TOP = os.path.realpath(os.path.join(os.path.dirname(__file__), "..", ".."))
BUILD = os.path.realpath(os.environ.get("RX_BUILD_DIR", os.path.join(TOP, "build")))
CHECKS = ["RESTORED", "RESIDUAL", "SUPPORT", "FILTERED", "SEGMENTATION", "BACKGROUND", "MINIBACKGROUND"]
KINDS = {
    "NONE": ["NONE"],
    "RL": ["RL"],
    "RL Moffat": ["RL", "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", "3"],
    "RL wide PSF": ["RL", "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", "15", "-PSF_SIZE", "101"],
    "RL_BLIND": ["RL_BLIND"],
    "NET": ["NET"],
    "NET seams": ["NET", "-VERIFY_SEAMS", "Y"],
    "NET or RL": ["NET", "-OUT_OF_DOMAIN", "RL"],
    "all four": ["NONE,RL,RL_BLIND,NET"],
    "NONE templates": ["NONE", "TEMPLATES"],
    "RL templates": ["RL", "TEMPLATES", "-TEMPLATE_COVAR_NAME", "covariances.fits"],
    "NET templates": ["NET", "TEMPLATES"],
    "NONE,RL report": ["NONE,RL", "REPORT"],
    "all four, templates, report": ["NONE,RL,RL_BLIND,NET", "TEMPLATES", "REPORT"],
    "NONE self check": ["NONE", "-SELF_CHECK", "Y", "-SELF_CHECK_DENSITY", "1000", "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", "3"],
    "RL self check": ["RL", "-SELF_CHECK", "Y", "-SELF_CHECK_COUNT", "200", "-SELF_CHECK_DENSITY", "1000", "-SELF_CHECK_NAME", "check"],
    "NET self check": ["NET", "-SELF_CHECK", "Y", "-SELF_CHECK_COUNT", "200", "-SELF_CHECK_DENSITY", "1000"],
    "RL template self check": ["RL", "TEMPLATES", "-PRECISION_TARGET", "0.9", "-SELF_CHECK", "Y", "-SELF_CHECK_COUNT", "20"],
    "NONE blank check": ["NONE", "-BLANK_CHECK", "1"],
    "RL blank check": ["RL", "-BLANK_CHECK", "1"],
    "NET blank check": ["NET", "-BLANK_CHECK", "1"],
    "NET without guard": ["NET", "-BLANK_CHECK", "0"],
    "NONE weights": ["NONE", "WEIGHTS", "MAP_RMS"],
    "RL weights": ["RL", "WEIGHTS", "MAP_WEIGHT"],
    "NET weights": ["NET", "WEIGHTS", "MAP_VAR"],
    "NONE flags": ["NONE", "FLAGS"],
    "RL check-images": ["RL", "IMAGES"],
    "NONE check-images": ["NONE", "IMAGES"],
    "NONE two images": ["NONE", "DUAL"],
    "RL two images": ["RL", "DUAL"],
    "NET two images": ["NET", "DUAL"],
    "RL templates two images": ["RL", "TEMPLATES", "DUAL"],
    "RL small meshes": ["RL", "-BACK_SIZE", "8"],
    "RL vignets": ["RL", "VIGNETS"],
    "RL original": ["RL", "-MEASURE_ON", "ORIGINAL"],
    "RL ASCII": ["RL", "-CATALOG_TYPE", "ASCII_HEAD"],
    "RL VOTable": ["RL", "-CATALOG_TYPE", "ASCII_VOTABLE"],
    "RL LDAC": ["RL", "-CATALOG_TYPE", "FITS_LDAC"],
}
# memory is then no measure; not read here, where it would count as memory of what we start
SANITIZED = subprocess.run(["grep", "-qa", "__asan_init", os.path.join(BUILD, "rextract")], check=False).returncode == 0
FORMS = ("integer", "gzip", "rice", "three images", "own maps")  # of an ordinary tile, by NONE and RL


def call(words, **more):
    return subprocess.run(words, stdin=subprocess.DEVNULL, check=False, **more)


class Measured:
    """A run: peak memory in bytes, sources found, bytes of all outputs."""

    def __init__(self, words, log):
        before = set(os.listdir("."))
        with open(log, "w+", encoding="utf-8", errors="replace") as file:
            process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=file)
            _, status, usage = os.wait4(process.pid, 0)
            file.seek(0)
            self.text = file.read()
        process.returncode = self.status = os.waitstatus_to_exitcode(status)
        self.memory = 1024 * usage.ru_maxrss
        found = [int(n) for n in re.findall(r": (\d+) sources", self.text)]
        self.found = max(found, default=0)
        made = set(os.listdir(".")) - before - {log}
        self.size = sum(size_of(name) for name in made)
        for name in made:
            shutil.rmtree(name) if os.path.isdir(name) else os.remove(name)


def size_of(name):
    if not os.path.isdir(name):
        return os.path.getsize(name)
    return sum(os.path.getsize(os.path.join(path, file)) for path, _, files in os.walk(name) for file in files)


# --- tiles ---


def apart(function, *words):
    """In a process of its own: what is large in ours would count as the peak of what we start (getrusage(2))."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            function(*words)
            code = 0
        finally:
            os._exit(code)
    if os.waitpid(child, 0)[1] != 0:
        raise SystemExit("plan.py: a tile cannot be made")


def simulate(kind, side):
    """Ordinary: like the deep sky; crowded: 30,000 stars per Mpixel; nebulous: as many galaxies, one over the other."""
    name = f"{kind}{side}"
    if os.path.exists(name + ".fits"):
        return name
    sky = {"o": ["-STAR_COUNT", "700", "-GALAXY_COUNT", "700", "-NOISE_SIGMA", "2"],
           "c": ["-STAR_COUNT", "30000", "-GALAXY_COUNT", "0", "-PSF_FWHM", "2", "-STAR_MAG", "14,20", "-NOISE_SIGMA", "3"],
           "n": ["-STAR_COUNT", "0", "-GALAXY_COUNT", "30000", "-PSF_FWHM", "3"]}[kind]
    if call([os.path.join(BUILD, "rextract-simulate"), "-IMAGE_SIZE", str(side), *sky, "-IMAGE_NAME", name + ".fits",
             "-TRUTH_NAME", name + ".truth", "-VERBOSE_TYPE", "QUIET"]).returncode != 0:
        raise SystemExit("plan.py: rextract-simulate failed")
    return name


def header_and_pixels(name):
    with open(name, "rb") as file:
        data = file.read()
    end = 0
    while data[end:end + 8] != b"END     ":
        end += 80
    cards = [data[i:i + 80] for i in range(0, end, 80)]
    return cards, data[(end // 2880 + 1) * 2880:]


def write_hdu(file, cards, pixels):
    head = b"".join(cards) + b"END".ljust(80)
    file.write(head + b" " * (-len(head) % 2880) + pixels + b"\0" * (-len(pixels) % 2880))


def card(key, value):
    return f"{key:8}= {value:>20}".ljust(80).encode()


def convert(form, name, other):
    """The same tile stored in another way, into `other`."""
    cards, data = header_and_pixels(name + ".fits")
    side = int(re.sub(r"\D", "", name))
    data = data[:4 * side * side]
    bare = [one for one in cards if not one.startswith((b"CHECKSUM", b"DATASUM"))]
    if form == "gzip":
        with open(name + ".fits", "rb") as source, gzip.open(other, "wb", 1) as file:
            shutil.copyfileobj(source, file)
        return
    with open(other, "wb") as file:
        if form in ("integer", "flags"):
            values = struct.unpack(f">{side * side}f", data)
            pixels = struct.pack(f">{side * side}h", *(min(32000, int(value)) for value in values))
            write_hdu(file, [card("BITPIX", 16) if one.startswith(b"BITPIX") else one for one in bare], pixels)
        elif form == "weights":
            write_hdu(file, bare, struct.pack(">f", 10) * (side * side))
        else:
            write_hdu(file, [card("SIMPLE", "T"), card("BITPIX", 8), card("NAXIS", 0), card("EXTEND", "T")], b"")
            kept = [one for one in bare if not one.startswith((b"SIMPLE", b"EXTEND"))]
            planes = [("", -32, data)] * 3
            if form == "own maps":
                planes = [("IMAGE", -32, data), ("MASK", 32, b"\0" * len(data)), ("VARIANCE", -32, struct.pack(">f", 4) * (side * side))]
            for plane, bitpix, pixels in planes:
                write_hdu(file, [b"XTENSION= 'IMAGE   '".ljust(80), card("BITPIX", bitpix), *kept[1:4], card("PCOUNT", 0),
                                 card("GCOUNT", 1), card("EXTNAME", f"'{plane:8}'"), *kept[4:]], pixels)


def in_form(form, name):
    """Name of the tile stored in another way; None without the program it takes."""
    other = f"{name}-{form.replace(' ', '-')}.fits" + {"gzip": ".gz", "rice": ".fz"}.get(form, "")
    if os.path.exists(other):
        return other
    if form != "rice":
        apart(convert, form, name, other)
        return other
    if shutil.which("fpack") and call(["fpack", "-O", other, name + ".fits"]).returncode == 0:
        return other
    return None


# --- runs ---


def arguments(name, words):
    """Of a kind, on that tile: image and keywords."""
    image, more = name + ".fits", ["-RESTORE_TYPE", words[0]]
    for word in words[1:]:
        if word == "TEMPLATES":
            more += ["-PARAMETERS_NAME", os.path.join(TOP, "config", "template.param")]
        elif word == "REPORT":
            more += ["-REFERENCE_NAME", name + ".truth", "-QA_NAME", "report"]
        elif word == "WEIGHTS":
            more += ["-WEIGHT_IMAGE", in_form("weights", name), "-WEIGHT_TYPE"]
        elif word == "FLAGS":
            more += ["-FLAG_IMAGE", in_form("flags", name), "-PARAMETERS_NAME", "flags.param"]
        elif word == "IMAGES":
            more += ["-CHECKIMAGE_TYPE", ",".join(CHECKS), "-CHECKIMAGE_NAME", ",".join(f"image{i}.fits" for i in range(7))]
        elif word == "VIGNETS":
            more += ["-PARAMETERS_NAME", "vignets.param"]
        elif word == "DUAL":
            image += "," + image
        else:
            more.append(word)
    return image, more


def plan_of(words, density=None):
    more = [] if density is None else ["-PLAN_DENSITY", str(density)]
    done = call([*words, "-PLAN", "Y", *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode != 0:
        raise SystemExit(f"plan.py: no plan: {done.stderr.decode('utf-8', 'replace')}")
    return json.loads(done.stdout)["tiles"][0]


def hold(title, name, image, more, threads, runs):
    """One run beside its plan, appended to `runs`; 1 where it is above it."""
    words = [os.path.join(BUILD, "rextract"), image, "-NET_MODEL", os.path.join(TOP, "config", "psfnet.fits"),
             "-NTHREADS", str(threads), "-CATALOG_NAME", "out.cat", "-VERBOSE_TYPE", "FULL"]  # all lines, unfolded
    words += ([] if "-CATALOG_TYPE" in more else ["-CATALOG_TYPE", "FITS_1.0"]) + more
    plan, usual = plan_of(words), plan_of(words, 1000)
    run = Measured(words, "log")
    if run.status != 0:
        print(f"{name:6} {threads:2} {title:28} ended with {run.status}: {run.text.strip().splitlines()[-1]}")
        return 1
    if title in KINDS and plan["images"] == 1:
        runs.append({"title": title, "pixels": plan["pixels"], "width": math.isqrt(plan["pixels"]), "sources": run.found,
                     "threads": threads, "memory": run.memory})
    if run.found > plan["sources"]:
        plan = plan_of(words, 1e6 * run.found / (plan["pixels"] / plan["images"]))
    outputs = run.size / plan["output_bytes"]
    above = outputs > 1 or (run.memory > plan["memory_bytes"] and not SANITIZED)
    print(f"{name:6} {threads:2} {title:28} {run.memory / 1e6:8.1f} MB {plan['memory_bytes'] / 1e6:8.1f} "
          f"{plan['memory_bytes'] / run.memory:6.2f} {usual['memory_bytes'] / 1e6:8.1f} "
          f"{usual['memory_bytes'] / run.memory:6.2f} "
          f"{run.found:6d} {outputs:6.3f}{'  ABOVE THE PLAN' if above else ''}", flush=True)
    return int(above)


def matrix(size):
    """(kind of sky, side, threads, kinds, forms) of all runs."""
    everything = list(KINDS)
    some = ["NONE", "RL", "RL_BLIND", "NET", "NET templates", "RL self check"]
    if size == "small":
        return [("o", 128, 2, ["NONE", "RL", "NET", "RL check-images", "NONE two images", "RL VOTable"], ["gzip", "own maps"]),
                ("c", 256, 1, ["NONE", "NET", "NONE templates", "NONE,RL report", "RL self check"], ["three images"]),
                ("o", 700, 1, ["NONE self check"], ())]
    return [("o", 128, 1, everything, FORMS), ("c", 128, 16, everything, ()), ("o", 1024, 1, everything, FORMS),
            ("c", 512, 1, everything, ()), ("c", 1024, 2, everything, ()), ("n", 1024, 1, some, ()),
            ("o", 2048, 2, everything, FORMS), ("o", 2048, 16, some, ()), ("c", 2048, 1, some[:4], ()),
            ("o", 4096, 1, some, ())]


# --- fitting the table ---

PIXELS, SOURCES, BLOCK = 1 << 20, 1 << 14, 2048  # where slopes change, as in src/stage/plan.c; the default NET_BLOCK
COLUMNS = ["fixed", "pixel", "large", "source", "many", "thread"]
ONLY = {"NET_BLOCK": ["fixed"], "REPORT": ["fixed", "source", "many"], "WEIGHT": ["fixed", "pixel", "large"],
        "FLAG_MAP": ["fixed", "pixel", "large"], "CHECKIMAGE": ["fixed", "pixel", "large"],
        "SECOND": ["fixed", "pixel", "large", "thread"]}  # what else there is to a row does not depend on it


def rows_of(title, width, threads):
    """How often each row of the table in src/stage/plan.c counts, for each restorer."""
    words = KINDS[title]
    kinds, on = words[0].split(","), set(words[1:])
    checked, dual = "-SELF_CHECK" in on or title.endswith(" blank check"), "DUAL" in on
    ways = []
    for kind in kinds:
        row = {kind: 1, "TILE": 1 + dual, "FURTHER": len(kinds) - 1}
        if kind == "NET":
            row["NET_BLOCK"] = threads * min(width, BLOCK) / BLOCK
            row["NET_AGAIN"] = int("-VERIFY_SEAMS" in on or "-OUT_OF_DOMAIN" in on)
        row["PSF_AUTO"] = int(kind == "NONE" and ("TEMPLATES" in on or "-SELF_CHECK" in on or len(kinds) > 1))
        row["TEMPLATES"] = int("TEMPLATES" in on)
        row["CHECKIMAGE"] = 4 if "IMAGES" in on else 0
        row["SECOND"], row["CHECK"] = int(dual), int(checked)
        row["CHECK_TEMPLATES"] = int(checked and "TEMPLATES" in on)
        row["REPORT"] = len(kinds) if "REPORT" in on else 0
        row["WEIGHT"], row["FLAG_MAP"] = (1 + dual) * int("WEIGHTS" in on), int("FLAGS" in on)
        ways.append({name: n for name, n in row.items() if n})
    return ways


def terms_of(run, row):
    """Coefficients of the table's entries in the memory of one way."""
    size = {"fixed": 1, "pixel": min(run["pixels"], PIXELS), "large": max(run["pixels"] - PIXELS, 0),
            "source": min(run["sources"], SOURCES), "many": max(run["sources"] - SOURCES, 0), "thread": run["threads"] - 1}
    return {(name, column): n * size[column] for name, n in row.items() for column in COLUMNS}


def fit(runs, margin):
    """The table that is above every run by the margin, and by no more than it must: a linear program. Of several restorers
    the way that takes most is the one that must be above; which that is comes from the round before."""
    import numpy as np
    from scipy.optimize import linprog
    ways = [rows_of(run["title"], run["width"], run["threads"]) for run in runs]
    names = list(dict.fromkeys(name for way in ways for row in way for name in row))
    place = {(name, column): i for i, (name, column) in enumerate((n, c) for n in names for c in COLUMNS)}
    table = np.ones(len(place))
    most = [(0, None if column in ONLY.get(name, COLUMNS) else 0) for name, column in place]
    for _ in range(4):
        lines = []
        for run, way in zip(runs, ways):
            candidates = []
            for row in way:
                line = np.zeros(len(place))
                for entry, n in terms_of(run, row).items():
                    line[place[entry]] = n / run["memory"]
                candidates.append(line)
            lines.append(max(candidates, key=lambda line: float(line @ table)))
        matrix = np.array(lines)
        scale = np.maximum(matrix.max(axis=0), 1e-30)
        done = linprog(matrix.sum(axis=0) / scale, A_ub=-matrix / scale, b_ub=-np.full(len(runs), margin), bounds=most)
        if done.status != 0:
            raise SystemExit(f"plan.py: no table: {done.message}")
        table = done.x / scale
    return names, {entry: table[i] for entry, i in place.items()}, matrix @ table


def fit_command(path, margin=1.1):
    """Writes the rows of src/stage/plan.c anew."""
    with open(path, encoding="utf-8") as file:
        runs = [run for run in json.load(file) if run["title"] in KINDS and run["title"] not in ("RL vignets", "RL small meshes")]
    names, table, ratios = fit(runs, margin)
    ratios.sort()
    print(f"{len(runs)} runs, the table over them: {ratios[0]:.2f} to {ratios[-1]:.2f}, median {ratios[len(ratios) // 2]:.2f}, "
          f"a tenth above {ratios[9 * len(ratios) // 10]:.2f}", file=sys.stderr)
    target = os.path.join(TOP, "src", "stage", "plan.c")
    with open(target, encoding="utf-8") as file:
        lines = file.read().splitlines()
    for i, line in enumerate(lines):
        row = re.match(r"( +\{)(?:[^,]*,){6}( *[^ ].*/\* (\w+).*)", line)
        if row and row[3] in names:
            new = [f"{table[row[3], 'fixed'] / 1e6 + 0.005:.2f}e6"]
            new += [f"{max(1.001 * table[row[3], column], 0):.4g}" for column in COLUMNS[1:5]]
            new += [f"{max(table[row[3], 'thread'], 0) / 1e6:.2f}e6"]
            lines[i] = row[1] + " ".join(f"{cell + ',':8}" for cell in new) + row[2]
    with open(target, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


def main():
    words = sys.argv[1:]
    if words[:1] == ["fit"]:
        fit_command(words[1], float(words[2]) if len(words) > 2 else 1.1)
        return 0
    target = os.path.realpath(words[1]) if words[:1] == ["measure"] else None
    words = words[2:] if target else words
    size = words.pop(0) if words[:1] and words[0] in ("small", "full") else "full"
    above, runs, measured = 0, 0, []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name, line in (("flags", "IMAFLAGS_ISO(1)"), ("vignets", "VIGNET(25,25)")):
            with open(name + ".param", "w", encoding="utf-8") as file:
                file.write(f"NUMBER\nX_IMAGE\nY_IMAGE\nFLUX_AUTO\n{line}\n")
        print("tile  threads kind              measured      plan  ratio  at 1000  ratio  found outputs")
        for sky, side, threads, kinds, forms in matrix(size):
            for title in [*kinds, *forms]:
                label = f"{sky}{side} {threads} {title}"
                if words and not any(word in label for word in words):
                    continue
                name = simulate(sky, side)
                image, more = arguments(name, KINDS.get(title, ["NONE"]))
                if title in forms:
                    image = in_form(title, name)
                if image is not None:
                    above += hold(title, name, image, more, threads, measured)
                    runs += 1
    if target:
        with open(target, "w", encoding="utf-8") as file:
            json.dump(measured, file, indent=0)
    print(f"{runs} runs, {above} above the plan")
    return 1 if above else 0


if __name__ == "__main__":
    sys.exit(main())
