"""The list of tiles, read as rextract reads it (config/tiles.h)."""
import os
import re
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
