"""What catalogues of several visits of one field say of each other, without any truth.

>>> from rextract.survey import repeatability
>>> numbers = repeatability(["visit1.cat", "visit2.cat"])
>>> numbers.pairs["first", "second", "pa1", "pull", "found"]      # the first row: all pairs of visits together
>>> numbers.write("repeat")                                       # each table as ECSV, and a plot where matplotlib is there

With d the difference of two magnitudes of a point source, zero points taken off, as in the LSST Science Requirements Document (Ivezic &
the LSST Science Collaboration, LPM-17):

- PA1 = 1.4826 MAD(d) / sqrt 2, the scatter of one measurement (LPM-17: the rms about the mean of many visits);
- PF1 = share of |d| / sqrt 2 above PA2 (`outlier`);
- AM1: the same as PA1 of the separations of stars 4 to 6 arcmin apart;
- pull = (F1 - F2) / sqrt(e1^2 + e2^2): 1 wide where the claimed errors are true. Errors that both visits share do not show.
- found: share of the sources of one visit that another one has. A false source is never found again: a lower bound of completeness.

Intervals are of 95 %: of shares Wilson's, of medians and widths those of order statistics. Of k visits all k (k - 1) / 2 pairs count,
which hold each measurement k - 1 times, so that intervals are widened by sqrt(k / 2).
"""
import dataclasses
import itertools
import math
import os
import warnings

import numpy as np
from astropy import units as u
from astropy.io import fits
from astropy.table import Table
from astropy.wcs import WCS, FITSFixedWarning
from astropy.wcs.utils import proj_plane_pixel_scales

from ._errors import InputError, RextractWarning, UsageError

__all__ = ["repeatability", "Repeatability"]

FEW = 10  # pairs below which there is no median, width or share
POSITIONS = [("ALPHATEMPLATE_J2000", "DELTATEMPLATE_J2000"), ("ALPHAPSF_J2000", "DELTAPSF_J2000"),
             ("ALPHAWIN_J2000", "DELTAWIN_J2000"), ("ALPHA_J2000", "DELTA_J2000"), ("ALPHA_SKY", "DELTA_SKY"), ("RA", "DEC"), ("ra", "dec")]
MAGNITUDES = [("MAG" + kind, "MAGERR" + kind) for kind in ("_TEMPLATE", "_PSF", "_AUTO", "_BEST", "_PETRO", "_ISO", "")]
STARS = ["CLASS_TEMPLATE", "P_STAR", "CLASS_STAR"]
POPULATIONS = ["points", "others"]
SNR = [5, 7, 10, 15, 20, 30, 50, 70, 100, 200, 400, 1000, 3000, math.inf]
MAG = 2.5 / math.log(10)
ROOT = math.sqrt(2)


# --- statistics ---


def _sigma(values):
    return 1.4826 * float(np.median(np.abs(values - np.median(values)))) if len(values) else math.nan


def _median(values, visits):
    """(value, low, high) of the median."""
    n = len(values)
    if n < FEW:
        return math.nan, -math.inf, math.inf
    rank = int(n / 2 - 0.98 * math.sqrt(n))
    ordered, value, wider = np.sort(values), float(np.median(values)), math.sqrt(visits / 2)
    low, high = (-math.inf, math.inf) if rank < 1 else (ordered[rank - 1], ordered[n - rank])
    return value, value - wider * (value - low), value + wider * (high - value)


def _width(values, visits, by=1.0):
    """The same of 1.4826 MAD / by."""
    if len(values) < FEW:
        return math.nan, 0.0, math.inf
    value, low, high = (1.4826 * x / by for x in _median(np.abs(values - np.median(values)), visits))
    return value, max(low, 0.0), high


