"""Convert picture values to the conventions of a Surface: a channel, a scale, a bias, a curve; no effects."""

from __future__ import annotations

import io
from typing import Final, NamedTuple

import numpy as np
from PIL import Image

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import linear_from_srgb, srgb_from_linear
from pbrs_farm.read.common.material_library import opened_picture

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
    return _png_bytes(Image.merge("RGBA", (*changed, bands[3])))


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
    return _png_bytes(Image.fromarray(np.rint(255 * rgba).astype(np.uint8)))


def _texels(data: bytes, most_px: int, *, size_of: F64 | None = None) -> F64:
    """(H, W, 4) values 0..1 as stored, of a picture no larger along its edges; or of another's size."""
    picture = opened_picture(data, whole=True).convert("RGBA")
    size = tuple(min(n, most_px) for n in picture.size)
    if size_of is not None:
        size = (size_of.shape[1], size_of.shape[0])
    if picture.size != size:
        picture = picture.resize((size[0], size[1]), Image.Resampling.BOX)
    return np.asarray(picture, np.float64) / 255


def _png_bytes(picture: Image.Image) -> bytes:
    is_opaque = picture.getchannel("A").getextrema() == (255, 255)
    buffer = io.BytesIO()
    (picture.convert("RGB") if is_opaque else picture).save(buffer, "PNG")
    return buffer.getvalue()
