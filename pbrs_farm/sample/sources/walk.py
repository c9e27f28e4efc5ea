"""A person's walk through the home; no effects."""

from __future__ import annotations

from pbrs_farm.sample.camera_source import CameraRequest, CameraSource, Sampling


def _views(request: CameraRequest) -> Sampling:
    from pbrs_farm.sample.walks.walk_sampler import sample_walk

    caster = request.caster
    return sample_walk(
        request.house, request.fields, request.seed, caster.geometry, caster.first_hit
    )


SOURCE = CameraSource(
    name="walk",
    views=_views,
    help="frames along a path through the home",
    use="`--cameras walk`, `--frames N`, `--fps F`",
    is_sequence=True,
    n_views=lambda fields: fields.walk_frames,
)
