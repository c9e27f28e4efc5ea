"""Doors and drawers of generated homes, in the home and in MuJoCo: `make bench NAME=joints` -> out/bench/joints.json.

N_HOMES dressed homes that nobody tunes on: doors, items with a joint, and furniture and machines whose name implies doors,
drawers or a lid should open. N_SMALL small ones are exported as MJCF, loaded by MuJoCo, left alone for two seconds, and each
door and drawer is pushed to its end. `python -m benchmarks.homes.joints N` measures N homes of both kinds.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np

from benchmarks.figures import write_report
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import House, Item, ItemKind
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.export.export_homes import export_house
from pbrs_farm.export.forms.mjcf import body_name
from pbrs_farm.export.home_pieces import ExportedHome, exported_home
from pbrs_farm.geometry.opened import free_value, part_triangles
from pbrs_farm.geometry.scene_triangles import SceneTriangles
from pbrs_farm.prepare.finished_house import finished_house
from pbrs_farm.prepare.source import resolve, variants

N_HOMES: Final = 3
N_SMALL: Final = 1
FIRST_SEED: Final = 62001
FIRST_SMALL_SEED: Final = 70201
DRESS_SEED: Final = 1
UNITS: Final = {
    "joints.homes": "dressed homes",
    "joints.items": "items that people open",
    "joints.share": "share of these that open at least half of their way",
    "joints.with_joints": "share of these with a joint",
    "joints.joints": "doors, drawers, flaps, lids and sashes that are joints",
    "joints.free": "share of these that go at least half of their way",
    "joints.drawers": "drawers",
    "joints.drawers_free": "drawers that go nine tenths of their way",
    "joints.small_homes": "small homes exported to MuJoCo",
    "joints.loads": "of these, loaded by MuJoCo",
    "joints.settle_mm": "mm, largest movement of an item in 2 s",
    "joints.deepest_mm": "mm, deepest contact then",
    "joints.pushed": "doors and drawers with a free way that are pushed",
    "joints.jammed": "of these, stopped before their limits",
    "joints.fixed": "loose items without a resting pose, exported as fixed",
}
_WIDE: Final = 0.9
_OPENED: Final = re.compile(
    r"\b(wardrobe|cabinet|cupboard|sideboard|chest|drawers?|fridge|refrigerator|freezer|oven|cooker|"
    r"dishwasher|washing machine|washer|dryer)\b",
    re.IGNORECASE,
)
_NOT_OPENED: Final = re.compile(r"\b(frame|open|blind)\b", re.IGNORECASE)  # a doorway, shelves
_REST_S: Final = 2.0
_PUSH_S: Final = 4.0
_PUSH: Final = 25.0  # N, or N m for hinges, beside friction
_N_SWEPT: Final = 8  # values of a joint whose bounds are taken
_MARGIN_M: Final = 0.05
_NEAR_END: Final = 0.05  # share of the way by which a part may stop short


def main(words: Sequence[str] = ()) -> None:
    """Measure both kinds of homes and write out/bench/joints.json."""
    n_homes, n_small = (int(words[0]),) * 2 if words else (N_HOMES, N_SMALL)
    counts: Counter[str] = Counter()
    for seed in range(FIRST_SEED, FIRST_SEED + n_homes):
        house = _dressed(f"made:{seed}")
        closed = count_openings(house, counts)
        print(f"{house.id}: closed: {', '.join(sorted(closed)) or 'none'}", flush=True)
    rows = []
    for seed in range(FIRST_SMALL_SEED, FIRST_SMALL_SEED + n_small):
        rows.append(in_mujoco(_dressed(f"made:{seed},rooms=0..1")))
        print(f"made:{seed}", rows[-1], flush=True)
    figures = {
        "joints.homes": n_homes,
        "joints.items": counts["items"],
        "joints.share": round(counts["open"] / counts["items"], 3),
        "joints.with_joints": round(counts["with joints"] / counts["items"], 3),
        "joints.joints": counts["joints"],
        "joints.free": round(counts["free"] / counts["joints"], 3),
        "joints.drawers": counts["drawers"],
        "joints.drawers_free": counts["drawers free"],
        "joints.small_homes": n_small,
        "joints.loads": sum(row["loads"] for row in rows),
        "joints.settle_mm": round(max(row["settle_mm"] for row in rows), 3),
        "joints.deepest_mm": round(max(row["deepest_mm"] for row in rows), 3),
        "joints.pushed": sum(row["pushed"] for row in rows),
        "joints.jammed": sum(len(row["jammed"]) for row in rows),
        "joints.fixed": sum(row["fixed"] for row in rows),
    }
    write_report("joints", figures, UNITS)


def _dressed(word: str) -> House:
    (source,) = variants(resolve(word), [DRESS_SEED])
    return finished_house(source, recipe_from_name("preview")).house


def count_openings(house: House, counts: Counter[str]) -> set[str]:
    """Add a home's counts; names of items that should open and do not."""
    scene, closed = SceneTriangles(house.items), set[str]()
    for index, item in enumerate(house.items):
        if item.is_outside or item.is_removed:
            continue
        n_free = 0
        for joint in item.joints:
            value, obstacle = free_value(scene, index, joint.part, joint.upper)
            share = (value - joint.lower) / (joint.upper - joint.lower)
            n_free += share >= 0.5
            if joint.kind is JointKind.PRISMATIC and item.kind is ItemKind.OBJECT:
                counts["drawers"] += 1
                counts["drawers free"] += share >= _WIDE
                if share < _WIDE:
                    print(f"{house.id}: {item.name}/{joint.part} stops before {obstacle}")
        counts["joints"] += len(item.joints)
        counts["free"] += n_free
        if is_opened(item):
            counts["items"] += 1
            counts["with joints"] += bool(item.joints)
            counts["open"] += bool(n_free)
            if not n_free:
                closed.add(item.name)
    return closed


