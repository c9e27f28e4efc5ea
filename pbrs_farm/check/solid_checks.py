"""Boxes, floors, lights and model poses of house.json against the triangles of house.glb. Effects: none beside reading documents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pbrs_farm.check.axes import into_frame, is_rigid
from pbrs_farm.check.cases import HouseCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.plan import points_in_plan
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.house import FLOATING

_MODEL_M = 1e-4  # between two instances of a model in its frame: float32 precision in the world
_BOX_M = 0.001  # tolerance of a box's sides
_FLOOR_M = 0.05  # height of rays above a floor, clear of carpets; tolerance below it
_FLOOR_SHARE = 0.5  # least share of a floor that rays meet: the rest may be covered, or a stairwell
_LIGHT_M = (
    0.05  # between a light and its surfaces beside its radius, as of a shade's ring about a bulb
)


def check_solids(case: HouseCase) -> None:
    """Boxes, floors and bulbs of house.json are where the triangles of house.glb are."""
    house, triangles = case.house, case.rest.triangles
    for instance, row in sorted(house.items.items()):
        points = triangles.loose.get(instance)
        if points is None:
            continue
        if row["box"]:
            off = _box_off(row["box"], points.astype(np.float64))
            fault = f"its box differs by {off * 1000:.1f} mm from its triangles"
            case.expect("house items", f"item {row['id']}")(off <= _BOX_M, fault)
        if row["lights"]:
            _check_lights(case, instance)
    for name, room in house.rooms.items():
        if room["has_floor"]:
            share = _share_of_floor(room, case.rest.rays)
            fault = f"its floor is at another height below {1 - share:.0%} of it"
            case.expect("rooms", f"room {name}")(share >= _FLOOR_SHARE, fault)


def check_floating(case: HouseCase) -> None:
    """No edge of a floating item passes through a face of another one, nor the other way round."""
    house, triangles = case.house, case.rest.triangles
    hung = [n for n, row in house.items.items() if FLOATING in row["tags"]]
    if not hung:
        return
    floats = np.isin(triangles.instance, hung)
    begin, along = _edges(triangles, floats)
    owner = np.repeat(triangles.instance[floats], 3)
    touching = set(owner[_pierced(Rays(triangles, ~floats), begin, along) >= 0].tolist())
    # Of the other items, only the near triangles matter.
    corners = triangles.vertices[triangles.faces].astype(np.float64)
    low, high = begin.min(0), begin.max(0)
    near = ~floats & ((corners.max(1) >= low) & (corners.min(1) <= high)).all(1)
    face = _pierced(Rays(triangles, floats), *_edges(triangles, near))
    touching |= set(triangles.instance[face[face >= 0]].tolist())
    for instance in hung:
        expect = case.expect("floating", f"item {house.items[instance]['id']}")
        expect(instance not in touching, "is marked as hanging, but touches")


def _edges(triangles: Triangles, chosen: Bools) -> tuple[F64, F64]:
    """(3 F, 3) begins of the edges of some triangles, face by face, and the vectors to their ends."""
    corners = triangles.vertices[triangles.faces[chosen]].astype(np.float64)
    begin = corners.reshape(-1, 3)
    return begin, np.roll(corners, -1, axis=1).reshape(-1, 3) - begin


def _pierced(rays: Rays, begin: F64, along: F64) -> I64:
    """(N,) the triangle that each edge passes through, -1 = none."""
    face = rays.first(begin, along)
    return np.where(rays.distance(face, begin, along) <= 1, face, -1)


def _box_off(box: Mapping[str, Any], points: F64) -> float:
    """Largest error in metres of the sides of a box of house.json, whose axes are columns."""
    axes = np.array(box["axes"], np.float64)
    local = (points - np.array(box["centre"])) @ axes
    half = np.array(box["half"], np.float64)
    return float(np.abs([local.min(0) + half, local.max(0) - half]).max())


def _check_lights(case: HouseCase, instance: int) -> None:
    """Lights are at their surfaces, and repair.json has the same measures of them."""
    house, row = case.house, case.house.items[instance]
    place = f"{house.id} item {row['id']}"
    expect = case.tally.at("lights", place)
    measured = {(r["item_id"], r["source"]): r for r in house.repair.get("sources", [])}
    total = sum(light["share"] for light in row["lights"])
    judge("lights of an item", place, case.tally, total=total)
    for k, light in enumerate(row["lights"]):
        exist = all(0 <= n < len(row["surfaces"]) for n in light["emitting"])
        if not expect(exist, "emits from a missing surface"):
            continue
        materials = {row["surfaces"][n]["material"] for n in light["emitting"]}
        kinds = {house.house["materials"][m]["kind"] for m in materials}
        expect(kinds <= {"bulb"}, f"emits from {sorted(kinds)}")
        points = case.rest.triangles.points_of_surfaces(instance, light["emitting"])
        if len(points):
            low, high = points.min(0), points.max(0)
            outside = np.maximum(np.maximum(low - light["position"], light["position"] - high), 0)
            off = float(np.linalg.norm(outside))
            fault = f"light {k} is {off:.2f} m from its emitter"
            expect(off <= _LIGHT_M + light["radius_m"], fault)
        source = measured.get((row["id"], k))
        if source is not None:
            measures = [[r["escape"], r["radius_m"]] for r in (source, light)]
            judge("repaired light", place, case.tally, measures=measures, k=k)


def _share_of_floor(room: Mapping[str, Any], rays: Rays) -> float:
    """Share of a grid of points of a room that have the floor at its height below them."""
    points = points_in_plan(room["polygon"], 12, room["floor_y"] + _FLOOR_M, inner=True)
    if not len(points):
        return 1.0
    down = np.broadcast_to([0.0, -1.0, 0.0], points.shape)
    face = rays.first(points, down)
    return float(((face >= 0) & (rays.distance(face, points, down) <= 2 * _FLOOR_M)).mean())


def check_models(case: HouseCase) -> None:
    """Poses of placed models are rigid, and bring all instances of a model to the same points."""
    first: dict[str, tuple[str, F64]] = {}
    several = set[str]()
    for instance, row in sorted(case.house.items.items()):
        if not row.get("pose"):
            continue
        expect = case.expect("model poses", f"item {row['id']}")
        pose = np.array(row["pose"]["world_from_model"], np.float64)
        if not expect(is_rigid(pose), "has no rigid pose"):
            continue
        points = case.rest.triangles.loose.get(instance)
        if points is None:
            continue
        local = into_frame(pose, points.astype(np.float64))
        name, model = first.setdefault(row["pose"]["model"], (row["id"], local))
        if name != row["id"]:
            several.add(row["pose"]["model"])
            same = model.shape == local.shape and np.abs(model - local).max() <= _MODEL_M
            fault = f"is not where its pose brings {row['pose']['model']}, as {name} has it"
            expect(same, fault)
    for _model in first.keys() - several:
        case.tally.leave_out(
            "positions of a model's origin, of models with one instance in their home"
        )


CHECKS = (
    Check("model poses", "house", check_models, 2, ("house.json",)),
    Check("floating", "house", check_floating, 3, ("house.json",)),
    Check("house items", "house", check_solids, 4, ("house.json",)),
)