def _share(found, of, visits):
    """The same of a share; each source counts in visits / 2 trials more than are independent."""
    if of == 0:
        return math.nan, 0.0, 1.0
    n, p, z = 2 * of / visits, found / of, 1.96
    middle, half = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return p, (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def _crossing(low, width, bins, mag, found, share, counts):
    """Where the falling curve nearest to the shares in fine bins crosses `share`; inf and -inf beyond the ends."""
    total = np.bincount(bins, counts, 36)
    with_any = np.flatnonzero(total)
    if total.sum() < FEW:
        return math.nan
    place = np.bincount(bins, counts * mag, 36)[with_any] / total[with_any]
    pools = []  # [share, weight, bins]: where one rises, it and the ones before take their mean
    for value, weight in zip(np.bincount(bins, counts * found, 36)[with_any] / total[with_any], total[with_any]):
        pools.append([value, weight, 1])
        while len(pools) > 1 and pools[-2][0] < pools[-1][0]:
            value, weight, n = pools.pop()
            both = pools[-1][1] + weight
            pools[-1] = [(pools[-1][0] * pools[-1][1] + value * weight) / both, both, pools[-1][2] + n]
    curve = np.repeat([pool[0] for pool in pools], [pool[2] for pool in pools])
    above = int((curve >= share).sum())
    if above == 0 or above == len(curve):
        return -math.inf if above == 0 else math.inf
    return place[above - 1] + (curve[above - 1] - share) / (curve[above - 1] - curve[above]) * (place[above] - place[above - 1])


def _limit(mag, found, share, visits):
    """(value, low, high) of the magnitude at which that share is found; the interval by resampling."""
    if len(mag) < FEW:
        return math.nan, -math.inf, math.inf
    low, width = math.floor(2 * mag.min()) / 2, (math.floor(2 * mag.max() + 1) - math.floor(2 * mag.min())) / 72
    bins = np.clip(((mag - low) / width).astype(int), 0, 35)
    value = _crossing(low, width, bins, mag, found, share, np.ones(len(mag)))
    draw, again = np.random.default_rng(1), []
    for _ in range(200):
        counts = np.bincount(draw.integers(len(mag), size=len(mag)), minlength=len(mag)).astype(float)
        again.append(_crossing(low, width, bins, mag, found, share, counts))
    ends = [sorted(again)[4], sorted(again)[-5]]
    wider = math.sqrt(visits / 2)
    return (value, *(value + wider * (end - value) if math.isfinite(end) and math.isfinite(value) else end for end in ends))


# --- visits ---


@dataclasses.dataclass
class _Frame:
    """One image of a visit: what it sees of the sky."""
    wcs: object = None
    shape: tuple = (0, 0)
    weight: object = None
    hull: object = None  # of its sources, arcsec, where nothing else is known

    @property
    def footprint(self):
        if self.weight is not None:
            return "weight map"
        return "hull of its sources" if self.wcs is None else "size and world coordinates of its image"

    def sees(self, visit, margin):
        """Sources of another visit that lie `margin` arcsec or more inside, at a pixel with weight."""
        if self.wcs is None:
            if len(self.hull) < 3:
                return np.zeros(len(visit.x), bool)
            inside = np.isfinite(visit.x)
            for (x0, y0), (x1, y1) in zip(self.hull, np.roll(self.hull, -1, axis=0)):
                inside &= (x1 - x0) * (visit.y - y0) - (y1 - y0) * (visit.x - x0) >= margin * math.hypot(x1 - x0, y1 - y0)
            return inside
        x, y = self.wcs.all_world2pix(visit.alpha, visit.delta, 0, quiet=True)
        edge = margin / 3600 / proj_plane_pixel_scales(self.wcs.celestial).mean()
        height, width = self.shape
        inside = (x >= edge - 0.5) & (x < width - 0.5 - edge) & (y >= edge - 0.5) & (y < height - 0.5 - edge)
        if self.weight is not None:
            inside[inside] = self.weight[np.rint(y[inside]).astype(int), np.rint(x[inside]).astype(int)] > 0
        return inside


@dataclasses.dataclass
class _Visit:
    name: str
    tables: list
    frames: list
    rows: list  # of each frame: a slice of the table
    alpha: np.ndarray = None  # deg
    delta: np.ndarray = None
    mag: np.ndarray = None  # nan where unknown, as the error
    error: np.ndarray = None
    star: np.ndarray = None
    flags: np.ndarray = None
    x: np.ndarray = None  # arcsec on the tangent plane, east and north
    y: np.ndarray = None


def _tables(path):
    """(Table, header of the image or None) of each catalogue in a file."""
    try:
        with open(path, "rb") as file:
            head = file.read(200)
        if head.startswith(b"SIMPLE"):
            found, header = [], None
            with fits.open(path) as hdus:
                for hdu in hdus:
                    if hdu.name == "LDAC_IMHEAD":
                        text = b"".join(np.atleast_1d(hdu.data["Field Header Card"][0]).astype("S80").tolist()).decode()
                        header = fits.Header.fromstring(text) if len(text) % 80 == 0 else _cards(hdu.data["Field Header Card"][0])
                    elif isinstance(hdu, fits.BinTableHDU):
                        found.append((Table(hdu.data), header))
            return found
        form = "votable" if b"VOTABLE" in head or head.startswith(b"<?xml") else "ascii.sextractor" if head.startswith(b"#") else "csv"
        return [(Table.read(path, format=form), None)]
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: is no catalogue: {str(error).splitlines()[0]}; give FITS_LDAC, FITS_1.0, ASCII_HEAD, VOTable or CSV") from None


def _cards(cards):
    return fits.Header([fits.Card.fromstring(str(card).ljust(80)) for card in np.atleast_1d(cards)])


def _frame(name, header, weight):
    frame = _Frame()
    if weight is not None:
        frame.weight, map_header = weight
        if header is not None and frame.weight.shape != (header.get("NAXIS2"), header.get("NAXIS1")):
            raise InputError(f"the weight map of {name} has {frame.weight.shape[1]} x {frame.weight.shape[0]} pixels, its image "
                             f"{header.get('NAXIS1')} x {header.get('NAXIS2')}; give the map of that image, in the order of the catalogues")
        frame.shape = frame.weight.shape
        header = map_header if map_header is not None and "CTYPE1" in map_header else header
    elif header is not None:
        frame.shape = header.get("NAXIS2", 0), header.get("NAXIS1", 0)
    if header is not None and min(frame.shape) > 0:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FITSFixedWarning)
            wcs = WCS(header)
        frame.wcs = wcs if wcs.has_celestial else None
    if weight is not None and frame.wcs is None:
        raise InputError(f"the weight map of {name} has no world coordinates, nor has the catalogue an image's header; give a map that "
                         "has, or a catalogue of FITS_LDAC")
    return frame


