"""The models a SUNCG house is made of, parsed once each. Effect: reads OBJ and MTL of the root."""

from __future__ import annotations

import posixpath
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import LightPart, Material, MaterialKind, Surface, part_of
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.core.mesh import area_vectors, triangle_corners
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.material_library import LoadedTexture, MaterialLibrary
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder, read_mtl
from pbrs_farm.read.mesh.obj import Mesh, ObjMaterial, parse_obj
from pbrs_farm.read.suncg.house_json import Override

_BYTES_PER_TRIANGLE = 150


@dataclass(frozen=True, slots=True, eq=False)
class ParsedModel:
    """Meshes with their materials."""

    meshes: tuple[Mesh, ...]
    slots: tuple[int, ...]  # per mesh its position in mtl, -1 = unknown
    mtl: tuple[ObjMaterial, ...]

    @property
    def n_faces(self) -> int:
        """Triangles over all meshes."""
        return sum(len(m.faces) for m in self.meshes)


class DamagedModel(BadHouse):
    """An OBJ of the library that cannot be read; one that an object places is left out."""


class ModelCache:
    """Parses every model once and remembers it for the nodes that place it again."""

    def __init__(self, folder: RootFolder, notes: Notes, fields: ReadFields) -> None:
        self._folder = folder
        self._notes = notes
        self._max_triangles = fields.max_model_triangles
        self._known: dict[tuple[str, str], ParsedModel | None] = {}

    def model(self, obj_name: str, mtl_name: str) -> ParsedModel | None:
        """The model of an OBJ below the root; None if there is no such OBJ."""
        key = (obj_name, mtl_name)
        if key not in self._known:
            self._known[key] = self._parse(obj_name, mtl_name)
        return self._known[key]

    def _parse(self, obj_name: str, mtl_name: str) -> ParsedModel | None:
        data = self._folder.read(
            obj_name,
            max_bytes=self._max_triangles * _BYTES_PER_TRIANGLE,
            limit="read.max_model_triangles",
        )
        if data is None:
            return None
        try:
            parsed = parse_obj(data, obj_name, max_triangles=self._max_triangles)
        except BadHouse as error:
            if error.hint:  # a limit of the recipe: the house is refused
                raise
            raise DamagedModel(obj_name, "", error.message.removeprefix(f"{obj_name}: ")) from None
        meshes = parsed.meshes
        if parsed.is_cut:
            text = "ends within a line, or with vertices of no face: cut short? The rest is kept"
            self._notes.add("cut-short", obj_name, text)
        mtl = self._mtl(mtl_name)
        names = {m.name: i for i, m in reversed(list(enumerate(mtl)))}
        for name in {m.material: None for m in meshes}:
            if mtl and name not in names:
                text = f"usemtl {name[:60]!r} is not in {mtl_name}; it is grey"
                self._notes.add("unknown-material", obj_name, text)
        return ParsedModel(meshes, tuple(names.get(m.material, -1) for m in meshes), mtl)

    def _mtl(self, name: str) -> tuple[ObjMaterial, ...]:
        materials = read_mtl(self._folder, name)
        if materials is None:
            self._notes.add("missing-materials", name, "does not exist; the model is grey")
        elif not materials:
            self._notes.add("missing-materials", name, "holds no material; the model is grey")
        return materials or ()


# Materials and textures of a SUNCG house (docs/spec/suncg.md sections 1.5, 1.6); reads textures
# of the root.


MAX_TEXTURE_BYTES: Final = 64_000_000
GREY: Final = (0.8, 0.8, 0.8)
WHITE: Final = (1.0, 1.0, 1.0)
DEFAULT_WALLS: Final = ("wallp_0", "wallp_1_1", "wallp_1_2")
"""Papers that the published pictures show white, whatever colour they have (docs/spec/suncg.md section 6)."""


