"""Captions: a description of each view in plain English, made from its labels.

    captions.jsonl  images/<house>/<view>.png

Effects: reads views, writes files. The text is a function of the labels alone: the visible room, the
kinds and numbers of objects, and the spatial relations of the largest.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64, Mask
from pbrs_farm.core.house import ItemKind
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.content import Files, Line, each_view
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.export.nouns import counted, is_plural, listed, noun_of
from pbrs_farm.formats.output_folder import RoomOutline
from pbrs_farm.home.room_use import RoomKind, named_kind

LEAST_VISIBLE: Final = 0.3
"""Minimum visible share of an object's pixels."""
LEAST_FRACTION: Final = 0.003
"""Minimum share of the picture's pixels of an object."""
_RELATED: Final = 6  # number of largest objects with relations
_SAID: Final = 4  # maximum number of relations in the text
_ORDINALS: Final = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
_TOUCH_M: Final = 0.05  # maximum gap between an object and its support
_BEFORE_M: Final = 0.1  # distance in front of a surface, for finding its room
_POINTS: Final = 20_000  # approximate number of sampled points of a view, for finding its room
_SLACK_M: Final = 0.02  # maximum overlap of separate objects
_ROOMS: Final = {
    RoomKind.LIVING: "living room",
    RoomKind.BEDROOM: "bedroom",
    RoomKind.KITCHEN: "kitchen",
    RoomKind.DINING: "dining room",
    RoomKind.BATHROOM: "bathroom",
    RoomKind.OFFICE: "study",
    RoomKind.HALL: "hall",
    RoomKind.OUTDOOR: "place outdoors",
    RoomKind.STORE: "storeroom",
}


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A described object, with its box in the axes of the camera."""

    row: dict[str, Any]  # of view.json's instances
    noun: str
    low: F64  # (3,) x right, y down, z forward, metres
    high: F64
    low_world: F64  # (3,) y up
    high_world: F64

    @property
    def id(self) -> int:
        """Its instance."""
        return int(self.row["id"])

    @property
    def column(self) -> float:
        """The middle of its box in the picture, pixels."""
        return float(self.row["box2d"][0] + self.row["box2d"][2]) / 2


def _things(view: ChosenView) -> list[_Seen]:
    """The described objects, in descending order of pixels."""
    camera_from_world = np.linalg.inv(view.pose)
    things = []
    for row in sorted(view.facts["instances"], key=lambda r: (-r["pixels"], r["id"])):
        share = row["visible_fraction"]
        is_seen = (share is None or share >= LEAST_VISIBLE) and row["fraction"] >= LEAST_FRACTION
        noun = noun_of(view, row) if is_seen and not _is_structure(row) else ""
        if noun:
            world = _corners(row["box3d"])
            local = world @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]
            ends = (local.min(0), local.max(0), world.min(0), world.max(0))
            things.append(_Seen(row, noun, *ends))
    return things


def _is_structure(row: dict[str, Any]) -> bool:
    return any(kind.is_structure for kind in ItemKind if kind == row["kind"])


def _corners(box: dict[str, Any]) -> F64:
    """(8, 3) corners of an oriented box, world."""
    signs = np.array([[1 if i >> k & 1 else -1 for k in range(3)] for i in range(8)])
    half, axes = np.array(box["half"], np.float64), np.array(box["axes"], np.float64)
    return np.asarray(np.array(box["centre"]) + (signs * half) @ axes)


def _titles(things: Sequence[_Seen]) -> dict[int, str]:
    """Instance -> a unique phrase: "the sofa", "the left chair", "the third lamp from the left"."""
    titles = {}
    for noun in dict.fromkeys(thing.noun for thing in things):
        same_noun = sorted((t for t in things if t.noun == noun), key=lambda t: (t.column, t.id))
        for k, thing in enumerate(same_noun):
            if len(same_noun) == 1:
                title = f"the {noun}"
            elif len(same_noun) == 2:
                title = f"the {('left', 'right')[k]} {noun}"
            else:
                ordinal = _ORDINALS[k] if k < len(_ORDINALS) else f"{k + 1}th"
                title = f"the {ordinal} {noun} from the left"
            titles[thing.id] = title
    return titles


def _relation(a: _Seen, b: _Seen, *, by_axes: bool) -> str:
    """Position of a relative to b; "" if no word fits. by_axes: the camera looks one way."""
    if _is_on(a, b):
        return "on top of"
    if not by_axes or _is_on(b, a):
        return ""
    axes = (a.low - b.high > -_SLACK_M, b.low - a.high > -_SLACK_M)  # behind it, before it, by axis
    if not (axes[0][0] or axes[1][0]):
        return "behind" if axes[0][2] else "in front of" if axes[1][2] else ""
    # Beside each other both in the room and in the picture.
    if axes[0][0]:
        return "to the right of" if a.column > b.column else ""
    return "to the left of" if a.column < b.column else ""


def _is_on(a: _Seen, b: _Seen) -> bool:
    """True if b supports a: a's bottom is at the height of b's top, and a's centre is above b."""
    middle = (a.low_world + a.high_world) / 2
    over = (b.low_world <= middle) & (middle <= b.high_world)
    return bool(abs(a.low_world[1] - b.high_world[1]) <= _TOUCH_M and over[0] and over[2])