def _weight(source):
    """(pixels, header or None) of a path, an HDU or an array; None of None."""
    if source is None or (isinstance(source, str) and source == "NONE"):
        return None
    if isinstance(source, (str, os.PathLike)):
        with fits.open(source) as hdus:
            hdu = next(hdu for hdu in hdus if hdu.is_image and hdu.header["NAXIS"] == 2)
            return np.array(hdu.data), hdu.header
    return np.asarray(getattr(source, "data", source)), getattr(source, "header", None)


def _read(source, number, weight):
    if isinstance(source, Table):
        name, found = source.meta.get("name", f"visit {number}"), [(source, None)]
    else:
        name, found = os.fspath(source), _tables(source)
    if not found:
        raise InputError(f"{name}: holds no table; give a catalogue of rextract")
    if len(found) > 1 and weight is not None:
        raise UsageError(f"{name}: holds {len(found)} tables, weights are for catalogues of one; leave the map out")
    ends = [0, *itertools.accumulate(len(table) for table, _ in found)]
    return _Visit(name, [table for table, _ in found], [_frame(name, header, weight) for _, header in found],
                  [slice(a, b) for a, b in zip(ends, ends[1:])])


def _choose(visit, columns):
    """The columns that all visits are read by, of those that the first one has."""
    names = visit.tables[0].colnames
    there = [pair for pair in POSITIONS if set(pair) <= set(names)]
    if not there:
        raise InputError(f"{visit.name}: has no column of positions on the sky, by which visits are matched; write ALPHAWIN_J2000 and "
                         "DELTAWIN_J2000, of an image with world coordinates")
    fluxes = [pair for pair in ([tuple(columns)] if columns else MAGNITUDES) if set(pair) <= set(names)]
    if not fluxes and columns:
        raise InputError(f"{visit.name}: has no columns {columns[0]} and {columns[1]}; name existing ones in columns")
    if not fluxes:
        raise InputError(f"{visit.name}: has no magnitudes with errors, as MAG_AUTO and MAGERR_AUTO; name them in columns")
    star = next((name for name in STARS if name in names), None)
    return [*there[0], *fluxes[0], star, "FLAGS" if "FLAGS" in names else None]


