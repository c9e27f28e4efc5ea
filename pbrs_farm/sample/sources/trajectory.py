"""A trajectory of the user's, in TUM's rows; no effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.camera_source import CameraRequest, CameraSource, Sampling

if TYPE_CHECKING:
    from pbrs_farm.sample.walks.trajectory_file import Pose


def _parse(text: str, fields: CameraFields) -> list[Pose]:
    from pbrs_farm.sample.walks.trajectory_file import poses_from_tum

    return poses_from_tum(text, fields.file)


def _views(request: CameraRequest) -> Sampling:
    from pbrs_farm.sample.walks.trajectory_file import trajectory_views

    fields, caster = request.fields, request.caster
    views = trajectory_views(
        request.house, request.content, fields.file, fields, caster.geometry, caster.first_hit
    )
    return Sampling.of_views(fields, views)


SOURCE = CameraSource(
    name="trajectory",
    views=_views,
    help="frames at the poses of a file",
    use="`--trajectory FILE`",
    parse=_parse,
    is_sequence=True,
)
