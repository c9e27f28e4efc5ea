"""Materials of UsdShade -> rows of a glTF document; pictures by the path that the stage resolves.

UsdPreviewSurface, MaterialX's surfaces, OmniPBR and OmniGlass are understood; of any other MDL the first
picture of its text, of anything else a matte grey. Effect: reads such texts, through the caller.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from pxr import Sdf, UsdShade

from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.read.common.material_fields import noted_fields
from pbrs_farm.read.common.material_library import (
    PANE_OPACITY,
    PictureValues,
    picture_of_values,
    picture_with_alpha,
)
from pbrs_farm.read.common.model_materials import GREY
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.document import UNREAD
from pbrs_farm.read.usd.surface_shaders import WRAPS, SurfaceWords, is_picture, surface_of

KIND_ATTRIBUTE: Final = "pbrs:kind"
"""Of a material: how light meets it, as our own exports say."""
_PICTURE_OF_MDL: Final = re.compile(r'texture_2d\s*\(\s*"([^"]+)"')
_REPEAT: Final = 10497  # glTF's number for a picture that goes on beyond its edges
_MODES: Final = ("uaddressmode", "vaddressmode")  # of MaterialX's image nodes
_USUAL_IOR: Final = 1.5
_MOST_NODES: Final = 16  # between a surface and its picture
_MOST_FOLLOWED: Final = 1000  # maximum connections to follow per material
_FIRST_TILE: Final = "1001"  # of a picture in tiles: where u and v are within 0..1
_TRANSFORMS: Final = {
    "UsdTransform2d": ("rotation", "scale", "translation"),
    "place2d_vector2": ("rotate", "scale", "offset"),
}
_Row = dict[str, Any]


class _Masked(NamedTuple):
    """A picture made of two: the colours of one, a channel of the other as their alpha."""

    colour: Any  # Sdf.AssetPath, None = white
    opacity: Any  # Sdf.AssetPath
    channel: str  # "r", "g", "b" or "a"; "" = its alpha, or its luminance without
    scale: float
    bias: float


class _Changed(NamedTuple):
    """A picture whose stored values are changed before they are read."""

    asset: Any  # Sdf.AssetPath
    values: PictureValues

    @property
    def path(self) -> str:
        """Path of the modified picture."""
        return str(self.asset.path)


class _Picture(NamedTuple):
    """A picture as the node that reads it says."""

    info: _Row  # glTF's textureInfo
    channel: str  # output channel: "rgb", "r", "g", "b", "a", MaterialX's "out"
    scale: tuple[float, ...] = (1.0,) * 4
    bias: tuple[float, ...] = (0.0,) * 4
    space: str = ""  # "raw", "sRGB", "" = what its use means


class Shaders:
    """The materials of a stage in glTF form, each once. State: a cache."""

    def __init__(self, notes: Notes, text_of: Callable[[Any], str], time: Any) -> None:
        """text_of: the text of an asset that an MDL material names, "" where it cannot be read."""
        self._notes, self._text_of, self._time = notes, text_of, time
        self.materials: list[_Row] = []
        self.textures: list[_Row] = []
        self.samplers: list[_Row] = [{"wrapS": _REPEAT, "wrapT": _REPEAT}]
        self.images: list[_Row] = []
        self.assets: list[Any] = []  # Sdf.AssetPath, _Masked or _Changed of each image
        self._n_followed = 0  # connections of the current material
        self._n_nodes = 0  # nodes between a surface and the current node
        self._understood: dict[str, bool] = {}  # by the material's path
        self._uv_names: dict[str, str] = {}  # by the material's path
        self._uv_name = ""  # of the current material
        self._numbers: dict[str, int] = {}
        self._pictures: dict[str, int] = {}

    def number(self, material: Any) -> int | None:
        """The row of a UsdShade.Material; None for no material."""
        if not material:
            return None
        path = str(material.GetPath())
        if path not in self._numbers:
            self._numbers[path] = self._add(self._row(material))
        return self._numbers[path]

    def plain(self, rgb: tuple[float, ...]) -> int:
        """A row for a colour without a material."""
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

    def is_understood(self, material: Any) -> bool:
        """Whether a material has a surface of which more than a picture is read."""
        path = str(material.GetPath())
        if path not in self._understood:
            is_known = surface_of(material)[1] is not None or bool(_omniverse(material))
            self._understood[path] = is_known
        return self._understood[path]

    def uv_name(self, material: Any) -> str:
        """Texture coordinates of a material's first picture, "" if it names none."""
        self.number(material)
        return self._uv_names.get(str(material.GetPath()), "") if material else ""

    def _row(self, material: Any) -> _Row:
        self._uv_name, self._n_followed = "", 0
        name, place = material.GetPrim().GetName()[:100], str(material.GetPath())
        shader, words = surface_of(material)
        if words is not None:
            row = self._surface(name, shader, words)
        elif shader := material.ComputeSurfaceSource("mdl")[0] or shader:
            row = self._mdl(name, shader, place)
        else:
            self._notes.add(UNREAD, place, "has no surface shader: it is a matte grey")
            row = _grey(name)
        self._uv_names[place] = self._uv_name
        kind = material.GetPrim().GetAttribute(KIND_ATTRIBUTE).Get()
        return row | ({"extras": {"kind": str(kind)}} if kind else {})

    # UsdPreviewSurface and MaterialX

    def _surface(self, name: str, shader: Any, words: SurfaceWords) -> _Row:
        colour, picture = self._colour(shader, words.colour, (words.default_colour,) * 3)
        times = _finite(self._input(shader, words.colour_times, 1.0)[0], 1.0)
        colour = tuple(c * times for c in colour)
        roughness, rough_picture = self._input(shader, words.roughness, words.default_roughness)
        roughness = _input_number(roughness, words.default_roughness)
        metallic = _input_number(
            self._input(shader, words.metallic, words.default_metallic)[0], words.default_metallic
        )
        is_specular = bool(self._input(shader, "useSpecularWorkflow", 0)[0])
        metallic = 0.0 if is_specular else metallic
        alpha, picture, has_picture = self._opacity(shader, words.opacity, picture, name)
        row = _pbr(name, [*colour, alpha], roughness, metallic)
        pbr = row["pbrMetallicRoughness"]
        if picture is not None:
            pbr["baseColorTexture"] = picture
        if rough_picture is not None:
            factor, info = self._level(rough_picture)
            pbr |= {"metallicRoughnessTexture": info, "roughnessFactor": factor}
        normal = self._input(shader, words.normal, None)[1]
        if normal is not None:
            row["normalTexture"] = self._normal(normal)
        if alpha < 1 or has_picture:
            row |= self._alpha_mode(shader)
        self._add_glow(row, shader, words)
        passes = _input_number(self._input(shader, words.transmission, 0.0)[0], 0.0)
        index = _finite(self._input(shader, "ior", _USUAL_IOR)[0], _USUAL_IOR)
        extensions = {} if index == _USUAL_IOR else {"KHR_materials_ior": {"ior": index}}
        if passes > 0:
            extensions |= {"KHR_materials_transmission": {"transmissionFactor": passes}}
        self._note_unread(shader, is_specular=is_specular)
        return row | ({"extensions": extensions} if extensions else {})

    def _note_unread(self, shader: Any, *, is_specular: bool) -> None:
        """A note for what the shader says of its surface and is not read."""
        for name in noted_fields("USD"):
            if not name.isidentifier() or (name == "specularColor" and not is_specular):
                continue
            value, picture = self._input(shader, name, 0.0)
            if picture is not None or np.any(value):
                self._notes.add(UNREAD, str(shader.GetPath()), f"{name} is not read")

    def _add_glow(self, row: _Row, shader: Any, words: SurfaceWords) -> None:
        value, picture = self._input(shader, words.glow, None)
        if value is None and picture is None and not words.glow_times:
            return
        times = 1.0
        if words.glow_times:
            times = _finite(self._input(shader, words.glow_times, 0.0)[0], 0.0)
        glow = _triple(value, (1.0, 1.0, 1.0)) if picture is None else picture.scale[:3]
        if max(glow) > 0 and times > 0:
            row["emissiveFactor"] = [max(c, 0.0) / max(glow) for c in glow]
            if picture is not None:
                row["emissiveTexture"] = picture.info

    def _alpha_mode(self, shader: Any) -> _Row:
        """glTF's words for a surface that is not opaque: by the threshold of either family."""
        threshold = _input_number(self._input(shader, "opacityThreshold", 0.0)[0], 0.0)
        if shader.GetInput("alpha_mode"):
            mode = self._input(shader, "alpha_mode", 0)[0]
            cutoff = _input_number(self._input(shader, "alpha_cutoff", 0.5)[0], 0.5)
            return {} if mode == 0 else _alpha_mode(cutoff if mode == 1 else 0.0)
        return _alpha_mode(threshold)

    def _normal(self, picture: _Picture) -> _Row:
        """A normal map; its node's scale turns 0..1 into twice the map's own."""
        x, y = picture.scale[:2]
        if (x < 0) != (y < 0):
            # A map whose green points down: turn it over.
            values = PictureValues(scale=(1.0, -1.0, 1.0), bias=(0.0, 1.0, 0.0))
            picture = picture._replace(info=self._changed(picture.info, values))
        times = 1.0 if x == 1 else abs(x) / 2  # 1 is what a node without a scale has
        return picture.info | ({"scale": times} if times != 1 else {})

    def _colour(
        self, shader: Any, name: str, default: tuple[float, ...]
    ) -> tuple[tuple[float, ...], _Row | None]:
        value, picture = self._input(shader, name, default)
        if picture is None:
            return _triple(value, default), None
        # A picture is multiplied by what its own node says; what a factor cannot say changes the picture.
        (r, g, b), bias = picture.scale[:3], picture.bias[:3]
        is_factor = 0 <= min(r, g, b) <= max(r, g, b) <= 1 and not any(bias)
        is_raw = picture.space == "raw"
        channel = picture.channel if picture.channel in tuple("rgba") else ""
        values = PictureValues(
            channel, decode=not is_factor and not is_raw, encode=not is_factor or is_raw
        )
        if not is_factor:
            values = values._replace(scale=(r, g, b), bias=(bias[0], bias[1], bias[2]))
        return (r, g, b) if is_factor else (1.0,) * 3, self._changed(picture.info, values)

    def _level(self, picture: _Picture) -> tuple[float, _Row]:
        """(factor, picture) of one number a texel, as glTF has roughness: in green, linear."""
        k = max("rgba".find(picture.channel), 0) if picture.channel else 1
        scale, bias = picture.scale[k], picture.bias[k]
        factor = 1.0 if bias or not 0 <= scale <= 1 else scale
        values = PictureValues(
            picture.channel if picture.channel in tuple("rba") else "",
            decode=picture.space == "sRGB",
            scale=(1.0 if factor != 1 else scale,) * 3,
            bias=(bias,) * 3,
        )
        return factor, self._changed(picture.info, values)

    def _opacity(
        self, shader: Any, name: str, colour: _Row | None, place: str
    ) -> tuple[float, _Row | None, bool]:
        """(opacity, the picture of the colour with it as its alpha, whether a picture says it)."""
        value, picture = self._input(shader, name, 1.0)
        if picture is None:
            level = np.mean(_triple(value, (1.0,) * 3)) if np.ndim(value) else value
            return _input_number(level, 1.0), colour, False
        info = picture.info
        channel = picture.channel if picture.channel in tuple("rgba") else "r"
        k = "rgba".index(channel)
        scale, bias = picture.scale[k], picture.bias[k]
        if colour is not None and info.get("extensions") != colour.get("extensions"):
            text = "its opacity picture has another mapping than its colour: left out"
            self._notes.add("texture-layout", place, text)
            return 1.0, colour, False
        # The alpha of the colour's own picture is there already.
        if info == colour and channel == "a" and bias == 0 and 0 < scale <= 1:
            return scale, colour, True
        colour_asset = None if colour is None else self._asset(colour)
        mask = _Masked(colour_asset, self._asset(info), channel, scale, bias)
        return 1.0, self._with_image(colour or info, self._masked_image(mask)), True

    def _input(self, shader: Any, name: str, default: Any) -> tuple[Any, _Picture | None]:
        """(the value of an input, the picture that it is connected to or None)."""
        source = shader.GetInput(name) if name else None
        for attribute in source.GetValueProducingAttributes() if source else ():
            if UsdShade.Utils.GetType(attribute.GetName()) != UsdShade.AttributeType.Output:
                value = attribute.Get(self._time)
                return (default if value is None else value), None
            self._n_followed += 1
            if self._n_nodes >= _MOST_NODES or self._n_followed > _MOST_FOLLOWED:
                return default, None  # a cycle of nodes, or too many
            self._n_nodes += 1
            try:
                return self._followed(attribute, default)
            finally:
                self._n_nodes -= 1
        return default, None

    def _followed(self, output: Any, default: Any) -> tuple[Any, _Picture | None]:
        """Value of a node's output: its picture, a constant, else the values connected to its inputs."""
        node = UsdShade.Shader(output.GetPrim())
        kind = str(node.GetIdAttr().Get() or "") if node else ""
        channel = output.GetName().rpartition(":")[2]
        if is_picture(kind):
            fallback = self._input(node, "fallback", self._input(node, "default", None)[0])[0]
            picture = self._texture(node, channel)
            is_lost = picture is None or (fallback is not None and self._is_lost(picture))
            return (
                (default if fallback is None else fallback, None) if is_lost else (default, picture)
            )
        if kind.startswith("UsdPrimvarReader"):
            value = self._input(node, "fallback", None)[0]
            return (default if value is None else value), None
        for node_input in node.GetInputs() if node else ():
            if kind.startswith("ND_constant_"):
                return self._input(node, node_input.GetBaseName(), default)
            value, picture = self._input(node, node_input.GetBaseName(), default)
            if picture is not None:
                return value, self._through(picture, node, kind, channel)
        return default, None

    def _through(self, picture: _Picture, node: Any, kind: str, channel: str) -> _Picture:
        """A picture modified by a node between it and its surface."""
        if kind.startswith(("ND_separate", "ND_extract")):
            number = _finite(self._input(node, "index", 0)[0], 0) if "extract" in kind else None
            word = channel.removeprefix("out")[:1] if number is None else "rgba"[int(number) % 4]
            return picture._replace(channel={"x": "r", "y": "g", "z": "b"}.get(word, word))
        if not kind.startswith(("ND_normalmap", "ND_convert", "ND_dot", "ND_gltf")):
            place = str(node.GetPath())
            self._notes.add(UNREAD, place, f"{kind or 'a node'} is not read: its picture is taken")
        return picture

    def _texture(self, node: Any, channel: str = "") -> _Picture | None:
        asset = self._input(node, "file", None)[0]
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            return None
        if "<UDIM>" in asset.path:
            asset = self._first_tile(node, asset)
        words = ("wrapS", "wrapT") if node.GetInput("wrapS") or node.GetInput("wrapT") else _MODES
        wraps = [WRAPS.get(str(self._input(node, w, "")[0]), _REPEAT) for w in words]
        if any(self._input(node, w, "")[0] in ("black", "constant") for w in words):
            text = "its picture ends in black beyond its edges: its last texels are drawn there"
            self._notes.add("texture-layout", str(node.GetPath()), text)
        scale, bias = (self._input(node, name, None)[0] for name in ("scale", "bias"))
        picture = _Picture(
            self._info(asset, wraps),
            channel,
            scale=tuple(_component(scale, k, 1.0) for k in range(4)),
            bias=tuple(_component(bias, k, 0.0) for k in range(4)),
            space=self._colour_space(node),
        )
        turn = self._place_of_picture(node)
        return picture._replace(info=picture.info | {"extensions": turn}) if turn else picture

    def _colour_space(self, node: Any) -> str:
        """How a picture is encoded: "raw", "sRGB", or "" for what its use means."""
        word = str(self._input(node, "sourceColorSpace", "")[0])
        file = node.GetInput("file")
        word = word or (str(file.GetAttr().GetColorSpace()) if file else "")
        if word.startswith(("lin", "raw")) and not word.startswith("linear_to"):
            return "raw"
        return "sRGB" if word.lower().startswith("srgb") else ""

    def _place_of_picture(self, node: Any) -> dict[str, _Row]:
        """KHR_texture_transform of UsdTransform2d, or of MaterialX's nodes; {} without one."""
        st = node.GetInput("st") or node.GetInput("texcoord")
        for attribute in st.GetValueProducingAttributes() if st else ():
            turn = UsdShade.Shader(attribute.GetPrim())
            kind = str(turn.GetIdAttr().Get() or "") if turn else ""
            self._uv_name = self._uv_name or self._name_of_uvs(turn, _MOST_NODES)
            names = _TRANSFORMS.get(kind.removeprefix("ND_"))
            if names is not None:
                angle = np.radians(_finite(self._input(turn, names[0], 0.0)[0], 0.0))
                size = _pair(self._input(turn, names[1], (1, 1))[0], (1.0, 1.0))
                shift = _pair(self._input(turn, names[2], (0, 0))[0], (0.0, 0.0))
                if names[1] == "scale" and kind.startswith("ND_place2d"):
                    # MaterialX divides by the scale, and takes the offset off.
                    size = (1 / (size[0] or 1.0), 1 / (size[1] or 1.0))
                    shift = (-shift[0], -shift[1])
                return _transform(float(angle), size, shift)
        size = _pair(self._input(node, "uvtiling", (1, 1))[0], (1.0, 1.0))
        shift = _pair(self._input(node, "uvoffset", (0, 0))[0], (0.0, 0.0))
        is_plain = size == (1.0, 1.0) and shift == (0.0, 0.0)
        return {} if is_plain else _transform(0.0, size, (-shift[0], -shift[1]))

    def _name_of_uvs(self, node: Any, depth: int) -> str:
        """The primvar that the nodes before a picture read, "" where they name none."""
        if not node or not depth:
            return ""
        for name in ("varname", "geomprop"):
            if value := self._input(node, name, "")[0]:
                return str(value)
        for name in ("in", "texcoord"):
            source = node.GetInput(name)
            for attribute in source.GetValueProducingAttributes() if source else ():
                if value := self._name_of_uvs(UsdShade.Shader(attribute.GetPrim()), depth - 1):
                    return value
        return ""

    def _first_tile(self, node: Any, asset: Any) -> Any:
        """The first tile of a picture in tiles (UDIM), with a note where there are more."""
        producers = node.GetInput("file").GetValueProducingAttributes()
        stack = producers[0].GetPropertyStack(self._time) if producers else ()
        layer = stack[0].layer if stack else None
        tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layer) if layer else []
        for path, number in tiles:
            if number != _FIRST_TILE:
                continue
            if len(tiles) > 1:
                text = f"{asset.path[:80]} has {len(tiles)} tiles: {_FIRST_TILE} alone is read"
                self._notes.add("texture-layout", str(node.GetPath()), text)
            return Sdf.AssetPath(asset.path.replace("<UDIM>", number), path)
        return asset

    def _is_lost(self, picture: _Picture) -> bool:
        """True if a picture's file is missing; the note names the replacement."""
        asset = self._asset(picture.info)
        if asset.resolvedPath:
            return False
        text = f"{asset.path[:120]} does not exist: replaced by its fallback"
        self._notes.add("missing-texture", asset.path[:80], text)
        return True

    # MDL

    def _mdl(self, name: str, shader: Any, place: str) -> _Row:
        asset = shader.GetPrim().GetAttribute("info:mdl:sourceAsset").Get()
        identifier = shader.GetPrim().GetAttribute("info:mdl:sourceAsset:subIdentifier").Get()
        path = asset.path if isinstance(asset, Sdf.AssetPath) else ""
        stem = str(identifier or path.replace("\\", "/").rsplit("/", 1)[-1].removesuffix(".mdl"))
        if stem.startswith("OmniGlass"):
            colour = _triple(self._input(shader, "glass_color", (1, 1, 1))[0], (1.0, 1.0, 1.0))
            return _pbr(name, [*colour, PANE_OPACITY], 0.0, 0.0) | {"alphaMode": "BLEND"}
        if not stem.startswith("OmniPBR"):
            kind = str(shader.GetIdAttr().Get() or "")
            return self._other_mdl(name, asset, stem or kind, place)
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
        alpha = self._mdl_picture(shader, "opacity_texture") if is_on else None
        if alpha is None:
            return colour, False
        mode = self._input(shader, "opacity_mode", 1)[0]
        colour_asset = self._asset(colour) if colour else None
        # Mode 0 is the alpha; the others are means and the like of the colours.
        mask = _Masked(colour_asset, self._asset(alpha), "a" if mode == 0 else "l", 1.0, 0.0)
        return self._with_image(colour or alpha, self._masked_image(mask)), True

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
        match = _PICTURE_OF_MDL.search(self._text_of(asset))
        text = f"{stem or 'a shader'} is not read"
        if match is None:
            self._notes.add(UNREAD, place, f"{text}: the surface is a matte grey")
            return _grey(name)
        self._notes.add(UNREAD, place, f"{text}: its first picture is the colour")
        folder = (asset.resolvedPath or asset.path).replace("\\", "/").rpartition("/")[0]
        picture = Sdf.AssetPath(match[1], f"{folder}/{match[1].lstrip('./')}")
        row = _pbr(name, [1.0, 1.0, 1.0, 1.0], 0.5, 0.0)
        row["pbrMetallicRoughness"]["baseColorTexture"] = self._info(picture)
        return row

    def _info(self, asset: Any, wraps: Sequence[int] = (_REPEAT, _REPEAT)) -> _Row:
        return self._texture_of_image(self._image(_path_of(asset), asset, asset), *wraps)

    def _masked_image(self, mask: _Masked) -> int:
        parts = [_path_of(a) if a else "" for a in mask[:2]]
        return self._image(f"{parts} {mask[2:]}", mask, mask.colour or mask.opacity)

    def _changed(self, info: _Row, values: PictureValues) -> _Row:
        """The texture of a picture whose values are changed, laid as the other."""
        if values == PictureValues():
            return info
        asset = self._asset(info)
        return self._with_image(
            info, self._image(f"{_path_of(asset)} {values}", _Changed(asset, values), asset)
        )

    def _asset(self, info: _Row) -> Any:
        return self.assets[self.textures[info["index"]]["source"]]

    def _with_image(self, info: _Row, image: int) -> _Row:
        sampler = self.samplers[self.textures[info["index"]].get("sampler", 0)]
        return info | self._texture_of_image(image, sampler["wrapS"], sampler["wrapT"])

    def _texture_of_image(self, image: int, wrap_s: int, wrap_t: int) -> _Row:
        sampler = {"wrapS": wrap_s, "wrapT": wrap_t}
        if sampler not in self.samplers:
            self.samplers.append(sampler)
        row = {"source": image, "sampler": self.samplers.index(sampler)}
        if row not in self.textures:
            self.textures.append(row)
        return {"index": self.textures.index(row)}

    def _image(self, key: str, asset: Any, named: Any) -> int:
        if key not in self._pictures:
            # Pictures are named by number; their names may hold anything.
            name = named.path.replace("\\", "/").rsplit("/", 1)[-1].rstrip("]")[:100]
            self.images.append({"uri": str(len(self.assets)), "name": name or "picture"})
            self.assets.append(asset)
            self._pictures[key] = len(self.assets) - 1
        return self._pictures[key]

    def picture(self, number: int, read: Callable[[Any], bytes | None]) -> bytes | None:
        """The bytes of a picture by number (read: of an asset, or None); ValueError if two cannot be combined."""
        asset = self.assets[number]
        if not isinstance(asset, _Masked):
            return _bytes_of(asset, read)
        colour = _bytes_of(asset.colour, read) if asset.colour else None
        opacity = read(asset.opacity)
        if opacity is None and colour is not None:
            missing = f"{asset.opacity.path[:120]} does not exist: nothing is cut out"
            self._notes.add("missing-texture", f"images[{number}]", missing)
        if opacity is None or (asset.colour and colour is None):
            return colour
        return picture_with_alpha(colour, opacity, asset.channel, asset.scale, asset.bias)


