from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House, Item, ItemKind, Surface
from pbrs_farm.core.recipe import ReadFields, RepairFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from pbrs_farm.repair.repair_house import repair
from tests.hypothesis_profiles import examples
from tests.inputs.damaged_json import outcome, paths_of, values
from tests.inputs.suncg_files import arch_json, write_v2
from tests.read.suncg.suncg_root import HOUSE


def read(root: Path) -> House:
    return read_suncg(root, HOUSE, ReadFields())


def volume(surfaces: tuple[Surface, ...]) -> float:
    p = np.concatenate([s.positions[s.faces] for s in surfaces]).astype(np.float64)
    return float(np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


def item(house: House, item_id: str) -> Item:
    return next(i for i in house.items if i.id == item_id)


def test_v2_walls_are_solids_outward_from_their_points(tmp_path: Path) -> None:
    write_v2(tmp_path, arch_json())
    house = read(tmp_path)
    assert [i.id for i in house.items][:6] == ["0_0w0", "0_0w1", "0_0w2", "0_0w3", "0_0f", "0_0c"]
    wall = item(house, "0_0w2")
    assert np.allclose(wall.bounds, [[0, 0, 3], [4, 2.735, 3.12]], atol=1e-5)
    assert volume(wall.surfaces) == pytest.approx(4 * 2.735 * 0.12, rel=1e-5)
    inside = next(s for s in wall.surfaces if s.name == "inside")
    assert np.allclose(inside.positions[:, 2], 3.0)
    assert house.materials[inside.material].diffuse == (1.0, 0.0, 0.0)
    assert np.allclose(item(house, "0_0w0").bounds[0], [0, 0, -0.12], atol=1e-5)


def test_walls_drawn_in_reverse_are_in_the_same_place(tmp_path: Path) -> None:
    arch = arch_json()
    for element in arch["elements"][:4]:
        element["points"].reverse()
        element["holes"] = []
    write_v2(tmp_path, arch)
    wall = item(read(tmp_path), "0_0w2")
    assert np.allclose(wall.bounds, [[0, 0, 3], [4, 2.735, 3.12]], atol=1e-5)
    assert volume(wall.surfaces) > 0


def test_v2_floors_and_ceilings_are_slabs_and_make_the_room(tmp_path: Path) -> None:
    write_v2(tmp_path, arch_json())
    house = read(tmp_path)
    floor, ceiling = item(house, "0_0f"), item(house, "0_0c")
    assert floor.kind is ItemKind.FLOOR
    assert volume(floor.surfaces) == pytest.approx(12 * 0.05, rel=1e-5)
    assert np.allclose(ceiling.bounds[:, 1], [2.69, 2.74])
    room = house.room("0_0")
    assert (room.floor_y, room.ceiling_y) == pytest.approx((0.05, 2.69))
    assert np.allclose([room.polygon.min(0), room.polygon.max(0)], [[0, 0], [4, 3]], atol=1e-4)


def test_a_slab_with_a_hole_is_closed(tmp_path: Path) -> None:
    arch = arch_json()
    arch["elements"][4] |= {
        "points": [
            [[0, 0, 0], [4, 0, 0], [4, 0, 3], [0, 0, 3]],
            [[1, 0, 1], [2, 0, 1], [2, 0, 2], [1, 0, 2]],
        ]
    }
    write_v2(tmp_path, arch)
    assert volume(item(read(tmp_path), "0_0f").surfaces) == pytest.approx(11 * 0.05, rel=1e-5)


def test_holes_become_openings_with_their_windows(tmp_path: Path) -> None:
    write_v2(tmp_path, arch_json())
    (opening,) = read(tmp_path).openings
    assert (opening.item_id, opening.is_window, opening.is_cut) == ("0_6", True, False)
    # The wall runs from (4, 3) to (0, 3): u = 1.1..2.5 is x = 2.9..1.5.
    assert np.allclose(
        [opening.quad.min(0), opening.quad.max(0)], [[1.5, 0.9, 3.06], [2.9, 2.3, 3.06]]
    )
    assert volume((opening.cutter,)) == pytest.approx(1.4 * 1.4 * 0.16, rel=1e-4)


def test_repair_closes_and_cuts_a_v2_house(tmp_path: Path) -> None:
    write_v2(tmp_path, arch_json())
    _, report = repair(read(tmp_path), RepairFields())
    assert report.structure.n_openings_cut == 1
    assert [r.enclosure for r in report.rooms] == ["closed"]


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda a: a.pop("elements"), "elements"),
        (lambda a: a["elements"].insert(0, 3), "element 0"),
        (lambda a: a["elements"][0].update(points=[[0, 0, 0]]), "element 0 (Wall 0_0_0), points"),
        (lambda a: a["elements"][0].update(height=-1), "element 0 (Wall 0_0_0), height"),
        (lambda a: a["elements"][0].update(depth="x"), "element 0 (Wall 0_0_0), depth"),
        (lambda a: a["elements"][0].update(holes=[{}]), "element 0 (Wall 0_0_0), holes[0].box"),
        (lambda a: a["elements"][4].update(points=[[[0, 0, 0]]]), "element 4 (Floor 0_0f), points[0]"),
        (lambda a: a["elements"][4].update(offset=[0]), "element 4 (Floor 0_0f), offset"),
    ],
)  # fmt: skip
def test_a_wrong_arch_json_is_refused_naming_the_element(
    tmp_path: Path, edit: Any, place: str
) -> None:
    arch = arch_json()
    edit(arch)
    write_v2(tmp_path, arch)
    with pytest.raises(BadHouse) as caught:
        read(tmp_path)
    assert caught.value.place == place
    assert caught.value.file.endswith("arch.json")


def test_a_v2_root_without_arch_json_is_refused_with_the_missing_file(tmp_path: Path) -> None:
    write_v2(tmp_path, arch_json())
    shutil.rmtree(tmp_path / "wall")
    with pytest.raises(BadHouse, match=r"room\.zip.*arch\.json"):
        read(tmp_path)


@settings(max_examples=examples(20), deadline=20_000, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(paths_of(arch_json())), values)
def test_any_value_anywhere_in_arch_json_gives_a_house_or_a_bad_house(
    tmp_path_factory: pytest.TempPathFactory, path: tuple[Any, ...], value: Any
) -> None:
    arch = arch_json()
    holder: Any = arch
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    root = tmp_path_factory.mktemp("v2")
    write_v2(root, arch)
    outcome(lambda: read(root))
    shutil.rmtree(root)
