"""The two sets that are compared: views of ours, and photographs with or without depth. Effects: reads files."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_by_area, resized_nearest
from pbrs_farm.curate.photographs import PhotoFiles, has_depth, pairs_in
from pbrs_farm.study.comparing.picture_facts import PictureFacts, facts_of
from pbrs_farm.study.judging.photo_predictions import SUFFIXES, read_photograph
from pbrs_farm.study.photographs import middle_of_form
from pbrs_farm.study.real_frames import camera_of, has_labels_of, nyu40_of, read_pair
from pbrs_farm.study.training.view_sources import is_root
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.views import Frame

WIDEST_PX: Final = 256
_FORM: Final = (4, 3)
_LEAST: Final = 2  # pictures of a set
Size = tuple[int, int]  # width, height


@dataclass(frozen=True, slots=True)
class PictureSet:
    """What is known of each picture of a set, and which could not be read."""

    place: str
    pictures: tuple[PictureFacts, ...]
    left_out: tuple[str, ...] = ()  # a line each
    credits: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def size_of_views(place: str) -> Size:
    """(width, height) in which a root's views and photographs are compared: 4 x 3, at most 256 wide."""
    frame = _frames(place, 1)[0]
    _, columns = middle_of_form(frame.size[1], frame.size[0], *_FORM)
    width = min(WIDEST_PX, columns.stop - columns.start)
    return width, round(width * _FORM[1] / _FORM[0])


def read_views(place: str, size: Size, *, mode: str = "", most: int = 0) -> PictureSet:
    """The views of an output root or of shards, at most so many, spread over all; mode "" = the best there is.

    Raises BadInput for a place with fewer than two views. A view that cannot be read is left out.
    """
    frames = _frames(place, most)
    found: list[PictureFacts] = []
    left_out: list[str] = []
    for frame in frames:
        try:
            found.append(_facts_of_frame(frame, size, mode))
        except BadInput as error:
            left_out.append(str(error))
    _check(place, found, left_out)
    of_homes = getattr(frames[0].source, "credits", None)
    homes = dict.fromkeys(frame.ref.house for frame in frames)
    credits = tuple(of_homes(list(homes))) if of_homes else ()
    return PictureSet(place, tuple(found), tuple(left_out), credits)


def _frames(place: str, most: int) -> list[Frame]:
    frames = [frame for frame in open_views(place) if not frame.ref.is_object]
    if len(frames) < _LEAST:
        raise BadInput(
            place, "", f"holds {len(frames) or 'no'} view, {_LEAST} at least are compared"
        )
    return _spread(frames, most)


def _spread(found: list[Any], most: int) -> list[Any]:
    if not most or len(found) <= most:
        return found
    return [found[round(k * (len(found) - 1) / max(most - 1, 1))] for k in range(most)]


def _facts_of_frame(frame: Frame, size: Size, mode: str) -> PictureFacts:
    colour = frame.picture(mode) if mode else frame.colour
    layers = frame.layers
    depth = frame.depth if "depth" in layers else None
    classes = frame.classes if {"semantic", "class40"} & set(layers) else None
    return _fitted(frame.id, frame.ref.house, colour, size, depth, frame.k, classes)


def _fitted(
    id: str, group: str, colour: Srgb8Image, size: Size, depth_m: NDArray[Any] | None = None,
    K: F64 | None = None, class40: NDArray[np.uint8] | None = None,
) -> PictureFacts:  # fmt: skip
    """The middle of a picture at the size of all; BadInput where it is smaller."""
    rows, columns = middle_of_form(colour.shape[0], colour.shape[1], *size)
    wide = columns.stop - columns.start
    if wide < size[0]:
        shown = f"{colour.shape[1]}x{colour.shape[0]}"
        raise BadInput(id, "", f"{shown} pixels, {size[0]}x{size[1]} at least are compared")
    scale = size[0] / wide
    small = resized_by_area(colour[rows, columns], *size)
    if depth_m is not None:
        depth_m = resized_nearest(np.asarray(depth_m, np.float64)[rows, columns], *size)
    if K is not None:
        K = np.diag([scale, scale, 1.0]) @ (K - _moved(columns.start, rows.start))
    if class40 is not None:
        class40 = resized_nearest(class40[rows, columns], *size)
    return facts_of(id, group, small, depth_m, K, class40)


def _moved(left: int, top: int) -> F64:
    return np.array([[0, 0, left], [0, 0, top], [0, 0, 0]], np.float64)


def read_photographs(place: Path, size: Size, *, most: int = 0) -> PictureSet:
    """Photographs below a folder, with depth where it holds pairs of a known layout; or views of another root.

    Raises BadInput for a folder with fewer than two pictures that can be read. One that cannot is
    left out, with a line that names it.
    """
    if not place.is_dir():
        raise BadInput(place, "", "no such folder")
    if is_root(place):
        return read_views(str(place), size, most=most)
    notes: tuple[str, ...] = ()
    reads: list[_Plain] | list[_Pair]
    with_depth = has_depth(place)
    if with_depth:
        reads = [_Pair(pair, place) for pair in _spread(list(pairs_in(place)), most)]
    else:
        files = sorted(path for path in place.rglob("*") if path.suffix.lower() in SUFFIXES)
        reads = [_Plain(path, place) for path in _spread(files, most)]
        notes = ("The photographs have no depth: appearance alone is compared.",)
    found: list[PictureFacts] = []
    left_out: list[str] = []
    for one in reads:
        try:
            found.append(one.facts(size))
        except BadInput as error:
            left_out.append(str(error))
    _check(str(place), found, left_out)
    if with_depth and not any("normals" in one.histograms for one in found):
        notes = ("The photographs have no intrinsics: normals are not compared.",)
    return PictureSet(str(place), tuple(found), tuple(left_out), notes=notes)


@dataclass(frozen=True, slots=True)
class _Plain:
    """A picture without depth."""

    path: Path
    top: Path

    def facts(self, size: Size) -> PictureFacts:
        name = self.path.relative_to(self.top).as_posix()
        colour = read_photograph(self.path).colour
        return _fitted(name, _group_of(name), colour, size)


@dataclass(frozen=True, slots=True)
class _Pair:
    """A picture with depth."""

    pair: PhotoFiles
    top: Path

    def facts(self, size: Size) -> PictureFacts:
        pair = self.pair
        try:
            camera = camera_of(pair.rgb.parent, self.top)
        except BadInput:
            camera = None
        photo = read_pair(pair, camera.depth_scale if camera else None)
        classes = nyu40_of(pair, photo) if has_labels_of(pair) else None
        depth_m, K = photo.depth_mm / np.float64(1000), camera.matrix() if camera else None
        return _fitted(pair.id, _group_of(pair.id), photo.rgb, size, depth_m, K, classes)


def _group_of(name: str) -> str:
    return name.rpartition("/")[0] or name


def _check(place: str, found: list[PictureFacts], left_out: list[str]) -> None:
    if len(found) >= _LEAST:
        return
    text = f"{len(found) or 'no'} picture can be compared, {_LEAST} at least are needed"
    raise BadInput(place, "", text, hint=left_out[0] if left_out else ", ".join(SUFFIXES))


def batches_of(pictures: tuple[PictureFacts, ...], n: int) -> Iterator[NDArray[np.uint8]]:
    """(n, H, W, 3) uint8 of their colours, n at a time."""
    for at in range(0, len(pictures), n):
        yield np.stack([one.colour for one in pictures[at : at + n]])
