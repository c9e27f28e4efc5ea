"""A reference file is a function of its photographs, chooses its binning by them, and names faults."""

from __future__ import annotations

import io
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.selection.binning import (
    BINNINGS,
    Binning,
    BinningRow,
    binning_table,
    finest_passing,
    table_text,
)
from pbrs_farm.selection.histograms import Histogram, coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.reference_set import (
    bytes_from_reference,
    check_comparable,
    reference_from_bytes,
    reference_from_histograms,
)
from pbrs_farm.selection.similarity import intersection
from tests.hypothesis_profiles import examples
from tests.selection.histogram_sets import random_histogram, reference

FINE = HistogramFields()


def test_a_reference_survives_its_file_and_equal_ones_give_equal_bytes() -> None:
    ref = reference()
    data = bytes_from_reference(ref)
    back = reference_from_bytes(data, "nyu.npz")
    assert back.facts == ref.facts
    assert np.array_equal(back.colour, ref.colour)
    assert back.digest == ref.digest
    assert data == bytes_from_reference(reference())
    assert ref.digest != reference(seed=5).digest


def test_the_file_opens_with_only_numpy() -> None:
    ref = reference()
    with np.load(io.BytesIO(bytes_from_reference(ref))) as file:
        assert np.array_equal(file["depth"], ref.depth)


def test_a_damaged_file_or_another_version_is_named() -> None:
    data = bytes_from_reference(reference())
    damaged = data.replace(b"reference.json", b"deference.json")
    for wrong in (b"", b"PK\x03\x04", data[: len(data) // 2], damaged):
        with pytest.raises(BadInput, match=r"nyu\.npz"):
            reference_from_bytes(wrong, "nyu.npz")


def test_left_one_out_table_equals_a_double_loop() -> None:
    rng = np.random.default_rng(3)
    sets = [random_histogram(rng, FINE) for _ in range(6)]
    colour = np.stack([h.colour for h in sets])
    depth = np.stack([h.depth for h in sets])
    rows = binning_table(colour, depth, min_colour=0.4, min_depth=0.5)
    assert [r.binning for r in rows] == list(BINNINGS)
    for row in rows:
        c = normalised(coarser_colour(colour, row.binning.colour))
        d = normalised(coarser_depth(depth, row.binning.depth))
        for shares, passing, limit in ((c, row.colour_passing, 0.4), (d, row.depth_passing, 0.5)):
            best = [
                max(float(intersection(shares[i], shares[j])) for j in range(6) if j != i)
                for i in range(6)
            ]
            assert passing == pytest.approx(np.mean(np.array(best) > limit))


@settings(max_examples=examples(25), deadline=None)
@given(st.integers(0, 10**6))
def test_coarser_bins_never_lower_a_score(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = random_histogram(rng, FINE), random_histogram(rng, FINE)
    scores = [
        float(
            intersection(
                normalised(coarser_colour(a.colour, binning.colour)),
                normalised(coarser_colour(b.colour, binning.colour)),
            )
        )
        for binning in BINNINGS
    ]
    assert all(coarse >= fine - 1e-6 for coarse, fine in itertools.pairwise(scores))


def row(binning: Binning, colour: float, depth: float) -> BinningRow:
    return BinningRow(
        binning=binning,
        colour_passing=colour,
        colour_median=0.8,
        depth_passing=depth,
        depth_median=0.8,
    )


def test_the_finest_binning_that_95_percent_pass_is_chosen_for_each() -> None:
    rows = [
        row(b, c, d) for b, c, d in zip(BINNINGS, (1, 1, 0.97, 0.95, 0.9), (1, 0.96, 0.9, 0, 0))
    ]
    chosen = finest_passing(rows)
    assert (chosen.colour, chosen.depth) == ((8, 8, 4), 16)
    assert "* 8x8x4     256  95.0 %" in table_text(rows, chosen)


def test_if_none_passes_the_coarsest_is_used() -> None:
    rows = [row(b, 0.5, 1.0) for b in BINNINGS]
    chosen = finest_passing(rows)
    assert (chosen.colour, chosen.depth) == ((2, 2, 2), 128)
    assert "no binning lets 95% pass by colour" in table_text(rows, chosen)
    assert "by depth" not in table_text(rows, chosen)


def test_an_empty_a_single_and_a_blind_set_are_rejected() -> None:
    some = random_histogram(np.random.default_rng(0), FINE)
    blind = Histogram(some.colour, np.zeros(128, np.uint32))
    for ids, sets, text in (
        ((), (), "has no image"),
        (("a",), (some,), "single image"),
        (("a", "b"), (some, blind), "b: no pixel has a known depth"),
    ):
        with pytest.raises(BadInput, match=text):
            reference_from_histograms(
                ids, sets, FINE, SelectionFields(), source=("photos", "0" * 64)
            )


def test_other_settings_are_an_error_that_names_file_and_fields() -> None:
    ref = reference(fields=FINE)
    check_comparable(ref, FINE, "nyu.npz")
    check_comparable(ref, HistogramFields(colour_bins=16, depth_bins=256), "nyu.npz")
    for foreign, field in (
        (HistogramFields(colour_space="ycbcr"), "colour_space"),
        (HistogramFields(depth_max_m=8.0), "depth_max_m"),
    ):
        with pytest.raises(BadInput, match=rf"nyu\.npz.*{field}"):
            check_comparable(ref, foreign, "nyu.npz")


def test_bins_coarser_than_the_reference_compares_are_rejected() -> None:
    twins = [random_histogram(np.random.default_rng(0), FINE)] * 3
    ref = reference_from_histograms(
        "abc", twins, FINE, SelectionFields(), source=("photos", "0" * 64)
    )
    assert ref.facts.binning == BINNINGS[-1]
    with pytest.raises(BadInput, match=r"colour bins: 8x8x8 there, 4.*depth bins: 128 there"):
        check_comparable(ref, HistogramFields(colour_bins=4, depth_bins=64), "x")
