"""All pictures of a house as one list of texels for the kernels; pure numpy, no effects.

A texel is 32 bits: of a colour 10 for the square root of each linear component; of
maps 11 for each of the normal's x and y, 10 for the roughness. A material's roughness map and
normal map are one list of texels, so that both cost one look-up. The texels of a picture that cuts holes
are followed by as many of its alpha, 0..255.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import House, Material
from pbrs_farm.core.normal_maps import normals_from_picture

Picture = NDArray[np.uint8]  # (H, W), (H, W, 3) or (H, W, 4), row 0 at the top
Slot = tuple[int, int, int]  # first texel, width, height
MapKey = tuple[str | None, str | None, float]  # roughness map, normal map, its scale

NORMAL_ZERO: Final = 1024  # of eleven bits: a normal's component is (bits - 1024) / 1023

_MAX_TEXTURE_PX: Final = 2048
_ROWS_AT_ONCE: Final = 64  # of a downscaled picture, to bound memory


@dataclass(frozen=True, slots=True, eq=False)
class TextureAtlas:
    """All textures in one list of texels; texel 0 belongs to none."""

    texels: NDArray[np.uint32]
    slots: dict[str, Slot]  # of colours, by texture id
    map_slots: dict[MapKey, Slot] = field(default_factory=dict)  # of maps


def map_key(material: Material) -> MapKey:
    """Which maps a material has: materials with the same ones share their texels."""
    return material.roughness_texture_id, material.normal_texture_id, material.normal_scale


def texture_atlas(
    house: House, textures: dict[str, Picture], *, with_roughness: bool = True
) -> TextureAtlas:
    """The atlas of the decoded textures that materials use, with or without roughness maps."""
    # Leave texel 0 out: a first texel of 0 means that there is no texture.
    parts: list[NDArray[np.uint32]] = [np.zeros(1, np.uint32)]
    pictures = {name: p for name, p in textures.items() if p.size}
    first = 1

    def added(texels: NDArray[np.uint32]) -> Slot:
        nonlocal first
        parts.append(texels.ravel())
        first += texels.size
        return first - texels.size, texels.shape[1], texels.shape[0]

    colours = sorted({m.texture_id for m in house.materials if m.texture_id in pictures})
    cutting = {m.texture_id for m in house.materials if m.alpha_cutout}
    slots = {}
    for name in colours:
        slots[name] = added(_packed_colours(pictures[name]))
        if name in cutting:
            added(_alpha_texels(pictures[name]))
    # Pair the maps; materials without maps need no texels.
    map_slots: dict[MapKey, Slot] = {}
    for key in dict.fromkeys(map_key(m) for m in house.materials):
        roughness = pictures.get(key[0] or "") if with_roughness else None
        normal = pictures.get(key[1] or "")
        if roughness is not None or normal is not None:
            map_slots[key] = added(_packed_maps(roughness, normal, key[2]))
    # Let go of each part once it is copied.
    texels = np.empty(first, np.uint32)
    while parts:
        part = parts.pop()
        texels[first - part.size : first] = part
        first -= part.size
    return TextureAtlas(texels, slots, map_slots)


def unpacked_colours(texels: NDArray[np.uint32]) -> F64:
    """(..., 3) linear colours of texels."""
    bits = np.stack([texels >> np.uint32(shift) & np.uint32(1023) for shift in (0, 10, 20)], -1)
    return np.asarray((bits / 1023.0) ** 2)


def unpacked_maps(texels: NDArray[np.uint32]) -> tuple[F64, F64]:
    """(unit normals (..., 3) in tangent space, roughness (...)) of texels."""
    bits = np.stack([texels & np.uint32(2047), texels >> np.uint32(11) & np.uint32(2047)], -1)
    across = (bits.astype(np.float64) - NORMAL_ZERO) / 1023.0
    z = np.sqrt(np.maximum(1 - (across**2).sum(-1), 0))
    return np.concatenate([across, z[..., None]], -1), (texels >> np.uint32(22)) / 1023.0


def _packed_colours(picture: Picture) -> NDArray[np.uint32]:
    """(H, W) uint32 texels of a colour picture, as TextureAtlas packs them."""
    # Take grey pictures as three equal components.
    if picture.ndim == 2:
        picture = picture[..., None]
    rgb = picture[..., :3] if picture.shape[-1] >= 3 else np.repeat(picture[..., :1], 3, -1)
    # Encode by the square root of linear light.
    linear = linear_from_srgb(np.arange(256) / 255)
    if _reduction_of(picture) > 1:
        small = _shrunk(rgb, linear.astype(np.float32))
        bits = np.round(np.sqrt(small) * 1023).astype(np.uint32)
        packed = bits[..., 0] | bits[..., 1] << np.uint32(10) | bits[..., 2] << np.uint32(20)
    else:
        # Look each channel up where its bits belong.
        of_byte = np.round(np.sqrt(linear) * 1023).astype(np.uint32)
        packed = of_byte.take(rgb[..., 0])
        for k in (1, 2):
            packed |= (of_byte << np.uint32(10 * k)).take(rgb[..., k])
    return np.asarray(packed, np.uint32)


def _alpha_texels(picture: Picture) -> NDArray[np.uint32]:
    """(H, W) uint32 alpha of a picture, of the size of its colours; 255 of one without."""
    has_alpha = picture.ndim == 3 and picture.shape[2] == 4
    alpha = picture[..., 3:] if has_alpha else np.full((*picture.shape[:2], 1), 255, np.uint8)
    return _round_to_uint(_shrunk(alpha, np.arange(256, dtype=np.float32))[..., 0])


def _packed_maps(
    roughness: Picture | None, normal: Picture | None, scale: float
) -> NDArray[np.uint32]:
    """(H, W) uint32 texels of a roughness map and a normal map, of the larger one's size."""
    # Average vectors and roughness linearly: neither is an sRGB colour.
    plain = np.arange(256, dtype=np.float32)
    rough = np.full((1, 1, 1), 255, np.float32)
    if roughness is not None:
        channel = roughness[..., None] if roughness.ndim == 2 else roughness[..., 1:2]
        rough = _shrunk(channel, plain)
    bent = np.full((1, 1, 3), (0, 0, 1), np.float32)
    if normal is not None and normal.ndim == 3 and normal.shape[2] >= 3:
        bent = normals_from_picture(_shrunk(normal[..., :3], plain), scale)
    # Bring both to one size, and pack.
    height, width = np.maximum(rough.shape[:2], bent.shape[:2])
    rough, bent = _resize_repeating(rough, height, width), _resize_repeating(bent, height, width)
    length = np.sqrt(np.maximum(np.einsum("ijk,ijk->ij", bent, bent), 1e-12))
    x, y = (
        _round_to_uint(bent[..., k] / length * np.float32(1023) + NORMAL_ZERO) for k in range(2)
    )
    r = _round_to_uint(np.clip(rough[..., 0], 0, 255) * np.float32(1023 / 255))
    packed: NDArray[np.uint32] = x | y << np.uint32(11) | r << np.uint32(22)
    return packed


