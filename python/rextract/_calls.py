"""The calls: what goes in, what comes out."""
from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from typing import Any, Iterable, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from astropy.io.fits import HDUList, Header
from astropy.table import Column, Table
from astropy.units import Unit

from ._errors import InputError, UsageError
from ._library import Conversation, Job, Progress, Stop, ffi, lib, text_of
from ._psf import PSF

DETECT_COLUMNS = ("NUMBER", "X_IMAGE", "Y_IMAGE", "ALPHA_J2000", "DELTA_J2000", "XMIN_IMAGE", "XMAX_IMAGE", "YMIN_IMAGE",
                  "YMAX_IMAGE", "ISOAREA_IMAGE", "A_IMAGE", "B_IMAGE", "THETA_IMAGE", "FLUX_ISO", "FLUXERR_ISO", "FLUX_MAX",
                  "THRESHOLD", "FLAGS")
TEMPLATE_COLUMNS = ("NUMBER", "XTEMPLATE_IMAGE", "YTEMPLATE_IMAGE", "ALPHATEMPLATE_J2000", "DELTATEMPLATE_J2000",
                    "MAG_TEMPLATE", "MAGERR_TEMPLATE", "FLUX_TEMPLATE", "FLUXERR_TEMPLATE", "SNR_TEMPLATE", "CHI2_TEMPLATE",
                    "EVIDENCE_TEMPLATE", "P_REAL", "BLEND_TEMPLATE", "CLASS_TEMPLATE", "P_BLEND", "RADIUS_TEMPLATE",
                    "GROUP_TEMPLATE", "FLAGS", "FLAGS_TEMPLATE", "FLAGS_RESTORE")
CELLS = {lib.RX_CELL_INT16: "i2", lib.RX_CELL_INT32: "i4", lib.RX_CELL_INT64: "i8", lib.RX_CELL_FLOAT: "f4",
         lib.RX_CELL_DOUBLE: "f8"}


@dataclass
class Image:
    """An image with what is known of it.

    pixels: (height, width), ADU with the sky; an array, a masked array, an HDU, or an NDData such as CCDData, whose mask, wcs, meta
    and unit (as BUNIT) count, and its uncertainty (standard deviation, variance, inverse variance) as the weight unless one is given.
    mask: (height, width), true where a pixel is bad. weight: (height, width), what WEIGHT_TYPE says, MAP_WEIGHT unless it is
    given. header: an astropy Header or WCS, for world coordinates, GAIN_KEY, SATUR_KEY, MAG_ZEROPOINT_KEY. psf: a PSF, or an
    array that is an image of it (PSF_SAMPLING samples a pixel). name: in messages.
    """

    pixels: Any
    mask: Any = None
    weight: Any = None
    header: Any = None
    psf: Union[PSF, np.ndarray, None] = None
    name: Optional[str] = None


def _plane(what: str, array, dtype, shape=None) -> np.ndarray:
    array = np.ascontiguousarray(array, dtype=dtype)
    if array.ndim != 2 or array.size == 0:
        raise UsageError(f"{what} has the shape {array.shape}; give one plane, (height, width)")
    if shape is not None and array.shape != shape:
        raise UsageError(f"{what} has the shape {array.shape}, the image {shape}")
    return array


#: WEIGHT_TYPE of an uncertainty of NDData
UNCERTAINTIES = {"std": "MAP_RMS", "var": "MAP_VAR", "ivar": "MAP_IVAR"}


def _cards(meta) -> Header:
    """What of a mapping a header can hold."""
    header = Header()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of long keywords and values
        for key, value in meta.items():
            try:
                header[key] = value
            except (ValueError, TypeError, AttributeError):
                pass  # a list, an object: no card
    return header


def _header_of(image):
    """Of an HDU or NDData, a copy where something joins it."""
    header = image.header if hasattr(image, "header") else image.meta
    wcs, unit = getattr(image, "wcs", None), getattr(image, "unit", None)
    if not isinstance(header, Header):
        header = _cards(header)
    elif wcs is not None or unit is not None:
        header = header.copy()
    if hasattr(wcs, "to_header"):
        header.update(wcs.to_header(relax=True))
    if unit is not None:
        header["BUNIT"] = str(unit)
    return header


