from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.frames import LM_PER_W, srgb_from_linear
from pbrs_farm.core.house import House, ItemKind, MaterialKind, geometry_from_house
from pbrs_farm.core.lighting import LightForm, flux_lm
from pbrs_farm.core.recipe import ReadFields, RepairFields, recipe_from_name
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.read.gltf.scene import read_gltf
from pbrs_farm.repair import repair
from pbrs_farm.transport.scene_tables.area_emitters import area_emitters_of_house, lamp_rgb
from tests.read.gltf.gltf_scenes import item, read, two_rooms
from tests.read.small_houses import png


def test_texture_coordinates_turn_v_up_and_follow_the_texture_transform() -> None:
    s = two_rooms()
    view = s.writer.add_bytes(png())
    s.more = {
        "images": [{"bufferView": view, "mimeType": "image/png", "name": "red"}],
        "textures": [{"source": 0}],
    }
    info: dict[str, Any] = {"index": 0}
    s.materials.append({"pbrMetallicRoughness": {"baseColorTexture": info}})
    s.node("Chair", mesh=s.mesh([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], 0))
    house = read(s)
    (surface,) = item(house, "Chair").surfaces
    assert surface.uvs is not None
    assert np.allclose(surface.uvs, [[0, 0], [1, 0], [1, 1], [0, 1]])  # bottom left first
    texture = house.textures[house.materials[surface.material].texture_id or ""]
    assert (texture.name, texture.data) == ("red", png())
    info["extensions"] = {"KHR_texture_transform": {"scale": [2, 3], "offset": [0.25, 0.5]}}
    (surface,) = item(read(s), "Chair").surfaces
    assert surface.uvs is not None
    assert np.allclose(surface.uvs[2], [2.25, 1 - 0.5])  # uv (1, 0) v down -> (2.25, 0.5)
    assert np.allclose(surface.uvs[0], [0.25, 1 - 3.5])


def test_materials_keep_colour_gloss_glass_and_mirror() -> None:
    s = two_rooms()
    pbr = "pbrMetallicRoughness"
    s.materials += [
        {"name": "paint", pbr: {"baseColorFactor": [0.214, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1}},
        {"name": "glass", "alphaMode": "BLEND", pbr: {"baseColorFactor": [1, 1, 1, 0.2], "metallicFactor": 0}},
        {"name": "silver", pbr: {"metallicFactor": 1, "roughnessFactor": 0.02}},
        {"name": "clear", pbr: {"metallicFactor": 0}, "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}},
    ]  # fmt: skip
    for k, name in enumerate(("Table", "Window", "Mirror", "Chair")):
        s.node(name, mesh=s.box([0, 0, 0], [1, 1, 0.05], k))
    house = read(s)
    look = {m.name: m for m in house.materials}
    assert look["paint"].diffuse == pytest.approx((0.5, 0, 0), abs=1e-3)
    assert (look["paint"].shininess, look["paint"].specular) == (0.0, (0.0, 0.0, 0.0))
    assert (look["glass"].kind, look["glass"].opacity) == (MaterialKind.PANE, 0.2)
    assert look["silver"].kind is MaterialKind.MIRROR
    assert (look["clear"].kind, look["clear"].opacity) == (MaterialKind.GLASS, 0.0)


def test_gloss_survives_a_round_trip_through_our_glb() -> None:
    home = builtin_home()
    shiny = replace(home.materials[0], shininess=40.0)
    home = replace(home, materials=(shiny, *home.materials[1:]))
    house = read_gltf(bundle_from_house(home)[0], "a.glb", fields=ReadFields())
    assert next(m for m in house.materials if m.name == shiny.name).shininess == pytest.approx(40.0)


def test_roughness_and_normal_maps_come_with_their_factors() -> None:
    s = two_rooms()
    pictures = [png(), png(rgb=(128, 128, 255))]
    views = [s.writer.add_bytes(data) for data in pictures]
    s.more = {
        "images": [{"bufferView": v, "mimeType": "image/png", "name": f"p{v}"} for v in views],
        "textures": [{"source": 0}, {"source": 1}],
    }
    rough = {"roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": 0}}
    s.materials += [
        {"name": "wood", "pbrMetallicRoughness": rough, "normalTexture": {"index": 1, "scale": 0.5}},
        {"name": "iron", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}},
        {"name": "askew", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
         "normalTexture": {"index": 1, "texCoord": 1}},
    ]  # fmt: skip
    for k in range(3):
        s.node("Chair", mesh=s.mesh([[[0, 0, k], [1, 0, k], [1, 1, k], [0, 1, k]]], k))
    house = read(s)
    look = {m.name: m for m in house.materials}
    wood = look["wood"]
    assert house.textures[wood.roughness_texture_id or ""].data == pictures[0]
    assert house.textures[wood.normal_texture_id or ""].data == pictures[1]
    assert (wood.roughness, wood.normal_scale, wood.texture_id) == (0.5, 0.5, None)
    # glTF's default is metal of roughness 1, which used to come out black.
    assert look["iron"].roughness == 1.0
    assert look["iron"].specular == pytest.approx((0.735,) * 3, abs=1e-3)
    # A surface has one set of texture coordinates.
    assert look["askew"].normal_texture_id is None
    assert any(n.kind == "texture-layout" and "normalTexture" in n.text for n in house.notes)


