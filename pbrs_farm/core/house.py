"""House > Level > Room > Item > Surface, Material, Opening, LightPart, Motion; frozen values, no effects.

Everything is in the world frame: metres, right-handed, y up. Geometry is float32 and placed (no
instancing): stored, labelled and rendered geometry has the same bits. Structure (walls, floors, ceilings)
consists of items with their own kinds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, Points, Points2
from pbrs_farm.core.frames import LUMINANCE, linear_from_srgb
from pbrs_farm.core.joints import Joint
from pbrs_farm.core.lighting import LightForm, PowerUnit
from pbrs_farm.core.mesh import points_bounds, triangle_corners
from pbrs_farm.core.motions import Motion

MAX_INSTANCES = 65535
_LEAST_METAL: Final = 0.2  # reflectance, linear; the dullest metals have .4, dielectrics .1 at most


class ItemKind(StrEnum):
    """Role of an item in the pipeline; its label is Item.nyu40."""

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
    PANE = "pane"  # glass of a window or door: light passes, and the camera sees it mirror
    MIRROR = "mirror"
    SHADE = "shade"  # translucent lamp shade, set by repair
    BULB = "bulb"  # emits


@dataclass(frozen=True, slots=True)
class Texture:
    """An encoded picture as its source has it, never decoded here."""

    id: str  # first 16 hex of the data's sha256
    name: str
    media_type: str  # "image/png"
    data: bytes

    def __repr__(self) -> str:
        return f"Texture({self.id!r}, {self.name!r}, {self.media_type}, {len(self.data):,} bytes)"


USUAL_CUTOFF: Final = 0.5
"""Alpha below which a texel is a hole where the source names no other (glTF 2.0's default)."""
NOTHING_LEFT: Final = 2.0
"""A cutoff above any alpha: the whole surface is a hole."""


@dataclass(frozen=True, slots=True)
class Material:
    """A surface's material as its source gives it.

    With a texture the colour is diffuse (linear) times texture (linear): readers set diffuse to
    white where the source means the texture alone.
    """

    name: str
    kind: MaterialKind = MaterialKind.OPAQUE
    diffuse: tuple[float, float, float] = (1.0, 1.0, 1.0)  # Kd, sRGB-encoded, 0..1
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)  # Ks, sRGB-encoded, 0..1
    shininess: float = 0.0  # Phong exponent Ns, 0 = none
    opacity: float = 1.0  # d, 0..1
    texture_id: str | None = None  # key into House.textures
    alpha_cutout: bool = False  # it has holes: where its texture's alpha is below alpha_cutoff
    alpha_cutoff: float = USUAL_CUTOFF  # 0..1, or NOTHING_LEFT; alpha is 1 without a texture
    roughness: float | None = None  # glTF's, 0..1 (GGX alpha is its square); None = by shininess
    roughness_texture_id: str | None = None  # green times roughness, as glTF's
    normal_texture_id: str | None = None  # tangent space, x along u, y along v, as glTF's
    normal_scale: float = 1.0  # times x and y of the normal map, as glTF's
    is_default: bool = False  # the source names no colour: repair paints such walls white

    @property
    def texture_ids(self) -> tuple[str, ...]:
        """Its colour picture, roughness map and normal map, those that it has."""
        named = (self.texture_id, self.roughness_texture_id, self.normal_texture_id)
        return tuple(name for name in named if name)

    @property
    def is_metal(self) -> bool:
        """True if highlights give its colour: no picture, Ks bright and four times Kd."""
        brightness = float(linear_from_srgb(np.clip(self.specular, 0, 1)) @ LUMINANCE)
        dark = 4 * float(linear_from_srgb(np.clip(self.diffuse, 0, 1)) @ LUMINANCE) < brightness
        return self.texture_id is None and brightness > _LEAST_METAL and dark

    @property
    def shows_maps(self) -> bool:
        """True if light and labels follow its roughness and normal maps: glass and bulbs stay flat."""
        return self.kind in (MaterialKind.OPAQUE, MaterialKind.MIRROR, MaterialKind.SHADE)


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Surface:
    """A triangle mesh of one material."""

    name: str
    positions: Points  # (V, 3) metres, world
    faces: I32  # (F, 3) counter-clockwise seen from the front
    material: int  # index into House.materials
    uvs: F32 | None = None  # (V, 2) v up, repeat wrap
    normals: F32 | None = None  # (V, 3) unit shading normals; None = flat
    part: str = ""  # moving part of its item (Joint.part); "" = the static body

    @property
    def bounds(self) -> F64:
        """(2, 3) minimum and maximum of its vertices, computed once; ValueError without any."""
        ends = _BOUNDS.get(self)
        if ends is None:
            ends = _BOUNDS[self] = np.array(points_bounds(self.positions))
        return ends

    def __repr__(self) -> str:
        return f"Surface({self.name!r}, {len(self.faces):,} triangles, material {self.material})"


