import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pbrs_farm.truth.boundary import instance_boundary


def by_the_text(ids: np.ndarray) -> np.ndarray:
    """Boundaries by the published definition, pixel by pixel."""
    height, width = ids.shape
    out = np.zeros(ids.shape, np.uint8)
    for r in range(height):
        for c in range(width):
            block = ids[r : r + 2, c : c + 2]
            across = (block[:, :-1] != block[:, 1:]).any()
            down = (block[:-1] != block[1:]).any()
            out[r, c] = 255 if across or down else 0
    return out


@given(
    arrays(np.uint16, st.tuples(st.integers(1, 6), st.integers(1, 6)), elements=st.integers(0, 2))
)
def test_boundary_is_the_published_definition(ids):
    assert (instance_boundary(ids) == by_the_text(ids)).all()


def test_a_vertical_edge_marks_the_pixel_left_of_it_only():
    ids = np.array([[1, 1, 2, 2]] * 3)
    assert (instance_boundary(ids) > 0).tolist() == [[False, True, False, False]] * 3


def test_the_bottom_right_corner_is_never_boundary():
    assert instance_boundary(np.arange(9).reshape(3, 3))[2, 2] == 0