def test_maps_survive_a_round_trip_through_our_glb() -> None:
    home = builtin_home()
    number = next(k for k, m in enumerate(home.materials) if m.texture_id)
    picture = home.materials[number].texture_id
    mapped = replace(
        home.materials[number],
        roughness=0.5, roughness_texture_id=picture, normal_texture_id=picture, normal_scale=2.0,
    )  # fmt: skip
    materials = (*home.materials[:number], mapped, *home.materials[number + 1 :])
    home = replace(home, materials=materials)
    house = read_gltf(bundle_from_house(home)[0], "a.glb", fields=ReadFields())
    back = next(m for m in house.materials if m.name == mapped.name)
    assert (back.roughness, back.normal_scale) == (0.5, 2.0)
    assert back.roughness_texture_id == back.normal_texture_id == picture
    assert all(m.roughness is None for m in house.materials if m.name == "carpet")


def test_punctual_lights_become_lumens_of_their_lamp() -> None:
    s = two_rooms()
    s.more["extensions"] = {
        "KHR_lights_punctual": {
            "lights": [
                {"type": "point", "intensity": 50, "color": [1, 0.5, 0.25]},
                {"type": "spot", "intensity": 100, "spot": {"outerConeAngle": np.pi / 3}},
                {"type": "directional", "intensity": 3},
            ]
        }
    }
    uses = [{"KHR_lights_punctual": {"light": k}} for k in range(3)]
    bulb = s.node("bulb", extensions=uses[0], translation=[0, 0.3, 0])
    s.node("Lamp", mesh=s.box([0, 0, 0], [0.2, 0.2, 0.2]), children=[bulb], translation=[1, 1, 1])
    turn = [-np.sqrt(0.5), 0, 0, np.sqrt(0.5)]  # -z turned down
    s.node("Spot", extensions=uses[1], translation=[2, 2.4, 1], rotation=turn)
    s.node("Sun", extensions=uses[2])
    house = read(s)
    (point,) = item(house, "Lamp").lights
    assert np.allclose(point.position, [1, 1.3, 1])
    assert flux_lm(point.power, point.unit, point.share) == pytest.approx(50 * 4 * np.pi)
    assert point.rgb_linear == (1.0, 0.5, 0.25)
    (spot,) = item(house, "Spot").lights
    assert (item(house, "Spot").kind, item(house, "Spot").room_id) == (ItemKind.LAMP, "0_0")
    assert spot.form is LightForm.SPOT
    assert np.allclose(spot.direction, [0, -1, 0], atol=1e-6)
    assert spot.power == pytest.approx(100 * np.pi)
    assert not any(i.name == "Sun" for i in house.items)


