"""Single models: listed from folders and libraries, picked at random, read as a House of one item."""

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.objects.model_folders import find_models, pick_models
from pbrs_farm.read.objects.single_object import read_object

OBJ = """mtllib box.mtl
v 10 0 0
v 12 0 0
v 12 1 0
v 10 1 4
usemtl red
f 1 2 3
f 1 3 4
"""
MTL = "newmtl red\nKd 1 0 0\n"
CATALOGUE = """id=Test#lib
id#1=Test#armchair
name#1=Fauteuil \\u00e9l\\u00e9gant armchair
category#1=Living room
creator#1=A. Uthor
model#1=/a/chair.obj
width#1=80
depth#1=90
height#1=100.5
id#2=Test#nothing
name#2=Nothing
model#2=/a/missing.obj
width#2=1
depth#2=1
height#2=1
"""


def shapenet(root: Path) -> Path:
    """Two chairs and a table in ShapeNet's layouts, and a toaster in a separate folder."""
    for place in (
        "03001627/abc/models/model_normalized",
        "03001627/abd/model",
        "04379243/abe/models/model_normalized",
        "toaster/shiny",
    ):
        path = root / f"{place}.obj"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(OBJ)
        (path.parent / "box.mtl").write_text(MTL)
    return root


def test_shapenet_folders_give_their_class_and_model_id(tmp_path: Path) -> None:
    models = find_models([shapenet(tmp_path)])
    chosen = {(m.category, m.name, NYU40_NAMES[m.nyu40]) for m in models}
    assert chosen == {
        ("chair", "abc", "chair"),
        ("chair", "abd", "chair"),
        ("table", "abe", "table"),
        ("toaster", "shiny", "otherprop"),
    }
    assert len({m.id for m in models}) == 4


@pytest.mark.parametrize("category", ["chair", "03001627", "CHAIR"])
def test_a_category_is_a_class_or_a_synset(category: str, tmp_path: Path) -> None:
    models = find_models([shapenet(tmp_path)])
    assert {m.name for m in pick_models(models, [category], 9, 0)} == {"abc", "abd"}


def test_a_choice_does_not_depend_on_the_other_models(tmp_path: Path) -> None:
    (template,) = pick_models(find_models([shapenet(tmp_path)]), ["table"], 1, 0)
    models = [replace(template, id=f"m{k}") for k in range(50)]
    ten = [m.id for m in pick_models(models, [], 10, 7)]
    assert [m.id for m in pick_models(models[::-1], [], 10, 7)] == ten
    fewer = [m for m in models if m.id != "m49" or m.id in ten]
    assert [m.id for m in pick_models(fewer, [], 10, 7)] == ten
    assert [m.id for m in pick_models(models, [], 10, 8)] != ten
    assert len(pick_models(models, [], 99, 7)) == 50


def test_a_category_that_no_model_has_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="piano"):
        pick_models(find_models([shapenet(tmp_path)]), ["piano"], 3, 0)


def test_an_object_is_one_item_centred_on_the_origin_with_its_material(tmp_path: Path) -> None:
    (model,) = pick_models(find_models([shapenet(tmp_path)]), ["table"], 1, 0)
    house = read_object(model, ReadFields())
    (item,) = house.items
    np.testing.assert_allclose(item.bounds, [[-1, -0.5, -2], [1, 0.5, 2]])
    assert NYU40_NAMES[item.nyu40] == "table"
    assert item.n_faces == 2
    assert house.rooms == ()
    assert house.materials[item.surfaces[0].material].diffuse == (1.0, 0.0, 0.0)


def library(path: Path) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("PluginFurnitureCatalog.properties", CATALOGUE.encode("latin-1"))
        archive.writestr("a/chair.obj", OBJ)
        archive.writestr("a/box.mtl", MTL)
    return path


def test_a_librarys_piece_has_its_catalogues_size_class_and_author(tmp_path: Path) -> None:
    (model,) = find_models([library(tmp_path / "lib.sh3f")])
    assert model.name == "Fauteuil élégant armchair"
    assert NYU40_NAMES[model.nyu40] == "chair"
    house = read_object(model, ReadFields())
    np.testing.assert_allclose(np.ptp(house.items[0].bounds, axis=0), [0.8, 1.005, 0.9], rtol=1e-6)
    normals = house.items[0].surfaces[0].normals
    assert normals is not None
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    assert house.source.attribution == "A. Uthor"
    assert not house.notes


def test_glb_models_are_read_too(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    folder = tmp_path / "chair"
    folder.mkdir()
    box = trimesh.creation.box(bounds=[[1, 1, 1], [2, 3, 4]])
    (folder / "one.glb").write_bytes(box.export(file_type="glb"))
    (model,) = find_models([tmp_path])
    assert NYU40_NAMES[model.nyu40] == "chair"
    house = read_object(model, ReadFields())
    np.testing.assert_allclose(house.items[0].bounds, [[-0.5, -1, -1.5], [0.5, 1, 1.5]])


def test_bad_input_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no such"):
        find_models([tmp_path / "none"])
    with pytest.raises(BadInput, match="no model"):
        find_models([tmp_path])
    damaged = tmp_path / "lib.sh3f"
    damaged.write_bytes(b"PK nothing")
    with pytest.raises(BadInput, match=r"lib\.sh3f"):
        find_models([damaged])
    empty = tmp_path / "empty.obj"
    empty.write_text("v 0 0 0\n")
    (model,) = find_models([empty])
    with pytest.raises(BadHouse, match=r"empty\.obj"):
        read_object(model, ReadFields())


def test_a_texture_outside_the_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "chair"
    folder.mkdir(parents=True)
    (folder / "a.obj").write_text("mtllib ../../secret.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (model,) = find_models([tmp_path / "models"])
    with pytest.raises(BadHouse, match="leads out"):
        read_object(model, ReadFields())
