"""A view's arrays as they are trained on, and what is asked of a view; frozen values, no effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest

# Normals as stored (16 bits) <-> unit vectors in camera axes by name.
# Stored normals are round((n + 1) 65535 / 2) in the published axes (docs/formats.md).


# Name -> for x, y and z: which published axis it is (0 right, 1 forward, 2 up), and its sign.
AXES: Final[dict[str, tuple[tuple[int, int], ...]]] = {
    "opencv": ((0, 1), (2, -1), (1, 1)),  # right, down, forward
    "opengl": ((0, 1), (2, 1), (1, -1)),  # right, up, backward
    "published": ((0, 1), (1, 1), (2, 1)),  # right, forward, up
}


def axes_from_published(axes: str) -> NDArray[np.float32]:
    """(3, 3) matrix: n in the axes of that name = matrix @ n in published axes."""
    matrix = np.zeros((3, 3), np.float32)
    for row, (column, sign) in enumerate(AXES[axes]):
        matrix[row, column] = sign
    return matrix


def axes_from_axes(to: str, of: str) -> NDArray[np.float32]:
    """(3, 3) matrix: n in the axes `to` = matrix @ n in the axes `of`."""
    return axes_from_published(to) @ axes_from_published(of).T


def decoded_normal(
    stored: NDArray[np.uint16], valid: NDArray[np.bool_], axes: str
) -> NDArray[np.float32]:
    """(H, W, 3) float32 normals in the axes of that name, of unit length within 3e-5; 0 if not valid."""
    normal = np.empty(stored.shape, np.float32)
    # Each published channel becomes an axis, turned round where the sign says.
    for axis, (channel, sign) in enumerate(AXES[axes]):
        own = normal[..., axis]
        np.multiply(stored[..., channel], np.float32(sign * 2 / 65535), out=own)
        own -= np.float32(sign)
    if not valid.all():
        normal[~valid] = 0
    return normal


def encoded_as_stored(
    normal: NDArray[np.float32], valid: NDArray[np.bool_], axes: str
) -> NDArray[np.uint16]:
    """(H, W, 3) uint16 as views store them, of normals in the axes of that name; 32768 if not valid."""
    stored = np.full(normal.shape, 32768, np.uint16)
    for axis, (channel, sign) in enumerate(AXES[axes]):
        scaled = (sign * normal[..., axis].astype(np.float64) + 1) * (65535 / 2)
        stored[..., channel][valid] = np.clip(np.rint(scaled), 0, 65535).astype(np.uint16)[valid]
    return stored


# A view's arrays as they are trained on, and what is asked of a view.


# What can be asked of a view. "normal" brings "valid" along.
LAYERS: Final = ("colour", "normal", "depth", "class40", "instance", "boundary")
MODES: Final = tuple(str(mode) for mode in Mode)

Size = tuple[int, int]  # width, height in pixels


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One view in one lighting mode: all arrays are (H, W, ...); a layer not asked for is None.

    Pixel (row 0, column 0) is top left and its centre lies at (0.5, 0.5). K maps
    (x right, y down, z forward) to pixels, whatever the axes of the normals.
    """

    id: str  # <house>/<view>
    house: str
    room: str
    mode: str  # of colour
    K: NDArray[np.float32]  # (3, 3)
    axes: str  # of normal: a name of AXES
    colour: NDArray[np.uint8] | None = None  # (H, W, 3) sRGB
    normal: NDArray[np.float32] | None = None  # (H, W, 3) unit in camera axes; 0 where not valid
    valid: NDArray[np.bool_] | None = None  # (H, W) where normal is known
    depth: NDArray[np.float32] | None = None  # (H, W) metres along the axis; 0 = nothing
    class40: NDArray[np.uint8] | None = None  # (H, W) NYU40 id, 0 = none
    instance: NDArray[np.uint16] | None = None  # (H, W) 0 = nothing
    boundary: NDArray[np.bool_] | None = None  # (H, W) instances meet here

    @property
    def size(self) -> Size:
        """Width and height of the first array there is, in pixels; (0, 0) without any."""
        first = next(iter(self.arrays().values()), np.zeros((0, 0)))
        return int(first.shape[1]), int(first.shape[0])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays there are, by field; valid beside normal."""
        named = ((name, getattr(self, name)) for name in (*LAYERS, "valid"))
        return {name: array for name, array in named if array is not None}


@dataclass(frozen=True, slots=True)
class SampleRequest:
    """What to read of a view. Raises BadInput for a layer, mode, axes or size that cannot be.

    mode: of colour. axes: of normals. size: (width, height) to resize to, None as stored.
    """

    layers: tuple[str, ...] = ("colour", "normal")
    mode: str = "mlt_il_ol"
    axes: str = "opencv"
    size: Size | None = None

    def __post_init__(self) -> None:
        for layer in self.layers:
            if layer not in LAYERS:
                raise BadInput("layers", layer, "no such layer", hint=f"of {', '.join(LAYERS)}")
        if self.mode not in MODES:
            hint = f"of {', '.join(MODES)}"
            raise BadInput("mode", self.mode, "no such lighting mode", hint=hint)
        if self.axes not in AXES:
            raise BadInput("axes", self.axes, "no such axes", hint=f"of {', '.join(AXES)}")
        if self.size is not None and min(self.size) < 1:
            raise BadInput("size", str(self.size), "expected a width and height of 1 or more")


# Samples flipped, cropped, resized and in other axes: normals and K follow the picture.


def flipped(sample: Sample) -> Sample:
    """The view in a mirror: left and right change places, normals turn x round, K's cx moves."""
    width = sample.size[0]
    arrays: dict[str, Any] = {n: a[:, ::-1] for n, a in sample.arrays().items()}
    if sample.normal is not None:
        # In all axes that have a name x points right.
        arrays["normal"] = arrays["normal"] * np.array([-1, 1, 1], np.float32)
    k = sample.K.copy()
    k[0, 2] = width - k[0, 2]
    return replace(sample, K=k, **_contiguous(arrays))