def _fill(visit, chosen, centre, star):
    """The arrays of a visit; centre of the tangent plane: that of the first visit, made here where it is None."""
    def column(name, otherwise):
        if name is None:
            return np.full(sum(map(len, visit.tables)), otherwise)
        if any(name not in table.colnames for table in visit.tables):
            raise InputError(f"{visit.name}: has no column {name}, which the first visit has; give all visits the same columns")
        values = [np.ma.filled(np.ma.asarray(table[name], float), math.nan) for table in visit.tables]
        return np.concatenate([value if value.ndim == 1 else value[:, 0] for value in values])
    visit.alpha, visit.delta, visit.mag, visit.error = (column(name, math.nan) for name in chosen[:4])
    visit.star = column(chosen[4], 1.0) >= star
    visit.flags = np.nan_to_num(column(chosen[5], 0.0)).astype(int)
    known = (np.abs(visit.mag) < 90) & (visit.error > 0) & (visit.error < 90)
    visit.mag, visit.error = np.where(known, visit.mag, math.nan), np.where(known, visit.error, math.nan)
    alpha, delta = np.radians(visit.alpha), np.radians(visit.delta)
    if centre is None:
        mean = [np.nanmean(v) for v in (np.cos(delta) * np.cos(alpha), np.cos(delta) * np.sin(alpha), np.sin(delta))]
        centre = math.atan2(mean[1], mean[0]), math.atan2(mean[2], math.hypot(mean[0], mean[1]))
    a, (sin, cos) = alpha - centre[0], (math.sin(centre[1]), math.cos(centre[1]))
    z = sin * np.sin(delta) + cos * np.cos(delta) * np.cos(a)
    scale = 3600 * np.degrees(1 / np.where(z > 0, z, math.nan))
    visit.x = scale * np.cos(delta) * np.sin(a)
    visit.y = scale * (cos * np.sin(delta) - sin * np.cos(delta) * np.cos(a))
    for frame, rows in zip(visit.frames, visit.rows):
        if frame.wcs is None:
            frame.hull = _hull(visit.x[rows], visit.y[rows])
    return centre


def _hull(x, y):
    """Convex hull, counter-clockwise (Andrew 1979, Inf. Process. Lett. 9, 216)."""
    points = sorted({point for point in zip(x.tolist(), y.tolist()) if math.isfinite(point[0])})
    corners = []
    for side in (points, points[::-1]):
        first = len(corners)
        for p in side:
            while len(corners) >= first + 2 and ((corners[-1][0] - corners[-2][0]) * (p[1] - corners[-2][1])
                                                 <= (corners[-1][1] - corners[-2][1]) * (p[0] - corners[-2][0])):
                corners.pop()
            corners.append(p)
        corners = corners[:-1]
    return np.array(corners).reshape(-1, 2)


