"""Quads and textures of the outdoors, by item and material; no effects.

Light takes these surfaces as both-sided and matte; a material whose name begins with LIT shines by
itself (core/house.py).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from pbrs_farm.core.arrays import F32, F64
from pbrs_farm.core.frames import srgb_from_linear
from pbrs_farm.core.house import LIT, OUTSIDE, Item, ItemKind, Material, Surface, Texture
from pbrs_farm.core.mesh import faces_with_area, triangle_corners
from pbrs_farm.dress.noise import noise
from pbrs_farm.dress.surface_maps import colour_bytes, texture_from_pixels
from pbrs_farm.geometry.plan_surfaces import horizontal
from pbrs_farm.geometry.solids import quads_surface
from pbrs_farm.images import png_from_array

Rgb = tuple[float, float, float]

_QUALITY: Final = 85  # JPEG quality
_TABLE: Final = (1 << 14) - 1  # steps of linear light, finer than bytes of sRGB

T = TypeVar("T")


class Drawn(Generic[T]):
    """Looks drawn on request, each by its seed."""

    def __init__(self, seed: int, n: int, draw: Callable[[np.random.Generator, int], T]) -> None:
        """draw: of number k, 0 to n - 1, with the generator of its seed."""
        self._seed, self._n, self._draw = seed, n, draw
        self._found: dict[int, T] = {}

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, k: int) -> T:
        if k not in self._found:
            self._found[k] = self._draw(np.random.default_rng([self._seed, k]), k)
        return self._found[k]


class SceneryMaterial(NamedTuple):
    """A material of the outside: its colour or picture, and how many metres the picture covers."""

    name: str
    rgb: Rgb = (1.0, 1.0, 1.0)  # sRGB-encoded, times the picture
    picture: F32 | None = None  # (H, W, 3) linear, with alpha (H, W, 4) of leaves with holes
    size_m: tuple[float, float] = (1.0, 1.0)
    is_glossy: bool = False  # a clear coat mirrors the sky


class Scenery:
    """Quads by item and look, which become items in the end."""

    def __init__(self) -> None:
        self._looks: dict[str, SceneryMaterial] = {}
        self._quads: dict[str, dict[str, list[tuple[F64, F64 | None]]]] = {}
        self._level: dict[str, list[tuple[str, Surface]]] = {}

    def add(self, thing: str, look: SceneryMaterial, quads: F64, uvs: F64 | None = None) -> None:
        """Add quads (N, 4, 3) in the world; uvs (N, 4, 2), without them metres over the look's size."""
        quads = np.asarray(quads, np.float64).reshape(-1, 4, 3)
        if len(quads):
            self._looks.setdefault(look.name, look)
            self._quads.setdefault(thing, {}).setdefault(look.name, []).append((quads, uvs))

    def lay(self, thing: str, look: SceneryMaterial, area: BaseGeometry, y: float) -> None:
        """Add the polygons of a plan area at a height, to be seen from above."""
        polygons = [
            p for p in shapely.get_parts(area) if p.geom_type == "Polygon" and p.area > 0.01
        ]
        if not polygons:
            return
        rings = [
            [shapely.get_coordinates(r)[:-1] for r in (p.exterior, *p.interiors)] for p in polygons
        ]
        self._looks.setdefault(look.name, look)
        surface = horizontal(look.name, rings, y, 0, up=True)
        assert surface.uvs is not None
        surface = replace(surface, uvs=(surface.uvs / np.array(look.size_m)).astype(np.float32))
        self._level.setdefault(thing, []).append((look.name, surface))

    def keep_off(self, area: BaseGeometry, by_m: float) -> None:
        """Take out quads that reach within by_m of a plan area: leaves of a tree that leans to it."""
        shapely.prepare(area)
        for looks in self._quads.values():
            for rows in looks.values():
                for k, (quads, uvs) in enumerate(rows):
                    off = shapely.distance(area, shapely.multipoints(quads[:, :, [0, 2]])) > by_m
                    rows[k] = quads[off], None if uvs is None else uvs[off]

    @property
    def n_faces(self) -> int:
        """Triangles of all items."""
        quads = (q for looks in self._quads.values() for rows in looks.values() for q, _ in rows)
        level = (surface for rows in self._level.values() for _name, surface in rows)
        return sum(2 * len(q) for q in quads) + sum(len(s.faces) for s in level)

    def items(
        self, level_id: str, first_material: int
    ) -> tuple[list[Item], list[Material], dict[str, Texture]]:
        """The items, and the materials and pictures that the house is to have beside its own."""
        materials: list[Material] = []
        textures: dict[str, Texture] = {}
        index: dict[str, int] = {}
        pictures: dict[int, Texture] = {}
        for look in self._looks.values():
            texture = None
            if look.picture is not None:
                # Plants of a kind share a picture.
                texture = pictures.get(id(look.picture)) or _texture(look.name, look.picture)
                textures[texture.id] = pictures[id(look.picture)] = texture
            index[look.name] = first_material + len(materials)
            gloss = {"specular": (0.5, 0.5, 0.5), "shininess": 2000.0} if look.is_glossy else {}
            materials.append(
                Material(
                    look.name,
                    diffuse=look.rgb,
                    texture_id=texture.id if texture else None,
                    alpha_cutout=look.picture is not None and look.picture.shape[2] == 4,
                    **gloss,  # type: ignore[arg-type]
                )
            )
        items = []
        for thing in dict.fromkeys((*self._level, *self._quads)):
            surfaces = [replace(s, material=index[name]) for name, s in self._level.get(thing, [])]
            surfaces += [
                _surface_of_quads(self._looks[name], rows, index[name])
                for name, rows in self._quads.get(thing, {}).items()
            ]
            items.append(
                Item(
                    id=f"{OUTSIDE}_{thing}",
                    name=thing.replace("_", " "),
                    kind=ItemKind.GROUND,
                    level_id=level_id,
                    surfaces=tuple(surfaces),
                    source_class=OUTSIDE,
                    tags=(OUTSIDE,),
                )
            )
        return items, materials, textures


