"""Motions of house.json, the positions that follow from them, and points followed from view to view; no effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from pbrs_farm.check.cases import Cast, HouseCase, Layers, Scenes, ViewCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.followed_points import SEEN, Followed, follow_points, near_edge, partner_of
from pbrs_farm.check.lens_rays import StoredCamera
from pbrs_farm.check.moved_house import body_pose, joint_value
from pbrs_farm.check.pixel_checks import of_another_part
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64, I64, Bools

_UNIT = 1e-6  # tolerance of joint limits and of a quaternion's length
_FARTHEST_M = 1e4  # of a pivot from the origin
_SCENE_FLOW_M = 5e-5  # vertices of both times are 32-bit floats
_FLOW_PX = 0.02  # beside half a step of the stored type
_KITTI_REACH_PX = 511.9  # largest motion that KITTI's 16 bits hold
_SAME = 1e-9  # of the axes of two cameras of a pair
# Relation -> layers of flow, of its KITTI form and of occlusion.
_LAYERS = {
    "next": ("flow_forward", "flow_forward_kitti", "occlusion_forward", "scene_flow"),
    "previous": ("flow_backward", "flow_backward_kitti", "occlusion_backward"),
    "stereo": ("disparity", "occlusion_stereo"),
}


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


@dataclass(frozen=True, slots=True, eq=False)
class _Then:
    """The house at the partner's time."""

    rays: Rays
    carry: Callable[[F64, I64], F64] | None  # points (N, 3) on faces (N,); None = nothing moves

    @staticmethod
    def at(case: ViewCase, time_s: float | None) -> _Then:
        scenes: Scenes = case.times.at(time_s)
        is_same = scenes is case.now
        return _Then(
            scenes.rays, None if is_same else partial(scenes.moved.carried, case.now.moved)
        )

    def moved(self, points: F64, faces: I64) -> F64:
        return points if self.carry is None else self.carry(points, faces)


def check_motion(case: ViewCase) -> None:
    """Recompute the layers between views at some pixels."""
    view, cast = case.view, case.cast(*case.pixels)
    # Keep the pixels whose stored depth is that of the ray.
    depth = case.arrays["depth"][cast.rows, cast.columns]
    cast = cast.some((cast.face >= 0) & (np.abs(depth - cast.z * 1000) <= 1.0 + cast.z))
    for relation, names in _LAYERS.items():
        layers = {n: case.arrays[n] for n in names if n in case.arrays}
        partner = partner_of(view, relation)
        if partner is None:
            case.expect("motion")(not layers, f"{[*layers]} without a {relation} view")
            continue
        then = _Then.at(case, view.table["partners"][relation].get("time_s"))
        right, ties = _judge_layers(view, partner, cast, layers, then)
        all_right = np.logical_and.reduce([np.ones(len(cast), bool), *right.values()])
        wrong = np.nonzero(~all_right)[0]
        if len(wrong) and then.carry is not None:
            # Of two surfaces at one depth either may move, if it explains all layers together.
            some = cast.some(wrong)
            faces = of_another_part(some)
            wrong, some = wrong[faces >= 0], some.at(faces).some(faces >= 0)
            again, _ = _judge_layers(view, partner, some, layers, then)
            either = wrong[np.logical_and.reduce(list(again.values()))]
            for name in layers:
                right[name][either] = ties[name][either] = True
        for name in layers:
            case.tally.add(f"motion: {name}", len(cast), ties=int(ties[name].sum()))
            for k in np.nonzero(~right[name])[0]:
                place = f"row {cast.rows[k]}, column {cast.columns[k]}"
                case.tally.fail(f"motion: {name}", case.place, place)


def _judge_layers(
    view: StoredView, other: StoredCamera, cast: Cast, layers: Layers, then: _Then
) -> tuple[dict[str, Bools], dict[str, Bools]]:
    """Layer -> (N,) its values at pixels are right; and (N,) right as another answer is right, too."""

    def carry_of(some: Cast) -> Callable[[F64], F64]:
        return lambda positions: then.moved(positions, some.face)

    followed = follow_points(
        view, other, (cast.rows, cast.columns), cast.z, then.rays, carry_of(cast)
    )
    rights, all_ties = dict[str, Bools](), dict[str, Bools]()
    for name, array in layers.items():
        values = array[cast.rows, cast.columns].astype(np.float64)
        tied = np.zeros(len(cast), bool)
        if name == "scene_flow":
            right, may_tie = _judge_scene_flow(values, cast, then), tied
        else:
            right, may_tie = _judge_motion(name, values, followed)
        # Look again at wrong values.
        ties = np.nonzero(~right & may_tie)[0]
        some = cast.some(ties)
        ties = ties[
            near_edge(view, other, (some.rows, some.columns), some.z, then.rays, carry_of(some))
        ]
        right[ties] = tied[ties] = True
        rights[name], all_ties[name] = right, tied
    return rights, all_ties


