"""A stored house at another time: what house.json says of motions, worked out again; no effects.

Shares no code with the stages: keys are taken between by numpy and scipy, and triangles of house.glb moved by
rotations about the joints' axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.embree_caster import Faces, Floats
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

_EQUAL: Final = 1e-9  # of values that are worked out again: metres, radians, parts of a rotation
_UNIT: Final = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class MovedHouse:
    """A house and its triangles at a time."""

    house: StoredHouse
    triangles: Triangles
    instances: frozenset[int]  # of what may move

    def carried(self, now: MovedHouse, points: Floats, faces: Faces) -> Floats:
        """(N, 3) where points on faces (N,) of the house now are at this house's time."""
        a, b = (
            h.triangles.vertices[h.triangles.faces[faces]].astype(np.float64) for h in (now, self)
        )
        # A face moves rigidly: the same steps along its edges and its normal.
        here, there = _frames(a), _frames(b)
        steps = np.einsum("nij,nj->ni", np.linalg.inv(here), points - a[:, 0])
        moved = b[:, 0] + np.einsum("nij,nj->ni", there, steps)
        # Float32 of vertices that stand still says nothing.
        return np.where((a == b).all((1, 2))[:, None], points, moved)


def _frames(corners: Floats) -> Floats:
    """(N, 3, 3) columns: two edges of each triangle and their unit normal."""
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([e1, e2, normal], axis=-1)


def house_at(house: StoredHouse, triangles: Triangles, time_s: float | None) -> MovedHouse:
    """The house at a time in seconds; at rest for None. KeyError or ValueError for damaged motions."""
    motions = house.house.get("motions", [])
    by_id = {str(row["id"]): k for k, row in house.items.items()}
    if time_s is None or not motions:
        return MovedHouse(house, triangles, frozenset())
    document = deepcopy({k: v for k, v in house.house.items() if k != "items"})
    rows = {int(row["instance"]): dict(row) for row in house.house["items"]}
    vertices, normals = triangles.vertices.copy(), triangles.normals.copy()
    loose = dict(triangles.loose)
    # Joints first, then the item with all its parts.
    for motion in sorted(motions, key=lambda m: not m["part"]):
        instance = by_id[str(motion["item"])]
        row, own = rows[instance], triangles.instance == instance
        if motion["part"]:
            turn, step = _joint_moves(motion, row, time_s)
            number = (
                triangles.parts.index(motion["part"]) if motion["part"] in triangles.parts else -1
            )
            own = own & (triangles.part == number)
        else:
            turn, step = _body_moves(motion, time_s)
            _move_row(row, turn, step)
            loose[instance] = (loose[instance] @ turn.T + step).astype(np.float32)
        used = np.unique(triangles.faces[own])
        vertices[used] = (vertices[used].astype(np.float64) @ turn.T + step).astype(np.float32)
        normals[used] = (normals[used].astype(np.float64) @ turn.T).astype(np.float32)
        if motion["part"]:
            loose[instance] = vertices[np.unique(triangles.faces[triangles.instance == instance])]
    document["items"] = list(rows.values())
    moved = replace(triangles, vertices=vertices, normals=normals, loose=loose)
    named = frozenset(by_id[str(m["item"])] for m in motions)
    return MovedHouse(StoredHouse(house.folder, document), moved, named)


def _joint_moves(
    motion: Mapping[str, Any], row: dict[str, Any], time_s: float
) -> tuple[Floats, Floats]:
    """(3, 3) and (3,) of a part from rest; its value is written into the item's row."""
    value = float(np.interp(time_s, motion["times_s"], [v[0] for v in motion["values"]]))
    joints = [dict(joint) for joint in row["joints"]]
    joint = next(j for j in joints if j["part"] == motion["part"])
    by, axis = value - joint["value"], np.array(joint["axis"], np.float64)
    joint["value"], row["joints"] = value, joints
    if joint["kind"] == "prismatic":
        return np.eye(3), by * axis
    turn, point = Rotation.from_rotvec(by * axis).as_matrix(), np.array(joint["point"], np.float64)
    return turn, point - turn @ point


def _body_moves(motion: Mapping[str, Any], time_s: float) -> tuple[Floats, Floats]:
    """(3, 3) and (3,) of a whole item from rest."""
    times, values = np.array(motion["times_s"], np.float64), np.array(motion["values"], np.float64)
    at = float(np.clip(time_s, times[0], times[-1]))
    place = np.array([np.interp(at, times, values[:, k]) for k in range(3)])
    turns = Rotation.from_quat(values[:, [4, 5, 6, 3]])
    turn = turns[0] if len(times) == 1 else Slerp(times, turns)(at)
    matrix = turn.as_matrix()
    return matrix, place - matrix @ np.array(motion["pivot"], np.float64)


