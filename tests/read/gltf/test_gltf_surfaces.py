"""Material extensions and samplers of glTF: colour of the surface, and its picture."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import House, Material, Surface
from tests.read.gltf.gltf_scenes import Scene, item, read, two_rooms
from tests.read.small_houses import png

PBR = "pbrMetallicRoughness"
GLOSS = "KHR_materials_pbrSpecularGlossiness"


def scene_with(material: dict[str, Any], *pictures: bytes) -> Scene:
    """Two rooms and a board named Chair with that material, uv 0..1."""
    s = two_rooms()
    views = [s.writer.add_bytes(data) for data in pictures]
    s.more = {
        "images": [{"bufferView": v, "mimeType": "image/png", "name": f"p{v}"} for v in views],
        "textures": [{"source": k} for k in range(len(views))],
    }
    s.materials.append(material)
    s.node("Chair", mesh=s.mesh([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], 0))
    return s


def board(house: House) -> tuple[Surface, Material]:
    (surface,) = item(house, "Chair").surfaces
    return surface, house.materials[surface.material]


def picture(house: House, texture: str | None) -> Any:
    data = house.textures[texture or ""].data
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), np.float64) / 255


def test_specular_glossiness_gives_colour_gloss_and_its_picture() -> None:
    glossy = {
        "diffuseFactor": [0.7, 0.05, 0.05, 1],
        "specularFactor": [0.05] * 3,
        "glossinessFactor": 0.6,
    }
    _, look = board(read(scene_with({"extensions": {GLOSS: glossy}})))
    assert linear_from_srgb(np.array(look.diffuse)) == pytest.approx([0.7, 0.05, 0.05], abs=1e-6)
    assert (look.roughness, look.is_metal, look.is_default) == (0.4, False, False)
    glossy = {"diffuseTexture": {"index": 0}, "specularFactor": [0.04] * 3}
    house = read(scene_with({"extensions": {GLOSS: glossy}}, png()))
    assert house.textures[board(house)[1].texture_id or ""].data == png()
    assert not house.notes


def test_a_metal_of_specular_glossiness_has_its_specular_colour_and_its_gloss_as_roughness() -> (
    None
):
    textures = {"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}}
    buffer = io.BytesIO()
    Image.new("RGBA", (2, 2), (255, 200, 80, 204)).save(buffer, "PNG")
    house = read(
        scene_with({"extensions": {GLOSS: textures}}, png(rgb=(0, 0, 0)), buffer.getvalue())
    )
    look = board(house)[1]
    gold = np.array([255, 200, 80]) / 255
    assert picture(house, look.texture_id)[0, 0] == pytest.approx(gold, abs=0.03)
    assert picture(house, look.roughness_texture_id)[0, 0, 1] == pytest.approx(0.2, abs=0.01)
    assert look.roughness == 1  # multiplied by the picture


def test_a_surface_without_metallic_factors_is_no_metal() -> None:
    for material in ({"name": "paint"}, {PBR: {}}, {"extensions": {"KHR_materials_unlit": {}}}):
        look = board(read(scene_with(material)))[1]
        assert look.diffuse == pytest.approx((1.0,) * 3)
        assert (look.is_metal, look.roughness) == (False, None)


def test_a_picture_that_cannot_be_had_is_a_matte_grey_with_its_name_in_a_note() -> None:
    s = scene_with({PBR: {"baseColorTexture": {"index": 0}}})
    s.more |= {"images": [{"uri": "wood.png"}], "textures": [{"source": 0}]}
    house = read(s)
    look = board(house)[1]
    assert look.diffuse == pytest.approx((0.8,) * 3)
    assert not look.is_metal
    assert any("wood.png" in n.text for n in house.notes if n.kind == "missing-texture")


def test_ior_and_specular_give_a_dielectrics_reflectance() -> None:
    extensions = {
        "KHR_materials_ior": {"ior": 2.0},
        "KHR_materials_specular": {"specularFactor": 0.5},
    }
    paint = {PBR: {"metallicFactor": 0, "roughnessFactor": 0.5}, "extensions": extensions}
    specular = linear_from_srgb(np.array(board(read(scene_with(paint)))[1].specular))
    assert specular == pytest.approx([0.5 / 9] * 3, abs=1e-6)


def test_metal_without_a_colour_picture_takes_the_mean_of_its_metal_picture() -> None:
    metal = {PBR: {"baseColorFactor": [0.9, 0.6, 0.2, 1], "metallicRoughnessTexture": {"index": 0}}}
    assert board(read(scene_with(metal, png(rgb=(0, 128, 255)))))[1].is_metal
    assert not board(read(scene_with(metal, png(rgb=(0, 128, 0)))))[1].is_metal


def test_a_surface_shines_by_the_mean_of_its_emissive_picture() -> None:
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 1000}}
    screen = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}, "extensions": strength}
    buffer = io.BytesIO()
    half = Image.new("RGB", (2, 2))
    half.paste((255, 255, 255), (0, 0, 2, 1))
    half.save(buffer, "PNG")
    (light,) = item(read(scene_with(screen, buffer.getvalue())), "Chair").lights
    assert light.power == pytest.approx(2 * np.pi * 1000 * 0.5)
    assert not item(read(scene_with(screen, png(rgb=(0, 0, 0)))), "Chair").lights


def test_a_transform_may_name_other_texture_coordinates() -> None:
    transform = {"KHR_texture_transform": {"texCoord": 1}}
    s = scene_with({PBR: {"baseColorTexture": {"index": 0, "extensions": transform}}}, png())
    attributes = s.meshes[-1]["primitives"][0]["attributes"]
    uvs = np.array([[0, 3], [3, 3], [3, 0], [0, 0]], np.float32)
    attributes["TEXCOORD_1"] = s.writer.add_vertices(uvs)
    surface, _ = board(read(s))
    assert surface.uvs is not None
    assert np.ptp(surface.uvs, axis=0).tolist() == [3, 3]


def quarters() -> bytes:
    """4 x 4 texels: red and green above, blue and white below."""
    rgb = np.zeros((4, 4, 3), np.uint8)
    rgb[:2, :2], rgb[:2, 2:], rgb[2:, :2], rgb[2:, 2:] = (255, 0, 0), (0, 255, 0), (0, 0, 255), 255
    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "PNG")
    return buffer.getvalue()


def colour_at(surface: Surface, x: float, y: float) -> tuple[int, int, int]:
    """Colour of the board at a point: its nearest texel, with the picture repeated."""
    assert surface.uvs is not None
    p = surface.positions[:, :2].astype(np.float64)
    for a, b, c in surface.faces:
        m = np.column_stack([p[b] - p[a], p[c] - p[a]])
        s, t = np.linalg.solve(m, np.array([x, y]) - p[a])
        if s >= 0 and t >= 0 and s + t <= 1:
            u, v = (1 - s - t) * surface.uvs[a] + s * surface.uvs[b] + t * surface.uvs[c]
            texels = np.asarray(Image.open(io.BytesIO(quarters())))
            r, g, b = texels[int((1 - v) % 1 * 4) % 4, int(u % 1 * 4) % 4]
            return int(r), int(g), int(b)
    raise AssertionError("no face there")


@pytest.mark.parametrize(
    ("mode", "number"), [("repeat", 10497), ("clamp", 33071), ("mirror", 33648)]
)
def test_a_picture_wraps_as_its_sampler_specifies(mode: str, number: int) -> None:
    s = scene_with({PBR: {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}, quarters())
    s.more["samplers"] = [{"wrapS": number, "wrapT": number}]
    s.more["textures"] = [{"source": 0, "sampler": 0}]
    attributes = s.meshes[-1]["primitives"][0]["attributes"]
    low, high = -1.3, 2.6
    uvs = np.array([[low, high], [high, high], [high, low], [low, low]], np.float32)
    attributes["TEXCOORD_0"] = s.writer.add_vertices(uvs)
    house = read(s)
    surface, _ = board(house)
    texels = np.asarray(Image.open(io.BytesIO(quarters())))
    for x, y in np.random.default_rng(1).uniform(0.02, 0.98, (60, 2)):
        u, down = low + (high - low) * x, low + (high - low) * (1 - y)
        ways = {
            "repeat": lambda t: t % 1, "clamp": lambda t: min(max(t, 0), 0.999),
            "mirror": lambda t: min(1 - abs(1 - t % 2), 0.999),
        }  # fmt: skip
        row, column = (int(ways[mode](t) * 4) for t in (down, u))
        assert colour_at(surface, x, y) == tuple(texels[row, column]), (x, y)
    area = np.cross(
        *(
            surface.positions[surface.faces[:, k]] - surface.positions[surface.faces[:, 0]]
            for k in (1, 2)
        )
    )
    assert np.linalg.norm(area, axis=1).sum() / 2 == pytest.approx(1, abs=1e-6)
    assert not house.notes


def test_a_mirrored_picture_with_a_hundred_repeats_is_repeated_plainly_with_a_note() -> None:
    s = scene_with({PBR: {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}, quarters())
    s.more |= {"samplers": [{"wrapS": 33648}], "textures": [{"source": 0, "sampler": 0}]}
    uvs = np.array([[0, 1], [100, 1], [100, 0], [0, 0]], np.float32)
    s.meshes[-1]["primitives"][0]["attributes"]["TEXCOORD_0"] = s.writer.add_vertices(uvs)
    house = read(s)
    assert len(board(house)[0].faces) == 2
    assert [n.kind for n in house.notes] == ["texture-layout"]


def test_a_clamped_picture_that_is_not_left_keeps_its_mesh() -> None:
    s = scene_with({PBR: {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}, quarters())
    s.more |= {"samplers": [{"wrapS": 33071}], "textures": [{"source": 0, "sampler": 0}]}
    assert len(board(read(s))[0].faces) == 2
