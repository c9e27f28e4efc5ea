"""The materials and textures of a house while it is read, each once; state: those met so far.

Pictures are converted to the conventions of a Surface: a channel, a scale, a bias, a curve.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.core.house import USUAL_CUTOFF, Material, Texture
from pbrs_farm.read.common.notes import Notes

MAX_EDGE_PX: Final = 16384
MAX_TEXTURE_PIXELS: Final = 64_000_000
_PNG: Final = "image/png"
_KEPT: Final = {"PNG": _PNG, "JPEG": "image/jpeg", "MPO": "image/jpeg"}
_TRIED: Final = ("PNG", "JPEG", "GIF", "BMP", "TIFF", "WEBP")
PANE_OPACITY: Final = 0.2  # opacity of panes and glass that the source calls opaque


class AlphaRange(NamedTuple):
    """Minimum, maximum and mean of a picture's alpha, 0..1."""

    least: float
    most: float
    mean: float


OPAQUE_ALPHA: Final = AlphaRange(1.0, 1.0, 1.0)


class LoadedTexture(NamedTuple):
    """A texture that decodes."""

    texture: Texture
    alpha: AlphaRange = OPAQUE_ALPHA

    def has_holes(self, cutoff: float = USUAL_CUTOFF) -> bool:
        """Whether its alpha is below the cutoff somewhere."""
        return self.alpha.least < cutoff


def texture_from_bytes(data: bytes, name: str) -> LoadedTexture:
    """The texture (PNG or JPEG, others become PNG) and what its alpha holds; ValueError with a reason."""
    picture = opened_picture(data)
    alpha = _alpha_range(picture)
    # Store other kinds as PNG, with alpha where it is not opaque.
    media_type = _KEPT.get(picture.format or "")
    if media_type is None:
        data, media_type = (
            _png_bytes(picture.convert("RGB" if alpha == OPAQUE_ALPHA else "RGBA")),
            _PNG,
        )
    return LoadedTexture(Texture(keys.sha256(data)[:16], name, media_type, data), alpha)


