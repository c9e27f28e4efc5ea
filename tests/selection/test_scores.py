"""Scores follow the paper, with either library; tables merge in any order."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.lighting import Mode
from pbrs_farm.formats.histogram_json import PictureQuality
from pbrs_farm.selection.histogram_pack import (
    bytes_from_pack,
    pack_from_bytes,
    pack_house,
    pack_source,
)
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.scores import SCORES, Scorer, merge_tables, score
from pbrs_farm.selection.similarity import best_match, intersection
from tests.hypothesis_profiles import examples
from tests.selection.histogram_sets import FIELDS, pack, record, reference


def plain_scores(counts: np.ndarray, references: np.ndarray) -> np.ndarray:
    """Paper section 3.3 in ten lines: best sum of bin-wise minima of normalised histograms."""
    best = []
    for view in counts.astype(float):
        view = view / view.sum() if view.sum() else view
        top = 0.0
        for row in references.astype(float):
            row = row / row.sum()
            top = max(top, sum(min(a, b) for a, b in zip(view, row)))
        best.append(top)
    return np.array(best)


@pytest.mark.parametrize("library", ["faiss", "numpy"])
def test_scores_agree_with_ten_lines_of_python(library: str) -> None:
    ref, house = reference(12), pack("a", 14)
    table = score([house], ref, library=library)
    binning = ref.facts.binning
    expected_colour = plain_scores(
        coarser_colour(house.colour, binning.colour), coarser_colour(ref.colour, binning.colour)
    )
    expected_depth = plain_scores(
        coarser_depth(house.depth, binning.depth), coarser_depth(ref.depth, binning.depth)
    )
    order = np.argsort(house.views)
    assert np.abs(table["colour_score"].to_numpy() - expected_colour[order]).max() < 1e-6
    assert np.abs(table["depth_score"].to_numpy() - expected_depth[order]).max() < 1e-6


@settings(max_examples=examples(40), deadline=None)
@given(st.integers(1, 40), st.integers(2, 30), st.integers(2, 70), st.integers(0, 10**6))
@example(3, 2, 2, 0)  # one reference is empty
def test_faiss_and_numpy_find_the_same_best(n: int, m: int, bins: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, r = (normalised(rng.integers(0, 9, (k, bins))) for k in (n, m))
    a, i = best_match(q, r, library="faiss")
    b, j = best_match(q, r, library="numpy")
    assert np.allclose(a, b, atol=1e-6, rtol=0)
    assert np.allclose(intersection(q, r[i]), intersection(q, r[j]), atol=1e-6, rtol=0)


@pytest.mark.parametrize("library", ["faiss", "numpy"])
def test_left_out_images_never_match_themselves_but_match_a_twin(library: str) -> None:
    rng = np.random.default_rng(0)
    r = normalised(rng.integers(1, 9, (6, 20)))
    best, index = best_match(r, r, leave_out_self=True, library=library)
    assert not (index == np.arange(6)).any()
    assert best.max() < 1
    twins = np.concatenate([r, r[2:3]])
    best, index = best_match(twins, twins, leave_out_self=True, library=library)
    assert (index[2], index[6]) == (6, 2)
    assert best[2] == pytest.approx(1)


def test_score_of_an_equal_histogram_is_one_and_of_a_disjoint_one_zero() -> None:
    shares = np.eye(4, dtype=np.float32)
    best, index = best_match(shares[[2, 0]], shares[:3])
    assert best.tolist() == [1, 1]
    assert index.tolist() == [2, 0]
    assert best_match(shares[3:], shares[:3])[0].tolist() == [0]


def test_blocks_of_references_do_not_change_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    q, r = (normalised(rng.integers(0, 9, (k, 24))) for k in (50, 40))
    whole = best_match(q, r, library="faiss")
    monkeypatch.setattr("pbrs_farm.selection.similarity.CACHE_BYTES", 7 * 4 * 24)
    blocks = best_match(q, r, library="faiss")
    assert np.array_equal(whole[0], blocks[0])


def test_an_empty_histogram_scores_zero() -> None:
    ref = normalised(np.ones((2, 4), np.uint32))
    assert best_match(np.zeros((1, 4), np.float32), ref)[0].tolist() == [0]


def test_bins_that_no_reference_has_change_nothing_but_the_mass() -> None:
    r = np.array([[0.5, 0.5, 0], [0.1, 0.9, 0]], np.float32)
    q = np.array([[0.2, 0.3, 0.5]], np.float32)
    for library in ("faiss", "numpy"):
        best, _ = best_match(q, r, library=library)
        assert best[0] == pytest.approx(0.5)


def test_batches_do_not_change_scores() -> None:
    ref, packs = reference(), [pack(name, 5) for name in "abcd"]
    whole = Scorer(ref).score(packs)
    assert merge_tables(*Scorer(ref).score_all(packs, batch_views=6)).equals(merge_tables(whole))


def test_merging_is_associative_commutative_and_idempotent() -> None:
    a, b, c = (score([pack(name, n)], reference()) for name, n in (("a", 4), ("b", 3), ("c", 5)))
    whole = merge_tables(a, b, c)
    assert merge_tables(merge_tables(a, b), c).equals(whole)
    assert merge_tables(a, merge_tables(b, c)).equals(whole)
    assert merge_tables(c, b, a).equals(whole)
    assert merge_tables(whole, whole, b).equals(whole)
    assert merge_tables(whole).equals(whole)
    assert merge_tables().equals(SCORES.empty_table())


def test_two_different_scores_of_one_view_are_rejected() -> None:
    a, b = score([pack("a", 2)], reference(seed=0)), score([pack("a", 2)], reference(seed=1))
    with pytest.raises(ValueError, match="two different values"):
        merge_tables(a, b)


def test_a_view_without_the_mode_is_scored_on_another_only_on_request() -> None:
    rng = np.random.default_rng(0)
    rows = [record("a", "0_0_0", rng, modes=(Mode.OPENGL_DL,)), record("a", "0_0_1", rng)]
    silent = score([pack_house("a", "s", FIELDS, rows)], reference())
    assert silent["fault"].to_pylist() == ["unscored", ""]
    assert silent["colour_score"].to_pylist()[0] is None
    scored = score([pack_house("a", "s", FIELDS, rows, score_mode=Mode.OPENGL_DL)], reference())
    assert scored["mode"].to_pylist() == ["opengl_dl", "mlt_il_ol"]
    assert scored["colour_score"].null_count == 0


def test_modes_with_dark_or_blown_pictures_are_named() -> None:
    row = record("a", "0_0_0", np.random.default_rng(0))
    dark = {Mode.MLT_OL: 1 / 255, Mode.OPENGL_IL: 0.0, Mode.OPENGL_DL: 2 / 255}
    bright = {m: PictureQuality(brightness=round(b, 5), blown=0.0) for m, b in dark.items()}
    row = row.model_copy(update={"picture": row.picture | bright})
    assert score([pack_house("a", "s", FIELDS, [row])], reference())["black"].to_pylist() == [
        "mlt_ol opengl_il"
    ]


def test_a_view_that_cannot_be_read_is_marked_and_the_rest_is_scored() -> None:
    rows = [record("a", "0_0_1", np.random.default_rng(0))]
    house = pack_house("a", "s", FIELDS, rows, failed={"0_0_0": "damaged"})
    table = score([house], reference())
    assert table["view"].to_pylist() == ["0_0_0", "0_0_1"]
    assert table["fault"].to_pylist() == ["damaged", ""]
    assert table["colour_score"].is_valid().to_pylist() == [False, True]


def test_a_pack_survives_its_bytes() -> None:
    house = pack("a", 3)
    data = bytes_from_pack(house)
    back = pack_from_bytes(data, "x")
    assert bytes_from_pack(back) == data
    assert back.views == house.views
    assert back.settings == FIELDS
    assert np.array_equal(back.colour, house.colour)
    assert np.array_equal(back.quality, house.quality)
    assert pack_source(data) == "digest of a"


def test_a_damaged_pack_is_named() -> None:
    data = bytes_from_pack(pack("a", 3))
    for wrong in (b"", b"{}\n", data[:-9], data.replace(b"pack 3", b"pack 9"), data[:40]):
        with pytest.raises(BadInput, match="house a"):
            pack_from_bytes(wrong, "house a")


def test_no_pack_no_rows() -> None:
    assert score([], reference()).num_rows == 0
    assert score([pack_house("a", "s", FIELDS, [])], reference()).num_rows == 0
