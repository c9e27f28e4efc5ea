from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from workers.node.view_batches import batches_from_views


@given(
    st.lists(st.tuples(st.integers(0, 4), st.integers(0, 99)), unique=True, max_size=40),
    st.floats(0.5, 1000),
)
def test_batches_hold_every_view_once_and_no_batch_is_too_long(
    pairs: list[tuple[int, int]], seconds: float
) -> None:
    views = [(f"r{room}_{k}", f"r{room}") for room, k in pairs]
    batches = batches_from_views(views, seconds)
    assert sorted(v for g in batches for v in g) == sorted(v for v, _room in views)
    assert all(len(g) == 1 or len(g) * seconds <= 300 + 1e-6 for g in batches)


def test_a_rooms_views_stay_together() -> None:
    views = [(f"a{k}", "a") for k in range(6)] + [(f"b{k}", "b") for k in range(6)]
    assert [len(g) for g in batches_from_views(views, 30.0)] == [6, 6]


def test_a_small_job_is_cut_into_enough_batches_for_the_slots() -> None:
    views = [(f"a{k}", "a") for k in range(10)]
    assert [len(g) for g in batches_from_views(views, 1.5)] == [10]
    assert [len(g) for g in batches_from_views(views, 1.5, 8)] == [2] * 5
    assert [len(g) for g in batches_from_views(views, 1.5, 100)] == [1] * 10
    assert batches_from_views([], 1.5, 8) == ()
