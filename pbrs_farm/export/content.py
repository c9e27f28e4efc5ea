"""The files of an export by their path, each encoded as its name says. Effects: writes files.

A form gives a table of files and their content for each view; lists that several views share are given a
line at a time.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.formats.hypersim import dataset_bytes
from pbrs_farm.images import exr_from_layers, jpeg_from_array, png_from_array

if TYPE_CHECKING:
    from pbrs_farm.export.chosen_view import Choice, ChosenView
    from pbrs_farm.export.form import WriteViews

_QUALITY: Final = 95  # of JPEG


class Line(str):
    """A line of a list; the lines of all views follow each other, each ended by a line break."""

    __slots__ = ()


Content: TypeAlias = "bytes | str | NDArray[Any] | Mapping[str, Any]"
"""Bytes as they are, text, an array of .png, .jpg, .npy or .hdf5, the planes of .exr, or the table of .json."""
Files: TypeAlias = "Mapping[str, Content]"
"""Path below the folder of an export -> content."""


def encoded(name: str, content: Content) -> bytes:
    """The bytes of a file of that name."""
    suffix = Path(name).suffix
    if isinstance(content, bytes):
        return content
    if isinstance(content, str):
        return content.encode()
    if isinstance(content, Mapping):
        if suffix == ".exr":
            return exr_from_layers(content)
        return (json.dumps(content, indent=1) + "\n").encode()
    if suffix == ".npy":
        data = BytesIO()
        np.save(data, content)
        return data.getvalue()
    if suffix == ".hdf5":
        return dataset_bytes(content)
    return jpeg_from_array(content, _QUALITY) if suffix == ".jpg" else png_from_array(content)


def write_files(out: Path, tables: Iterable[Files], heads: Files | None = None) -> None:
    """Write the files of tables as they come, then the lists whose lines they have; heads: the first lines."""
    lists: dict[str, list[str]] = {}
    for files in chain([heads or {}], tables):
        for name, content in files.items():
            if isinstance(content, Line):
                lists.setdefault(name, []).append(f"{content}\n")
            else:
                _write(out / name, encoded(name, content))
    for name, lines in lists.items():
        _write(out / name, "".join(lines).encode())


def each_view(files_of: Callable[[ChosenView], Files]) -> WriteViews:
    """The writer of a form whose files are those of each view, by `write_files`."""

    def write(views: list[ChosenView], out: Path, _choice: Choice) -> None:
        write_files(out, map(files_of, views))

    return write


def _write(file: Path, data: bytes) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)


def numbers(values: Iterable[float]) -> str:
    """Numbers as text, with nine digits."""
    return " ".join(f"{float(x):.9g}" for x in values)


def rows(matrix: Iterable[Iterable[float]]) -> str:
    """The rows of a matrix as lines of text, with nine digits."""
    return "".join(f"{numbers(row)}\n" for row in matrix)


def parquet_bytes(table: list[dict[str, Any]] | dict[str, list[Any]], schema: Any) -> bytes:
    """The Parquet file of rows, or of columns; schema: pyarrow's, None for its own guess."""
    import pyarrow as pa
    from pyarrow import parquet

    of = pa.Table.from_pydict if isinstance(table, dict) else pa.Table.from_pylist
    data = pa.BufferOutputStream()
    parquet.write_table(of(table, schema), data)
    content: bytes = data.getvalue().to_pybytes()
    return content


def rgb_planes(image: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The planes R, G and B of an image (H, W, 3), for an .exr."""
    return dict(zip("RGB", np.moveaxis(image, -1, 0), strict=True))
