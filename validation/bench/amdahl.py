#!/usr/bin/env python3
"""What a second core can do for each step: CPU seconds outside parallel regions.

usage: amdahl.py FOLDER [SIDE [REPEATS]]    FOLDER/amdahl.json; a simulated crowded tile of SIDE (4096) pixels, the least of REPEATS (3)

It is CPU time, not wall time: other programs do no harm to shares. What it does not see: waiting for files and memory, work that
threads do twice, uneven shares, criticals. So efficiencies that follow are upper limits. RX_BUILD_DIR is the build. Needs a C compiler.
"""
import json
import os
import re
import subprocess
import sys

TOP = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
BUILD = os.path.abspath(os.environ.get("RX_BUILD_DIR", os.path.join(TOP, "build")))
GIVEN = ("MOFFAT", "-PSF_FWHM", "4")
KINDS = {"NONE": ("NONE", False, GIVEN), "RL": ("RL", False, GIVEN), "RL, its PSF measured": ("RL", False, ("AUTO",)), "NET": ("NET", False, GIVEN),
         "NONE with templates": ("NONE", True, GIVEN)}
COLUMNS = "NUMBER X_IMAGE Y_IMAGE FLUX_AUTO FLUXERR_AUTO MAG_AUTO A_IMAGE B_IMAGE THETA_IMAGE FLAGS FLUX_RADIUS".split()


def steps_of(text):
    """{step: seconds} of the log's lines, and of the whole run."""
    steps = {}
    for part in re.findall(r"\]: (?:\w+: )?CPU seconds: (.+)", text):
        for name, seconds in (pair.rsplit(" ", 1) for pair in part.split(", ")):
            steps[name] = steps.get(name, 0) + float(seconds)
    return steps


def command(folder, threads, restorer, templates, psf):
    """The program on the tile, which tells the seconds of its steps."""
    with open(os.path.join(folder, "c.param"), "w", encoding="utf-8") as file:
        file.write("\n".join(COLUMNS + (["FLUX_TEMPLATE"] if templates else [])) + "\n")
    return [os.path.join(BUILD, "rextract"), "tile.fits", "-RESTORE_TYPE", restorer, "-PSF_TYPE", *psf, "-NET_MODEL",
            os.path.join(TOP, "config/psfnet.fits"), "-PARAMETERS_NAME", "c.param", "-CATALOG_TYPE", "FITS_1.0", "-CATALOG_NAME",
            "ours.cat", "-NTHREADS", str(threads), "-VERBOSE_TYPE", "FULL"]


def simulate(folder, side):
    """The tile."""
    subprocess.run([os.path.join(BUILD, "rextract-simulate"), "-IMAGE_SIZE", str(side), "-SEED", "1", "-PSF_FWHM", "4", "-STAR_COUNT", "700",
                    "-GALAXY_COUNT", "700", "-STAR_MAG", "16.5,22.5", "-GALAXY_MAG", "16.5,22.5", "-STAR_SLOPE", "0.1", "-GALAXY_SLOPE",
                    "0.1", "-MAG_ZEROPOINT", "22.5", "-SKY_LEVEL", "0.87", "-NOISE_TYPE", "CCD", "-GAIN", "987", "-READ_NOISE", "9",
                    "-IMAGE_NAME", "tile.fits", "-VERBOSE_TYPE", "QUIET"], cwd=folder, check=True)


def measure(folder, library, *kind):
    """{step: (serial, all)}"""
    texts = [subprocess.run(command(folder, 2, *kind), cwd=folder, check=True, capture_output=True, text=True, env=os.environ | {"LD_PRELOAD": library} | more).stderr
             for more in ({}, {"RX_SERIAL_WHOLE": "1"})]
    serial, both = steps_of(texts[0]), steps_of(texts[1])
    whole = [float(one) for one in re.search(r"CPU seconds: serial ([0-9.]+), all ([0-9.]+)", texts[0]).groups()]
    steps = {name: (min(serial[name], both[name]), both[name]) for name in both}
    steps["start-up and outputs"] = (whole[0] - sum(serial.values()), whole[0] - sum(serial.values()))
    return steps


def main(folder, side="4096", repeats="3"):
    folder = os.path.abspath(folder)
    os.makedirs(folder, exist_ok=True)
    library = os.path.join(folder, "serial.so")
    subprocess.run([os.environ.get("CC", "cc"), "-O2", "-shared", "-fPIC", "-o", library,
                    os.path.join(TOP, "validation/bench/serial.c"), "-ldl"], check=True)
    simulate(folder, side)
    kinds = {}
    for name, kind in KINDS.items():
        runs = [measure(folder, library, *kind) for _ in range(int(repeats))]
        kinds[name] = {step: [round(min(run[step][k] for run in runs), 4) for k in (0, 1)] for step in runs[0]}
        print(name, kinds[name], flush=True)
    with open(os.path.join(folder, "amdahl.json"), "w", encoding="utf-8") as file:
        json.dump({"side": int(side), "kinds": kinds}, file, indent=1)
        file.write("\n")


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4:
        sys.exit("usage: amdahl.py FOLDER [SIDE [REPEATS]]")
    main(*sys.argv[1:])
