"""What all calls have in common: the library, its log and its errors."""
from __future__ import annotations

import logging
import os
import warnings
from importlib.metadata import version
from typing import Any, Callable, Optional

from ._errors import BY_STATUS, Error, RextractWarning
from ._librextract import ffi, lib

__version__ = version("rextract")

_found = ffi.string(lib.rx_job_version()).decode()
if _found != __version__:
    raise ImportError(f"this package was built with librextract {__version__}, and librextract {_found} is installed; build "
                      "it again (pip wheel)")

logger = logging.getLogger("rextract")

Progress = Callable[[str, float], Any]
Stop = Callable[[], bool]


class Conversation:
    """What a call says while it runs, and what it is asked. Warnings wait for its end, for one may be an error to the caller;
    an exception in a callback, Ctrl-C among them, ends the call and is raised there."""

    def __init__(self, progress: Optional[Progress] = None, stop: Optional[Stop] = None):
        self.progress, self.stop = progress, stop
        self.warnings: list[str] = []
        self.raised: Optional[BaseException] = None
        self.handle = ffi.new_handle(self)
        self.log = ffi.new("rx_log *")
        level = lib.RX_FULL if logger.isEnabledFor(logging.DEBUG) else lib.RX_NORMAL
        lib.rx_log_calls(self.log, level, lib.rextract_message, lib.rextract_progress, self.handle)
        self.error = ffi.new("rx_error *")
        self.error.hdu = -1
        self.error.stop = lib.rextract_stop
        self.error.user = self.handle

    def end(self, status: int, stacklevel: int = 4) -> None:
        """Raise what went wrong; else warn of what there is to warn of."""
        if self.raised is not None:
            raise self.raised
        if status == lib.RX_OK:
            for text in self.warnings:
                warnings.warn(text, RextractWarning, stacklevel=stacklevel)
            return
        line = ffi.new("char[2048]")
        lib.rx_error_format(self.error, b"", line, 2048)
        err, text = self.error, ffi.string(line).decode(errors="replace")
        where = ffi.string(err.where).decode(errors="replace")
        raise BY_STATUS.get(int(status), Error)(text[2:] if text.startswith(": ") else text, where,
                                                err.hdu if where and err.hdu >= 0 else None,
                                                err.line if where and err.line > 0 else None)


def _keep(kind, value, trace):
    """An exception in a callback. `trace` holds its frame, which knows the conversation."""
    frame = trace.tb_frame if trace is not None else None
    talk = ffi.from_handle(frame.f_locals["user"]) if frame is not None and "user" in frame.f_locals else None
    if talk is not None and talk.raised is None:
        talk.raised = value


@ffi.def_extern(error=True, onerror=_keep)
def rextract_stop(user):
    talk = ffi.from_handle(user)
    return talk.raised is not None or (talk.stop is not None and bool(talk.stop()))


@ffi.def_extern(onerror=_keep)
def rextract_message(user, kind, text):
    talk = ffi.from_handle(user)
    said = ffi.string(text).decode(errors="replace")
    if kind == lib.RX_LOG_WARNING:
        talk.warnings.append(said)
    else:
        logger.log(logging.INFO if kind == lib.RX_LOG_INFO else logging.DEBUG, "%s", said)


@ffi.def_extern(onerror=_keep)
def rextract_progress(user, what, done):
    talk = ffi.from_handle(user)
    if talk.progress is not None and talk.raised is None:
        talk.progress(ffi.string(what).decode(errors="replace"), done)


def words(value: Any) -> str:
    """A keyword's value as the command line has it."""
    if isinstance(value, bool):
        return "Y" if value else "N"
    if isinstance(value, (list, tuple)):
        return ",".join(words(item) for item in value)
    if isinstance(value, (str, bytes, os.PathLike)):
        return os.fsdecode(value)
    kind = type(value)
    if kind.__module__ == "numpy":  # numpy.bool_, numpy.float64, arrays: their plain selves
        return words(value.tolist())
    return repr(value)


class Job:
    """An rx_job and the memory behind it."""

    def __init__(self, config, keywords: dict, columns=()):
        self.settings = {name.upper(): words(value) for name, value in keywords.items() if value is not None}
        if len(self.settings) != sum(value is not None for value in keywords.values()):
            raise BY_STATUS[2]("a keyword is given twice, in upper and in lower case")
        self._kept: list[Any] = []
        self.c = ffi.new("rx_job *")
        pairs = ffi.new("rx_job_setting[]", len(self.settings) or 1)
        for pair, (name, value) in zip(pairs, self.settings.items()):
            pair.name, pair.value = self.text(name), self.text(value)
        names = ffi.new("char *[]", [self.text(name) for name in columns] or 1)
        self._kept += [pairs, names]
        self.c.config = self.text(os.fspath(config)) if config is not None else ffi.NULL
        self.c.settings, self.c.nsettings = pairs, len(self.settings)
        self.c.columns, self.c.ncolumns = names, len(columns)

    def text(self, value):
        data = os.fsencode(value)
        if b"\0" in data:
            raise BY_STATUS[2](f"{value!r} holds a NUL character")
        self._kept.append(ffi.new("char[]", data))
        return self._kept[-1]


def text_of(data) -> str:
    """Of a char array or pointer."""
    return ffi.string(data).decode(errors="replace")
