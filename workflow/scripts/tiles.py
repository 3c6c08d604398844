"""The list of tiles, read as rextract reads it (config/tiles.h)."""
import functools
import json
import math
import os
import re
import subprocess
import urllib.parse


class Tile:
    """One line of the list; `id` is its name, fit for a file name."""

    def __init__(self, line, name):
        self.line, self.name, self.id = line, name, urllib.parse.quote(name, safe="+ ,=@").replace(" ", "%20")


def words(line):
    """Apart by blanks, "quotes" keep them, '#' at the start of a word ends the line."""
    found, at = [], 0
    while True:
        while at < len(line) and line[at] in " \t\r\n\v\f":
            at += 1
        if at == len(line) or line[at] == "#":
            return found
        word, quoted = "", False
        while at < len(line) and (quoted or line[at] not in " \t\r\n\v\f"):
            if line[at] == '"':
                quoted = not quoted
            else:
                word += line[at]
            at += 1
        if quoted:
            raise ValueError("a quote is not closed")
        found.append(word)


def stem(image):
    """What {tile} stands for: the file's name without folder, [brackets] and endings."""
    name, depth = "", 0
    for letter in image:  # the detection image
        depth += (letter == "[") - (letter == "]")
        if letter == "," and depth <= 0:
            break
        name += letter
    if name.endswith("]"):
        name = name[: name.index("[")]
    name = os.path.basename(name)
    for pattern in (r"(?i)(?<=.)\.(fz|gz|bz2|z)$", r"(?i)(?<=.)\.(fits|fit|fts)$"):
        name = re.sub(pattern, "", name)
    return name


def read(path):
    """{id: Tile}; the whole list is wrong when a line is."""
    tiles = {}
    with open(path, encoding="utf-8", errors="surrogateescape") as file:
        for number, line in enumerate(file, 1):
            try:
                each = words(line)
            except ValueError as error:
                raise SystemExit(f"{path}:{number}: {error}")
            if not each:
                continue
            tile = Tile(line.rstrip("\n"), stem(each[0]))
            if tile.id in ("", ".", "..") or tile.id in tiles:
                raise SystemExit(f"{path}:{number}: '{tile.name}' names no tile of its own; name files differently")
            tiles[tile.id] = tile
    if not tiles:
        raise SystemExit(f"{path}: lists no tile; give an image per line")
    return tiles


def arguments(tile, settings, options, threads):
    """What rextract is called with for a tile."""
    image, *own = words(tile.line)
    return [image, "-c", settings, "-CATALOG_NAME", "catalogs/{tile}.cat", "-QA_NAME", "reports/{tile}", "-NTHREADS",
            str(threads), *options, *own, "-RECORD_NAME", "records/{tile}.record"]


WORKFLOW_MB = 300  # of the workflow's own process in a job, beside rextract
PATIENCE = 5  # times the CPU seconds that rextract reckons with, for slower machines
LEAST_MINUTES = 10


@functools.lru_cache(maxsize=None)
def plan(tile, program, settings, options, threads, density, otherwise):
    """(MB, minutes) that a tile takes by rextract -PLAN Y; of one that cannot be planned `otherwise` and an hour."""
    command = [program, "-PLAN", "Y", *arguments(tile, settings, options, threads), "-PLAN_DENSITY", str(density)]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                              check=True)
        found = json.loads(done.stdout)["all"]
    except (OSError, subprocess.CalledProcessError, ValueError, KeyError):
        return otherwise, 60
    return (math.ceil(found["memory_bytes"] / 1e6) + WORKFLOW_MB,
            max(LEAST_MINUTES, math.ceil(PATIENCE * found["cpu_seconds"] / threads / 60)))
