"""Falsehoods about joints of a home at rest, planted for each joint of furniture, doors and windows, are found."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pbrs_farm.check.cases import HouseCase, ScenesInTime
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.house_checks import check_models
from pbrs_farm.check.joint_checks import check_joints, row_of
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.check.stored_mesh import Triangles, triangles_from_glb
from pbrs_farm.core import classes
from pbrs_farm.core.catalogue import Piece
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Box, House, Item
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.furnishings.things.families import family_pieces, family_shape
from pbrs_farm.generate.floor_plan import OpeningKind, PlanOpening, RoomType
from pbrs_farm.generate.opening_models import (
    CASINGS,
    HANDLES,
    LEAVES,
    LIGHTS,
    MOULDINGS,
    SASHES,
    OpeningDesign,
    opening_model,
)
from pbrs_farm.geometry.opened import item_at
from pbrs_farm.home.masses import weighed
from pbrs_farm.read.builtin.builtin_home import builtin_home

_FAMILIES = (
    "base_cabinet-01", "wardrobe-02", "upper_cabinet-02", "cooker-01", "toilet-01", "desk-01",
    "washing_machine-01", "fridge-01", "fitted_cabinet-01",
)  # fmt: skip
Row = dict[str, Any]
Plant = Callable[[Row, Row], object]


def house_of(
    pieces: Iterable[Piece], designs: Iterable[OpeningDesign] = (OpeningDesign(),)
) -> House:
    """Those of the pieces, doors and windows that open, beside the built-in home, the first part of each left open."""
    home = builtin_home()
    materials, items = list(home.materials), list(home.items)
    shapes = [(piece.id, piece.name, piece.nyu40, family_shape(piece)) for piece in pieces]
    kinds = (
        (OpeningKind.DOOR, classes.DOOR, 0.9, 2.05, 0.0),
        (OpeningKind.WINDOW, classes.WINDOW, 1.4, 1.2, 0.9),
    )
    for design, (kind, nyu40, width, height, sill) in product(designs, kinds):
        opening = PlanOpening(kind, 0, 1.0, width, height, sill, room=0)
        rooms = (RoomType.LIVING if design.lights else RoomType.BATHROOM,)
        shape = opening_model(opening, 0.1, design, rooms)
        shapes.append((f"pbrs_farm#{kind}", str(kind), nyu40, shape))
    shapes = [row for row in shapes if row[3].joints]
    for k, (source_class, name, nyu40, shape) in enumerate(shapes):
        pose = np.eye(4)
        pose[0, 3] = 50.0 + 4 * k
        surfaces = tuple(
            replace(
                s,
                positions=transform_points(pose, s.positions).astype(np.float32),
                material=s.material + len(materials),
            )
            for s in shape.surfaces
        )
        materials += shape.materials
        points = np.concatenate([s.positions for s in surfaces]).astype(np.float64)
        low, high = points.min(0), points.max(0)
        item = replace(
            home.items[0], id=f"piece_{k}", name=name, surfaces=surfaces, nyu40=nyu40,
            source_class=source_class, box=Box((low + high) / 2, (high - low) / 2, np.eye(3)),
            joints=tuple(joint.placed(pose) for joint in shape.joints), pose=None,
        )  # fmt: skip
        items.append(_ajar(item))
    return weighed(replace(home, items=tuple(items), materials=tuple(materials)))


def _ajar(item: Item) -> Item:
    if not item.joints:
        return item
    return item_at(item, item.joints[0].part, 0.4 * item.joints[0].upper)


class Stored:
    """A stored house whose items are checked one at a time."""

    def __init__(self, house: House, folder: Path) -> None:
        glb, text = bundle_from_house(house)
        self.glb, self.document = glb, json.loads(text)
        self.rows = [row for row in self.document["items"] if row.get("joints")]
        self.folder = folder
        whole = triangles_from_glb(glb)
        self.own: dict[int, Triangles] = {
            row["instance"]: whole.only(row["instance"]) for row in self.rows
        }

    def faults(self, row: Row) -> tuple[str, ...]:
        """The faults of an item with that row in house.json."""
        tally = Tally()
        house = StoredHouse(self.folder, self.document | {"items": [row]})
        times = ScenesInTime(house, self.own[row["instance"]])
        check_joints(HouseCase(house, self.glb, times, tally))
        return tally.certificate("", 1, 0, all_pixels=False).failures


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Stored:
    pieces = [p for p in family_pieces() if p.id.removeprefix("generated#").startswith(_FAMILIES)]
    assert len(pieces) == len(_FAMILIES)
    return Stored(house_of(pieces), tmp_path_factory.mktemp("joints"))


def _sides(joint: Row) -> list[np.ndarray]:
    """The two axes of the world across a joint's."""
    return [np.eye(3)[k] for k in range(3) if k != np.argmax(np.abs(joint["axis"]))]


def moved(side: int, by_m: float) -> Plant:
    def plant(joint: Row, _item: Row) -> object:
        if joint["kind"] != "revolute":
            return False
        return joint.update(point=(np.array(joint["point"]) + by_m * _sides(joint)[side]).tolist())

    return plant


def changed(**fields: Callable[[Row], object]) -> Plant:
    return lambda joint, _item: joint.update({k: f(joint) for k, f in fields.items()})


def only(is_meant: Callable[[Row], bool], plant: Plant) -> Plant:
    """A plant for some joints alone."""
    return lambda joint, item: plant(joint, item) if is_meant(joint) else False


def tilted(joint: Row) -> object:
    turn = Rotation.from_rotvec(np.radians(10) * _sides(joint)[0]).as_matrix()
    return (turn @ np.array(joint["axis"])).tolist()


