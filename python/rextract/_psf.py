"""The point spread function of an image."""
from __future__ import annotations

import numpy as np

from ._library import ffi, lib, text_of


class PSF:
    """The PSF of an image, at every place of it. Where psf() gave it, the `psf=` of other calls takes it, and it is not
    measured again.

    fwhm (pixels), ellipticity (1 - b/a), beta (of a Moffat, else 0), size (pixels, odd), nstars, fwhm_error (pixels, 0:
    unknown), how ("PIXELS", "MOFFAT" ...: RXPSFHOW of man rextract; "" where it was not measured), stars (array (nstars, 2)
    of x, y from 0), facts (dict of the cards RXPSF...).
    """

    def __init__(self, owner, pointer, facts=None):
        self._owner, self._c = owner, pointer  # whose memory it is
        self.fwhm: float = pointer.fwhm
        self.ellipticity: float = pointer.ellipticity
        self.beta: float = pointer.beta
        self.size: int = pointer.size
        self.nstars: int = pointer.nstars
        self.fwhm_error: float = pointer.fwhm_error
        self.how: str = text_of(lib.rx_psf_how_name(pointer.quality.how))
        self.facts: dict = facts or {}
        n = pointer.nstars if pointer.stars != ffi.NULL else 0
        self.stars = np.empty((n, 2))
        if n:
            self.stars[:] = np.frombuffer(ffi.buffer(pointer.stars, 16 * n), dtype=np.float64).reshape(n, 2)

    def __call__(self, x: float, y: float) -> np.ndarray:
        """The PSF at pixel (x, y), which count from 0: float32 (size, size), of sum 1, its centre in the middle pixel."""
        stamp = np.empty((self.size, self.size), dtype=np.float32)
        lib.rx_psf_at(self._c, x, y, ffi.cast("float *", stamp.ctypes.data))
        return stamp

    def flux_error(self, x: float, y: float) -> float:
        """Relative error (1 sigma) that the PSF leaves in the flux of a point source there; 0: not known."""
        return lib.rx_psf_flux_error(self._c, x, y)

    def __repr__(self):
        return f"<PSF: {text_of(self._c.description)}>"
