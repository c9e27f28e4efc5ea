"""Joints of house.json against house.glb and joints.csv, and a view's articulation.json; reads files."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy import ndimage

from pbrs_farm.check.axes import into_frame
from pbrs_farm.check.cases import HouseCase, ViewCase
from pbrs_farm.check.certificate import Expect
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.moving_parts import MovingPart, mass_kg
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.classes import DOOR
from pbrs_farm.core.record import Record, Several, read_csv

_EQUAL = 1e-6  # metres, radians, parts of a unit vector
_NEAR_M = 0.1  # maximum distance of a hinge from its part
_MOST = {"revolute": 2 * np.pi, "prismatic": 5.0}  # largest value of a joint, rad or m
_SLACK, _INSIDE = 0.02, 0.1  # shares of a part: noise, and of one that has its body around it
_STATED = 4.0  # factor between a mass that a source states and that of its boards
_TILT = 1e-4  # radians
_LEVEL_SHARE = 0.3  # of a leaf's area, least
_STANDS_OUT_M = 0.15  # beyond the item's box, of a closed leaf
_PULL = 0.4  # least place of a handle, as a share of the leaf's width
_RAIL_M = 0.03  # beyond the item's sides, of a sliding leaf
_GAP_M = 0.005  # behind the front of a closed drawer


class JointRow(Record):
    """A row of joints.csv: the joint of a part of generated items."""

    source: Several[str]  # patterns of Item.source_class
    word: str = ""  # begins the part's name
    kind: Literal["revolute", "prismatic"]
    axis: Literal["up", "level", ""] = ""
    least: float  # limits of the widest opening
    most: float
    of: Literal["rad", "open", "length", "depth"]  # open: radians, or its value if larger
    edge: float = 0.0  # most metres between a hinge and its leaf's edge
    face_least: float = 0.0  # metres of a hinge before its leaf's face
    face_most: float = 0.0


@functools.cache
def joint_rows() -> tuple[JointRow, ...]:
    """The rows of joints.csv; the first that fits a part counts."""
    return read_csv(Path(__file__).with_name("joints.csv"), JointRow)


def row_of(item: Mapping[str, Any], joint: Mapping[str, Any]) -> JointRow | None:
    """The row of a joint of an item of house.json; None for a joint that only its source states."""
    for row in joint_rows():
        fits = any(fnmatchcase(item["source_class"], s) for s in row.source)
        # Models of the example homes have hinges and rails alike.
        is_kind = row.of != "open" or row.kind == joint["kind"]
        if fits and is_kind and joint["part"].startswith(row.word):
            return row
    return None


def check_joints(case: HouseCase) -> None:
    """Every joint moves a part of house.glb, at a hinge at its edge or on a rail, within its limits."""
    triangles = case.rest.triangles
    for instance, item in case.house.items.items():
        faces = triangles.instance == instance
        in_glb = {triangles.parts[int(k)] for k in np.unique(triangles.part[faces])} - {""}
        parts = [str(joint["part"]) for joint in item.get("joints", [])]
        expect = case.expect("joints", f"item {item['id']}")
        same = len(set(parts)) == len(parts) and in_glb <= set(parts)
        expect(same, f"parts {sorted(in_glb)} of house.glb, joints of {parts}")
        named = {str(s["part"]) for s in item["surfaces"] if s.get("part") and s["n_faces"]}
        expect(named == in_glb, "its surfaces are of other parts in house.glb")
        if parts:
            _check_moving(case, item, triangles.only(instance))


def _check_moving(case: HouseCase, item: Mapping[str, Any], own: Triangles) -> None:
    """Check the joints of an item, given its triangles."""
    still = own.is_part("")
    axes = np.array(item["box"]["axes"], np.float64) if item["box"] else np.eye(3)
    body, points = Rays(own, still), own.points_of(still)
    for joint in item["joints"]:
        expect = case.expect("joints", f"item {item['id']}/{joint['part']}")
        of_part = own.is_part(joint["part"])
        if not expect(_is_sound(joint), "its axis or limits are invalid") or not of_part.any():
            continue
        part = MovingPart(joint, own, of_part, body, points, axes)
        row = row_of(item, joint)
        _check_mass(case, item, part, is_generated=row is not None)
        if part.joint["kind"] == "revolute":
            far = _off_axis(joint, own.points_of(of_part))
            expect(far <= _NEAR_M, f"its axis is off by {far:.2f} m")
        if row is None or not len(points) or (row.kind == "revolute" and not row.edge):
            case.tally.leave_out("hinges, values or limits of joints that only their source states")
        if not len(points):
            continue
        ahead, behind = part.into_body(1.0), part.into_body(-1.0)
        is_free = ahead <= behind + _SLACK or behind > _INSIDE
        expect(is_free, f"opens into its item: {ahead:.0%} of it, {behind:.0%} the other way")
        if row is not None and expect(joint["kind"] == row.kind, f"is not {row.kind}"):
            _check_row(expect, part, row)


def _check_mass(
    case: HouseCase, item: Mapping[str, Any], part: MovingPart, *, is_generated: bool
) -> None:
    only = int(item["nyu40"]) if item["nyu40"] == DOOR else 0
    estimate = mass_kg(part.item, part.part, case.house.house["materials"], only)
    stored = part.joint["mass_kg"]
    if abs(stored - estimate) <= 0.001 + 0.001 * estimate:
        case.tally.add("joints", 1)
        return
    most = 1.0 if is_generated else _STATED
    fault = f"its mass is {stored:.2f} kg, by its boards {estimate:.2f} kg"
    place = f"item {item['id']}/{part.joint['part']}"
    if case.expect("joints", place)(estimate / most < stored < estimate * most, fault):
        case.tally.leave_out("masses of joints that only their source states, within a factor of 4")


def _check_row(expect: Expect, part: MovingPart, row: JointRow) -> None:
    """Check a joint against its row of joints.csv."""
    joint, upper = part.joint, part.joint["upper"]
    sizes = part.sizes(row.of)
    is_limit = any(row.least * size <= upper <= row.most * size for size in sizes)
    is_limit |= row.of == "open" and upper == joint["value"]
    limits = f"{row.least * sizes[0]:.3f} to {row.most * sizes[0]:.3f}"
    fault = f"opens from {joint['lower']:.3f} to {upper:.3f}, by its shape from 0 to {limits}"
    expect(is_limit and joint["lower"] == 0, fault)
    expect(part.tilt <= _TILT, f"its axis is tilted by {np.degrees(part.tilt):.2f} degrees")
    is_so = not row.axis or (abs(joint["axis"][1]) > 0.5) == (row.axis == "up")
    expect(is_so, f"its axis is not {row.axis}")
    if row.kind == "revolute":
        if not row.edge:
            return
        expect(part.level_share >= _LEVEL_SHARE, "is not parallel to its item when closed")
        expect(part.beyond_sides <= _STANDS_OUT_M, "stands out of its item when closed")
        expect(part.edge_off <= row.edge, f"its hinge is {part.edge_off:.3f} m beside its edge")
        off = part.face_off
        is_at_face = row.face_least <= off <= row.face_most
        expect(is_at_face, f"its hinge is {off:.3f} m before the side to which it opens")
        expect(part.pull >= _PULL, "its handle is at its hinge")
        return
    behind, ahead = part.beyond(0.0)
    if row.word == "leaf":
        off = max(ahead, behind, *part.beyond(upper))
        expect(off <= _RAIL_M, f"slides {off:.3f} m out of its item")
        return
    expect(part.gap <= _GAP_M, f"is {part.gap:.3f} m open when closed")
    out = part.beyond(upper)[1]
    expect(out >= upper / 2, f"stands {out:.3f} m out of its item when open")


def _is_sound(joint: Mapping[str, Any]) -> bool:
    most = _MOST.get(joint["kind"], -1.0)
    lower, value, upper = (float(joint[k]) for k in ("lower", "value", "upper"))
    return bool(
        abs(np.linalg.norm(joint["axis"]) - 1) <= _EQUAL
        and -most <= lower <= value + _EQUAL
        and value <= upper + _EQUAL
        and upper <= most
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
