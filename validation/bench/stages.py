"""What is measured: a part per group of the table. Ours and the others take turns within each repeat."""
import os
import re
import shutil

from machine import Failed, available_memory, found, free_disk, restored, tell_steps
from table import Row

COLUMNS = """NUMBER X_IMAGE Y_IMAGE FLUX_AUTO FLUXERR_AUTO MAG_AUTO FLUX_APER(1) A_IMAGE B_IMAGE THETA_IMAGE FLAGS
ELONGATION FLUX_RADIUS""".split()
TEMPLATE_COLUMNS = ["FLUX_TEMPLATE", "FLUXERR_TEMPLATE", "FLAGS_RESTORE"]
DENSITY = {"sparse": (50, 50), "crowded": (700, 700), "stars": (8000, 0)}  # stars and galaxies per Mpixel (1e6 pixels)
GAIN, NOISE = 987, 0.031  # electrons per ADU; ADU, of the sky
FWHM = 4
SIGMA = FWHM / 2.3548
NAME = {512: "0.5k", 1024: "1k", 2048: "2k", 4096: "4k", 8192: "8k", 16384: "16k"}
MODELS = {"NET": "psfnet.fits"}
# Per size of the benchmark: sides of the comparison with others and of the growth, repeats, side of the whole stage.
SIZES = {"quick": ((1024, 4096), (1024, 4096), 3, 2048),
         "full": ((1024, 4096, 8192), (1024, 4096, 8192, 16384), 5, 4096)}
# Cosmic Clarity v1 and Tikhonet on one core, the faster of the two, as measured once: CPU seconds per Mpixel.
LEARNED_PEERS = 22.0
# Iterations of accelerated Richardson-Lucy: the default, and what is best at FWHM 7.
ACCELERATED = (18, 75)
PLANES_AT_MOST = 13  # of a tile, in memory, before a size is left out


def label(threads):
    return "1 core" if threads == 1 else f"{threads} cores"


def mpixels(side):
    return 1e-6 * side * side


