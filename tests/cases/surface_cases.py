"""Cases of materials, pictures and their mapping, in glTF and OpenUSD; writers write files."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image
from pxr import Sdf, UsdShade

import pbrs_farm as pf
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import House
from tests.cases.case import (
    Case,
    Rgb,
    depth_to,
    house_of,
    kinds_of_notes,
    material_of,
    named,
    shown,
)
from tests.inputs.usd_files import UsdHome, walls_of
from tests.read.gltf.gltf_scenes import Scene
from tests.read.small_houses import png

_RED: Final[Rgb] = (0.7, 0.05, 0.05)
_EYE: Final[Rgb] = (2.0, 1.2, 0.4)
_AXES: Final = {"clamp": 33071, "mirror": 33648, "repeat": 10497}


def cases() -> list[Case]:
    """glTF first."""
    usd = Path("home.usda")
    return [
        Case("alpha", partial(_write_glb, _crates), _ask_for_holes),
        Case("usd_opacity", lambda folder: _cut_by_a_mask(folder / usd), _ask_for_a_hole_of_usd),
        Case("quantized", partial(_write_glb, partial(_small, 16_384.0, 6.1e-5)), _ask_for_the_table),
        Case("tiny_scale", partial(_write_glb, partial(_small, 1e5, 1e-5)), _ask_for_the_table),
        Case("spec_gloss", partial(_write_glb, _spec_gloss), partial(_ask_for_colour, _RED)),
        Case("spec_gloss_picture", partial(_write_glb, _spec_gloss_picture), _ask_for_a_picture),
        Case(
            "usd_materialx", lambda folder: _materialx(folder / usd, "ND_standard_surface_surfaceshader"),
            partial(_ask_for_colour, _RED),
        ),
        Case(
            "usd_unknown_shader", lambda folder: _materialx(folder / usd, "ND_of_nobody"),
            _ask_for_grey_and_a_note,
        ),
        Case("wrap", _write_wraps, _ask_for_three_wraps),
        Case("texcoord_override", partial(_write_glb, _second_uvs), _ask_for_second_uvs),
        *(
            Case(
                f"usd_purpose_{purpose}",
                lambda folder, purpose=purpose: _bound_for(folder / usd, purpose),
                partial(_ask_for_colour, _RED),
            )
            for purpose in ("preview", "full")
        ),
        Case("usd_udim", lambda folder: _udim(folder / usd), _ask_for_the_name_of_the_tile),
        Case("dark", partial(_write_glb, _dark), _ask_for_light_on_a_dark_box),
        Case("own_model_glb", _model_without_its_picture, _ask_for_a_warning),
        Case("own_model_obj", _obj_without_its_picture, _ask_for_a_warning),
        Case("sky_flipped", _sky_from_below, _ask_for_the_sky_above),
    ]  # fmt: skip


def room() -> Scene:
    """A closed room of 4 x 3.5 x 2.5 m, walls 12 cm thick; material 0 is its paint."""
    s = Scene()
    s.materials.append(_plain("Wall paint", (0.8, 0.8, 0.78)))
    t, w, d, h = 0.12, 4.0, 3.5, 2.5
    for name, low, high in (
        ("Floor", [0, -t, 0], [w, 0, d]),
        ("Ceiling", [0, h, 0], [w, h + t, d]),
        ("Wall.001", [-t, -t, -t], [w + t, h + t, 0]),
        ("Wall.002", [-t, -t, d], [w + t, h + t, d + t]),
        ("Wall.003", [-t, -t, 0], [0, h + t, d]),
        ("Wall.004", [w, -t, 0], [w + t, h + t, d]),
    ):
        s.node(name, mesh=s.box(low, high, 0))
    return s


def _plain(name: str, rgb: Rgb) -> dict[str, Any]:
    pbr = {"baseColorFactor": [*rgb, 1], "metallicFactor": 0, "roughnessFactor": 1}
    return {"name": name, "pbrMetallicRoughness": pbr}


def _textured(name: str, picture: int = 0, **more: Any) -> dict[str, Any]:
    pbr = {"baseColorTexture": {"index": picture}, "metallicFactor": 0}
    return {"name": name, "pbrMetallicRoughness": pbr, **more}


def _with_pictures(s: Scene, *pictures: bytes, **sampler: int) -> None:
    views = [s.writer.add_bytes(data) for data in pictures]
    s.more["images"] = [{"bufferView": v, "mimeType": "image/png"} for v in views]
    s.more["textures"] = [{"source": k, "sampler": 0} for k in range(len(views))]
    s.more["samplers"] = [sampler]


def _write_glb(scene: Callable[[], Scene], folder: Path) -> Path:
    path = folder / "room.glb"
    path.write_bytes(scene().glb())
    return path


# Name of a crate -> alpha of its picture's upper half, the alpha mode in the file, whether it is a
# hole.
_CRATES: Final[dict[str, tuple[int, dict[str, Any], bool]]] = {
    "Crate 0": (150, {"alphaMode": "MASK", "alphaCutoff": 0.2}, False),
    "Crate 1": (150, {"alphaMode": "MASK", "alphaCutoff": 0.9}, True),
    "Crate 2": (150, {"alphaMode": "MASK"}, False),
    "Crate 3": (0, {"alphaMode": "OPAQUE"}, False),
    "Crate 4": (0, {"alphaMode": "BLEND"}, True),
}


def _crate_at(k: int) -> tuple[list[float], list[float]]:
    return [0.6 + 0.6 * k, 0.0, 1.9], [1.0 + 0.6 * k, 0.5, 2.4]


def _crates() -> Scene:
    s = room()
    _with_pictures(s, *(_png((90, 140, 60, alpha)) for alpha, _, _ in _CRATES.values()))
    for k, (name, (_alpha, cut, _hole)) in enumerate(_CRATES.items()):
        s.materials.append(_textured(f"leaf {k}", k, **cut))
        s.node(name, mesh=s.box(*_crate_at(k), material=k + 1))
    return s


def _ask_for_holes(path: Path) -> None:
    frame = shown(path, _EYE, (2.0, 0.3, 2.0))
    for k, (name, (_alpha, _cut, hole)) in enumerate(_CRATES.items()):
        low, high = np.array(_crate_at(k))
        x, y = (low[0] + high[0]) / 2, 0.25 * low[1] + 0.75 * high[1]
        got, solid = depth_to(frame, _EYE, (float(x), float(y), float(low[2])))
        assert (got > solid + 0.1) == hole, f"{name}: depth {got:.2f}, its front is at {solid:.2f}"


def _small(size: float, scale: float) -> Scene:
    s = room()
    s.materials.append(_plain("Oak", (0.5, 0.35, 0.2)))
    s.node(
        "Table",
        mesh=s.box([0.0] * 3, [size] * 3, 1),
        scale=[scale] * 3,
        translation=[1.5, 0.0, 1.3],
    )
    return s


def _ask_for_the_table(path: Path) -> None:
    assert np.allclose(np.ptp(named(house_of(path), "Table").bounds, axis=0), 1.0, atol=2e-3)


def _spec_gloss() -> Scene:
    diffuse = {"diffuseFactor": [*_RED, 1], "specularFactor": [0.05] * 3, "glossinessFactor": 0.6}
    return _with_table({"name": "Lacquer", "extensions": {"KHR_materials_pbrSpecularGlossiness": diffuse}})  # fmt: skip


def _spec_gloss_picture() -> Scene:
    diffuse = {"diffuseTexture": {"index": 0}, "glossinessFactor": 0.6}
    s = _with_table({"name": "Lacquer", "extensions": {"KHR_materials_pbrSpecularGlossiness": diffuse}})  # fmt: skip
    _with_pictures(s, png())
    return s


def _with_table(material: dict[str, Any]) -> Scene:
    s = room()
    s.materials.append(material)
    s.node("Table", mesh=s.box([1.5, 0, 1.2], [2.5, 0.75, 2.0], 1))
    if "extensions" in material:
        s.more["extensionsUsed"] = list(material["extensions"])
    return s


def _ask_for_colour(linear: Rgb, path: Path) -> None:
    got = linear_from_srgb(np.array(material_of(house_of(path), "Table").diffuse))
    assert np.allclose(got, linear, atol=0.01), f"the table is {got}"


def _ask_for_a_picture(path: Path) -> None:
    assert material_of(house_of(path), "Table").texture_id


def _materialx(path: Path, node: str) -> Path:
    home, table = _usd_room(path)
    material = UsdShade.Material.Define(home.stage, "/World/Looks/Mtlx")
    shader = UsdShade.Shader.Define(home.stage, "/World/Looks/Mtlx/S")
    shader.CreateIdAttr(node)
    shader.CreateInput("base_color", Sdf.ValueTypeNames.Color3f).Set(_RED)
    shader.CreateInput("base", Sdf.ValueTypeNames.Float).Set(1.0)
    out = shader.CreateOutput("out", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(out)
    UsdShade.MaterialBindingAPI.Apply(table).Bind(material)
    return home.save()


def _usd_room(path: Path) -> tuple[UsdHome, Any]:
    """A room of 4 x 3 m with a table, which has no material yet."""
    home = UsdHome(path, up="Y")
    walls_of(home, "/World/Kitchen", 0, 4, 0, 3)
    return home, home.box(
        "/World/Kitchen/Table", [1.5, 0, 1.2], [2.5, 0.75, 2.0], "table"
    ).GetPrim()


def _ask_for_grey_and_a_note(path: Path) -> None:
    house = house_of(path)
    material = material_of(house, "Table")
    assert len(set(material.diffuse)) == 1, "no grey"
    assert material.diffuse[0] > 0.3, "black"
    assert material.specular == (0.0, 0.0, 0.0), "not matte"
    assert _says(house, "Mtlx") or _says(house, "ND_of_nobody"), "no note"


def _says(house: House, word: str) -> bool:
    return any(word in note.place or word in note.text for note in house.notes)


def _cut_by_a_mask(path: Path) -> Path:
    home, table = _usd_room(path)
    (path.parent / "colour.png").write_bytes(png())
    (path.parent / "mask.png").write_bytes(png(rgb=(0, 0, 0)))
    material = home.material("Leaf", picture="colour.png", opacityThreshold=0.5)
    mask = UsdShade.Shader.Define(home.stage, "/World/Looks/Leaf/Mask")
    mask.CreateIdAttr("UsdUVTexture")
    mask.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath("mask.png"))
    st = UsdShade.Shader(home.stage.GetPrimAtPath("/World/Looks/Leaf/St"))
    mask.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st.GetOutput("result"))
    shader = UsdShade.Shader(home.stage.GetPrimAtPath("/World/Looks/Leaf/Shader"))
    opacity = shader.CreateInput("opacity", Sdf.ValueTypeNames.Float)
    opacity.ConnectToSource(mask.CreateOutput("r", Sdf.ValueTypeNames.Float))
    UsdShade.MaterialBindingAPI.Apply(table).Bind(material)
    return home.save()


def _ask_for_a_hole_of_usd(path: Path) -> None:
    frame = shown(path, _EYE, (2.0, 0.4, 1.5))
    got, solid = depth_to(frame, _EYE, (2.0, 0.4, 1.2))
    assert got > solid + 0.1, "the table is solid"


def _bound_for(path: Path, purpose: str) -> Path:
    home, table = _usd_room(path)
    material = home.material("Red", _RED)
    UsdShade.MaterialBindingAPI.Apply(table).Bind(material, materialPurpose=purpose)
    return home.save()


def _udim(path: Path) -> Path:
    home, table = _usd_room(path)
    (path.parent / "tile.1001.png").write_bytes(png())
    material = home.material("Tiles", picture="tile.<UDIM>.png")
    UsdShade.MaterialBindingAPI.Apply(table).Bind(material)
    return home.save()


def _ask_for_the_name_of_the_tile(path: Path) -> None:
    house = house_of(path)
    assert material_of(house, "Table").texture_id or _says(house, "tile.")


def _write_wraps(folder: Path) -> Path:
    """Write the same room three times with three wrap modes of its floor's picture; returns the folder."""
    colours = np.array([[[200, 30, 30], [30, 200, 30]], [[30, 30, 200], [200, 200, 30]]], np.uint8)
    for name, mode in _AXES.items():
        s = room()
        _with_pictures(s, _encoded(colours), wrapS=mode, wrapT=mode)
        s.materials.append(_textured("Rug floor"))
        # The floor's uv range from -1 to 2 on each of its sides.
        floor = s.box([0, -0.12, 0], [4, 0, 3.5], 1)
        uvs = np.tile(np.array([[-1, 2], [2, 2], [2, -1], [-1, -1]], np.float32), (6, 1))
        s.meshes[floor]["primitives"][0]["attributes"]["TEXCOORD_0"] = s.writer.add_vertices(uvs)
        s.nodes[0]["mesh"] = floor
        (folder / f"{name}.glb").write_bytes(s.glb())
    return folder