def test_emissive_surfaces_of_objects_emit_and_floors_never_glow() -> None:
    s = two_rooms()
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 1000}}
    s.materials += [
        {"name": "screen", "emissiveFactor": [1, 1, 1], "extensions": strong},
        {"name": "plain", "emissiveFactor": [1, 1, 1]},
    ]
    s.node("TV", mesh=s.mesh([[[0, 1, 0.1], [1, 1, 0.1], [1, 1.5, 0.1], [0, 1.5, 0.1]]], 0))
    s.node("Floor lamp", mesh=s.box([3, 0, 1], [3.1, 1, 1.1], 1))
    s.node("Picture", mesh=s.box([3, 1, 0], [3.1, 1.1, 0.1], 1))
    s.nodes[0]["mesh"] = s.mesh([[[0, 0, 3], [6, 0, 3], [6, 0, 0], [0, 0, 0]]], 0)
    house = read(s)
    (screen,) = item(house, "TV").lights
    assert screen.emitting == (0,)
    # Both sides of an open surface emit the declared radiance.
    assert screen.power == pytest.approx(2 * np.pi * 1000 * 0.5)
    (lamp,) = item(house, "Floor lamp").lights
    assert (lamp.power, lamp.emitting) == (800.0, (0,))
    assert not item(house, "Picture").lights
    floor = item(house, "Floor")
    assert not floor.lights
    assert house.materials[floor.surfaces[0].material].kind is MaterialKind.OPAQUE


def strong(name: str, rgb: list[float], strength: float) -> dict[str, object]:
    extension = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    return {"name": name, "emissiveFactor": rgb, "extensions": extension, "doubleSided": True}


def test_emitters_have_their_declared_brightness_and_colour() -> None:
    s = two_rooms()
    candelas = {
        "Panel": ([1, 1, 1], 1000), "Red panel": ([1, 0, 0], 500), "Green box": ([0.2, 0.8, 0.1], 300),
        "Lamp": ([1, 1, 1], 2000),
    }  # fmt: skip
    first = len(s.materials)
    s.materials += [strong(name, rgb, strength) for name, (rgb, strength) in candelas.items()]
    for k, name in enumerate(("Panel", "Red panel")):
        z = 1.0 + k
        s.node(name, mesh=s.mesh([[[0.5, 1, z], [1, 1, z], [1, 1.5, z], [0.5, 1.5, z]]], first + k))
    s.node("Green box", mesh=s.box([2, 1, 1], [2.2, 1.2, 1.2], first + 2))
    # A bulb inside a body that absorbs most of its light is as bright.
    bulb = s.node("bulb", mesh=s.box([2, 2, 2], [2.1, 2.1, 2.1], first + 3))
    s.node("Lamp", mesh=s.box([1.9, 1.9, 1.9], [2.2, 2.2, 2.2]), children=[bulb])
    house, _report = repair(read(s), RepairFields(), occluder_from=caster_of)
    geometry = geometry_from_house(house)
    keep = np.ones(len(geometry.faces), bool)
    emitters = area_emitters_of_house(house, geometry, keep, recipe_from_name("fast"))
    emitted = {house.items[e.item].name: np.array(e.radiance) * LM_PER_W for e in emitters}
    for name, (rgb, strength) in candelas.items():
        np.testing.assert_allclose(emitted[name], np.array(rgb) * strength, rtol=0.01, err_msg=name)


def caster_of(house: House) -> Caster:
    return Caster(geometry_from_house(house))


