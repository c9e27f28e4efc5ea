"""The subjects of questions: a picture or a walk, with its visible items.

Effects: reads the house of a view and, on demand, its layers.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import numpy as np
import shapely
import trimesh
from scipy.spatial import cKDTree

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.edits import is_lamp_on
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.core.recipe import recipe_from_json
from pbrs_farm.core.record import read_csv
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.export_homes import stored_house
from pbrs_farm.export.nouns import is_plural, noun_of
from pbrs_farm.export.sequences import frames_by_house
from pbrs_farm.geometry.surface_points import item_triangles, surface_points
from pbrs_farm.regular_files import read_given

LEAST_FRACTION: Final = 0.003
"""Minimum share of a picture's pixels of a visible item."""
LEAST_VISIBLE: Final = 0.3
"""Minimum visible share of an item: neither occluded nor outside the picture."""
WHOLE: Final = 0.7
"""Minimum visible share of an item for questions about its size."""
_GLIMPSED: Final = 1e-4  # minimum share of a picture's pixels of a noticeable item
_SPACING_M: Final = 0.03  # spacing of points, for the gap between two items
_POINTS_ALONG: Final = 16  # points along an item's longest side, for its share within a picture
_STARTS: Final = 4  # initial pairs of points in the search for the gap
_STEPS: Final = 24  # maximum iterations from one item to the other and back
_BY_FLOOR_M: Final = 0.3  # maximum gap between the floor and an item on it
_WAY_M: Final = 0.5  # width of a path between items
_STEPPED_OVER_M: Final = 0.1
_HEAD_M: Final = 1.8
_LEAST_STOOD_BY_M: Final = 0.4  # minimum longest side of an item as a viewpoint
# Nouns without meaning, and first words of nouns whose number is unclear: a row of books, a sheet
# of paper.
_VAGUE: Final = frozenset({"object", "part of the building", "person", "food"})
_UNCOUNTED: Final = ("piece", "row", "sheet")


@dataclass(eq=False)
class Thing:
    """An instance of a clip and its first frames; frames count from 0 and are 0 in a picture."""

    instance: int
    noun: str
    item: Item
    first_glimpsed: int  # first frame with some of its pixels
    first_seen: int | None = None  # first frame in which it is visible; None = never
    most_visible: float = 0.0  # its largest visible share in a frame

    @cached_property
    def triangles(self) -> F64:
        """(F, 3, 3) corners in the world, metres."""
        return item_triangles(self.item)

    @cached_property
    def points(self) -> cKDTree:
        """Points on its surface, including the corners of its triangles."""
        corners = self.triangles.reshape(-1, 3)
        return cKDTree(np.concatenate([corners, surface_points(self.triangles, _SPACING_M)]))

    def share_within(self, view: ChosenView) -> float:
        """The share of its surface within the picture's edges, occluded or not."""
        pose, (width, height) = view.pose, view.size
        x, y = view.intrinsics.pixels((self._sparse_points - pose[:3, 3]) @ pose[:3, :3]).T
        # NaN (outside the lens) compares false.
        within = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
        return float(within.mean()) if len(within) else 0.0

    @cached_property
    def _sparse_points(self) -> F64:
        """(N, 3) points on its surface, spaced in proportion to its longest side."""
        return surface_points(self.triangles, max(self.longest_m / _POINTS_ALONG, _SPACING_M / 4))

    @cached_property
    def plan(self) -> Any:
        """Its box seen from above, a shapely polygon: x and z, metres."""
        return _plan(self.item)

    @cached_property
    def middle(self) -> F64:
        """(2,) the middle of its box in plan: x and z, metres."""
        return np.asarray(self.item.oriented_box.centre, np.float64)[[0, 2]]

    @cached_property
    def longest_m(self) -> float:
        """The longest side of its box."""
        return float(2 * np.max(self.item.oriented_box.half))


def _plan(item: Item) -> Any:
    return shapely.MultiPoint(item.oriented_box.corners[:, [0, 2]]).convex_hull


