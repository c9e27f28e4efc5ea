"""Homes with joints in other programs: `make bench NAME=robots` -> out/bench/robots.json.

Small homes that nobody tunes on are dressed, exported as MJCF, loaded by MuJoCo, left alone for two
seconds, and each door and drawer is pushed to its end. A home takes minutes, most of them for convex
parts; a process a core measures one after the other. `BENCH_HOMES=2` takes the first two.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
import trimesh
from pxr import Usd, UsdGeom, UsdPhysics
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from benchmarks.figures import write_report
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import House, Item
from pbrs_farm.core.joints import Joint
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.export.forms.mjcf import body_name
from pbrs_farm.export.home_pieces import ExportedHome, exported_home
from pbrs_farm.geometry.opened import free_value, part_triangles
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.geometry.surface_points import surface_points
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.source import resolve, variants

UNITS: Final = {
    "joints.loads": "homes that MuJoCo loads",
    "joints.homes": "homes",
    "joints.settle_mm": "mm that the most restless thing moves in 2 s",
    "joints.deepest_mm": "mm that the deepest contact penetrates then",
    "joints.pushed": "doors and drawers that nothing stands before",
    "joints.jammed": "of them that stop before their limits",
    "joints.jammed_names": "of these",
    "joints.hull_mm": "mm that a face of a thing lies beyond its collision parts at most",
    "joints.over_mm": "mm that collision parts reach beyond their thing, 95th percentile of things",
    "joints.fixed": "loose things that found no rest and stand fixed",
    "joints.joints": "joints that homes have",
    "joints.roundtrip": "share of them that MuJoCo reads of MJCF and URDF, and OpenUSD of USD, as ours",
}
HOMES: Final = tuple(f"made:{70201 + k},rooms=0..1" for k in range(20))
_REST_S: Final = 2.0
_PUSH_S: Final = 4.0
_PUSH: Final = 25.0  # newtons, or newton metres of hinges, beside friction
_OVER_M: Final = 0.003
_VALUES: Final = 8  # of a joint whose bounds are wanted
_ROOM_M: Final = 0.05
_NEAR: Final = 0.05  # share of its way by which a part may stop short
_SAME: Final = 1e-4  # metres, radians, and of unit axes
_Z_UP: Final = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True, eq=False)
class ReadJoint:
    """A joint as another program read it, in the world, z up."""

    kind: str  # revolute or prismatic
    point: F64  # (3,) on its axis
    axis: F64  # (3,) unit
    limits: F64  # (2,) radians or metres


def main() -> None:
    """Measure every home, and tell each when it is done."""
    names = HOMES[: int(os.environ.get("BENCH_HOMES", len(HOMES)))]
    rows: dict[str, dict[str, Any]] = {}
    # Fresh processes: a fork would share what libraries hold.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(os.cpu_count(), context) as pool:
        for done in as_completed([pool.submit(_measured_by_name, name) for name in names]):
            name, row = done.result()
            rows[name] = row
            told = {k: v for k, v in row.items() if k != "over"}
            print(f"{len(rows)} of {len(names)}: {name}", told, flush=True)
    write_report("robots", figures([rows[name] for name in names]), UNITS)


def _measured_by_name(name: str) -> tuple[str, dict[str, Any]]:
    started = time.monotonic()
    house, _ = repaired_house(variants(resolve(name), [1])[0], recipe_from_name("fast"))
    row = measured(house)
    return name, row | {"seconds": round(time.monotonic() - started)}


def figures(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Of all homes."""
    return {
        "joints.loads": sum(row["loads"] for row in rows),
        "joints.homes": len(rows),
        "joints.settle_mm": round(max(row["settle_mm"] for row in rows), 3),
        "joints.deepest_mm": round(max(row["deepest_mm"] for row in rows), 3),
        "joints.pushed": sum(row["pushed"] for row in rows),
        "joints.jammed": sum(len(row["jammed"]) for row in rows),
        "joints.jammed_names": [name for row in rows for name in row["jammed"]],
        "joints.hull_mm": round(max(row["hull_mm"] for row in rows), 2),
        "joints.over_mm": round(float(np.percentile([x for r in rows for x in r["over"]], 95)), 2),
        "joints.fixed": sum(row["fixed"] for row in rows),
        "joints.joints": (n := sum(row["joints"] for row in rows)),
        "joints.roundtrip": round(1 - sum(len(row["unlike"]) for row in rows) / max(n, 1), 4),
    }