def _move_row(row: dict[str, Any], turn: Floats, step: Floats) -> None:
    """Move what an item's row says of places: its box, joints and pose."""
    if row.get("box"):
        axes = turn @ np.array(row["box"]["axes"], np.float64)
        row["box"] = {**row["box"], "axes": axes.tolist()}
    if row.get("pose"):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, step
        pose = matrix @ np.array(row["pose"]["world_from_model"], np.float64)
        row["pose"] = {**row["pose"], "world_from_model": pose.tolist()}
    if row.get("joints"):
        row["joints"] = [
            {
                **joint, "axis": (turn @ np.array(joint["axis"])).tolist(),
                "point": (turn @ np.array(joint["point"]) + step).tolist(),
            }
            for joint in row["joints"]
        ]  # fmt: skip


def check_motions(house: StoredHouse, tally: Tally) -> None:
    """Each motion of house.json is of an item or a joint that there is, times ascend, turns are unit.

    Joints stay within their limits.
    """
    of_item = {str(row["id"]): row for row in house.items.values()}
    seen = set()
    for motion in house.house.get("motions", []):
        part, place = motion["part"], f"{house.id} motion of {motion['item']}/{motion['part']}"
        row = of_item.get(str(motion["item"]), {})
        joint = {j["part"]: j for j in row.get("joints", [])}.get(part)
        there = bool(row) and (joint is not None or not part)
        there &= (motion["item"], part) not in seen
        seen.add((motion["item"], part))
        if not tally.expect("motions", place, there, "moves nothing of its own"):
            continue
        times, values = np.array(motion["times_s"]), np.array(motion["values"], np.float64)
        shaped = values.shape == (len(times), 1 if part else 7) and len(times) > 0
        ascend = shaped and bool((np.diff(times) > 0).all() and np.isfinite(values).all())
        if not tally.expect("motions", place, ascend, "has times or values that are none"):
            continue
        if joint is not None:
            within = bool(
                (values >= joint["lower"] - _UNIT).all()
                and (values <= joint["upper"] + _UNIT).all()
            )
            tally.expect("motions", place, within, "leaves the joint's limits")
        else:
            off = np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1).max()
            tally.expect("motions", place, bool(off <= _UNIT), "has a turn that is none")
            off = np.abs(np.array(motion["pivot"], np.float64)).max()
            tally.expect("motions", place, bool(off < 1e4), "turns about a place far away")


def check_motion_table(view: StoredView, house: StoredHouse, tally: Tally) -> None:
    """What view.json says of where things are is what house.json's motions give at the view's time."""
    motions, table, time_s = (
        house.house.get("motions", []),
        view.table.get("motion"),
        view.table.get("time_s"),
    )
    expected = bool(motions) and time_s is not None
    what = "tells nothing of what moves" if expected else "tells of motions where nothing moves"
    if (
        not tally.expect("motions", view.place, (table is not None) == expected, what)
        or table is None
        or time_s is None
    ):
        return
    by_id = {str(row["id"]): k for k, row in house.items.items()}
    joints = [m for m in motions if m["part"]]
    bodies = [m for m in motions if not m["part"]]
    named = [(by_id[m["item"]], m["item"], m["part"]) for m in joints]
    same = [(r["instance"], r["item"], r["part"]) for r in table["joints"]] == named
    same &= [(r["instance"], r["item"]) for r in table["bodies"]] == [
        (by_id[m["item"]], m["item"]) for m in bodies
    ]
    if not tally.expect("motions", view.place, same, "names other things than house.json"):
        return
    for row, motion in zip(table["joints"], joints, strict=True):
        value = np.interp(time_s, motion["times_s"], [v[0] for v in motion["values"]])
        what = f"{row['item']}/{row['part']} is at {row['value']}, by house.json {value}"
        tally.expect("motions", view.place, abs(row["value"] - value) <= _EQUAL, what)
    for row, motion in zip(table["bodies"], bodies, strict=True):
        turn, step = _body_moves(motion, float(time_s))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, step
        off = np.abs(np.array(row["world_from_rest"], np.float64) - matrix).max()
        tally.expect(
            "motions", view.place, bool(off <= _UNIT), f"{row['item']} is off by {off:.2g}"
        )
