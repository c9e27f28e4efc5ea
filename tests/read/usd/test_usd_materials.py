"""Surface shaders of USD other than UsdPreviewSurface, bindings by purpose, and inputs of texture nodes."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pxr import Gf, Sdf, UsdGeom, UsdShade

from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import House, Material
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs.usd_files import UsdHome, walls_of
from tests.read.small_houses import png

RED = (0.7, 0.05, 0.05)
Types = Sdf.ValueTypeNames


def home_with(path: Path) -> UsdHome:
    home = UsdHome(path)
    walls_of(home, "/World", 0, 4, 0, 3)
    return home


def read(home: UsdHome) -> House:
    return read_house(resolve(str(home.save())), ReadFields())


def look(house: House, name: str) -> Material:
    return next(m for m in house.materials if m.name == name)


def material(
    home: UsdHome, name: str, kind: str, context: str = "", **inputs: Any
) -> tuple[Any, Any]:
    """A material with one shader of that id, and the shader."""
    material_prim = UsdShade.Material.Define(home.stage, f"/World/Looks/{name}")
    shader = UsdShade.Shader.Define(home.stage, f"/World/Looks/{name}/Shader")
    shader.CreateIdAttr(kind)
    for key, value in inputs.items():
        is_colour = isinstance(value, tuple)
        usd_value = Gf.Vec3f(*value) if is_colour else value
        shader.CreateInput(key, Types.Color3f if is_colour else Types.Float).Set(usd_value)
    out = (
        material_prim.CreateSurfaceOutput(context)
        if context
        else material_prim.CreateSurfaceOutput()
    )
    out.ConnectToSource(shader.CreateOutput("out", Types.Token))
    return material_prim, shader


def picture_node(home: UsdHome, name: str, file: str, kind: str = "UsdUVTexture") -> Any:
    node = UsdShade.Shader.Define(home.stage, f"/World/Looks/{name}/Picture")
    node.CreateIdAttr(kind)
    node.CreateInput("file", Types.Asset).Set(Sdf.AssetPath(file))
    return node


@pytest.mark.parametrize(
    ("kind", "inputs"),
    [
        ("ND_standard_surface_surfaceshader", {"base": 1.0, "base_color": RED}),
        ("ND_gltf_pbr_surfaceshader", {"base_color": RED, "metallic": 0.0}),
        ("ND_open_pbr_surface_surfaceshader", {"base_color": RED}),
        ("ND_UsdPreviewSurface_surfaceshader", {"diffuseColor": RED}),
    ],
)
def test_surfaces_of_materialx_have_their_colour(
    tmp_path: Path, kind: str, inputs: dict[str, Any]
) -> None:
    home = home_with(tmp_path / "a.usda")
    red, _ = material(home, "Red", kind, "mtlx", **inputs)
    home.box("/World/Table", [1, 0, 1], [2, 1, 2], material=red)
    house = read(home)
    red_material = look(house, "Red")
    assert linear_from_srgb(np.array(red_material.diffuse)) == pytest.approx(RED, abs=1e-6)
    assert not red_material.is_metal
    assert not house.notes


def test_metal_and_pictures_of_materialx_are_read_through_the_nodes_between(tmp_path: Path) -> None:
    (tmp_path / "p.png").write_bytes(png(rgb=(200, 10, 10)))
    home = home_with(tmp_path / "a.usda")
    gold, _ = material(
        home, "Gold", "ND_standard_surface_surfaceshader", "mtlx", base_color=(1.0, 0.7, 0.3), metalness=1.0
    )  # fmt: skip
    home.box("/World/Table", [1, 0, 1], [2, 1, 2], material=gold)
    brick, shader = material(home, "Brick", "ND_standard_surface_surfaceshader", "mtlx")
    node = picture_node(home, "Brick", "./p.png", "ND_image_color3")
    between = UsdShade.Shader.Define(home.stage, "/World/Looks/Brick/Gain")
    between.CreateIdAttr("ND_multiply_color3FA")
    between.CreateInput("in1", Types.Color3f).ConnectToSource(
        node.CreateOutput("out", Types.Color3f)
    )
    gain = between.CreateOutput("out", Types.Color3f)
    shader.CreateInput("base_color", Types.Color3f).ConnectToSource(gain)
    home.box("/World/Chair", [2, 0, 1], [2.5, 1, 2], material=brick)
    house = read(home)
    assert look(house, "Gold").is_metal
    assert house.textures[look(house, "Brick").texture_id or ""].data == png(rgb=(200, 10, 10))
    assert [n.text for n in house.notes] == [
        "ND_multiply_color3FA is not read: its picture is taken"
    ]


def test_a_shader_that_is_not_understood_is_a_matte_grey_with_a_note(tmp_path: Path) -> None:
    home = home_with(tmp_path / "a.usda")
    odd, _ = material(home, "Odd", "PxrSurface", "ri", diffuseColor=RED)
    home.box("/World/Table", [1, 0, 1], [2, 1, 2], material=odd)
    house = read(home)
    grey_material = look(house, "Odd")
    assert grey_material.diffuse == pytest.approx((0.8,) * 3)
    assert (grey_material.roughness, grey_material.is_metal) == (None, False)
    (note,) = house.notes
    assert (note.kind, "PxrSurface" in note.text) == ("unread-part", True)


@pytest.mark.parametrize("purpose", ["full", "preview"])
def test_a_material_bound_for_one_purpose_is_used(tmp_path: Path, purpose: str) -> None:
    home = home_with(tmp_path / "a.usda")
    table = home.box("/World/Table", [1, 0, 1], [2, 1, 2])
    binding = UsdShade.MaterialBindingAPI.Apply(table.GetPrim())
    binding.Bind(home.material("red", RED), materialPurpose=purpose)
    assert look(read(home), "red").diffuse == pytest.approx((0.854, 0.248, 0.248), abs=1e-3)


def test_a_full_material_that_is_not_understood_gives_way_to_that_of_previews(
    tmp_path: Path,
) -> None:
    home = home_with(tmp_path / "a.usda")
    table = home.box("/World/Table", [1, 0, 1], [2, 1, 2])
    binding = UsdShade.MaterialBindingAPI.Apply(table.GetPrim())
    binding.Bind(material(home, "Odd", "PxrSurface", "ri")[0], materialPurpose="full")
    binding.Bind(home.material("red", RED), materialPurpose="preview")
    assert {m.name for m in read(home).materials} >= {"red"}


def test_a_picture_in_tiles_is_read_by_its_first_tile(tmp_path: Path) -> None:
    home = home_with(tmp_path / "a.usda")
    paint = home.material("paint", picture="./tile.<UDIM>.png")
    home.box("/World/Table", [1, 0, 1], [2, 1, 2], material=paint)
    house = read(home)
    (note,) = house.notes
    assert "tile.<UDIM>.png" in note.text
    assert look(house, "paint").diffuse == pytest.approx((0.8,) * 3)
    source = resolve(str(home.path))
    (tmp_path / "tile.1001.png").write_bytes(png())
    assert resolve(str(home.path)).companions != source.companions
    house = read(home)
    assert not house.notes
    assert house.textures[look(house, "paint").texture_id or ""].data == png()
    (tmp_path / "tile.1002.png").write_bytes(png())
    assert [n.kind for n in read(home).notes] == ["texture-layout"]


def values_of(house: House, texture: str | None) -> list[int]:
    picture = Image.open(io.BytesIO(house.textures[texture or ""].data)).convert("RGB")
    pixel = picture.getpixel((0, 0))
    assert isinstance(pixel, tuple)
    return [int(v) for v in pixel]


def test_channel_scale_bias_space_and_fallback_of_a_picture_are_read(tmp_path: Path) -> None:
    (tmp_path / "p.png").write_bytes(png(rgb=(51, 102, 204)))
    home = home_with(tmp_path / "a.usda")
    # Roughness is the blue channel, halved, plus a quarter; one colour is linear; one file is
    # missing.
    rough, shader = material(home, "rough", "UsdPreviewSurface")
    node = picture_node(home, "rough", "./p.png")
    node.CreateInput("scale", Types.Float4).Set(Gf.Vec4f(1, 1, 0.5, 1))
    node.CreateInput("bias", Types.Float4).Set(Gf.Vec4f(0, 0, 0.25, 0))
    blue = node.CreateOutput("b", Types.Float)
    shader.CreateInput("roughness", Types.Float).ConnectToSource(blue)
    raw, shader = material(home, "raw", "UsdPreviewSurface")
    node = picture_node(home, "raw", "./p.png")
    node.CreateInput("sourceColorSpace", Types.Token).Set("raw")
    rgb = node.CreateOutput("rgb", Types.Float3)
    shader.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(rgb)
    lost, shader = material(home, "lost", "UsdPreviewSurface")
    node = picture_node(home, "lost", "./none.png")
    node.CreateInput("fallback", Types.Float4).Set(Gf.Vec4f(*RED, 1))
    rgb = node.CreateOutput("rgb", Types.Float3)
    shader.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(rgb)
    for k, material_prim in enumerate((rough, raw, lost)):
        home.box(f"/World/Chair_{k}", [k, 0, 1], [k + 0.5, 1, 2], material=material_prim)
    house = read(home)
    assert values_of(house, look(house, "rough").roughness_texture_id) == [166] * 3  # .4 + .25
    expected = np.rint(255 * np.array([0.484, 0.665, 0.906]))
    assert values_of(house, look(house, "raw").texture_id) == pytest.approx(expected, abs=1)
    assert look(house, "lost").diffuse == pytest.approx((0.854, 0.248, 0.248), abs=1e-3)
    assert [n.text for n in house.notes] == ["./none.png does not exist: replaced by its fallback"]


def test_a_mesh_has_the_texture_coordinates_that_its_picture_names(tmp_path: Path) -> None:
    (tmp_path / "p.png").write_bytes(png())
    home = home_with(tmp_path / "a.usda")
    paint = home.material("paint", picture="./p.png")
    home.stage.GetPrimAtPath("/World/Looks/paint/St").GetAttribute("inputs:varname").Set("second")
    table = home.box("/World/Table", [1, 0, 1], [2, 1, 2], material=paint)
    primvars = UsdGeom.PrimvarsAPI(table)
    second_uvs = primvars.CreatePrimvar("second", Types.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    second_uvs.Set([Gf.Vec2f(3 * u, 3 * v) for u, v in primvars.GetPrimvar("st").Get()])
    (item,) = [i for i in read(home).items if i.name == "Table"]
    assert max(s.uvs.max() for s in item.surfaces if s.uvs is not None) == 3


def test_a_picture_that_is_connected_to_itself_is_no_picture(tmp_path: Path) -> None:
    home = home_with(tmp_path / "a.usda")
    loop, shader = material(home, "loop", "UsdPreviewSurface")
    node = picture_node(home, "loop", "./none.png")
    out = node.CreateOutput("rgb", Types.Float3)
    node.GetInput("file").ConnectToSource(out)
    node.CreateInput("fallback", Types.Float4).ConnectToSource(out)
    shader.CreateInput("diffuseColor", Types.Color3f).ConnectToSource(out)
    home.box("/World/Table", [1, 0, 1], [2, 1, 2], material=loop)
    assert look(read(home), "loop").texture_id is None