@dataclass(eq=False)
class Clip:
    """A picture or a walk, and its visible items. A walk shows one home, so questions may ask for rooms."""

    name: str  # unique in the export, and a file name
    views: Sequence[ChosenView]  # one, or the frames of a walk in their order
    house: House
    things: Sequence[Thing]  # all noticeable items, by instance
    gaps: dict[tuple[int, int], float] = field(default_factory=dict, repr=False)
    """Gaps of two instances, metres; all clips of a house have the same."""

    lamps_off: Container[str] = ()  # items with light sources that the recipe has off

    _ways: dict[tuple[int, int], bool] = field(default_factory=dict, init=False, repr=False)

    @property
    def is_walk(self) -> bool:
        """True for several frames of a moving camera."""
        return len(self.views) > 1

    @cached_property
    def by_noun(self) -> dict[str, list[Thing]]:
        """Noun -> its items, for countable nouns with all items visible."""
        groups: dict[str, list[Thing]] = defaultdict(list)
        for thing in self.things:
            groups[thing.noun].append(thing)
        return {
            noun: things
            for noun, things in sorted(groups.items())
            if is_countable(noun) and all(t.first_seen is not None for t in things)
        }

    @cached_property
    def single(self) -> list[Thing]:
        """The items with an unambiguous noun: the only noticeable item of that noun.

        No item of another noun has the same name: a coat rack may be labelled furniture or clothes.
        """
        names = Counter(thing.item.name for thing in self.things)
        alone = (things[0] for things in self.by_noun.values() if len(things) == 1)
        return [thing for thing in alone if names[thing.item.name] == 1]

    def has_look_alike(self, noun: str) -> bool:
        """True if a noticeable item of another noun has a similar shape."""
        return any(thing.noun in look_alikes().get(noun, ()) for thing in self.things)

    @cached_property
    def footprints(self) -> dict[str, list[tuple[Item, Any]]]:
        """Room id -> obstacles of a walker, between the floor and head height, with their plans."""
        obstacles: dict[str, list[tuple[Item, Any]]] = defaultdict(list)
        floors = {room.id: room.floor_y for room in self.house.rooms}
        for item in self.house.items:
            floor_y = floors.get(item.room_id or "")
            if floor_y is None or item.kind.is_structure or not item.surfaces:
                continue
            low, high = item.bounds[:, 1]
            if high > floor_y + _STEPPED_OVER_M and low < floor_y + _HEAD_M:
                obstacles[item.room_id or ""].append((item, _plan(item)))
        return obstacles

    @cached_property
    def rooms_entered(self) -> list[Room]:
        """The rooms entered by the camera, in the house's order."""
        return [room for room in self.house.rooms if any(self._is_in(room))]

    def _is_in(self, room: Room) -> list[bool]:
        """Of each view, whether its camera is in a room."""
        polygon = shapely.Polygon(room.polygon)
        return [
            bool(room.floor_y <= y <= room.ceiling_y and polygon.contains(shapely.Point(x, z)))
            for x, y, z in (view.pose[:3, 3] for view in self.views)
        ]

    def visits_of(self, room: Room, least_frames: int) -> int:
        """Number of stays of the camera in a room; 0 if a stay or an absence is shorter than least_frames."""
        runs = [(inside, len(list(run))) for inside, run in groupby(self._is_in(room))]
        is_clear = all(n_frames >= least_frames for _inside, n_frames in runs)
        return sum(inside for inside, _n in runs) if is_clear else 0

    def stands_on_floor(self, thing: Thing) -> bool:
        """True if the item is on the floor of its room and large enough to be a destination."""
        floor_y = next((r.floor_y for r in self.house.rooms if r.id == thing.item.room_id), None)
        low = float(thing.item.bounds[0, 1])
        is_by_floor = floor_y is not None and low - floor_y <= _BY_FLOOR_M
        return is_by_floor and thing.longest_m >= _LEAST_STOOD_BY_M

    def is_way_free(self, a: Thing, b: Thing) -> bool:
        """True if a person can walk straight from a to b, within one room; cached."""
        key = (min(a.instance, b.instance), max(a.instance, b.instance))
        if key not in self._ways:
            self._ways[key] = self._is_free(a, b)
        return self._ways[key]

    def _is_free(self, a: Thing, b: Thing) -> bool:
        room = next((r for r in self.house.rooms if r.id == a.item.room_id), None)
        if room is None or b.item.room_id != room.id:
            return False
        line: Any = shapely.LineString([a.middle, b.middle])
        way = line.difference(shapely.union(a.plan, b.plan)).buffer(_WAY_M / 2, cap_style="flat")
        if way.is_empty or not shapely.Polygon(room.polygon).contains(way):
            return False
        obstacles = (p for item, p in self.footprints[room.id] if item not in (a.item, b.item))
        return not any(plan.intersects(way) for plan in obstacles)

    def gap_m(self, a: Thing, b: Thing) -> float:
        """Gap between two items' surfaces, metres; cached.

        Starts at the nearest points of a cloud on each item, and alternates between the nearest points of the
        two surfaces until they converge: exact where the items are locally convex.
        """
        key = (min(a.instance, b.instance), max(a.instance, b.instance))
        if key not in self.gaps:
            self.gaps[key] = _gap_m(a, b)
        return self.gaps[key]


@dataclass(frozen=True, slots=True)
class _Shape:
    """A row of look_alikes.csv; its head explains the columns."""

    shape: str
    named: str
    also: str = ""


@cache
def look_alikes() -> dict[str, set[str]]:
    """Noun -> the other nouns with a similar shape, for the nouns that phrases name.

    >>> "jar" in look_alikes()["vase"], "ornament" in look_alikes()
    (True, False)
    """
    others: dict[str, set[str]] = defaultdict(set)
    for row in read_csv(Path(__file__).with_name("look_alikes.csv"), _Shape):
        named = row.named.split("|")
        for noun in named:
            others[noun].update({*named, *row.also.split("|")} - {noun})
    return dict(others)


