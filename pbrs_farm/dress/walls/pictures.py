"""Hangs pictures in a room: singles, pairs, rows and galleries, over furniture or at eye height."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.catalogue import PRINTS, Catalogue, Picture
from pbrs_farm.core.classes import BED, CABINET, CHAIR, DESK, DRESSER, OTHERFURNITURE, SOFA, TABLE
from pbrs_farm.core.house import Material, Texture
from pbrs_farm.dress.content import content
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.space import HouseSpace
from pbrs_farm.dress.style import Rgb, Style, room_style
from pbrs_farm.dress.walls.hanging import IN_FRONT_M, WANTS, Hanging, faces_behind
from pbrs_farm.dress.walls.hung_things import canvas, frame_material, framed, jpeg_texture, poster
from pbrs_farm.home.room_use import RoomKind
from pbrs_farm.images import decode_photo

MOST_PICTURES = 7  # in one room
_MOST_PRINTS = 24  # drawn for a home; further pictures show one of them again
_EYE_M = 1.55  # height of a picture's middle above the floor
_CEILING_M = 0.12  # kept free below the ceiling
_APART_M = 0.25  # least distance between groups of pictures

# Over what pictures hang, and how much it is liked.
_BENEATH = {
    BED: 1.0,
    SOFA: 1.0,
    DRESSER: 0.8,
    DESK: 0.6,
    TABLE: 0.5,
    CABINET: 0.5,
    OTHERFURNITURE: 0.4,
    CHAIR: 0.3,
}
_LOWEST_M, _TALLEST_BENEATH_M = 0.35, 1.25
_LOW_M: Final = 1.2


@dataclass(frozen=True, slots=True)
class PictureGroup:
    """Pictures that hang together: (left, bottom, width, height) of each, metres from the lower left."""

    frames: tuple[tuple[float, float, float, float], ...]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the whole."""
        return (
            max(x + w for x, _y, w, _h in self.frames),
            max(y + h for _x, y, _w, h in self.frames),
        )


@dataclass(frozen=True, slots=True)
class PictureSpot:
    """A place for a group: middle s on a face, above what (world y of its top; None = eye height)."""

    score: float
    face: int
    s: float
    width: float  # that suits it
    above_y: float | None


@dataclass(frozen=True, slots=True)
class Print:
    """A picture of the home's collection."""

    aspect: float  # width over height
    texture: Texture
    mean: Rgb


class Gallery:
    """The prints of a home, the catalogue's or generated, made on demand."""

    def __init__(self, house: MutableHouse, catalogue: Catalogue, style: Style) -> None:
        self._rng = house.rng("prints")
        self._style = style
        prints = [p for p in catalogue.pictures if p.group == PRINTS]
        order = house.rng("prints", "own").permutation(len(prints))
        self._own = [prints[int(k)] for k in order]
        self._prints: list[Print] = []
        self._families: Counter[str] = Counter()

    def print_for(self, aspect: float, besides: Collection[str] = ()) -> Print:
        """A picture of about that width over height, new while there are few, other than besides if possible."""
        if self._own or len(self._prints) < _MOST_PRINTS:
            pixels, family = self._new(aspect)
            r, g, b = (float(c) for c in pixels.reshape(-1, 3).mean(0) / 255)
            self._prints.append(Print(aspect, jpeg_texture(f"print {family}", pixels), (r, g, b)))
            return self._prints[-1]
        # Show one of a like shape again.
        free = [p for p in self._prints if p.texture.id not in besides] or self._prints
        likeness = [abs(np.log(p.aspect / aspect)) for p in free]
        near = [p for p, d in zip(free, likeness, strict=True) if d < min(likeness) + 0.15]
        return near[int(self._rng.integers(len(near)))]

    def _new(self, aspect: float) -> tuple[Srgb8Image, str]:
        """Pixels and kind of a picture that is not in use yet."""
        if self._own:
            likeness = [abs(np.log(p.size[0] / p.size[1] / aspect)) for p in self._own]
            picture = self._own.pop(int(np.argmin(likeness)))
            return _cropped(picture, aspect), "photograph"
        pixels, family = content().print_pixels(self._rng, aspect, self._style, self._families)
        self._families[family] += 1
        return pixels, family


def _cropped(picture: Picture, aspect: float) -> Srgb8Image:
    """The middle of a picture in that width over height: a frame is filled, nothing is stretched."""
    pixels = decode_photo(picture.texture.data, picture.texture.name)
    rows, columns = pixels.shape[:2]
    width, height = min(columns, round(rows * aspect)), min(rows, round(columns / aspect))
    top, left = (rows - height) // 2, (columns - width) // 2
    return pixels[top : top + height, left : left + width]


