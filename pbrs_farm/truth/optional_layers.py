"""Optional label layers: made when asked for, from the same hit record; no effects."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import FirstHit, HitRecord, Mask
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.classes import NYU13_FROM_NYU40
from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.house import Geometry, House, MaterialKind
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lenses import Lens
from pbrs_farm.core.plugins import plugins
from pbrs_farm.truth.articulation import part_label
from pbrs_farm.truth.boundary import instance_boundary, typed_boundaries
from pbrs_farm.truth.depth_sensor import kinect_reading
from pbrs_farm.truth.mirrored_hits import mirror_faces, mirrored_hits
from pbrs_farm.truth.optical_flow import (
    Correspondence,
    OtherTime,
    Relation,
    correspondence,
    disparity_label,
    flow_kitti,
    flow_label,
    scene_flow_label,
)
from pbrs_farm.truth.pierced_surfaces import PiercedSurfaces, pierced_surfaces
from pbrs_farm.truth.projector import projector_label
from pbrs_farm.truth.sensor_reading import Reading, hole_label
from pbrs_farm.truth.standard_layers import (
    depth_mm,
    encoded_normal,
    instance_label,
    normal_label,
    semantic_label,
)
from pbrs_farm.truth.stereo_sensor import D455, stereo_reading
from pbrs_farm.truth.surface_layers import (
    albedo_label,
    albedo_of_points,
    f0_label,
    hha_label,
    metallic_label,
    nocs_label,
    roughness_label,
    shading_normals,
)
from pbrs_farm.truth.tof_sensor import AZURE, L515, tof_reading

HitWithout = Callable[[Mask], HitRecord]  # (F,) bool faces to ignore -> the same camera's hits


@dataclass(frozen=True)
class LabelInputs:
    """Inputs of the optional layers of one view."""

    hit: HitRecord
    house: House
    geometry: Geometry  # of house: what hit.face counts in
    camera: Camera
    hit_without: HitWithout  # for the layers behind glass
    textures: Mapping[str, NDArray[np.uint8]]  # id -> (H, W, 3 or 4) sRGB, row 0 = top
    seed: int = 0  # of depth_sensor's noise
    partners: Mapping[Relation, Camera] = field(default_factory=dict)  # at this picture's size
    first_hit: FirstHit | None = None  # for the layers between views and behind mirrors
    times: Mapping[Relation, OtherTime] = field(default_factory=dict)  # of partners, if items moved
    max_albedo: float = 1.0  # that light holds diffuse colour times texture to

    @cached_property
    def behind(self) -> HitRecord:
        """The hit record behind glass: the first hit on neither glass nor pane."""
        transparent = transparent_faces(self.geometry, self.house)
        return self.hit_without(transparent) if transparent.any() else self.hit

    @cached_property
    def behind_mirror(self) -> HitRecord:
        """Hits reflected by mirrors; ValueError without first_hit if there is a mirror."""
        mirrors = mirror_faces(self.geometry, self.house)
        if not mirrors.any() or not (self.hit.valid & mirrors[self.hit.face]).any():
            return self.hit
        if self.first_hit is None:
            raise ValueError("what mirrors show needs first_hit")
        return mirrored_hits(
            self.hit, self.camera, self.geometry, self.house, self.first_hit, self.textures
        )

    @cached_property
    def surfaces(self) -> PiercedSurfaces:
        """All surfaces along the pixels' rays; ValueError without first_hit if anything is hit."""
        return pierced_surfaces(self.hit, self.camera, self.geometry, self.first_hit)

    @cached_property
    def to_partners(self) -> dict[Relation, Correspondence]:
        """Where the hits lie in the picture of each partner."""
        if self.first_hit is None:
            return {}
        cast = self.first_hit
        return {
            relation: correspondence(self.hit, self.camera, camera, cast, self.times.get(relation))
            for relation, camera in self.partners.items()
        }

    @cached_property
    def boundaries(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Occlusion and crease boundaries."""
        return typed_boundaries(self.hit, self.camera)


def transparent_faces(geometry: Geometry, house: House) -> Mask:
    """(F,) bool: the face's material is glass or a pane."""
    kinds = (MaterialKind.GLASS, MaterialKind.PANE)
    transparent = np.array([m.kind in kinds for m in house.materials], bool)
    if not len(transparent):
        return np.zeros(len(geometry.faces), bool)
    return transparent[geometry.face_material]


def source_classes(house: House) -> tuple[str, ...]:
    """The source's own classes in this house, sorted; id k of class_source.png is entry k - 1."""
    return tuple(sorted({item.source_class for item in house.items if item.source_class}))


def _class_source(inputs: LabelInputs) -> NDArray[np.uint16]:
    # Look the class's number up by instance id; entry 0 is nothing.
    number = {name: k for k, name in enumerate(source_classes(inputs.house), start=1)}
    table = np.array([0, *(number.get(i.source_class, 0) for i in inputs.house.items)], np.uint16)
    return table[inputs.hit.item]


def _material(inputs: LabelInputs) -> NDArray[np.uint16]:
    if len(inputs.house.materials) > 65535:
        n = len(inputs.house.materials)
        raise BadHouse(
            inputs.house.source.file, "materials", f"{n} materials, a 16-bit layer holds 65535"
        )
    if not len(inputs.geometry.faces):
        return np.zeros(inputs.hit.face.shape, np.uint16)
    # Count materials from 1, so that 0 is nothing.
    number = inputs.geometry.face_material[inputs.hit.face] + 1
    return np.where(inputs.hit.valid, number, 0).astype(np.uint16)


def _mask(inputs: LabelInputs, faces: Mask) -> NDArray[np.uint8]:
    """(H, W) 255 where one of faces (F,) is hit first."""
    if not faces.any():
        return np.zeros(inputs.hit.face.shape, np.uint8)
    return np.where(inputs.hit.valid & faces[inputs.hit.face], 255, 0).astype(np.uint8)


def _normal(inputs: LabelInputs, hit: HitRecord) -> NDArray[np.uint16]:
    return normal_label(hit.geo_normal_world, inputs.camera.world_from_camera)


def _normal_shading(inputs: LabelInputs) -> NDArray[np.uint16]:
    normals = shading_normals(inputs.hit, inputs.house, inputs.geometry, inputs.textures)
    return normal_label(normals, inputs.camera.world_from_camera)


def _projector(inputs: LabelInputs) -> NDArray[np.uint8]:
    if inputs.first_hit is None:
        return np.zeros(inputs.hit.face.shape, np.uint8)
    s, partner = inputs, inputs.partners.get("stereo")
    albedo = albedo_label(s.hit, s.house, s.geometry, s.textures, s.max_albedo)
    return projector_label(s.hit, s.camera, partner, albedo, inputs.first_hit)


def _clear_surfaces(inputs: LabelInputs) -> NDArray[np.uint8]:
    face = inputs.surfaces.face
    clear = np.append(transparent_faces(inputs.geometry, inputs.house), False)  # the last: face -1
    return np.where(clear[face], np.uint8(255), np.uint8(0))


def _sensor_depth(inputs: LabelInputs, sensor: str) -> NDArray[np.uint16]:
    return _SENSORS[sensor](inputs).depth_mm


def _hole(inputs: LabelInputs, sensor: str) -> NDArray[np.uint8]:
    s, is_hit = inputs, inputs.hit.valid
    reflectance = np.zeros(is_hit.shape)
    if is_hit.any():
        points = s.hit.face[is_hit], s.hit.points.uv[is_hit]
        albedo = albedo_of_points(*points, s.house, s.geometry, s.textures)
        # As for laser scans: dyes are bright in infrared, so the brightest channel counts.
        reflectance[is_hit] = albedo.max(1)
    clear = _mask(s, transparent_faces(s.geometry, s.house)) > 0
    mirror = _mask(s, mirror_faces(s.geometry, s.house)) > 0
    return hole_label(_SENSORS[sensor](s), s.hit, s.camera, clear, mirror, reflectance)


# The depth sensors, by what follows the names of their layers.
_SENSORS: Mapping[str, Callable[[LabelInputs], Reading]] = {
    "": lambda s: kinect_reading(s.hit, s.camera, seed=s.seed),
    "_tof": lambda s: tof_reading(s.hit, s.camera, seed=s.seed),
    "_stereo": lambda s: stereo_reading(s.hit, s.camera, seed=s.seed),
    "_d455": lambda s: stereo_reading(s.hit, s.camera, seed=s.seed, sensor=D455),
    "_azure": lambda s: tof_reading(s.hit, s.camera, seed=s.seed, sensor=AZURE),
    "_l515": lambda s: tof_reading(s.hit, s.camera, seed=s.seed, sensor=L515),
}

# How each optional layer of core/layers.py is computed.
_LAYER_FUNCTIONS: Mapping[str, Callable[[LabelInputs], NDArray[Any]]] = {
    # Geometry of the hit.
    "depth_z": lambda s: s.hit.depth_z,
    "position": lambda s: s.hit.points.position_world,
    "normal_shading": _normal_shading,
    "normal_world": lambda s: encoded_normal(s.hit.geo_normal_world),
    "nocs": lambda s: nocs_label(s.hit, s.house),
    # Appearance and classes of the hit.
    "albedo": lambda s: albedo_label(s.hit, s.house, s.geometry, s.textures, s.max_albedo),
    "material": _material,
    "nyu13": lambda s: NYU13_FROM_NYU40[semantic_label(s.hit.item, s.house)],
    "class_source": _class_source,
    "roughness": lambda s: roughness_label(s.hit, s.house, s.geometry, s.textures),
    "metallic": lambda s: metallic_label(s.hit, s.house, s.geometry),
    "f0": lambda s: f0_label(s.hit, s.house, s.geometry),
    "glass": lambda s: _mask(s, transparent_faces(s.geometry, s.house)),
    "mirror": lambda s: _mask(s, mirror_faces(s.geometry, s.house)),
    "part": lambda s: part_label(s.hit, s.house, s.geometry),
    # The first hit behind glass.
    "behind_glass_depth": lambda s: depth_mm(s.behind.depth_z),
    "behind_glass_normal": lambda s: _normal(s, s.behind),
    "behind_glass_semantic": lambda s: semantic_label(s.behind.item, s.house),
    "behind_glass_instance": lambda s: instance_label(s.behind.item, s.house),
    # Reflections in mirrors.
    "behind_mirror_depth": lambda s: depth_mm(s.behind_mirror.depth_z),
    "behind_mirror_normal": lambda s: _normal(s, s.behind_mirror),
    "behind_mirror_semantic": lambda s: semantic_label(s.behind_mirror.item, s.house),
    "behind_mirror_instance": lambda s: instance_label(s.behind_mirror.item, s.house),
    # All surfaces along the ray.
    "depth_layers": lambda s: depth_mm(s.surfaces.depth_z),
    "depth_layers_semantic": lambda s: semantic_label(s.surfaces.item, s.house),
    "depth_layers_instance": lambda s: instance_label(s.surfaces.item, s.house),
    "depth_layers_clear": _clear_surfaces,
    # Edges, and what sensors and encoders make of depth.
    "boundary_occlusion": lambda s: s.boundaries[0],
    "boundary_semantic": lambda s: instance_boundary(semantic_label(s.hit.item, s.house)),
    "boundary_crease": lambda s: s.boundaries[1],
    "hha": lambda s: hha_label(s.hit, s.camera),
    "projector": _projector,
    **{f"depth_sensor{k}": partial(_sensor_depth, sensor=k) for k in _SENSORS},
    **{f"depth_hole{k}": partial(_hole, sensor=k) for k in _SENSORS},
    # Where the hits lie in other views.
    "flow_forward": lambda s: flow_label(s.to_partners["next"]),
    "flow_forward_kitti": lambda s: flow_kitti(s.to_partners["next"]),
    "occlusion_forward": lambda s: s.to_partners["next"].state,
    "scene_flow": lambda s: scene_flow_label(s.hit, s.camera, s.times.get("next")),
    "flow_backward": lambda s: flow_label(s.to_partners["previous"]),
    "flow_backward_kitti": lambda s: flow_kitti(s.to_partners["previous"]),
    "occlusion_backward": lambda s: s.to_partners["previous"].state,
    "disparity": lambda s: disparity_label(s.to_partners["stereo"]),
    "occlusion_stereo": lambda s: s.to_partners["stereo"].state,
}

OPTIONAL_NAMES = tuple(_LAYER_FUNCTIONS)


def optional_layers(names: Collection[str], inputs: LabelInputs) -> dict[str, NDArray[Any]]:
    """The named optional layers, as layers.py says: PNG arrays, and float32 for the EXR ones.

    A layer between views is left out if the view has no such partner. Raises KeyError for a name that is no optional
    label layer, BadInput for one that needs planar depth from a lens without.
    """
    check_lens(names, inputs.camera.intrinsics.lens)
    available = [n for n in names if not LAYER[n].partner or LAYER[n].partner in inputs.to_partners]
    return {name: _function(name)(inputs) for name in available}


def _function(name: str) -> Callable[[LabelInputs], NDArray[Any]]:
    if name in _LAYER_FUNCTIONS:
        return _LAYER_FUNCTIONS[name]
    label: Callable[[LabelInputs], NDArray[Any]] = plugins("layers")[name].load().label
    return label


def check_lens(names: Collection[str], lens: Lens) -> None:
    """Raise BadInput for a named layer that a lens cannot have, before rendering. Ignores unknown names."""
    for layer in (LAYER[name] for name in names if name in LAYER):
        if layer.needs == "planar depth" and not lens.depth_is_planar:
            text = f"needs depth along the axis, which lens.model {lens.model} has not"
            raise BadInput(
                "--layers", layer.name, text, hint="lens.model pinhole, radtan or opencv"
            )
        if layer.needs == "rows" and not lens.is_pinhole:
            text = f"needs rows that correspond, which lens.model {lens.model} has not"
            raise BadInput("--layers", layer.name, text, hint="lens.model pinhole")


def optional_tables(names: Collection[str], house: House) -> dict[str, Any]:
    """Tables of view.json, "materials" and "source_classes" by id from 1, of the layers that need them."""
    tables: dict[str, Any] = {}
    if "material" in names:
        tables["materials"] = {
            str(k): {"name": m.name, "kind": str(m.kind)}
            for k, m in enumerate(house.materials, start=1)
        }
    if "class_source" in names:
        classes = source_classes(house)
        tables["source_classes"] = {str(k): name for k, name in enumerate(classes, start=1)}
    return tables