class Bench:
    """The state of a run: samples, rows, what could not be done."""

    def __init__(self, box, size, layers, repeats, largest):
        self.box, self.layers = box, layers
        sides, growth_sides, self.repeats, self.stage_side = SIZES[size]
        self.sides, self.growth_sides = ([side for side in all_sides if side <= largest] for all_sides in (sides, growth_sides))
        if repeats:
            self.repeats = repeats
        self.rows, self.extras, self.missing, self.skipped, self.limits = [], {}, [], [], {}
        self.group, self.macs, self.simulated = "", {}, []

    # --- what is there ---

    def prepare(self):
        """Configuration for all, and which peers there are."""
        box = self.box
        peer = shutil.which("source-extractor") or shutil.which("sex")
        self.sextractor = peer
        source = [peer, "-d"] if peer else [os.path.join(box.build, "rextract"), "-d"]
        self.write("plain.sex", box.run(source, 1).text)
        self.write("plain.param", "\n".join(COLUMNS) + "\n")
        self.write("template.param", "\n".join(COLUMNS + TEMPLATE_COLUMNS) + "\n")
        shutil.copy(os.path.join(box.top, "config/default.conv"), box.work)
        for name, file in MODELS.items():
            info = box.run([os.path.join(box.build, "rextract-train"), "-INFO", box.model(file)], 1)
            self.macs[name] = 1e3 * sum(map(float, re.findall(r"([0-9.]+) thousand multiplications per pixel", info.text)))  # of all stages
        self.siril = shutil.which("siril-cli")
        self.python = {name: self.has_module(name) for name in ("skimage", "sep", "photutils", "astropy")}
        self.iraf = shutil.which("irafcl")
        for name, there in (("source-extractor", peer), ("siril", self.siril), ("iraf", self.iraf),
                            *((f"python3-{name}", there) for name, there in self.python.items())):
            if not there:
                self.missing.append(name)
                box.say(f"bench: {name} is not there and takes no part")
        load = os.getloadavg()[0]
        if load > 0.5:
            box.say(f"bench: something else is running (load {load:.1f}); ratios will be less sure")

    def has_module(self, name):
        try:
            self.box.run(["/usr/bin/python3", "-c", f"import {name}, numpy, astropy, scipy"], 1)
        except Failed:
            return False
        return True

    def write(self, name, text):
        with open(os.path.join(self.box.work, name), "w", encoding="utf-8") as file:
            file.write(text)

    def begin(self, group):
        self.group = group

    def skip(self, text):
        self.skipped.append(text)
        self.box.say(f"bench: left out: {text}")

    def add(self, *arguments, **words):
        row = Row(*arguments, **words)
        row.group = self.group
        self.rows.append(row)

    def tell(self, *lines):
        self.extras.setdefault(self.group, []).extend(lines)

    # --- tiles and turns ---

    def tile(self, side, kind):
        """The name of a simulated tile, made when it is not there; its truth beside it."""
        name = f"{kind}-{NAME[side]}.fits"
        if os.path.exists(os.path.join(self.box.work, name)):
            return name
        stars, galaxies = map(str, DENSITY[kind])
        run = self.box.run([os.path.join(self.box.build, "rextract-simulate"), "-IMAGE_SIZE", str(side), "-SEED", "1",
                            "-PSF_FWHM", str(FWHM), "-STAR_COUNT", stars, "-GALAXY_COUNT", galaxies,
                            "-STAR_MAG", "16.5,22.5", "-GALAXY_MAG", "16.5,22.5", "-STAR_SLOPE", "0.1", "-GALAXY_SLOPE", "0.1",
                            "-MAG_ZEROPOINT", "22.5", "-SKY_LEVEL", "0.87", "-NOISE_TYPE", "CCD", "-GAIN", str(GAIN),
                            "-READ_NOISE", "9", "-IMAGE_NAME", name, "-TRUTH_NAME", "truth-" + name, "-NTHREADS",
                            str(self.box.most), "-VERBOSE_TYPE", "QUIET"], self.box.most)
        self.simulated.append((side, kind, run))
        return name

    def drop(self, side, kind):
        for name in (f"{kind}-{NAME[side]}.fits", f"truth-{kind}-{NAME[side]}.fits"):
            path = os.path.join(self.box.work, name)
            if os.path.exists(path):
                os.remove(path)

    def turns(self, repeats, jobs):
        """jobs: {name: function giving a number, or a tuple}. {name: [one of each repeat]}; who fails is left out."""
        samples = {name: [] for name in jobs}
        for _ in range(repeats):
            for name in list(samples):
                try:
                    samples[name].append(jobs[name]())
                except Failed as error:
                    self.skip(f"{name}: {error}")
                    del samples[name]
        return samples

    # --- the others ---

    def peer(self, *words, threads=1):
        script = os.path.join(self.box.top, "validation/bench/peer.py")
        run = self.box.run(["/usr/bin/python3", "-B", script, *words], threads)
        return run.need(r"seconds ([0-9.]+)")[0]

    def sextractor_seconds(self, tile):
        """On one core, as it has no other way."""
        return self.box.run([self.sextractor, tile, "-c", "plain.sex", "-PARAMETERS_NAME", "plain.param",
                             "-CATALOG_TYPE", "FITS_1.0", "-CATALOG_NAME", "other.cat", "-VERBOSE_TYPE", "QUIET"],
                            1).wall

    def siril_seconds(self, tile, iterations, threads):
        """Of its rl alone: a script with it, less one without it."""
        version = self.box.run([self.siril, "--version"], 1).need(r"siril (\d+)\.(\d+)")
        old = version < [1, 1]
        command = f"rl {SIGMA:.3f} 0 {iterations}"
        if not old:
            command = f"makepsf manual -gaussian -fwhm={FWHM}\nrl -iters={iterations}"
        seconds = []
        for name, body in (("with.ssf", command + "\n"), ("without.ssf", "")):
            self.write(name, f"requires 1.0.0\nload {tile}\n{body}")
            run = self.box.run([self.siril, "-s", name], threads)
            if "finished successfully" not in run.text:
                raise Failed("its script did not finish")
            seconds.append(run.wall)
        return seconds[0] - seconds[1]

    def ratio(self, samples, other, ours):
        """other / ours, repeat by repeat; None where one took no part."""
        if not samples.get(other) or not samples.get(ours):
            return None
        return [a / b for a, b in zip(samples[other], samples[ours])]

    def versus(self, key, what, samples, other, ours, target=None, **words):
        """A row: other / ours, unless one of them took no part."""
        ratios = self.ratio(samples, other, ours)
        if ratios:
            self.add(key, what, ratios, target, ours=samples[ours], other=samples[other], **words)