def hang_pictures(
    hanging: Hanging, space: HouseSpace, gallery: Gallery, style: Style, share: float
) -> None:
    """Pictures for one room, as many as its use and its walls allow."""
    room = hanging.room
    low, high = WANTS[room.kind].pictures, WANTS[room.kind].most_pictures
    rng = hanging.house.rng("pictures", room.room.id)
    n_wanted = int(np.floor(rng.integers(low, high + 1) * share + rng.random()))
    taste = room_style(style, rng)
    frame = frame_material(rng, taste)
    n_left = MOST_PICTURES
    for spot in _spots(hanging, space, rng):
        if n_wanted <= 0 or n_left <= 0:
            return
        group = _group_for(rng, spot, hanging, n_left)
        if group is None:
            continue
        _hang_group(rng, hanging, spot, group, gallery, taste, frame)
        n_left -= len(group[0].frames)
        n_wanted -= 1
    if n_wanted > 0:
        hanging.house.refused["walls: no free wall for pictures"] += n_wanted


def _spots(hanging: Hanging, space: HouseSpace, rng: np.random.Generator) -> list[PictureSpot]:
    """Places for pictures, best first: over furniture, then the middles of free stretches."""
    room, spots = hanging.room, []
    for number in room.items:
        item, (low, high) = hanging.house.items[number], space.bounds[number]
        liked = _BENEATH.get(item.nyu40, 0.0)
        top = float(high[1]) - hanging.floor_y
        if not liked or not _LOWEST_M < top < _TALLEST_BENEATH_M:
            continue
        for k, s0, s1 in faces_behind(room, low, high)[:1]:
            if s1 - s0 > 0.5:
                width = (s1 - s0) * float(rng.uniform(0.55, 0.8))
                score = liked + 0.3 * (s1 - s0) + float(rng.uniform(0, 0.6))
                spots.append(PictureSpot(score, k, (s0 + s1) / 2, width, float(high[1])))
    y0, y1 = hanging.floor_y + 1.3, hanging.floor_y + 1.8
    for k, face in enumerate(hanging.faces):
        starts = face.starts(0.3, y0, y1, IN_FRONT_M)
        for first, last in _stretches(starts):
            length = last - first + 0.3
            # Long walls take several groups.
            n = max(1, int(length / 1.8))
            for j in range(n):
                s = first + length * (j + 0.5) / n
                score = 0.25 * min(length / n, 2.5) + float(rng.uniform(0, 0.7))
                spots.append(PictureSpot(score, k, s, min(length / n - 0.2, 1.5), None))
    return sorted(spots, key=lambda spot: -spot.score)


def _stretches(starts: F64) -> list[tuple[float, float]]:
    if not len(starts):
        return []
    gaps = np.flatnonzero(np.diff(starts) > 0.03)
    first, last = np.r_[0, gaps + 1], np.r_[gaps, len(starts) - 1]
    return [(float(starts[a]), float(starts[b])) for a, b in zip(first, last, strict=True)]


def _group_for(
    rng: np.random.Generator, spot: PictureSpot, hanging: Hanging, left: int
) -> tuple[PictureGroup, float, float] | None:
    """A group that fits at the spot, with its left edge and its bottom; smaller ones are tried."""
    face, floor = hanging.faces[spot.face], hanging.floor_y
    for attempt in range(5):
        width = min(max(spot.width * 0.85**attempt, 0.22), 1.6)
        group = _draw_group(rng, width, left)
        w, h = group.size
        bottom = floor + _EYE_M + float(rng.uniform(-0.08, 0.08)) - h / 2
        if spot.above_y is not None:
            over = spot.above_y + float(rng.uniform(0.15, 0.25))
            bottom = over if over + h / 2 > floor + 1.2 else max(bottom, over)
        for shift in (0.0, 0.15, -0.15, 0.3, -0.3):
            s = spot.s + shift - w / 2
            free = face.free_m(
                s - _APART_M / 2, s + w + _APART_M / 2, bottom - 0.06, bottom + h + _CEILING_M
            )
            if free >= IN_FRONT_M:
                return group, s, bottom
    return None