class ModelMaterials:
    """Resolves the materials of one house's models and nodes into its material library."""

    def __init__(self, folder: RootFolder, notes: Notes) -> None:
        self._folder = folder
        self.library = MaterialLibrary(notes)

    def material(
        self, mtl: ObjMaterial | None, override: Override | None, *, place: str, clear: MaterialKind
    ) -> Material:
        """A model's material as a node overrides it.

        mtl: the model's, its texture a name below the root; None = grey. clear: the kind of
        what lets light through (d < 1).
        """
        base = mtl or ObjMaterial("")
        diffuse, reference = base.kd, base.map_kd
        if override is not None and override.texture is not None:
            reference = self._override_texture(override.texture)
            diffuse = override.diffuse or WHITE
        elif override is not None and override.diffuse is not None:
            diffuse = override.diffuse
        elif reference and base.kd == GREY:  # what parse_mtl gives where there is no Kd
            diffuse = WHITE
        found = self._texture(reference, place) if reference else None
        if reference and found is None and diffuse == WHITE:
            diffuse = GREY
        return Material(
            name=(override.name if override is not None else "") or base.name,
            kind=clear if base.d < 1 else MaterialKind.OPAQUE,
            diffuse=diffuse,
            specular=base.ks,
            shininess=base.ns,
            opacity=base.d,
            texture_id=found.texture.id if found else None,
            alpha_cutout=bool(found and found.has_holes),
        )

    def wall_material(
        self, mtl: ObjMaterial | None, override: Override | None, *, place: str
    ) -> Material:
        """A wall's material; one that nobody chose is white and marked as default.

        That is no colour at all, or a default paper, whose colour the published pictures ignore.
        """
        material = self.material(mtl, override, place=place, clear=MaterialKind.GLASS)
        picture = mtl.map_kd if mtl is not None else ""
        is_unpainted = mtl is None or (not picture and mtl.kd == GREY)
        if override is not None:
            picture = override.texture or picture
            is_unpainted &= override.texture is None and override.diffuse is None
        if posixpath.splitext(posixpath.basename(picture))[0] in DEFAULT_WALLS:
            return replace(material, diffuse=WHITE, texture_id=None, is_default=True)
        return replace(material, is_default=is_unpainted)

    def _override_texture(self, name: str) -> str:
        png = f"texture/{name}.png"
        return png if self._folder.path(png) is not None else f"texture/{name}.jpg"

    def _texture(self, name: str, place: str) -> LoadedTexture | None:
        return self.library.texture(
            name,
            name=posixpath.basename(name),
            place=place,
            load=lambda: self._folder.read(name, max_bytes=MAX_TEXTURE_BYTES),
        )


# Which material of a SUNCG mirror is its glass.
# The models say nothing of reflection: their MTL has colours alone.


_REFLECTANCE: Final = 0.9
_FLAT_COS: Final = 0.98  # of the angle to the glass's normal, within which a face lies flat
_FLAT_SHARE: Final = 0.45  # of a material's area: a pane with a back and edges has half
_NAMES: Final = ("mirror", "spiegel", "glass")  # an MTL's names are material_0, material_1 mostly


def mirror_slot(model: ParsedModel) -> int | None:
    """The position in the MTL of a mirror's glass, -1 for meshes without one; None if none is flat.

    The glass faces away from the wall: of the materials that lie flat across the model's thinnest
    level axis the one named so, else the one that shows the largest area.
    """
    # The thinner of the two level axes points out of the wall.
    corners = np.concatenate([m.positions for m in model.meshes])
    extent = np.ptp(corners, axis=0)
    across = 0 if extent[0] < extent[2] else 2
    areas = _areas_of_slots(model, across)
    is_flat = [s for s, (whole, flat_area) in areas.items() if flat_area > _FLAT_SHARE * whole]

    def rank(slot: int) -> tuple[bool, float]:
        name = model.mtl[slot].name.lower() if slot >= 0 else ""
        return any(word in name for word in _NAMES), areas[slot][1]

    return max(is_flat, key=rank, default=None)


def _areas_of_slots(model: ParsedModel, across: int) -> dict[int, list[float]]:
    """Position in the MTL -> all of its area, and what of it lies flat across an axis."""
    areas: dict[int, list[float]] = {}
    for mesh, slot in zip(model.meshes, model.slots, strict=True):
        normals = area_vectors(triangle_corners(mesh.positions, mesh.faces))
        area = np.linalg.norm(normals, axis=1)
        flat = np.abs(normals[:, across]) >= _FLAT_COS * area
        found = areas.setdefault(slot, [0.0, 0.0])
        found[0] += float(area.sum())
        found[1] += float(area[flat].sum())
    return areas