class _Lent:
    """An Image as the library takes it. Pixels are not copied where they are float32 as C has it."""

    def __init__(self, image: Image):
        pixels, mask, header = image.pixels, image.mask, image.header
        weight, self.weight_type = image.weight, "MAP_WEIGHT"
        name = image.name or "image"
        if isinstance(pixels, (str, bytes, os.PathLike)):
            raise UsageError("the image is the name of a file; rextract.run() reads files, or give astropy.io.fits.getdata(name)")
        if isinstance(pixels, HDUList):
            raise UsageError("the image is an HDUList; give one of its HDUs, such as hdus[0]")
        if hasattr(pixels, "data") and (hasattr(pixels, "header") or hasattr(pixels, "uncertainty")):
            header = _header_of(pixels) if header is None else header
            mask = getattr(pixels, "mask", None) if mask is None else mask
            uncertainty = getattr(pixels, "uncertainty", None)
            if weight is None and uncertainty is not None:
                self.weight_type = UNCERTAINTIES.get(uncertainty.uncertainty_type)
                if self.weight_type is None:
                    raise UsageError("the image's uncertainty is none of StdDevUncertainty, VarianceUncertainty and "
                                     "InverseVariance; set it to None")
                weight = uncertainty.array
            pixels = pixels.data
        if isinstance(pixels, np.ma.MaskedArray):
            hidden = np.ma.getmaskarray(pixels)
            mask = hidden if mask is None else hidden | np.asarray(mask, dtype=bool)
            pixels = pixels.data
        if np.iscomplexobj(pixels):
            raise UsageError("the image holds complex numbers; give real ones")
        self.pixels = _plane("the image", pixels, np.float32)
        shape = self.pixels.shape
        self.mask = None if mask is None else _plane("the mask", np.asarray(mask) != 0, np.bool_, shape)
        self.weight = None if weight is None else _plane("the weight map", weight, np.float32, shape)
        if header is not None and not hasattr(header, "tostring"):
            header = header.to_header(relax=True)  # a WCS
        cards = b"" if header is None else header.tostring(sep="", endcard=False, padding=False).encode("ascii", "replace")
        self._cards, self._name = ffi.new("char[]", cards), ffi.new("char[]", os.fsencode(name))
        self.c = ffi.new("rx_tile_arrays *")
        self.c.name = self._name
        self.c.height, self.c.width = shape
        self.c.pixels = _pointer("float *", self.pixels)
        self.c.mask = _pointer("uint8_t *", self.mask)
        self.c.weight = _pointer("float *", self.weight)
        self.c.cards, self.c.ncards = self._cards, len(cards) // 80
        self.psf, self._stamp, self.stamp = image.psf, None, ffi.NULL
        if self.psf is not None and not isinstance(self.psf, PSF):
            self._stamp = _plane("the PSF", self.psf, np.float32)
            self.stamp = ffi.new("rx_psf_pixels *")
            self.stamp.height, self.stamp.width = self._stamp.shape
            self.stamp.pixels = _pointer("float *", self._stamp)
            self.psf = None


def _pointer(kind: str, array: Optional[np.ndarray]):
    return ffi.NULL if array is None else ffi.cast(kind, array.ctypes.data)


class _Memory:
    """What a call made, and what it was made from."""

    def __init__(self, job: Job, detect: _Lent, measure: Optional[_Lent], talk: Conversation):
        images = ffi.new("rx_job_images *")
        self._lent = (detect, measure)
        images.detect = detect.c
        images.measure = measure.c if measure is not None else ffi.NULL
        for role, lent in enumerate(self._lent):
            if lent is not None:
                images.psf[role] = lent.psf._c if lent.psf is not None else ffi.NULL
                images.image_of_psf[role] = lent.stamp
        self.c = ffi.gc(ffi.new("rx_job_result *"), lib.rx_job_result_free)
        talk.end(lib.rx_job_arrays(job.c, images, talk.log, self.c, talk.error), stacklevel=5)

    def facts(self) -> dict:
        facts = {}
        for i in range(self.c.facts.n):
            name, value = (text_of(self.c.facts.pairs[i][k]) for k in (0, 1))
            for number in (int, float):
                try:
                    facts[name] = number(value)
                    break
                except ValueError:
                    facts[name] = value
        return facts

    def view(self, pointer, dtype, shape):
        """The library's own memory as an array, which may be read while it lives."""
        return np.asarray(_View(self, int(ffi.cast("uintptr_t", pointer)), np.dtype(dtype), shape))


