"""The caster's item buffer against OpenGL's rasterizer, which shares no code with it."""

import numpy as np
import pytest

from pbrs_farm.core.camera import Intrinsics
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.recipe import CameraFields
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.sample.house_sampler import sample_cameras

gl_items = pytest.importorskip("tests.sample.gl_items")


def test_item_buffers_agree_with_opengls_but_for_pixels_on_edges() -> None:
    house = builtin_home()
    geometry = geometry_from_house(house)
    caster = Caster(geometry)
    fields = CameraFields(score_width_px=160, score_height_px=120, cell_m=0.5)
    views = sample_cameras(house, fields, 0, caster.item_counts).views
    assert len(views) >= 8
    gl = gl_items.GlItems(geometry, 160, 120)
    try:
        differing = 0
        for view in views:
            camera = view.camera
            rays, drawn = caster.item_buffer(camera), gl.item_buffer(camera)
            assert len(np.unique(rays)) > 3
            differing += int((rays != drawn).sum())
    finally:
        gl.release()
    assert differing <= 0.001 * len(views) * 160 * 120


def test_a_principal_point_off_centre_moves_both_alike() -> None:
    house = builtin_home()
    geometry = geometry_from_house(house)
    camera = sample_cameras(
        house, CameraFields(cell_m=1.0, score_width_px=80, score_height_px=60), 0,
        Caster(geometry).item_counts,
    ).views[0].camera  # fmt: skip
    i = camera.intrinsics
    shifted = Intrinsics(80, 60, i.fx, i.fy * 1.1, i.cx + 7, i.cy - 5)
    moved = type(camera)(shifted, camera.world_from_camera)
    gl = gl_items.GlItems(geometry, 80, 60)
    try:
        assert (Caster(geometry).item_buffer(moved) != gl.item_buffer(moved)).mean() < 0.003
    finally:
        gl.release()
