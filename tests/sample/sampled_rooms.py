"""Small rooms with boxes in them, built in code, and an independent ray caster for them."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import (
    House,
    Item,
    ItemKind,
    Level,
    Material,
    Room,
    Source,
    Surface,
    geometry_from_house,
)
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.raycast.caster import Caster

QUICK = CameraFields(
    score_width_px=80, score_height_px=60, coarse_width_px=40, coarse_height_px=30, cell_m=0.5
)


def box(
    low: Sequence[float], high: Sequence[float], kind: ItemKind = ItemKind.OBJECT, name: str = "box"
) -> Item:
    """A closed axis-aligned box with outward faces."""
    mesh = trimesh.creation.box(bounds=np.array([low, high], np.float64))
    surface = Surface(
        name, np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32), 0
    )
    return Item(name, name, kind, "0", (surface,), room_id="0_0")


def shell(width: float, depth: float, height: float = 2.5, wall: float = 0.1) -> list[Item]:
    """Floor, ceiling and four walls, all solid, around (0..width, 0..height, 0..depth)."""
    w, d, t = width, depth, wall
    parts = [
        ((-t, -0.1, -t), (w + t, 0, d + t), ItemKind.FLOOR),
        ((-t, height, -t), (w + t, height + 0.1, d + t), ItemKind.CEILING),
        ((-t, 0, -t), (0, height, d + t), ItemKind.WALL),
        ((w, 0, -t), (w + t, height, d + t), ItemKind.WALL),
        ((0, 0, -t), (w, height, 0), ItemKind.WALL),
        ((0, 0, d), (w, height, d + t), ItemKind.WALL),
    ]
    return [box(low, high, kind, f"{kind.value} {k}") for k, (low, high, kind) in enumerate(parts)]


def room_house(
    items: Sequence[Item], width: float, depth: float, height: float = 2.5, **room: object
) -> House:
    """A house of one rectangular room, lit by its windows by default."""
    polygon = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], np.float64)
    plain = Room("0_0", "room", "0", polygon, 0.0, height, lit_by=("windows",))
    return House(
        "test-house",
        "test",
        Source("builtin", "test", "0" * 64),
        (Level("0", "0", 0.0, height),),
        (replace(plain, **room),),  # type: ignore[arg-type]
        tuple(items),
        (Material("m"),),
        {},
        is_repaired=True,
    )


def furnished(width: float = 4.0, depth: float = 5.0) -> House:
    """A room with a table, a chair, a cupboard, a bed and a hollow wardrobe that reaches 2.2 m."""
    w, d = width, depth
    items = [
        *shell(w, d),
        box((0.4, 0, 0.3), (1.6, 0.75, 1.1), name="table"),
        box((1.8, 0, 0.4), (2.2, 0.9, 0.8), name="chair"),
        box((w - 0.5, 0, 0.1), (w - 0.05, 1.3, 1.2), name="cupboard"),
        box((0.1, 0, d - 2.1), (1.7, 0.5, d - 0.1), name="bed"),
        box((w - 1.0, 0, d - 1.8), (w - 0.1, 2.2, d - 0.1), name="wardrobe"),
    ]
    return room_house(items, w, d)


def counter_of(house: House) -> Callable[[Sequence[Camera]], NDArray[np.uint32]]:
    """The real caster's item counts."""
    return Caster(geometry_from_house(house)).item_counts


class IndependentLook:
    """Distances and pictures of a house by trimesh and embreex, without code of transport/."""

    def __init__(self, house: House) -> None:
        geometry = geometry_from_house(house)
        self.mesh = trimesh.Trimesh(geometry.positions, geometry.faces, process=False)
        self.face_item = geometry.face_item

    def clearance(self, point: NDArray[np.float64]) -> float:
        """Distance to the nearest triangle, metres."""
        # Trimesh 4 divides by the edges of a triangle without an area.
        triangles = self.mesh.triangles[self.mesh.area_faces > 0]
        repeated = np.broadcast_to(point, (len(triangles), 3))
        nearest = trimesh.triangles.closest_point(triangles, repeated)
        return float(np.linalg.norm(nearest - point, axis=1).min())

    def assert_rules_of_place(self, room: Room, camera: Camera, fields: CameraFields) -> None:
        """Assert that a camera is in its room, at a height of the recipe, clear of everything."""
        x, y, z = camera.eye
        assert shapely.Polygon(room.polygon).contains(shapely.Point(x, z))
        assert fields.height_min_m <= y - room.floor_y <= fields.height_max_m
        assert self.clearance(camera.eye) > fields.clearance_m

    def pixels(self, camera: Camera) -> dict[int, int]:
        """Instance id -> pixels, from rays through the pixels' centres."""
        i = camera.intrinsics
        u, v = np.meshgrid(np.arange(i.width_px) + 0.5, np.arange(i.height_px) + 0.5)
        d = np.stack([(u - i.cx) / i.fx, (i.cy - v) / i.fy, -np.ones_like(u)], -1).reshape(-1, 3)
        d = d @ camera.world_from_camera[:3, :3].T
        face = self.mesh.ray.intersects_first(np.broadcast_to(camera.eye, d.shape), d)
        ids, n = np.unique(self.face_item[face[face >= 0]], return_counts=True)
        return dict(zip(ids.tolist(), n.tolist(), strict=True))