# --- limits ---

def limits(bench):
    tile = bench.tile(4096, "sparse")
    run = bench.box.run([os.path.join(bench.box.build, "validation/bench/limits"), "-values", "all", tile],
                        bench.box.most)
    bench.limits = {line.split()[0]: float(line.split()[1]) for line in run.text.splitlines()}
    known = bench.limits
    bench.tell("| | 1 core | all |", "| --- | --- | --- |")
    for what, key, form in (("3 x 3 convolutions, f32 (GFLOP/s)", "conv_f32_{}", ".0f"),
                            ("3 x 3 convolutions, bf16 (GFLOP/s)", "conv_bf16_{}", ".0f"),
                            ("real transform of 1024 x 1024 (ms)", "fft_1024_{}_ms", ".2f"),
                            ("of 1152 x 1152 (ms)", "fft_1152_{}_ms", ".2f"),
                            ("of 4096 x 4096 (ms)", "fft_4096_{}_ms", ".1f"),
                            ("of 4096 x 4096 (GFLOP/s)", "fft_4096_{}_gflops", ".1f"),
                            ("memory, copy (GB/s)", "memory_copy_{}", ".1f"),
                            ("memory, triad (GB/s)", "memory_triad_{}", ".1f")):
        values = [known.get(key.format(n)) for n in (1, bench.box.most)]
        bench.tell(f"| {what} | " + " | ".join("" if v is None else format(v, form) for v in values) + " |")
    bench.tell(f"| reading a file that is in memory (GB/s) | {known['read']:.2f} | |")


# --- restoration ---

def network_jobs(bench, tile, log):
    """Jobs of both networks in each precision and on each number of cores, and, in turn with them, of the
    convolutions' peak: what was reached once in the run is the limit."""
    def net(name, precision, threads):
        run = bench.box.restore(tile, "NET", threads, "-NET_PRECISION", precision, "-NET_MODEL",
                                bench.box.model(MODELS[name]))
        log[name, precision, threads] = run
        part = run.find(r"NET: network ([0-9.]+) s")
        return restored(run, "NET"), part[0] if part else None

    def peak(precision, threads):
        key = f"conv_{precision.lower()}_{threads}"
        shape = [str(int(bench.limits[f"{key}_{name}"])) for name in ("channels", "side")]
        now = bench.box.limit("conv", precision, str(threads), *shape, threads=threads)[key]
        bench.limits[key] = max(bench.limits[key], now)
        return now

    jobs = {}
    for threads in bench.box.threads:
        for precision in ("F32", "BF16"):
            if f"conv_{precision.lower()}_{threads}" in bench.limits:
                for name in MODELS:
                    jobs[f"{name} {precision} {threads}"] = lambda n=name, p=precision, t=threads: net(n, p, t)
                jobs[f"peak {precision} {threads}"] = lambda p=precision, t=threads: peak(p, t)
    return jobs


def key_of(name):
    return name.lower().replace(" ", "-")


def network_rows(bench, samples, side, log):
    for name in MODELS:
        for precision in ("F32", "BF16"):
            for threads in bench.box.threads:
                both = samples.get(f"{name} {precision} {threads}")
                if both:
                    share_rows(bench, both, side, name, precision, threads)
    for (name, precision, threads), run in log.items():
        lines = re.findall(r"NET: (layer .*)", run.text)
        if bench.layers and lines:
            bench.tell(f"Layers of {name}, {precision.lower()}, {label(threads)}:", "", "```", *lines, "```", "")


def share_rows(bench, both, side, name, precision, threads):
    """both: seconds of all its steps and of the network alone, one pair of each repeat."""
    key, end = key_of(name), f"{precision}-{threads}"
    what = f"{precision.lower()}, {label(threads)}"
    least = 2e-9 * bench.macs[name] * side * side / bench.limits[f"conv_{precision.lower()}_{threads}"]
    parts, whole = [part for _, part in both if part], [one for one, _ in both]
    if parts:
        bench.add(f"{key}-conv-{end}", f"{name}'s network alone, {what}, of the convolution peak",
                  [least / one for one in parts], 0.8, "percent", ours=parts, other=[least])
        bench.add(f"{key}-around-{end}", f"{name}, all its steps over the network alone, {what}",
                  [part / one for one, part in both if part], 1 / 1.35, "inverse", ours=whole, other=parts)
    else:
        bench.skip(f"the network's own share of {name}, {what}: the log does not tell it")
    bench.add(f"{key}-whole-{end}", f"{name}, all its steps, {what}, of the convolution peak",
              [least / one for one in whole], None, "percent", ours=whole, other=[least])


