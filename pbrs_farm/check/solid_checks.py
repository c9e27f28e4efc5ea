"""What house.json says of solids against the triangles of house.glb: boxes, floors, lights, poses of models. Effects: none beside reading documents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Floats, Rays
from pbrs_farm.check.fact_checks import is_rigid
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.house import FLOATING

MODEL_M = (
    1e-4  # between two instances of one model, in its own frame: what float32 keeps in the world
)
BOX_M = 0.001  # by which a side of a box may differ from its triangles
FLOOR_M = 0.05  # above a floor, where what lies on it is not met, and below it
FLOOR_SHARE = 0.5  # of a room's floor: the rest may be covered, or a stairwell
LIGHT_M = 0.05  # between a light and its surfaces, beside its radius: a shade's ring about a bulb
TOLD_STEP = 1e-6  # repair.json tells measures to six digits


def check_solids(house: StoredHouse, triangles: Triangles, rays: Rays, tally: Tally) -> None:
    """Boxes, floors and bulbs that house.json tells of are where the triangles of house.glb are."""
    for instance, row in sorted(house.items.items()):
        place = f"{house.id} item {row['id']}"
        points = triangles.loose.get(instance)
        if points is None:
            continue
        if row["box"]:
            off = _box_off(row["box"], points.astype(np.float64))
            what = f"its box differs by {off * 1000:.1f} mm from its triangles"
            tally.expect("house items", place, off <= BOX_M, what)
        if row["lights"]:
            _check_lights(house, instance, triangles, place, tally)
    for name, room in house.rooms.items():
        if room["has_floor"]:
            share = _share_of_floor(room, rays)
            what = f"its floor lies elsewhere below {1 - share:.0%} of it"
            tally.expect("rooms", f"{house.id} room {name}", share >= FLOOR_SHARE, what)


def check_floating(house: StoredHouse, triangles: Triangles, tally: Tally) -> None:
    """What hangs in the air touches nothing that stands: no edge of either passes through a face of the other."""
    hung = [n for n, row in house.items.items() if FLOATING in row["tags"]]
    if not hung:
        return
    floats = np.isin(triangles.instance, hung)
    begin, along = _edges(triangles, floats)
    owner = np.repeat(triangles.instance[floats], 3)
    touches = set(owner[_met(Rays(triangles, ~floats), begin, along) >= 0].tolist())
    # Of what stands, look at what is near.
    corners = triangles.vertices[triangles.faces].astype(np.float64)
    low, high = begin.min(0), begin.max(0)
    near = ~floats & ((corners.max(1) >= low) & (corners.min(1) <= high)).all(1)
    met = _met(Rays(triangles, floats), *_edges(triangles, near))
    touches |= set(triangles.instance[met[met >= 0]].tolist())
    for instance in hung:
        place = f"{house.id} item {house.items[instance]['id']}"
        tally.expect("floating", place, instance not in touches, "is said to hang, and touches")


def _edges(triangles: Triangles, which: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """(3 F, 3) begins of the edges of some triangles, face by face, and the ways to their ends."""
    corners = triangles.vertices[triangles.faces[which]].astype(np.float64)
    begin = corners.reshape(-1, 3)
    return begin, np.roll(corners, -1, axis=1).reshape(-1, 3) - begin


def _met(rays: Rays, begin: Floats, along: Floats) -> NDArray[np.int64]:
    """(N,) the triangle that each edge passes through, -1 = none."""
    face = rays.first(begin, along)
    return np.where(rays.distance(face, begin, along) <= 1, face, -1)


def _box_off(box: Mapping[str, Any], points: Floats) -> float:
    """Metres by which the worst side of a box of house.json, whose axes are columns, is off."""
    axes = np.array(box["axes"], np.float64)
    local = (points - np.array(box["centre"])) @ axes
    half = np.array(box["half"], np.float64)
    return float(np.abs([local.min(0) + half, local.max(0) - half]).max())


def _check_lights(
    house: StoredHouse, instance: int, triangles: Triangles, place: str, tally: Tally
) -> None:
    """A light stands where its surfaces are; what repair measured of it is told alike."""
    row = house.items[instance]
    measured = {
        (r["item_id"], r["source"]): r for r in house.repair.get("sources", [])
    }  # fmt: skip
    total = sum(light["share"] for light in row["lights"])
    tally.expect(
        "lights", place, abs(total - 1) <= 1e-6, f"its lights share {total:g} of its power"
    )
    for k, light in enumerate(row["lights"]):
        same = all(0 <= n < len(row["surfaces"]) for n in light["emitting"])
        if not tally.expect("lights", place, same, "shines by a surface that it has not"):
            continue
        kinds = {
            house.house["materials"][row["surfaces"][n]["material"]]["kind"]
            for n in light["emitting"]
        }
        tally.expect("lights", place, kinds <= {"bulb"}, f"shines by what is {sorted(kinds)}")
        points = triangles.points_of_surfaces(instance, light["emitting"])
        if len(points):
            low, high = points.min(0), points.max(0)
            outside = np.maximum(np.maximum(low - light["position"], light["position"] - high), 0)
            off = float(np.linalg.norm(outside))
            what = f"light {k} stands {off:.2f} m beside what shines"
            tally.expect("lights", place, off <= LIGHT_M + light["radius_m"], what)
        told = measured.get((row["id"], k))
        if told is not None:
            same = all(abs(told[n] - light[n]) <= TOLD_STEP for n in ("escape", "radius_m"))
            tally.expect("lights", place, same, f"light {k} is another in repair.json")


def _share_of_floor(room: Mapping[str, Any], rays: Rays) -> float:
    """The part of a grid of points of a room below which the floor lies where it is told to."""
    corners = np.array(room["polygon"], np.float64)
    low, high = corners.min(0), corners.max(0)
    x, z = np.meshgrid(*(np.linspace(a, b, 12)[1:-1] for a, b in zip(low, high, strict=True)))
    inside = [p for p in np.stack([x.ravel(), z.ravel()], 1) if is_within(room["polygon"], p)]
    if not inside:
        return 1.0
    above = np.insert(np.array(inside), 1, room["floor_y"] + FLOOR_M, axis=1)
    down = np.broadcast_to([0.0, -1.0, 0.0], above.shape)
    face = rays.first(above, down)
    return float(((face >= 0) & (rays.distance(face, above, down) <= 2 * FLOOR_M)).mean())


def is_within(polygon: list[list[float]], point: Floats) -> bool:
    """Whether a polygon in plan holds a point: an odd number of its sides lie beyond it."""
    corners = np.array(polygon, np.float64)
    a, b = corners, np.roll(corners, -1, axis=0)
    crosses = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (point[1] - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool((crosses & (point[0] < at)).sum() % 2)


def check_models(house: StoredHouse, triangles: Triangles, tally: Tally) -> None:
    """Poses of placed models are rigid, and bring instances of one model to the same points."""
    first: dict[str, tuple[str, Floats]] = {}
    for instance, row in sorted(house.items.items()):
        if not row.get("pose"):
            continue
        place = f"{house.id} item {row['id']}"
        pose = np.array(row["pose"]["world_from_model"], np.float64)
        if not tally.expect("model poses", place, is_rigid(pose), "has no rigid pose"):
            continue
        points = triangles.loose.get(instance)
        if points is None:
            continue
        own = (points.astype(np.float64) - pose[:3, 3]) @ pose[:3, :3]
        name, known = first.setdefault(row["pose"]["model"], (row["id"], own))
        if name != row["id"]:
            same = known.shape == own.shape and bool(np.abs(known - own).max() <= MODEL_M)
            what = f"is not where its pose brings {row['pose']['model']}, as {name} has it"
            tally.expect("model poses", place, same, what)