def opened_picture(data: bytes, *, whole: bool = False) -> Image.Image:
    """A decoded picture, a JPEG at an eighth of its size unless whole; ValueError with a reason."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of odd metadata in a picture that decodes
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            picture = Image.open(io.BytesIO(data), formats=_TRIED)
            width, height = picture.size
            if max(width, height) > MAX_EDGE_PX or width * height > MAX_TEXTURE_PIXELS:
                raise ValueError(f"the picture is too large: {width} x {height}")
            # Decode in full, a JPEG at an eighth: a header alone proves nothing.
            if _KEPT.get(picture.format or "") == "image/jpeg" and not whole:
                picture.draft("RGB", (max(width // 8, 1), max(height // 8, 1)))
            picture.load()
            return picture
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        raise ValueError("the picture is too large") from None
    except UnidentifiedImageError:
        raise ValueError("is not a picture of a known kind") from None
    except (OSError, SyntaxError, EOFError, IndexError, KeyError, TypeError):
        raise ValueError("the picture cannot be decoded: damaged or cut short") from None


def picture_with_alpha(
    colour: bytes | None, opacity: bytes, channel: str = "", scale: float = 1.0, bias: float = 0.0
) -> bytes:
    """PNG of a colour picture whose alpha is what another picture says: for formats that part them.

    colour: None = white. channel: "r", "g", "b" or "a" of the other picture, "l" its luminance; "" is
    its alpha where it has any, else its luminance. Its values 0..1 are multiplied by scale, then bias is added. Of
    two sizes the larger one is taken along each axis. Raises ValueError as `opened_picture` does.
    """
    values = _channel(opened_picture(opacity, whole=True), channel)
    times = np.clip(np.rint(np.arange(256) * scale + 255 * bias), 0, 255).astype(np.uint8)
    alpha = Image.fromarray(times[np.asarray(values)])
    white = Image.new("RGB", alpha.size, "white")
    picture = white if colour is None else opened_picture(colour, whole=True).convert("RGB")
    size = (max(picture.width, alpha.width), max(picture.height, alpha.height))
    picture, alpha = (p if p.size == size else p.resize(size) for p in (picture, alpha))
    picture.putalpha(alpha)
    return _png_bytes(picture)


def _channel(picture: Image.Image, channel: str) -> Image.Image:
    """One channel of a picture, 8 bits."""
    if picture.mode.startswith("I"):
        # 16 bits of grey: the upper eight.
        return Image.fromarray((np.asarray(picture) >> 8).clip(0, 255).astype(np.uint8))
    if channel == "l" or (channel == "" and not _has_alpha(picture)):
        return picture.convert("L")
    return picture.convert("RGBA").getchannel((channel or "a").upper())


def _alpha_range(picture: Image.Image) -> AlphaRange:
    if not _has_alpha(picture):
        return OPAQUE_ALPHA
    counts = np.array(picture.convert("RGBA").getchannel("A").histogram())
    values = np.flatnonzero(counts)
    mean = float(counts @ np.arange(256)) / float(counts.sum())
    return AlphaRange(float(values[0]) / 255, float(values[-1]) / 255, mean / 255)


def _has_alpha(picture: Image.Image) -> bool:
    return picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info


def _png_bytes(picture: Image.Image) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


class MaterialLibrary:
    """Numbers the materials of any format, and decodes every picture once, as they first come up."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._materials: dict[Material, int] = {}
        self._loaded: dict[str, LoadedTexture | None] = {}  # by key; None = cannot be used

    @property
    def materials(self) -> tuple[Material, ...]:
        """Every material; a Surface's material is an index into it."""
        return tuple(self._materials)

    @property
    def textures(self) -> dict[str, Texture]:
        """Textures used by a material, by id; unused loaded textures are left out."""
        used = {name for m in self._materials for name in m.texture_ids}
        loaded_textures = (loaded.texture for loaded in self._loaded.values() if loaded is not None)
        return {t.id: t for t in loaded_textures if t.id in used}

    def index(self, material: Material) -> int:
        """The index of a material, which thereby belongs to the house; the same for equal materials."""
        return self._materials.setdefault(material, len(self._materials))

    def adopted(self, other: MaterialLibrary) -> tuple[int, ...]:
        """Take in another library; entry k of the answer is the index here of its material k."""
        for loaded in other._loaded.values():
            if loaded is not None:
                self._loaded.setdefault(f"texture {loaded.texture.id}", loaded)
        return tuple(self.index(material) for material in other.materials)

    def texture(
        self, key: str, *, name: str, place: str, load: Callable[[], bytes | None]
    ) -> LoadedTexture | None:
        """Load the texture of a picture; None, with a note, if it is missing or cannot be decoded.

        key: identity of the picture, such as a path; each is loaded once. name: of the texture. place: for
        notes. load: returns the file's bytes, None for a missing file.
        """
        if key not in self._loaded:
            self._loaded[key] = self._load(key, name, place, load)
        return self._loaded[key]

    def colours_of_faces(self, rgb: NDArray[np.uint8], name: str) -> tuple[F64, str]:
        """(F, 2) coordinates in a picture of the faces' sRGB (F, 3), 4 x 4 texels each, and its id."""
        colours, of_face = np.unique(rgb, axis=0, return_inverse=True)
        side = int(np.ceil(np.sqrt(len(colours))))
        grid = np.zeros((side * side, 3), np.uint8)
        grid[: len(colours)] = colours
        picture = grid.reshape(side, side, 3).repeat(4, 0).repeat(4, 1)
        row, column = np.divmod(of_face.reshape(-1), side)
        uvs = np.stack([(column + 0.5) / side, 1 - (row + 0.5) / side], axis=1)
        loaded = texture_from_bytes(_png_bytes(Image.fromarray(picture)), f"{name}.png")
        self._loaded[f"texture {loaded.texture.id}"] = loaded
        return uvs, loaded.texture.id

    def _load(
        self, key: str, name: str, place: str, load: Callable[[], bytes | None]
    ) -> LoadedTexture | None:
        shown = key[:120]
        try:
            data = load()
        except ValueError as error:
            self._notes.add("unreadable-texture", place, f"{shown}: {error}")
            return None
        if data is None:
            self._notes.add("missing-texture", place, f"{shown} does not exist; the colour is kept")
            return None
        try:
            return texture_from_bytes(data, name)
        except ValueError as error:
            self._notes.add("unreadable-texture", place, f"{shown}: {error}")
            return None


_MEAN_PX: Final = 64  # edge to which a picture is averaged before its mean is taken in linear light
_MOST_PX: Final = 2048  # maximum edge of a picture combined from two, to bound memory
_DIELECTRIC: Final = 0.04  # reflectance of dielectrics (glTF 2.0, appendix B)


