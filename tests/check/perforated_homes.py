"""Homes whose surfaces have holes or coincide, for the checks of verify."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
from PIL import Image

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, Item, ItemKind, Material, MaterialKind, Surface, Texture
from pbrs_farm.read.builtin.builtin_home import builtin_home
from tests.check.roots import views_of

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


def with_frame_in_wall(by_m: float) -> House:
    """The small home with a sheet in front of every wall's larger faces, by_m off their plane."""
    home = builtin_home()
    frames = []
    for item in home.items:
        if item.kind is not ItemKind.WALL:
            continue
        surfaces = []
        for s in item.surfaces:
            corners = s.positions[s.faces].astype(np.float64)
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
            upright = np.abs(normals[:, 1]) < 0.1
            # Smaller triangles about the same middle, each in its plane.
            middle = corners.mean(1, keepdims=True)
            small = (middle + 0.8 * (corners - middle) + by_m * normals[:, None])[upright]
            faces = np.arange(3 * len(small)).reshape(-1, 3).astype(np.int32)
            surfaces.append(
                Surface("frame", small.reshape(-1, 3).astype(np.float32), faces, s.material)
            )
        frame = replace(item, id=f"frame_{item.id}", name="frame", kind=ItemKind.WINDOW, nyu40=9, surfaces=tuple(surfaces), tags=())  # fmt: skip
        frames.append(frame)
    return home.with_items([*frames, *home.items])
