"""The paper's rules (section 3.1) for cameras, asserted for every winner of a home."""

import math

import pytest

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.sample.house_sampler import sample_cameras
from tests.sample.sampled_rooms import IndependentLook, counter_of


def assert_rules(house: House, fields: CameraFields, seed: int) -> int:
    """Assert each of the paper's rules for every winner; returns the number of winners."""
    sampling = sample_cameras(house, fields, seed, counter_of(house))
    look = IndependentLook(house)
    objects = {k + 1 for k, item in enumerate(house.items) if not item.kind.is_structure}
    for view in sampling.views:
        room, camera = house.room(view.room_id), view.camera
        look.assert_rules_of_place(room, camera, fields)

        towards = camera.towards
        assert math.degrees(math.asin(-towards[1])) == pytest.approx(fields.tilt_deg)
        azimuth = math.atan2(towards[2], towards[0]) % (2 * math.pi)
        assert int(azimuth / (2 * math.pi) * fields.n_sectors) == view.sector
        assert camera.world_from_camera[1, 0] == pytest.approx(0)  # no roll

        visible = {k: n for k, n in look.pixels(camera).items() if k in objects}
        least = fields.min_object_fraction * fields.score_width_px * fields.score_height_px
        large = [k for k, n in visible.items() if n >= least + 2]
        barely = [k for k, n in visible.items() if abs(n - least) < 2]
        assert len(large) + len(barely) >= fields.min_objects
        n_pixels = fields.score_width_px * fields.score_height_px
        edges = max(4, 5e-4 * n_pixels)  # rays through an edge, coinciding surfaces
        assert view.score == pytest.approx(sum(visible.values()), abs=edges)
    return len(sampling.views)
