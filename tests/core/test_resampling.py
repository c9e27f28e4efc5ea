import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrs_farm.core.resampling import resized_any, resized_by_area, resized_nearest
from pbrs_farm.images import resized

SIZES = st.tuples(st.integers(1, 23), st.integers(1, 23))


@given(SIZES, SIZES, st.integers(0, 255))
def test_a_picture_of_one_colour_is_unchanged(size, to, value):
    picture = np.full((size[1], size[0], 3), value, np.uint8)
    assert (resized_by_area(picture, *to) == value).all()


def test_blocks_are_averaged_and_halves_rounded_up():
    picture = np.array([[0, 1, 10, 20], [0, 1, 30, 41]], np.uint8)[..., None]
    assert resized_by_area(picture, 2, 1)[..., 0].tolist() == [[1, 25]]


def test_parts_of_pixels_count_as_much_as_they_cover():
    picture = np.array([[0, 90, 180]], np.uint8)[..., None]
    # 1.5 pixels each: (0 + 90 / 2) / 1.5 and (90 / 2 + 180) / 1.5.
    assert resized_by_area(picture, 2, 1)[..., 0].tolist() == [[30, 150]]


@pytest.mark.parametrize("to", [(8, 6), (10, 7), (50, 30)])
def test_light_is_averaged_linearly_and_keeps_its_type(to):
    light = np.random.default_rng(1).normal(0, 100, (24, 40, 3)).astype(np.float32)
    small = resized_by_area(light, *to)
    assert small.dtype == np.float32
    assert small.mean() == pytest.approx(light.mean(), rel=1e-4)
    by_blocks = light.reshape(6, 4, 8, 5, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(resized_by_area(light, 8, 6), by_blocks, rtol=1e-4, atol=1e-3)
    # A layer of one channel has two axes.
    grey = np.arange(96, dtype=np.uint8).reshape(8, 12)
    assert resized_by_area(grey, 6, 4)[0, 0] == 7  # (0 + 1 + 12 + 13) / 4, rounded up
    assert resized_by_area(grey, 5, 3).shape == (3, 5)


@pytest.mark.parametrize("to", [(8, 6), (10, 7), (5, 5)])
def test_it_is_the_box_filter_of_openimageio_within_rounding(to):
    picture = np.random.default_rng(0).integers(0, 256, (24, 40, 3)).astype(np.uint8)
    ours, theirs = resized_by_area(picture, *to), resized(picture, *to)
    if 40 % to[0] == 0 and 24 % to[1] == 0:
        assert np.abs(ours.astype(int) - theirs).max() <= 1
    # The mean is preserved for any grid.
    assert ours.mean() == pytest.approx(picture.mean(), abs=1)


@given(SIZES, SIZES)
def test_nearest_keeps_values_and_picks_the_pixel_with_the_nearest_centre(size, to):
    rows = np.arange(size[1])[:, None] * 100 + np.arange(size[0])
    small = resized_nearest(rows, *to)
    for r in range(to[1]):
        for c in range(to[0]):
            y, x = divmod(int(small[r, c]), 100)
            assert abs((r + 0.5) * size[1] / to[1] - (y + 0.5)) <= 0.5 + 1e-9
            assert abs((c + 0.5) * size[0] / to[0] - (x + 0.5)) <= 0.5 + 1e-9


@given(SIZES, SIZES, st.integers(0, 22), st.integers(0, 22))
def test_a_line_of_one_pixel_is_never_lost(size, to, x, y):
    mask = np.zeros((size[1], size[0]), bool)
    mask[y % size[1], x % size[0]] = True
    small = resized_any(mask, *to)
    assert small.any()
    assert not resized_any(np.zeros_like(mask), *to).any()
