from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.house import House, ItemKind, Material, MaterialKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE, item, material_of, outward_volume


def texture_name(house: House, material: Material) -> str:
    assert material.texture_id is not None
    return house.textures[material.texture_id].name


def test_labels_and_kinds_come_from_the_users_table(house: House) -> None:
    got = {i.id: (i.kind, i.nyu40, i.name) for i in house.items}
    assert got["0_2"] == (ItemKind.OBJECT, 5, "office chair")
    assert got["0_4"] == (ItemKind.LAMP, 35, "floor lamp")
    assert got["0_6"] == (ItemKind.WINDOW, 9, "window")
    assert got["0_7"] == (ItemKind.DOOR, 8, "door")
    assert got["0_9"][:2] == (ItemKind.PLANT, 40)
    assert got["1_0"][:2] == (ItemKind.PERSON, 31)
    assert got["0_0f"][:2] == (ItemKind.FLOOR, 2)
    assert got["0_0c"][:2] == (ItemKind.CEILING, 22)
    assert got["0_0w3"][:2] == (ItemKind.WALL, 1)
    assert got["0_12"][:2] == (ItemKind.GROUND, 0)
    assert got["0_11"][:2] == (ItemKind.OBJECT, 0)


def test_without_active_column_persons_and_plants_are_still_recognised(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    table = tmp_path / "metadata/ModelCategoryMappingNewActive.csv"
    lines = [line.rsplit(",", 1)[0] for line in table.read_text().splitlines()]
    (tmp_path / "metadata/ModelCategoryMapping.csv").write_text("\n".join(lines))
    table.unlink()
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert item(house, "0_9").kind is ItemKind.PLANT
    assert item(house, "1_0").kind is ItemKind.PERSON


def test_a_model_that_is_not_active_is_removed_as_a_plant(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    table = tmp_path / "metadata/ModelCategoryMappingNewActive.csv"
    table.write_text(table.read_text().replace("chair,2,chair,,,1", "chair,2,chair,,,0"))
    assert item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_2").kind is ItemKind.PLANT


def test_column_major_transforms_place_objects(house: House) -> None:
    assert np.allclose(item(house, "0_2").bounds, [[0.8, 0.05, 0.8], [1.2, 1.05, 1.2]])
    assert np.allclose(item(house, "0_15").bounds, [[2.7, 0.05, 1.7], [3.3, 1.55, 2.3]])
    # A quarter turn about +y takes the chair's back from -z to -x.
    back = next(s for s in item(house, "0_16").surfaces if s.name == "material_1")
    assert np.allclose([back.positions.min(0)[0], back.positions.max(0)[0]], [0.8, 0.85])
    assert np.allclose([back.positions.min(0)[2], back.positions.max(0)[2]], [1.8, 2.2])


def test_mirrored_nodes_keep_their_fronts_outside(house: House) -> None:
    plain, mirrored = item(house, "0_2"), item(house, "0_3")
    assert outward_volume(plain.surfaces) == pytest.approx(0.083, rel=1e-5)
    assert outward_volume(mirrored.surfaces) == pytest.approx(0.083, rel=1e-5)
    assert "mirrored" in mirrored.tags
    assert "mirrored" not in plain.tags
    for surface in mirrored.surfaces:
        assert surface.normals is not None
        p = surface.positions[surface.faces]
        face_normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        shading = surface.normals[surface.faces].mean(1)
        assert (np.einsum("ij,ij->i", face_normal, shading) > 0).all()


def test_normals_follow_the_inverse_transpose(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    slanted = suncg_root.house_json()
    m = np.eye(4)
    m[:3, :3] = suncg_slope() @ np.diag([2.0, 0.5, 1.0])
    slanted["levels"][0]["nodes"][2]["transform"] = m.T.reshape(-1).tolist()
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(slanted))
    for surface in item(read_suncg(tmp_path, HOUSE, ReadFields()), "0_2").surfaces:
        p = surface.positions[surface.faces].astype(np.float64)
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        assert surface.normals is not None
        assert np.allclose(surface.normals[surface.faces[:, 0]], n, atol=1e-5)


def suncg_slope() -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    c, s = np.cos(0.3), np.sin(0.3)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def test_a_wrong_isMirrored_is_noted_and_the_transform_believed(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"][2]["isMirrored"] = 1
    (tmp_path / f"house/{HOUSE}/house.json").write_text(json.dumps(plain))
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    assert "mirrored" not in item(house, "0_2").tags
    assert any(n.kind == "mirrored-differs" and "0_2" in n.place for n in house.notes)


def test_state_one_takes_the_variant_mesh(house: House) -> None:
    closed, opened = item(house, "0_7"), item(house, "0_8")
    assert np.ptp(closed.bounds, axis=0)[0] == pytest.approx(
        0.1, abs=1e-5
    )  # turned towards the wall
    assert np.ptp(opened.bounds, axis=0)[2] == pytest.approx(0.95, abs=1e-5)


def test_materials_are_overridden_by_position(house: House) -> None:
    stone, orange = (
        material_of(house, "0_15", "material_0"),
        material_of(house, "0_15", "material_1"),
    )
    assert texture_name(house, stone) == "stone.png"  # PNG is preferred to JPEG
    assert stone.diffuse == (1.0, 1.0, 1.0)
    assert orange.diffuse == (1.0, 128 / 255, 0.0)
    assert orange.texture_id is None
    overridden, same = (
        material_of(house, "0_16", "material_0"),
        material_of(house, "0_16", "material_1"),
    )
    assert (texture_name(house, overridden), overridden.diffuse) == ("leaves.png", (128 / 255,) * 3)
    assert same.diffuse == (0.1, 0.2, 0.9)
    model = material_of(house, "0_2", "material_0")
    assert (texture_name(house, model), model.diffuse) == ("wood.jpg", (0.64, 0.64, 0.64))
    assert (model.specular, model.shininess) == ((0.1, 0.1, 0.1), 30.0)


def test_textures_keep_their_bytes_and_alpha_is_a_hole(root: Path, house: House) -> None:
    by_name = {t.name: t for t in house.textures.values()}
    assert by_name["wood.jpg"].data == (root / "texture/wood.jpg").read_bytes()
    assert by_name["wood.jpg"].media_type == "image/jpeg"
    assert material_of(house, "0_16", "material_0").alpha_cutout
    assert not material_of(house, "0_15", "material_0").alpha_cutout
    assert "stone.jpg" not in by_name


def test_a_picture_of_opacity_is_the_alpha_of_the_colours(tmp_path: Path) -> None:
    suncg_root.write_root(tmp_path)
    Image.fromarray(np.array([[0, 255], [255, 255]], np.uint8)).save(tmp_path / "texture/mask.png")
    mtl = tmp_path / "object/chair/chair.mtl"
    before = read_suncg(tmp_path, HOUSE, ReadFields())
    names = [line.split()[1] for line in mtl.read_text().splitlines() if "map_Kd" in line]
    picture_name = names[0].replace(Path(names[0]).name, "mask.png")
    mtl.write_text(mtl.read_text().replace("map_Kd", f"map_d {picture_name}\nmap_Kd", 1))
    holed = material_of(house := read_suncg(tmp_path, HOUSE, ReadFields()), "0_2", "material_0")
    assert holed.alpha_cutout
    assert not material_of(before, "0_2", "material_0").alpha_cutout
    alpha = Image.open(io.BytesIO(house.textures[holed.texture_id or ""].data)).getchannel("A")
    assert alpha.getextrema() == (0, 255)
    assert alpha.getpixel((0, 0)) == 0
    # The colour remains if the picture is missing.
    (tmp_path / "texture/mask.png").unlink()
    house = read_suncg(tmp_path, HOUSE, ReadFields())
    plain = material_of(house, "0_2", "material_0")
    assert (plain.texture_id, plain.alpha_cutout) == (
        material_of(before, "0_2", "material_0").texture_id, False,
    )  # fmt: skip
    assert "missing-texture" in [n.kind for n in house.notes]


def test_glass_of_windows_is_a_pane_and_other_glass_is_glass(house: House, tmp_path: Path) -> None:
    assert material_of(house, "0_6", "material_1").kind is MaterialKind.PANE
    assert material_of(house, "0_6", "material_1").opacity == 0.5
    assert material_of(house, "0_6", "material_0").kind is MaterialKind.OPAQUE
    suncg_root.write_root(tmp_path)
    mtl = tmp_path / "object/chair/chair.mtl"
    mtl.write_text(mtl.read_text().replace("Ns 0\nd 1", "Ns 0\nd 0.5"))
    material = read_suncg(tmp_path, HOUSE, ReadFields())
    assert material_of(material, "0_2", "material_1").kind is MaterialKind.GLASS
