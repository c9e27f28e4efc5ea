"""3D-FRONT houses of three generations, intact and damaged."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from pbrs_farm.core.classes import LAMP, NYU40_NAMES
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import BOX_ONLY, FRONT_GIVEN, House, ItemKind, MaterialKind
from pbrs_farm.core.recipe import ReadFields, Recipe
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.common.given_classes import given_class
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.front3d.front_file import front_file
from tests.inputs import front3d_files as files


def read(path: Path, models: str = "") -> House:
    return read_house(resolve(str(path), models=models), ReadFields())


def written(folder: Path, house: dict[str, Any]) -> Path:
    path = folder / "flat.json"
    folder.mkdir(exist_ok=True)
    path.write_text(json.dumps(house))
    return path


@pytest.mark.quick(1)
@pytest.mark.parametrize("generation", files.GENERATIONS)
def test_a_repaired_house_of_each_generation_leaks_no_ray_and_keeps_walls_and_openings(
    tmp_path: Path, generation: files.Generation
) -> None:
    path = files.write_house(tmp_path, generation, with_models=False)
    house = read(path)
    doors = [i for i in house.items if i.kind is ItemKind.DOOR]
    windows = [i for i in house.items if i.kind is ItemKind.WINDOW]
    assert (len(doors), len(windows), len(house.openings)) == (6, 5, 12)
    assert sum(i.kind is ItemKind.WALL for i in house.items) == 24
    if generation == "0.4":
        return  # the others have the same walls; testing one jamb and one gap is enough
    if generation == "0.10":
        return
    recipe = Recipe().model_copy(update={"read": ReadFields(stand_ins="none")})
    repaired, report = repaired_house(resolve(str(path)), recipe)
    assert report.leaks is not None
    assert report.leaks.n_sky == 0
    assert report.structure.walls_lost == ()
    assert (report.structure.n_openings, report.structure.n_openings_cut) == (12, 12)
    assert {str(room.enclosure) for room in repaired.rooms} == {"closed"}


@pytest.mark.parametrize("generation", ["0.11", "0.11 gaps"])
def test_walls_of_tiles_and_grout_have_the_openings_of_plain_ones(
    tmp_path: Path, generation: files.Generation
) -> None:
    # The wall is tiled from one side or from both; each mesh alone is full of gaps.
    tiled = files.tile_walls(
        files.front_house(generation), ("Bathroom-5", "SecondBedroom-6", "Kitchen-2")
    )
    house = read(written(tmp_path, tiled))
    plain = read(written(tmp_path, files.front_house(generation)))
    assert [o.id for o in house.openings] == [o.id for o in plain.openings]
    for opening, expected in zip(house.openings, plain.openings, strict=True):
        np.testing.assert_allclose(opening.quad, expected.quad, atol=0.01)
    walls = [i for i in house.items if i.kind is ItemKind.WALL]
    assert len(walls) == 24
    # The larger mesh paints the wall.
    painted = {house.materials[s.material].name for i in walls for s in i.surfaces}
    assert painted == {"paint", "tiles"}


def test_a_wall_of_two_adjacent_meshes_has_no_false_hole(tmp_path: Path) -> None:
    # L-shaped paint around a panel in its upper corner, on both sides of one wall.
    front_house = files.front_house("0.11 gaps")
    for z, name in ((4.0, "LivingRoom-1"), (4.12, "Hallway-3")):
        room = next(r for r in front_house["scene"]["room"] if r["instanceid"] == name)
        refs = {c["ref"] for c in room["children"]}
        mesh = next(
            m
            for m in front_house["mesh"]
            if m["uid"] in refs and m["type"] == "WallInner" and set(m["xyz"][2::3]) == {z}
        )
        corners = np.reshape(mesh["xyz"], (-1, 3, 3))
        is_panel = (corners[..., 0].max(1) < 1.6) & (corners[..., 1].min(1) > 2)
        assert is_panel.any()
        for part, part_faces in (("paint", ~is_panel), ("panel", is_panel)):
            xyz = corners[part_faces].reshape(-1, 3)
            row = {"uid": f"{name}/{part}", "xyz": xyz.ravel().tolist()}
            front_house["mesh"].append({**mesh, **row, "faces": list(range(len(xyz)))})
            child = next(c for c in room["children"] if c["ref"] == mesh["uid"])
            room["children"].append({**child, "ref": f"{name}/{part}"})
        front_house["mesh"].remove(mesh)
    plain = read(written(tmp_path, files.front_house("0.11 gaps")))
    assert len(read(written(tmp_path, front_house)).openings) == len(plain.openings)


def test_rooms_have_the_types_and_areas_of_the_file(tmp_path: Path) -> None:
    house = read(written(tmp_path, files.front_house()))
    for room, (kind, x0, z0, x1, z1) in zip(house.rooms, files.ROOMS.values(), strict=True):
        assert room.name.replace(" ", "") == kind.replace("LivingDiningRoom", "livingroom")
        assert shapely.Polygon(room.polygon).area == pytest.approx((x1 - x0) * (z1 - z0), abs=0.02)
    assert [r.types for r in house.rooms][:3] == [("living",), ("kitchen",), ("hall",)]


def test_walls_are_as_thick_as_the_distance_of_their_faces(tmp_path: Path) -> None:
    house = read(written(tmp_path, files.front_house("0.11 gaps")))
    walls = [i for i in house.items if i.kind is ItemKind.WALL]
    outside = min(walls, key=lambda i: float(i.bounds[0, 2]))
    # Mitred: the back extends to the outer corner.
    assert outside.bounds[0, 2] == pytest.approx(-0.24, abs=1e-4)
    for opening, (_, _, (x, z), axis, width, low, high, depth, _d) in zip(
        sorted(house.openings, key=lambda o: tuple(np.round(o.quad.mean(0), 2))),
        sorted(files.HOLES, key=lambda h: (h[2][0], round((h[5] + h[6]) / 2, 2), h[2][1])),
        strict=True,
    ):
        size = np.ptp(opening.quad, axis=0)
        across = np.ptp(opening.cutter.positions, axis=0)[2 if axis == "x" else 0]
        np.testing.assert_allclose(opening.quad.mean(0), [x, (low + high) / 2, z], atol=0.01)
        assert size[0 if axis == "x" else 2] == pytest.approx(width, abs=0.01)
        assert across == pytest.approx(depth + 0.04, abs=0.01)


def test_ceilings_and_floors_of_either_winding_face_the_room(tmp_path: Path) -> None:
    for generation in ("0.4", "0.11"):
        house = read(written(tmp_path, files.front_house(generation)))
        for item in house.items:
            if item.kind in (ItemKind.FLOOR, ItemKind.CEILING):
                for s in item.surfaces:
                    a, b, c = (s.positions[s.faces[:, k]] for k in range(3))
                    n = np.cross(b - a, c - a)[:, 1]
                    assert ((n > 0) == (item.kind is ItemKind.FLOOR)).all()


def test_titles_give_sliding_doors_of_glass_and_mirrored_doors_change_sides(tmp_path: Path) -> None:
    house = read(written(tmp_path, files.front_house()))
    doors = {i.source_class: i for i in house.items if i.kind is ItemKind.DOOR}
    sliding = doors["door/double sliding door"]
    kinds = [house.materials[s.material].kind for s in sliding.surfaces]
    assert MaterialKind.PANE in kinds
    plain = doors["door/single swing door"]
    assert MaterialKind.PANE not in [house.materials[s.material].kind for s in plain.surfaces]
    # Mirror a door model: its handle changes sides.
    scene = files.front_house()
    handles = []
    for mirrored in (False, True):
        if mirrored:
            for room in scene["scene"]["room"]:
                for child in room["children"]:
                    if child["ref"] == "hole1/model":
                        child["scale"] = [-1, 1, 1]
            scene["extension"]["door"][1]["ref"] = ["hole1/model"]
            scene["mesh"] = [m for m in scene["mesh"] if m["type"] != "Door"]
        door = _door_at(read(written(tmp_path, scene)), 2.0, 4.06)
        handle = next(s for s in door.surfaces if s.name == "handle")
        handles.append(float(handle.positions[:, 0].mean()) - 2.0)
    assert handles[0] * handles[1] < 0


def _door_at(house: House, x: float, z: float) -> Any:
    return next(
        i for i in house.items if i.kind is ItemKind.DOOR
        and np.abs(i.oriented_box.centre[[0, 2]] - [x, z]).max() < 0.1
    )  # fmt: skip


def test_pieces_have_the_place_of_their_child_and_the_class_of_the_tables(tmp_path: Path) -> None:
    house = read(files.write_house(tmp_path))
    pieces = [i for i in house.items if i.id.startswith("piece_")]
    assert len(pieces) == files.N_DRAWN
    sofa = next(i for i in pieces if "Sofa" in i.source_class)
    np.testing.assert_allclose(sofa.bounds, [[0.15, 0, 2.95], [2.25, 0.8, 3.85]], atol=1e-4)
    # Turned by 180 degrees: the lower half, which is the front, faces -z.
    high = np.concatenate([s.positions for s in sofa.surfaces])
    assert high[high[:, 1] > 0.7][:, 2].min() == pytest.approx(3.4, abs=1e-4)
    assert all(len(s.faces) != 2 for i in pieces for s in i.surfaces), "the shadow cards are gone"
    assert sum("mirrored" in i.tags for i in pieces) == 1
    for _, title, category, *_rest in files.PIECES[:-1]:
        item = next(i for i in pieces if i.source_class == (category or title))
        classes = given_class("3dfuture", category) or given_class("3dfront-title", title)
        assert classes is not None
        assert NYU40_NAMES[item.nyu40] == NYU40_NAMES[classes.nyu40]


def test_without_models_pieces_are_boxes_of_their_size_and_one_note_reports_it(
    tmp_path: Path,
) -> None:
    house = read(files.write_house(tmp_path, with_models=False))
    box_only = [i for i in house.items if BOX_ONLY in i.tags]
    assert len(box_only) == files.N_DRAWN
    assert all(FRONT_GIVEN in i.tags for i in box_only)
    sofa = next(i for i in box_only if "sofa" in i.source_class)
    assert sofa.box is not None
    np.testing.assert_allclose(2 * sofa.box.half, [2.1, 0.8, 0.9])
    np.testing.assert_allclose(sofa.box.centre, [1.2, 0.4, 3.4], atol=1e-9)
    np.testing.assert_allclose(sofa.box.axes[:, 2], [0, 0, -1], atol=1e-9)
    assert [n.kind for n in house.notes].count("missing-model") == 1


def test_models_may_lie_in_a_folder_that_is_named(tmp_path: Path) -> None:
    path = files.write_house(tmp_path / "a", with_models=False)
    files.write_models(tmp_path / "b" / "3D-FUTURE-model")
    for models in (tmp_path / "b", tmp_path / "b" / "3D-FUTURE-model"):
        source = resolve(str(path), models=str(models))
        assert source.companions
        assert not any(BOX_ONLY in i.tags for i in read_house(source, ReadFields()).items)


def test_a_declared_light_without_a_lamp_becomes_a_lamp_of_its_colour(tmp_path: Path) -> None:
    house = read(files.write_house(tmp_path))
    spots = [i for i in house.items if i.id.startswith("light_")]
    assert len(spots) == 3
    for spot in spots:
        assert (spot.nyu40, house.room(spot.room_id or "").name) == (LAMP, "Hallway")
        r, g, b = spot.lights[0].rgb_linear
        assert r > g > b
        assert spot.lights[0].position[1] < files.HEIGHT


def test_missing_invalid_and_flat_pieces_are_notes_with_their_number(tmp_path: Path) -> None:
    scene = files.front_house()
    scene["furniture"][-1]["valid"] = False
    scene["scene"]["room"][0]["children"][-2]["scale"] = [1, 0, 1]
    house = read(written(tmp_path, scene))
    texts = [n.text for n in house.notes if n.kind == "missing-piece"]
    assert [t.split(":")[0] for t in texts] == [
        "1 children name no entry", "1 children name an invalid piece", "1 children are flat or huge",
    ]  # fmt: skip


# Refused inputs: one line with the place.


def _changed(path: list[Any], value: Any) -> dict[str, Any]:
    scene = files.front_house()
    target: Any = scene
    for step in path[:-1]:
        target = target[step]
    target[path[-1]] = value
    return scene


FAULTS = {
    "no mesh": (_changed(["mesh"], []), "mesh: is missing or empty"),
    "no rooms": (_changed(["scene", "room"], []), r"scene\.room: is missing or empty"),
    "text for a number": (_changed(["mesh", 3, "xyz"], ["a", 0, 0]), r"mesh\[3\]\.xyz"),
    "nested": (_changed(["mesh", 3, "xyz"], [[0, 0, 0]]), r"mesh\[3\]\.xyz"),
    "two numbers": (_changed(["mesh", 3, "xyz"], [0, 0]), r"mesh\[3\]\.xyz"),
    "an index beyond": (_changed(["mesh", 3, "faces"], [0, 1, 10**9]), r"mesh\[3\]\.faces"),
    "a huge number": (_changed(["mesh", 3, "xyz", 0], 1e30), r"mesh\[3\]\.xyz"),
    "a short turn": (_changed(["scene", "room", 0, "children", 7, "rot"], [0, 1]), r"children\[7\]\.rot"),
    "rooms are an object": (_changed(["scene", "room"], {"a": 1}), r"room.*list"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_damaged_house_is_refused_with_its_place(tmp_path: Path, name: str) -> None:
    scene, expected = FAULTS[name]
    if name == "a short turn":
        for child in scene["scene"]["room"][0]["children"]:
            child["rot"] = [0, 1]
        expected = r"children\[\d+\]\.rot"
    with pytest.raises(BadHouse, match=expected) as error:
        read(written(tmp_path, scene))
    assert "\n" not in str(error.value)


def test_truncated_files_nan_and_centimetres_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, files.front_house())
    text = path.read_text()
    for damaged in (text[: len(text) * 3 // 4], text.replace("2.7", "NaN")):
        path.write_text(damaged)
        with pytest.raises(BadHouse, match="not valid JSON"):
            read(path)
    scene = files.front_house()
    for mesh in scene["mesh"]:
        mesh["xyz"] = [100 * v for v in mesh["xyz"]]
    with pytest.raises(BadHouse, match="looks like centimetres"):
        read(written(tmp_path, scene))


def test_ids_twice_and_names_that_lead_out_do_no_harm(tmp_path: Path) -> None:
    scene = files.front_house()
    scene["mesh"].append(scene["mesh"][0])
    for piece in scene["furniture"]:
        piece["jid"] = "../../../etc"
    scene["material"][2]["jid"] = "../../secret"
    house = read(written(tmp_path, scene))
    assert "duplicate-id" in [n.kind for n in house.notes]
    ids = [i.id for i in house.items]
    assert len(ids) == len(set(ids))


def test_uids_are_distinguished_by_their_last_characters(tmp_path: Path) -> None:
    short = read(written(tmp_path / "short", files.front_house()))
    scene = files.front_house()
    renamed = {mesh["uid"]: "x" * 80 + f"/{k:03d}" for k, mesh in enumerate(scene["mesh"])}
    for mesh in scene["mesh"]:
        mesh["uid"] = renamed[mesh["uid"]]
    for room in scene["scene"]["room"]:
        for child in room["children"]:
            child["ref"] = renamed.get(child["ref"], child["ref"])
    long = read(written(tmp_path / "long", scene))
    assert [(i.kind, i.room_id) for i in long.items] == [(i.kind, i.room_id) for i in short.items]
    assert "duplicate-id" not in [n.kind for n in long.notes]


def test_a_second_mesh_of_one_uid_is_read_if_it_differs(tmp_path: Path) -> None:
    scene = files.front_house()
    floor = next(m for m in scene["mesh"] if m["type"] == "Floor")
    scene["mesh"] += [floor, floor | {"xyz": [v + 1 for v in floor["xyz"]]}]
    notes = Notes("flat.json", strict=False)
    meshes = front_file(json.dumps(scene).encode(), "flat.json", notes).meshes
    assert len(meshes) == len(files.front_house()["mesh"]) + 1
    assert notes.count("duplicate-id") == 2


def test_a_million_entries_are_refused_quickly(tmp_path: Path) -> None:
    path = tmp_path / "many.json"
    path.write_text('{"furniture":[],"mesh":[' + '{"type":"Floor"},' * 10**6 + '{}],"scene":{"room":[{}]}}')  # fmt: skip
    start = time.monotonic()
    with pytest.raises(BadHouse, match="at most"):
        read_house(resolve(str(path)), ReadFields())
    assert time.monotonic() - start < 20


def test_a_home_of_shafts_alone_says_so(tmp_path: Path) -> None:
    scene = files.front_house()
    for model in scene["mesh"]:
        model["xyz"] = [0.1 * x for x in model["xyz"]]
    with pytest.raises(BadHouse, match=r"all \d rooms are below 0.5 m2: shafts, not rooms"):
        read(written(tmp_path, scene))


def test_a_door_in_no_hole_and_a_shaft_are_notes(tmp_path: Path) -> None:
    scene = files.front_house()
    plain = read(written(tmp_path, scene))
    for room in scene["scene"]["room"]:
        for child in room["children"]:
            if child["ref"] == "hole1/model":
                child["pos"] = [2.0, 0.0, 2.0]
    floor = files.level_face(20.0, 20.0, 20.5, 20.6, 0.0, up=True)
    xyz = np.asarray(floor, float).reshape(-1, 3)
    row = {"uid": "shaft/floor", "type": "Floor", "xyz": xyz.ravel().tolist(),
           "faces": list(range(len(xyz)))}  # fmt: skip
    model = next(m for m in scene["mesh"] if m["type"] == "Floor")
    scene["mesh"].append({**model, **row, "uv": [0.0] * (2 * len(xyz)),
                          "normal": [0.0, 1.0, 0.0] * len(xyz)})  # fmt: skip
    child = {"ref": "shaft/floor", "instanceid": "shaft/1", "pos": [0, 0, 0], "rot": [0, 0, 0, 1],
             "scale": [1, 1, 1]}  # fmt: skip
    shaft = {"type": "EquipmentRoom", "instanceid": "EquipmentRoom-9", "children": [child]}
    scene["scene"]["room"].append(shaft)
    house = read(written(tmp_path, scene))
    assert [r.name for r in house.rooms] == [r.name for r in plain.rooms]
    texts = {n.kind: n.text for n in house.notes}
    assert texts["room-left-out"] == "has 0.30 m2: a shaft, not a room"
    assert texts["opening-without-wall"].startswith("door/")
