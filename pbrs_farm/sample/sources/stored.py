"""Cameras that the home's author placed; no effects."""

from __future__ import annotations

from pbrs_farm.sample.camera_source import CameraRequest, CameraSource, Sampling


def _views(request: CameraRequest) -> Sampling:
    from pbrs_farm.sample.stored_cameras import stored_views

    views, notes = stored_views(request.house, request.fields, request.caster.item_counts)
    return Sampling.of_views(request.fields, views, notes)


SOURCE = CameraSource(name="stored", views=_views, help="cameras in the home's own file")
