from __future__ import annotations

import json

import pytest

from pbrs_farm.core.classes import FLOOR, NYU40_NAMES
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import ItemKind
from tests.read.gltf.gltf_scenes import item, read, two_rooms


def test_ground_that_is_called_grass_is_ground_and_a_tuft_of_it_a_plant() -> None:
    scene = two_rooms()
    scene.node("Grass", mesh=scene.box([-6, -0.3, -6], [10, -0.13, -0.13]))
    scene.node("Grass.001", mesh=scene.box([1, 0, 1], [1.3, 0.4, 1.3]))
    scene.node("Hedge", mesh=scene.box([-6, 0, -6], [10, 1.2, -5]))
    scene.node("Turf", extras={"class": "plant"}, mesh=scene.box([-6, -0.3, -6], [10, -0.13, -1]))
    house = read(scene)
    kinds = {i.name: (str(i.kind), i.nyu40) for i in house.items}
    assert kinds["Grass"] == ("ground", FLOOR)
    assert [kinds[n][0] for n in ("Grass.001", "Hedge", "Turf")] == ["plant"] * 3


def test_names_give_classes_and_unknown_ones_are_otherprop_with_a_note() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [0.5, 0.5, 0.5])
    for name in ("Armchair_01", "wall lamp", "Thing.002", "Kitchen cabinet L"):
        s.node(name, mesh=cube, translation=[1, 0, 1])
    s.node("floor mat", mesh=s.box([1, 0, 1], [2, 0.02, 1.5]))
    house = read(s)
    got = {i.name: (i.nyu40, i.kind) for i in house.items}
    assert got["Floor"] == (2, ItemKind.FLOOR)
    assert got["Walls outer"] == (1, ItemKind.WALL)
    assert got["Wall.001"] == (1, ItemKind.WALL)
    assert got["Ceiling"] == (22, ItemKind.CEILING)
    assert got["Armchair_01"] == (5, ItemKind.OBJECT)
    assert got["wall lamp"] == (35, ItemKind.LAMP)
    assert got["floor mat"] == (20, ItemKind.OBJECT)
    assert got["Kitchen cabinet L"] == (3, ItemKind.OBJECT)
    assert got["Thing.002"] == (40, ItemKind.OBJECT)
    assert [n.kind for n in house.notes] == ["unmapped-class"]
    assert "Thing.002" in house.notes[0].place


def test_the_mapping_file_beats_names_and_extras_beat_the_mapping() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [0.5, 0.5, 0.5])
    s.node("Chair A", mesh=cube)
    s.node("Chair B", mesh=cube)
    s.node("Chair C", mesh=cube, extras={"class": "night_stand"})
    s.node("X7", mesh=cube)
    mapping = {"nodes": {"Chair*": "sofa", "Chair B": {"class": "bed", "kind": "object"}, "X?": 25}}
    house = read(s, mapping=json.dumps(mapping).encode())
    assert [item(house, f"Chair {x}").nyu40 for x in "ABC"] == [6, 4, 32]
    assert item(house, "X7").nyu40 == 25
    assert not house.notes


def test_a_group_is_one_item_unless_its_name_is_plural() -> None:
    s = two_rooms()
    cube = s.box([0, 0, 0], [0.2, 0.2, 0.2])
    legs = [s.node(f"leg {k}", mesh=cube, translation=[k, 0, 0]) for k in range(3)]
    s.node("Table", children=legs)
    chairs = [s.node(f"Cube.{k:03}", mesh=cube) for k in range(2)]
    s.node("Chairs", children=chairs)
    lamp = s.node("Lamp", mesh=cube)
    vase = s.node("Vase", mesh=cube, extras={"class": "otherprop"})
    s.node("Furniture", children=[s.node("Desk", mesh=cube, children=[lamp, vase])])
    house = read(s)
    assert item(house, "Table").n_faces == 36
    names = [i.name for i in house.items][7:]
    assert names == ["Table", "Cube.000", "Cube.001", "Desk", "Vase"]
    assert item(house, "Cube.001").nyu40 == 5
    assert item(house, "Desk").n_faces == 24  # its untagged lamp is part of it
    assert not house.notes


def test_a_storey_named_floor_is_no_floor() -> None:
    s = two_rooms()
    cube = s.node("Cube", mesh=s.box([1, 0, 1], [1.5, 0.5, 1.5]))
    chair = s.node("Chair", mesh=s.box([2, 0, 1], [2.5, 0.5, 1.5]))
    s.node("Ground floor", children=[0, 1, 2, 3, cube, chair])
    house = read(s)
    assert [i.name for i in house.items if i.kind is ItemKind.FLOOR] == ["Floor"]
    assert item(house, "Cube").tags == ("unmapped",)
    assert item(house, "Chair").nyu40 == 5
    assert len(house.rooms) == 2


def test_a_wrong_mapping_row_is_refused_naming_it() -> None:
    with pytest.raises(BadHouse, match="names no class"):
        read(two_rooms(), mapping=b'{"nodes": {"A": "spaceship"}}')


