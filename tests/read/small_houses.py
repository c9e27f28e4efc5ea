"""Small houses built in code for the tests of readers and bundle; no effects."""

from __future__ import annotations

import hashlib
import struct
import zlib

import numpy as np

from pbrs_farm.core.house import (
    Box,
    Enclosure,
    House,
    Item,
    ItemKind,
    Level,
    LightPart,
    Material,
    MaterialKind,
    Note,
    Opening,
    Room,
    Source,
    StoredCamera,
    Surface,
    Texture,
)
from pbrs_farm.core.lighting import LightForm, PowerUnit


def png(width: int = 2, height: int = 2, rgb: tuple[int, int, int] = (200, 30, 40)) -> bytes:
    """The bytes of a one-colour PNG."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    rows = (b"\0" + bytes(rgb) * width) * height
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows))
        + chunk(b"IEND", b"")
    )


def texture(data: bytes, name: str, media_type: str = "image/png") -> Texture:
    """A Texture with the id that readers would give it."""
    return Texture(hashlib.sha256(data).hexdigest()[:16], name, media_type, data)


def quad(corners: list[list[float]], material: int, name: str = "quad") -> Surface:
    """Two triangles over four corners in order, uv with odd numbers, flat normals."""
    p = np.array(corners, np.float32)
    n = np.cross(p[1] - p[0], p[2] - p[0])
    return Surface(
        name=name,
        positions=p,
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        material=material,
        uvs=np.array([[0, 0], [0.1, 0.7], [1 / 3, -2.25], [5.3, 1e-7]], np.float32),
        normals=np.tile((n / np.linalg.norm(n)).astype(np.float32), (4, 1)),
    )


def full_house() -> House:
    """A house in which every type and every optional field of house.py occurs once."""
    red, gif = texture(png(), "red"), texture(b"GIF89a...", "old", "image/gif")
    floor = quad([[0, 0, 0], [0, 0, 4], [5, 0, 4], [5, 0, 0]], 0, "floor")
    pane = quad([[1, 1, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]], 1, "pane")
    bulb = quad([[2, 2, 2], [2.1, 2, 2], [2.1, 2.1, 2], [2, 2.1, 2]], 2, "bulb")
    bare = Surface("bare", pane.positions + np.float32(0.1), pane.faces, 3)
    nothing = Surface("nothing", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), 3)
    points = Surface("points", pane.positions, np.zeros((0, 3), np.int32), 3)
    light = LightPart(
        position=(2.0, 2.0, 2.0),
        radius_m=0.03,
        power=60.0,
        unit=PowerUnit.WATT,
        share=0.5,
        form=LightForm.LINE,
        position_end=(2.5, 2.0, 2.0),
        cutoff_rad=1.57,
        dropoff=2.0,
        emitting=(0,),
        escape=0.25,
    )
    box = Box(np.array([1.0, 2.0, 1 / 3]), np.array([0.5, 0.5, 0.1]), np.eye(3))
    return House(
        id="full-01234567",
        name="Full",
        source=Source("builtin", "full", "0" * 64, attribution="Full, by a test"),
        levels=(Level("0", "Ground", 0.0, 2.5),),
        rooms=(
            Room(
                "0_0", "Kitchen", "0", np.array([[0, 0], [5, 0], [5, 4], [0, 4.0]]), 0.0, 2.5,
                types=("Kitchen",), enclosure=Enclosure.OPEN, enclosure_reason="no ceiling",
                lit_by=("lamps",),
            ),
        ),
        items=(
            Item("floor", "Floor", ItemKind.FLOOR, "0", (floor,), 2, room_id="0_0"),
            Item("w1", "Window", ItemKind.WINDOW, "0", (pane, bare), 9, "126", box=box),
            Item("l1", "Lamp", ItemKind.LAMP, "0", (bulb,), 35, lights=(light,), tags=("mirrored",)),
            Item("e1", "Empty", ItemKind.OBJECT, "0", ()),
            Item("e2", "", ItemKind.OBJECT, "0", (nothing, points, bare)),
        ),
        materials=(
            Material("tiles", diffuse=(0.2, 0.5, 1.0), texture_id=red.id, shininess=30.0),
            Material("glass", kind=MaterialKind.PANE, opacity=0.5),
            Material("bulb", kind=MaterialKind.BULB),
            Material("old", texture_id=gif.id, alpha_cutout=True, alpha_cutoff=0.25, is_default=True),
        ),
        textures={red.id: red, gif.id: gif},
        openings=(
            Opening("o1", "0", "w1", True, bare, np.arange(12.0).reshape(4, 3), np.array([0, 0, 1.0])),
        ),
        cameras=(StoredCamera("top", np.array([1, 1.7, 2.0]), np.array([0, 0, -1.0]), 1.1),),
        notes=(Note("missing-texture", "item w1", "frost.jpg does not exist"),),
        is_repaired=True,
    )  # fmt: skip