def _judge_scene_flow(values: F64, cast: Cast, then: _Then) -> Bools:
    """(N,) True where a layer holds the movement of the pixels' points until the next frame."""
    motion = then.moved(cast.point, cast.face) - cast.point
    return np.asarray(np.abs(values - motion).max(axis=1) <= _SCENE_FLOW_M, bool)


def _judge_motion(name: str, values: F64, followed: Followed) -> tuple[Bools, Bools]:
    """(N,) stored values of a layer are right; (N,) an edge may be the reason of a wrong one."""
    in_front = np.isfinite(followed.motion).all(axis=1)
    motion = np.nan_to_num(followed.motion)
    never = np.zeros(len(values), bool)
    if name.startswith("occlusion"):
        return np.asarray(values == followed.state, bool), ~never
    if name.endswith("kitti"):
        # Valid points are visible and move by that many steps.
        valid = values[:, 2] == 1
        close = (np.abs((values[:, :2] - 2**15) / 64 - motion) <= _FLOW_PX).all(axis=1)
        hidden = (followed.state != SEEN) | (np.abs(motion) >= _KITTI_REACH_PX).any(axis=1)
        return np.where(valid, close & (followed.state == SEEN), hidden), close | ~valid
    if name == "disparity":
        shift = np.minimum(np.abs(motion[:, 0]), 65535 / 256)
        return ~in_front | (np.abs(values / 256 - shift) <= _FLOW_PX), never
    close = (np.abs(values - motion) <= _FLOW_PX + half_step(motion)).all(axis=1)
    return np.asarray(close | ~in_front, bool), never


def half_step(values: F64) -> F64:
    """Half the distance between 16-bit floats next to values (their error); NaN beyond the range."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.spacing(np.abs(values).astype(np.float16)).astype(np.float64) / 2)


def check_partners(case: HouseCase) -> None:
    """Each stored partner has the pose, K and time in the view's table, and a name that follows from it."""
    views = {v.view.folder.name: v.view for v in case.views}
    for view in views.values():
        for relation, row in sorted(view.table.get("partners", {}).items()):
            name = _name_of_partner(view, relation, case.house.camera_rows)
            words = {"row": row, "relation": relation}
            judge("partner name", view.place, case.tally, name=name, **words)
            partner = views.get(str(row["view"]))
            if partner is None:
                continue
            expect = case.tally.at("partners", view.place)
            pose, k = (np.array(row[n], np.float64) for n in ("world_from_camera_opencv", "K"))
            same = pose.shape == (4, 4) and (
                np.abs(pose - partner.world_from_camera).max() < _SAME
                and np.abs(k - partner.k).max() < _SAME
            )
            expect(same, f"the {relation} view {partner.folder.name} has another camera")
            judge("partner time", view.place, case.tally, other=partner.table, name=partner.folder.name, **words)  # fmt: skip


def _name_of_partner(
    view: StoredView, relation: str, camera_rows: Mapping[str, dict[str, Any]]
) -> str:
    """The id of the other of a pair, or of the frame before or after by the same camera of a rig."""
    rig, name = view.table.get("rig"), view.folder.name
    if relation != "stereo":
        return view.shot.partner(1 if relation == "next" else -1).id
    # The nearest of the instant's cameras beside it that have its orientation.
    row, beside = camera_rows.get(name, {}), list[tuple[float, str]]()
    for other_name, partner in camera_rows.items():
        if other_name == name or (partner.get("rig") or {}).get("instant") != (rig or {}).get("instant"):  # fmt: skip
            continue
        a, b = (np.array(r["world_from_camera_opengl"], np.float64) for r in (row, partner))
        step = a[:3, :3].T @ (b[:3, 3] - a[:3, 3])
        is_beside = np.abs(a[:3, :3] - b[:3, :3]).max() < _SAME and np.abs(step[1:]).max() < _SAME
        if is_beside and partner["intrinsics"] == row["intrinsics"]:
            beside.append((round(abs(float(step[0])), 9), other_name))
    return min(beside, key=lambda pair: pair[0])[1] if beside else ""


CHECKS = (
    Check("motion", "view", check_motion, 95, sum(_LAYERS.values(), ())),
    Check("partners", "views", check_partners, 2),
    Check("motions", "house", check_motions, 6, ("house.json",)),
    Check("motions", "view", check_motion_table, 17),
)
