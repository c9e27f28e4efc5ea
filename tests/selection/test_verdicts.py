"""A view is kept for the paper's reason, or rejected for a named reason with its number."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from pbrs_farm.core.recipe import SelectionFields
from pbrs_farm.selection.class_balance import balance_classes, class_shares
from pbrs_farm.selection.scores import SCORES, merge_tables, score
from pbrs_farm.selection.verdicts import REASONS, verdicts
from tests.selection.histogram_sets import pack, reference

GOOD: dict[str, Any] = {
    "house": "a", "view": "0_0_0", "room": "0_0", "room_type": "Kitchen", "mode": "mlt_il_ol",
    "colour_score": 0.8, "depth_score": 0.9, "colour_reference": "p", "depth_reference": "q",
    "brightness": 0.5, "blown": 0.0, "surface": 0.4, "near": 0.0, "n_objects": 4.0, "noise": 0.1,
    "missing_textures": 0.0, "classes": "1:0.5 5:0.1", "black": "", "fault": "", "source": "s",
}  # fmt: skip


def table(*rows: dict[str, Any]) -> Any:
    return pa.Table.from_pylist([GOOD | row for row in rows], schema=SCORES)


def reasons(*rows: dict[str, Any], **fields: Any) -> list[str]:
    return verdicts(table(*rows), SelectionFields(**fields))["reason"].to_pylist()


def test_a_good_view_is_kept() -> None:
    judged = verdicts(table({}), SelectionFields()).to_pylist()[0]
    assert (judged["kept"], judged["reason"], judged["reasons"]) == (True, "", "")


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ({"colour_score": 0.69}, "unlike-colour"),
        ({"depth_score": 0.69}, "unlike-depth"),
        ({"brightness": 0.0}, "black"),
        ({"brightness": 0.01}, "too-dark"),
        ({"blown": 0.9}, "blown"),
        ({"surface": 0.99}, "one-surface"),
        ({"near": 0.5}, "inside-object"),
        ({"n_objects": 2.0}, "too-few-objects"),
        ({"noise": 3.0}, "too-noisy"),
        ({"missing_textures": 9.0}, "missing-textures"),
        ({"fault": "damaged"}, "failed"),
        ({"fault": "unscored"}, "unscored"),
    ],
)
def test_each_number_beyond_its_threshold_rejects_with_its_reason(
    row: dict[str, Any], reason: str
) -> None:
    judged = verdicts(table(row), SelectionFields()).to_pylist()[0]
    assert judged["kept"] is False
    assert judged["reason"] == reason
    assert reason in REASONS


def test_a_black_picture_is_refused_for_any_thresholds() -> None:
    assert reasons({"brightness": 0.0}, {"brightness": 0.01}, min_brightness=0.0) == ["black", ""]


def test_a_picture_black_in_another_mode_is_refused_if_the_recipe_asks() -> None:
    rows = {"black": "mlt_ol"}, {"black": "opengl_dl"}, {"black": "opengl_dl mlt_ol"}, {"black": ""}
    assert reasons(*rows) == ["", "", "", ""]
    assert reasons(*rows, black_modes="light") == ["black", "", "black", ""]
    assert reasons(*rows, black_modes="all") == ["black", "black", "black", ""]


def test_a_score_at_the_threshold_is_not_above_it() -> None:
    assert reasons({"colour_score": 0.7}, min_colour=0.7) == ["unlike-colour"]
    assert reasons({"blown": 0.5, "surface": 0.85, "n_objects": 3.0}) == [""]


def test_an_unknown_number_rejects_nothing() -> None:
    assert reasons({"noise": None, "brightness": None}) == [""]


def test_all_reasons_are_listed_and_the_first_is_named() -> None:
    judged = verdicts(table({"depth_score": 0.1, "blown": 0.9}), SelectionFields()).to_pylist()[0]
    assert judged["reason"] == "blown"
    assert judged["reasons"] == "blown,unlike-depth"


def test_the_cap_keeps_the_best_of_each_room_of_each_house() -> None:
    rows = [
        {"view": "0_0_0", "colour_score": 0.75},
        {"view": "0_0_1", "colour_score": 0.95},
        {"view": "0_0_2", "colour_score": 0.85},
        {"view": "0_0_3", "colour_score": 0.10},
        {"view": "0_1_0", "room": "0_1"},
        {"view": "0_0_0", "house": "b", "colour_score": 0.71},
    ]
    assert reasons(*rows, per_room_cap=2) == ["room-cap", "", "", "unlike-colour", "", ""]
    assert reasons(*reversed(rows), per_room_cap=2) == ["", "", "unlike-colour", "", "", "room-cap"]


def test_equal_views_are_capped_by_their_id() -> None:
    rows = [{"view": f"0_0_{k}"} for k in (2, 0, 1)]
    assert reasons(*rows, per_room_cap=1) == ["room-cap", "", "room-cap"]


def test_a_lower_threshold_keeps_all_views_of_a_higher_one() -> None:
    scores = score([pack(name, 9) for name in "abc"], reference())
    kept_ids = [
        verdicts(scores, SelectionFields(min_colour=t, min_depth=t))["kept"].to_numpy()
        for t in np.linspace(0, 1, 21)
    ]
    assert all((low | ~high).all() for low, high in itertools.pairwise(kept_ids))
    assert kept_ids[0].all()
    assert not kept_ids[-1].any()


def test_verdicts_of_merged_houses_are_the_merged_verdicts() -> None:
    fields = SelectionFields(per_room_cap=1, min_colour=0.3, min_depth=0.3)
    a, b = (score([pack(name, 7)], reference()) for name in "ab")
    separate = [verdicts(t, fields) for t in (a, b)]
    assert verdicts(merge_tables(b, a), fields).equals(pa.concat_tables(separate).combine_chunks())


def test_no_views_no_verdicts() -> None:
    assert verdicts(SCORES.empty_table(), SelectionFields()).num_rows == 0


def slow_balance(shares: np.ndarray, n_views: int) -> np.ndarray:
    """Plain greedy: repeatedly the view that gains most."""
    taken, total = np.zeros(len(shares), bool), np.full(shares.shape[1], 0.01)
    for _ in range(n_views):
        gains = np.log1p(shares / total).sum(axis=1)
        gains[taken] = -1
        taken[gains.argmax()] = True
        total += shares[gains.argmax()]
    return taken


def test_lazy_balance_equals_plain_greedy() -> None:
    rng = np.random.default_rng(0)
    shares = rng.dirichlet(np.full(41, 0.1), 60).astype(np.float32)
    for n_views in (0, 1, 7, 30, 60):
        assert np.array_equal(balance_classes(shares, n_views), slow_balance(shares, n_views))
    assert balance_classes(shares, 99).all()


def test_balance_keeps_the_rare_classes() -> None:
    rng = np.random.default_rng(1)
    common = [f"1:0.6 2:{0.3 + 0.01 * rng.random():.4f}" for _ in range(20)]
    rare = ["1:0.8 33:0.05", "1:0.8 36:0.1"]
    rows = [
        {"view": f"0_0_{k:02d}", "classes": text} for k, text in enumerate([*common[:10], *rare])
    ]
    fields = SelectionFields(balance="classes", balance_share=0.25)
    judged = verdicts(table(*rows), fields).to_pylist()
    kept_classes = [r["classes"] for r in judged if r["kept"]]
    assert len(kept_classes) == 3
    assert set(rare) <= set(kept_classes)
    assert {r["reason"] for r in judged if not r["kept"]} == {"class-balance"}


def test_balance_does_not_depend_on_the_order_of_rows() -> None:
    rows = [{"view": f"0_0_{k}", "classes": f"1:0.5 {3 + k % 3}:0.1"} for k in range(9)]
    fields = SelectionFields(balance="classes")
    forward = verdicts(table(*rows), fields).to_pylist()
    back = verdicts(table(*reversed(rows)), fields).to_pylist()
    assert [r["kept"] for r in forward] == [r["kept"] for r in reversed(back)]


def test_class_shares_are_read_back() -> None:
    shares = class_shares(["", "1:0.5 40:0.25"])
    assert shares.sum() == 0.75
    assert (shares[1, 1], shares[1, 40]) == (0.5, 0.25)