class _View:
    def __init__(self, owner, address, dtype, shape):
        self._owner = owner
        self.__array_interface__ = {"version": 3, "data": (address, True), "typestr": dtype.str, "shape": shape}


def _table(source, facts: Mapping[str, Any]) -> Table:
    """An rx_table as a Table, copied: it is small."""
    table = Table(meta=dict(facts))
    n = source.nrows
    for i in range(source.ncolumns):
        column = source.columns + i
        elements = lib.rx_column_elements(column)
        dtype = CELLS[column.type]
        data = np.frombuffer(ffi.buffer(column.data, n * elements * lib.rx_column_element_size(column)), dtype).copy()
        if elements > 1:
            data = data.reshape((n, *(column.dim[k] for k in reversed(range(column.ndim)))))
        unit = text_of(column.unit)
        ucd = text_of(column.ucd)
        table[text_of(column.name)] = Column(data, description=text_of(column.description),
                                             unit=Unit(unit, format="fits", parse_strict="silent") if unit else None,
                                             meta={"ucd": ucd} if ucd else None)
    return table


class Result:
    """All that came of an image. numpy.asarray(result) is the restored image.

    table: astropy Table of the sources, its meta the facts. facts: dict of the cards that headers of catalogues hold (RXREST
    names the restorer that did the work, RXWHY why another one did; man rextract has them all).
    """

    def __init__(self, memory: _Memory):
        self._memory = memory
        c = memory.c
        restored, field = c.result.restored, c.detect
        self.shape: Tuple[int, int] = (restored.height, restored.width)  #: (height, width)
        self.restorer: str = text_of(restored.name)  #: that did it: "NONE", "RL", "RL_BLIND", "NET"
        self.facts: dict = memory.facts()
        self.table: Table = _table(c.table, self.facts)
        self.psf: Optional[PSF] = self._psf(field.psf)  #: of the image as it was given; None: not known
        self.restored_psf: Optional[PSF] = self._psf(restored.psf)  #: of the restored image; None: not known

    def _psf(self, pointer):
        return PSF(self._memory, pointer, self.facts) if pointer != ffi.NULL else None

    def _map(self, make) -> np.ndarray:
        field = self._memory.c.detect
        sky = field.plain if self._memory.c.result.plain else field.restored
        plane, made = np.empty(self.shape, dtype=np.float32), ffi.new("rx_map *", make(sky))
        lib.rx_map_fill(made, self.shape[0], os.cpu_count() or 1, ffi.cast("float *", plane.ctypes.data))
        return plane

    @property
    def restored(self) -> np.ndarray:
        """The restored image less its sky, ADU: float32 (height, width), read-only, not a copy; 0 where it is masked."""
        return self._memory.view(self._memory.c.result.restored.pixels, np.float32, self.shape)

    @property
    def segments(self) -> np.ndarray:
        """Which pixel is whose: NUMBER of the source, 0 of the sky; int32 (height, width), read-only, not a copy."""
        return self._memory.view(self._memory.c.result.sources.segments, np.int32, self.shape)

    @property
    def sky(self) -> np.ndarray:
        """The sky that was taken off, ADU: float32 (height, width), made anew at each access."""
        return self._map(lib.rx_background_level)

    @property
    def noise(self) -> np.ndarray:
        """Noise of a pixel of the given image without sources, ADU, 1 sigma: float32 (height, width), made anew."""
        return self._map(lib.rx_background_noise)

    def __array__(self, dtype=None, copy=None):
        array = self.restored
        return array.astype(dtype or array.dtype) if copy or (dtype is not None and dtype != array.dtype) else array

    def __repr__(self):
        return f"<Result: {self.shape[1]} x {self.shape[0]} pixels by {self.restorer}, {len(self.table)} sources>"


