import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.samples.view_order import shard_order, view_order, whole_order

pytestmark = pytest.mark.study

COUNTS = st.lists(st.integers(1, 30), min_size=1, max_size=12)


def rows(order: np.ndarray) -> list[tuple[int, int]]:
    return [tuple(row) for row in order.tolist()]


@given(COUNTS, st.integers(1, 8), st.integers(0, 3), st.integers(0, 3))
def test_readers_share_all_views_and_none_is_read_twice(counts, n_parts, seed, epoch):
    if sum(counts) < n_parts:
        with pytest.raises(BadInput, match="readers"):
            shard_order(counts, seed=seed, epoch=epoch, n_parts=n_parts)
        return
    parts = [
        rows(shard_order(counts, seed=seed, epoch=epoch, part=p, n_parts=n_parts))
        for p in range(n_parts)
    ]
    assert len({len(part) for part in parts}) == 1
    read = [row for part in parts for row in part]
    assert len(set(read)) == len(read) > sum(counts) - n_parts
    assert all(0 <= position < counts[shard] for shard, position in read)
    whole = [
        row for p in range(n_parts) for row in rows(whole_order(counts, part=p, n_parts=n_parts))
    ]
    assert sorted(whole) == [(s, k) for s, n in enumerate(counts) for k in range(n)]


def test_every_view_is_read_in_time_though_parts_are_equal():
    all_rows = {row for epoch in range(40) for p in range(2)
            for row in rows(shard_order([7], seed=0, epoch=epoch, part=p, n_parts=2))}  # fmt: skip
    assert len(all_rows) == 7


def test_the_order_follows_from_seed_and_epoch():
    def order(seed, epoch):
        return rows(shard_order([20, 20, 20], seed=seed, epoch=epoch))

    assert order(0, 0) == order(0, 0)
    assert len({tuple(order(s, e)) for s in range(3) for e in range(3)}) == 9


def test_a_reader_opens_only_its_shards():
    for part in range(4):
        order = shard_order([50] * 20, seed=1, epoch=0, part=part, n_parts=4)
        assert len(np.unique(order[:, 0])) <= 6


def test_views_of_several_shards_are_mixed():
    order = shard_order([100] * 4, seed=0, epoch=0)
    assert (np.diff(order[:50, 0]) != 0).sum() > 20


def test_ranks_share_the_views_of_a_root():
    parts = [view_order(10, seed=3, epoch=1, part=p, n_parts=3).tolist() for p in range(3)]
    assert [len(p) for p in parts] == [3, 3, 3]
    assert len({k for p in parts for k in p}) == 9
