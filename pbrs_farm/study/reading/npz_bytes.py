"""Arrays <-> deflated .npz bytes without a clock, as webdataset and numpy read them; no effects."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput

_DATE: Final = (1980, 1, 1, 0, 0, 0)  # the first a zip file can hold
_LEVEL: Final = 6


def npz_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """.npz bytes; equal arrays give equal bytes."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", _DATE)
            member.compress_type = zipfile.ZIP_DEFLATED
            part = io.BytesIO()
            np.lib.format.write_array(part, np.ascontiguousarray(array), allow_pickle=False)
            archive.writestr(member, part.getbuffer())
    return whole.getvalue()


def arrays_of_npz(data: bytes, place: str) -> dict[str, NDArray[Any]]:
    """Name -> array; BadInput, naming place, where data is no .npz or is damaged."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (
        OSError,
        ValueError,
        KeyError,
        EOFError,
        AttributeError,
        zipfile.BadZipFile,
        zlib.error,
    ):
        raise BadInput(place, "", "not an .npz of arrays, or damaged") from None
