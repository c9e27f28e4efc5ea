"""Opacity of USD materials from a separate picture."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Gf, Sdf, UsdShade

from pbrs_farm.core.house import House, Material, MaterialKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from tests.inputs.usd_files import UsdHome, walls_of

RGB, MASK = (200, 40, 30), ((0, 255, 102, 255), (255, 255, 255, 255))  # a 4 x 2 picture


def leaf(tmp_path: Path, *, colour: str, mask: str, channel: str = "r", **inputs: float) -> House:
    """A room with a chair whose opacity is a channel of a picture."""
    home = UsdHome(tmp_path / "a.usda")
    walls_of(home, "/World", 0, 4, 0, 3)
    colour_input = {"picture": colour} if colour else {"rgb": (0.5, 0.5, 0.5)}
    scale, bias = inputs.pop("scale", None), inputs.pop("bias", None)
    material = home.material("Leaf", **colour_input, **inputs)
    stage, types = home.stage, Sdf.ValueTypeNames
    node = UsdShade.Shader.Define(stage, "/World/Looks/Leaf/Mask")
    node.CreateIdAttr("UsdUVTexture")
    node.CreateInput("file", types.Asset).Set(Sdf.AssetPath(mask))
    for name, value in (("scale", scale), ("bias", bias)):
        if value is not None:
            node.CreateInput(name, types.Float4).Set(Gf.Vec4f(value))
    shader = UsdShade.Shader.Get(stage, "/World/Looks/Leaf/Shader")
    opacity = shader.CreateInput("opacity", types.Float)
    opacity.ConnectToSource(node.CreateOutput(channel, types.Float))
    home.box("/World/Chair", [1, 0, 1], [1.5, 0.9, 1.5], material=material)
    return read_house(resolve(str(home.save())), ReadFields())


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    Image.new("RGB", (4, 2), RGB).save(tmp_path / "colour.png")
    grey = Image.fromarray(np.array(MASK, np.uint8))
    grey.save(tmp_path / "mask.png")
    rgba = Image.new("RGB", (4, 2), RGB)
    rgba.putalpha(grey)
    rgba.save(tmp_path / "both.png")
    return tmp_path


def chair(house: House) -> Material:
    (item,) = [i for i in house.items if i.name == "Chair"]
    return house.materials[item.surfaces[0].material]


def pixels(house: House) -> np.ndarray:  # type: ignore[type-arg]
    data = house.textures[chair(house).texture_id or ""].data
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))


@pytest.mark.parametrize("colour", ["colour.png", ""])
def test_a_picture_of_opacity_cuts_at_the_threshold(pictures: Path, colour: str) -> None:
    house = leaf(pictures, colour=colour, mask="mask.png", opacityThreshold=0.3)
    material = chair(house)
    assert (material.alpha_cutout, material.alpha_cutoff) == (True, pytest.approx(0.3))
    assert (material.kind, material.opacity) == (MaterialKind.OPAQUE, 1.0)
    rgba = pixels(house)
    assert np.array_equal(rgba[..., 3], MASK)
    assert (rgba[..., :3] == (RGB if colour else (255, 255, 255))).all()
    assert not [n for n in house.notes if n.kind.endswith(("texture", "layout"))]


def test_opacity_of_the_colours_own_picture_keeps_its_bytes(pictures: Path) -> None:
    house = leaf(pictures, colour="both.png", mask="both.png", channel="a", opacityThreshold=0.5)
    texture = house.textures[chair(house).texture_id or ""]
    assert texture.data == (pictures / "both.png").read_bytes()
    assert chair(house).alpha_cutout


def test_scale_and_bias_of_the_picture_of_opacity_count(pictures: Path) -> None:
    house = leaf(pictures, colour="colour.png", mask="mask.png", scale=-1.0, bias=1.0)
    assert np.array_equal(pixels(house)[..., 3], 255 - np.array(MASK))


def test_a_missing_picture_of_opacity_is_a_note(pictures: Path) -> None:
    house = leaf(pictures, colour="colour.png", mask="none.png", opacityThreshold=0.5)
    assert [n.kind for n in house.notes if n.kind.endswith("texture")] == ["missing-texture"]
    assert not chair(house).alpha_cutout
    assert (pixels(house) == (*RGB, 255)).all()
