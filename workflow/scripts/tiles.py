"""The list of tiles, read as rextract reads it (config/tiles.h)."""
import itertools
import json
import math
import os
import re
import subprocess
import tempfile
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


def check(config):
    """What the configuration holds is of the kind that it has to be."""
    kinds = {"tiles": str, "rextract": str, "survey": str, "settings": str, "options": list, "survey_options": list,
             "threads": int, "density": (int, float), "memory_mb": int, "minutes": int, "retries": int}
    for key, kind in kinds.items():
        value = config[key]
        if not isinstance(value, kind) or isinstance(value, bool):
            meant = {str: "a name", list: 'a list of words, ["-KEYWORD", "VALUE"]'}.get(kind, "a number")
            raise SystemExit(f"{key}: {value}: give {meant}")
    for key in ("options", "survey_options"):
        config[key] = [str(word) for word in config[key]]


def try_out(tile, config):
    """Keywords that are wrong are found before the first job: a tile is planned with them."""
    command = [config["rextract"], "-PLAN", "Y", *arguments(tile, config["settings"], config["options"], config["threads"]),
               "-VERBOSE_TYPE", "QUIET"]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
    except OSError as error:
        raise SystemExit(f"rextract: {config['rextract']}: {error.strerror}") from None
    if done.returncode == 2:
        raise SystemExit(done.stderr.decode(errors="replace").strip())


def read(path):
    """{id: Tile}; the whole list is wrong when a line is."""
    tiles = {}
    try:
        file = open(path, encoding="utf-8", errors="surrogateescape")
    except OSError as error:
        raise SystemExit(f"tiles: {path}: {error.strerror}; give a list of images, one a line") from None
    with file:
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


def has_report(settings, given):
    """Does the file or the command line ask for a report? rextract warns of a QA_NAME that has no effect."""
    asks = {"REFERENCE_NAME": lambda value: value not in ("", "NONE"), "QA_TYPE": lambda value: value == "TILE"}
    pairs = [(word.lstrip("-"), value) for word, value in zip(given, given[1:])]
    try:
        with open(settings, encoding="utf-8", errors="surrogateescape") as file:
            pairs += [(line + [""])[:2] for line in map(words, file) if line]
    except (OSError, ValueError):
        return True  # rextract says what is wrong with it
    return any(asks[key.upper()](value.upper()) for key, value in pairs if key.upper() in asks)


def common(settings, options, threads, own=()):
    """Keywords of all tiles, as rextract is called with them; own: those of one tile."""
    report = ["-QA_NAME", "reports/{tile}"] if has_report(settings, [*options, *own]) else []
    return ["-c", settings, "-CATALOG_NAME", "catalogs/{tile}.cat", *report, "-NTHREADS", str(threads), *options]


def arguments(tile, settings, options, threads):
    """What rextract is called with for a tile."""
    image, *own = words(tile.line)
    return [image, *common(settings, options, threads, own), *own, "-RECORD_NAME", "records/{tile}.record"]


WORKFLOW_MB = 300  # of the workflow's own process in a job, beside rextract


class Plans:
    """Memory of tiles by rextract -PLAN Y.

    To start rextract takes longer than to plan a tile, so that each call plans twice as many as the one before, the ones
    that follow in the list: a job asks for its own tile alone, and 1e4 tiles take 14 calls."""

    def __init__(self, tiles, program, settings, options, threads, otherwise):
        self.tiles, self.otherwise = tiles, otherwise
        own = [word for tile in tiles.values() for word in words(tile.line)]
        self.command = [program, *common(settings, options, threads, own), "-RECORD_NAME", "records/{tile}.record", "-PLAN", "Y"]
        self.known, self.left, self.size = {}, {}, {}

    def of(self, name, density):
        """MB of a tile; of one that cannot be planned `otherwise`."""
        if (name, density) not in self.known:
            left = self.left.setdefault(density, dict.fromkeys(self.tiles))
            size = self.size.get(density, 1)
            del left[name]
            batch = [name, *itertools.islice(left, size - 1)]
            for each in batch[1:]:
                del left[each]
            self._plan(batch, density)
            self.size[density] = 2 * size
        return self.known[name, density]

    def _plan(self, batch, density):
        with tempfile.NamedTemporaryFile("w", suffix=".list", encoding="utf-8", errors="surrogateescape") as file:
            file.writelines(self.tiles[name].line + "\n" for name in batch)
            file.flush()
            done = subprocess.run([*self.command, "-PLAN_DENSITY", str(density), "@" + file.name], stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)
        if done.returncode in (0, 8):  # 8: some cannot be planned
            for name, found in zip(batch, json.loads(done.stdout)["tiles"]):
                self.known[name, density] = self._ask(found)
        elif len(batch) == 1:
            self.known[batch[0], density] = self.otherwise
        else:  # a line of the list is wrong, and no other shall suffer
            half = len(batch) // 2
            self._plan(batch[:half], density)
            self._plan(batch[half:], density)

    def _ask(self, found):
        if "error" in found:
            return self.otherwise
        return math.ceil(found["memory_bytes"] / 1e6) + WORKFLOW_MB