def restoration(bench):
    """On a tile of 1 Mpixel; the work of the restorers does not depend on what is in it."""
    box, side = bench.box, 1024
    tile, log = bench.tile(side, "crowded"), {}

    def rl(iterations, threads, accelerate="N"):
        return restored(box.restore(tile, "RL", threads, "-RL_ACCELERATE", accelerate, "-RL_NITER", str(iterations)), "RL")

    def transforms(threads):
        values = box.limit("rl", str(side), str(side), str(FWHM), str(threads), threads=threads)
        name = f"rl_{side}x{side}_{threads}"
        return 4e-3 * values[name + "_ms"], 1e-3 * values[name + "_blur_ms"]

    def skimage(workers, threads):
        return bench.peer("skimage", tile, "30", str(FWHM), workers, threads=threads)

    jobs = network_jobs(bench, tile, log)
    for threads in box.threads:
        for iterations in (20, 30, 50, 100):
            jobs[f"RL {iterations} {threads}"] = lambda i=iterations, t=threads: rl(i, t)
        for iterations in ACCELERATED:
            jobs[f"accelerated {iterations} {threads}"] = lambda i=iterations, t=threads: rl(i, t, "Y")
        jobs[f"FFT {threads}"] = lambda t=threads: transforms(t)
        if bench.python["skimage"]:
            jobs[f"skimage {threads}"] = lambda t=threads: skimage("1", t)
            if threads > 1:
                jobs[f"skimage workers {threads}"] = lambda t=threads: skimage(str(t), t)
        if bench.siril:
            jobs[f"siril {threads}"] = lambda t=threads: bench.siril_seconds(tile, 30, t)
    samples = bench.turns(bench.repeats, jobs)
    network_rows(bench, samples, side, log)
    net_against_others(bench, samples)
    bench.begin(PARTS["rl"][0])
    rl_rows(bench, samples)


def net_against_others(bench, samples):
    for name in MODELS:
        key = key_of(name)
        for threads in bench.box.threads:
            ours = samples.get(f"{name} F32 {threads}")
            if not ours:
                continue
            samples[name] = [one for one, _ in ours]
            for iterations in (20, 30, 50, 100):
                bench.versus(f"{key}-rl{iterations}-{threads}",
                             f"{name} against our RL of {iterations} iterations, {label(threads)}", samples,
                             f"RL {iterations} {threads}", name, 5)
            for iterations in ACCELERATED:
                bench.versus(f"{key}-accelerated{iterations}-{threads}",
                             f"{name} against our accelerated RL of {iterations} iterations, {label(threads)}", samples,
                             f"accelerated {iterations} {threads}", name)
            bench.versus(f"{key}-skimage-{threads}",
                         f"{name} against scikit-image's RL of 30 iterations, {label(threads)}", samples,
                         f"skimage {threads}", name, 10)
            if threads == 1:
                samples[name + " one"] = samples[name]
                bench.add(f"{key}-learned",
                          f"{name} against learned restorers (22 CPU seconds: quoted, not measured), 1 core",
                          [LEARNED_PEERS / one for one in samples[name]], 100, ours=samples[name],
                          other=[LEARNED_PEERS], compared=False)
            else:
                bench.versus(f"{key}-scaling", f"{name} on {threads} cores against 1", samples, name + " one", name,
                             1.8)