def _match(a, b, radius):
    """For each source of a its partner in b or -1: pairs within the radius, nearest first, each source once. a, b: (x, y)."""
    to_b = np.full(len(a[0]), -1)
    good = [np.flatnonzero(np.isfinite(x) & np.isfinite(y)) for x, y in (a, b)]
    cell = [np.floor(np.array([x[i], y[i]]) / radius).astype(np.int64) for (x, y), i in zip((a, b), good)]
    if not len(good[0]) or not len(good[1]):
        return to_b
    rows = 4 * max(int(np.abs(c).max()) + 2 for c in cell)
    order = np.argsort(cell[1][1] * rows + cell[1][0], kind="stable")
    keys = (cell[1][1] * rows + cell[1][0])[order]
    pairs = []
    for dx, dy in itertools.product((-1, 0, 1), repeat=2):
        key = (cell[0][1] + dy) * rows + cell[0][0] + dx
        first, last = np.searchsorted(keys, key, "left"), np.searchsorted(keys, key, "right")
        n = last - first
        i = np.repeat(np.arange(len(key)), n)
        j = np.arange(n.sum()) - np.repeat(np.cumsum(n) - n, n) + np.repeat(first, n)
        pairs.append((good[0][i], good[1][order[j]]))
    i, j = (np.concatenate(side) for side in zip(*pairs))
    apart = np.hypot(a[0][i] - b[0][j], a[1][i] - b[1][j])
    taken = set()
    for k in np.lexsort((j, i, apart)):
        if apart[k] <= radius and to_b[i[k]] < 0 and j[k] not in taken:
            to_b[i[k]] = j[k]
            taken.add(j[k])
    return to_b


# --- pairs of visits ---


@dataclasses.dataclass
class _Pairs:
    """Sources of two visits with FLAGS 0 and both magnitudes."""
    dm: np.ndarray  # second - first, zero point taken off
    error: np.ndarray  # of it, as claimed
    pull: np.ndarray  # of fluxes, as errors of magnitudes are not symmetric
    snr: np.ndarray  # mean flux over the rms of both errors
    star: np.ndarray  # 1, 0; 2 where the visits disagree
    x: np.ndarray
    y: np.ndarray
    dx: np.ndarray  # arcsec, offset taken off
    dy: np.ndarray

    def choose(self, which):
        return _Pairs(*(getattr(self, field.name)[which] for field in dataclasses.fields(self)))

    def numbers(self, visits, outlier):
        """Of one measurement, in mmag and mas."""
        n, mag, place = len(self.dm), 1e3 * self.dm, [1e3 * self.dx, 1e3 * self.dy]
        return {"pa1": _width(mag, visits, ROOT), "pa1_rms": math.sqrt(np.mean(mag**2) / 2) if n >= FEW else math.nan,
                "claimed": 1e3 * float(np.median(self.error)) / ROOT if n else math.nan,
                "pf1": _share(int((np.abs(mag) > ROOT * outlier).sum()), n, visits),
                "pull": _width(self.pull, visits), "pull_median": _median(self.pull, visits),
                "east": _width(place[0], visits, ROOT), "north": _width(place[1], visits, ROOT)}

    def separations(self):
        """(AM1 in mas, how many) of the 1500 brightest at most."""
        best = np.lexsort((self.x, -self.snr))[:1500]
        x, y, dx, dy = (v[best] for v in (self.x, self.y, self.dx, self.dy))
        i, j = np.triu_indices(len(best), 1)
        apart = np.hypot(x[i] - x[j], y[i] - y[j])
        keep = (apart >= 240) & (apart < 360)
        i, j, apart = i[keep], j[keep], apart[keep]
        change = np.hypot(x[i] - x[j] + dx[i] - dx[j], y[i] - y[j] + dy[i] - dy[j]) - apart
        return (1e3 * _sigma(change) / ROOT if len(change) >= FEW else math.nan), len(change)


