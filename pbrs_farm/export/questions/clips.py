"""The subjects of questions: a picture or a walk, with its visible items.

Effects: reads the house of a view and, on demand, its layers.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
import shapely
import trimesh
from scipy.spatial import cKDTree

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import House, Item, Room
from pbrs_farm.export.chosen_view import ChosenView, intrinsics_of
from pbrs_farm.export.export_homes import stored_house
from pbrs_farm.export.nouns import is_plural, noun_of
from pbrs_farm.export.sequences import frames_by_house, pose_opencv
from pbrs_farm.geometry.surface_points import item_triangles, surface_points

LEAST_FRACTION: Final = 0.003
"""Share of a picture's pixels from which a thing is seen."""
LEAST_VISIBLE: Final = 0.3
"""Share of a thing from which it is seen: neither hidden by others nor beyond the picture's edges."""
WHOLE: Final = 0.7
"""Share of a thing from which its size can be judged."""
_GLIMPSED: Final = 1e-4  # minimum share of a picture's pixels of a noticeable item
_SPACING_M: Final = 0.03  # of the points that find the nearest places of two things
_POINTS_ALONG: Final = (
    16  # the longest side of a thing, where it is asked how much of it a picture holds
)
_STARTS: Final = 4  # pairs of points from which the nearest places are sought
_STEPS: Final = 24  # from one thing to the other and back
_BY_FLOOR_M: Final = 0.3  # maximum gap between the floor and an item on it
_WAY_M: Final = 0.5  # the width of a way between things
_STEPPED_OVER_M: Final = 0.1
_HEAD_M: Final = 1.8
_LEAST_STOOD_BY_M: Final = 0.4  # the longest side of a thing that one stands by
# Nouns that say nothing, and words of what is hard to tell from two of it: a row of books, a sheet of paper.
_VAGUE: Final = frozenset({"object", "part of the building", "person", "food"})
_UNCOUNTED: Final = ("piece", "row", "sheet")


@dataclass(eq=False)
class Thing:
    """An instance of a clip and when it is seen; frames count from 0 and are 0 in a picture."""

    instance: int
    noun: str
    item: Item
    first_glimpsed: int  # the first frame in which some pixels of it are there
    first_seen: int | None = None  # the first frame in which it counts as seen; None = never
    most_visible: float = 0.0  # the largest share of it in a frame

    @cached_property
    def triangles(self) -> F64:
        """(F, 3, 3) corners in the world, metres."""
        return item_triangles(self.item)

    @cached_property
    def points(self) -> cKDTree:
        """Points on its surface, corners of its triangles among them."""
        corners = self.triangles.reshape(-1, 3)
        return cKDTree(np.concatenate([corners, surface_points(self.triangles, _SPACING_M)]))

    def share_within(self, view: ChosenView) -> float:
        """The share of its surface that lies within the picture's edges, whether hidden or not."""
        facts, pose = view.facts, pose_opencv(view)
        x, y = intrinsics_of(facts).pixels((self._sparse_points - pose[:3, 3]) @ pose[:3, :3]).T
        # NaN, what the lens does not see, is not within.
        within = (x >= 0) & (x <= facts["width_px"]) & (y >= 0) & (y <= facts["height_px"])
        return float(within.mean()) if len(within) else 0.0

    @cached_property
    def _sparse_points(self) -> F64:
        """(N, 3) points on its surface, the longer its sides the farther apart."""
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
    """A picture or a walk, and what is seen in it. Walks show one home, so questions may ask for rooms."""

    name: str  # unique in the export, and a file name
    views: Sequence[ChosenView]  # one, or the frames of a walk in their order
    house: House
    things: Sequence[Thing]  # all that may be noticed, by instance

    _gaps: dict[tuple[int, int], float] = field(default_factory=dict, init=False, repr=False)
    _ways: dict[tuple[int, int], bool] = field(default_factory=dict, init=False, repr=False)

    @property
    def is_walk(self) -> bool:
        """Several frames of a moving camera."""
        return len(self.views) > 1

    @cached_property
    def by_noun(self) -> dict[str, list[Thing]]:
        """Noun -> all of its things, for nouns whose things are all seen: others cannot be counted."""
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
        """The things that their noun names without doubt: the only one of it that may be noticed.

        Nor is there another of the same own name: a coat rack that is furniture, and one of clothes.
        """
        names = Counter(thing.item.name for thing in self.things)
        alone = (things[0] for things in self.by_noun.values() if len(things) == 1)
        return [thing for thing in alone if names[thing.item.name] == 1]

    @cached_property
    def footprints(self) -> dict[str, list[tuple[Item, Any]]]:
        """Room id -> what a walker would meet there between the floor and head height, seen from above."""
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
        """The rooms in which the camera stands in some frame, in the house's order."""
        eyes = np.array([pose_opencv(view)[:3, 3] for view in self.views])
        return [
            room
            for room in self.house.rooms
            if any(
                room.floor_y <= y <= room.ceiling_y
                and shapely.Polygon(room.polygon).contains(shapely.Point(x, z))
                for x, y, z in eyes
            )
        ]

    def stands_on_floor(self, thing: Thing) -> bool:
        """It stands on the floor of its room, large enough to be a place to go to."""
        floor_y = next((r.floor_y for r in self.house.rooms if r.id == thing.item.room_id), None)
        low = float(thing.item.bounds[0, 1])
        is_by_floor = floor_y is not None and low - floor_y <= _BY_FLOOR_M
        return is_by_floor and thing.longest_m >= _LEAST_STOOD_BY_M

    def is_way_free(self, a: Thing, b: Thing) -> bool:
        """A person can walk straight from one thing to the other, within one room; kept."""
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
        """Metres between the nearest places of two things' surfaces; kept.

        From the nearest points of a cloud on each, walks from surface to surface to the nearest place
        until it stays: exact where the things are convex about there.
        """
        key = (min(a.instance, b.instance), max(a.instance, b.instance))
        if key not in self._gaps:
            self._gaps[key] = _gap_m(a, b)
        return self._gaps[key]


