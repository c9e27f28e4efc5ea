"""Joints of house.json against house.glb, and a view's articulation.json; no effects but reading it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import ndimage

from pbrs_farm.check.axes import into_frame
from pbrs_farm.check.cases import HouseCase, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.rules import judge
from pbrs_farm.core.arrays import F64

_EQUAL = 1e-6  # metres, radians, parts of a unit vector
_NEAR_M = 0.1  # maximum distance of a hinge from its part
_MOST = {"revolute": 2 * np.pi, "prismatic": 5.0}  # largest value of a joint, rad or m
_HEAVIEST_KG = 1000.0


def check_joints(case: HouseCase) -> None:
    """Every joint moves a part of house.glb, about a unit axis near it, within its limits."""
    triangles = case.rest.triangles
    for instance, item in case.house.items.items():
        faces = triangles.instance == instance
        in_glb = {triangles.parts[int(k)] for k in np.unique(triangles.part[faces])} - {""}
        parts = [str(joint["part"]) for joint in item.get("joints", [])]
        place = f"item {item['id']}"
        expect = case.expect("joints", place)
        same = len(set(parts)) == len(parts) and in_glb <= set(parts)
        expect(same, f"parts {sorted(in_glb)} of house.glb, joints of {parts}")
        named = {str(s["part"]) for s in item["surfaces"] if s.get("part") and s["n_faces"]}
        expect(named == in_glb, "its surfaces are of other parts in house.glb")
        for joint in item.get("joints", []):
            expect = case.expect("joints", f"{place}/{joint['part']}")
            expect(_is_sound(joint), "its axis, limits or mass are invalid")
            points = triangles.points_of(faces & triangles.is_part(joint["part"]))
            if joint["kind"] == "revolute" and len(points):
                far = _off_axis(joint, points)
                expect(far <= _NEAR_M, f"its axis is off by {far:.2f} m")


def _is_sound(joint: Mapping[str, Any]) -> bool:
    most = _MOST.get(joint["kind"], -1.0)
    lower, value, upper = (float(joint[k]) for k in ("lower", "value", "upper"))
    return bool(
        abs(np.linalg.norm(joint["axis"]) - 1) <= _EQUAL
        and -most <= lower <= value + _EQUAL
        and value <= upper + _EQUAL
        and upper <= most
        and 0 <= joint["mass_kg"] <= _HEAVIEST_KG
    )


def _off_axis(joint: Mapping[str, Any], points: F64) -> float:
    """Distance in metres between a hinge's axis and the nearest point of its part."""
    away = points - np.array(joint["point"], np.float64)
    axis = np.array(joint["axis"], np.float64)
    return float(np.linalg.norm(away - (away @ axis)[:, None] * axis, axis=1).min())


def check_articulation(case: ViewCase) -> None:
    """articulation.json has a row for each visible part: that of house.json, in the camera's frame."""
    place, parts = f"{case.place}/articulation.json", case.arrays["part"]
    expect = case.tally.at("articulation", place)
    counts = np.bincount(parts.reshape(-1), minlength=1)
    rows = {int(row["id"]): row for row in case.view.parts}
    visible = {int(k) for k in np.nonzero(counts)[0]} - {0}
    expect(rows.keys() == visible, f"ids {sorted(rows.keys() ^ visible)[:5]}")
    # Parts are numbered through the house, in the order of its items and their joints.
    triples = ((k, item, j) for k, item in sorted(case.house.items.items()) for j in item.get("joints", []))  # fmt: skip
    joints = dict(enumerate(triples, start=1))
    boxes = ndimage.find_objects(parts.astype(np.int32))
    pose = case.view.world_from_camera
    for number in sorted(rows.keys() & visible & joints.keys()):
        instance, item, joint = joints[number]
        axis = np.array(joint["axis"], np.float64) @ pose[:3, :3]
        point = into_frame(pose, np.array(joint["point"], np.float64))
        ys, xs = boxes[number - 1]
        box = [xs.start, ys.start, xs.stop, ys.stop]
        judge(
            "articulation", place, case.tally, row=rows[number], item=item, joint=joint,
            instance=instance, number=number, geometry=np.stack([axis, point]),
            stored=[rows[number]["axis_opencv"], rows[number]["point_opencv"]],
            picture={"pixels": int(counts[number]), "box2d": box},
        )  # fmt: skip
    unknown = (rows.keys() & visible) - joints.keys()
    expect(not unknown, f"parts {sorted(unknown)[:5]} are not in house.json")


CHECKS = (
    Check("joints", "house", check_joints, 5, ("house.json",)),
    Check("articulation", "view", check_articulation, 16, ("part",)),
)