def _compare(a, b, radius, snr, zero_point_of_a):
    """None where neither sees a source of the other; else (facts, _Pairs, trials of both populations)."""
    seen = [np.logical_or.reduce([frame.sees(v, 3 * radius) for frame in other.frames]) for v, other in ((a, b), (b, a))]
    if not seen[0].any() and not seen[1].any():
        return None
    chance = int((_match((a.x, a.y), (b.x - 10 * radius, b.y), radius) >= 0).sum())
    offset = [math.nan, 0.0, 0.0]
    for last in (False, True):  # what is farther off than the radius is not seen; what is nearer is taken off, and all matched again
        to_b = _match((a.x, a.y), (b.x - offset[1], b.y - offset[2]), radius)
        i = np.flatnonzero(to_b >= 0)
        k = to_b[i]
        clean = (a.flags[i] == 0) & (b.flags[k] == 0) & np.isfinite(a.mag[i] + b.mag[k])
        least = np.where(clean, MAG / np.fmax(a.error[i], b.error[k]), math.nan)
        for limit, stars in ((snr, True), (20, True), (20, False), (0, False)):
            shows = clean & (least >= limit) & (~np.bool_(stars) | (a.star[i] & b.star[k]))
            if shows.sum() >= FEW:
                break
        change = np.array([b.mag[k] - a.mag[i], b.x[k] - a.x[i], b.y[k] - a.y[i]])[:, shows]
        if not last and shows.any():
            offset = [float(np.median(v)) for v in change]
    n = change.shape[1]
    offset = [float(np.median(v)) for v in change] if n else [math.nan, 0.0, 0.0]
    spread = 1.2533 * _sigma(change[0]) / math.sqrt(n) if n > 1 else math.nan
    fine = clean & math.isfinite(offset[0])
    i, k = i[fine], k[fine]
    dm = b.mag[k] - a.mag[i] - offset[0]
    flux = [10 ** (0.2 * dm), 10 ** (-0.2 * dm)]  # in units of the geometric mean
    both = np.hypot(flux[0] * a.error[i], flux[1] * b.error[k]) / MAG
    pairs = _Pairs(dm, np.hypot(a.error[i], b.error[k]), (flux[0] - flux[1]) / both, (flux[0] + flux[1]) / ROOT / both,
                   np.where(a.star[i] == b.star[k], a.star[i].astype(int), 2), a.x[i], a.y[i], b.x[k] - a.x[i] - offset[1],
                   b.y[k] - a.y[i] - offset[2])
    to_a = np.full(len(b.x), -1)
    to_a[to_b[to_b >= 0]] = np.flatnonzero(to_b >= 0)
    trials = []
    shift = zero_point_of_a + (offset[0] if math.isfinite(offset[0]) else 0.0)
    for v, sees, partner, zero in ((a, seen[0], to_b, zero_point_of_a), (b, seen[1], to_a, shift)):
        counts = sees & (v.flags < 4) & np.isfinite(v.mag)
        trials.append((v.mag[counts] - zero, partner[counts] >= 0, v.star[counts]))
    facts = {"first": a.name, "second": b.name, "matched": int((to_b >= 0).sum()), "chance": chance, "zero_point": offset[0],
             "zero_point_error": spread, "offset_east": 1e3 * offset[1], "offset_north": 1e3 * offset[2]}
    return facts, pairs, [np.concatenate(column) for column in zip(*trials)], shift


# --- all of it ---

UNITS = {"mmag": ("pa1", "pa1_rms", "claimed"), "mas": ("east", "north", "am1", "offset_east", "offset_north"),
         "mag": ("zero_point", "zero_point_error", "mag_low", "mag_high", "mag90", "mag50")}


def _table(rows):
    """Rows of numbers and (value, low, high), which become three columns."""
    flat = []
    for row in rows:
        flat.append({})
        for name, value in row.items():
            if isinstance(value, tuple):
                flat[-1].update({name: value[0], name + "_low": value[1], name + "_high": value[2]})
            else:
                flat[-1][name] = value
    table = Table(rows=flat) if flat else Table()
    for unit, names in UNITS.items():
        for name in table.colnames:
            if name in names or name.rsplit("_", 1)[0] in names:
                table[name].unit = u.Unit("mmag" if unit == "mmag" else unit)
    return table


