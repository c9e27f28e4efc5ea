"""Which views a house gets: sampled, stored, walked, or those of the user's file. Effects: reads that file."""

from __future__ import annotations

from dataclasses import replace

from pbrs_farm.core.camera import View
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import House
from pbrs_farm.core.plugins import plugins
from pbrs_farm.core.recipe import CameraFields, LensFields, Recipe, RigFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.step_cache import camera_file_text
from pbrs_farm.sample.camera_file import cameras_from_file_text
from pbrs_farm.sample.camera_report import CameraReport
from pbrs_farm.sample.house_sampler import Sampling, add_rig_views, sample_cameras
from pbrs_farm.sample.stored_cameras import views_from_cameras
from pbrs_farm.sample.walks.trajectory_file import poses_from_tum, trajectory_views
from pbrs_farm.sample.walks.walk_sampler import sample_walk


def chosen_cameras(house: House, recipe: Recipe, seed: int, caster: Caster) -> Sampling:
    """The views by cameras.source and the report on them, those of all cameras of a rig among them.

    caster: of this house, panes included. Raises BadInput for a file that gives no cameras.
    """
    sampling = _one_by_one(house, recipe.judged_cameras, seed, caster)
    views = add_rig_views(sampling.views, recipe.rig_in_use)
    report = sampling.report.model_copy(update={"n_views": len(views)})
    return replace(sampling, views=views, report=report)


def check_camera_file(fields: CameraFields) -> None:
    """Raise BadInput for a camera file or trajectory that cannot be read, before a home is.

    Reads and parses the whole file and keeps nothing. Does nothing for cameras of other sources.
    """
    if fields.source == "trajectory":
        poses_from_tum(camera_file_text(fields), fields.file)
    elif fields.source == "file":
        text, size = camera_file_text(fields), (fields.score_width_px, fields.score_height_px)
        cameras_from_file_text(text, fields.file, *size)


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
            own = next(camera for camera in rig.cameras if camera.name == place.camera)
            intrinsics = own.intrinsics(chosen, lens)
        else:
            intrinsics = lens.intrinsics(chosen)
    except ValueError as error:
        raise BadInput("lens", view.id, str(error)) from None
    return replace(view, camera=replace(view.camera, intrinsics=intrinsics))


def _one_by_one(house: House, fields: CameraFields, seed: int, caster: Caster) -> Sampling:
    if fields.source == "given":
        hint = "render them there, or --set cameras.source=sampled"
        raise BadInput("cameras.source", "given", "these cameras come from Python", hint=hint)
    if fields.source == "sampled" and fields.preset in plugins("cameras"):
        sample = plugins("cameras")[fields.preset].load()
        views = tuple(sample(house, fields, seed, caster))
        return Sampling(views, _report_of_file(fields, views), ())
    if fields.source == "walk":
        return sample_walk(house, fields, seed, caster.geometry, caster.first_hit)
    if fields.source == "file":
        given = cameras_from_file_text(
            camera_file_text(fields), fields.file, fields.score_width_px, fields.score_height_px
        )
        views = views_from_cameras(house, given, fields, caster.item_counts, origin="file")
        return Sampling(views, _report_of_file(fields, views), ())
    if fields.source == "trajectory":
        poses = poses_from_tum(camera_file_text(fields), fields.file)
        views = trajectory_views(
            house, poses, fields.file, fields, caster.geometry, caster.first_hit
        )
        return Sampling(views, _report_of_file(fields, views), ())
    return sample_cameras(house, fields, seed, caster.item_counts, caster.depth_pictures)


def _report_of_file(fields: CameraFields, views: tuple[View, ...]) -> CameraReport:
    return CameraReport(
        preset=fields.preset, source=fields.source, n_views=len(views),
        n_candidates=len(views), refused={}, rooms=(),
    )  # fmt: skip
