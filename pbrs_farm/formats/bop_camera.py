"""camera.json of a BOP data set: the size and the K of its pictures. Effects: reads a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, checked
from pbrs_farm.regular_files import MAX_TEXT_BYTES, read_given

_Focal = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Pixels = Annotated[int, Field(gt=0, le=16384)]


class _BopCamera(BaseModel):
    # Other fields, such as depth_scale, are left alone.
    model_config = ConfigDict(frozen=True, extra="ignore")
    fx: _Focal
    fy: _Focal
    cx: Finite
    cy: Finite
    width: _Pixels
    height: _Pixels


def camera_of_bop(path: Path) -> tuple[tuple[int, int], F64]:
    """((width, height), K) of a camera.json, K relative to the first pixel's centre; BadInput."""
    data = read_given(path, MAX_TEXT_BYTES)
    c = checked(_BopCamera, data, path, hint="fx, fy, cx, cy, width, height")
    # Ours counts from the picture's corner: half a pixel more.
    k = np.array([[c.fx, 0, c.cx + 0.5], [0, c.fy, c.cy + 0.5], [0, 0, 1]], np.float64)
    return (c.width, c.height), k