@dataclasses.dataclass
class Repeatability:
    """Tables of numbers; each estimate NAME is beside the ends of its interval, NAME_low and NAME_high.

    pairs   a row for all pairs of visits together, then one for each pair
    by_snr  scatter against claimed errors, by S/N; points and others
    by_mag  share found again, by magnitude on the first visit's scale
    limits  magnitudes at which 90 and 50 % are found again
    visits  each catalogue, and how it is known what the visit sees
    """
    pairs: Table
    by_snr: Table
    by_mag: Table
    limits: Table
    visits: Table

    def write(self, folder):
        """Each table as ECSV into the folder, which is made; figures.png where matplotlib is there."""
        os.makedirs(folder, exist_ok=True)
        for field in dataclasses.fields(self):
            getattr(self, field.name).write(os.path.join(folder, field.name + ".ecsv"), format="ascii.ecsv", overwrite=True)
        try:
            self.figure().savefig(os.path.join(folder, "figures.png"), dpi=120)
        except ImportError:
            pass

    def figure(self):
        """Scatter, pulls and positions by S/N and the share found again, as a figure of matplotlib."""
        from matplotlib.figure import Figure
        figure = Figure(figsize=(10, 7), constrained_layout=True)
        axes = figure.subplots(2, 2).ravel()

        def draw(panel, table, x, name, population, label):
            rows = table[table["population"] == population] if len(table) else table
            if len(rows):
                value = np.array(rows[name])
                ends = [np.nan_to_num(np.abs(np.array(rows[name + end]) - value), posinf=0) for end in ("_low", "_high")]
                panel.errorbar(x(rows), value, ends, fmt="o", ms=3, label=label)
        for population in POPULATIONS:
            rows = self.by_snr[self.by_snr["population"] == population] if len(self.by_snr) else []
            if len(rows):
                axes[0].plot(rows["snr_low"], rows["claimed"], "--", label=population + ", claimed")
            draw(axes[0], self.by_snr, lambda r: r["snr_low"], "pa1", population, population)
            draw(axes[1], self.by_snr, lambda r: r["snr_low"], "pull", population, population)
            draw(axes[3], self.by_mag, lambda r: (r["mag_low"] + r["mag_high"]) / 2, "found", population, population)
        for name in ("east", "north"):
            draw(axes[2], self.by_snr, lambda r: r["snr_low"], name, "points", name)
        labels = ("scatter [mmag]", "width of pulls", "scatter of positions [mas]", "found again")
        for panel, label in zip(axes, labels):
            panel.set(xlabel="S/N from" if panel is not axes[3] else "magnitude, on the first visit's scale", ylabel=label)
            panel.legend()
        for panel, log in zip(axes[:3], (True, False, True)):
            panel.set(xscale="log", yscale="log" if log else "linear")
        axes[1].axhline(1, color="0.6")
        return figure


