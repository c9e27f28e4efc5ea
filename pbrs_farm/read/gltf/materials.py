"""Materials and textures of a glTF scene -> Material and Texture; no effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import NOTHING_LEFT, USUAL_CUTOFF, Material, MaterialKind
from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.home.names import FRAME_WORDS, GLASS_WORDS, words_of
from pbrs_farm.read.common.furniture_classes import words_of_list
from pbrs_farm.read.common.material_fields import noted_fields
from pbrs_farm.read.common.material_library import (
    OPAQUE_ALPHA,
    LoadedTexture,
    MaterialLibrary,
    PictureValues,
    base_colour_picture,
    opened_picture,
    picture_mean,
    picture_of_values,
)
from pbrs_farm.read.common.model_materials import GREY
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.compressed import BASISU, decoded_picture
from pbrs_farm.read.gltf.document import (
    UNREAD,
    Fetch,
    MissingFile,
    image_bytes,
    numbers,
    object_at,
    specular_glossiness,
    texture_layout,
    texture_slots,
    texture_wraps,
)
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.mesh.texture_wraps import REPEAT, Wraps, leaves_picture, wrapped

# Reflectance of a dielectric at normal incidence, linear (glTF 2.0, appendix B).
F0: Final = 0.04

MAX_SHININESS: Final = 10_000.0  # Phong exponent; above it a lobe is a mirror's


@dataclass(frozen=True, slots=True)
class Emission:
    """How a material shines."""

    luminance: float  # cd m-2; 0 = of unknown strength
    rgb_linear: tuple[float, float, float]  # largest 1
    is_coloured: bool  # the file gives that colour, even if it is white


_LEAST_DIFFERENCE: Final = 0.004  # of the colours of vertices, linear


class SceneMaterials:
    """Resolves the materials of one scene into its material library."""

    def __init__(self, gltf: Gltf, fetch: Fetch, notes: Notes) -> None:
        self._gltf = gltf
        self._fetch = fetch
        self._notes = notes
        self._means: dict[tuple[str, bool], F64] = {}
        self.library = MaterialLibrary(notes)

    def material(
        self, number: int | None, *, clear: MaterialKind
    ) -> tuple[Material, Emission | None]:
        """(materials[number], None = white; its emission or None). clear: the kind of clear materials."""
        if number is None:
            return Material("default", is_default=True), None
        fields_json = entry(self._gltf, "materials", number)
        place = f"materials[{number}]"
        for path in noted_fields("glTF"):
            if path.startswith("extensions.") and _has_path(fields_json, path):
                self._notes.add(UNREAD, place, f"{path.rpartition('.')[2]} is not read")
        factor, picture, is_lost = self._colour(number, place)
        glossy = specular_glossiness(fields_json)
        metallic, roughness = self._metal(fields_json, place)
        maps = self._maps(number, place)
        if "specularGlossinessTexture" in maps:
            roughness = 1.0  # the factor is in the map
        transmission = object_at(object_at(fields_json, "extensions"), "KHR_materials_transmission")
        passes = self._fraction(transmission, "transmissionFactor", 0.0, place)
        # Opacity is what blending lets through, or transmission, whichever is less.
        opacity, cutoff = self._alpha(fields_json, float(np.clip(factor[3], 0, 1)), picture, place)
        opacity = min(opacity, 1.0 - passes)
        colour = np.clip(factor[:3], 0, 1)
        if is_lost:
            colour, metallic = colour * linear_from_srgb(np.array(GREY)), 0.0
        # Roughness to a Phong exponent: alpha = roughness^2, n = 2 / alpha^2 - 2.
        shininess = min(2.0 / max(roughness, 1e-3) ** 4 - 2.0, MAX_SHININESS)
        is_metal = metallic > 0 and picture is None
        reflected = self._reflected(fields_json, place)
        if not glossy:
            reflected = reflected + (colour - reflected) * metallic
        specular = reflected if shininess > 0 or is_metal else np.zeros(3)
        # Fully rough dielectrics are matte.
        roughness_map = maps.get("metallicRoughnessTexture", maps.get("specularGlossinessTexture"))
        has_coat = roughness < 1 or is_metal or roughness_map is not None
        material = Material(
            name=str(fields_json.get("name", ""))[:100],
            kind=self._kind(fields_json, clear, opacity, metallic, roughness),
            diffuse=_encoded(colour if picture else colour * (1 - metallic)),
            specular=_encoded(specular),
            shininess=shininess,
            opacity=opacity,
            texture_id=picture.texture.id if picture else None,
            alpha_cutout=cutoff is not None,
            alpha_cutoff=USUAL_CUTOFF if cutoff is None else cutoff,
            roughness=roughness if has_coat else None,
            roughness_texture_id=roughness_map,
            normal_texture_id=maps.get("normalTexture"),
            normal_scale=self._normal_scale(fields_json, place) if "normalTexture" in maps else 1.0,
            is_default=picture is None and not is_lost and not _names_colour(fields_json),
        )
        return material, self._emission(fields_json, place)

    def _alpha(
        self, fields_json: dict[str, Any], factor: float, picture: LoadedTexture | None, place: str
    ) -> tuple[float, float | None]:
        """(opacity, alpha threshold of cut-outs or None) by the alpha mode.

        MASK cuts out texels below its cutoff, the rest is opaque. BLEND is cut at one half, since labels
        cannot be blended, as in Cycles' passes; a uniformly transparent picture makes glass of its mean.
        """
        mode = fields_json.get("alphaMode", "OPAQUE")
        alpha = picture.alpha if picture else OPAQUE_ALPHA
        if mode == "BLEND":
            is_even = alpha.most < USUAL_CUTOFF or alpha.least == alpha.most
            has_holes = not is_even and alpha.least < USUAL_CUTOFF
            return (factor * alpha.mean if is_even else factor), USUAL_CUTOFF if has_holes else None
        if mode != "MASK":
            return 1.0, None
        cutoff_value = fields_json.get("alphaCutoff", USUAL_CUTOFF)
        (least,) = numbers(self._gltf, [cutoff_value], 1, f"{place}: alphaCutoff")
        if factor * alpha.most < least:
            text = (
                f"alphaCutoff {least:g}: its alpha is nowhere more than {factor * alpha.most:.3g}"
            )
            self._notes.add("wholly-cut-out", place, f"{text}, so that nothing of it is seen")
            return 1.0, NOTHING_LEFT
        return 1.0, None if factor * alpha.least >= least else float(least) / factor

    def _colour(self, number: int, place: str) -> tuple[F64, LoadedTexture | None, bool]:
        """(colour and opacity, the picture they multiply or None, whether one is named and cannot be had)."""
        fields_json = entry(self._gltf, "materials", number)
        glossy, slots = specular_glossiness(fields_json), texture_slots(self._gltf, number)
        if not glossy:
            pbr = object_at(fields_json, "pbrMetallicRoughness")
            info = slots.get("baseColorTexture")
            factor = numbers(self._gltf, pbr.get("baseColorFactor", [1] * 4), 4, f"{place}: colour")
            picture = self._texture(info, place)
            return factor, picture, info is not None and picture is None
        factor = numbers(self._gltf, glossy.get("diffuseFactor", [1] * 4), 4, f"{place}: colour")
        diffuse, shine = slots.get("diffuseTexture"), slots.get("specularGlossinessTexture")
        picture = self._texture(diffuse, place)
        is_lost = diffuse is not None and picture is None
        if shine is None or is_lost or (diffuse and not self._lie_alike(diffuse, shine)):
            return factor, picture, is_lost
        # Metals of two pictures are black in the one and coloured in the other.
        converted = self._made(
            shine,
            f"{place}: base colour",
            lambda data: base_colour_picture(
                picture.texture.data if picture else None,
                data,
                np.clip(factor[:3], 0, 1),
                self._specular_factor(glossy, place),
            ),
        )
        if converted is None:
            return factor, picture, False
        return np.array([1, 1, 1, factor[3]]), converted, False

    def _lie_alike(self, first: dict[str, Any], other: dict[str, Any]) -> bool:
        return texture_layout(self._gltf, first) == texture_layout(self._gltf, other)

    def _specular_factor(self, glossy: dict[str, Any], place: str) -> F64:
        rgb = numbers(self._gltf, glossy.get("specularFactor", [1] * 3), 3, f"{place}: specular")
        return np.clip(rgb, 0, 1)

    def _metal(self, fields_json: dict[str, Any], place: str) -> tuple[float, float]:
        """(metallic, roughness) by the factors; what says nothing of its surface is no metal."""
        extensions = object_at(fields_json, "extensions")
        pbr = object_at(fields_json, "pbrMetallicRoughness")
        if glossy := specular_glossiness(fields_json):
            return 0.0, 1.0 - self._fraction(glossy, "glossinessFactor", 1.0, place)
        if "KHR_materials_unlit" in extensions or not pbr:
            return 0.0, 1.0
        metallic = self._fraction(pbr, "metallicFactor", 1.0, place)
        if "metallicRoughnessTexture" in pbr:
            # A colour's picture is shown as paint; without one the mean of metal's picture counts.
            info = None if "baseColorTexture" in pbr else pbr["metallicRoughnessTexture"]
            mean = self._mean(info, f"{place}: metallicRoughnessTexture", is_colour=False)
            metallic *= 0.0 if mean is None else float(mean[2])
        return metallic, self._fraction(pbr, "roughnessFactor", 1.0, place)

    def _reflected(self, fields_json: dict[str, Any], place: str) -> F64:
        """(3,) reflectance of dielectrics at normal incidence, linear."""
        if glossy := specular_glossiness(fields_json):
            return self._specular_factor(glossy, place)
        extensions = object_at(fields_json, "extensions")
        ior, spec = (object_at(extensions, f"KHR_materials_{key}") for key in ("ior", "specular"))
        (index,) = numbers(self._gltf, [ior.get("ior", 1.5)], 1, f"{place}: ior")
        colour_factor = spec.get("specularColorFactor", [1] * 3)
        tint = np.maximum(numbers(self._gltf, colour_factor, 3, f"{place}: specular colour"), 0)
        strength = self._fraction(spec, "specularFactor", 1.0, place)
        f0 = ((index - 1) / (index + 1)) ** 2 if "ior" in ior and index >= 0 else F0
        return np.asarray(np.minimum(f0 * tint, 1) * strength)

    def _maps(self, number: int, place: str) -> dict[str, str]:
        """Texture ids of the roughness and normal maps that lie as the leading texture does."""
        slots = texture_slots(self._gltf, number)
        layouts = {key: texture_layout(self._gltf, info) for key, info in slots.items()}
        maps: dict[str, str] = {}
        for key, info in slots.items():
            if key in ("baseColorTexture", "diffuseTexture"):
                continue
            if layouts[key] != next(iter(layouts.values())):
                text = f"{key} has another mapping than the first texture: left out"
                self._notes.add("texture-layout", place, text)
                continue
            loaded = self._texture(info, f"{place}: {key}")
            if loaded is not None and key == "specularGlossinessTexture":
                loaded = self._roughness_of_gloss(number, info, place)
            if loaded is not None:
                maps[key] = loaded.texture.id
        return maps

    def _roughness_of_gloss(
        self, number: int, info: dict[str, Any], place: str
    ) -> LoadedTexture | None:
        glossy = specular_glossiness(entry(self._gltf, "materials", number))
        gloss = self._fraction(glossy, "glossinessFactor", 1.0, place)
        values = PictureValues("a", scale=(-gloss,) * 3, bias=(1.0,) * 3)
        return self._made(info, f"{place}: roughness", lambda data: picture_of_values(data, values))

    def _normal_scale(self, fields_json: dict[str, Any], place: str) -> float:
        scale = object_at(fields_json, "normalTexture").get("scale", 1.0)
        (value,) = numbers(self._gltf, [scale], 1, f"{place}: scale of the normal map")
        return float(value)

    def _kind(
        self,
        fields_json: dict[str, Any],
        clear: MaterialKind,
        opacity: float,
        metallic: float,
        roughness: float,
    ) -> MaterialKind:
        word = object_at(fields_json, "extras").get("kind")
        tagged = next((k for k in MaterialKind if k.value == word), None)
        # Extras take precedence, then opacity, then the factors.
        if tagged is not None:
            return tagged
        if opacity < 1:
            return clear
        return MaterialKind.MIRROR if metallic > 0.9 and roughness < 0.1 else MaterialKind.OPAQUE

    def _emission(self, fields_json: dict[str, Any], place: str) -> Emission | None:
        """KHR_materials_emissive_strength alone gives its strength; None = it does not shine."""
        factor = numbers(
            self._gltf, fields_json.get("emissiveFactor", [0] * 3), 3, f"{place}: emission"
        )
        mean = None
        if (factor > 0).any():
            mean = self._mean(fields_json.get("emissiveTexture"), place, is_colour=True)
        factor = factor if mean is None else factor * mean
        if not (factor > 0).any():
            return None
        strength = object_at(
            object_at(fields_json, "extensions"), "KHR_materials_emissive_strength"
        )
        rgb = triple(np.maximum(factor, 0.0) / factor.max())
        # Our own files paint bulbs that have no colour white.
        is_given = object_at(fields_json, "extras").get("kind") != MaterialKind.BULB.value
        if "emissiveStrength" not in strength:
            return Emission(0.0, rgb, is_given)
        # Take luminance for the strength: its Rec. 709 weights.
        (value,) = numbers(self._gltf, [strength["emissiveStrength"]], 1, f"{place}: emission")
        luminance = float(value * (np.maximum(factor, 0.0) @ LUMINANCE))
        return Emission(luminance, rgb, is_given) if luminance > 0 else None

    def _fraction(self, holder: dict[str, Any], key: str, default: float, place: str) -> float:
        (value,) = numbers(self._gltf, [holder.get(key, default)], 1, f"{place}: {key}")
        return float(np.clip(value, 0, 1))

    def _texture(self, info: Any, place: str) -> LoadedTexture | None:
        if not isinstance(info, dict):
            return None
        texture = entry(self._gltf, "textures", info.get("index"))
        # Prefer the WebP picture: the other is a fallback for readers without it.
        webp = object_at(object_at(texture, "extensions"), "EXT_texture_webp")
        basisu = object_at(object_at(texture, "extensions"), BASISU)
        source = webp.get("source", texture.get("source", basisu.get("source")))
        if type(source) is not int:
            self._notes.add("unreadable-texture", place, "its picture is of an unknown kind")
            return None
        image = entry(self._gltf, "images", source)
        name = str(image.get("name") or image.get("uri") or "")[:100]
        name = "" if name.startswith("data:") else name
        key = f"images[{source}]" + (f" ({name})" if name else "")
        return self.library.texture(
            key, name=name or f"images[{source}]", place=place, load=lambda: self._picture(source)
        )

    def _mean(self, info: Any, place: str, *, is_colour: bool) -> F64 | None:
        """(3,) mean of a texture, of a colour in linear light; None without a texture."""
        loaded = self._texture(info, place)
        if loaded is None:
            return None
        key = (loaded.texture.id, is_colour)
        if key not in self._means:
            self._means[key] = picture_mean(loaded.texture.data, is_colour=is_colour)
        return self._means[key]

    def _made(
        self, info: dict[str, Any], key: str, make: Callable[[bytes], bytes]
    ) -> LoadedTexture | None:
        """A texture derived from another one's picture; None if that is not available."""
        loaded = self._texture(info, key)
        if loaded is None:
            return None
        data = loaded.texture.data
        return self.library.texture(key, name=key, place=key, load=lambda: make(data))

    def _picture(self, source: int) -> bytes | None:
        try:
            return decoded_picture(image_bytes(self._gltf, source, self._fetch))
        except MissingFile:
            return None

    def with_vertex_colours(self, mesh: Mesh, material: Material) -> tuple[Mesh, Material]:
        """The mesh and material with vertex colours: their mean, or a picture without another one."""
        if mesh.colours is None:
            return mesh, material
        base = linear_from_srgb(np.array(material.diffuse))
        faces = mesh.colours[mesh.faces].mean(1)
        if not base.any():  # a metal
            tint = linear_from_srgb(np.array(material.specular)) * faces.mean(0)
            return mesh, replace(material, specular=_encoded(tint))
        if material.texture_id is not None or np.ptp(faces, axis=0).max() < _LEAST_DIFFERENCE:
            return mesh, replace(material, diffuse=_encoded(base * faces.mean(0)))
        rgb = np.rint(255 * srgb_from_linear(faces * base)).astype(np.uint8)
        uvs, texture = self.library.colours_of_faces(rgb, material.name or "vertex colours")
        corners = mesh.faces.reshape(-1)
        parted = replace(
            mesh,
            positions=mesh.positions[corners],
            faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3),
            uvs=uvs.repeat(3, 0),
            normals=mesh.normals[corners],
            colours=None,
        )
        return parted, replace(material, diffuse=(1.0, 1.0, 1.0), texture_id=texture)

    def laid(self, number: int | None, mesh: Mesh) -> Mesh:
        """The mesh as its material's pictures lie on it, which a surface repeats beyond their edges."""
        info = next(iter(texture_slots(self._gltf, number).values()), None)
        modes = (REPEAT, REPEAT) if info is None else texture_wraps(self._gltf, info)
        if info is None or not leaves_picture(mesh, modes):
            return mesh
        place = f"materials[{number}]"
        loaded = self._texture(info, place)
        if loaded is None:
            return mesh
        cut = wrapped(mesh, Wraps(modes, opened_picture(loaded.texture.data, whole=True).size))
        if cut is None:
            text = f"its picture ({' and '.join(modes)}) goes on too often: it repeats"
            self._notes.add("texture-layout", place, text)
        return cut or mesh

    def is_tagged(self, number: int | None) -> bool:
        """Whether the material's extras say its kind, as those of house.glb do."""
        return number is not None and "kind" in object_at(
            entry(self._gltf, "materials", number), "extras"
        )

    def as_bulb(self, material: Material) -> int:
        """The index of the material as one that emits."""
        return self.library.index(replace(material, kind=MaterialKind.BULB))