def _draw_group(rng: np.random.Generator, width: float, left: int) -> PictureGroup:
    """A group about so wide of at most `left` pictures; sides of 20 to 110 cm."""
    gap = float(rng.uniform(0.05, 0.08))
    kind = rng.random()
    if width > 0.75 and left >= 4 and kind < 0.15:
        w = min((width - gap) / 2, 0.5)
        h = w * float(rng.choice([1.0, 1.3]))
        cells = [(x, y, w, h) for y in (0.0, h + gap) for x in (0.0, w + gap)]
        return PictureGroup(tuple(cells))
    if width > 0.8 and left >= 3 and kind < 0.38:
        w = min((width - 2 * gap) / 3, 0.5)
        h = w * float(rng.choice([1.0, 1.25, 1.41]))
        return PictureGroup(tuple((k * (w + gap), 0.0, w, h) for k in range(3)))
    if width > 0.55 and left >= 2 and kind < 0.6:
        w = min((width - gap) / 2, 0.6)
        h = w * float(rng.choice([1.0, 1.3, 1.41]))
        return PictureGroup(tuple((k * (w + gap), 0.0, w, min(h, 0.95)) for k in range(2)))
    w = min(max(width, 0.22), 1.05)
    shapes = [0.7, 0.75, 1.0] if w > 0.7 else [1.0, 1.3, 1.41]
    h = float(np.clip(w * float(rng.choice(shapes)), 0.2, 1.0))
    return PictureGroup(((0.0, 0.0, w, h),))


def _hang_group(
    rng: np.random.Generator,
    hanging: Hanging,
    spot: PictureSpot,
    group: tuple[PictureGroup, float, float],
    gallery: Gallery,
    style: Style,
    frame: Material,
) -> None:
    pictures, left, bottom = group
    # A group of pictures has the same kind of frame.
    kind = str(rng.choice(["framed", "canvas", "poster"], p=[0.68, 0.22, 0.1]))
    group_seed, hung = int(rng.integers(1 << 30)), list[str]()
    for x, y, w, h in pictures.frames:
        shown = gallery.print_for(w / h, hung)
        hung.append(shown.texture.id)
        piece, shape = _framed_picture(
            np.random.default_rng(group_seed), kind, (w, h), shown, style, frame
        )
        middle = left + x + w / 2
        hanging.hang(piece, shape, spot.face, middle, bottom + y, margin_m=0.0)
    w, h = pictures.size
    face = hanging.faces[spot.face]
    hanging.faces[spot.face] = face.taken(
        left - 0.1, left + w + 0.1, bottom - 0.1, bottom + h + 0.1
    )


def _framed_picture(
    rng: np.random.Generator,
    kind: str,
    size: tuple[float, float],
    shown: Print,
    style: Style,
    frame: Material,
) -> Model:
    width, height = size
    if kind == "canvas":
        return canvas(rng, width, height, shown.texture, shown.mean, frame)
    if kind == "poster":
        return poster(rng, width, height, shown.texture, frame)
    return framed(rng, style, width, height, shown.texture, frame)


def hang_pin_board(hanging: Hanging, space: HouseSpace, style: Style, share: float) -> None:
    """A pin board over the room's desk, else on any free wall of a kitchen, hall or study."""
    kind = hanging.room.kind
    rng = hanging.house.rng("pin board", hanging.room.room.id)
    if rng.random() >= WANTS[kind].pin_board * share:
        return
    width, height = float(rng.uniform(0.55, 0.95)), float(rng.uniform(0.42, 0.65))
    frame = frame_material(rng, style)
    board = content().things["pin_board"](rng, style, width, height, frame)
    low = hanging.floor_y + _LOW_M
    places = _over_desks(hanging, space)
    if kind is not RoomKind.BEDROOM:
        places += [
            (k, float(s) + width / 2 + 0.05)
            for k, face in enumerate(hanging.faces)
            for s in face.starts(width + 0.1, low - 0.05, low + height + 0.05, IN_FRONT_M)[::8]
        ]
    for k, s in places:
        if hanging.faces[k].free_m(s - width / 2, s + width / 2, low, low + height) >= IN_FRONT_M:
            hanging.hang(*board, k, s, low)
            return
    hanging.house.refused["walls: no free wall for a pin board"] += 1


def _over_desks(hanging: Hanging, space: HouseSpace) -> list[tuple[int, float]]:
    """(face, s) of the wall behind the middle of each desk, or table in a room with a bed."""
    spots = []
    for number in hanging.room.items:
        item, (low, high) = hanging.house.items[number], space.bounds[number]
        if item.nyu40 in (DESK, TABLE) and 0.6 < high[1] - hanging.floor_y < 0.95:
            spots += [(k, (s0 + s1) / 2) for k, s0, s1 in faces_behind(hanging.room, low, high)[:1]]
    return spots
