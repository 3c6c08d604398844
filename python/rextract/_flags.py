"""Columns of flags in words."""
from __future__ import annotations

from typing import NamedTuple

from ._errors import UsageError
from ._library import ffi, lib, text_of


class Flag(NamedTuple):
    """A bit of a column of flags."""

    bit: int  #: 1, 2, 4 ...
    name: str  #: SATURATED
    meaning: str  #: "at least one pixel is saturated"


def _read():
    n = ffi.new("int *")
    rows = lib.rx_flags(n)
    columns: dict[str, list[Flag]] = {}
    for row in ffi.unpack(rows, n[0]):
        columns.setdefault(text_of(row.column), []).append(Flag(row.bit, text_of(row.name), text_of(row.meaning)))
    return columns


_COLUMNS = _read()


def decode_flags(value: int, column: str = "FLAGS") -> list[Flag]:
    """The bits that are set in `value` of a column of flags: FLAGS, FLAGS_WEIGHT, FLAGS_WIN, FLAGS_MEASURE, FLAGS_TEMPLATE
    or FLAGS_RESTORE. A bit that the column does not have is an error, for then it is another column's value.

    >>> [flag.name for flag in rextract.decode_flags(19)]
    ['CROWDED', 'MERGED', 'APERTURE']
    """
    known = _COLUMNS.get(column.upper())
    if known is None:
        raise UsageError(f"'{column}' is no column of flags; these are {', '.join(_COLUMNS)}")
    value = int(value)
    every = sum(flag.bit for flag in known)
    if value < 0 or value & ~every:
        raise UsageError(f"{value} is no value of {column.upper()}, whose bits are 1 to {known[-1].bit}")
    return [flag for flag in known if value & flag.bit]