def repeatability(catalogues, *, columns=None, radius=1.0, snr=200.0, star=0.5, outlier=15.0, weights=None):
    """Compare two or more visits of one field; a Repeatability.

    catalogues  paths (FITS_LDAC, whose header says what the image sees, FITS_1.0, ASCII_HEAD, VOTable, CSV) or astropy Tables
    columns     (magnitude, its error); without them the first there are of _TEMPLATE, _PSF, _AUTO, _BEST, _PETRO, _ISO
    radius      of matches, arcsec
    snr         from which a source is bright: PA1, PF1, AM1
    star        least CLASS_TEMPLATE, P_STAR or CLASS_STAR of a point source, in both visits
    outlier     PA2: beyond it a magnitude is an outlier, mmag
    weights     a weight map (path, HDU or array) or None for each visit: nothing is found where it is 0

    FLAGS have to be 0 in both visits. The difference of zero points (median of bright point sources) and that of positions are
    reported, and taken off before anything else is measured. Found again are sources that lie inside the other visit's image by three
    radii or more, at a pixel with weight, have a magnitude and FLAGS below 4.
    """
    catalogues, weights = list(catalogues), list(weights) if weights is not None else None
    if len(catalogues) < 2:
        raise UsageError(f"repeatability compares visits of one field, {len(catalogues)} named; give two catalogues or more")
    if weights is not None and len(weights) != len(catalogues):
        raise UsageError(f"weights has {len(weights)} of {len(catalogues)} maps; give a map, or None, for each catalogue, in their order")
    paths = [os.fspath(one) for one in catalogues if not isinstance(one, Table)]
    for path in paths:
        if paths.count(path) > 1:
            raise UsageError(f"{path} is named twice; give each visit once")
    if columns is not None and len(columns) != 2:
        raise UsageError("columns are two: a magnitude and its error, such as ('MAG_AUTO', 'MAGERR_AUTO')")
    visits, centre = [], None
    for number, (source, weight) in enumerate(zip(catalogues, weights or [None] * len(catalogues)), 1):
        visits.append(_read(source, number, _weight(weight)))
        if number == 1:
            chosen = _choose(visits[0], columns)
            if chosen[4] is None:
                warnings.warn("no column distinguishes point sources (CLASS_TEMPLATE, CLASS_STAR): all sources count as point sources",
                              RextractWarning, stacklevel=2)
        centre = _fill(visits[-1], chosen, centre, star)

    zero, facts, pairs, trials = {0: 0.0}, [], [], []
    for i, k in itertools.combinations(range(len(visits)), 2):
        made = _compare(visits[i], visits[k], radius, snr, zero.get(i, 0.0))
        if made is not None:
            facts.append(made[0])
            pairs.append(made[1])
            trials.append(made[2])
            zero.setdefault(k, made[3])
    if not facts:
        raise InputError(f"none of the {len(visits)} visits sees a source of another one; give visits that overlap")
    if not any(len(one.dm) for one in pairs):
        raise InputError(f"the visits overlap, but no source with FLAGS 0 and a magnitude is within {radius:g} arcsec of one in another "
                         "visit; give a larger radius, or visits whose positions agree")

    def row(fact, p, of, n, am1):
        bright, points = p.choose((p.star == 1) & (p.snr >= snr)), p.choose((p.star == 1) & (p.snr >= 5))
        numbers = bright.numbers(n, outlier)
        am1 = am1 or bright.separations()
        return {**fact, "bright": len(bright.dm), **{name: numbers[name] for name in ("pa1", "pa1_rms", "claimed", "pf1", "east", "north")},
                "am1": am1[0], "separations": am1[1], "pull": points.numbers(n, outlier)["pull"],
                "found": _share(int(of[1].sum()), len(of[1]), n)}
    rows = [row(fact, p, of, 2, None) for fact, p, of in zip(facts, pairs, trials)]
    every = _Pairs(*(np.concatenate([getattr(p, field.name) for p in pairs]) for field in dataclasses.fields(_Pairs)))
    mag, found, is_star = (np.concatenate(column) for column in zip(*trials))
    separations = [one["am1"] for one in rows if math.isfinite(one["am1"])]  # those of one and the same pair of visits
    fact = {"first": "all", "second": "", "matched": sum(f["matched"] for f in facts), "chance": sum(f["chance"] for f in facts),
            "zero_point": math.nan, "zero_point_error": math.nan, "offset_east": math.nan, "offset_north": math.nan}
    rows.insert(0, row(fact, every, (mag, found), len(visits),
                       (float(np.median(separations)) if separations else math.nan, sum(one["separations"] for one in rows))))

    by_snr, by_mag, limits = [], [], []
    for population, points in zip(POPULATIONS, (True, False)):
        for low, high in zip(SNR, SNR[1:]):
            chosen_pairs = every.choose((every.star == int(points)) & (every.snr >= low) & (every.snr < high))
            if len(chosen_pairs.dm) >= FEW:
                numbers = chosen_pairs.numbers(len(visits), outlier)
                by_snr.append({"population": population, "snr_low": low, "snr_high": high, "pairs": len(chosen_pairs.dm),
                               **{name: numbers[name] for name in ("pa1", "claimed", "pull", "pull_median", "east", "north")}})
        m, f = mag[is_star == points], found[is_star == points]
        for low in np.arange(np.floor(2 * m.min()) / 2, m.max() + 1e-9, 0.5) if len(m) else []:
            here = (m >= low) & (m < low + 0.5)
            if here.any():
                by_mag.append({"population": population, "mag_low": low, "mag_high": low + 0.5, "seen": int(here.sum()),
                               "found": _share(int(f[here].sum()), int(here.sum()), len(visits))})
        if len(m):
            limits.append({"population": population, "seen": len(m), "mag90": _limit(m, f, 0.9, len(visits)),
                           "mag50": _limit(m, f, 0.5, len(visits))})
    return Repeatability(_table(rows), _table(by_snr), _table(by_mag), _table(limits),
                         _table([{"catalogue": v.name, "sources": len(v.x), "footprint": v.frames[0].footprint} for v in visits]))
