"""The two sets of a comparison: rendered views, and photographs with or without depth. Effects: reads files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.curate.photographs import PhotoFiles, has_depth, pairs_in
from pbrs_farm.study.comparing.picture_facts import PictureFacts, facts_of
from pbrs_farm.study.judging.photo_predictions import SUFFIXES, read_photograph
from pbrs_farm.study.photographs import camera_of_crop, crop_to_size, middle_of_form
from pbrs_farm.study.real_frames import camera_of, has_labels_of, nyu40_of, read_pair
from pbrs_farm.study.training.training_views import evenly_spaced
from pbrs_farm.study.training.view_sources import is_root, source_credits
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.views import Frame

WIDEST_PX: Final = 256
_FORM: Final = (4, 3)
_LEAST: Final = 2  # minimum number of pictures in a set
Size = tuple[int, int]  # width, height


@dataclass(frozen=True, slots=True)
class PictureSet:
    """Statistics of each picture of a set, and a line for each unreadable one."""

    place: str
    pictures: tuple[PictureFacts, ...]
    left_out: tuple[str, ...] = ()
    credits: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def size_of_views(place: str) -> Size:
    """(width, height) for a comparison with the views of a root: 4 x 3, at most 256 wide."""
    frame = _frames(place)[0]
    _, columns = middle_of_form(frame.size[1], frame.size[0], *_FORM)
    width = min(WIDEST_PX, columns.stop - columns.start)
    return width, round(width * _FORM[1] / _FORM[0])


def read_views(place: str, size: Size, *, mode: str = "", most: int = 0) -> PictureSet:
    """At most so many views of a root or of shards; mode "" = their best light. BadInput for fewer than two."""
    frames = evenly_spaced(_frames(place), most)
    pictures, left_out = _readable_pictures(
        place, [partial(_facts_of_frame, frame, size, mode) for frame in frames]
    )
    homes = dict.fromkeys(frame.ref.house for frame in frames)
    return PictureSet(place, pictures, left_out, source_credits(frames[0].source, list(homes)))


def _frames(place: str) -> list[Frame]:
    frames = [frame for frame in open_views(place) if not frame.ref.is_object]
    if len(frames) < _LEAST:
        text = f"has {len(frames) or 'no'} view, {_LEAST} at least are compared"
        raise BadInput(place, "", text)
    return frames


def _facts_of_frame(frame: Frame, size: Size, mode: str) -> PictureFacts:
    colour = frame.picture(mode) if mode else frame.colour
    layers = frame.layers
    depth = frame.depth if "depth" in layers else None
    classes = frame.classes if {"semantic", "class40"} & set(layers) else None
    return _fitted(frame.id, frame.ref.house, colour, size, depth, frame.k, classes)


def _fitted(
    id: str,
    group: str,
    colour: Srgb8Image,
    size: Size,
    depth_m: NDArray[Any] | None = None,
    K: F64 | None = None,
    class40: NDArray[np.uint8] | None = None,
) -> PictureFacts:
    """Statistics of the middle of a picture at the common size; BadInput for a smaller picture."""
    small, rows, columns = crop_to_size(colour, size)
    if columns.stop - columns.start < size[0]:
        pixels = f"{colour.shape[1]}x{colour.shape[0]}"
        raise BadInput(id, "", f"{pixels} pixels, {size[0]}x{size[1]} at least are compared")
    if depth_m is not None:
        depth_m = resized_nearest(np.asarray(depth_m, np.float64)[rows, columns], *size)
    if K is not None:
        K = camera_of_crop(K, rows, columns, size)
    if class40 is not None:
        class40 = resized_nearest(class40[rows, columns], *size)
    return facts_of(id, group, small, depth_m, K, class40)


def read_photographs(place: Path, size: Size, *, most: int = 0) -> PictureSet:
    """At most so many photographs, with depth from pairs, or views of a root; BadInput for fewer than two."""
    if not place.is_dir():
        raise BadInput(place, "", "no such folder")
    if is_root(place):
        return read_views(str(place), size, most=most)
    if has_depth(place):
        pairs = evenly_spaced(pairs_in(place), most)
        readers = [partial(_facts_of_pair, pair, place, size) for pair in pairs]
        note = "The photographs have no intrinsics: normals are not compared."
    else:
        files = sorted(path for path in place.rglob("*") if path.suffix.lower() in SUFFIXES)
        chosen = evenly_spaced(files, most)
        readers = [partial(_facts_of_photograph, path, place, size) for path in chosen]
        note = "The photographs have no depth: appearance alone is compared."
    pictures, left_out = _readable_pictures(str(place), readers)
    has_normals = any("normals" in picture.histograms for picture in pictures)
    return PictureSet(str(place), pictures, left_out, notes=() if has_normals else (note,))


def _facts_of_photograph(path: Path, top: Path, size: Size) -> PictureFacts:
    name = path.relative_to(top).as_posix()
    return _fitted(name, _group_of(name), read_photograph(path).colour, size)


def _facts_of_pair(pair: PhotoFiles, top: Path, size: Size) -> PictureFacts:
    try:
        camera = camera_of(pair.rgb.parent, top)
    except BadInput:
        camera = None
    photo = read_pair(pair, camera.depth_scale if camera else None)
    classes = nyu40_of(pair, photo) if has_labels_of(pair) else None
    depth_m, K = photo.depth_mm / np.float64(1000), camera.matrix() if camera else None
    return _fitted(pair.id, _group_of(pair.id), photo.rgb, size, depth_m, K, classes)


def _group_of(name: str) -> str:
    return name.rpartition("/")[0] or name


def _readable_pictures(
    place: str, readers: Sequence[Callable[[], PictureFacts]]
) -> tuple[tuple[PictureFacts, ...], tuple[str, ...]]:
    """Statistics of the readable pictures, and a line for each other one; BadInput for too few."""
    pictures: list[PictureFacts] = []
    left_out: list[str] = []
    for read in readers:
        try:
            pictures.append(read())
        except BadInput as error:
            left_out.append(str(error))
    if len(pictures) < _LEAST:
        text = f"{len(pictures) or 'no'} picture can be compared, {_LEAST} at least are needed"
        raise BadInput(place, "", text, hint=left_out[0] if left_out else ", ".join(SUFFIXES))
    return tuple(pictures), tuple(left_out)
