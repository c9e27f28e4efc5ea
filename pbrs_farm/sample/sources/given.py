"""Cameras from Python, which `pbrs_farm.render` writes before the step runs; no effects."""

from __future__ import annotations

from typing import NoReturn

from pbrs_farm.core.errors import BadInput
from pbrs_farm.sample.camera_source import CameraRequest, CameraSource


def _views(_request: CameraRequest) -> NoReturn:
    hint = "render them there, or --set cameras.source=sampled"
    raise BadInput("cameras.source", "given", "these cameras come from Python", hint=hint)


SOURCE = CameraSource(
    name="given", views=_views, help="cameras from Python", use="`pf.render`", is_sequence=None
)
