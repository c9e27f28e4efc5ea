"""The summary of a selection: yield, reasons, tallies per house and room type; no effects."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.recipe import SelectionFields
from pbrs_farm.core.record import Record
from pbrs_farm.home.room_use import named_kind
from pbrs_farm.selection.binning import Binning, BinningRow
from pbrs_farm.selection.reference_set import Reference
from pbrs_farm.selection.verdicts import REASONS

THRESHOLDS: Final = tuple(round(0.01 * k, 2) for k in range(101))

# Share of its own pictures that the paper keeps at 0.70 (section 3.3): 73.0 %.
PAPER_VIEWS: Final = 779_342
PAPER_KEPT: Final = 568_793
_OF_CHOICE: Final = {"unlike-colour", "unlike-depth", "room-cap", "class-balance"}


class KeptCount(Record):
    """Number of views of one house or room type, and how many of them are kept."""

    name: str
    views: int
    kept: int


class ReferenceSummary(Record):
    """Which photographs the views were compared with, and how."""

    source: str
    source_sha256: str
    digest: str
    photographs: int
    binning: Binning
    table: tuple[BinningRow, ...]


class SelectionSummary(Record):
    """selection.json: the counts of a run, and what they were made with."""

    run: str
    fields: SelectionFields
    reference: ReferenceSummary
    views: int
    scored: int
    kept: int
    reasons: dict[str, int]  # rejected views by their first reason
    modes: dict[str, int]  # scored views by the lighting mode they were scored on
    colour_quartiles: tuple[float, ...]  # with minimum and maximum; empty without scores
    depth_quartiles: tuple[float, ...]
    # Share of all views that would be kept with both thresholds at each of THRESHOLDS, before caps.
    yield_both: tuple[float, ...]
    houses: tuple[KeptCount, ...]
    room_types: tuple[KeptCount, ...]
    n_scored_houses: int = 0  # houses scored in this very run; not stored


def summary_of(
    judged: Any, run: str, fields: SelectionFields, reference: Reference
) -> SelectionSummary:
    """The summary of a table of verdicts: statistics of views with a score, tallies of all."""
    # Views without a score have null there and are excluded from the statistics of scores.
    colour, depth = (judged[k].drop_null().to_numpy() for k in ("colour_score", "depth_score"))
    counts = {r["values"]: r["counts"] for r in pc.value_counts(judged["reason"]).to_pylist()}
    modes = pc.value_counts(judged["mode"].filter(judged["colour_score"].is_valid())).to_pylist()
    facts = reference.facts
    return SelectionSummary(
        run=run,
        fields=fields,
        reference=ReferenceSummary(
            source=facts.source,
            source_sha256=facts.source_sha256,
            digest=reference.digest,
            photographs=len(facts.ids),
            binning=facts.binning,
            table=facts.table,
        ),
        views=judged.num_rows,
        scored=len(colour),
        kept=int(pc.sum(judged["kept"]).as_py() or 0),
        reasons={reason: counts[reason] for reason in REASONS if reason in counts},
        modes={m["values"]: m["counts"] for m in sorted(modes, key=lambda m: str(m["values"]))},
        colour_quartiles=_quartiles(colour),
        depth_quartiles=_quartiles(depth),
        yield_both=tuple(yield_curve(np.minimum(*good_scores(judged)), judged.num_rows)),
        houses=_tallies(judged, "house"),
        room_types=_tallies(with_types(judged), "room_type"),
    )


def good_scores(judged: Any) -> tuple[F64, F64]:
    """Colour and depth scores of the views that at most thresholds, caps and balance reject."""
    of_quality = set(REASONS) - _OF_CHOICE
    is_good = [
        not of_quality.intersection(text.split(",")) for text in judged["reasons"].to_pylist()
    ]
    good = judged.filter(pa.array(is_good, pa.bool_()))
    colour, depth = (good[k].drop_null().to_numpy() for k in ("colour_score", "depth_score"))
    return colour, depth


def yield_curve(scores: F64, n_views: int) -> list[float]:
    """Share of n_views whose score (n,) is above each of THRESHOLDS; zeros without scores."""
    if not len(scores):
        return [0.0] * len(THRESHOLDS)
    # Sort once to count the scores above each threshold.
    above = len(scores) - np.searchsorted(np.sort(scores), THRESHOLDS, side="right")
    return [round(float(n) / n_views, 6) for n in above]


def _quartiles(scores: np.ndarray[Any, np.dtype[np.float64]]) -> tuple[float, ...]:
    """Minimum, quartiles and maximum; empty without scores."""
    if not len(scores):
        return ()
    return tuple(round(float(q), 6) for q in np.percentile(scores, (0, 25, 50, 75, 100)))


def with_types(judged: Any) -> Any:
    """The table with room names replaced by room types: "Bedroom 2" and "Chambre" are bedrooms."""
    names = judged["room_type"].to_pylist()
    kinds = {name: named_kind(name or "") for name in set(names)}
    column = [kind.value if (kind := kinds[name]) else "" for name in names]
    column_index = judged.schema.get_field_index("room_type")
    return judged.set_column(column_index, "room_type", pa.array(column, pa.string()))


def _tallies(judged: Any, column: str) -> tuple[KeptCount, ...]:
    groups = judged.group_by(column).aggregate([("kept", "count"), ("kept", "sum")])
    rows = sorted(groups.to_pylist(), key=lambda r: str(r[column]))
    return tuple(
        KeptCount(name=r[column] or "", views=r["kept_count"], kept=r["kept_sum"]) for r in rows
    )
