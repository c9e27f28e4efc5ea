"""Every part that a reader leaves out is a note that names file and line."""

from __future__ import annotations

import json

import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.mesh.obj import parse_obj
from tests.read.suncg.suncg_root import HOUSE, house_json, object_node, placement, write_root


def _house(tmp_path, edit=lambda _plain: None, files=None):
    write_root(tmp_path)
    plain = house_json()
    edit(plain)
    folder = tmp_path / "house" / HOUSE
    (folder / "house.json").write_text(json.dumps(plain))
    for name, data in (files or {}).items():
        (tmp_path / name).write_bytes(data)
    return read_house(resolve(str(folder)), ReadFields())


def _kinds(house):
    return {note.kind for note in house.notes}


def test_a_node_of_an_unknown_type_is_a_note(tmp_path):
    house = _house(tmp_path, lambda p: p["levels"][0]["nodes"][2].update(type="Spaceship"))
    assert any("Spaceship" in n.text for n in house.notes if n.kind == "unknown-type")


def test_an_object_900_m_away_is_a_note(tmp_path):
    far = object_node("0_90", "chair", placement(900, 0.05, 1))
    house = _house(tmp_path, lambda p: p["levels"][0]["nodes"].append(far))
    assert "far-away" in _kinds(house)
    assert "far-away" not in _kinds(_house(tmp_path))


def test_an_empty_material_library_is_a_note(tmp_path):
    assert "missing-materials" in _kinds(_house(tmp_path, files={"object/chair/chair.mtl": b""}))


def test_one_damaged_model_of_a_library_is_left_out_with_its_line(tmp_path):
    data = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 99\n"
    house = _house(tmp_path, files={"object/chair/chair.obj": data})
    (note, *_) = [n for n in house.notes if n.kind == "unreadable-model"]
    assert "chair.obj" in note.text
    assert not any(item.source_class == "chair" for item in house.items)


def test_a_room_mesh_cut_short_is_a_note(tmp_path):
    write_root(tmp_path)
    name = f"room/{HOUSE}/fr_0rm_0w.obj"
    data = (tmp_path / name).read_bytes()
    assert "cut-short" not in _kinds(_house(tmp_path))
    assert "cut-short" in _kinds(_house(tmp_path, files={name: data[: len(data) - 5]}))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("v 0 0 0\nv 1 x7 0\nf 1 2 1\n", "`v` line 2: 'x7' is not a number"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 two 3\n", "`f` line 2: 'two' is not an index"),
    ],
)
def test_an_invalid_number_is_refused_without_library_words(text, says):
    with pytest.raises(BadHouse) as caught:
        parse_obj(text.encode(), "m.obj")
    assert says in str(caught.value)
    assert "literal" not in str(caught.value)


@pytest.mark.parametrize("name", ["library.sh3f"])
def test_a_single_model_names_the_verb_objects(name, tmp_path):
    (tmp_path / name).write_bytes(b"v 0 0 0\n")
    with pytest.raises(BadHouse, match="pbrs-farm objects"):
        read_house(resolve(str(tmp_path / name)), ReadFields())


def test_a_single_glb_without_a_floor_names_the_verb_objects(tmp_path):
    scene = {"asset": {"version": "2.0"}, "scene": 0, "nodes": [{"name": "chair"}]}
    scene["scenes"] = [{"nodes": [0]}]
    (tmp_path / "chair.gltf").write_text(json.dumps(scene))
    with pytest.raises(BadHouse, match="pbrs-farm objects"):
        read_house(resolve(str(tmp_path / "chair.gltf")), ReadFields())