def test_materials_sizes_and_collections_disambiguate_names() -> None:
    s = two_rooms()
    s.materials += [{"name": "mirror_toilet"}, {"name": "Table_Kitchen"}]
    pane = s.box([1, 1, 0.1], [1.6, 1.8, 0.12], len(s.materials) - 2)
    s.node("Sink_mirror_mirror_toilet_0", mesh=pane)
    top = s.box([2, 0, 1], [3.2, 0.75, 1.8], len(s.materials) - 1)
    s.node("Table_Table_Kitchen_0", mesh=top)
    s.node("Pine", mesh=s.box([0.5, 0, 0.5], [3.5, 2, 0.6]))
    man = s.node("Man_01", mesh=s.box([4, 0, 1], [4.4, 1.7, 1.3]))
    s.node("Statues", children=[man])
    s.node("Man_02", mesh=s.box([4.6, 0, 1], [5, 1.7, 1.3]))
    s.node("Bottle_dining_table", mesh=s.box([2, 0.75, 1], [2.08, 1.05, 1.08]))
    kinds = {i.name: (str(i.kind), NYU40_NAMES[i.nyu40]) for i in read(s).items}
    assert kinds["Sink_mirror_mirror_toilet_0"] == ("object", "mirror")
    assert kinds["Table_Table_Kitchen_0"] == ("object", "table")
    assert kinds["Pine"] == ("object", "otherprop")
    assert kinds["Man_01"] == ("object", "otherprop")
    assert kinds["Man_02"] == ("person", "person")
    assert kinds["Bottle_dining_table"] == ("object", "otherprop")


def test_node_names_mark_the_mirror_and_the_pane_of_a_piece() -> None:
    s = two_rooms()
    s.materials += [{"name": "Chrome"}]
    sheet = s.box([1, 1, 0.1], [1.6, 1.8, 0.11], len(s.materials) - 1)
    parts = [s.node(name, mesh=sheet) for name in ("Mirror_Glass", "Mirror_Frame", "Drawer")]
    s.node("Dressing_Table", children=parts)
    assert [p.name for p in item(read(s), "Dressing_Table").surfaces] == [
        "Mirror_Glass", "Chrome", "Chrome",
    ]  # fmt: skip


def test_a_material_names_an_item_only_if_its_size_fits() -> None:
    s = two_rooms()
    boxes = {
        "Plane.001": ("Grass", [-6, -0.3, -6], [10, -0.13, -0.13]),
        "Cube.002": ("Pine", [1, 0, 1], [3, 1.9, 1.05]),
        "Object_3": ("Leaves", [4, 0, 1], [4.4, 0.9, 1.4]),
    }
    for name, (material, low, high) in boxes.items():
        s.materials.append({"name": material})
        s.node(name, mesh=s.box(low, high, len(s.materials) - 1))
    kinds = {i.name: str(i.kind) for i in read(s).items}
    assert [kinds[name] for name in boxes] == ["ground", "object", "plant"]


def test_a_material_called_mat_is_no_floor_mat_and_a_floor_mat_is_flat() -> None:
    s = two_rooms()
    cube = [1, 0, 1], [1.6, 0.1, 1.6]
    for k, name in enumerate(("mat_0", "Mat.1", "mat_black", "BlackMat", "Bath mat")):
        s.materials.append({"name": name})
        s.node(f"Object_{k}", mesh=s.box(*cube, len(s.materials) - 1))
    for name in ("Tall floor mat", "Rug"):
        s.node(name, mesh=s.box([1, 0, 1], [1.6, 0.7, 1.5]))
    house = read(s)
    classes = {i.name: NYU40_NAMES[i.nyu40] for i in house.items[4:]}
    assert [name for name, label in classes.items() if label == "floor mat"] == ["Object_4"]
    assert {classes["Tall floor mat"], classes["Rug"]} == {"otherprop"}


def test_the_mirrored_copy_of_a_part_is_no_mirror() -> None:
    s = two_rooms()
    s.materials.append({"name": "Chrome"})
    side = s.box([1, 0, 1], [1.02, 0.8, 1.5], len(s.materials) - 1)
    names = ("Side", "Side_mirror.001", "Door.mirror", "Hand_mirror")
    s.node("Cabinet", children=[s.node(name, mesh=side) for name in names])
    parts = [part.name for part in item(read(s), "Cabinet").surfaces]
    assert parts == ["Chrome", "Chrome", "Chrome", "Hand_mirror"]


@pytest.mark.parametrize(
    ("name", "size", "label"),
    [
        ("Chair_mirror.001", (0.5, 0.9, 0.5), "chair"),
        ("Cabinet.mirror", (0.8, 0.9, 0.4), "cabinet"),
        ("Cabinet_mirror", (0.8, 0.9, 0.4), "cabinet"),
        ("Cabinet_mirror", (0.8, 0.9, 0.03), "mirror"),
        ("Table_mirror.002", (1.6, 0.75, 0.9), "table"),
        ("Flowerbed", (3.0, 0.4, 1.0), "otherprop"),
        ("Bed", (12.0, 0.3, 30.0), "otherprop"),
        ("Box001", (4.0, 2.5, 0.1), "otherprop"),
    ],
)
def test_suffixes_of_programs_and_sizes_decide_between_classes(
    name: str, size: tuple[float, float, float], label: str
) -> None:
    s = two_rooms()
    s.node(name, mesh=s.box([1, 0, 1], [1 + size[0], size[1], 1 + size[2]]))
    assert NYU40_NAMES[item(read(s), name).nyu40] == label
