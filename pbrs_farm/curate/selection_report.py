"""`pbrs-farm select --report`: a run as one HTML page without network or script. Reads the store."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from markupsafe import Markup
from numpy.typing import NDArray

from pbrs_farm import images
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, Bools, Srgb8Image
from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import SelectionFields
from pbrs_farm.curate.charts import distribution, joint, mirrored, yields
from pbrs_farm.curate.selection_run import house_pack, verdict_table
from pbrs_farm.curate.selection_summary import (
    PAPER_KEPT,
    PAPER_VIEWS,
    KeptCount,
    SelectionSummary,
    good_scores,
    summary_of,
    yield_curve,
)
from pbrs_farm.gallery.gallery_page import data_url, small_jpeg
from pbrs_farm.gallery.html_page import page
from pbrs_farm.gallery.label_colours import depth_colours
from pbrs_farm.regular_files import read_regular
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.reference_set import Reference
from pbrs_farm.store.object_store import Store

MAX_ROWS: Final = 40  # maximum rows of a table of houses or room types
_N_EXAMPLES: Final = 8  # examples of each verdict
_SHOWN_COLOURS: Final = 26  # fullest colour bins of a histogram


def selection_report(
    store: Store,
    reference: Reference,
    fields: SelectionFields,
    *,
    run: str = "default",
    photographs: Mapping[str, Path] | None = None,
) -> str:
    """HTML of a stored run, with up to _N_EXAMPLES kept and as many rejected views.

    fields: the thresholds of the run's verdicts. photographs: id -> file of the reference's
    photographs, if available; the nearest ones are shown beside each view. Raises
    BadInput when there is no such run.
    """
    table = verdict_table(store, run)
    summary = summary_of(table, run, fields, reference)
    # Draw scored views only; count all of them.
    scored = table.filter(table["colour_score"].is_valid())
    shown = {"kept": _spread(scored, _N_EXAMPLES), "rejected": _rejected(scored, _N_EXAMPLES)}
    examples = _Examples(store, reference, fields, photographs or {})
    return page(
        "pbrs_farm.curate",
        "selection_report.html",
        run=run,
        summary=summary,
        fields=fields,
        reference=summary.reference,
        numbers=_number_cells(summary),
        charts=_charts(table, scored, summary, fields),
        reasons=sorted(summary.reasons.items(), key=lambda pair: -pair[1]),
        room_types=_tally_table(summary.room_types),
        houses=_tally_table(summary.houses),
        credits=_report_credits(store, *shown.values()),
        **{name: [examples.example(row) for row in t.to_pylist()] for name, t in shown.items()},
    )


def _number_cells(summary: SelectionSummary) -> list[tuple[str, str]]:
    """The large numbers at the top of the page: (number, label)."""
    share = summary.kept / summary.views if summary.views else 0.0
    return [
        (f"{summary.views:,}", f"views, houses: {len(summary.houses):,}"),
        (f"{summary.kept:,}", "kept"),
        (f"{share:.1%}", f"yield (the paper's own pictures: {PAPER_KEPT / PAPER_VIEWS:.1%})"),
        (_median(summary.colour_quartiles), "median colour score"),
        (_median(summary.depth_quartiles), "median depth score"),
        (f"{summary.views - summary.scored:,}", "views without a score"),
    ]


def _median(quartiles: Sequence[float]) -> str:
    return f"{quartiles[2]:.3f}" if quartiles else "–"


def _charts(
    table: Any, scored: Any, summary: SelectionSummary, fields: SelectionFields
) -> dict[str, Markup]:
    colour, depth = (scored[k].to_numpy() for k in ("colour_score", "depth_score"))
    is_kept, limits = _is_kept(scored), (fields.min_colour, fields.min_depth)
    # All curves count views of good quality as a share of all views, like the card.
    good = good_scores(table)
    # Curves: (label, CSS class, share of views kept at equal steps of the limit).
    curves = (
        ("colour and depth", "both", summary.yield_both),
        ("colour alone", "colour", yield_curve(good[0], summary.views)),
        ("depth alone", "depth", yield_curve(good[1], summary.views)),
    )
    return {
        "colour": distribution(colour, is_kept, limits[0], "colour score"),
        "depth": distribution(depth, is_kept, limits[1], "depth score"),
        "joint": joint(colour, depth, is_kept, limits),
        "yields": yields(curves, min(limits), (0.70, PAPER_KEPT / PAPER_VIEWS)),
    }


def _tally_table(tallies: Sequence[KeptCount]) -> dict[str, Any]:
    """shown: the MAX_ROWS largest tallies; rest: the sum of the others; most: views of the largest."""
    # Show the largest, and sum up the others.
    ordered = sorted(tallies, key=lambda t: (-t.views, t.name))
    rest = ordered[MAX_ROWS:]
    sums = {"n": len(rest), "kept": sum(t.kept for t in rest), "views": sum(t.views for t in rest)}
    most = max((t.views for t in tallies), default=1)
    return {"shown": ordered[:MAX_ROWS], "rest": sums if rest else None, "most": most}


def _report_credits(store: Store, *shown: Any) -> list[str]:
    """The distinct attribution lines of the houses whose pictures are shown."""
    lines: dict[str, None] = {}
    for house in dict.fromkeys(h for table in shown for h in table["house"].to_pylist()):
        try:
            # A house without a bundle, or with a damaged one, has no line.
            facts = json.loads(store.get(keys.house_key(house, "house.json")))
            line = (facts.get("source") or {}).get("attribution")
        except (ObjectMissing, ValueError, AttributeError):
            continue
        if line:
            lines[str(line)] = None
    return list(lines)


def _worst(table: Any) -> F64:
    colour, depth = (table[k].to_numpy() for k in ("colour_score", "depth_score"))
    return np.asarray(np.minimum(colour, depth), np.float64)


def _is_kept(scored: Any) -> Bools:
    return np.asarray(scored["kept"].to_numpy(zero_copy_only=False), np.bool_)


def _spread(scored: Any, n: int) -> Any:
    """n kept rows from the best to the worst, at equal steps of rank."""
    table = scored.filter(scored["kept"])
    # Rank by the smaller of the two scores.
    order = np.argsort(-_worst(table), kind="stable")
    picked = np.unique(np.linspace(0, max(len(order) - 1, 0), min(n, len(order))).round())
    return table.take(pa.array(order[picked.astype(np.intp)]))


def _rejected(scored: Any, n: int) -> Any:
    """n rejected rows, taking each reason in turn, and for each reason the highest scores first."""
    table = scored.filter(pa.array(~_is_kept(scored)))
    reasons = table["reason"].to_pylist()
    # Rank the views within each reason; the rank is the view's turn.
    turns: dict[str, int] = {}
    ranked: list[tuple[int, int, int]] = []  # turn, rank among all, row
    for row in np.argsort(-_worst(table), kind="stable"):
        turn = turns[reasons[row]] = turns.get(reasons[row], -1) + 1
        ranked.append((turn, len(ranked), int(row)))
    return table.take(pa.array([row for _turn, _rank, row in sorted(ranked)[:n]], pa.int64()))


class _Examples:
    """Cards of views with their histograms beside those of their nearest photographs."""

    def __init__(
        self,
        store: Store,
        reference: Reference,
        fields: SelectionFields,
        photographs: Mapping[str, Path],
    ) -> None:
        self._store = store
        self._photographs = photographs
        self._mode = Mode(fields.score_mode)
        # Look up photographs by their ids.
        self._binning = reference.facts.binning
        self._places = {name: k for k, name in enumerate(reference.facts.ids)}
        self._colour, self._depth = reference.colour_shares(), reference.depth_shares()
        self._space = reference.facts.settings.colour_space

    def example(self, row: dict[str, Any]) -> dict[str, Any]:
        """A row of verdicts with its pictures as data URLs and its histograms as charts."""
        layers = (row["mode"], "depth")
        pictures = [(layer, self._picture(row, layer)) for layer in layers]
        nearest = dict.fromkeys((row["colour_reference"], row["depth_reference"]))
        neighbours = {name: self._neighbour(name) for name in nearest}
        return {
            "row": row,
            "pictures": pictures,
            "histograms": self._histograms(row),
            "neighbours": neighbours,
        }

    def _neighbour(self, name: str) -> str:
        """A photograph's thumbnail as a data URL, "" if it is missing or cannot be read."""
        path = self._photographs.get(name)
        try:
            if path is None:
                return ""
            pixels = images.decode_photo(read_regular(path), str(path))
        except (BadInput, OSError):
            return ""
        return _thumbnail_url(pixels)

    def _picture(self, row: dict[str, Any], layer: str) -> str:
        """The layer's thumbnail as a data URL, "" if it cannot be read."""
        key = keys.view_key(row["house"], row["view"], LAYER[layer].file)
        try:
            stored = images.array_from_png(self._store.get(key), key)
        except (ObjectMissing, BadInput):
            return ""
        pixels = depth_colours(stored) if layer == "depth" else stored[..., :3].astype(np.uint8)
        return _thumbnail_url(pixels)

    def _histograms(self, row: dict[str, Any]) -> list[tuple[Markup | None, str]]:
        """(chart, nearest photograph) for colour and for depth; chart is None without a histogram."""
        names = row["colour_reference"], row["depth_reference"]
        try:
            pack = house_pack(self._store, row["house"], self._mode)
            place = pack.views.index(row["view"])
        except (BadInput, ObjectMissing, KeyError, ValueError):
            return [(None, name) for name in names]
        colour = normalised(coarser_colour(pack.colour[place], self._binning.colour))
        depth = normalised(coarser_depth(pack.depth[place], self._binning.depth))
        like_colour = self._colour[self._places[names[0]]]
        like_depth = self._depth[self._places[names[1]]]
        # Show only the fullest colour bins of either histogram, in their own colours.
        order = np.argsort(-np.maximum(colour, like_colour), kind="stable")
        fullest = np.sort(order[:_SHOWN_COLOURS])
        shades = bin_colours(self._binning.colour, self._space)[fullest]
        tuples = [(int(r), int(g), int(b)) for r, g, b in shades]
        of_colour = colour[fullest], like_colour[fullest], "colour histograms", tuples
        drawn = mirrored(*of_colour), mirrored(depth, like_depth, "depth histograms")
        return list(zip(drawn, names, strict=True))


def _thumbnail_url(pixels: Srgb8Image) -> str:
    return data_url(small_jpeg(images.thumbnail(pixels, max_edge_px=320), 14_000), "jpeg")


def bin_colours(bins: Iterable[int], space: str) -> NDArray[np.uint8]:
    """(a * b * c, 3) sRGB of the bins' centres, clipped for "ycbcr", in the order of the counts."""
    # Enumerate the centres, the first channel slowest.
    axes = [(np.arange(n) + 0.5) * 256 / n for n in bins]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    # Convert the centre of a YCbCr bin to RGB (BT.601, full range).
    if space == "ycbcr":
        y, cb, cr = grid[:, 0], grid[:, 1] - 128, grid[:, 2] - 128
        grid = np.stack([y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb], -1)
    return np.clip(np.rint(grid), 0, 255).astype(np.uint8)