def measured(house: House) -> dict[str, Any]:
    """The numbers of one home."""
    home = exported_home(house)
    started = time.monotonic()
    short, over = hull_distances(home)
    parts_s = time.monotonic() - started
    row: dict[str, Any] = {"hull_mm": short, "over": over, "loads": 0, "pushed": 0, "jammed": []}
    row |= {"settle_mm": np.inf, "deepest_mm": np.inf, "fixed": 0}
    row |= {"joints": sum(len(p.bodies) - 1 for p in home.pieces), "unlike": []}
    with tempfile.TemporaryDirectory() as scratch:
        folders = {form: Path(scratch) / form for form in ("mjcf", "urdf", "usd")}
        for form, folder in folders.items():
            export_house(house, folder, form)
        try:
            model = mujoco.MjModel.from_xml_path(str(next(folders["mjcf"].glob("*.xml"))))
        except ValueError as error:
            return row | {"fault": str(error)}
        row["unlike"] = unlike(home, folders)
    row["loads"] = 1
    loose = sum(bool(p.surfaces) and not p.is_fixed for p in home.pieces)
    row["fixed"] = loose - int((model.jnt_type == mujoco.mjtJoint.mjJNT_FREE).sum())
    row["settle_mm"], row["deepest_mm"] = settled(model)
    row["pushed"], row["jammed"] = pushed(model, home)
    return row | {"of them for parts": round(parts_s)}


def settled(model: Any) -> tuple[float, float]:
    """(mm that a body moves in two seconds, mm of the deepest contact then)."""
    state = mujoco.MjData(model)
    mujoco.mj_forward(model, state)
    before = state.xpos.copy()
    for _ in range(int(_REST_S / model.opt.timestep)):
        mujoco.mj_step(model, state)
    moved = np.linalg.norm(state.xpos - before, axis=1).max()
    deepest = max((-c.dist for c in state.contact[: state.ncon]), default=0.0)
    return 1e3 * float(moved), 1e3 * float(max(deepest, 0.0))


def pushed(model: Any, home: ExportedHome) -> tuple[int, list[str]]:
    """How many joints are pushed to their ends and back, and the names of those that jam.

    What geometry alone says stands in the way (`free_value`) is no jam: such joints are left out.
    Joints whose ways lie apart are pushed at the same time.
    """
    # What lies still costs nothing until something wakes it.
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    scene = SceneTriangles(home.house.items)
    ways: dict[str, F64] = {}
    for k, piece in enumerate(home.pieces):
        for link in piece.bodies[1:]:
            joint = next(j for j in piece.item.joints if j.part == link.part)
            if free_value(scene, k, link.part, joint.upper)[1] == "":
                ways[body_name(piece, link.part)] = _way(piece.item, joint)
    jammed: list[str] = []
    left = list(ways)
    while left:
        batch: list[str] = []
        for name in left:
            apart = [
                (ways[name][0] > ways[o][1]).any() | (ways[o][0] > ways[name][1]).any()
                for o in batch
            ]
            if all(apart):
                batch.append(name)
        left = [name for name in left if name not in batch]
        jammed += _jammed(model, batch)
    return len(ways), jammed


def _way(item: Item, joint: Joint) -> F64:
    """(2, 3) bounds of all that a part sweeps, and some room around it."""
    points = part_triangles(item, joint.part).reshape(-1, 3)
    values = np.linspace(joint.lower, joint.upper, _VALUES)
    swept = np.concatenate([transform_points(joint.motion(float(v)), points) for v in values])
    return np.array([swept.min(0) - _ROOM_M, swept.max(0) + _ROOM_M])


def _jammed(model: Any, names: Sequence[str]) -> list[str]:
    """Which of some joints do not reach both of their limits when they are pushed."""
    joints = [model.joint(name) for name in names]
    low, high = np.array([joint.range for joint in joints]).T
    at = np.array([joint.qposadr[0] for joint in joints])
    dofs = np.array([joint.dofadr[0] for joint in joints])
    push = _PUSH + model.dof_frictionloss[dofs]
    state, stops = mujoco.MjData(model), np.zeros(len(names), bool)
    for sign, end in ((1.0, high), (-1.0, low)):
        state.qfrc_applied[dofs] = sign * push
        there = np.zeros(len(names), bool)
        for _ in range(int(_PUSH_S / model.opt.timestep)):
            mujoco.mj_step(model, state)
            there |= sign * (state.qpos[at] - end) > -_NEAR * (high - low)
            if there.all():
                break
        stops |= ~there
    return [name for name, stop in zip(names, stops, strict=True) if stop]