def _relations(view: ChosenView, things: Sequence[_Seen]) -> list[dict[str, Any]]:
    """Relations of each pair of the largest objects, smaller first: "on top of" first, then by size."""
    by_axes = view.intrinsics.lens.depth_is_planar
    rows = []
    for larger, smaller in combinations(things[:_RELATED], 2):
        relation = _relation(smaller, larger, by_axes=by_axes)
        pair = smaller, larger
        if not relation and _is_on(larger, smaller):
            relation, pair = "on top of", (larger, smaller)
        if relation:
            rows.append({"subject": pair[0].id, "relation": relation, "object": pair[1].id})
    return sorted(rows, key=lambda row: row["relation"] != "on top of")


def _files(view: ChosenView) -> Files:
    """images/<house>/<view>.png, and a line of captions.jsonl.

    A line has file_name, text, objects (id, noun, box2d, the largest first) and relations (subject,
    relation, object by id, among the largest six). An object is listed if LEAST_VISIBLE of it is
    visible on LEAST_FRACTION of the picture; walls, floors and ceilings are not listed. Nouns are
    NYU40's, or the names of the user's classes. Views without a picture are left out.
    """
    name = f"images/{view.house.id}/{view.id}.png"
    row = json.dumps({"file_name": name, **caption(view)}, ensure_ascii=False)
    return {name: view.shown, "captions.jsonl": Line(row)}


def caption(view: ChosenView) -> dict[str, Any]:
    """text, objects and relations of a view, as _files says.

    Depends on the labels alone, so the same view gives the same words. Objects carry box2d as view.json
    has it; relations name them by id.
    """
    things = _things(view)
    relations = _relations(view, things)
    objects = [{"id": t.id, "noun": t.noun, "box2d": t.row["box2d"]} for t in things]
    sentences = [_first_sentence(view, things), *_relation_sentences(relations, _titles(things))]
    return {"text": " ".join(sentences), "objects": objects, "relations": relations}


def _first_sentence(view: ChosenView, things: Sequence[_Seen]) -> str:
    # In the order of the largest of each noun.
    counts = Counter(thing.noun for thing in things)
    nouns = listed([counted(n, noun) for noun, n in counts.items()]) if counts else ""
    room = _room(view)
    if not room:
        return f"The picture shows {nouns or 'an object'}."
    return f"The picture shows {room} with {nouns}." if nouns else f"The picture shows {room}."


def _room(view: ChosenView) -> str:
    """The visible room by its use, else by its name; "" for a model without context."""
    if view.house.id.startswith("object_"):
        return ""
    room_id = seen_room(view)
    name = view.house.rooms.get(room_id, room_id)
    kind = named_kind(name)
    # A studio is a study in some languages and a home of one room in others.
    if kind is RoomKind.OFFICE and any(row["class"] == "bed" for row in view.facts["instances"]):
        return "a studio"
    if kind in _ROOMS:
        return counted(1, _ROOMS[kind])
    is_named = name not in (room_id, f"Room {room_id}", "")
    return f'a room called "{name}"' if is_named else "a room"


def seen_room(view: ChosenView) -> str:
    """The room with most of the visible points; the camera's room if no point is in a room.

    Points are moved 0.1 m in front of their surface, so that a wall counts for the room on the camera's
    side. A point belongs to the room with the highest floor below it.
    """
    outlines = view.house.outlines
    points = _seen_points(view) if outlines else np.zeros((0, 3))
    if not len(points):
        return view.entry.room_id
    rooms = sorted(outlines, key=lambda one: -outlines[one].floor_y)
    inside = [_is_over(points, outlines[room]) for room in rooms]
    # Of rooms above each other the highest below the point.
    first = np.argmax([*inside, np.ones(len(points), bool)], axis=0)
    counts = np.bincount(first, minlength=len(rooms) + 1)[:-1]
    return rooms[int(counts.argmax())] if counts.any() else view.entry.room_id


def _is_over(points: F64, room: RoomOutline) -> Mask:
    plan = shapely.contains_xy(shapely.Polygon(room.polygon), points[:, 0], points[:, 2])
    return np.asarray(plan & (points[:, 1] > room.floor_y - _BEFORE_M))


def _seen_points(view: ChosenView) -> F64:
    """(N, 3) points before the surfaces of a grid of pixels, world, metres."""
    depth = view.array("depth")
    step = max(1, int(np.sqrt(depth.size / _POINTS)))
    y, x = (g.ravel() for g in np.mgrid[: depth.shape[0] : step, : depth.shape[1] : step])
    z = depth[y, x] / 1000
    y, x, z = y[z > 0], x[z > 0], z[z > 0]
    pixels = np.stack([x + 0.5, y + 0.5], axis=1)
    slant = np.linalg.norm(view.intrinsics.directions(pixels), axis=1)
    return view.in_world(pixels, np.maximum(z - _BEFORE_M / np.maximum(slant, 1), 0))


def _relation_sentences(relations: Iterable[dict[str, Any]], titles: dict[int, str]) -> list[str]:
    """Sentences for the first relations, at most one per subject."""
    first: dict[int, dict[str, Any]] = {}
    for row in relations:
        first.setdefault(row["subject"], row)
    sentences = []
    for row in list(first.values())[:_SAID]:
        subject, relation, target = (titles[row["subject"]], row["relation"], titles[row["object"]])
        verb = "are" if is_plural(subject.partition(" from the left")[0]) else "is"
        sentences.append(f"{subject[0].upper()}{subject[1:]} {verb} {relation} {target}.")
    return sentences


FORM = ViewForm(
    "captions",
    each_view(_files),
    "`captions.jsonl`, a line a view: `file_name` (`images/<house>/<view>.png`), `text` in plain"
    " English, `objects` (`id`, `noun`, `box2d`), `relations` (`subject`, `relation`, `object` by id)",
    takes=replace(PICTURES, left_out=""),
    has_classes=True,
    convention=Convention(0.5, axes=""),
)
