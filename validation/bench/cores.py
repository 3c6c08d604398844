#!/usr/bin/env python3
"""Seconds by the clock on more and more cores, for a machine that has them and does nothing else.

usage: cores.py FOLDER [SIDE [THREADS,...]]    FOLDER/cores.json; the tile of amdahl.py, SIDE (4096) pixels; threads 1,2,4,8

Each kind of run is made on all numbers of threads in turn, up to five times; after 45 seconds no repeat is begun. The least seconds
count. Threads stay on as many cores. Templates, which take longest, get half the SIDE. RX_BUILD_DIR is the build.
"""
import json
import os
import subprocess
import sys
import time

from amdahl import KINDS, command, simulate
from machine import Run, distinct_cores, processor_name, tell_steps

REPEATS, ENOUGH = 5, 45  # seconds of a kind, after which no repeat is begun


def measure(folder, threads, kind):
    """Seconds of the whole run, and of its steps."""
    cores = set(distinct_cores()[:threads])
    begun = time.monotonic()
    text = subprocess.run(command(folder, threads, *kind), cwd=folder, check=True, capture_output=True, text=True,
                          preexec_fn=lambda: os.sched_setaffinity(0, cores)).stderr
    whole = time.monotonic() - begun
    steps = {}
    for named in tell_steps(Run(whole, 0, text)).values():
        for step, seconds in named.items():
            steps[step] = steps.get(step, 0) + seconds
    steps["start-up and outputs"] = whole - sum(steps.values())
    return whole, steps


def main(folder, side="4096", threads="1,2,4,8"):
    folder, numbers = os.path.abspath(folder), [int(one) for one in threads.split(",")]
    if max(numbers) > len(distinct_cores()):
        sys.exit(f"cores.py: this machine has {len(distinct_cores())} cores; give fewer THREADS")
    os.makedirs(folder, exist_ok=True)
    kinds = {}
    for name, kind in KINDS.items():
        pixels = int(side) // (2 if kind[1] else 1)
        simulate(folder, pixels)
        begun, runs = time.monotonic(), {n: [] for n in numbers}
        while len(runs[numbers[0]]) < REPEATS and time.monotonic() - begun < ENOUGH:
            for n in numbers:
                runs[n].append(measure(folder, n, kind))
        kinds[name] = {"side": pixels} | {
            str(n): {"seconds": round(min(whole for whole, _ in of), 4),
                     "steps": {step: round(min(steps[step] for _, steps in of), 4) for step in of[0][1]}, "repeats": len(of)}
            for n, of in runs.items()}
        print(name, {n: kinds[name][str(n)]["seconds"] for n in numbers}, flush=True)
    with open(os.path.join(folder, "cores.json"), "w", encoding="utf-8") as file:
        json.dump({"processor": processor_name(), "cores": len(distinct_cores()), "kinds": kinds}, file, indent=1)
        file.write("\n")


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4:
        sys.exit("usage: cores.py FOLDER [SIDE [THREADS,...]]")
    main(*sys.argv[1:])
