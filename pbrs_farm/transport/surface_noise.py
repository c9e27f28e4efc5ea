"""Random streams fixed to surfaces while a camera moves, so that noise does not swim in a film; no effects.

Two frames of a film, the anchors, provide the random numbers of their pixels: a surface point has the stream of the
pixel at its projection into an anchor's camera, visible there or not. Between the anchors, points switch to the
later one at different times, each once: noise changes gradually from frame to frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import opencv_world_from_camera

Streams = NDArray[np.uint32]
_OWN: Final = 1 << 62  # added to the number of a pixel whose point no anchor has before it
_REACH_PX: Final = (
    1 << 24
)  # maximum distance from the corner of an anchor's picture at which pixels are distinguished


@dataclass(frozen=True, slots=True, eq=False)
class NoiseAnchors:
    """The frames whose pixels name the streams of a frame between them."""

    cameras: tuple[Camera, Camera]  # the earlier one and the later one, at the picture's size
    numbers: tuple[int, int]  # of these frames
    share: float  # of points that have gone over to the later one, 0..1


def surface_streams(points: NDArray[np.floating], anchors: NoiseAnchors) -> Streams:
    """(N,) a stream of random numbers for each pixel, from its surface point.

    points: (N, 3) world, metres, in the pixels' order; not finite for pixels without one. If several points
    project to one pixel of the anchor the first gets its stream, the others get separate ones.
    Deterministic to the bit.
    """
    early, late = (
        _cells(points, camera, number)
        for camera, number in zip(anchors.cameras, anchors.numbers, strict=True)
    )
    has_gone = (early & np.uint64(0xFFFFFFFF)) < anchors.share * 2.0**32
    cells = np.where(has_gone, late, early)
    # Tell apart the pixels of one cell: a denoiser takes two with the same noise for something seen.
    named = _mixed(cells + _places_among_equals(cells))
    return (named >> np.uint64(32)).astype(np.uint32)


def _places_among_equals(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """(N,) number of equal values before each one."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    place = np.arange(len(ordered))
    is_first = np.append(True, ordered[1:] != ordered[:-1])
    places = np.empty(len(ordered), np.uint64)
    places[order] = place - np.maximum.accumulate(np.where(is_first, place, 0))
    return places


def _cells(points: NDArray[np.floating], camera: Camera, number: int) -> NDArray[np.uint64]:
    """(N,) 64-bit identifier of the anchor's pixel that each point projects to."""
    cell = _OWN + np.arange(len(points))
    finite = np.flatnonzero(np.isfinite(points).all(1))
    # Turn axis by axis: a product with a 3 x 3 matrix takes four times the CPU.
    x, y, z = (points[finite] - camera.eye).T
    axes = opencv_world_from_camera(camera.world_from_camera)[:3, :3].T
    local = np.stack([x * a[0] + y * a[1] + z * a[2] for a in axes], -1)
    px = np.floor(camera.intrinsics.pixels(local)) + _REACH_PX
    in_reach = ((px >= 0) & (px < 2 * _REACH_PX)).all(1)  # NaN is not
    column, row = px[in_reach].astype(np.int64).T
    cell[finite[in_reach]] = row * (2 * _REACH_PX) + column
    return _mixed(cell.astype(np.uint64) ^ _mixed(np.array([number], np.uint64)))


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """64 bits that look random of each number, by splitmix64 (Steele, Lea, Flood 2014)."""
    x = values + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(x ^ (x >> np.uint64(31)))
