"""Rextract on arrays: restore an image, detect and measure its sources.

>>> import rextract
>>> table = rextract.measure(pixels, header=header, GAIN=2.5)          # an astropy Table
>>> sharp = rextract.restore(pixels, RESTORE_TYPE="RL", RL_NITER=50)   # numpy.asarray(sharp): the restored image

An image is a two-dimensional array of ADU with its sky, shape (height, width), y first. float32 in the machine's byte
order and C order is used as it is; anything else is converted. Not a number means bad. Positions count from 1 in tables, as
in every catalogue of SExtractor's kind: pixel [0, 0] is centred on X_IMAGE 1, Y_IMAGE 1.

Every keyword of rextract (man rextract.conf) is a keyword argument, in either case: detect_thresh=2, RESTORE_TYPE="NET".
"""
from ._calls import Image, Result, SelfCheck, detect, extract, measure, psf, restore, run, self_check, templates
from ._errors import (DifferentError, Error, GateError, GateUndecidedError, InputError, Interrupted, NotRestoredError,
                      RextractWarning, SomeFailedError, ResourceError, UsageError)
from ._flags import Flag, decode_flags
from ._library import __version__
from ._parquet import to_parquet
from ._psf import PSF

__all__ = ["restore", "detect", "measure", "templates", "extract", "psf", "self_check", "run", "decode_flags",
           "to_parquet", "Image", "Result", "SelfCheck", "PSF", "Flag", "Error", "UsageError", "InputError", "ResourceError",
           "GateError", "GateUndecidedError", "Interrupted", "SomeFailedError", "DifferentError", "NotRestoredError",
           "RextractWarning", "__version__"]