class SelfCheck:
    """How complete and how right a catalogue of this image is, by objects that were injected into copies of it.

    injected: Table, one row for each object: X_IMAGE, Y_IMAGE, MAG, GALAXY, ROUND, FOUND, MAG_FOUND. n, found: how many.
    mag50, mag90: magnitude where 50 and 90 % are found, with the ends of its interval at 95 %: (value, low, high), None
    where it is not known. facts: dict of the cards RXSC... table: the sources of the image.
    """

    def __init__(self, memory: _Memory):
        c = memory.c
        self.facts: dict = memory.facts()
        if c.injected == ffi.NULL:
            raise InputError(f"no self check: {self.facts.get('RXSCWHY', 'nothing could be injected')}")
        self.injected: Table = _table(c.injected, self.facts)
        self.table: Table = _table(c.table, self.facts)
        self.n: int = self.facts["RXSCN"]
        self.found: int = self.facts["RXSCFND"]
        self.mag50, self.mag90 = (self._estimate(key) for key in ("RXSC50", "RXSC90"))

    def _estimate(self, key):
        return tuple(self.facts.get(key + end) for end in ("", "L", "H")) if key in self.facts else None

    def completeness(self, step: float = 0.5) -> Table:
        """Share found in bins of `step` magnitudes: MAG (middle), INJECTED, FOUND, SHARE."""
        place = np.floor(np.asarray(self.injected["MAG"]) / step).astype(int)
        bins = np.unique(place)
        injected = np.array([np.sum(place == k) for k in bins])
        found = np.array([np.sum(np.asarray(self.injected["FOUND"])[place == k]) for k in bins])
        return Table({"MAG": (bins + 0.5) * step, "INJECTED": injected, "FOUND": found, "SHARE": found / injected})

    def __repr__(self):
        return f"<SelfCheck: {self.found} of {self.n} injected objects found>"


def _call(image, columns: Iterable[str], *, detection=None, config=None, progress: Optional[Progress] = None,
          stop: Optional[Stop] = None, psf_only=False, mask=None, weight=None, header=None, psf=None, name=None,
          **keywords) -> _Memory:
    own = {"mask": mask, "weight": weight, "header": header, "psf": psf, "name": name}
    if not isinstance(image, Image):
        image = Image(image, **own)
    elif any(value is not None for value in own.values()):
        raise UsageError("an Image holds its mask, weight, header, psf and name; give them there")
    lent = [_Lent(image)]
    if detection is not None:
        lent.insert(0, _Lent(detection if isinstance(detection, Image) else Image(detection)))
    if not any(key.upper() == "WEIGHT_TYPE" for key in keywords) and any(one.weight is not None for one in lent):
        keywords["WEIGHT_TYPE"] = ["NONE" if one.weight is None else one.weight_type for one in lent]
    columns = [columns] if isinstance(columns, str) else columns
    job = Job(config, keywords, tuple(dict.fromkeys(column.upper() for column in columns)))
    job.c.psf_only = psf_only
    return _Memory(job, lent[0], lent[1] if len(lent) > 1 else None, Conversation(progress, stop))


def extract(image, *, columns: Sequence[str] = (), detection=None, config: Union[str, os.PathLike, None] = None,
            mask=None, weight=None, header=None, psf=None, name: Optional[str] = None,
            progress: Optional[Progress] = None, stop: Optional[Stop] = None, **keywords) -> Result:
    """Restore, detect and measure; all that came of it.

    image: (height, width), ADU, or an Image; mask, weight, header, psf, name: as in Image.
    columns: of the table, as a .param file has them: "FLUX_AUTO", "FLUX_APER(3)"; none: those of PARAMETERS_NAME, or of
    default.param. detection: another image, on the same pixels, that sources are detected on (dual-image mode).
    config: a configuration file of SExtractor's kind; keywords go before it. Without one no default.sex is read.
    progress(what, done): called now and then, done rises from 0 to 1; an exception in it ends the call. stop(): asked now and
    then, true ends the call (Interrupted). Other threads run meanwhile.
    keywords: those of rextract (man rextract.conf); True is Y, a list goes by commas, None leaves the default.

    What the program warns of is a RextractWarning; the rest of its log goes to logging.getLogger("rextract").
    """
    return Result(_call(image, columns, detection=detection, config=config, mask=mask, weight=weight, header=header, psf=psf,
                        name=name, progress=progress, stop=stop, **keywords))


