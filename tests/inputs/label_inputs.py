"""Inputs of the label functions for a house and a camera."""

from pbrs_farm import truth
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.raycast.caster import Caster


def label_inputs_of(
    home: House, view: Camera, textures: dict | None = None, seed: int = 0
) -> truth.LabelInputs:
    geometry = geometry_from_house(home)
    caster = Caster(geometry)
    record = caster.hit_record(view)
    return truth.LabelInputs(
        record,
        home,
        geometry,
        view,
        lambda skip: caster.hit_record(view, skip_faces=skip),
        textures or {},
        seed,
        first_hit=caster.first_hit,
    )