def _round_to_uint(values: F32) -> NDArray[np.uint32]:
    return (values + np.float32(0.5)).astype(np.uint32)


def _reduction_of(picture: Picture) -> int:
    return int(-(-max(picture.shape[:2]) // _MAX_TEXTURE_PX))


def _shrunk(picture: Picture, value_of_byte: F32) -> F32:
    """(H, W, C) values of the bytes, averaged over blocks where the picture is too large."""
    step = _reduction_of(picture)
    if step == 1:
        return value_of_byte[picture]
    height, width = (-(-n // step) for n in picture.shape[:2])
    rows, columns = _edges(picture.shape[0], height), _edges(picture.shape[1], width)
    small = np.empty((height, width, picture.shape[2]), np.float32)
    for first in range(0, height, _ROWS_AT_ONCE):
        # Sum the rows, then the columns of each block, and divide by the pixels in it.
        edges = rows[first : first + _ROWS_AT_ONCE + 1]
        values = value_of_byte[picture[edges[0] : edges[-1]]]
        sums = np.add.reduceat(values, edges[:-1] - edges[0], axis=0)
        sums = np.add.reduceat(sums, columns[:-1], axis=1)
        pixels = np.diff(edges)[:, None] * np.diff(columns)
        small[first : first + len(sums)] = sums / pixels[..., None]
    return small


def _edges(n: int, parts: int) -> I32:
    return np.round(np.linspace(0, n, parts + 1)).astype(np.int32)


def _resize_repeating(values: F32, height: int, width: int) -> F32:
    """(height, width, C) values between the four nearest, repeating."""
    for axis, n in ((0, height), (1, width)):
        old = values.shape[axis]
        if old == n:
            continue
        # Place centres at half integers.
        positions = (np.arange(n) + 0.5) * old / n - 0.5
        low = np.floor(positions)
        shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
        t = (positions - low).astype(np.float32).reshape(shape)
        index = low.astype(np.int64)
        a, b = np.take(values, index % old, axis), np.take(values, (index + 1) % old, axis)
        values = a * (1 - t) + b * t
    return values
