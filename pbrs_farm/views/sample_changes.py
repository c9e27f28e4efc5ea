"""Flip, crop and resize samples, and change their axes: normals and K follow the picture; no effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest
from pbrs_farm.views.normal_axes import axes_from_axes
from pbrs_farm.views.view_sample import Sample


def flip(sample: Sample) -> Sample:
    """Mirror the view: swap left and right in every array.

    The x of normals changes its sign and K's cx moves, so that the sample is a valid view of the
    mirrored room.
    """
    width = sample.size[0]
    arrays: dict[str, Any] = {n: a[:, ::-1] for n, a in sample.arrays().items()}
    if sample.normal is not None:
        # x points right in all named axes.
        arrays["normal"] = arrays["normal"] * np.array([-1, 1, 1], np.float32)
    k = sample.K.copy()
    k[0, 2] = width - k[0, 2]
    return replace(sample, K=k, **_contiguous(arrays))


def crop(sample: Sample, left: int, top: int, width: int, height: int) -> Sample:
    """Crop width x height pixels at (left, top); K's principal point moves.

    The arrays are copies. Raises BadInput for an empty rectangle, or one not wholly inside. Boxes and
    masks made from the whole sample do not follow.
    """
    full_width, full_height = sample.size
    fits = 0 <= left <= full_width - width and 0 <= top <= full_height - height
    if not fits or width < 1 or height < 1:
        text = f"{width}x{height} at ({left}, {top}) is not inside {full_width}x{full_height}"
        raise BadInput("crop", sample.id, text)
    part = (slice(top, top + height), slice(left, left + width))
    k = sample.K.copy()
    k[:2, 2] -= (left, top)
    return replace(sample, K=k, **_contiguous({n: a[part] for n, a in sample.arrays().items()}))


def resize(sample: Sample, width: int, height: int) -> Sample:
    """Resample the sample: colour by area, boundaries if the cell contains any, all other labels nearest.

    K is scaled, also if the aspect ratio changes.
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
        sample, K=resize_k(sample.K, (full_width, full_height), (width, height)), **arrays
    )


def resize_k(
    k: NDArray[np.float32], of: tuple[int, int], to: tuple[int, int]
) -> NDArray[np.float32]:
    """K (3, 3) of a picture of size `of` (width, height) for the same picture of size `to`.

    Returns float32. Pixel centres are at +0.5, so the principal point scales with the size. Not for a
    crop, which moves it.
    """
    scale = np.array([to[0] / of[0], to[1] / of[1], 1], np.float64)
    return np.asarray(k.astype(np.float64) * scale[:, None], np.float32)


def with_axes(sample: Sample, axes: str) -> Sample:
    """The sample with its normals in the axes of that name; unchanged if they are already.

    axes: "opencv", "opengl" or "published". Values are swapped and negated, never rounded.
    """
    if sample.normal is None or sample.axes == axes:
        return replace(sample, axes=axes)
    matrix = axes_from_axes(axes, sample.axes)
    # Index and negate instead of multiplying, so that no bit is rounded.
    columns, signs = np.abs(matrix).argmax(1), matrix.sum(1)
    normal = sample.normal[..., columns] * signs
    # Turn -0 into 0.
    return replace(sample, axes=axes, normal=np.asarray(normal + np.float32(0), np.float32))


def _contiguous(arrays: dict[str, NDArray[Any]]) -> dict[str, Any]:
    return {name: np.ascontiguousarray(array) for name, array in arrays.items()}