_BOUNDS: Final = WeakKeyDictionary[Surface, F64]()


def corners_of_surfaces(surfaces: Iterable[Surface]) -> F64:
    """(F, 3, 3) float64 corners of all triangles of surfaces in their order; (0, 3, 3) without any."""
    corners = [triangle_corners(s.positions, s.faces) for s in surfaces]
    return np.concatenate([np.zeros((0, 3, 3)), *corners])


def part_of(surface: Surface, faces: I32, name: str) -> Surface:
    """Some faces (F, 3) of a surface, maybe repeated, with their vertices, renumbered, as a new surface."""
    used, numbers = np.unique(faces, return_inverse=True)
    return Surface(
        name=name,
        positions=surface.positions[used],
        faces=numbers.reshape(-1, 3).astype(np.int32),
        material=surface.material,
        uvs=None if surface.uvs is None else surface.uvs[used],
        normals=None if surface.normals is None else surface.normals[used],
        part=surface.part,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """An oriented box."""

    centre: F64  # (3,) metres, world
    half: F64  # (3,) half extents, metres
    axes: F64  # (3, 3), unit columns; view.json has them as rows (docs/formats/view_json.md)

    @property
    def corners(self) -> F64:
        """(8, 3) float64 corners in the world, metres; corner i has the sign of bit k of i along axis k."""
        signs = np.array([[1 if i >> k & 1 else -1 for k in range(3)] for i in range(8)])
        return np.asarray(self.centre + (signs * self.half) @ self.axes.T)


@dataclass(frozen=True, slots=True)
class LightPart:
    """One light source of a lamp, in the world. Its flux: lighting.flux_lm."""

    position: tuple[float, float, float]  # of the bulb as the source gives it, metres
    radius_m: float
    power: float  # of the whole lamp, in unit
    unit: PowerUnit
    share: float = 1.0  # this source's part of its lamp's power
    rgb_linear: tuple[float, float, float] = (1.0, 1.0, 1.0)  # largest 1
    form: LightForm = LightForm.POINT
    direction: tuple[float, float, float] = (0.0, -1.0, 0.0)  # of spots and lines
    cutoff_rad: float = 3.141592653589793  # half angle of a spot
    dropoff: float = 0.0  # exponent of the cosine to the direction
    position_end: tuple[float, float, float] | None = None  # other end of a line
    emitting: tuple[int, ...] = ()  # indices into Item.surfaces; repair adds a sphere where none do
    escape: float | None = None  # light output ratio: share that leaves the lamp; None = unmeasured
    is_coloured: bool = False  # the source gives rgb_linear, even if white
    is_bare: bool = False  # power is what its surfaces send out, not what leaves the lamp


Rows4 = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ModelPose:
    """The model of which an item is an instance, and the pose of the model's frame: a 6-D pose."""

    model: str
    world_from_model: tuple[Rows4, Rows4, Rows4, Rows4]  # rigid; metres


OUTSIDE: Final = "outside"
"""Tag of an item before the windows (furnishings/surroundings), which is not part of the home.

It reflects light into the rooms; labels and pictures have it behind glass.
"""
LIT: Final = "lit"
"""Prefix of the name of a self-luminous material of such an item: windows at night."""

FLOATING: Final = "floating"
"""Tag of an item in the air without support, added to teach geometry (dress/floating.py); it does not
fall.
"""
REMOVED: Final = "removed"
"""Tag of an item that an edit took away: without surfaces, it holds its place, so that the instance
ids of the others stay.
"""

BOX_ONLY: Final = "box-only"
"""Tag of an item without surfaces, for which the source gives class and box alone.

box: its axes are right, up, front (columns). prepare/stand_ins.py replaces the item by furniture.
"""
FRONT_GIVEN: Final = "front-given"
"""Tag beside BOX_ONLY: the source gives the box's front, which is otherwise guessed."""


@dataclass(frozen=True, slots=True, eq=False)
class Item:
    """An object with one instance id and one class: a chair, a wall, a room's floor."""

    id: str  # unique in the house and stable
    name: str
    kind: ItemKind
    level_id: str
    surfaces: tuple[Surface, ...]
    nyu40: int = 0  # class 0..40, 0 = none
    source_class: str = ""  # the source's own name of its class: catalogue id or model id
    room_id: str | None = None  # the room around it
    lights: tuple[LightPart, ...] = ()
    box: Box | None = (
        None  # oriented: the source's plan, of a repaired house the mesh's; None = along x, y, z
    )
    tags: tuple[str, ...] = ()  # words of the source: "mirrored", "unmapped", "boundary_of:0_1"
    pose: ModelPose | None = None  # of what an edit placed
    joints: tuple[Joint, ...] = ()  # of its doors, drawers, lids; each moves the part it names

    @property
    def bounds(self) -> F64:
        """(2, 3) axis-aligned minimum and maximum of all vertices, metres; NaN without any."""
        ends = np.array([s.bounds for s in self.surfaces if len(s.positions)]).reshape(-1, 2, 3)
        if not len(ends):
            return np.full((2, 3), np.nan)
        return np.array([ends[:, 0].min(0), ends[:, 1].max(0)])

    @property
    def oriented_box(self) -> Box:
        """The item's box of its reader, or its axis-aligned one, which is NaN without vertices."""
        if self.box is not None:
            return self.box
        low, high = self.bounds
        return Box((low + high) / 2, (high - low) / 2, np.eye(3))

    @property
    def is_outside(self) -> bool:
        """True for an item before the windows, which the camera search and exports of a home omit."""
        return OUTSIDE in self.tags

    @property
    def is_floating(self) -> bool:
        """It hangs in the air on purpose: nothing holds it."""
        return FLOATING in self.tags

    @property
    def is_removed(self) -> bool:
        """An edit took it away; its instance id stays its own."""
        return REMOVED in self.tags

    @property
    def n_faces(self) -> int:
        """Triangles over all surfaces."""
        return sum(len(s.faces) for s in self.surfaces)

    def __repr__(self) -> str:
        room = f", room {self.room_id}" if self.room_id else ""
        summary = f"{self.kind}, nyu40 {self.nyu40}{room}, {self.n_faces:,} triangles"
        return f"Item({self.id!r}, {self.name!r}, {summary})"


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """A hole that a door or window cuts into walls."""

    id: str
    level_id: str
    item_id: str | None  # the door or window
    is_window: bool
    cutter: Surface  # closed solid that repair subtracts from every wall it touches
    quad: F64  # (4, 3) corners in the wall's middle plane, in order around
    normal: F64  # (3,) unit, across the wall, either way
    is_cut: bool = False  # the source's walls have the hole already: the cutter is its plug


class Enclosure(StrEnum):
    """Whether a room is bounded by full-height walls, a floor and a ceiling (decided by repair)."""

    UNKNOWN = "unknown"
    CLOSED = "closed"
    OPEN = "open"


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """A room's floor polygon and heights."""

    id: str  # `<level index>_<room index>`
    name: str
    level_id: str
    polygon: Points2  # (N, 2) plan (x, z), simple, counter-clockwise with x right and z up
    floor_y: float  # world y of the walkable surface
    ceiling_y: float  # world y of the nominal ceiling
    types: tuple[str, ...] = ()
    has_floor: bool = True
    has_ceiling: bool = True
    enclosure: Enclosure = Enclosure.UNKNOWN
    enclosure_reason: str = ""
    # Set by repair: some of "lamps", "windows", "sky" (no ceiling), "fallback" and "added" (lamps
    # of repair: where nothing else lights the room, and where people live without a lamp).
    lit_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Level:
    """A storey; metres."""

    id: str
    name: str
    elevation: float  # world y of its floor's top
    height: float  # floor to nominal ceiling
    floor_thickness: float = 0.12


@dataclass(frozen=True, slots=True, eq=False)
class StoredCamera:
    """A viewpoint kept in the source."""

    name: str
    eye: F64  # (3,) world
    towards: F64  # (3,) world
    hfov_rad: float  # horizontal, full angle


@dataclass(frozen=True, slots=True)
class Source:
    """Where a house came from and under which terms; "" where nothing is known."""

    kind: str  # "sweethome3d", "suncg", "gltf", "object" or "builtin"
    file: str
    sha256: str  # of the source's bytes; of a generated home the digest of its word
    package: str = ""  # distribution package and version it was fetched from
    author: str = ""
    licence: str = ""
    attribution: str = ""  # the line that every product made from it must carry


@dataclass(frozen=True, slots=True)
class Note:
    """Something wrong but recoverable."""

    kind: str  # a slug such as "missing-texture"
    place: str  # where inside the source
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class House:
    """A house as read, or as repaired."""

    id: str
    name: str
    source: Source
    levels: tuple[Level, ...]
    rooms: tuple[Room, ...]
    items: tuple[Item, ...]  # the instance id of items[i] is i + 1
    materials: tuple[Material, ...]
    textures: dict[str, Texture]  # by Material.texture_ids
    openings: tuple[Opening, ...] = ()
    cameras: tuple[StoredCamera, ...] = ()
    notes: tuple[Note, ...] = ()
    is_repaired: bool = False
    motions: tuple[Motion, ...] = ()  # of what moves with time: at most one a joint and one an item

    def level(self, level_id: str) -> Level:
        """The level with an id; KeyError without one."""
        for level in self.levels:
            if level.id == level_id:
                return level
        raise KeyError(level_id)

    def room(self, room_id: str) -> Room:
        """The room with an id; KeyError without one."""
        for room in self.rooms:
            if room.id == room_id:
                return room
        raise KeyError(room_id)

    def with_items(self, items: Iterable[Item]) -> House:
        """The same house with other items; instance ids follow their order."""
        return replace(self, items=tuple(items))

    def surfaces(self) -> Iterator[tuple[int, Item, int, Surface]]:
        """(instance id from 1, item, index in it, surface) in order, as Geometry.face_surface numbers them."""
        for index, item in enumerate(self.items):
            for j, surface in enumerate(item.surfaces):
                yield index + 1, item, j, surface

    def __repr__(self) -> str:
        counts = f"{len(self.rooms)} rooms, {len(self.items)} items"
        n_faces = sum(item.n_faces for item in self.items)
        state = "repaired" if self.is_repaired else "as read"
        return f"House({self.id!r}, {counts}, {n_faces:,} triangles, {state})"


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """All triangles of a house in one list: what rays and rasters see."""

    positions: Points  # (V, 3) metres, world
    normals: F32  # (V, 3) unit, (0, 0, 0) = flat
    uvs: F32  # (V, 2) v up
    faces: I32  # (F, 3) indices into positions
    face_item: NDArray[np.uint32]  # (F,) instance id
    face_material: I32  # (F,) index into House.materials
    face_surface: I32  # (F,) number of the surface in House.surfaces() order

    def __repr__(self) -> str:
        return f"Geometry({len(self.positions):,} vertices, {len(self.faces):,} triangles)"


def geometry_from_house(house: House, *, with_panes: bool = True) -> Geometry:
    """Concatenate every surface, unwelded; with_panes False leaves window panes, but no number, out."""
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
        # Number the vertices through, and tell of each face where it came from.
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
    # The empty array gives shape and dtype where a house has no surface.
    return np.concatenate([empty, *(p.astype(empty.dtype, copy=False) for p in parts)])