def is_opened(item: Item) -> bool:
    """True for doors, items with joints, and names that imply doors, drawers or a lid; False for windows."""
    if item.kind is ItemKind.WINDOW or _NOT_OPENED.search(item.name):
        return False
    if item.kind is ItemKind.DOOR or item.joints:
        return True
    return item.kind is ItemKind.OBJECT and bool(item.n_faces) and bool(_OPENED.search(item.name))


def in_mujoco(house: House) -> dict[str, Any]:
    """Load a home's MJCF, let it settle, push its joints."""
    home = exported_home(house)
    row: dict[str, Any] = {"loads": 0, "pushed": 0, "jammed": [], "fixed": 0}
    with tempfile.TemporaryDirectory() as folder:
        export_house(house, Path(folder), "mjcf")
        try:
            model = mujoco.MjModel.from_xml_path(str(next(Path(folder).glob("*.xml"))))
        except ValueError as error:
            return row | {"fault": str(error), "settle_mm": np.inf, "deepest_mm": np.inf}
    n_loose = sum(bool(p.surfaces) and not p.is_fixed for p in home.pieces)
    row["loads"] = 1
    row["fixed"] = n_loose - int((model.jnt_type == mujoco.mjtJoint.mjJNT_FREE).sum())
    row["settle_mm"], row["deepest_mm"] = settled(model)
    row["pushed"], row["jammed"] = pushed(model, home)
    return row


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
    """(number of joints pushed to both ends, names of those that jam).

    Joints whose way is blocked by geometry (`free_value`) are skipped. Joints with disjoint ways are pushed together.
    """
    # Sleeping bodies cost no time until something touches them.
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    scene = SceneTriangles(home.house.items)
    ways: dict[str, F64] = {}
    for k, piece in enumerate(home.pieces):
        for link in piece.bodies[1:]:
            joint = next(j for j in piece.item.joints if j.part == link.part)
            if free_value(scene, k, link.part, joint.upper)[1] == "":
                ways[body_name(piece, link.part)] = _swept_bounds(piece.item, joint)
    jammed: list[str] = []
    remaining = list(ways)
    while remaining:
        batch: list[str] = []
        for name in remaining:
            if all(_are_disjoint(ways[name], ways[chosen]) for chosen in batch):
                batch.append(name)
        remaining = [name for name in remaining if name not in batch]
        jammed += _jammed(model, batch)
    return len(ways), jammed


def _are_disjoint(a: F64, b: F64) -> bool:
    return bool((a[0] > b[1]).any() or (b[0] > a[1]).any())


def _swept_bounds(item: Item, joint: Joint) -> F64:
    """(2, 3) bounds of a part's sweep, with a margin."""
    points = part_triangles(item, joint.part).reshape(-1, 3)
    values = np.linspace(joint.lower, joint.upper, _N_SWEPT)
    swept = np.concatenate([transform_points(joint.motion(float(v)), points) for v in values])
    return np.array([swept.min(0) - _MARGIN_M, swept.max(0) + _MARGIN_M])


def _jammed(model: Any, names: Sequence[str]) -> list[str]:
    """Names of joints that do not reach both limits when pushed."""
    joints = [model.joint(name) for name in names]
    low, high = np.array([joint.range for joint in joints]).T
    positions = np.array([joint.qposadr[0] for joint in joints])
    dofs = np.array([joint.dofadr[0] for joint in joints])
    push = _PUSH + model.dof_frictionloss[dofs]
    state, stopped = mujoco.MjData(model), np.zeros(len(names), bool)
    for sign, end in ((1.0, high), (-1.0, low)):
        state.qfrc_applied[dofs] = sign * push
        reached = np.zeros(len(names), bool)
        for _ in range(int(_PUSH_S / model.opt.timestep)):
            mujoco.mj_step(model, state)
            reached |= sign * (state.qpos[positions] - end) > -_NEAR_END * (high - low)
            if reached.all():
                break
        stopped |= ~reached
    return [name for name, stop in zip(names, stopped, strict=True) if stop]


if __name__ == "__main__":
    main(sys.argv[1:])
