"""House > Level > Room > Item > Surface, Material, Opening, LightPart; frozen values, no effects.

Everything stands in the world frame: metres, right-handed, y up. Geometry is float32, already
placed (no instancing), so that what is stored, labelled and rendered is the same bits.
Structure (walls, floors, ceilings) are items like any other; their kind tells them apart.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Points, Points2
from pbrs_farm.core.lighting import LightForm, PowerUnit

MAX_INSTANCES = 65535


class ItemKind(StrEnum):
    """What an item is to the pipeline; its label is Item.nyu40."""

    WALL = "wall"
    FLOOR = "floor"
    CEILING = "ceiling"
    GROUND = "ground"
    DOOR = "door"
    WINDOW = "window"
    LAMP = "lamp"
    STAIRS = "stairs"
    PERSON = "person"
    PLANT = "plant"
    OBJECT = "object"

    @property
    def is_structure(self) -> bool:
        """Wall, floor, ceiling or ground: no object in the sense of the camera score."""
        return self in (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING, ItemKind.GROUND)


class MaterialKind(StrEnum):
    """How light meets a material."""

    OPAQUE = "opaque"
    GLASS = "glass"  # thin glass of an object: seen through, reflects
    PANE = "pane"  # glass of a window or door: left out of the scene that carries light
    MIRROR = "mirror"
    SHADE = "shade"  # translucent lamp shade, set by repair
    BULB = "bulb"  # emits


@dataclass(frozen=True, slots=True)
class Texture:
    """An encoded picture (PNG or JPEG), never decoded here. id = first 16 hex of its sha256."""

    id: str
    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Material:
    """A surface's look as its source gives it.

    diffuse, specular: sRGB-encoded Kd and Ks in 0..1; decode with frames.linear_from_srgb.
    With a texture the colour is diffuse (linear) times texture (linear): readers set diffuse to
    white where the source means the texture alone. shininess: Phong exponent Ns (0 = none).
    opacity: d in 0..1. texture_id: key into House.textures. alpha_cutout: texture alpha < 0.5
    is a hole. is_default: the source names no colour (repair paints default walls white).
    """

    name: str
    kind: MaterialKind = MaterialKind.OPAQUE
    diffuse: tuple[float, float, float] = (1.0, 1.0, 1.0)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: float = 0.0
    opacity: float = 1.0
    texture_id: str | None = None
    alpha_cutout: bool = False
    is_default: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A triangle mesh of one material.

    positions: (V, 3) float32, metres, world. faces: (F, 3) int32, counter-clockwise seen from
    the front. uvs: (V, 2) float32, v up, repeat wrap, or None. normals: (V, 3) float32 unit
    shading normals, or None for flat shading. material: index into House.materials.
    """

    name: str
    positions: Points
    faces: NDArray[np.int32]
    material: int
    uvs: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An oriented box: centre (3,) and half extents (3,) in metres; columns of axes (3, 3) are unit."""

    centre: NDArray[np.float64]
    half: NDArray[np.float64]
    axes: NDArray[np.float64]

    @property
    def corners(self) -> NDArray[np.float64]:
        """(8, 3) corners in the world; corner i has the sign of bit k of i along axis k."""
        signs = np.array([[1 if i >> k & 1 else -1 for k in range(3)] for i in range(8)])
        return np.asarray(self.centre + (signs * self.half) @ self.axes.T)


@dataclass(frozen=True, slots=True)
class LightPart:
    """One light source of a lamp, in the world.

    position, radius_m: the bulb as the source gives it. rgb_linear: colour, linear, largest 1.
    power, unit, share: see lighting.flux_lm; share is this source's part of its lamp's power.
    direction, cutoff_rad (half angle), dropoff (exponent of the cosine): spots and lines.
    position_end: the other end of a line.
    emitting: indices into Item.surfaces that emit this light (repair adds a sphere where none do).
    escape: share of the light that leaves the lamp, measured by repair; None = not measured.
    """

    position: tuple[float, float, float]
    radius_m: float
    power: float
    unit: PowerUnit
    share: float = 1.0
    rgb_linear: tuple[float, float, float] = (1.0, 1.0, 1.0)
    form: LightForm = LightForm.POINT
    direction: tuple[float, float, float] = (0.0, -1.0, 0.0)
    cutoff_rad: float = 3.141592653589793
    dropoff: float = 0.0
    position_end: tuple[float, float, float] | None = None
    emitting: tuple[int, ...] = ()
    escape: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Item:
    """A thing with one instance id and one class: a chair, a wall, a room's floor.

    id: unique in the house and stable. source_class: the source's own name for it (catalogue id
    or model id). nyu40: class 0..40, 0 = none. room_id: the room it stands in, or None.
    box: oriented bounding box, or None (then the axis-aligned one holds).
    tags: words of the source the stages may need ("mirrored", "unmapped", "boundary_of:0_1").
    """

    id: str
    name: str
    kind: ItemKind
    level_id: str
    surfaces: tuple[Surface, ...]
    nyu40: int = 0
    source_class: str = ""
    room_id: str | None = None
    lights: tuple[LightPart, ...] = ()
    box: Box | None = None
    tags: tuple[str, ...] = ()

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) axis-aligned minimum and maximum, metres; NaN for an item without vertices."""
        points = [s.positions for s in self.surfaces if len(s.positions)]
        if not points:
            return np.full((2, 3), np.nan)
        return np.array(
            [np.min([p.min(0) for p in points], 0), np.max([p.max(0) for p in points], 0)],
            np.float64,
        )

    @property
    def oriented_box(self) -> Box:
        """The item's box, or its axis-aligned one."""
        if self.box is not None:
            return self.box
        low, high = self.bounds
        return Box((low + high) / 2, (high - low) / 2, np.eye(3))

    @property
    def n_faces(self) -> int:
        """Triangles over all surfaces."""
        return sum(len(s.faces) for s in self.surfaces)


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """A hole that a door or window cuts into walls.

    cutter: a closed solid in the world that repair subtracts from every wall it touches.
    quad: (4, 3) corners of the opening's rectangle in the wall's middle plane, in order around.
    normal: (3,) unit, across the wall, either way. item_id: the door or window, or None.
    is_cut: the source's walls have the hole already; the cutter then is its plug.
    """

    id: str
    level_id: str
    item_id: str | None
    is_window: bool
    cutter: Surface
    quad: NDArray[np.float64]
    normal: NDArray[np.float64]
    is_cut: bool = False