def _floor(s: Scene, material: int, *uv_sets: np.ndarray[Any, Any]) -> int:
    """The floor as one quad with its sets of texture coordinates."""
    number = s.mesh([[[0, 0, 3.5], [4, 0, 3.5], [4, 0, 0], [0, 0, 0]]], material)
    attributes = s.meshes[number]["primitives"][0]["attributes"]
    for k, uvs in enumerate(uv_sets):
        attributes[f"TEXCOORD_{k}"] = s.writer.add_vertices(uvs)
    return number


def _ask_for_three_wraps(folder: Path) -> None:
    """Each picture follows its file, or a note reports the difference."""
    pictures: list[bytes] = []
    for name in _AXES:
        path = folder / f"{name}.glb"
        if "texture-layout" not in kinds_of_notes(house_of(path)):
            frame = shown(path, _EYE, (2.0, 0.0, 2.0), layers=("albedo",))
            pictures.append(np.asarray(frame.layer("albedo")).tobytes())
    assert len(set(pictures)) == len(pictures), "two of clamp, mirror and repeat give one picture"


_SECOND: Final = np.array([[0, 4], [4, 4], [4, 0], [0, 0]], np.float32)


def _second_uvs() -> Scene:
    s = room()
    _with_pictures(s, png())
    extensions = {"KHR_texture_transform": {"texCoord": 1, "scale": [1, 1]}}
    material = _textured("Tiles")
    material["pbrMetallicRoughness"]["baseColorTexture"] |= {
        "texCoord": 0,
        "extensions": extensions,
    }
    s.materials.append(material)
    s.nodes[0]["mesh"] = _floor(s, 1, _SECOND / 4, _SECOND)
    return s


