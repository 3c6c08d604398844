"""Catalogues as Parquet, where pyarrow is installed."""
from __future__ import annotations

import json
import os
from typing import Union

import numpy as np
from astropy.table import Table

from ._errors import UsageError


def to_parquet(table: Table, path: Union[str, os.PathLike], **options) -> None:
    """Write a table as a Parquet file. Every column has its unit, description and UCD in the metadata of its field ("unit",
    "description", "ucd"), the file those of the table under "rextract" (JSON: the facts of the run, RXREST ...). Vectors are
    lists of fixed size. `options` go to pyarrow.parquet.write_table(). Needs pyarrow (pip install pyarrow).
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as why:
        raise ImportError("to_parquet() needs pyarrow; pip install pyarrow, or write FITS: table.write('out.fits')") from why
    fields, arrays = [], []
    for name in table.colnames:
        column = table[name]
        values = np.ma.asarray(column.data)
        if values.ndim > 2:
            raise UsageError(f"{name} holds images of {values.shape[1:]} pixels, which Parquet has no type for; leave it out")
        flat = np.ascontiguousarray(values.data.reshape(-1), dtype=values.dtype.newbyteorder("="))
        hidden = np.ma.getmaskarray(values).reshape(-1)
        data = pyarrow.array(flat, mask=hidden if hidden.any() else None)
        if values.ndim == 2:
            data = pyarrow.FixedSizeListArray.from_arrays(data, values.shape[1])
        about = {"unit": str(column.unit or ""), "description": column.description or "", "ucd": column.meta.get("ucd", "")}
        fields.append(pyarrow.field(name, data.type, metadata={key: text for key, text in about.items() if text}))
        arrays.append(data)
    schema = pyarrow.schema(fields, metadata={"rextract": json.dumps(dict(table.meta), default=str)})
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=schema), os.fspath(path), **options)