def rl_rows(bench, samples):
    """Beside its transforms in two ways: those of the whole padded tile, and, what the restorer really does, a blur and
    its adjoint in blocks that fit the cache."""
    for threads in bench.box.threads:
        parts = [samples.get(f"{name} {threads}") for name in ("RL 20", "RL 100", "FFT")]
        if all(parts):
            each = [(b - a) / 80 for a, b in zip(parts[0], parts[1])]
            for at, key, what in ((0, "fft", "four transforms of the whole tile"),
                                  (1, "blur", "the transforms it makes, in blocks")):
                least = min(one[at] for one in parts[2])
                bench.add(f"rl-{key}-{threads}", f"RL, an iteration over {what}, {label(threads)}",
                          [least / one for one in each], 1 / 1.3, "inverse", ours=[1e3 * one for one in each],
                          other=[1e3 * least], unit="ms")
        ours, target = f"RL 30 {threads}", 3 if threads == 1 else 5
        bench.versus(f"rl-skimage-{threads}", f"RL against scikit-image's, 30 iterations, {label(threads)}", samples,
                     f"skimage {threads}", ours, target)
        bench.versus(f"rl-skimage-workers-{threads}",
                     f"the same, scikit-image's transforms told to use {threads} threads", samples,
                     f"skimage workers {threads}", ours, target)
        bench.versus(f"rl-siril-{threads}", f"RL against siril's, 30 iterations, {label(threads)}", samples,
                     f"siril {threads}", ours, note="Gaussian PSF only")


# --- detection and photometry ---

def extraction(bench):
    for side in bench.sides:
        for kind in ("sparse", "crowded"):
            extraction_of(bench, side, kind)
            if side == 8192:
                bench.drop(side, kind)


def extraction_of(bench, side, kind):
    box, tile = bench.box, bench.tile(side, kind)
    jobs = {}
    for threads in box.threads:
        jobs[f"ours {threads}"] = lambda t=threads: box.rextract(tile, "NONE", t, "-CATALOG_TYPE", "FITS_1.0").wall
    if bench.sextractor:
        jobs["source-extractor"] = lambda: bench.sextractor_seconds(tile)
    if bench.python["sep"]:
        jobs["sep"] = lambda: bench.peer("sep", tile, "other.fits", "default.conv")
    if bench.python["photutils"] and side == 1024:  # its deblending takes minutes on larger ones
        jobs["photutils"] = lambda: bench.peer("photutils", tile, "other.fits", "default.conv")
    # Hundredths of a second are less sure; minutes are more so, and many.
    repeats = {1024: max(bench.repeats, 5), 8192: min(bench.repeats, 3)}.get(side, bench.repeats)
    samples = bench.turns(repeats, jobs)
    for threads in box.threads:
        name = f"{NAME[side]} {kind}, {label(threads)}"
        key = f"{NAME[side]}-{kind}-{threads}"
        bench.versus("none-sex-" + key, f"against source-extractor, {name}", samples, "source-extractor",
                     f"ours {threads}", 2 if threads == 1 else 3.2)
        bench.versus("none-sep-" + key, f"against python sep, {name}", samples, "sep", f"ours {threads}")
        bench.versus("none-photutils-" + key, f"against photutils, {name}", samples, "photutils", f"ours {threads}")


# --- the PSF of a tile ---

PSFEX_SIDE = 35  # pixels of psfex's stamps, some 9 FWHM


def psf_of(bench):
    """PSF_TYPE AUTO, which finds its stars itself, against source-extractor (for stars only, from 5 sigma on) and psfex."""
    if not (bench.sextractor and shutil.which("psfex")):
        bench.skip("the PSF of a tile: source-extractor or psfex is not there")
        return
    box, side = bench.box, bench.stage_side
    bench.write("psf.param", f"VIGNET({PSFEX_SIDE},{PSFEX_SIDE})\nX_IMAGE\nY_IMAGE\nFLUX_RADIUS\nSNR_WIN\nFLUX_APER(1)\nFLUXERR_APER(1)\n"
                "ELONGATION\nFLAGS\n")

    def ours(tile, threads):
        run = box.rextract(tile, "RL", threads, "-PSF_TYPE", "AUTO", "-RL_NITER", "1", "-CATALOG_TYPE", "NONE", "-VERBOSE_TYPE", "FULL")
        return run.need(r"\]: seconds: .*PSF ([0-9.]+)")[0]

    def psfex(tile, threads):
        first = box.run([bench.sextractor, tile, "-c", "plain.sex", "-PARAMETERS_NAME", "psf.param", "-CATALOG_TYPE", "FITS_LDAC",
                         "-CATALOG_NAME", "stars.cat", "-DETECT_THRESH", "5", "-PHOT_APERTURES", str(5 * FWHM), "-VERBOSE_TYPE", "QUIET"], 1)
        second = box.run(["psfex", "stars.cat", "-PSF_SIZE", f"{PSFEX_SIDE},{PSFEX_SIDE}", "-SAMPLE_FWHMRANGE", "1,20", "-CHECKPLOT_TYPE",
                          "NONE", "-CHECKIMAGE_TYPE", "NONE", "-WRITE_XML", "N", "-VERBOSE_TYPE", "QUIET", "-NTHREADS", str(threads)], threads)
        return first.wall + second.wall

    for kind in ("sparse", "crowded"):
        tile = bench.tile(side, kind)
        for threads in box.threads:
            samples = bench.turns(min(bench.repeats, 3), {"ours": lambda t=threads: ours(tile, t), "psfex": lambda t=threads: psfex(tile, t)})
            bench.versus(f"psf-psfex-{kind}-{threads}", f"against source-extractor and psfex, {NAME[side]} {kind}, {label(threads)}", samples,
                         "psfex", "ours", 1)