def is_countable(noun: str) -> bool:
    """True for a singular noun whose items can be counted in a picture.

    >>> [is_countable(noun) for noun in ("chair", "glass", "set of shelves", "row of books", "plates")]
    [True, True, True, False, False]
    """
    first = noun.partition(" of ")[0]
    return noun not in _VAGUE and first not in _UNCOUNTED and not is_plural(noun)


def _gap_m(a: Thing, b: Thing) -> float:
    gaps, nearest = (np.asarray(pair) for pair in b.points.query(a.points.data))
    best = float(gaps.min())
    starts = np.argsort(gaps, kind="stable")[:_STARTS]
    for start in starts:
        place = np.asarray(b.points.data[nearest[start]])
        for _ in range(_STEPS):
            place_a, _d = _nearest_place(a.triangles, place)
            after, gap = _nearest_place(b.triangles, place_a)
            best = min(best, gap)
            if np.allclose(after, place, atol=1e-6):
                break
            place = after
    return best


def _nearest_place(triangles: F64, place: F64) -> tuple[F64, float]:
    """The point of a mesh nearest to a point in the world, and the distance."""
    # Test only triangles whose box is as near as the nearest corner.
    low, high = triangles.min(1), triangles.max(1)
    to_box = np.linalg.norm(np.maximum(np.maximum(low - place, place - high), 0.0), axis=1)
    to_corner = np.linalg.norm(triangles.reshape(-1, 3) - place, axis=1).min()
    near = triangles[to_box <= to_corner + 1e-9]
    places = trimesh.triangles.closest_point(near, np.broadcast_to(place, (len(near), 3)))
    gaps = np.linalg.norm(places - place, axis=1)
    k = int(np.nanargmin(gaps))  # trimesh 4 divides by the edges of a triangle without an area
    return np.asarray(places[k]), float(gaps[k])


def clips_of(views: Sequence[ChosenView]) -> Iterator[Clip]:
    """A clip for each view, and one for each walk: the first camera's frames of a rig, in order.

    Views of models without a home are left out: they have no room to ask about. Holds one house at a
    time. Raises BadInput for a damaged house.
    """
    for house_id, frames in frames_by_house(views).items():
        firsts = [frame.first for frame in frames]
        if house_id.startswith("object_"):
            continue
        folder = firsts[0].entry.folder.parents[1]
        house = stored_house(folder)
        off = lamps_off(folder.parents[1] / keys.RECIPE, house)
        gaps: dict[tuple[int, int], float] = {}
        walk = [view for view in firsts if view.facts.get("frame") is not None]
        if len(walk) > 1:
            yield replace(clip_of_views(house_id, walk, house, gaps), lamps_off=off)
        for view in firsts:
            if len(walk) < 2 or view.facts.get("frame") is None:
                clip = clip_of_views(f"{house_id}__{view.id}", [view], house, gaps)
                yield replace(clip, lamps_off=off)


def lamps_off(file: Path, house: House) -> frozenset[str]:
    """Ids of a house's lamps that the recipe in a file has off; none without the file. BadRecipe if it is damaged."""
    if not file.is_file():
        return frozenset()
    recipe = recipe_from_json(read_given(file), str(file))
    lamps = (item.id for item in house.items if item.lights)
    return frozenset(lamp for lamp in lamps if not is_lamp_on(lamp, house.id, recipe))


def clip_of_views(
    name: str,
    views: Sequence[ChosenView],
    house: House,
    gaps: dict[tuple[int, int], float] | None = None,
) -> Clip:
    """gaps: those of the house already known, which the clip adds to."""
    items = {item.id: item for item in house.items}
    things: dict[int, Thing] = {}
    for k, view in enumerate(views):
        for row, noun, item in _noticed(view, items):
            thing = things.setdefault(row["id"], Thing(int(row["id"]), noun, item, k))
            share = row["visible_fraction"]
            share = 1.0 if share is None else float(share)
            if row["truncated"]:
                share *= thing.share_within(view)
            thing.most_visible = max(thing.most_visible, share)
            is_seen = share >= LEAST_VISIBLE and row["fraction"] >= LEAST_FRACTION
            if is_seen and thing.first_seen is None:
                thing.first_seen = k
    return Clip(
        name, views, house, [things[k] for k in sorted(things)], {} if gaps is None else gaps
    )


def _noticed(
    view: ChosenView, items: dict[str, Item]
) -> Iterable[tuple[dict[str, Any], str, Item]]:
    """Rows of noticeable items of a view with a noun, without the building and the outdoors."""
    for row in view.facts["instances"]:
        item = items.get(str(row["item"]))
        if item is None or item.is_outside or item.kind.is_structure or not item.surfaces:
            continue
        noun = noun_of(view, row)
        if noun and row["fraction"] >= _GLIMPSED:
            yield row, noun, item