def cropped(sample: Sample, left: int, top: int, width: int, height: int) -> Sample:
    """The part of width x height pixels at (left, top); K's principal point moves. Raises BadInput."""
    full_width, full_height = sample.size
    fits = 0 <= left <= full_width - width and 0 <= top <= full_height - height
    if not fits or width < 1 or height < 1:
        text = f"{width}x{height} at ({left}, {top}) lies not inside {full_width}x{full_height}"
        raise BadInput("crop", sample.id, text)
    part = (slice(top, top + height), slice(left, left + width))
    k = sample.K.copy()
    k[:2, 2] -= (left, top)
    return replace(sample, K=k, **_contiguous({n: a[part] for n, a in sample.arrays().items()}))


def resized(sample: Sample, width: int, height: int) -> Sample:
    """The sample on another grid: colour by area, boundaries where any is, all other labels nearest.

    K is scaled, also where the sides' ratio changes.
    """
    full_width, full_height = sample.size
    if (full_width, full_height) == (width, height):
        return sample
    arrays: dict[str, Any] = {}
    for name, array in sample.arrays().items():
        if name == "colour":
            arrays[name] = resized_by_area(array, width, height)
        elif name == "boundary":
            arrays[name] = resized_any(array, width, height)
        else:
            arrays[name] = resized_nearest(array, width, height)
    return replace(
        sample, K=k_resized(sample.K, (full_width, full_height), (width, height)), **arrays
    )


def k_resized(
    k: NDArray[np.float32], of: tuple[int, int], to: tuple[int, int]
) -> NDArray[np.float32]:
    """K (3, 3) of a picture of size `of` (width, height) for the same picture of size `to`."""
    scale = np.array([to[0] / of[0], to[1] / of[1], 1], np.float64)
    return np.asarray(k.astype(np.float64) * scale[:, None], np.float32)


def with_axes(sample: Sample, axes: str) -> Sample:
    """The sample with its normals in the axes of that name."""
    if sample.normal is None or sample.axes == axes:
        return replace(sample, axes=axes)
    matrix = axes_from_axes(axes, sample.axes)
    # The axes change places and signs only: pick them, so that no bit is rounded.
    columns, signs = np.abs(matrix).argmax(1), matrix.sum(1)
    normal = sample.normal[..., columns] * signs
    # Keep a zero a zero without a sign.
    return replace(sample, axes=axes, normal=np.asarray(normal + np.float32(0), np.float32))


def _contiguous(arrays: dict[str, NDArray[Any]]) -> dict[str, Any]:
    return {name: np.ascontiguousarray(array) for name, array in arrays.items()}