def _ask_for_second_uvs(path: Path) -> None:
    house = house_of(path)
    uvs = named(house, "Floor").surfaces[0].uvs
    assert uvs is not None
    assert np.ptp(uvs, axis=0).max() == 4 or "texture-layout" in kinds_of_notes(house)


def _dark() -> Scene:
    s = room()
    s.materials.append(_plain("night", (0.0, 0.0046, 0.083)))
    s.node("Crate", mesh=s.box([1.6, 0, 1.5], [2.2, 0.6, 2.1], 1))
    return s


def _ask_for_light_on_a_dark_box(path: Path) -> None:
    camera = pf.Camera.look_at((0.5, 1.4, 3.2), (1.9, 0.3, 1.8), size=(96, 72), hfov_deg=40)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        frame = pf.render(pf.load(str(path), recipe="preview"), camera, modes=["mlt_il_ol"])
    (number,) = (row["id"] for row in frame.instances if row["name"] == "Crate")
    box = frame.colour[frame.instance == number]
    assert len(box) > 200
    black = float((box == 0).all(-1).mean())
    assert black < 0.2, f"{black:.0%} of the box is black"


def _model_without_its_picture(folder: Path) -> Path:
    s = Scene()
    s.materials.append(_textured("label"))
    s.more |= {"images": [{"uri": "nothere.png"}], "textures": [{"source": 0}]}
    s.node("Can", mesh=s.box([0, 0, 0], [0.1, 0.2, 0.1], 0))
    path = folder / "can.glb"
    path.write_bytes(s.glb())
    return path


