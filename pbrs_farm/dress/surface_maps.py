"""Maps of a procedural surface: colour, roughness and normals that repeat; no effects."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F32, Srgb8Image
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.core.house import Texture
from pbrs_farm.dress.noise import halved
from pbrs_farm.dress.style import Rgb
from pbrs_farm.images import jpeg_from_array

_COLOUR_QUALITY = 92
_MAP_QUALITY = 90
_RELIEF_PX = 1024  # longest edge of roughness and normal maps


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceMaps:
    """One repeat of a surface; row 0 is its upper edge, u to the right, v up."""

    colour: Srgb8Image  # (H, W, 3) uint8, sRGB-encoded, the relief's shade in it
    roughness: Srgb8Image | float  # (h, w) uint8, 255 = 1, or one value 0..1
    normal: Srgb8Image | None  # (h, w, 3) uint8, tangent space as glTF's; None = flat
    size_m: tuple[float, float]  # width and height of one repeat
    gloss: float = 0.0  # specular strength of the surface, 0 matt, 0.5 varnish or glaze

    @property
    def mean_rgb(self) -> Rgb:
        """The mean of the linear colour, what a surface's own colour is divided by to tint it."""
        table = linear_from_srgb(np.arange(256) / 255)
        # Count the bytes instead of looking each up.
        counts = [np.bincount(self.colour[..., k].reshape(-1), minlength=256) for k in range(3)]
        r, g, b = (float(table @ count) / count.sum() for count in counts)
        return (float(r), float(g), float(b))

    @property
    def mean_roughness(self) -> float:
        """The mean of the roughness, 0..1."""
        if isinstance(self.roughness, float):
            return self.roughness
        return float(self.roughness.mean()) / 255.0


def surface_maps(
    colour: F32, roughness: F32 | float, height_m: F32, size_m: tuple[float, float], gloss: float
) -> SurfaceMaps:
    """The maps of a surface: sRGB-encoded colour (H, W, 3), roughness (h, w) or one, height (H, W)."""
    rough = roughness if isinstance(roughness, float) else roughness_bytes(roughness)
    normal = normals_from_height(np.asarray(height_m, np.float32), size_m)
    return SurfaceMaps(colour_bytes(colour), rough, normal, size_m, gloss)


def colour_bytes(colour: F32) -> Srgb8Image:
    """(H, W, 3) uint8 of an sRGB-encoded colour 0..1."""
    scaled = np.clip(colour, np.float32(0), np.float32(1))
    scaled *= np.float32(255)
    scaled += np.float32(0.5)
    return scaled.astype(np.uint8)


def ramp(tone: F32, dark: Rgb, light: Rgb) -> F32:
    """(H, W, 3) colours between dark (tone 0) and light (tone 1), not clipped."""
    a, b = np.array(dark, np.float32), np.array(light, np.float32)
    return np.asarray(a + tone[..., None] * (b - a), np.float32)


def normals_from_height(height_m: F32, size_m: tuple[float, float]) -> Srgb8Image:
    """Tangent-space normals of a periodic height field in metres, uint8, at most _RELIEF_PX wide."""
    height_m = _coarse(height_m)
    rows, columns = height_m.shape
    du, dv = size_m[0] / columns, size_m[1] / rows
    slope_u = (np.roll(height_m, -1, 1) - np.roll(height_m, 1, 1)) / np.float32(2 * du)
    # Row numbers grow downwards, v upwards.
    slope_v = (np.roll(height_m, 1, 0) - np.roll(height_m, -1, 0)) / np.float32(2 * dv)
    length = np.sqrt(1.0 + slope_u**2 + slope_v**2)
    normal = np.stack([-slope_u / length, -slope_v / length, 1.0 / length], -1)
    return np.asarray((normal * 0.5 + 0.5) * 255.0 + 0.5, np.uint8)


def roughness_bytes(roughness: F32) -> Srgb8Image:
    """uint8 of a roughness 0..1 (H, W), at most _RELIEF_PX wide."""
    return np.asarray(np.clip(_coarse(roughness), 0.02, 1.0) * 255.0 + 0.5, np.uint8)


def _coarse(field: F32) -> F32:
    while max(field.shape) > _RELIEF_PX and field.shape[0] % 2 == field.shape[1] % 2 == 0:
        field = halved(field)
    return field


def texture_from_pixels(name: str, pixels: Srgb8Image, quality: int) -> Texture:
    """The pixels as a JPEG texture; its id is that of its bytes."""
    data = jpeg_from_array(pixels, quality)
    return Texture(hashlib.sha256(data).hexdigest()[:16], name, "image/jpeg", data)


def encode_maps(maps: SurfaceMaps, name: str) -> tuple[Texture, Texture | None, Texture | None]:
    """Colour, roughness and normal map as textures; the last two may be None."""
    colour = texture_from_pixels(f"{name}.jpg", maps.colour, _COLOUR_QUALITY)
    rough = normal = None
    if not isinstance(maps.roughness, float):
        rough = texture_from_pixels(f"{name}-roughness.jpg", maps.roughness, _MAP_QUALITY)
    if maps.normal is not None:
        normal = texture_from_pixels(f"{name}-normal.jpg", maps.normal, _MAP_QUALITY)
    return colour, rough, normal