class Site(NamedTuple):
    """An item of the outdoors under construction, and the source of its draws."""

    scenery: Scenery
    item: str
    rng: np.random.Generator

    def add(self, look: SceneryMaterial, quads: F64, uvs: F64 | None = None) -> None:
        """Add quads as `Scenery.add` does."""
        self.scenery.add(self.item, look, quads, uvs)


@cache
def _bytes() -> NDArray[np.uint8]:
    """(_TABLE + 1,) sRGB-encoded bytes of linear 0..1."""
    return colour_bytes(srgb_from_linear(np.arange(_TABLE + 1) / _TABLE).astype(np.float32))


def _texture(name: str, picture: F32) -> Texture:
    """A linear picture as a JPEG, one with alpha as a PNG."""
    pixels = _bytes()[(np.clip(picture[..., :3], 0, 1) * _TABLE).astype(np.uint16)]
    if picture.shape[2] == 3:
        return texture_from_pixels(name, pixels, _QUALITY)
    alpha = np.uint8(255) * (picture[..., 3:] > 0.5)
    data = png_from_array(np.concatenate([pixels, alpha], -1))
    return Texture(hashlib.sha256(data).hexdigest()[:16], name, "image/png", data)


def _surface_of_quads(
    look: SceneryMaterial, rows: list[tuple[F64, F64 | None]], material: int
) -> Surface:
    surface = quads_surface(look.name, np.concatenate([q for q, _ in rows]), material)
    assert surface.uvs is not None
    uv = surface.uvs.reshape(-1, 4, 2) / np.array(look.size_m, np.float32)
    start = 0
    for quads, uvs in rows:
        if uvs is not None:
            uv[start : start + len(quads)] = uvs
        start += len(quads)
    # A quad of three corners has one triangle without an area.
    faces = surface.faces[faces_with_area(triangle_corners(surface.positions, surface.faces), 1e-6)]
    return Surface(
        surface.name, surface.positions, faces, material, uv.reshape(-1, 2).astype(np.float32)
    )


def mottled(
    rng: np.random.Generator, dark: Rgb, light: Rgb, *, size: int = 128, slope: float = 1.4
) -> F32:
    """(size, size, 3) linear: two colours in clouds and grains."""
    tone = (
        0.5
        + 0.22 * noise(rng, (size, size), slope=slope)
        + 0.12 * noise(rng, (size, size), slope=0.2)
    )
    tone = np.clip(tone, 0, 1)[..., None]
    return np.asarray(np.array(dark) * (1 - tone) + np.array(light) * tone, np.float32)


def grass(rng: np.random.Generator) -> F32:
    """(384, 384, 3) linear: a lawn, fresh in patches and dry in others, with blades and tufts.

    Real lawns reflect .05 to .25 of light, green a quarter more than red and twice as much as blue.
    """
    shape = (384, 384)
    patches = noise(rng, shape, slope=2.6, band=(2.0, 1e9))
    dry = np.clip(rng.uniform(0.05, 0.4) + 0.28 * patches, 0, 1)[..., None]
    fresh = np.clip(0.55 + 0.3 * noise(rng, shape, slope=1.6), 0, 1)[..., None]
    green = np.array([0.062, 0.084, 0.036]) * (1 - fresh) + np.array([0.120, 0.145, 0.066]) * fresh
    picture = green * (1 - dry) + np.array([0.190, 0.172, 0.108]) * dry
    tone = (
        1
        + 0.22 * noise(rng, shape, slope=0.3)
        + 0.14 * noise(rng, shape, slope=1.0, band=(30, 1e9))
    )
    stripes = 0.05 * np.sign(np.sin(2 * np.pi * 8 * np.arange(384) / 384)) * (rng.random() < 0.4)
    tone += stripes[:, None]
    return np.asarray(
        rng.uniform(0.85, 1.15) * picture * np.clip(tone, 0.3, 1.9)[..., None], np.float32
    )


def paved(rng: np.random.Generator, rgb: Rgb, n: int) -> F32:
    """(192, 192, 3) linear: n by n slabs with joints."""
    picture = mottled(rng, tuple(0.85 * c for c in rgb), rgb, size=192)  # type: ignore[arg-type]
    step = 192 // n
    for row in range(n):
        for column in range(n):
            slab = picture[row * step : (row + 1) * step, column * step : (column + 1) * step]
            slab *= rng.uniform(0.88, 1.08)
            slab[:2], slab[:, :2] = 0.55 * slab[:2], 0.55 * slab[:, :2]
    return np.clip(picture, 0, 1)


def lit(name: str, rgb: Rgb = (1.0, 1.0, 1.0), picture: F32 | None = None) -> SceneryMaterial:
    """A look that emits light."""
    return SceneryMaterial(f"{LIT} {name}", rgb, picture)
