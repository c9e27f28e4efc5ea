"""Home files of plans pass the ordinary reader and repair without loss."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
import zipfile
from functools import cache

import numpy as np
import pytest
from shapely.geometry import Polygon

from pbrs_farm.core.catalogue import EMPTY, Catalogue, Piece, Place, Shape
from pbrs_farm.core.house import (
    Enclosure,
    House,
    ItemKind,
    LightPart,
    Material,
    MaterialKind,
    geometry_from_house,
)
from pbrs_farm.core.lighting import PowerUnit
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.generate.drawn_plan import drawn_plan
from pbrs_farm.generate.floor_plan import PlacedPiece, Plan, Storey
from pbrs_farm.generate.home_file import home_contents
from pbrs_farm.geometry.solids import box
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.repair import repair


@cache
def plan(seed: int) -> Plan:
    return drawn_plan(np.random.default_rng(seed))


def written(seed: int, pieces: tuple[PlacedPiece, ...] = (), catalogue: Catalogue = EMPTY) -> bytes:
    storeys, rng = [Storey(plan(seed), pieces)], np.random.default_rng(seed)
    return home_contents(storeys, catalogue, rng).archive()


def read(data: bytes) -> House:
    return read_home(data, "home.sh3d")


LAMP = Piece(
    "test#lamp", "Lamp", "ceiling_lamp", Place.CEILING, 35, (0.4, 0.4, 0.5), ItemKind.LAMP,
    creator="A. Person", licence="CC-BY 3.0",
)  # fmt: skip


def lamp_catalogue() -> Catalogue:
    materials = (
        Material("metal", diffuse=(0.2, 0.2, 0.2)),
        Material("glass", kind=MaterialKind.GLASS, diffuse=(1, 1, 1), opacity=0.3),
    )
    surfaces = (
        box("rod", np.array([0, 0.3, 0]), np.array([0.02, 0.2, 0.02]), 0),
        box("globe", np.array([0, 0.1, 0]), np.array([0.2, 0.1, 0.2]), 1),
    )
    light = LightPart((0.1, 0.1, -0.05), 0.03, 0.5, PowerUnit.SWEETHOME3D)
    shape = Shape(surfaces, materials, lights=(light,))
    return Catalogue((LAMP,), lambda _piece: shape, "test")


@pytest.mark.long
def test_the_same_plan_gives_the_same_bytes() -> None:
    assert written(1) == written(1)


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_home_is_read_without_a_note_and_with_its_rooms(seed: int) -> None:
    house = read(written(seed))
    assert not house.notes
    assert [room.name for room in house.rooms] == [room.name for room in plan(seed).rooms]
    for room, drawn in zip(house.rooms, plan(seed).rooms, strict=True):
        assert Polygon(room.polygon).area == pytest.approx(drawn.area, rel=1e-3)


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", range(4))
def test_every_door_and_window_cuts_a_hole(seed: int) -> None:
    house = read(written(seed))
    assert len(house.openings) == len(plan(seed).openings)
    assert sum(o.is_window for o in house.openings) == sum(
        "window" in o.kind.value for o in plan(seed).openings
    )


def test_frames_of_doors_show_on_both_sides_of_their_walls() -> None:
    openings, home = plan(1).openings, read(written(1))
    built = [item for item in home.items if item.source_class.startswith("pbrs_farm#")]
    for opening, item in zip(openings, built, strict=True):
        wall = plan(1).walls[opening.wall]
        frame = next(s for s in item.surfaces if not s.part).positions[:, [0, 2]]
        away = (frame - np.array(wall.at(opening.along))) @ np.array(wall.normal)
        assert away.min() == pytest.approx(-away.max(), abs=0.001)
        assert away.max() > wall.thickness / 2 + 0.005


@pytest.mark.quick(1)
@pytest.mark.parametrize("seed", range(2))
def test_repair_finds_closed_rooms_and_no_leak(seed: int) -> None:
    house = read(written(seed))
    repaired, report = repair(
        house, Recipe().repair, occluder_from=lambda some: Caster(geometry_from_house(some))
    )
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert report.leaks.n_rays > 0
    is_open = {r.name for r in repaired.rooms if r.enclosure is not Enclosure.CLOSED}
    assert is_open <= {"Balcony"}


def test_a_lamp_hangs_from_the_ceiling_with_its_light_and_glass() -> None:
    x0, z0, x1, z1 = plan(0).rooms[0].bounds
    placed = PlacedPiece(LAMP, (x0 + x1) / 2, (z0 + z1) / 2, 0, 0, 0.4, 0.4, 0.5, room=0)
    house = read(written(0, (placed,), lamp_catalogue()))
    lamp = next(item for item in house.items if item.kind is ItemKind.LAMP)
    low, high = lamp.bounds
    assert high[1] == pytest.approx(house.rooms[0].ceiling_y, abs=0.01)
    assert lamp.lights[0].position == pytest.approx(
        ((x0 + x1) / 2 + 0.1, low[1] + 0.1, (z0 + z1) / 2 - 0.05), abs=0.01
    )
    kinds = {house.materials[s.material].kind for s in lamp.surfaces}
    assert MaterialKind.GLASS in kinds


def test_the_file_credits_the_authors_of_its_models() -> None:
    placed = PlacedPiece(LAMP, 1, 1, 0, 0, 0.4, 0.4, 0.5, room=0)
    data = written(0, (placed,), lamp_catalogue())
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        root = ET.fromstring(archive.read("Home.xml"))
    properties = {e.get("name"): e.get("value") for e in root.findall("property")}
    assert properties["License"] == "CC-BY 3.0"
    assert "A. Person" in (properties["Models"] or "")