def is_countable(noun: str) -> bool:
    """One of it is told from two, and the word is of one thing.

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
    """The place of a mesh that is nearest to one in the world, and how far."""
    # Look only at triangles whose box is as near as the nearest corner.
    low, high = triangles.min(1), triangles.max(1)
    to_box = np.linalg.norm(np.maximum(np.maximum(low - place, place - high), 0.0), axis=1)
    to_corner = np.linalg.norm(triangles.reshape(-1, 3) - place, axis=1).min()
    near = triangles[to_box <= to_corner + 1e-9]
    places = trimesh.triangles.closest_point(near, np.broadcast_to(place, (len(near), 3)))
    gaps = np.linalg.norm(places - place, axis=1)
    k = int(gaps.argmin())
    return np.asarray(places[k]), float(gaps[k])


def clips_of(views: Sequence[ChosenView]) -> Iterator[Clip]:
    """A clip for each view, and one for each walk: its frames in order, of a rig the first camera's.

    Views of models without a home are left out: they have no room to ask about. One house is read at a
    time. Raises BadInput for a house that is damaged.
    """
    for house_id, frames in frames_by_house(views).items():
        firsts = [frame.first for frame in frames]
        if house_id.startswith("object_"):
            continue
        house = stored_house(firsts[0].entry.folder.parent.parent)
        walk = [view for view in firsts if view.facts.get("frame") is not None]
        if len(walk) > 1:
            yield _clip(house_id, walk, house)
        for view in firsts:
            if len(walk) < 2 or view.facts.get("frame") is None:
                yield _clip(f"{house_id}__{view.id}", [view], house)


def _clip(name: str, views: Sequence[ChosenView], house: House) -> Clip:
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
    return Clip(name, views, house, [things[k] for k in sorted(things)])


def _noticed(
    view: ChosenView, items: dict[str, Item]
) -> Iterable[tuple[dict[str, Any], str, Item]]:
    """Rows of a view with a noun and enough pixels to be noticed; not the building, nothing outside."""
    for row in view.facts["instances"]:
        item = items.get(str(row["item"]))
        if item is None or item.is_outside or item.kind.is_structure or not item.surfaces:
            continue
        noun = noun_of(view, row)
        if noun and row["fraction"] >= _GLIMPSED:
            yield row, noun, item