# --- the whole stage ---

def whole_stage(bench):
    side = bench.stage_side
    box, tile = bench.box, bench.tile(side, "crowded")
    logs, least = {}, {}

    def stage(kinds, threads):
        run = box.rextract(tile, kinds, threads, "-CATALOG_TYPE", "FITS_1.0", "-REFERENCE_NAME", "truth-" + tile,
                           "-QA_NAME", "report", "-VERBOSE_TYPE", "FULL")
        steps = tell_steps(run)
        if steps and run.wall < least.get((kinds, threads), run.wall + 1):
            steps["all"] = {"else (catalogues, report)": run.wall - sum(sum(one.values()) for one in steps.values())}
            logs[kinds, threads], least[kinds, threads] = steps, run.wall
        return run.wall

    jobs = {f"all {threads}": lambda t=threads: stage("NONE,RL,NET", t) for threads in box.threads}
    for kind in ("NONE", "RL", "NET"):
        jobs[kind] = lambda k=kind: stage(k, box.most)
    samples = bench.turns((bench.repeats + 1) // 2, jobs)
    if box.most > 1:
        bench.versus("stage-scaling", f"NONE, RL, NET and report, {NAME[side]}: {box.most} cores against 1", samples,
                     "all 1", f"all {box.most}", 1.8)
    if all(samples.get(kind) for kind in ("NONE", "RL", "NET")):
        samples["sum"] = [sum(three) for three in zip(samples["NONE"], samples["RL"], samples["NET"])]
        bench.versus("stage-shared", f"the same in one run against three, {label(box.most)}", samples, "sum",
                     f"all {box.most}")
    step_table(bench, logs)


def step_table(bench, logs):
    """Where the time of the fastest run goes, and what a second core does to each step."""
    steps = {threads: logs.get(("NONE,RL,NET", threads)) for threads in bench.box.threads}
    if not all(steps.values()):
        bench.skip("seconds of each step: the log does not tell them")
        return
    head = [f"{label(threads)} [s]" for threads in bench.box.threads]
    bench.tell("| step | " + " | ".join(head) + " | ratio |", "| --- |" + " --- |" * (len(head) + 1))
    for kind, names in steps[1].items():
        for name, seconds in names.items():
            more = [steps[threads].get(kind, {}).get(name, 0) for threads in bench.box.threads]
            if max(more) < 0.001:
                continue
            gain = f"{seconds / more[-1]:.2f}" if more[-1] > 0.001 else ""
            cells = [f"{kind} {name}".strip()] + [f"{one:.3f}" for one in more] + [gain]
            bench.tell("| " + " | ".join(cells) + " |")


# --- templates ---

def templates(bench):
    """Seconds on one core that templates add to a run, for 20,000 sources on 4096 x 4096 pixels: half a second for 1,000."""
    side, allowed = bench.stage_side, 10
    box, tile, threads = bench.box, bench.tile(side, "crowded"), 1
    share = (side / 4096) ** 2

    def run(kind, columns):
        one = box.rextract(tile, kind, threads, "-CATALOG_TYPE", "FITS_1.0", "-SATUR_LEVEL", "1e9", "-VERBOSE_TYPE",
                           "NORMAL", columns=columns)
        return one.wall, one.memory, found(one.text, kind)

    bench.tell("| restorer | found | without templates [s] | with [s] | difference per 1000 sources [s] | "
               "peak memory without, with [MB] |", "| --- | --- | --- | --- | --- | --- |")
    for kind in ("NONE", "NET"):
        jobs = {"plain": lambda k=kind: run(k, "plain.param"), "template": lambda k=kind: run(k, "template.param")}
        if bench.sextractor and kind == "NONE":
            jobs["source-extractor"] = lambda: bench.sextractor_seconds(tile)
        samples = bench.turns(min(bench.repeats, 2), jobs)
        if not samples.get("plain") or not samples.get("template"):
            continue
        plain, full = samples["plain"][0], samples["template"][0]
        added = [b[0] - a[0] for a, b in zip(samples["plain"], samples["template"])]
        scaled = [20000 * share * one / full[2] for one in added]
        bench.add(f"template-seconds-{kind}",
                  f"templates of {20000 * share:.0f} sources on {NAME[side]} ({kind}), 1 core, {allowed * share:g} s allowed",
                  [allowed * share / one for one in scaled], 1, ours=scaled,
                  other=[allowed * share], compared=False)
        if samples.get("source-extractor"):
            samples["added"] = added
            bench.versus("template-sex", f"what they add against a run of source-extractor, {NAME[side]} crowded",
                         samples, "source-extractor", "added")
        bench.tell(f"| {kind} | {full[2]} | {plain[0]:.1f} | {full[0]:.1f} | {1000 * added[0] / full[2]:.2f} | "
                   f"{plain[1] / 1e6:.0f}, {full[1] / 1e6:.0f} |")
    if bench.iraf and bench.python["astropy"]:
        stars = bench.tile(512, "stars")
        samples = bench.turns(min(bench.repeats, 3), {
            "templates": lambda: box.rextract(stars, "NONE", threads, "-CATALOG_TYPE", "FITS_1.0", "-SATUR_LEVEL", "1e9",
                                              columns="template.param").wall,
            "ALLSTAR": lambda: bench.peer("allstar", stars, str(FWHM), str(NOISE), str(GAIN), "iraf")})
        bench.versus("template-allstar", "with templates against IRAF's ALLSTAR, 512 x 512 pixels, 8000 stars per Mpixel, 1 core",
                     samples, "ALLSTAR", "templates")


# --- growth ---

def fits_in(bench, side):
    """Is there room for a tile of this side, on disk and in memory?"""
    plane = 4 * side * side
    if free_disk(bench.box.work) < 2 * plane + 1e9:
        bench.skip(f"{NAME[side]}: {2 * plane / 1e9:.1f} GB of disk and one to spare are not free")
        return False
    if available_memory() < PLANES_AT_MOST * plane:
        bench.skip(f"{NAME[side]}: {PLANES_AT_MOST * plane / 1e9:.0f} GB of memory are not free")
        return False
    return True


KINDS = {"NONE": ("NONE", "plain.param"), "RL": ("RL", "plain.param"), "NET": ("NET", "plain.param"),
         "NONE with templates": ("NONE", "template.param")}


def growth(bench):
    """Memory and seconds of the whole program by the size of the tile, equally dense."""
    box, seconds, memory = bench.box, {}, {}

    def run(tile, kind):
        one = box.rextract(tile, KINDS[kind][0], box.most, "-CATALOG_TYPE", "FITS_1.0", "-SATUR_LEVEL", "1e9",
                           columns=KINDS[kind][1])
        return one.wall, one.memory

    for side in bench.growth_sides:
        if not fits_in(bench, side):
            continue
        tile = bench.tile(side, "sparse")
        repeats = {1024: bench.repeats, 4096: max(bench.repeats // 2, 1)}.get(side, 1)
        samples = bench.turns(repeats, {kind: lambda k=kind, f=tile: run(f, k) for kind in KINDS})
        for kind, values in samples.items():
            seconds[kind, side] = [one[0] / mpixels(side) for one in values]
            memory[kind, side] = [one[1] for one in values]
        if side > 4096:
            bench.drop(side, "sparse")
    for kind in KINDS:
        for side in bench.growth_sides:
            if (kind, side) in memory:
                allowed = 12 * side * side + 1e9
                bench.add(f"memory-{kind}-{NAME[side]}".replace(" ", "-"),
                          f"peak memory, {kind}, {NAME[side]}, over what is allowed",
                          [allowed / one for one in memory[kind, side]], 1, "inverse",
                          ours=[one / 1e6 for one in memory[kind, side]], other=[allowed / 1e6], unit="MB")
    for kind in KINDS:
        sides = [side for side in bench.growth_sides if (kind, side) in seconds]
        if len(sides) > 1:
            each = [min(seconds[kind, side]) for side in sides]
            text = ", ".join(f"{NAME[side]} {one:.3f}" for side, one in zip(sides, each))
            bench.add(f"growth-{kind}".replace(" ", "-"),
                      f"most over least seconds per Mpixel, {kind}, {NAME[sides[0]]} to {NAME[sides[-1]]}",
                      [min(each) / max(each)], 1 / 1.15, "inverse", ours=[max(each)], other=[min(each)], compared=False,
                      note=text)


# --- simulator and trainer ---

EPOCHS, BIN_IMAGES, PATCH = 8, 24, 128
COSTS = r"steps: ([0-9.]+) s for (\d+) images; making images: ([0-9.]+) s for (\d+) images"


def train(bench):
    """A short training: seconds of a step and of making an image, per image; multiplications per pixel."""
    box = bench.box
    for name in ("net.fits", "net.checkpoint"):
        path = os.path.join(box.work, name)
        if os.path.exists(path):
            os.remove(path)
    shutil.rmtree(os.path.join(box.work, "net"), ignore_errors=True)
    run = box.run([os.path.join(box.build, "rextract-train"), os.path.join(box.top, "validation/training/psfnet-ideal.train"),
                   "-EPOCHS", str(EPOCHS), "-GRID", "2,2", "-BIN_IMAGES", str(BIN_IMAGES), "-PATCH", str(PATCH),
                   "-MODEL_NAME", "net.fits", "-CHECKPOINT_NAME", "net.checkpoint", "-OUTPUT_NAME", "net",
                   "-NTHREADS", "1", "-QA_FIGURES", "N", "-VERBOSE_TYPE", "FULL"], 2)
    lines = [[float(n) for n in line] for line in re.findall(COSTS, run.text)]
    if len(lines) < 2:
        raise Failed("the log does not tell what steps and images cost")
    step, learnt, making, made = lines[-1]
    return step / learnt, making / made, 1e3 * run.need(r"([0-9.]+) kMAC per pixel")[0]


def training(bench):
    for side, kind, run in bench.simulated:
        if side == 4096:
            bench.tell(f"Simulator, {NAME[side]} {kind}, {label(bench.box.most)}: {mpixels(side) / run.wall:.1f} "
                       "Mpixel/s.", "")
    samples = bench.turns(2 if bench.repeats <= 3 else 3, {"training": lambda: train(bench)}).get("training")
    if not samples:
        return
    steps, images = [one[0] for one in samples], [one[1] for one in samples]
    bench.add("generator", "making an image against a step on it, each on 1 core",
              [a / b for a, b in zip(steps, images)], 1,
              ours=[1e3 * one for one in images], other=[1e3 * one for one in steps], unit="ms")
    if "conv_f32_1" in bench.limits:
        least = [6 * one[2] * PATCH * PATCH / (1e9 * bench.limits["conv_f32_1"]) for one in samples]
        bench.add("training-conv", "a training step, of the convolution peak, 1 core",
                  [a / b for a, b in zip(least, steps)], 0.6, "percent", ours=[1e3 * one for one in steps],
                  other=[1e3 * one for one in least], unit="ms",
                  note="backward counted as twice forward; losses, transforms and Adam included")


# Name of a part: title of its rows, and what measures it. RL is measured along with the network.
PARTS = {"limits": ("Limits of this machine", limits), "restoration": ("Restoration by the network", restoration),
         "rl": ("Richardson-Lucy", lambda bench: None),
         "extraction": ("Detection and photometry, nothing restored", extraction),
         "psf": ("The PSF of a tile", psf_of), "stage": ("The whole stage", whole_stage), "templates": ("Template photometry", templates),
         "growth": ("Memory and growth", growth), "training": ("Simulator and training", training)}
