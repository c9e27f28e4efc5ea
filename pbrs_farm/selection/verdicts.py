"""Verdicts on views from their scores: kept, or rejected with reasons; no effects.

A verdict is a function of the scores and the thresholds alone: other thresholds need no histogram.
Rejected views are marked, never dropped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import SelectionFields
from pbrs_farm.selection.class_balance import balance_classes, class_shares
from pbrs_farm.selection.histogram_pack import BLACK

# Reasons for rejecting a view, in order of precedence.
# fmt: off
REASONS: Final = (
    "failed", "unscored", "black", "too-dark", "blown", "one-surface", "inside-object", "too-few-objects",
    "too-noisy", "missing-textures", "unlike-colour", "unlike-depth", "room-cap",
    "class-balance",
)
# fmt: on
_LIGHT_MODES: Final = {str(mode) for mode in Mode if mode.groups}
# fmt: off
_NUMBERS: Final = (
    "brightness", "blown", "surface", "near", "n_objects", "noise", "missing_textures",
    "colour_score", "depth_score",
)
# fmt: on


def verdicts(scores: Any, fields: SelectionFields) -> Any:
    """The table scores (SCORES) with columns kept (bool), reason (the first of REASONS that applies,
    "" if kept) and reasons (all of them, with commas).

    A view is kept when its colour and its depth score are both above their thresholds (paper
    section 3.3) and no quality number is beyond its own. An unknown number rejects nothing.
    """
    # Judge each view separately: a column per reason.
    rejections = _rejections(scores, fields)
    table = np.stack(list(rejections.values()), axis=1)
    is_kept = np.asarray(~table.any(axis=1), np.bool_)
    # Compare the remaining views with each other.
    beyond = _beyond_cap(scores, is_kept, fields.per_room_cap)
    is_kept &= ~beyond
    surplus = _surplus(scores, is_kept, fields)
    is_kept &= ~surplus
    table = np.column_stack([table, beyond, surplus])
    # Name the first reason and all of them.
    first = np.where(is_kept, len(REASONS), table.argmax(axis=1))
    names = np.array([*REASONS, ""], object)
    added = {"kept": pa.array(is_kept), "reason": pa.array(names[first], pa.string())}
    added["reasons"] = pa.array(_reasons_joined(table), pa.string())
    for name, column in added.items():
        scores = scores.append_column(name, column)
    return scores


def _rejections(scores: Any, fields: SelectionFields) -> Mapping[str, Bools]:
    number = {name: _floats(scores, name) for name in _NUMBERS}
    faults = scores["fault"].to_numpy()
    unscored = np.asarray(faults == "unscored", bool)
    failed = np.asarray(faults != "", bool) & ~unscored
    has_scores = ~(failed | unscored)
    with np.errstate(invalid="ignore"):  # NaN: unknown
        return {
            "failed": failed,
            "unscored": unscored,
            "black": _black(scores, number["brightness"], fields),
            "too-dark": number["brightness"] < fields.min_brightness,
            "blown": number["blown"] > fields.max_blown,
            "one-surface": number["surface"] > fields.max_surface,
            "inside-object": number["near"] > fields.max_near,
            "too-few-objects": number["n_objects"] < fields.min_objects,
            "too-noisy": number["noise"] > fields.max_noise,
            "missing-textures": number["missing_textures"] > fields.max_missing_textures,
            "unlike-colour": has_scores & ~(number["colour_score"] > fields.min_colour),
            "unlike-depth": has_scores & ~(number["depth_score"] > fields.min_depth),
        }


def _black(scores: Any, brightness: F64, fields: SelectionFields) -> Bools:
    """(n,) bool: the scored picture is black, or that of a mode that must not be black."""
    black = np.asarray(brightness <= BLACK, bool)
    if fields.black_modes == "scored":
        return black
    # For the other modes, only the names of black ones are stored with each view.
    black_modes = [set(modes.split()) for modes in scores["black"].to_pylist()]
    light_modes = _LIGHT_MODES if fields.black_modes == "light" else set(Mode)
    return np.asarray(
        black | np.array([bool(modes & light_modes) for modes in black_modes], bool), bool
    )


def _floats(scores: Any, name: str) -> F64:
    """(n,) float64; NaN for null. float32 numbers are rounded to their stored decimals."""
    values = scores[name].to_numpy()
    if values.dtype == np.float32:
        return np.asarray(np.round(values.astype(np.float64), 6))
    return np.asarray(values, np.float64)


def _beyond_cap(scores: Any, is_kept: Bools, cap: int) -> Bools:
    """(n,) bool: kept views of a room that has cap better ones (by the lesser score, then id); 0 = no cap."""
    beyond = np.zeros(len(is_kept), bool)
    if cap <= 0 or not is_kept.any():
        return beyond
    # Sort by house and room, in each room the best first.
    rows = np.nonzero(is_kept)[0]
    worse_score = np.minimum(_floats(scores, "colour_score"), _floats(scores, "depth_score"))[rows]
    house, room, view = (_ranks(scores[name])[rows] for name in ("house", "room", "view"))
    order = np.lexsort((view, -worse_score, room, house))
    # A view's rank in its room: its row minus that of the room's first view.
    starts = np.ones(len(order), bool)
    starts[1:] = (np.diff(house[order]) != 0) | (np.diff(room[order]) != 0)
    first_of_room = np.maximum.accumulate(np.where(starts, np.arange(len(order)), 0))
    beyond[rows[order]] = np.arange(len(order)) - first_of_room >= cap
    return beyond


def _surplus(scores: Any, is_kept: Bools, fields: SelectionFields) -> Bools:
    """(n,) bool: kept views to drop so that the classes of the others are balanced."""
    surplus = np.zeros(len(is_kept), bool)
    if fields.balance == "none" or not is_kept.any():
        return surplus
    rows = np.nonzero(is_kept)[0]
    # Sort by ids, so that ties do not depend on the order of rows.
    order = rows[np.lexsort((_ranks(scores["view"])[rows], _ranks(scores["house"])[rows]))]
    shares = class_shares(scores["classes"].take(pa.array(order)).to_pylist())
    taken = balance_classes(shares, round(fields.balance_share * len(order)))
    surplus[order[~taken]] = True
    return surplus


def _ranks(column: Any) -> I64:
    """(n,) the sort position of each row's text; equal texts share a position."""
    return np.asarray(pc.rank(column.combine_chunks(), tiebreaker="dense"), np.int64)


def _reasons_joined(table: Bools) -> list[str]:
    """(n,) the names of the reasons that apply, with commas."""
    # Number each combination of reasons, and write the text of each number once.
    weights = 1 << np.arange(len(REASONS))
    codes = table @ weights
    text = {
        int(code): ",".join(name for k, name in enumerate(REASONS) if code >> k & 1)
        for code in np.unique(codes)
    }
    return [text[int(code)] for code in codes]