def exchanged(joint: Row, item: Row) -> object:
    """Exchange the parts of two joints of different kinds."""
    other = next((j for j in item["joints"] if j["kind"] != joint["kind"]), None)
    if other is None:
        return False
    other["part"], joint["part"] = joint["part"], other["part"]
    return None


def is_hinge(joint: Row) -> bool:
    return bool(joint["kind"] == "revolute")


PLANTS: dict[str, Plant] = {
    "axis negated": changed(axis=lambda j: [-a for a in j["axis"]]),
    "axis tilted by 10 degrees": changed(axis=tilted),
    "axis along another side": changed(axis=lambda j: _sides(j)[0].tolist()),
    "value halved": only(lambda j: j["value"] > 0, changed(value=lambda j: j["value"] / 2)),
    "value of a shut part": only(lambda j: j["value"] == 0, changed(value=lambda j: j["upper"] / 3)),
    "shut, though it is open": only(
        lambda j: j["value"] > 0 and j["part"] != "drawer 1", changed(value=lambda _j: 0.0)
    ),
    "hinge 4 cm beside": moved(0, 0.04),
    "hinge 4 cm to the other side": moved(0, -0.04),
    "hinge 4 cm before": moved(1, 0.04),
    "hinge 4 cm behind": moved(1, -0.04),
    "upper limit x 1.4": changed(upper=lambda j: j["upper"] * 1.4),
    "upper limit - 0.3 rad": only(is_hinge, changed(upper=lambda j: j["upper"] - 0.3)),
    "lower limit - 0.3": changed(lower=lambda _j: -0.3),
    "limits exchanged": changed(lower=lambda j: j["upper"], upper=lambda _j: 0.0),
    "mass x 10": changed(mass_kg=lambda j: j["mass_kg"] * 10),
    "mass + 10 %": changed(mass_kg=lambda j: j["mass_kg"] * 1.1),
    "no mass": changed(mass_kg=lambda _j: 0.0),
    "another kind": changed(kind=lambda j: "prismatic" if is_hinge(j) else "revolute"),
    "parts of two joints exchanged": exchanged,
    "another part": changed(part=lambda _j: "door 9"),
}  # fmt: skip


def test_true_joints_are_clean(stored: Stored) -> None:
    assert sum(len(row["joints"]) for row in stored.rows) >= 25
    for row in stored.rows:
        assert stored.faults(row) == ()


@pytest.mark.parametrize("name", PLANTS)
def test_a_falsehood_about_any_joint_is_found(stored: Stored, name: str) -> None:
    n_planted, missed = 0, []
    for row in stored.rows:
        for k in range(len(row["joints"])):
            false = copy.deepcopy(row)
            joint = false["joints"][k]
            if PLANTS[name](joint, false) is False:
                continue
            n_planted += 1
            if not stored.faults(false):
                missed.append(f"{row['source_class']}/{joint['part']}")
    assert n_planted >= 2
    assert missed == []


def test_what_only_a_source_states_is_listed_as_not_looked_at(stored: Stored) -> None:
    row = copy.deepcopy(next(r for r in stored.rows if r["source_class"] == "builtin#door"))
    row["source_class"] = "a stranger's door"
    row["joints"][0]["mass_kg"] *= 2
    tally = Tally()
    house = StoredHouse(stored.folder, stored.document | {"items": [row]})
    times = ScenesInTime(house, stored.own[row["instance"]])
    check_joints(HouseCase(house, stored.glb, times, tally))
    certificate = tally.certificate("", 1, 0, all_pixels=False)
    assert certificate.failures == ()
    assert [line.split(" of joints")[0] for line in certificate.not_looked_at] == [
        "masses",
        "hinges, values or limits",
    ]
    assert certificate.text().count("that only their source states") == 2


def test_the_origin_of_a_model_with_one_instance_is_listed_as_not_looked_at(stored: Stored) -> None:
    row = stored.rows[0] | {"pose": {"model": "crate", "world_from_model": np.eye(4).tolist()}}
    tally = Tally()
    house = StoredHouse(stored.folder, stored.document | {"items": [row]})
    times = ScenesInTime(house, stored.own[row["instance"]])
    check_models(HouseCase(house, stored.glb, times, tally))
    (line,) = tally.certificate("", 1, 0, all_pixels=False).not_looked_at
    assert line == "positions of a model's origin, of models with one instance in their home (1)"


def test_true_doors_and_windows_of_any_design_are_clean(tmp_path: Path) -> None:
    n = max(len(LEAVES), len(SASHES))
    designs = [
        OpeningDesign(
            leaf=LEAVES[k % len(LEAVES)], sash=SASHES[k % len(SASHES)], handle=HANDLES[k % len(HANDLES)],
            lights=("", *LIGHTS)[k % 5], moulding=MOULDINGS[k % 3], casing=CASINGS[k % 4],
            n_hinges=2 + k % 2, has_beads=k % 2 == 0, has_fixed_sash=k % 3 == 0,
        )
        for k in range(n)
    ]  # fmt: skip
    stored = Stored(house_of((), designs), tmp_path)
    assert len(stored.rows) >= 2 * n
    assert [stored.faults(row) for row in stored.rows] == [()] * len(stored.rows)


@pytest.mark.long
def test_every_joint_of_the_generated_catalogue_is_clean_and_has_a_row(tmp_path: Path) -> None:
    stored = Stored(house_of(family_pieces()), tmp_path)
    for row in stored.rows:
        assert stored.faults(row) == ()
        assert all(row_of(row, joint) for joint in row["joints"])
