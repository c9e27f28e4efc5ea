"""Random streams fixed to surfaces while a camera moves, so that noise does not swim in a film; no effects.

A pixel takes over the stream of the pixel that showed its surface point one frame earlier, and shifts the
stream's positions within the pixel, so that most samples start at the same points of the surface as before.
Every twentieth frame is an anchor, at which streams begin, so a frame needs forty frames' cameras at most.
Between two anchors, pixels switch to the later one's streams at different times, each once: noise changes
gradually from frame to frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, I64
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import opencv_world_from_camera
from pbrs_farm.core.shot import MOST_FRAMES

_SAME_POINT: Final = (
    0.03  # of its distance: points of two frames nearer to each other are one surface's
)
_OFFSET_STEPS: Final = (
    4096.0  # of a pixel, in float32 without rounding: a static camera has the same noise
)


class FilmFrame(NamedTuple):
    """A frame of a film."""

    number: int
    camera: Camera  # at the picture's size
    time_s: float | None


@dataclass(frozen=True, slots=True, eq=False)
class NoiseAnchors:
    """The frames of a film from an anchor to a frame."""

    frames: tuple[FilmFrame, ...]  # in order; some may be missing, also an anchor
    first: int  # number of the earlier anchor in the film
    later: int  # frames from it to the later one; 0 = no later one
    share: float  # of pixels that have gone over to the later one's streams, 0..1
    eye: str = ""  # the rig's camera whose film it is


class SurfaceStreams(NamedTuple):
    """Streams of random numbers of N pixels."""

    names: NDArray[np.uint32]  # (N,)
    shifts: (
        F32  # (N, 2) right and down, px in [0, 1), taken off a stream's positions within the pixel
    )


class _Chain(NamedTuple):
    """Streams that began at an anchor."""

    anchor: int
    names: NDArray[np.uint64]  # (N,)
    shifts: F32  # (N, 2) px in [0, 1)


class StreamWalk:
    """The streams of a film, frame by frame; remembers those of the last frame."""

    def __init__(self) -> None:
        self._frames: list[FilmFrame] = []
        self._first = self._later = -1
        self._points: F32 = np.zeros((0, 3), np.float32)  # (N, 3) of the last frame
        self._chains: list[_Chain] = []

    def streams(
        self, anchors: NoiseAnchors, points_of: Callable[[Camera, float | None], F32]
    ) -> SurfaceStreams:
        """The streams of the last frame of anchors; the same whichever frames were asked for before.

        points_of: (N, 3) surface points at a frame's pixel centres, world, metres; not finite without one.
        """
        if not self._leads_to(anchors):
            self._frames, self._chains = [], []
            self._first, self._later = anchors.first, anchors.later
        for frame in anchors.frames[len(self._frames) :]:
            self._go_on(frame, points_of(frame.camera, frame.time_s))
        early, late = self._chains[0], self._chains[-1]
        has_gone = (early.names & np.uint64(0xFFFFFFFF)) < anchors.share * 2.0**32
        names = np.where(has_gone, late.names, early.names)
        shifts = np.where(has_gone[:, None], late.shifts, early.shifts)
        # Names of a chain are mixed, so their halves are random.
        return SurfaceStreams((names >> np.uint64(32)).astype(np.uint32), shifts)

    def _leads_to(self, anchors: NoiseAnchors) -> bool:
        """True if the frames so far are the first ones of anchors."""
        if (self._first, self._later) != (anchors.first, anchors.later):
            return False
        return len(self._frames) <= len(anchors.frames) and all(
            (a.number, a.time_s) == (b.number, b.time_s)
            and a.camera.intrinsics == b.camera.intrinsics
            and np.array_equal(a.camera.world_from_camera, b.camera.world_from_camera)
            for a, b in zip(self._frames, anchors.frames, strict=False)
        )  # fmt: skip

    def _go_on(self, frame: FilmFrame, points: F32) -> None:
        """Take over streams from the frame before; those of an anchor begin there, or at the first frame after it."""
        if self._frames:
            matches = _matches(points, self._points, self._frames[-1].camera)
            self._chains = [
                _taken_over(chain, _new_names(chain.anchor, frame.number, points), matches)
                for chain in self._chains
            ]
        anchors = sorted({self._first, self._first + self._later})
        for anchor in anchors[len(self._chains) :]:
            if anchor <= frame.number:
                names = _new_names(anchor, frame.number, points)
                self._chains.append(_Chain(anchor, names, np.zeros((len(points), 2), np.float32)))
        self._frames.append(frame)
        self._points = points


class _Matches(NamedTuple):
    """Pixels of a frame and of the one before that show a point of a surface, each once."""

    pixels: I64  # (M,) of the frame
    before: I64  # (M,) of the one before
    offsets: F32  # (M, 2) px from the point's projection there to that pixel's centre


def _matches(points: F32, points_before: F32, camera: Camera) -> _Matches:
    """points: (N, 3) of a frame; points_before: of the frame before, which camera took."""
    finite = np.flatnonzero(np.isfinite(points).all(1))
    # Turn axis by axis: a product with a 3 x 3 matrix takes four times the CPU.
    x, y, z = (points[finite] - camera.eye).T
    axes = opencv_world_from_camera(camera.world_from_camera)[:3, :3].T
    local = np.stack([x * a[0] + y * a[1] + z * a[2] for a in axes], -1)
    px = camera.intrinsics.pixels(local)
    width, height = camera.intrinsics.width_px, camera.intrinsics.height_px
    is_inside = ((px >= 0) & (px < (width, height))).all(1)  # NaN is not
    pixels, px, local = finite[is_inside], px[is_inside], local[is_inside]
    column, row = px.astype(np.int64).T
    before = row * width + column
    # Leave out what another surface hid.
    gap = ((points_before[before] - points[pixels]) ** 2).sum(1)
    is_same = gap < _SAME_POINT**2 * (local**2).sum(1)  # no point there: infinite
    pixels, before = pixels[is_same], before[is_same]
    offsets = np.floor(px[is_same]) + 0.5 - px[is_same]
    offsets = np.rint(offsets * _OFFSET_STEPS) / _OFFSET_STEPS
    # Of several pixels the one nearest to the centre takes over.
    order = np.lexsort(((offsets**2).sum(1), before))
    is_first = np.append(True, np.diff(before[order]) > 0)[: len(order)]
    nearest = order[is_first]
    return _Matches(pixels[nearest], before[nearest], offsets[nearest].astype(np.float32))


def _taken_over(chain: _Chain, names: NDArray[np.uint64], matches: _Matches) -> _Chain:
    """A chain one frame later; names: of new streams, for pixels without a match."""
    shifts = np.zeros_like(chain.shifts)
    names[matches.pixels] = chain.names[matches.before]
    shifts[matches.pixels] = np.mod(chain.shifts[matches.before] - matches.offsets, 1)
    return chain._replace(names=names, shifts=shifts)


def _new_names(anchor: int, number: int, points: F32) -> NDArray[np.uint64]:
    """(N,) names of streams that begin in a frame; where no surface is seen, all frames have the same."""
    has_surface = np.isfinite(points).all(1)
    places = np.where(has_surface, anchor * MOST_FRAMES + number, (anchor + 1) * -MOST_FRAMES)
    pixels: NDArray[np.uint64] = np.arange(len(points), dtype=np.uint64)
    return _mixed(_mixed(places.astype(np.uint64)) + pixels)


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """64 bits that look random of each number, by splitmix64 (Steele, Lea, Flood 2014)."""
    x = values + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(x ^ (x >> np.uint64(31)))