def as_mirror(material: Material) -> Material:
    """The material as a mirror."""
    return replace(
        material,
        kind=MaterialKind.MIRROR,
        specular=(_REFLECTANCE,) * 3,
        texture_id=None,
        opacity=1.0,
        alpha_cutout=False,
    )


# Lights of a placed SUNCG model, each with the bulbs that emit it (docs/spec/suncg.md section 2).


# Power of a lamp that has bulbs but no row in suncgModelLights.json; shared by its bulbs.
ASSUMED_WATT = 60.0


def placed_light(light: LightPart, world_from_model: F64) -> LightPart:
    """A light of a model's frame in the world."""
    points = (
        [light.position] if light.position_end is None else [light.position, light.position_end]
    )
    world = transform_points(world_from_model, np.array(points))
    direction = world_from_model[:3, :3] @ np.array(light.direction)
    direction /= max(float(np.linalg.norm(direction)), 1e-12)
    return replace(
        light,
        position=triple(world[0]),
        position_end=None if light.position_end is None else triple(world[1]),
        direction=triple(direction),
    )


def separate_bulbs(bulb: Surface) -> tuple[Surface, ...]:
    """The connected parts of a bulb material's surface, one per bulb."""
    # Weld equal positions, then find the connected parts of the faces.
    _, same = np.unique(bulb.positions, axis=0, return_inverse=True)
    faces = same.reshape(-1)[bulb.faces]
    n = len(bulb.positions)
    links = coo_array(
        (np.ones(2 * len(faces)), (np.tile(faces[:, 0], 2), faces[:, 1:].T.reshape(-1))),
        shape=(n, n),
    )
    _, part_of_vertex = connected_components(links, directed=False)
    part_of_face = part_of_vertex[faces[:, 0]]
    parts = np.unique(part_of_face)
    if len(parts) == 1:
        return (bulb,)
    return tuple(
        part_of(bulb, bulb.faces[part_of_face == part], f"{bulb.name}_{k}")
        for k, part in enumerate(parts)
    )


def with_emitting_bulbs(
    lights: Sequence[LightPart], surfaces: Sequence[Surface], bulbs: Sequence[int]
) -> tuple[LightPart, ...]:
    """lights with the bulbs (indices into surfaces) that emit each.

    Every bulb belongs to the light nearest to it, and a light without one shares the bulb nearest
    to it. Without lights every bulb is one, of an assumed power; without bulbs none emits, and
    repair adds them.
    """
    if not bulbs:
        return tuple(replace(light, radius_m=BULB_RADIUS_M) for light in lights)
    # Centre and mean radius of each bulb.
    bounds = [(surfaces[b].positions.min(0), surfaces[b].positions.max(0)) for b in bulbs]
    centres = np.array([(low + high) / 2 for low, high in bounds], np.float64)
    radii = [float(np.mean(high - low)) / 2 for low, high in bounds]
    if not lights:
        # Without lights every bulb is one, with an equal share of the assumed power.
        share = 1 / len(bulbs)
        return tuple(
            LightPart(triple(c), r, ASSUMED_WATT, PowerUnit.WATT, share, emitting=(b,))
            for c, r, b in zip(centres, radii, bulbs, strict=True)
        )
    at = np.array([light.position for light in lights])
    # Give every bulb to its nearest light; a light left without shares its nearest bulb.
    distance = np.linalg.norm(at[:, None] - centres[None], axis=2)
    light_of_bulb = distance.argmin(0)
    found = []
    for k, light in enumerate(lights):
        mine = np.flatnonzero(light_of_bulb == k)
        if not len(mine):
            mine = np.array([distance[k].argmin()])
        emitting = tuple(bulbs[int(m)] for m in mine)
        found.append(replace(light, radius_m=radii[int(mine[0])], emitting=emitting))
    return tuple(found)
