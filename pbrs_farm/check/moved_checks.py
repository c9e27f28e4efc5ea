"""Motions of house.json, and the positions in view.json that follow from them; no effects beside reading documents."""

from __future__ import annotations

import numpy as np

from pbrs_farm.check.cases import HouseCase, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.moved_house import body_pose, joint_value
from pbrs_farm.check.rules import judge

_UNIT = 1e-6  # tolerance of joint limits and of a quaternion's length
_FARTHEST_M = 1e4  # of a pivot from the origin


def check_motions(case: HouseCase) -> None:
    """Motions belong to an item or joint, their times ascend, and joints stay within their limits."""
    items = {str(row["id"]): row for row in case.house.items.values()}
    names = set()
    for motion in case.house.house.get("motions", []):
        part, name = motion["part"], (motion["item"], motion["part"])
        expect = case.expect("motions", f"motion of {motion['item']}/{part}")
        row = items.get(str(motion["item"]), {})
        joint = {j["part"]: j for j in row.get("joints", [])}.get(part)
        exists = bool(row) and (joint is not None or not part)
        is_first = name not in names
        names.add(name)
        if not expect(exists and is_first, "has no moving part"):
            continue
        times, values = np.array(motion["times_s"]), np.array(motion["values"], np.float64)
        shaped = values.shape == (len(times), 1 if part else 7) and len(times) > 0
        ascends = shaped and (np.diff(times) > 0).all() and np.isfinite(values).all()
        if not expect(ascends, "has invalid times or values"):
            continue
        if joint is not None:
            low, high = joint["lower"] - _UNIT, joint["upper"] + _UNIT
            expect(((values >= low) & (values <= high)).all(), "leaves the joint's limits")
        else:
            off = np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1).max()
            expect(off <= _UNIT, "has an invalid rotation")
            off = np.abs(np.array(motion["pivot"], np.float64)).max()
            expect(off < _FARTHEST_M, "turns about a place far away")


def check_motion_table(case: ViewCase) -> None:
    """The table "motion" of view.json follows from house.json's motions at the view's time."""
    motions = case.house.house.get("motions", [])
    table, time_s = case.view.table.get("motion"), case.view.table.get("time_s")
    moves = bool(motions) and time_s is not None
    fault = "lacks its motions" if moves else "has motions, but nothing moves"
    expect = case.expect("motions")
    if not expect((table is not None) == moves, fault) or table is None or time_s is None:
        return
    instances = {str(row["id"]): k for k, row in case.house.items.items()}
    joints = [m for m in motions if m["part"]]
    bodies = [m for m in motions if not m["part"]]
    parts = [(r["instance"], r["item"], r["part"]) for r in table["joints"]]
    items = [(r["instance"], r["item"]) for r in table["bodies"]]
    same = parts == [(instances[m["item"]], m["item"], m["part"]) for m in joints]
    same &= items == [(instances[m["item"]], m["item"]) for m in bodies]
    if not expect(same, "names other items than house.json"):
        return
    for row, motion in zip(table["joints"], joints, strict=True):
        value = joint_value(motion, time_s)
        judge("moved joint", case.place, case.tally, row=row, value=value)
    for row, motion in zip(table["bodies"], bodies, strict=True):
        pose = body_pose(motion, float(time_s))
        judge("moved body", case.place, case.tally, row=row, pose=pose)


CHECKS = (
    Check("motions", "house", check_motions, 6, ("house.json",)),
    Check("motions", "view", check_motion_table, 17),
)