def unlike(home: ExportedHome, folders: Mapping[str, Path]) -> list[str]:
    """The joints that one of the forms' files does not hold as the home has them, and the form."""
    read = {
        "mjcf": joints_of_mujoco(next(folders["mjcf"].glob("*.xml"))),
        "urdf": joints_of_mujoco(next(folders["urdf"].glob("*.urdf"))),
        "usd": joints_of_usd(next(folders["usd"].glob("*.usdc"))),
    }
    found = []
    for piece in home.pieces:
        for k, link in enumerate(piece.bodies[1:], 1):
            joint = next(j for j in piece.item.joints if j.part == link.part)
            for form, rows in read.items():
                name = f"{piece.name}/{k}" if form == "usd" else body_name(piece, link.part)
                # A loose thing of MJCF has moved to where it rests.
                placed = form != "mjcf" or piece.is_fixed
                if not _is_same(joint, rows.get(name), placed):
                    found.append(f"{form}: {body_name(piece, link.part)}")
    return found


def joints_of_mujoco(path: Path) -> dict[str, ReadJoint]:
    """What MuJoCo reads of a model or a URDF, by the joint's name."""
    model = mujoco.MjModel.from_xml_path(str(path))
    state = mujoco.MjData(model)
    mujoco.mj_kinematics(model, state)
    found = {}
    for k in range(model.njnt):
        kind = {2: "prismatic", 3: "revolute"}.get(int(model.jnt_type[k]))
        if kind:
            row = ReadJoint(kind, state.xanchor[k], state.xaxis[k], model.jnt_range[k])
            found[model.joint(k).name] = row
    return found


def joints_of_usd(path: Path) -> dict[str, ReadJoint]:
    """What OpenUSD reads of a stage, by item and number: `Fridge/1`."""
    stage = Usd.Stage.Open(str(path))
    found = {}
    for prim in stage.Traverse():
        kind = prim.GetTypeName().removeprefix("Physics").removesuffix("Joint").lower()
        if kind not in ("revolute", "prismatic"):
            continue
        joint = UsdPhysics.Joint(prim)
        (body,) = joint.GetBody0Rel().GetTargets()
        xform = UsdGeom.Xformable(stage.GetPrimAtPath(body))
        world = np.array(xform.ComputeLocalToWorldTransform(Usd.TimeCode.Default())).T
        turn = joint.GetLocalRot0Attr().Get()
        towards = Rotation.from_quat([*turn.GetImaginary(), turn.GetReal()]).apply([1.0, 0, 0])
        point = world[:3, :3] @ np.array(joint.GetLocalPos0Attr().Get()) + world[:3, 3]
        limits = [prim.GetAttribute(f"physics:{end}Limit").Get() for end in ("lower", "upper")]
        limits = np.radians(limits) if kind == "revolute" else np.array(limits)
        name = f"{prim.GetParent().GetName()}/{prim.GetName().removeprefix('Joint_')}"
        found[name] = ReadJoint(kind, point, world[:3, :3] @ towards, limits)
    return found


def _is_same(joint: Joint, read: ReadJoint | None, is_placed: bool) -> bool:
    """Whether a joint of the home (y up) is what was read (z up)."""
    if read is None or read.kind != joint.kind.value:
        return False
    if np.abs(read.limits - (joint.lower, joint.upper)).max() > _SAME:
        return False
    if not is_placed:
        return True
    axis = _Z_UP @ np.array(joint.axis)
    if np.abs(read.axis - axis).max() > _SAME:
        return False
    # A slide may be told anywhere; a hinge lies anywhere on its axis.
    off = np.cross(read.point - _Z_UP @ np.array(joint.point), axis)
    return read.kind == "prismatic" or float(np.linalg.norm(off)) < _SAME


def hull_distances(home: ExportedHome) -> tuple[float, list[float]]:
    """(mm that faces lie beyond the parts at most, mm that each thing's parts reach beyond it).

    The second counts what lies inside a mesh only where the mesh is closed.
    """
    short, over = 0.0, []
    for piece in home.things:
        for link in piece.bodies:
            if not len(link.triangles):
                continue
            points = surface_points(link.triangles, 0.02)
            beyond = np.full(len(points), np.inf)
            for part in link.colliders:
                planes = ConvexHull(part).equations
                beyond = np.minimum(beyond, (points @ planes[:, :3].T + planes[:, 3]).max(1))
            short = max(short, 1e3 * float(beyond.max()))
            over.append(1e3 * _over(link.triangles, link.colliders))
    return max(short, 0.0), over


def _over(triangles: F64, parts: tuple[F64, ...]) -> float:
    """Metres that the middles of hulls' faces lie beyond a mesh, outside it where it is closed."""
    mesh = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    mesh.merge_vertices()
    points = np.concatenate([trimesh.convex.convex_hull(part).triangles_center for part in parts])
    far, _ = cKDTree(surface_points(triangles, 0.006)).query(points)
    if mesh.is_watertight and (far > _OVER_M).any():
        far[far > _OVER_M] *= ~mesh.contains(points[far > _OVER_M])
    return float(far.max())


if __name__ == "__main__":
    main()