def _bytes_of(asset: Any, read: Callable[[Any], bytes | None]) -> bytes | None:
    """The bytes of an asset, its values changed where they are; None where it is not there."""
    if not isinstance(asset, _Changed):
        return read(asset)
    data = read(asset.asset)
    return None if data is None else picture_of_values(data, asset.values)


def _path_of(asset: Any) -> str:
    if isinstance(asset, (_Masked, _Changed)):
        return str(asset)
    return str(asset.resolvedPath or asset.path)


def _omniverse(material: Any) -> str:
    """OmniPBR or OmniGlass, "" of other materials."""
    shader = material.ComputeSurfaceSource("mdl")[0]
    asset = shader.GetPrim().GetAttribute("info:mdl:sourceAsset").Get() if shader else None
    path = asset.path if isinstance(asset, Sdf.AssetPath) else ""
    stem = path.replace("\\", "/").rsplit("/", 1)[-1]
    return stem if stem.startswith(("OmniPBR", "OmniGlass")) else ""


def _grey(name: str) -> _Row:
    """Matte grey, for unsupported shaders."""
    return _pbr(name, [float(c) for c in (*linear_from_srgb(np.array(GREY)), 1.0)], 1.0, 0.0)


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
            "offset": [float(c) for c in offset],
            "rotation": angle,
            "scale": list(size),
        }
    }


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
        number = float(value)
    except (TypeError, ValueError):
        return default
    return number if np.isfinite(number) else default


def _triple(value: Any, default: tuple[float, ...]) -> tuple[float, ...]:
    try:
        triple = tuple(float(c) for c in value)[:3]
    except (TypeError, ValueError):
        return default
    return triple if len(triple) == 3 and np.isfinite(triple).all() else default


def _pair(value: Any, default: tuple[float, float]) -> tuple[float, float]:
    try:
        pair = tuple(float(c) for c in value)[:2]
    except (TypeError, ValueError):
        return default
    return (pair[0], pair[1]) if len(pair) == 2 and np.isfinite(pair).all() else default
