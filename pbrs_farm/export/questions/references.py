"""Referring expressions: phrases that fit exactly one item of a picture.

Effects: reads the view's albedo and depth, if present.
"""

from __future__ import annotations

import colorsys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.gloss import coat_of
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.export.questions.clips import Clip, Thing, is_countable, look_alikes

_APART: Final = 0.05  # minimum horizontal distance between centres of items side by side, share of the picture's width
_NEARER_M: Final = 0.3
_ON_M: Final = 0.05  # maximum gap between an item and its support
_OF_COLOUR: Final = 0.7  # minimum share of an item's pixels for a colour
_OF_ANOTHER: Final = 0.3  # maximum share of that colour in another item of the same noun
_COLOURS_APART: Final = 60.0  # of 255, minimum distance between the mean colours of items of a noun
_OF_NO_COLOUR: Final = (
    0.3  # minimum share of metal, mirror or glass in the surface of an item without a colour
)
_RECOGNIZED: Final = 0.6  # minimum visible share of an item with a phrase
_LEAST_SIDE_PX: Final = 24  # minimum width and height of its box in the picture
_TOUCHING_M: Final = 0.03  # gap in plan between items whose border is hard to see
_ORDINALS: Final = ("first", "second", "third", "fourth", "fifth", "sixth")


@dataclass(frozen=True, slots=True)
class Reference:
    """A phrase and the one instance it fits."""

    phrase: str
    instance: int


class _Picture:
    """Input of the phrases: the items of a picture, with positions, colours and depths."""

    def __init__(self, clip: Clip) -> None:
        self.clip = clip
        self.view = clip.views[0]
        self.rows = {int(r["id"]): r for r in self.view.facts["instances"]}

    @cached_property
    def instance(self) -> NDArray[Any]:
        return self.view.array("instance")

    @cached_property
    def depth_m(self) -> F64 | None:
        """(H, W) metres along the axis, NaN for unknown depth; None without the layer."""
        if self.view.entry.file("depth.png") is None:
            return None
        depth = self.view.array("depth").astype(np.float64) / 1000
        return np.where(depth > 0, depth, np.nan)

    @cached_property
    def colour_words(self) -> NDArray[Any] | None:
        """(H, W) index into _COLOURS of each pixel's albedo; None without the layer."""
        if self.view.entry.file("albedo.png") is None:
            return None
        return _colour_words(self.view.array("albedo")[..., :3])

    def is_recognizable(self, thing: Thing) -> bool:
        """True if a person sees what the item is, and where it ends.

        Its noun has a familiar shape, and no noticeable item of another noun has a similar one; it is large,
        mostly visible and not cut by the picture's edge, and does not touch an item of its noun. All of a
        user's classes are familiar.
        """
        if self.view.choice.classes is None and thing.noun not in look_alikes():
            return False
        row = self.rows[thing.instance]
        x0, y0, x1, y1 = row["box2d"]
        is_clear = thing.first_seen is not None and thing.most_visible >= _RECOGNIZED
        return (
            is_clear
            and not row["truncated"]
            and min(x1 - x0, y1 - y0) >= _LEAST_SIDE_PX
            and not self.clip.has_look_alike(thing.noun)
            and not any(
                other.noun == thing.noun and other.plan.distance(thing.plan) < _TOUCHING_M
                for other in self.clip.things
                if other is not thing
            )
        )

    def columns(self, thing: Thing) -> tuple[float, float]:
        """Left and right edge of an item's box in the picture, as shares of the width."""
        box, width = self.rows[thing.instance]["box2d"], float(self.view.facts["width_px"])
        return box[0] / width, box[2] / width

    def column(self, thing: Thing) -> float:
        """Centre of an item's box in the picture, as a share of the width."""
        return sum(self.columns(thing)) / 2

    def distance_m(self, thing: Thing) -> float:
        """Median depth of an item's pixels; NaN if unknown."""
        if self.depth_m is None:
            return float("nan")
        depths = self.depth_m[self.instance == thing.instance]
        depths = depths[np.isfinite(depths)]
        return float(np.median(depths)) if len(depths) else float("nan")

    def colour_shares(self, thing: Thing) -> Counter[str]:
        """Colour -> share of an item's pixels; empty for mirrors, glass and metals."""
        if self.colour_words is None or self._mirrors(thing):
            return Counter()
        words = self.colour_words[self.instance == thing.instance]
        counts = np.bincount(words, minlength=len(_COLOURS)) / max(len(words), 1)
        return Counter({name: float(counts[k]) for k, name in enumerate(_COLOURS)})

    def mean_colour(self, thing: Thing) -> F64:
        """(3,) 8-bit sRGB, the mean of an item's albedo."""
        albedo = self.view.array("albedo")[..., :3]
        return np.asarray(albedo[self.instance == thing.instance].mean(0), np.float64)

    def _mirrors(self, thing: Thing) -> bool:
        """True if much of its surface is metal, mirror or glass, whose albedo is not the visible colour."""
        materials = self.clip.house.materials
        areas = [
            (
                float(face_areas(triangle_corners(s.positions, s.faces)).sum()),
                _is_colourless(materials[s.material]),
            )
            for s in thing.item.surfaces
        ]
        return sum(a for a, is_own in areas if is_own) >= _OF_NO_COLOUR * sum(a for a, _is in areas)