def test_a_lamp_without_a_colour_is_warm_white_and_a_white_one_stays_white() -> None:
    s = two_rooms()
    point = {"type": "point", "intensity": 50}
    lights = [point, {**point, "color": [1, 1, 1]}]
    s.more["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    for k, name in enumerate(("Plain lamp", "White lamp")):
        use = {"KHR_lights_punctual": {"light": k}}
        bulb = s.node("bulb", extensions=use, translation=[0, 0.5, 0])
        s.node(name, mesh=s.box([0, 0, 0], [0.2, 0.2, 0.2]), children=[bulb], translation=[1, k, 1])
    house = read(s)
    fields = recipe_from_name("fast").emission
    plain, white = (
        lamp_rgb(item(house, name).lights[0], name, fields, 0)
        for name in ("Plain lamp", "White lamp")
    )
    assert plain[0] > 5 * plain[2]
    np.testing.assert_allclose(white, 1.0)
    # The stored pair of files has the same values.
    data = bundle_from_house(house)
    back = house_from_bundle(*data)
    assert item(back, "White lamp").lights == item(house, "White lamp").lights


def test_a_lamp_without_a_light_gets_an_assumed_power() -> None:
    s = two_rooms()
    s.node("Lamp", mesh=s.box([1, 0, 1], [1.2, 1, 1.2]))
    lamp = item(read(s), "Lamp")
    assert lamp.tags == ("assumed_light",)
    assert np.allclose(lamp.lights[0].position, [1.1, 0.5, 1.1])


@pytest.mark.parametrize(
    ("names", "panes"),
    [
        (("Glass", "Frame"), {"Glass"}),
        (("windowGlass.001", "wood"), {"windowGlass.001"}),
        (("Fensterscheibe Glas", "Fensterrahmen"), {"Fensterscheibe Glas"}),
        (("Window", "Wood"), {"Window"}),
        (("window", "glass"), {"glass"}),  # "window" names the frame if there is a glass beside it
        (("glass frame", "plastic"), set()),
    ],
)
def test_an_opaque_material_named_glass_in_a_window_is_a_pane(
    names: tuple[str, ...], panes: set[str]
) -> None:
    s = two_rooms()
    s.materials += [{"name": n, "pbrMetallicRoughness": {}} for n in names]
    parts = [s.node(f"part {k}", mesh=s.box([1, 1 + k, 0], [2, 2 + k, 0.05], k)) for k in range(2)]
    s.node("Window", children=parts)
    s.node("Table", mesh=s.box([1, 0, 1], [2, 0.7, 2], 0))
    house = read(s)
    materials = [house.materials[x.material] for x in item(house, "Window").surfaces]
    assert {m.name for m in materials if m.kind is MaterialKind.PANE} == panes
    assert all(m.opacity < 0.5 for m in materials if m.kind is MaterialKind.PANE)
    (table,) = (house.materials[x.material] for x in item(house, "Table").surfaces)
    assert table.kind is MaterialKind.OPAQUE


def test_a_part_named_glass_of_a_window_is_a_pane_of_any_material() -> None:
    s = two_rooms()
    pane = s.node("Glass", mesh=s.box([1, 1, 0], [2, 2, 0.02]))
    frame = s.node("Glass frame", mesh=s.box([1, 0.9, 0], [2, 1, 0.05]))
    s.node("Window", children=[pane, frame])
    house = read(s)
    kinds = [house.materials[x.material].kind for x in item(house, "Window").surfaces]
    assert kinds == [MaterialKind.PANE, MaterialKind.OPAQUE]


def test_colours_of_vertices_are_the_materials_colour_or_a_picture() -> None:
    s = two_rooms()
    s.materials.append(
        {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1], "metallicFactor": 0}}
    )
    for name, red_of_second_half in (("Even", 1.0), ("Painted", 0.0)):
        s.node(name, mesh=s.box([1, 0, 1], [1.5, 0.5, 1.5], len(s.materials) - 1))
        primitive = s.meshes[-1]["primitives"][0]
        rgb = np.tile(np.array([[1.0, 0.25, 0.0]], np.float32), (24, 1))
        rgb[12:, 0] = red_of_second_half
        primitive["attributes"]["COLOR_0"] = s.writer.add_vertices(rgb)
    house = read(s)
    even, painted = (
        house.materials[item(house, name).surfaces[0].material] for name in ("Even", "Painted")
    )
    assert even.texture_id is None
    expected = srgb_from_linear(np.array([0.5, 0.25, 0.0]))
    np.testing.assert_allclose(even.diffuse, expected, atol=1e-6)
    assert painted.texture_id is not None
    picture = Image.open(io.BytesIO(house.textures[painted.texture_id].data)).convert("RGB")
    (surface,) = item(house, "Painted").surfaces
    assert surface.uvs is not None
    # The texel of the first corner of each face.
    texels = np.array([
        picture.getpixel((int(u * picture.width), int((1 - v) * picture.height)))
        for u, v in surface.uvs[surface.faces[:, 0]]
    ])  # fmt: skip
    np.testing.assert_array_equal(texels[:6, 0], 188)
    np.testing.assert_array_equal(texels[6:, 0], 0)
    assert {n.kind for n in house.notes} == {"unmapped-class"}
