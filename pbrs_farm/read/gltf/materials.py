"""Materials and textures of a glTF scene -> Material and Texture; no effects."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import triple
from pbrs_farm.core.frames import LUMINANCE, srgb_from_linear
from pbrs_farm.core.house import NOTHING_LEFT, USUAL_CUTOFF, Material, MaterialKind
from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.home.names import words_of
from pbrs_farm.read.common.material_library import (
    FRAME_WORDS,
    GLASS_WORDS,
    OPAQUE_ALPHA,
    LoadedTexture,
    MaterialLibrary,
)
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.compressed import BASISU, decoded_picture
from pbrs_farm.read.gltf.document import (
    Fetch,
    MissingFile,
    image_bytes,
    numbers,
    object_at,
    texture_layout,
    texture_slots,
)

# Reflectance of a dielectric at normal incidence, linear (glTF 2.0, appendix B).
F0: Final = 0.04

MAX_SHININESS: Final = 10_000.0  # Phong exponent; above it a lobe is a mirror's
_WINDOW: Final = frozenset(
    ("window", "fenster", "fenetre", "ventana", "finestra", "raam", "fonster", "vindu")
)


@dataclass(frozen=True, slots=True)
class Emission:
    """How a material shines."""

    luminance: float  # cd m-2; 0 = of unknown strength
    rgb_linear: tuple[float, float, float]  # largest 1
    is_coloured: bool  # the file tells that colour, also where it is white


class SceneMaterials:
    """Resolves the materials of one scene into its material library."""

    def __init__(self, gltf: Gltf, fetch: Fetch, notes: Notes) -> None:
        self._gltf = gltf
        self._fetch = fetch
        self._notes = notes
        self.library = MaterialLibrary(notes)

    def material(
        self, number: int | None, *, clear: MaterialKind
    ) -> tuple[Material, Emission | None]:
        """(materials[number], its emission or None). None: glTF's default, white.

        clear: the kind of what lets light through.
        """
        if number is None:
            return Material("default", is_default=True), None
        fields_json = entry(self._gltf, "materials", number)
        place = f"materials[{number}]"
        pbr = object_at(fields_json, "pbrMetallicRoughness")
        factor = numbers(self._gltf, pbr.get("baseColorFactor", [1] * 4), 4, f"{place}: colour")
        # The metallic-roughness factors; of a texture of them metal is not looked at.
        metallic = self._fraction(pbr, "metallicFactor", 1.0, place)
        roughness = self._fraction(pbr, "roughnessFactor", 1.0, place)
        if "metallicRoughnessTexture" in pbr:
            metallic = 0.0  # its factor only scales what this reader does not look at
        found = self._texture(pbr.get("baseColorTexture"), place)
        maps = self._maps(number, place)
        transmission = object_at(object_at(fields_json, "extensions"), "KHR_materials_transmission")
        passes = self._fraction(transmission, "transmissionFactor", 0.0, place)
        # Opacity is what blending lets through, or transmission, whichever is less.
        opacity, cutoff = self._alpha(fields_json, float(np.clip(factor[3], 0, 1)), found, place)
        opacity = min(opacity, 1.0 - passes)
        colour = np.clip(factor[:3], 0, 1)
        # Roughness to a Phong exponent: alpha = roughness^2, n = 2 / alpha^2 - 2.
        shininess = min(2.0 / max(roughness, 1e-3) ** 4 - 2.0, MAX_SHININESS)
        is_metal = metallic > 0 and found is None
        specular = F0 + (colour - F0) * metallic if shininess > 0 or is_metal else np.zeros(3)
        # What is as rough as can be and no metal is matte.
        has_coat = roughness < 1 or is_metal or "metallicRoughnessTexture" in maps
        material = Material(
            name=str(fields_json.get("name", ""))[:100],
            kind=self._kind(fields_json, clear, opacity, metallic, roughness),
            diffuse=_encoded(colour if found else colour * (1 - metallic)),
            specular=_encoded(specular),
            shininess=shininess,
            opacity=opacity,
            texture_id=found.texture.id if found else None,
            alpha_cutout=cutoff is not None,
            alpha_cutoff=USUAL_CUTOFF if cutoff is None else cutoff,
            roughness=roughness if has_coat else None,
            roughness_texture_id=maps.get("metallicRoughnessTexture"),
            normal_texture_id=maps.get("normalTexture"),
            normal_scale=self._normal_scale(fields_json, place) if "normalTexture" in maps else 1.0,
            is_default=found is None and "baseColorFactor" not in pbr,
        )
        return material, self._emission(fields_json, place)

    def _alpha(
        self, fields_json: dict[str, Any], factor: float, found: LoadedTexture | None, place: str
    ) -> tuple[float, float | None]:
        """(opacity, alpha of the picture below which it is a hole or None) by the alpha mode.

        MASK cuts out what is below its cutoff, and the rest is opaque. BLEND, which a label cannot be
        half of, cuts its picture at one half, as Cycles' passes do; a picture that is as clear all over
        makes glass of its mean.
        """
        mode = fields_json.get("alphaMode", "OPAQUE")
        alpha = found.alpha if found else OPAQUE_ALPHA
        if mode == "BLEND":
            is_even = alpha.most < USUAL_CUTOFF or alpha.least == alpha.most
            has_holes = not is_even and alpha.least < USUAL_CUTOFF
            return (factor * alpha.mean if is_even else factor), USUAL_CUTOFF if has_holes else None
        if mode != "MASK":
            return 1.0, None
        given = fields_json.get("alphaCutoff", USUAL_CUTOFF)
        (least,) = numbers(self._gltf, [given], 1, f"{place}: alphaCutoff")
        if factor * alpha.most < least:
            text = (
                f"alphaCutoff {least:g}: its alpha is nowhere more than {factor * alpha.most:.3g}"
            )
            self._notes.add("wholly-cut-out", place, f"{text}, so that nothing of it is seen")
            return 1.0, NOTHING_LEFT
        return 1.0, None if factor * alpha.least >= least else float(least) / factor

    def _maps(self, number: int, place: str) -> dict[str, str]:
        """Texture ids of the roughness and normal maps that lie as the leading texture does."""
        slots = texture_slots(self._gltf, number)
        layouts = {key: texture_layout(info) for key, info in slots.items()}
        maps: dict[str, str] = {}
        for key, info in slots.items():
            if key == "baseColorTexture":
                continue
            if layouts[key] != next(iter(layouts.values())):
                text = f"{key} lies on the surface otherwise than the first texture: left out"
                self._notes.add("texture-layout", place, text)
                continue
            found = self._texture(info, f"{place}: {key}")
            if found is not None:
                maps[key] = found.texture.id
        return maps

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
        # What extras say goes first, then opacity, then the factors.
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
        key = f"images[{source}]"
        name = str(image.get("name") or image.get("uri") or key)[:100]
        return self.library.texture(
            key,
            name=key if name.startswith("data:") else name,
            place=place,
            load=lambda: self._picture(source),
        )

    def _picture(self, source: int) -> bytes | None:
        try:
            return decoded_picture(image_bytes(self._gltf, source, self._fetch))
        except MissingFile:
            return None

    def is_tagged(self, number: int | None) -> bool:
        """Whether the material's extras say its kind, as those of house.glb do."""
        return number is not None and "kind" in object_at(
            entry(self._gltf, "materials", number), "extras"
        )

    def as_bulb(self, material: Material) -> int:
        """The index of the material as one that emits."""
        return self.library.index(replace(material, kind=MaterialKind.BULB))


def _encoded(linear: Any) -> tuple[float, float, float]:
    r, g, b = (float(c) for c in np.clip(srgb_from_linear(np.asarray(linear)), 0, 1))
    return (r, g, b)


def glass_materials(gltf: Gltf, numbers: Iterable[int | None]) -> frozenset[int]:
    """Those of a window's or door's materials that are its glass by their names.

    "Pane" and "Window glass" are, "glass frame" is not. "Window" is when nothing else of the
    piece is clear: beside a glass it names the frame.
    """
    rows = {n: entry(gltf, "materials", n) for n in numbers if n is not None}
    words = {n: words_of(str(row.get("name", ""))) for n, row in rows.items()}
    glass = frozenset(n for n, w in words.items() if w & GLASS_WORDS and not w & FRAME_WORDS)
    if glass or any(_lets_light_through(row) for row in rows.values()):
        return glass
    return frozenset(n for n, w in words.items() if w & _WINDOW and not w & FRAME_WORDS)


def _lets_light_through(row: dict[str, Any]) -> bool:
    has_transmission = "KHR_materials_transmission" in object_at(row, "extensions")
    return row.get("alphaMode") == "BLEND" or has_transmission
