"""The preset that imitates the sampler of the published data (docs/spec/suncg.md section 3.2)."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import ItemKind
from pbrs_farm.core.recipe import CameraFields, recipe_from_name
from pbrs_farm.sample.camera_report import Verdict
from pbrs_farm.sample.house_sampler import sample_cameras
from pbrs_farm.sample.released_rules import room_grid, viewpoint_mask
from pbrs_farm.sample.view_score import released_columns, released_score
from tests.sample.sampled_rooms import box, counter_of, furnished, room_house, shell

RELEASED = recipe_from_name("released").cameras
SMALL = RELEASED.model_copy(update={"score_width_px": 80, "score_height_px": 60, "cell_m": 0.4})


def score_of(*pixels: int) -> float:
    counts = np.array([[640 * 480 - sum(pixels), *pixels]], np.uint32)
    columns = np.arange(1, len(pixels) + 1)
    return float(released_score(counts, columns, RELEASED).score[0])


def test_the_score_is_the_log_of_a_product_of_integer_quotients() -> None:
    assert score_of(3073, 6144, 9300, 40000) == pytest.approx(math.log(1 * 2 * 3 * 13))
    assert score_of(3 * 3072 - 1, 4 * 3072, 5 * 3072, 6 * 3072) == pytest.approx(math.log(240))


def test_exactly_one_percent_is_not_enough_and_three_objects_are_not() -> None:
    assert score_of(3072, 6144, 9300, 40000) == 0
    assert score_of(6144, 9300, 40000) == 0


def test_four_sectors_tilted_by_one_fifth_in_the_published_height_band() -> None:
    house = furnished()
    sampling = sample_cameras(house, SMALL, 0, counter_of(house))
    assert 1 <= len(sampling.views) <= 4
    assert [v.score for v in sampling.views] == sorted(
        (v.score for v in sampling.views), reverse=True
    )
    base = room_grid(house, house.rooms[0]).base_y
    assert base == pytest.approx(-0.1)  # the bottom of the floor's slab, rather than its surface
    for view in sampling.views:
        x, y, z = view.camera.towards
        assert y / math.hypot(x, z) == pytest.approx(-0.2, abs=1e-6)
        assert 1.5 <= view.camera.eye[1] - base <= 1.6
        assert int(math.atan2(z, x) % (2 * math.pi) / (math.pi / 2)) == view.sector
        assert math.exp(view.score) == pytest.approx(round(math.exp(view.score)))


def test_nothing_keeps_a_viewpoint_ten_centimetres_off_an_obstacle() -> None:
    house = furnished()
    trace = sample_cameras(house, SMALL, 0, counter_of(house)).traces[0]
    low, high = house.items[-1].bounds[:, [0, 2]]
    plan = trace.candidates.eye[:, [0, 2]]
    off = np.maximum(np.maximum(low - plan, plan - high), 0)
    near = np.linalg.norm(off, axis=1)
    accepted = trace.verdict >= Verdict.FEW_OBJECTS
    assert (accepted & (near > 0.03) & (near < 0.1)).any()
    assert not (accepted & (near == 0)).any()


def test_low_furniture_blocks_a_viewpoint_above_it() -> None:
    table = box((1, 0, 1), (2, 0.7, 2), name="table")
    house = room_house([*shell(4, 3), table], 4, 3)
    grid = room_grid(house, house.rooms[0])
    _floor, allowed, cell = viewpoint_mask(house, house.rooms[0], 0.0)
    assert cell == 0.05
    column, row = round((1.5 - grid.x_min) / cell), round((1.5 - grid.z_min) / cell)
    assert not allowed[row, column]
    assert allowed[row, round((3 - grid.x_min) / cell)]


def test_a_clearance_erodes_the_mask() -> None:
    house = room_house(shell(4, 3), 4, 3)
    room = house.rooms[0]
    _floor, loose, cell = viewpoint_mask(house, room, 0.0)
    _floor, tight, finer = viewpoint_mask(house, room, 0.5)
    assert finer == 0.1
    assert tight.sum() * finer**2 < loose.sum() * cell**2
    assert tight.sum() * finer**2 == pytest.approx(3 * 2, rel=0.15)


def test_only_objects_of_the_room_count_and_neither_stairs_nor_boxes() -> None:
    things = [
        box((0, 0, 0), (1, 1, 1)),
        replace(box((0, 0, 0), (1, 1, 1)), room_id="0_1"),
        box((0, 0, 0), (1, 1, 1), ItemKind.STAIRS),
        replace(box((0, 0, 0), (1, 1, 1)), tags=("box",)),
        box((0, 0, 0), (1, 1, 1), ItemKind.WINDOW),
        replace(box((0, 0, 0), (1, 1, 1)), tags=("structure",)),  # a column or partition
    ]
    house = room_house(things, 4, 3)
    assert released_columns(house, house.rooms[0]).tolist() == [1, 5]


@pytest.mark.parametrize("missing", ["has_floor", "has_ceiling"])
def test_a_room_without_floor_or_ceiling_has_no_camera_with_a_reason(missing: str) -> None:
    house = room_house(furnished().items, 4, 5, **{missing: False})
    sampling = sample_cameras(house, SMALL, 0, counter_of(house))
    assert not sampling.views
    assert "floor and a ceiling" in sampling.report.rooms[0].reason


def test_the_presets_numbers_are_the_published_ones() -> None:
    assert RELEASED.n_sectors == 4
    assert RELEASED.min_objects == 4
    assert RELEASED.clearance_m == 0
    assert math.tan(math.radians(RELEASED.tilt_deg)) == pytest.approx(0.2)
    assert CameraFields().n_sectors == 6