class Enclosure(StrEnum):
    """Whether a room is bounded by full-height walls, a floor and a ceiling (decided by repair)."""

    UNKNOWN = "unknown"
    CLOSED = "closed"
    OPEN = "open"


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A room's floor polygon and heights.

    id: `<level index>_<room index>`. polygon: (N, 2) float64 plan (x, z), simple, counter-clockwise
    seen with x right and z up. floor_y, ceiling_y: world y of the walkable surface and of the
    nominal ceiling. lit_by (set by repair): some of "lamps", "windows", "fallback".
    """

    id: str
    name: str
    level_id: str
    polygon: Points2
    floor_y: float
    ceiling_y: float
    types: tuple[str, ...] = ()
    has_floor: bool = True
    has_ceiling: bool = True
    enclosure: Enclosure = Enclosure.UNKNOWN
    enclosure_reason: str = ""
    lit_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Level:
    """A storey. elevation: world y of its floor's top; height: floor to nominal ceiling, metres."""

    id: str
    name: str
    elevation: float
    height: float
    floor_thickness: float = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class StoredCamera:
    """A viewpoint kept in the source. eye, towards: (3,) world. hfov_rad: horizontal, full."""

    name: str
    eye: NDArray[np.float64]
    towards: NDArray[np.float64]
    hfov_rad: float


@dataclass(frozen=True, slots=True)
class Source:
    """Where a house came from and under which terms.

    kind: "sweethome3d", "suncg", "gltf" or "builtin". sha256: of the source's bytes.
    package: distribution package and version it was fetched from, or "".
    attribution: the line every product made from it must carry, or "".
    """

    kind: str
    file: str
    sha256: str
    package: str = ""
    author: str = ""
    licence: str = ""
    attribution: str = ""