def _is_colourless(material: Material) -> bool:
    coat = coat_of(material)
    clear = (MaterialKind.MIRROR, MaterialKind.GLASS, MaterialKind.PANE)
    return material.kind in clear or (coat is not None and coat.is_metal)


# fmt: off
_COLOURS: Final = (
    "black", "grey", "white", "red", "brown", "orange", "yellow", "beige", "green", "blue", "purple", "pink",
)
# fmt: on


def _colour_words(rgb: NDArray[Any]) -> NDArray[Any]:
    """(H, W) index into _COLOURS of the sRGB albedo (H, W, 3) of 8 bits."""
    # Name each of 16 x 16 x 16 colours once.
    cell = (rgb // 16).astype(np.int64)
    index = (cell[..., 0] * 16 + cell[..., 1]) * 16 + cell[..., 2]
    used, places = np.unique(index, return_inverse=True)
    names = [_COLOURS.index(_colour_word(k // 256, k // 16 % 16, k % 16)) for k in used]
    return np.asarray(names, np.int64)[places].reshape(index.shape)


def _colour_word(*cell: int) -> str:
    hue, light, saturation = colorsys.rgb_to_hls(*((k + 0.5) / 16 for k in cell))
    chroma = saturation * (1 - abs(2 * light - 1))
    if chroma < 0.12:
        return "black" if light < 0.2 else "white" if light > 0.8 else "grey"
    if light < 0.1:
        return "black"
    degrees = 360 * hue
    if degrees < 15 or degrees >= 345:
        return "pink" if light > 0.7 else "red"
    if degrees < 45:
        # Dark or dull orange is brown, pale orange beige.
        if light < 0.45 or (light < 0.55 and chroma < 0.6):
            return "brown"
        return "beige" if chroma < 0.4 else "orange"
    if degrees < 70:
        return "beige" if chroma < 0.4 else "yellow"
    if degrees < 170:
        return "green"
    return "blue" if degrees < 260 else "purple" if degrees < 310 else "pink"


def references_of(clip: Clip) -> list[Reference]:
    """Phrases for the clearly visible items of a picture, each true of one item only.

    By noun if it is unique, by colour, by side and order, by support, and by distance from the camera.
    Hardly visible items of the same noun are considered: a phrase must not fit any of them. Only items that
    a person recognizes have phrases.
    """
    picture = _Picture(clip)
    groups: dict[str, list[Thing]] = {}
    for thing in clip.things:
        groups.setdefault(thing.noun, []).append(thing)
    singles = {t.instance for t in clip.single}
    references: list[Reference] = []
    for noun, things in sorted(groups.items()):
        if not is_countable(noun):
            continue
        for phrase, thing in _phrases(picture, noun, things, singles):
            if picture.is_recognizable(thing):
                references.append(Reference(phrase, thing.instance))
    return references


def _phrases(
    picture: _Picture, noun: str, namesakes: Sequence[Thing], singles: set[int]
) -> Iterator[tuple[str, Thing]]:
    if len(namesakes) == 1:
        yield f"the {noun}", namesakes[0]
    else:
        yield from _by_side(picture, noun, namesakes)
        yield from _by_distance(picture, noun, namesakes)
    yield from _by_colour(picture, noun, namesakes)
    yield from _by_support(picture, noun, namesakes, singles)


def _by_side(
    picture: _Picture, noun: str, namesakes: Sequence[Thing]
) -> Iterator[tuple[str, Thing]]:
    row = sorted(namesakes, key=picture.column)
    columns = [picture.column(t) for t in row]
    if min(np.diff(columns)) < _APART or len(row) > len(_ORDINALS):
        return
    # Three items and more have an order only side by side.
    edges = [picture.columns(t) for t in row]
    if len(row) > 2 and any(right > left for (_, right), (left, _) in pairwise(edges)):
        return
    yield f"the {noun} on the left" if len(row) == 2 else f"the leftmost {noun}", row[0]
    yield f"the {noun} on the right" if len(row) == 2 else f"the rightmost {noun}", row[-1]
    for k, thing in enumerate(row[1:-1], 1):
        yield f"the {_ORDINALS[k]} {noun} from the left", thing


def _by_distance(
    picture: _Picture, noun: str, namesakes: Sequence[Thing]
) -> Iterator[tuple[str, Thing]]:
    away = [picture.distance_m(t) for t in namesakes]
    if not np.isfinite(away).all():
        return
    order = np.argsort(away, kind="stable")
    if away[order[1]] - away[order[0]] >= _NEARER_M:
        yield f"the {noun} nearest to the camera", namesakes[order[0]]
    if away[order[-1]] - away[order[-2]] >= _NEARER_M:
        yield f"the {noun} farthest from the camera", namesakes[order[-1]]


def _by_colour(
    picture: _Picture, noun: str, namesakes: Sequence[Thing]
) -> Iterator[tuple[str, Thing]]:
    shares = [picture.colour_shares(t) for t in namesakes]
    for k, thing in enumerate(namesakes):
        for colour in _COLOURS:
            other_shares = [s[colour] for j, s in enumerate(shares) if j != k]
            is_its = (
                shares[k][colour] >= _OF_COLOUR and max(other_shares, default=0.0) < _OF_ANOTHER
            )
            if is_its and _is_of_another_colour(picture, thing, namesakes):
                yield f"the {colour} {noun}", thing


def _is_of_another_colour(picture: _Picture, thing: Thing, namesakes: Sequence[Thing]) -> bool:
    """True if its mean colour differs clearly from all namesakes', not just by a shade at a word's boundary."""
    mean = picture.mean_colour(thing)
    other_colours = (picture.mean_colour(t) for t in namesakes if t is not thing)
    return all(np.linalg.norm(colour - mean) >= _COLOURS_APART for colour in other_colours)


def _by_support(
    picture: _Picture, noun: str, namesakes: Sequence[Thing], singles: set[int]
) -> Iterator[tuple[str, Thing]]:
    for support in picture.clip.things:
        if support.instance not in singles or support.noun == noun:
            continue
        on = [t for t in namesakes if _stands_on(t, support)]
        # Every item that could be on the support is in namesakes, and only one is.
        if len(on) == 1 and len(namesakes) > 1:
            yield f"the {noun} on the {support.noun}", on[0]


def _stands_on(a: Thing, b: Thing) -> bool:
    """True if b supports a: a's bottom is at the height of b's top, and a's centre is above b."""
    low, top = float(a.item.bounds[0, 1]), float(b.item.bounds[1, 1])
    return abs(low - top) <= _ON_M and bool(b.plan.contains(shapely.Point(*a.middle)))
