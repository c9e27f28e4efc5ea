"""sceneState files of HSSD, Rent3D++ and generators, intact and damaged."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import BOX_ONLY, House, ItemKind, MaterialKind
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs import scenestate_files as files


def written(folder: Path, scene: dict[str, Any]) -> Path:
    path = folder / "home.scenestate.json"
    path.write_text(json.dumps(scene))
    return path


def read(path: Path, models: str = "") -> House:
    return read_house(resolve(str(path), models=models), ReadFields())


@pytest.mark.parametrize("kind", ["hssd", "rent3d", "generated"])
def test_a_repaired_scene_leaks_no_ray_loses_no_wall_and_keeps_its_openings(
    tmp_path: Path, kind: str
) -> None:
    path = (
        files.hssd_like(tmp_path)
        if kind == "hssd"
        else written(tmp_path, files.rent3d_like() if kind == "rent3d" else files.generated())
    )
    house, report = repaired_house(resolve(str(path)), Recipe())
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert report.structure.walls_lost == ()
    assert report.structure.n_openings_cut == report.structure.n_openings
    assert report.structure.n_openings == {"hssd": files.N_OPENINGS, "rent3d": 3, "generated": 0}[kind]  # fmt: skip
    assert {str(room.enclosure) for room in house.rooms} == {"closed"}


def test_a_hssd_scene_has_its_rooms_its_doors_with_leaves_and_windows_with_panes(
    tmp_path: Path,
) -> None:
    house = read(files.hssd_like(tmp_path))
    assert [r.name for r in house.rooms] == [kind for _, kind in files.ROOMS.values()]
    doors = [i for i in house.items if i.kind is ItemKind.DOOR]
    windows = [i for i in house.items if i.kind is ItemKind.WINDOW]
    assert (len(doors), len(windows)) == (6, 5)
    for window in windows:
        kinds = {house.materials[s.material].kind for s in window.surfaces}
        assert kinds == {MaterialKind.OPAQUE, MaterialKind.PANE}
    assert all(float(d.bounds[0, 1]) == pytest.approx(0, abs=0.01) for d in doors)


def test_the_matrix_of_a_model_places_it_and_the_scene_turns_it(tmp_path: Path) -> None:
    house = read(files.hssd_like(tmp_path))
    sofa = next(i for i in house.items if i.name == "couch")
    assert NYU40_NAMES[sofa.nyu40] == "sofa"
    low, high = sofa.bounds
    # The plan's y points away from the viewer: x is unchanged, the front is turned by 180 degrees.
    np.testing.assert_allclose(high - low, [2.0, 0.8, 0.9], atol=1e-5)
    assert low[1] == pytest.approx(0, abs=1e-5)
    room = house.room(sofa.room_id or "")
    assert room.name == "living room"


def test_without_models_the_tables_category_and_size_are_used(tmp_path: Path) -> None:
    house = read(files.hssd_like(tmp_path, with_models=False))
    box_only = [i for i in house.items if BOX_ONLY in i.tags]
    assert len(box_only) == 20
    sofa = next(i for i in box_only if i.name == "couch")
    assert sofa.box is not None
    np.testing.assert_allclose(2 * sofa.box.half, [2.0, 0.8, 0.9], atol=1e-6)
    with_models = read(files.hssd_like(tmp_path / "b"))
    modelled = next(i for i in with_models.items if i.name == "couch")
    np.testing.assert_allclose(sofa.box.centre, modelled.bounds.mean(0), atol=1e-3)


def test_objects_without_model_and_table_are_one_note(tmp_path: Path) -> None:
    house = read(written(tmp_path, files.generated()))
    (note,) = [n for n in house.notes if n.kind == "missing-model"]
    assert note.text.startswith("5 objects are left out")


def test_models_are_found_in_a_folder_that_is_named_and_change_the_fingerprint(
    tmp_path: Path,
) -> None:
    path = files.hssd_like(tmp_path / "models")
    lone = tmp_path / "alone" / "deep" / "er" / path.name
    lone.parent.mkdir(parents=True)
    lone.write_bytes(path.read_bytes())
    bare, full = resolve(str(lone)), resolve(str(lone), models=str(tmp_path / "models"))
    assert bare.companions == ""
    assert full.companions
    assert bare.house_id == full.house_id
    n_before = len(read_house(bare, ReadFields()).items)
    assert len(read_house(full, ReadFields()).items) == n_before + 20


def test_a_generated_room_gets_its_ceiling_at_the_height_of_its_walls(tmp_path: Path) -> None:
    house = read(written(tmp_path, files.generated()))
    (ceiling,) = [i for i in house.items if i.kind is ItemKind.CEILING]
    assert ceiling.bounds[0, 1] == pytest.approx(2.7)
    assert house.rooms[0].floor_y == pytest.approx(0)


def test_a_wall_listed_by_two_rooms_is_one_and_so_is_its_door(tmp_path: Path) -> None:
    house = read(written(tmp_path, files.rent3d_like()))
    assert sum(i.kind is ItemKind.WALL for i in house.items) == 7
    assert sum(i.kind is ItemKind.DOOR for i in house.items) == 1
    shared = next(
        i for i in house.items if i.kind is ItemKind.WALL
        and sum(t.startswith("boundary_of") for t in i.tags) == 2
    )  # fmt: skip
    np.testing.assert_allclose(shared.bounds[:, 0], [3.95, 4.05], atol=1e-5)


def test_a_hole_is_clipped_to_its_wall(tmp_path: Path) -> None:
    scene = files.rent3d_like()
    wall = scene["scene"]["arch"]["elements"][2]
    wall["holes"][0]["box"] = {"min": [-0.06, 0.9], "max": [1.0, 5.0]}
    house = read(written(tmp_path, scene))
    window = next(i for i in house.items if i.kind is ItemKind.WINDOW)
    assert window.bounds[1, 1] <= 2.84
    assert window.bounds[0, 0] >= -0.01


# Refused inputs: one line with the place.


def _changed(path: list[Any], value: Any) -> dict[str, Any]:
    scene = files.rent3d_like()
    target: Any = scene["scene"]
    for step in path[:-1]:
        target = target[step]
    target[path[-1]] = value
    return scene


_WALL = ["arch", "elements", 2]
FAULTS = {
    "points of two numbers": (_changed([*_WALL, "points"], [[0, 0], [1, 1]]), r"elements\[2\].*points"),
    "one end": (_changed([*_WALL, "points"], [[0, 0, 0]]), "expected 2 ends"),
    "a huge number": (_changed([*_WALL, "points", 0], [1e30, 0, 0]), r"elements\[2\]"),
    "no height": (_changed([*_WALL, "height"], None), r"elements\[2\].*height"),
    "up and front are one": (_changed(["front"], [0, 1, 0]), "up, front"),
    "elements are not a list": (_changed(["arch", "elements"], {}), "elements"),
    "no floor": (_changed(["arch", "elements"], []), "has no floor"),
    "a flat matrix": (_changed(["object"], [{"modelId": "a.b", "transform": {"data": [0] * 16}}]), r"object\[0\]"),
    "three numbers a matrix": (_changed(["object"], [{"modelId": "a.b", "transform": {"data": [0] * 3}}]), "16 numbers"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_damaged_scene_is_refused_with_its_place(tmp_path: Path, name: str) -> None:
    scene, expected = FAULTS[name]
    with pytest.raises(BadHouse, match=expected) as error:
        read(written(tmp_path, scene))
    assert "\n" not in str(error.value)


def test_truncated_text_and_invalid_numbers_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, files.rent3d_like())
    text = path.read_text()
    for damaged in (text[: len(text) * 2 // 3], text.replace("2.8", "NaN"), text.replace("2.8", "Infinity")):  # fmt: skip
        path.write_text(damaged)
        with pytest.raises(BadHouse, match="not valid JSON"):
            read(path)


def test_a_scene_in_centimetres_is_called_so_and_its_unit_mends_it(tmp_path: Path) -> None:
    scene = files.rent3d_like()
    text = json.dumps(scene)
    for e in scene["scene"]["arch"]["elements"]:
        points = np.array(e["points"]) * 100
        e["points"] = points.tolist()
        for key in ("height", "depth", "extra_height"):
            if key in e:
                e[key] *= 100
        if "offset" in e:
            e["offset"] = [0, 280, 0]
        for hole in e.get("holes", []):
            hole["box"] = {k: [100 * v for v in corner] for k, corner in hole["box"].items()}
    with pytest.raises(BadHouse, match="looks like centimetres"):
        read(written(tmp_path, scene))
    scene["scene"]["unit"] = 0.01
    metres = tmp_path / "metres.scene.json"
    metres.write_text(text)
    mended, expected = read(written(tmp_path, scene)), read(metres)
    assert [i.name for i in mended.items] == [i.name for i in expected.items]
    np.testing.assert_allclose(mended.items[0].bounds, expected.items[0].bounds, atol=1e-4)


def test_ids_twice_cyclic_parents_and_names_that_lead_out_do_no_harm(tmp_path: Path) -> None:
    scene = files.generated()
    for element in scene["scene"]["arch"]["elements"]:
        element["id"] = "same"
    objects = scene["scene"]["object"]
    objects[0]["parentIndex"], objects[1]["parentIndex"] = 1, 0
    objects[2]["modelId"] = "objaverse.../../etc/passwd"
    house = read(written(tmp_path, scene))
    ids = [i.id for i in house.items]
    assert len(ids) == len(set(ids))


@pytest.mark.quick(1)
@pytest.mark.parametrize("what", ["walls", "slabs", "holes"])
def test_more_walls_slabs_or_holes_than_a_home_has_are_refused(tmp_path: Path, what: str) -> None:
    scene = files.rent3d_like()
    elements = scene["scene"]["arch"]["elements"]
    wall, floor = elements[2], elements[0]
    if what == "holes":
        wall["holes"] *= 4_000
    else:
        elements += [(wall if what == "walls" else floor) | {"id": f"e{k}"} for k in range(4_000)]
    with pytest.raises(BadHouse, match=rf"\d+ {what}, at most"):
        read(written(tmp_path, scene))


def test_a_million_elements_are_refused_quickly(tmp_path: Path) -> None:
    path = tmp_path / "many.scenestate.json"
    element = '{"type":"Wall","points":[[0,0,0],[1,0,0]],"height":1},'
    path.write_text(
        '{"format":"sceneState","scene":{"arch":{"elements":[' + element * 10**6 + "{}]}}}"
    )
    start = time.monotonic()
    with pytest.raises(BadHouse, match=r"more than any house|at most"):
        read(path)
    assert time.monotonic() - start < 20