def restore(image, **options) -> Result:
    """The image without the blur of its PSF: numpy.asarray(result), float32 (height, width), ADU less the sky; with
    result.sky it is what CHECKIMAGE_TYPE RESTORED writes. RESTORE_TYPE chooses the restorer (RL), options are those of extract()."""
    return Result(_call(image, options.pop("columns", ("NUMBER", "X_IMAGE", "Y_IMAGE")), **options))


def detect(image, *, columns: Sequence[str] = DETECT_COLUMNS, **options) -> Table:
    """Sources: positions, shapes (pixels, degrees), isophotal fluxes (ADU) and flags, on the restored image. RESTORE_TYPE="NONE"
    detects on the image as it is. Options are those of extract(), whose Result has the segments too."""
    return _calls_table(image, columns, options)


def measure(image, *, columns: Sequence[str] = (), **options) -> Table:
    """The catalogue that rextract writes of this image: the columns of default.param unless others are named, fluxes in ADU,
    magnitudes of MAG_ZEROPOINT, positions in pixels from 1 and degrees. Options are those of extract()."""
    return _calls_table(image, columns, options)


def templates(image, *, columns: Sequence[str] = TEMPLATE_COLUMNS, **options) -> Table:
    """Template photometry: fluxes (ADU) fitted to the untouched pixels with shapes from the restored ones, P_REAL (probability
    that a source is there), blending, radii (pixels). With `detection` it is forced photometry of another band or epoch.
    Options are those of extract()."""
    return _calls_table(image, columns, options)


def _calls_table(image, columns, options) -> Table:
    memory = _call(image, columns, **options)
    return _table(memory.c.table, memory.facts())


def psf(image, **options) -> PSF:
    """The PSF of the image, measured from its stars unless PSF_TYPE names another: psf(x, y) is its image at a place.
    Options are those of extract() without columns. Errors: InputError where it cannot be known."""
    memory = _call(image, (), psf_only=True, **options)
    field = memory.c.detect
    if field.psf == ffi.NULL:
        raise InputError("the PSF is not known: the image has no usable stars, and no width was stated; give PSF_TYPE and "
                         "PSF_FWHM or PSF_NAME")
    return PSF(memory, field.psf, memory.facts())


def self_check(image, *, columns: Sequence[str] = (), **options) -> SelfCheck:
    """Inject objects into copies of this image (SELF_CHECK_COUNT, SELF_CHECK_MAG ...), and see what is found and how right it
    is. Options are those of extract(). Errors: InputError where nothing can be injected."""
    return SelfCheck(_call(image, columns, **{**options, "SELF_CHECK": True}))


def run(image: Union[str, os.PathLike, Sequence[Union[str, os.PathLike]]], *,
        config: Union[str, os.PathLike, None] = None, progress: Optional[Progress] = None, stop: Optional[Stop] = None,
        **keywords) -> None:
    """rextract IMAGE -c config -KEYWORD value ...: a FITS file in, catalogues, images and reports out. Two images, detection and
    measurement, are a pair. As on the command line, default.sex of the current folder is read where config is None. Lists of
    tiles (@FILE) and RECORD_NAME are the program's. Errors: those of the program; GateError after all outputs are written."""
    names = [image] if isinstance(image, (str, os.PathLike)) else list(image)
    job, talk = Job(config, keywords), Conversation(progress, stop)
    talk.end(lib.rx_job_files(job.c, job.text(",".join(os.fspath(one) for one in names)), talk.log, talk.error), stacklevel=3)