def _has_path(fields_json: dict[str, Any], path: str) -> bool:
    *holders, name = path.split(".")
    for holder in holders:
        fields_json = object_at(fields_json, holder)
    return name in fields_json


def _names_colour(fields_json: dict[str, Any]) -> bool:
    pbr, glossy = object_at(fields_json, "pbrMetallicRoughness"), specular_glossiness(fields_json)
    return "baseColorFactor" in pbr or "diffuseFactor" in glossy


def _encoded(linear: Any) -> tuple[float, float, float]:
    r, g, b = (float(c) for c in np.clip(srgb_from_linear(np.asarray(linear)), 0, 1))
    return (r, g, b)


def glass_materials(gltf: Gltf, numbers: Iterable[int | None]) -> frozenset[int]:
    """The glass among the materials of a window or door, by name.

    "Pane" and "Window glass" are glass, "glass frame" is not. "Window" is glass only if the piece has
    no other clear material: beside a glass it names the frame.
    """
    rows = {n: entry(gltf, "materials", n) for n in numbers if n is not None}
    words = {n: words_of(str(row.get("name", ""))) for n, row in rows.items()}
    glass = frozenset(n for n, w in words.items() if w & GLASS_WORDS and not w & FRAME_WORDS)
    if glass or any(_lets_light_through(row) for row in rows.values()):
        return glass
    panes = words_of_list("window pane")
    return frozenset(n for n, w in words.items() if w & panes and not w & FRAME_WORDS)


def material_names(gltf: Gltf, node: dict[str, Any]) -> tuple[str, ...]:
    """Names of the materials of a node's mesh; empty for a damaged one."""
    try:
        primitives = entry(gltf, "meshes", node.get("mesh")).get("primitives")
        numbers = [p.get("material") for p in primitives] if isinstance(primitives, list) else []
        rows = [entry(gltf, "materials", n) for n in numbers if n is not None]
    except (AttributeError, BadHouse):
        return ()  # reported where the mesh is read
    return tuple(str(row.get("name", ""))[:200] for row in rows)


def _lets_light_through(row: dict[str, Any]) -> bool:
    has_transmission = "KHR_materials_transmission" in object_at(row, "extensions")
    return row.get("alphaMode") == "BLEND" or has_transmission
