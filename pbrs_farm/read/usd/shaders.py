"""Materials of UsdShade -> rows of a glTF document; pictures by the path that the stage resolves.

UsdPreviewSurface, OmniPBR and OmniGlass are understood; of any other MDL the first picture of its
text. Effect: reads such texts, through the caller.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from pxr import Sdf, UsdShade

from pbrs_farm.read.common.material_library import PANE_OPACITY, picture_with_alpha
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.document import UNREAD

KIND_ATTRIBUTE: Final = "pbrs:kind"
"""Of a material: how light meets it, as our own exports say."""
_PICTURE_OF_MDL: Final = re.compile(r'texture_2d\s*\(\s*"([^"]+)"')
_Row = dict[str, Any]


class _Masked(NamedTuple):
    """A picture made of two: the colours of one, a channel of the other as their alpha."""

    colour: Any  # Sdf.AssetPath, None = white
    opacity: Any  # Sdf.AssetPath
    channel: str  # "r", "g", "b" or "a"; "" = its alpha, or its luminance without
    scale: float
    bias: float


class Shaders:
    """The materials of a stage as glTF has them, each once. State: what was asked for."""

    def __init__(self, notes: Notes, text_of: Callable[[Any], str], time: Any) -> None:
        """text_of: the text of an asset that an MDL material names, "" where it cannot be read."""
        self._notes, self._text_of, self._time = notes, text_of, time
        self.materials: list[_Row] = []
        self.textures: list[_Row] = []
        self.images: list[_Row] = []
        self.assets: list[Any] = []  # Sdf.AssetPath or _Masked of each image
        self._numbers: dict[str, int] = {}
        self._pictures: dict[str, int] = {}

    def number(self, material: Any) -> int | None:
        """The row of a UsdShade.Material, None of none."""
        if not material:
            return None
        path = str(material.GetPath())
        if path not in self._numbers:
            self._numbers[path] = self._add(self._row(material))
        return self._numbers[path]

    def plain(self, rgb: tuple[float, ...]) -> int:
        """A row for what has a colour and no material."""
        key = f"colour {rgb}"
        if key not in self._numbers:
            self._numbers[key] = self._add(_pbr("", [*rgb, 1.0], 1.0, 0.0))
        return self._numbers[key]

    def shining(self, rgb: tuple[float, ...]) -> int:
        """A row for the surface of a light."""
        key = f"light {rgb}"
        if key not in self._numbers:
            self._numbers[key] = self._add(
                {"name": "light", "emissiveFactor": [float(c) for c in rgb]}
            )
        return self._numbers[key]

    def _add(self, row: _Row) -> int:
        self.materials.append(row)
        return len(self.materials) - 1

    def _row(self, material: Any) -> _Row:
        name = material.GetPrim().GetName()[:100]
        shader = material.ComputeSurfaceSource()[0]
        kind = str(shader.GetIdAttr().Get() or "") if shader else ""
        if kind == "UsdPreviewSurface":
            row = self._preview(name, shader)
        elif shader := material.ComputeSurfaceSource("mdl")[0] or shader:
            row = self._mdl(name, shader, str(material.GetPath()))
        else:
            row = {"name": name}
        given = material.GetPrim().GetAttribute(KIND_ATTRIBUTE).Get()
        return row | ({"extras": {"kind": str(given)}} if given else {})

    # UsdPreviewSurface

    def _preview(self, name: str, shader: Any) -> _Row:
        colour, picture = self._colour(shader, "diffuseColor", (0.18, 0.18, 0.18))
        roughness, rough_picture = self._input(shader, "roughness", 0.5)
        metallic = _input_number(self._input(shader, "metallic", 0.0)[0], 0.0)
        threshold = _input_number(self._input(shader, "opacityThreshold", 0.0)[0], 0.0)
        alpha, picture, has_picture = self._opacity(shader, picture, name)
        row = _pbr(name, [*colour, alpha], _input_number(roughness, 0.5), metallic)
        pbr = row["pbrMetallicRoughness"]
        if picture is not None:
            pbr["baseColorTexture"] = picture
        if rough_picture is not None:
            times = _input_number((rough_picture.pop("scale_rgb", None) or (1.0,))[0], 1.0)
            pbr |= {"metallicRoughnessTexture": rough_picture, "roughnessFactor": times}
        normal = self._input(shader, "normal", None)[1]
        if normal is not None:
            # The node's scale turns 0..1 into twice the map's own.
            times = _finite((normal.pop("scale_rgb", None) or (2.0,))[0], 2.0) / 2
            row["normalTexture"] = normal | ({"scale": times} if times != 1 else {})
        if alpha < 1 or has_picture:
            row |= _alpha_mode(threshold)
        glow = _triple(self._input(shader, "emissiveColor", (0, 0, 0))[0], (0.0, 0.0, 0.0))
        if max(glow) > 0:
            row["emissiveFactor"] = [c / max(glow) for c in glow]
        return row

    def _colour(
        self, shader: Any, name: str, default: tuple[float, ...]
    ) -> tuple[tuple[float, ...], _Row | None]:
        value, picture = self._input(shader, name, default)
        if picture is not None:
            # A picture is multiplied by what its own node says.
            return _triple(picture.pop("scale_rgb", None), (1.0, 1.0, 1.0)), picture
        return _triple(value, default), None

    def _opacity(
        self, shader: Any, colour: _Row | None, place: str
    ) -> tuple[float, _Row | None, bool]:
        """(opacity, the picture of the colour with it as its alpha, whether a picture says it)."""
        found = shader.GetInput("opacity")
        node, channel = self._node(found) if found else (None, "")
        if node is None:
            return _input_number(self._input(shader, "opacity", 1.0)[0], 1.0), colour, False
        own = self._texture(node)
        if own is None:
            return 1.0, colour, False
        own.pop("scale_rgb", None)
        k = "rgba".index(channel)
        scale = _component(self._input(node, "scale", None)[0], k, 1.0)
        bias = _component(self._input(node, "bias", None)[0], k, 0.0)
        if colour is not None and own.get("extensions") != colour.get("extensions"):
            text = "the picture of its opacity lies otherwise than that of its colour: left out"
            self._notes.add("texture-layout", place, text)
            return 1.0, colour, False
        # The alpha of the colour's own picture is there already.
        if own == colour and channel == "a" and bias == 0 and 0 < scale <= 1:
            return scale, colour, True
        colour_asset = self.assets[colour["index"]] if colour else None
        mask = _Masked(colour_asset, self.assets[own["index"]], channel, scale, bias)
        return 1.0, (colour or own) | {"index": self._masked_index(mask)}, True

    def _node(self, connected: Any) -> tuple[Any, str]:
        """(the UsdUVTexture that an input is connected to or None, the channel of it)."""
        for attribute in connected.GetValueProducingAttributes():
            node = UsdShade.Shader(attribute.GetPrim())
            if node and node.GetIdAttr().Get() == "UsdUVTexture":
                channel = attribute.GetName().rpartition(":")[2]
                return node, channel if channel in tuple("rgba") else "r"
        return None, ""

    def _input(self, shader: Any, name: str, default: Any) -> tuple[Any, _Row | None]:
        """(the value of an input, the picture that it is connected to or None)."""
        found = shader.GetInput(name)
        for attribute in found.GetValueProducingAttributes() if found else ():
            if UsdShade.Utils.GetType(attribute.GetName()) != UsdShade.AttributeType.Output:
                value = attribute.Get(self._time)
                return (default if value is None else value), None
            node = UsdShade.Shader(attribute.GetPrim())
            if node.GetIdAttr().Get() == "UsdUVTexture":
                return default, self._texture(node)
        return default, None

    def _texture(self, node: Any) -> _Row | None:
        asset = self._input(node, "file", None)[0]
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            return None
        info = self._info(asset)
        scale = self._input(node, "scale", None)[0]
        if scale is not None and len(scale) == 4 and not np.allclose(list(scale)[:3], 1):
            info["scale_rgb"] = tuple(scale)[:3]
        st = node.GetInput("st")
        for attribute in st.GetValueProducingAttributes() if st else ():
            turn = UsdShade.Shader(attribute.GetPrim())
            if turn.GetIdAttr().Get() == "UsdTransform2d":
                angle = np.radians(_finite(self._input(turn, "rotation", 0.0)[0], 0.0))
                size = _pair(self._input(turn, "scale", (1, 1))[0], (1.0, 1.0))
                shift = _pair(self._input(turn, "translation", (0, 0))[0], (0.0, 0.0))
                info["extensions"] = _transform(float(angle), size, shift)
        return info

    # MDL

    def _mdl(self, name: str, shader: Any, place: str) -> _Row:
        asset = shader.GetPrim().GetAttribute("info:mdl:sourceAsset").Get()
        given = shader.GetPrim().GetAttribute("info:mdl:sourceAsset:subIdentifier").Get()
        path = asset.path if isinstance(asset, Sdf.AssetPath) else ""
        stem = str(given or path.replace("\\", "/").rsplit("/", 1)[-1].removesuffix(".mdl"))
        if stem.startswith("OmniGlass"):
            colour = _triple(self._input(shader, "glass_color", (1, 1, 1))[0], (1.0, 1.0, 1.0))
            return _pbr(name, [*colour, PANE_OPACITY], 0.0, 0.0) | {"alphaMode": "BLEND"}
        if not stem.startswith("OmniPBR"):
            return self._other_mdl(name, asset, stem, place)
        colour = _triple(self._input(shader, "diffuse_color_constant", None)[0], (0.2, 0.2, 0.2))
        tint = np.array(_triple(self._input(shader, "diffuse_tint", None)[0], (1.0, 1.0, 1.0)))
        picture = self._mdl_picture(shader, "diffuse_texture")
        factor = (tint if picture else tint * np.array(colour)).tolist()
        alpha, threshold, has_picture = 1.0, 0.0, False
        if self._input(shader, "enable_opacity", False)[0]:
            alpha = _input_number(self._input(shader, "opacity_constant", 1.0)[0], 1.0)
            threshold = _input_number(self._input(shader, "opacity_threshold", 0.0)[0], 0.0)
            picture, has_picture = self._mdl_opacity(shader, picture)
        roughness = _input_number(self._input(shader, "reflection_roughness_constant", 0.5)[0], 0.5)
        metallic = _input_number(self._input(shader, "metallic_constant", 0.0)[0], 0.0)
        row = _pbr(name, [*factor, alpha], roughness, metallic)
        pbr = row["pbrMetallicRoughness"]
        if alpha < 1 or has_picture:
            row |= _alpha_mode(threshold)
        if picture:
            pbr["baseColorTexture"] = picture
        if normal := self._mdl_picture(shader, "normalmap_texture"):
            row["normalTexture"] = normal
        packed = self._input(shader, "enable_ORM_texture", True)[0]
        rough = self._mdl_picture(shader, "ORM_texture") if packed else None
        if rough := rough or self._mdl_picture(shader, "reflectionroughness_texture"):
            pbr |= {"metallicRoughnessTexture": rough, "roughnessFactor": 1.0}
        if self._input(shader, "enable_emission", False)[0]:
            glow = _triple(self._input(shader, "emissive_color", None)[0], (1.0, 0.1, 0.1))
            if max(glow) > 0:
                row["emissiveFactor"] = [c / max(glow) for c in glow]
        return row

    def _mdl_opacity(self, shader: Any, colour: _Row | None) -> tuple[_Row | None, bool]:
        """(the picture of the colour with opacity as its alpha, whether a picture says it)."""
        is_on = self._input(shader, "enable_opacity_texture", False)[0]
        own = self._mdl_picture(shader, "opacity_texture") if is_on else None
        if own is None:
            return colour, False
        mode = self._input(shader, "opacity_mode", 1)[0]
        colour_asset = self.assets[colour["index"]] if colour else None
        # Mode 0 is the alpha; the others are means and the like of the colours.
        mask = _Masked(colour_asset, self.assets[own["index"]], "a" if mode == 0 else "l", 1.0, 0.0)
        return (colour or own) | {"index": self._masked_index(mask)}, True

    def _mdl_picture(self, shader: Any, name: str) -> _Row | None:
        asset = self._input(shader, name, None)[0]
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            return None
        size = _pair(self._input(shader, "texture_scale", None)[0], (1.0, 1.0))
        shift = _pair(self._input(shader, "texture_translate", None)[0], (0.0, 0.0))
        is_plain = size == (1.0, 1.0) and shift == (0.0, 0.0)
        turn = {} if is_plain else {"extensions": _transform(0.0, size, shift)}
        return self._info(asset) | turn

    def _other_mdl(self, name: str, asset: Any, stem: str, place: str) -> _Row:
        found = _PICTURE_OF_MDL.search(self._text_of(asset))
        text = f"{stem or 'a shader'} is not read"
        if found is None:
            self._notes.add(UNREAD, place, f"{text}: the surface stays plain")
            return {"name": name}
        self._notes.add(UNREAD, place, f"{text}: its first picture is the colour")
        folder = (asset.resolvedPath or asset.path).replace("\\", "/").rpartition("/")[0]
        picture = Sdf.AssetPath(found[1], f"{folder}/{found[1].lstrip('./')}")
        row = _pbr(name, [1.0, 1.0, 1.0, 1.0], 0.5, 0.0)
        row["pbrMetallicRoughness"]["baseColorTexture"] = self._info(picture)
        return row

    def _info(self, asset: Any) -> _Row:
        return {"index": self._picture_index(str(asset.resolvedPath or asset.path), asset, asset)}

    def _masked_index(self, mask: _Masked) -> int:
        parts = [str(a.resolvedPath or a.path) if a else "" for a in mask[:2]]
        return self._picture_index(f"{parts} {mask[2:]}", mask, mask.colour or mask.opacity)

    def _picture_index(self, key: str, asset: Any, named: Any) -> int:
        if key not in self._pictures:
            # Pictures are named by number; their names may hold anything.
            name = named.path.replace("\\", "/").rsplit("/", 1)[-1].rstrip("]")[:100]
            self.images.append({"uri": str(len(self.assets)), "name": name or "picture"})
            self.textures.append({"source": len(self.assets)})
            self.assets.append(asset)
            self._pictures[key] = len(self.assets) - 1
        return self._pictures[key]

    def picture(self, number: int, read: Callable[[Any], bytes | None]) -> bytes | None:
        """The bytes of a picture by its number; read: those of an asset, None where it is not there.

        Raises ValueError with the reason where a picture that has to be made of two cannot be.
        """
        asset = self.assets[number]
        if not isinstance(asset, _Masked):
            return read(asset)
        colour = read(asset.colour) if asset.colour else None
        opacity = read(asset.opacity)
        if opacity is None and colour is not None:
            missing = f"{asset.opacity.path[:120]} does not exist: nothing is cut out"
            self._notes.add("missing-texture", f"images[{number}]", missing)
        if opacity is None or (asset.colour and colour is None):
            return colour
        return picture_with_alpha(colour, opacity, asset.channel, asset.scale, asset.bias)


def _pbr(name: str, factor: list[float], roughness: float, metallic: float) -> _Row:
    values = [float(np.clip(c, 0, 1)) if np.isfinite(c) else 1.0 for c in factor]
    pbr = {"baseColorFactor": values, "roughnessFactor": roughness, "metallicFactor": metallic}
    return {"name": name, "pbrMetallicRoughness": pbr}


def _transform(
    angle: float, size: tuple[float, float], shift: tuple[float, float]
) -> dict[str, _Row]:
    """UsdTransform2d, which measures v upwards, as KHR_texture_transform, which does downwards."""
    cos, sin = np.cos(angle), np.sin(angle)
    # Where (u, v down) = (0, 1), the upward origin, goes to; less what the scale makes of it.
    turned = np.array([[cos, -sin], [sin, cos]]) @ np.array([0.0, -size[1]])
    offset = np.array([shift[0], 1 - shift[1]]) - turned * [1, -1]
    return {
        "KHR_texture_transform": {
            "offset": [float(c) for c in offset], "rotation": angle, "scale": list(size),
        }
    }  # fmt: skip


def _alpha_mode(threshold: float) -> _Row:
    return (
        {"alphaMode": "MASK", "alphaCutoff": threshold} if threshold > 0 else {"alphaMode": "BLEND"}
    )


def _component(values: Any, k: int, default: float) -> float:
    """Number k of four, as a node's scale and bias are."""
    return _finite(values[k], default) if values is not None and len(values) == 4 else default


def _input_number(value: Any, default: float) -> float:
    return float(np.clip(_finite(value, default), 0, 1))


def _finite(value: Any, default: float) -> float:
    try:
        found = float(value)
    except (TypeError, ValueError):
        return default
    return found if np.isfinite(found) else default


def _triple(value: Any, default: tuple[float, ...]) -> tuple[float, ...]:
    try:
        found = tuple(float(c) for c in value)[:3]
    except (TypeError, ValueError):
        return default
    return found if len(found) == 3 and np.isfinite(found).all() else default


def _pair(value: Any, default: tuple[float, float]) -> tuple[float, float]:
    try:
        found = tuple(float(c) for c in value)[:2]
    except (TypeError, ValueError):
        return default
    return (found[0], found[1]) if len(found) == 2 and np.isfinite(found).all() else default
