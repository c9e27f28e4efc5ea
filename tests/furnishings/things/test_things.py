"""Generated items are closed, rest on their base and have realistic sizes."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.mesh import closed_edge_share, signed_volume, triangle_corners
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.thing_materials import CLEAR
from pbrs_farm.furnishings.things import books
from pbrs_farm.furnishings.things.book_covers import N_CELLS, book_covers
from pbrs_farm.furnishings.things.things import THINGS

_STYLE = style_for(np.random.default_rng(1), "nordic")
_COVERS = book_covers(np.random.default_rng(2), _STYLE)


def _corners(shape: Shape) -> F64:
    return np.concatenate([triangle_corners(s.positions, s.faces) for s in shape.surfaces])


def _hold(made: Model, most_faces: int = 1500) -> None:
    piece, shape = made
    corners = _corners(shape)
    assert closed_edge_share(np.round(corners, 6)) == 1.0, "closed"
    assert signed_volume(corners, corners.mean((0, 1))) > 0, "faces look outwards"
    assert len(corners) <= most_faces
    low, high = shape.bounds
    assert low[1] == pytest.approx(0, abs=1e-6), "stands on its base"
    assert (low + high)[[0, 2]] == pytest.approx(0, abs=1e-6), "about the origin"
    assert np.asarray(piece.size)[[0, 2, 1]] == pytest.approx(high - low, abs=1e-5)


@pytest.mark.parametrize("name", sorted(THINGS))
def test_an_item_is_closed_and_rests_on_its_base(name: str) -> None:
    for seed in range(6):
        _hold(THINGS[name].make(np.random.default_rng(seed), _STYLE))


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("cup", 0.05, 0.16), ("bottle", 0.17, 0.33), ("laptop", 0.15, 0.3), ("plates", 0.015, 0.06),
     ("cushion", 0.1, 0.16), ("vase", 0.1, 0.67), ("remote", 0.01, 0.03)],
)  # fmt: skip
def test_an_item_has_a_realistic_height(name: str, least: float, most: float) -> None:
    for seed in range(6):
        piece, _ = THINGS[name].make(np.random.default_rng(seed), _STYLE)
        assert least <= piece.size[2] <= most


def test_books_side_by_side_fill_the_given_length() -> None:
    for seed in range(8):
        books_made, last = books.run_of_books(np.random.default_rng(seed), _COVERS, 0.6, 0.24, 0.2)
        _hold(books_made)
        piece, shape = books_made
        assert piece.nyu40 == 23
        assert 0.3 < piece.size[0] <= 0.6 + 1e-6
        assert piece.size[1] <= 0.25
        assert 0.11 <= last <= 0.24
        # Boxes of 12 faces, none inside another.
        solids = _corners(shape).reshape(-1, 12 * 3, 3)
        left, right = solids[..., 0].min(1), solids[..., 0].max(1)
        assert (left[1:] >= right[:-1]).all()


def test_a_short_gap_still_takes_a_book() -> None:
    books_made, _ = books.run_of_books(np.random.default_rng(0), _COVERS, 0.008, 0.2, 0.2)
    assert books_made[0].size[0] <= 0.008 + 1e-6


def test_stacks_and_single_books_are_closed() -> None:
    rng = np.random.default_rng(3)
    for shape in (
        books.stack_of_books(rng, _COVERS, 1), books.stack_of_books(rng, _COVERS, 5),
        books.leaning_book(rng, _COVERS, 0.2, 0.2), books.magazines(rng, _COVERS, 3),
        books.open_book(rng, _COVERS),
    ):  # fmt: skip
        _hold(shape)


def test_a_leaning_book_leans_on_its_left_neighbour_below_its_top() -> None:
    _, shape = books.leaning_book(np.random.default_rng(3), _COVERS, 0.2, 0.2)
    points = _corners(shape).reshape(-1, 3)
    touching = points[points[:, 0] < points[:, 0].min() + 1e-6]
    assert touching[:, 1].max() < 0.2
    assert touching[:, 1].min() > 0.1


def test_every_cell_of_the_covers_is_in_the_picture() -> None:
    for cell in range(N_CELLS):
        for box in (_COVERS.spine(cell), _COVERS.pages(cell), _COVERS.board(cell),
                    _COVERS.paper(cell), _COVERS.front(cell)):  # fmt: skip
            assert 0 <= box[0] < box[2] <= 1
            assert 0 <= box[1] < box[3] <= 1


def test_the_same_seed_gives_the_same_bits() -> None:
    again = book_covers(np.random.default_rng(2), _STYLE)
    assert again.texture == _COVERS.texture
    for name in THINGS:
        first, two = (THINGS[name].make(np.random.default_rng(7), _STYLE) for _ in range(2))
        assert first[0] == two[0], name
        assert first[1].surfaces[0].positions.tobytes() == two[1].surfaces[0].positions.tobytes()


def test_a_jar_is_clear_in_its_middle_and_dark_at_its_outline() -> None:
    # Light passes two walls with two faces each; at 70 degrees its path is longer.
    kd = ((np.array(CLEAR.diffuse) + 0.055) / 1.055) ** 2.4
    passed = (1 - CLEAR.opacity * (1 - kd)) ** 4
    outline = passed ** (1 / np.cos(np.radians(70)))
    assert 0.8 < passed.min() < passed.max() < 0.95
    assert outline.min() < 0.65