class PictureValues(NamedTuple):
    """Conversion of a picture's stored values, 0..1, to those of a surface."""

    channel: str = ""  # "r", "g", "b" or "a" takes the place of all three; "" = each its own
    decode: bool = False  # from sRGB to linear light, before scale and bias
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    encode: bool = False  # from linear light to sRGB, after them


def picture_of_values(data: bytes, values: PictureValues) -> bytes:
    """PNG of a picture with its values changed, alpha kept, or its own bytes; ValueError with a reason."""
    picture = opened_picture(data, whole=True).convert("RGBA")
    bands = picture.split()
    stored = np.arange(256) / 255
    changed = []
    for k, (scale, bias) in enumerate(zip(values.scale, values.bias, strict=True)):
        level = linear_from_srgb(stored) if values.decode else stored
        level = np.clip(level * scale + bias, 0, 1)
        level = srgb_from_linear(level) if values.encode else level
        source = bands["rgba".index(values.channel) if values.channel else k]
        changed.append(source.point([int(v) for v in np.rint(255 * level)]))
    if all(new.tobytes() == old.tobytes() for new, old in zip(changed, bands, strict=False)):
        return data
    return _png_of_rgba(Image.merge("RGBA", (*changed, bands[3])))


def picture_mean(data: bytes, *, is_colour: bool) -> F64:
    """(3,) mean of a picture's values, of a colour in linear light; ValueError with a reason."""
    rgb = _texels(data, _MEAN_PX)[..., :3]
    return np.asarray((linear_from_srgb(rgb) if is_colour else rgb).mean((0, 1)))


def base_colour_picture(
    diffuse: bytes | None, specular: bytes, diffuse_factor: F64, specular_factor: F64
) -> bytes:
    """The picture of a base colour, of pictures of diffuse and specular colour: where it is metal, its specular.

    Both in sRGB; the factors, linear, are multiplied in. diffuse: None = white. Metalness is what glTF's
    appendix to KHR_materials_pbrSpecularGlossiness solves for. Raises ValueError as
    `picture_of_values` does.
    """
    s_rgba = _texels(specular, _MOST_PX)
    d_rgba = np.ones_like(s_rgba) if diffuse is None else _texels(diffuse, _MOST_PX, size_of=s_rgba)
    d = linear_from_srgb(d_rgba[..., :3]) * diffuse_factor
    s = linear_from_srgb(s_rgba[..., :3]) * specular_factor
    # Solve for the metalness that gives both brightnesses.
    rest = 1 - s.max(-1)
    d_light, s_light = (np.sqrt((c * c) @ np.array([0.299, 0.587, 0.114])) for c in (d, s))
    b = d_light * rest / (1 - _DIELECTRIC) + s_light - 2 * _DIELECTRIC
    root = np.sqrt(np.maximum(b * b - 4 * _DIELECTRIC * (_DIELECTRIC - s_light), 0))
    metal = np.where(s_light < _DIELECTRIC, 0, np.clip((root - b) / (2 * _DIELECTRIC), 0, 1))
    # Mix the colours that either would need.
    metal, rest = metal[..., None], rest[..., None]
    of_diffuse = d * rest / (1 - _DIELECTRIC) / np.maximum(1 - metal, 1e-6)
    of_specular = (s - _DIELECTRIC * (1 - metal)) / np.maximum(metal, 1e-6)
    base = of_diffuse + (of_specular - of_diffuse) * metal**2
    rgba = np.concatenate([srgb_from_linear(np.clip(base, 0, 1)), d_rgba[..., 3:]], -1)
    return _png_of_rgba(Image.fromarray(np.rint(255 * rgba).astype(np.uint8)))


def _texels(data: bytes, most_px: int, *, size_of: F64 | None = None) -> F64:
    """(H, W, 4) values 0..1 as stored, of a picture no larger along its edges; or of another's size."""
    picture = opened_picture(data, whole=True).convert("RGBA")
    size = tuple(min(n, most_px) for n in picture.size)
    if size_of is not None:
        size = (size_of.shape[1], size_of.shape[0])
    if picture.size != size:
        picture = picture.resize((size[0], size[1]), Image.Resampling.BOX)
    return np.asarray(picture, np.float64) / 255


def _png_of_rgba(picture: Image.Image) -> bytes:
    is_opaque = picture.getchannel("A").getextrema() == (255, 255)
    buffer = io.BytesIO()
    (picture.convert("RGB") if is_opaque else picture).save(buffer, "PNG")
    return buffer.getvalue()
