"""verify looks through the holes of surfaces by its own rays."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Material,
    MaterialKind,
    Surface,
    Texture,
    geometry_from_house,
)
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.roots import failed, make_root, views_of

DISTANCES_M = (0.4, 0.45, 0.7)  # from the first camera to the screens


def screened(material: Material) -> House:
    """The small home with three perforated screens in front of its first camera."""
    rng = np.random.default_rng(2)
    pixels = np.full((6, 9, 4), 120, np.uint8)
    pixels[..., 3] = rng.integers(0, 256, (6, 9))
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    texture = Texture("screen", "screen.png", "image/png", buffer.getvalue())
    home = builtin_home()
    camera = next(iter(views_of(home).values()))
    surfaces = tuple(screen(camera, d, len(home.materials)) for d in DISTANCES_M)
    item = Item("screen", "Screen", ItemKind.OBJECT, home.levels[0].id, surfaces, 40)
    return replace(
        home,
        items=(*home.items, item),
        materials=(*home.materials, replace(material, texture_id=texture.id)),
        textures={**home.textures, texture.id: texture},
    )


def screen(camera: Camera, distance_m: float, material: int) -> Surface:
    """A square across half of the camera's picture."""
    pose, half = camera.world_from_camera, 0.35 * distance_m
    corners = [(x * half, y * half, -distance_m) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    points = np.array(corners) @ pose[:3, :3].T + pose[:3, 3]
    return Surface(
        "screen", points.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), material,
        np.array([[0, 0], [1.3, 0], [1.3, 1.3], [0, 1.3]], np.float32),
    )  # fmt: skip


MATERIALS = {
    "leaf": Material("leaf", alpha_cutout=True),
    "low": Material("low", alpha_cutout=True, alpha_cutoff=0.2),
    "glass": Material("glass", MaterialKind.GLASS, opacity=0.3, alpha_cutout=True),
    "gone": Material("gone", alpha_cutout=True, alpha_cutoff=2.0),
    "whole": Material("whole"),
}


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", MATERIALS)
def test_every_layer_of_a_home_with_holes_agrees_with_independent_rays(
    tmp_path: Path, name: str
) -> None:
    home = screened(MATERIALS[name])
    make_root(tmp_path, home, with_optional=True)
    assert failed(tmp_path) == set()


@pytest.mark.quick(1)
@pytest.mark.parametrize("wrong", ["solid", "other cutoff"])
def test_labels_of_a_solid_surface_or_of_another_cutoff_are_caught(
    tmp_path: Path, wrong: str
) -> None:
    home = screened(MATERIALS["leaf"])
    replacement = screened(MATERIALS["whole" if wrong == "solid" else "low"])
    caster = Caster.of_house(replacement, geometry_from_house(home))
    make_root(tmp_path, home, caster=caster)
    assert {"ray: instance", "ray: depth"} <= failed(tmp_path)