def _obj_without_its_picture(folder: Path) -> Path:
    (folder / "can.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd nothere.png\n")
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.1))
    faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    path = folder / "can.obj"
    path.write_text(f"mtllib can.mtl\n{corners}usemtl m\n{faces}")
    return path


def _ask_for_a_warning(path: Path) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pf.model(path)
    assert any("nothere.png" in str(warning.message) for warning in caught), (
        "no word of its picture"
    )


def _sky_from_below(folder: Path) -> Path:
    """A Radiance picture whose rows are stored from the bottom: bright above, dark below."""
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n+Y 16 +X 32\n"
    rows = [bytes([40, 40, 40, 128]) * 32] * 8 + [bytes([200, 200, 250, 131]) * 32] * 8
    path = folder / "sky.hdr"
    path.write_bytes(head + b"".join(rows))
    return path


def _ask_for_the_sky_above(path: Path) -> None:
    from pbrs_farm.images import decode_radiance

    sky = decode_radiance(path.read_bytes(), path.name)
    assert sky[0].mean() > 10 * sky[-1].mean(), "it hangs upside down"


def _png(rgba: tuple[int, int, int, int]) -> bytes:
    """A picture of one colour whose lower half is opaque."""
    pixels = np.full((8, 8, 4), rgba, np.uint8)
    pixels[4:, :, 3] = 255
    return _encoded(pixels)


def _encoded(pixels: np.ndarray[Any, Any]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()
