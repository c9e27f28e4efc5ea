"""Captions against hand-made answers: counts, relations of boxes, a real view."""

import json

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_views import export
from pbrs_farm.export.forms.captions import caption
from pbrs_farm.export.nouns import counted, plural
from pbrs_farm.formats.class_map import ClassMap, ClassRule
from pbrs_farm.formats.output_folder import OutputHouse, RoomOutline
from tests.inputs.made_views import made_view
from tests.scene.homes import small_home

# Camera axes are x right, y down, z forward; the world is y up: turn about x.
WORLD_FROM_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])


def instance_row(number: int, noun: str, at=(0, 0, 3), size=(1, 1, 1), column=50, **fields) -> dict:
    """An instance whose box is at a place in camera axes."""
    world = np.array(at) * [1, -1, -1]
    return {
        "id": number, "name": noun, "class": noun, "kind": "object", "nyu40": 1, "pixels": 1000 - number,
        "fraction": 0.05, "visible_fraction": 1.0, "box2d": [column - 5, 0, column + 5, 10],
        "box3d": {
            "centre": world.tolist(), "half": (np.array(size) / 2).tolist(), "axes": np.eye(3).tolist(),
        },
    } | fields  # fmt: skip


def view_of(*rows: dict, room: str = "Bedroom", classes: ClassMap | None = None, **facts):
    table = {
        "width_px": 100, "height_px": 80, "K": [[50, 0, 50], [0, 50, 40], [0, 0, 1]],
        "world_from_camera_opencv": WORLD_FROM_CAMERA.tolist(), "instances": list(rows), **facts,
    }  # fmt: skip
    house = OutputHouse("h", "h", "", {"0_0": room})
    return made_view(table, choice=Choice(classes=classes), house=house, room_id="0_0")


def text(*rows: dict, **fields) -> str:
    return caption(view_of(*rows, **fields))["text"]


@pytest.mark.parametrize(
    ("noun", "many"),
    [
        ("chair", "chairs"), ("box", "boxes"), ("bookshelf", "bookshelves"), ("person", "people"),
        ("set of shelves", "sets of shelves"), ("dish", "dishes"), ("lady", "ladies"), ("tray", "trays"),
        ("wine glass", "wine glasses"), ("piece of furniture", "pieces of furniture"),
        ("glass", "glasses"),
    ],
)  # fmt: skip
def test_nouns_have_plurals_and_articles(noun, many):
    assert plural(noun) == many
    assert counted(3, noun) == f"three {many}"
    assert counted(13, noun) == f"13 {many}"
    assert counted(1, noun) == f"a {noun}"
    assert counted(1, "armchair") == "an armchair"


def test_a_plural_name_takes_some():
    table = instance_row(1, "table", (0, 0, 3), (1, 0.8, 1))
    plates = instance_row(2, "otherprop", (0, -0.45, 3), (0.2, 0.1, 0.2), name="Plates")
    assert text(table, plates).endswith(
        "a table and some plates. The plates are on top of the table."
    )
    assert (plural("plates"), counted(2, "plates")) == ("plates", "some plates")


def test_items_are_counted_and_named_by_class():
    rows = [
        instance_row(1, "bed"), instance_row(2, "chair"), instance_row(3, "chair"), instance_row(4, "otherprop", name="Vase 3"),
        instance_row(5, "otherprop", name="Обои"), instance_row(6, "otherprop", kind="plant"), instance_row(7, "none"),
        instance_row(8, "wall", kind="wall"), instance_row(9, "sofa", visible_fraction=0.29),
        instance_row(10, "sofa", fraction=0.0029), instance_row(11, "lamp", visible_fraction=None),
    ]  # fmt: skip
    counts = "a bed, two chairs, a vase, an object, a plant and a lamp."
    assert text(*rows) == f"The picture shows a bedroom with {counts}"


@pytest.mark.parametrize(
    ("room", "said"),
    [
        ("Wohnzimmer", "a living room"), ("Room 0_0", "a room"), ("0_0", "a room"),
        ("Zxqv", 'a room called "Zxqv"'), ("Studio", "a study"),
    ],
)  # fmt: skip
def test_the_name_of_a_room_gives_its_kind(room, said):
    assert text(room=room) == f"The picture shows {said}."


def square(x: float, z: float, floor_y: float = -1.0) -> RoomOutline:
    """A room of 4 x 4 m with this least corner."""
    return RoomOutline(np.array([[x, z], [x + 4, z], [x + 4, z + 4], [x, z + 4]]), floor_y)


