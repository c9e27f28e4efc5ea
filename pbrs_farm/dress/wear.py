"""Traces of use on smooth furniture: smudges on fronts and tops, the grain of brushed steel.

Maps of roughness and normals; colours are unchanged. Part of `parts`.
Effects: JPEGs are encoded through a temporary file.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.catalogue import Catalogue
from pbrs_farm.core.house import Item, ItemKind, Material, MaterialKind, Texture
from pbrs_farm.dress.box_mapping import area_of_look, box_mapped
from pbrs_farm.dress.mutable_house import MutableHouse
from pbrs_farm.dress.noise import blurred, noise, smoothstep
from pbrs_farm.dress.style import Style
from pbrs_farm.dress.surface_maps import normals_from_height, roughness_bytes, texture_from_pixels

PASS: Final = "parts"
SIZE_M: Final = (0.6, 0.6)  # size of one repeat
_SHAPE: Final = (512, 512)
_QUALITY: Final = 90
_LEAST_M: Final = 0.35  # minimum longest side of an item with smudges, metres
_LEAST_M2: Final = 0.04
_SMOOTH: Final = (0.08, 0.5)  # roughness of what shows a smudge
_COATED: Final = 0.55  # Ks: more is metal
_CLEAN: Final = 0.66  # roughness of a smudge map where nobody has touched it


def add_wear(house: MutableHouse, _catalogue: Catalogue, _style: Style, share: float) -> None:
    """Give smooth parts of furniture a roughness map, in share of the homes' pieces."""
    smudges = brushed = None
    for index, item in enumerate(house.items):
        if not _is_handled(item) or house.rng(PASS, "wear", item.id).random() >= share:
            continue
        surfaces = []
        for surface in item.surfaces:
            material = house.materials[surface.material]
            if not _is_smooth(material) or area_of_look(item, surface) < _LEAST_M2:
                surfaces.append(surface)
                continue
            axes = np.eye(3) if item.box is None else item.box.axes
            if max(material.specular) <= _COATED:
                smudges = smudges or _smudges(house)
                number = house.material(_smudged(material, smudges), [smudges])
            elif "brushed" in material.name:
                brushed = brushed or _brushed(house)
                normal, rough = brushed
                number = house.material(_grained(material, normal, rough), brushed)
            else:
                surfaces.append(surface)
                continue
            mapped = box_mapped(surface, axes, SIZE_M, is_grained=True)
            surfaces.append(replace(mapped, material=number))
        if any(a is not b for a, b in zip(surfaces, item.surfaces, strict=True)):
            house.change(index, replace(item, surfaces=tuple(surfaces)), PASS)
            house.done[f"{PASS}: worn"] += 1


def smudge_map(rng: np.random.Generator) -> F32:
    """(H, W) roughness, 0..1: wiped streaks, fingers, drops that have dried, dust."""
    clouds = smoothstep(0.2, 2.2, noise(rng, _SHAPE, slope=2.4, band=(1.0, 40.0)))
    wipes = smoothstep(
        0.6, 2.4, noise(rng, _SHAPE, slope=1.2, stretch=(9.0, 1.0), band=(2.0, 160.0))
    )
    dust = smoothstep(2.3, 3.2, noise(rng, _SHAPE, slope=0.3))
    rough = _CLEAN + 0.16 * clouds + 0.1 * wipes + 0.25 * dust
    touched = np.zeros(_SHAPE, np.float32)
    # Fingers touch in threes and fours, drops leave rings.
    for _ in range(int(rng.integers(5, 10))):
        y, x = rng.random(2)
        for k in range(int(rng.integers(1, 5))):
            _stamp_oval(
                touched, y + 0.012 * k * rng.uniform(-0.6, 0.6), x + 0.033 * k, 0.013, 0.009, 0.0
            )
    for _ in range(int(rng.integers(2, 6))):
        y, x = rng.random(2)
        r = float(rng.uniform(0.008, 0.016))
        _stamp_oval(touched, float(y), float(x), r, r, 0.72)
    return np.asarray(np.clip(rough + 0.26 * blurred(touched, 0.8), 0.0, 1.0), np.float32)


def _stamp_oval(
    field: F32, y: float, x: float, high_m: float, wide_m: float, hollow: float
) -> None:
    """An oval at (y, x) of the repeat, half axes in metres, hollow up to that share of them."""
    rows, columns = field.shape
    dy = ((np.arange(rows) / rows - y + 0.5) % 1.0 - 0.5) * SIZE_M[1] / high_m
    dx = ((np.arange(columns) / columns - x + 0.5) % 1.0 - 0.5) * SIZE_M[0] / wide_m
    near = np.ix_(np.abs(dy) < 1, np.abs(dx) < 1)
    r = np.hypot(dy[near[0]], dx[near[1]])
    field[near] = np.maximum(field[near], ((r < 1) & (r >= hollow)).astype(np.float32))


def _smudges(house: MutableHouse) -> Texture:
    pixels = roughness_bytes(smudge_map(house.rng(PASS, "smudges")))
    return texture_from_pixels("smudges-roughness.jpg", pixels, _QUALITY)


def _brushed(house: MutableHouse) -> tuple[Texture, Texture]:
    """(normals, roughness) of steel brushed along u."""
    rng = house.rng(PASS, "brushed")
    lines = noise(rng, _SHAPE, slope=0.4, stretch=(1.0, 60.0), band=(20.0, 1e9))
    rough = np.asarray(0.72 + 0.06 * lines, np.float32) * (smudge_map(rng) / np.float32(_CLEAN))
    normal = normals_from_height(np.asarray(4e-5 * lines, np.float32), SIZE_M)
    return (
        texture_from_pixels("brushed-normal.jpg", normal, _QUALITY),
        texture_from_pixels("brushed-roughness.jpg", roughness_bytes(rough), _QUALITY),
    )


def _smudged(material: Material, smudges: Texture) -> Material:
    rough = min(1.0, (material.roughness or 0.0) / _CLEAN)
    return replace(material, roughness=round(rough, 4), roughness_texture_id=smudges.id)


def _grained(material: Material, normal: Texture, rough: Texture) -> Material:
    factor = min(1.0, (material.roughness or 0.0) / 0.72)
    return replace(
        material,
        roughness=round(factor, 4),
        roughness_texture_id=rough.id,
        normal_texture_id=normal.id,
    )


def _is_handled(item: Item) -> bool:
    low, high = item.bounds
    return (
        item.kind is ItemKind.OBJECT
        and bool(item.n_faces)
        and float((high - low).max()) >= _LEAST_M
    )


def _is_smooth(material: Material) -> bool:
    is_plain = material.kind is MaterialKind.OPAQUE and not material.texture_ids
    low, high = _SMOOTH
    return (
        is_plain
        and material.opacity == 1
        and material.roughness is not None
        and low <= material.roughness <= high
        and max(material.specular) > 0
    )
