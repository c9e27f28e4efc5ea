"""The views of a house, by the source of cameras that the recipe names. Effects: reads a user's camera file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pbrs_farm.core.camera import View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import CameraFields, LensFields, Recipe, RigFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.step_cache import camera_file_text
from pbrs_farm.sample.camera_source import CameraRequest, Sampling, source_of
from pbrs_farm.sample.house_sampler import add_rig_views


def chosen_cameras(house: House, recipe: Recipe, seed: int, caster: Caster) -> Sampling:
    """The views by cameras.source with all cameras of rigs, and the report; BadInput without cameras."""
    fields = recipe.judged_cameras
    source, content = source_of(fields), file_content(fields)
    options = source.options_of(fields.source)
    sampling = source.views(CameraRequest(house, fields, seed, caster, content, options))
    views = add_rig_views(sampling.views, recipe.rig_in_use)
    report = sampling.report.model_copy(update={"n_views": len(views)})
    return replace(sampling, views=views, report=report)


def file_content(fields: CameraFields) -> Any:
    """The parsed camera file or trajectory of a source that needs one, else None; BadInput if damaged."""
    parse = source_of(fields).parse
    return parse(camera_file_text(fields), fields) if parse is not None else None


def with_lens(view: View, lens: LensFields, rig: RigFields | None = None) -> View:
    """The view, which was chosen through a pin-hole, through its own lens; BadInput for a fold.

    lens: the recipe's. rig: what the view's camera is of; one of its cameras may have another lens.
    Size, focal lengths and principal point become those that the lens states; one that states none
    keeps the view's. The pose stays. BadInput too for a fisheye without a focal length or field of
    view.
    """
    chosen, place = view.camera.intrinsics, view.rig
    try:
        if rig is not None and place is not None:
            rig_camera = next(camera for camera in rig.cameras if camera.name == place.camera)
            intrinsics = rig_camera.intrinsics(chosen, lens)
        else:
            intrinsics = lens.intrinsics(chosen)
    except ValueError as error:
        raise BadInput("lens", view.id, str(error)) from None
    return replace(view, camera=replace(view.camera, intrinsics=intrinsics))