@dataclass(frozen=True, slots=True)
class Note:
    """Something wrong but recoverable: kind (a slug such as "missing-texture"), place, text."""

    kind: str
    place: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class House:
    """A house as read, or as repaired (is_repaired). Instance id of items[i] is i + 1."""

    id: str
    name: str
    source: Source
    levels: tuple[Level, ...]
    rooms: tuple[Room, ...]
    items: tuple[Item, ...]
    materials: tuple[Material, ...]
    textures: dict[str, Texture]
    openings: tuple[Opening, ...] = ()
    cameras: tuple[StoredCamera, ...] = ()
    notes: tuple[Note, ...] = ()
    is_repaired: bool = False

    def level(self, level_id: str) -> Level:
        """The level of that id; KeyError if there is none."""
        for level in self.levels:
            if level.id == level_id:
                return level
        raise KeyError(level_id)

    def room(self, room_id: str) -> Room:
        """The room of that id; KeyError if there is none."""
        for room in self.rooms:
            if room.id == room_id:
                return room
        raise KeyError(room_id)

    def with_items(self, items: Iterable[Item]) -> House:
        """The same house with other items (instance ids follow their order)."""
        return replace(self, items=tuple(items))

    def surfaces(self) -> Iterator[tuple[int, Item, int, Surface]]:
        """(instance id, item, index in the item, surface) of every surface, in order."""
        for index, item in enumerate(self.items):
            for j, surface in enumerate(item.surfaces):
                yield index + 1, item, j, surface


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """All triangles of a house in one list: what rays and rasters see.

    positions, normals: (V, 3) float32 (normals (0, 0, 0) = flat). uvs: (V, 2) float32.
    faces: (F, 3) int32. face_item: (F,) uint32 instance id. face_material: (F,) int32.
    face_surface: (F,) int32, running number of the surface in House.surfaces() order.
    """

    positions: Points
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    faces: NDArray[np.int32]
    face_item: NDArray[np.uint32]
    face_material: NDArray[np.int32]
    face_surface: NDArray[np.int32]


def geometry_from_house(house: House, *, with_panes: bool = True) -> Geometry:
    """Concatenate every surface of house; with_panes False leaves out window panes (light only)."""
    positions, normals, uvs, faces = [], [], [], []
    face_item, face_material, face_surface = [], [], []
    n_vertices = 0
    for number, (instance, _item, _j, s) in enumerate(house.surfaces()):
        if not with_panes and house.materials[s.material].kind is MaterialKind.PANE:
            continue
        v, f = len(s.positions), len(s.faces)
        positions.append(s.positions)
        normals.append(s.normals if s.normals is not None else np.zeros((v, 3), np.float32))
        uvs.append(s.uvs if s.uvs is not None else np.zeros((v, 2), np.float32))
        faces.append(s.faces + n_vertices)
        face_item.append(np.full(f, instance, np.uint32))
        face_material.append(np.full(f, s.material, np.int32))
        face_surface.append(np.full(f, number, np.int32))
        n_vertices += v

    return Geometry(
        positions=_joined(positions, np.zeros((0, 3), np.float32)),
        normals=_joined(normals, np.zeros((0, 3), np.float32)),
        uvs=_joined(uvs, np.zeros((0, 2), np.float32)),
        faces=_joined(faces, np.zeros((0, 3), np.int32)),
        face_item=_joined(face_item, np.zeros(0, np.uint32)),
        face_material=_joined(face_material, np.zeros(0, np.int32)),
        face_surface=_joined(face_surface, np.zeros(0, np.int32)),
    )


_T = TypeVar("_T", bound=np.generic)


def _joined(parts: list[NDArray[_T]], empty: NDArray[_T]) -> NDArray[_T]:
    return np.concatenate([empty, *(p.astype(empty.dtype, copy=False) for p in parts)])
