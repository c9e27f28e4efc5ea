"""What opens: joints of house.json by themselves and against house.glb, a view's articulation.json; no effects but reading it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.check.stored_view import StoredView

_EQUAL: Final = 1e-6  # metres, radians, parts of a unit vector
_NEAR_M: Final = 0.1  # of a hinge to what hangs on it
_MOST_RAD: Final = 2 * np.pi
_MOST_M: Final = 5.0
_HEAVIEST_KG: Final = 1000.0
_COPIED: Final = ("part", "kind", "value", "lower", "upper", "mass_kg")


def check_joints(house: StoredHouse, triangles: Triangles, tally: Tally) -> None:
    """Every joint moves a part that house.glb has, about a unit axis near it, within its limits."""
    for instance, item in house.items.items():
        own = triangles.instance == instance
        in_glb = {triangles.parts[int(k)] for k in np.unique(triangles.part[own])} - {""}
        told = [str(joint["part"]) for joint in item.get("joints", [])]
        place = f"{house.id} item {item['id']}"
        same = len(set(told)) == len(told) and in_glb <= set(told)
        tally.expect(
            "joints", place, same, f"parts {sorted(in_glb)} of house.glb, joints of {told}"
        )
        named = {str(s["part"]) for s in item["surfaces"] if s.get("part") and s["n_faces"]}
        tally.expect(
            "joints", place, named == in_glb, "its surfaces are of other parts in house.glb"
        )
        for joint in item.get("joints", []):
            where = f"{place}/{joint['part']}"
            tally.expect("joints", where, _is_sound(joint), "its axis, limits or mass are none")
            points = triangles.vertices[
                triangles.faces[own & (triangles.part == _number(triangles, joint["part"]))]
            ]
            if joint["kind"] == "revolute" and len(points):
                far = _off_axis(joint, points.reshape(-1, 3).astype(np.float64))
                tally.expect("joints", where, far <= _NEAR_M, f"its axis passes it by {far:.2f} m")


def _number(triangles: Triangles, part: str) -> int:
    return triangles.parts.index(part) if part in triangles.parts else -1


def _is_sound(joint: Mapping[str, Any]) -> bool:
    is_hinge = joint["kind"] == "revolute"
    most = _MOST_RAD if is_hinge else _MOST_M
    lower, value, upper = (float(joint[k]) for k in ("lower", "value", "upper"))
    return bool(
        joint["kind"] in ("revolute", "prismatic")
        and abs(np.linalg.norm(joint["axis"]) - 1) <= _EQUAL
        and -most <= lower <= value + _EQUAL
        and value <= upper + _EQUAL
        and upper <= most
        and 0 <= joint["mass_kg"] <= _HEAVIEST_KG
    )


def _off_axis(joint: Mapping[str, Any], points: NDArray[np.float64]) -> float:
    """How far the nearest point of a part lies from its hinge's axis, metres."""
    away = points - np.array(joint["point"], np.float64)
    axis = np.array(joint["axis"], np.float64)
    across = away - (away @ axis)[:, None] * axis
    return float(np.linalg.norm(across, axis=1).min())


def check_articulation(
    view: StoredView, house: StoredHouse, arrays: Mapping[str, NDArray[Any]], tally: Tally
) -> None:
    """articulation.json has a row for each part in the picture: that of house.json, seen by the camera."""
    if "part" not in arrays:
        return
    place, parts = f"{view.place}/articulation.json", arrays["part"]
    counts = np.bincount(parts.reshape(-1), minlength=1)
    rows = {int(row["id"]): row for row in view.parts}
    seen = {int(k) for k in np.nonzero(counts)[0]} - {0}
    tally.expect(
        "articulation", place, rows.keys() == seen, f"ids {sorted(rows.keys() ^ seen)[:5]}"
    )
    # Parts are numbered through the house, in the order of its items and their joints.
    known = dict(
        enumerate(
            ((k, item, joint) for k, item in sorted(house.items.items()) for joint in item.get("joints", [])), 1
        )
    )  # fmt: skip
    boxes = ndimage.find_objects(parts.astype(np.int32))
    turn, eye = view.world_from_camera[:3, :3], view.world_from_camera[:3, 3]
    for number in sorted(rows.keys() & seen & known.keys()):
        row, (instance, item, joint) = rows[number], known[number]
        same = (row["instance"], row["item"]) == (instance, item["id"])
        same = same and all(row[name] == joint[name] for name in _COPIED)
        tally.expect("articulation", place, same, f"part {number} is another in house.json")
        axis = np.array(joint["axis"], np.float64) @ turn
        point = (np.array(joint["point"], np.float64) - eye) @ turn
        off = max(
            float(np.abs(axis - row["axis_opencv"]).max()),
            float(np.abs(point - row["point_opencv"]).max()),
        )
        tally.expect(
            "articulation", place, off <= _EQUAL, f"axis of part {number} is off by {off:.3g}"
        )
        ys, xs = boxes[number - 1]
        box = [xs.start, ys.start, xs.stop, ys.stop]
        same = row["pixels"] == counts[number] and row["box2d"] == box
        tally.expect("articulation", place, bool(same), f"part {number} covers other pixels")
    lost = (rows.keys() & seen) - known.keys()
    tally.expect(
        "articulation", place, not lost, f"parts {sorted(lost)[:5]} are none of house.json"
    )
