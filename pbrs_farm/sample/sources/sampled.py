"""Viewpoints of a home by the rules and the score of a preset (paper section 3.1); no effects."""

from __future__ import annotations

from pbrs_farm.sample.camera_source import CameraRequest, CameraSource, Sampling


def _views(request: CameraRequest) -> Sampling:
    from pbrs_farm.sample.house_sampler import sample_cameras

    caster = request.caster
    return sample_cameras(
        request.house, request.fields, request.seed, caster.item_counts, caster.item_pictures
    )


SOURCE = CameraSource(
    name="sampled", views=_views, help="the best of each sector of each room", is_ranked=True
)
