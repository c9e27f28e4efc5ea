"""Scenes of data sets in the layout of Habitat. No effects before `read`."""

from __future__ import annotations

from pbrs_farm.read.common.format import Format, deferred

# fmt: off
FORMAT = Format(
    kind="habitat", title="Habitat", files="*.scene_instance.json", order=60,
    brings="a stage, objects, regions", where="HSSD-hab, ReplicaCAD, ai2thor-hab",
    licence="of each data set", needs="the extra gltf for compressed files",
    keys=(("stage_instance",),), has_box_only_items=True,
    read=deferred("pbrs_farm.read.habitat.scene_instance:read_habitat"),
    companions=deferred("pbrs_farm.read.habitat.scene_instance:companions_of_habitat"),
)
# fmt: on
