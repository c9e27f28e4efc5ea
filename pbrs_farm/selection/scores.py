"""Histograms -> scores against a reference, as tables that merge in any order; no effects.

A score table is a pyarrow Table of SCORES, a row per view. Merging is associative and commutative,
so houses can be scored anywhere and joined later.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Bools
from pbrs_farm.selection.histogram_pack import QUALITIES, HistogramPack
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.reference_set import Reference, check_comparable
from pbrs_farm.selection.similarity import best_match

# Columns of a score table.
SCORES: Final[Any] = pa.schema(
    [
        *((name, pa.string()) for name in ("house", "view", "room", "room_type")),
        ("mode", pa.string()),  # scored lighting mode
        ("colour_score", pa.float64()),  # best intersection, null if not scored
        ("depth_score", pa.float64()),
        ("colour_reference", pa.string()),  # id of the most similar photograph
        ("depth_reference", pa.string()),
        *((name, pa.float32()) for name in QUALITIES),
        ("classes", pa.string()),  # as HistogramPack.classes
        ("black", pa.string()),  # as HistogramPack.black
        ("fault", pa.string()),  # "", "unscored", or reason why the view cannot be read
        ("source", pa.string()),  # digest of the house's histograms
    ]
)

BATCH_VIEWS: Final = 8192  # views per batch: bounds memory, and keeps the search efficient


class Scorer:
    """Scores packs against one reference; holds its normalised histograms."""

    def __init__(self, reference: Reference, *, library: str | None = None) -> None:
        """library: as similarity.best_match's."""
        self._reference = reference
        self._binning = reference.facts.binning
        self._ids = np.array(reference.facts.ids, object)
        self._colour = reference.colour_shares()
        self._depth = reference.depth_shares()
        self._library = library

    def score(self, packs: Sequence[HistogramPack]) -> Any:
        """The score table of the packs' views (SCORES); BadInput if incomparable with the reference."""
        packs = [p for p in packs if p.views]
        if not packs:
            return SCORES.empty_table()
        for settings in {p.settings for p in packs if any(p.modes)}:
            check_comparable(self._reference, settings, self._reference.facts.source)
        # Search among the photographs; packs without a scored view have no shape to compare.
        with_views = [p for p in packs if any(p.modes)]
        c_score, c_best = self._best(
            [coarser_colour(p.colour, self._binning.colour) for p in with_views],
            self._colour,
            packs,
        )
        d_score, d_best = self._best(
            [coarser_depth(p.depth, self._binning.depth) for p in with_views], self._depth, packs
        )
        # Lay out a row per view.
        quality = np.concatenate([p.quality for p in packs])
        columns: dict[str, Any] = {
            "house": [p.house for p in packs for _ in p.views],
            "view": [v for p in packs for v in p.views],
            "room": [r for p in packs for r in p.rooms],
            "room_type": [r for p in packs for r in p.room_types],
            "mode": [m for p in packs for m in p.modes],
            "colour_score": _nullable(c_score),
            "depth_score": _nullable(d_score),
            "colour_reference": c_best,
            "depth_reference": d_best,
            "classes": [c for p in packs for c in p.classes],
            "black": [b for p in packs for b in p.black],
            "fault": [f for p in packs for f in p.faults],
            "source": [p.source for p in packs for _ in p.views],
        }
        columns |= {name: _nullable(quality[:, k]) for k, name in enumerate(QUALITIES)}
        return pa.table({f.name: columns[f.name] for f in SCORES}, schema=SCORES)

    def score_all(
        self, packs: Iterable[HistogramPack], batch_views: int = BATCH_VIEWS
    ) -> Iterator[Any]:
        """Score tables, about batch_views rows each, of a stream of whole packs, read on demand."""
        # Gather packs until they fill a batch.
        batch: list[HistogramPack] = []
        n = 0  # their views
        for pack in packs:
            batch.append(pack)
            n += len(pack.views)
            if n >= batch_views:
                yield self.score(batch)
                batch, n = [], 0
        if batch:
            yield self.score(batch)

    def _best(
        self, counts: Sequence[NDArray[np.generic]], references: F32, packs: Sequence[HistogramPack]
    ) -> tuple[F64, NDArray[Any]]:
        """(n,) scores, NaN if not scored, and (n,) reference ids or None, of all packs' views."""
        # Search for scored views only, of the packs that counts holds.
        scored = np.array([bool(m) for p in packs for m in p.modes])
        score = np.full(len(scored), np.nan)
        best = np.full(len(scored), None, object)
        if scored.any():
            among = np.array([bool(m) for p in packs if any(p.modes) for m in p.modes])
            shares = normalised(np.concatenate(counts)[among])
            score[scored], index = best_match(shares, references, library=self._library)
            best[scored] = self._ids[index]
        return score, best


def score(
    packs: Iterable[HistogramPack], reference: Reference, *, library: str | None = None
) -> Any:
    """One score table (SCORES) of the packs, sorted by house and view.

    packs: histograms of houses, read one by one. reference: the photographs to compare with. library:
    "faiss" or "numpy" for the search, None for faiss if it is installed; scores are the same.
    Tables of parts may be computed separately and merged (Scorer).
    """
    return merge_tables(*Scorer(reference, library=library).score_all(packs))


def merge_tables(*tables: Any) -> Any:
    """Merge score tables, by house and view, equal rows once; ValueError if two disagree."""
    joined = pa.concat_tables([SCORES.empty_table(), *(t.select(SCORES.names) for t in tables)])
    joined = joined.sort_by([("house", "ascending"), ("view", "ascending")]).combine_chunks()
    if joined.num_rows < 2:
        return joined
    # Rows of one view are adjacent now: all but the first are repeats.
    again = _same_as_before(joined, "house") & _same_as_before(joined, "view")
    if not again.any():
        return joined
    # Refuse to merge repeats that differ.
    for name in SCORES.names:
        same = _same_as_before(joined, name)
        if not same[again].all():
            row = int(np.nonzero(again & ~same)[0][0])
            view = f"{joined['house'][row]} {joined['view'][row]}"
            raise ValueError(f"view {view} has two different values of {name}")
    return joined.filter(pa.array(~again)).combine_chunks()


def _same_as_before(table: Any, name: str) -> Bools:
    """(n,) bool: the row's value equals that of the row before; nulls are equal."""
    column = table[name].combine_chunks()
    now, before = column[1:], column[:-1]
    both_null = pc.and_(pc.is_null(now), pc.is_null(before))
    same = pc.or_(pc.fill_null(pc.equal(now, before), False), both_null)
    return np.concatenate([[False], np.asarray(same, bool)])


def _nullable(values: NDArray[np.floating]) -> Any:
    return pa.array(values, from_pandas=True)