@pytest.mark.parametrize(
    ("left_m", "right_m", "said"),
    [
        (3.0, 3.0, "a hall"),  # the walls of the eye's room
        (6.5, 3.0, "a kitchen"),  # 60 of 100 columns show the next room through a doorway
        (0.0, 3.0, "a hall"),  # pixels without a surface do not count
        (60.0, 60.0, "a hall"),  # all of it is outdoors
    ],
)
def test_the_caption_names_the_visible_room(left_m, right_m, said):
    # The eye looks along -z from the origin; the kitchen is the next room there.
    rooms = {"0_0": "Hall", "0_1": "Kitchen", "1_0": "Attic"}
    places = {"0_0": square(-2, -3), "0_1": square(-4, -7.1), "1_0": square(-4, -7.1, 2)}
    depth = np.full((80, 100), right_m * 1000, np.uint16)
    depth[:, :60] = left_m * 1000
    view = view_of(K=[[250, 0, 50], [0, 250, 40], [0, 0, 1]])
    vars(view.entry)["house"] = OutputHouse("h", "h", "", rooms, places)
    vars(view)["array"] = {"depth": depth}.get
    assert caption(view)["text"] == f"The picture shows {said}."


def test_a_study_with_a_bed_is_a_studio():
    assert text(instance_row(1, "bed"), room="Studio") == "The picture shows a studio with a bed."


@pytest.mark.parametrize(
    ("at", "size", "column", "relation"),
    [
        ((2, 0, 3), (1, 1, 1), 90, "to the right of"),
        ((-2, 0, 3), (1, 1, 1), 10, "to the left of"),
        ((-2, 0, 30), (1, 1, 1), 60, ""),  # left in the room, right in the picture
        ((0.2, 0, 5), (1, 1, 1), 50, "behind"),
        ((0.2, 0, 1.5), (1, 1, 1), 50, "in front of"),
        ((0.2, -0.6, 3), (0.2, 0.2, 0.2), 50, "on top of"),  # y is down
        ((0.2, -0.8, 3), (0.2, 0.2, 0.2), 50, ""),  # a gap of 20 cm
        ((0.2, 0.2, 3.2), (1, 1, 1), 50, ""),  # one inside the other
    ],
)
def test_relations_are_those_of_the_boxes(at, size, column, relation):
    relations = caption(
        view_of(instance_row(1, "table"), instance_row(2, "bowl", at, size, column))
    )["relations"]
    assert relations == ([{"subject": 2, "relation": relation, "object": 1}] if relation else [])


def test_the_larger_item_may_be_on_the_smaller():
    rows = instance_row(1, "lamp", (0, -1, 3)), instance_row(2, "table")
    assert text(*rows).endswith("a lamp and a table. The lamp is on top of the table.")


def test_items_of_one_noun_are_distinguished_from_left_to_right():
    pair = [instance_row(1, "table"), instance_row(2, "chair", (2, 0, 3), column=90)]
    pair.append(instance_row(3, "chair", (-2, 0, 3), column=10))
    expected = (
        "The right chair is to the right of the table. The left chair is to the left of the table."
    )
    assert text(*pair).endswith(expected)
    pair.append(instance_row(4, "chair", (0, 0, 9), column=50))
    assert "The second chair from the left is behind the table." in text(*pair)


def test_a_panorama_lists_only_supports():
    rows = (
        instance_row(1, "table"),
        instance_row(2, "bowl", (2, 0, 3), column=90),
        instance_row(3, "vase", (0, -1, 3)),
    )
    facts = {"lens": {"model": "equirect"}, "depth": "distance"}
    relations = caption(view_of(*rows, **facts))["relations"]
    assert [row["relation"] for row in relations] == ["on top of"]


def test_the_users_classes_are_the_nouns():
    classes = ClassMap((ClassRule("chair", 1, "seat"), ClassRule("bed", 0, "")))
    rows = (
        instance_row(1, "chair", own_class_name="seat"),
        instance_row(2, "bed", own_class_name=""),
    )
    assert text(*rows, classes=classes) == "The picture shows a bedroom with a seat."


def test_an_export_has_a_line_a_view_and_its_picture(tmp_path):
    home = small_home()
    cameras = home.cameras(n=2)
    pf.render(home, cameras, modes=["opengl_dl"]).save(tmp_path / "root")
    assert export(tmp_path / "root", tmp_path / "out", "captions") == (2, 4)
    lines = (tmp_path / "out/captions.jsonl").read_text("utf-8").splitlines()
    for line in map(json.loads, lines):
        assert list(line) == ["file_name", "text", "objects", "relations"]
        assert (tmp_path / "out" / line["file_name"]).is_file()
        assert line["text"].startswith(
            ("The picture shows a living room", "The picture shows a bed")
        )
        ids = {row["id"] for row in line["objects"]}
        assert all({row["subject"], row["object"]} <= ids for row in line["relations"])
    export(tmp_path / "root", tmp_path / "again", "captions")
    assert (tmp_path / "again/captions.jsonl").read_text("utf-8").splitlines() == lines
