"""`pbrs-farm select --report`: a run as one HTML page. Effects: reads the store.

The page needs no network and no script: charts are inline SVG, examples are small pictures in it.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from pbrs_farm import images
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, ObjectMissing
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import SelectionFields
from pbrs_farm.curate import charts
from pbrs_farm.curate.selection_run import house_pack, verdict_table
from pbrs_farm.curate.selection_summary import (
    PAPER_KEPT,
    PAPER_VIEWS,
    SelectionSummary,
    Tally,
    summary_of,
    yield_curve,
)
from pbrs_farm.gallery.gallery_page import filled, small_jpeg
from pbrs_farm.gallery.label_colours import depth_colours
from pbrs_farm.selection.binning import Binning
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.reference_set import Reference
from pbrs_farm.store.interface import Store

MAX_ROWS: Final = 40
_SHOWN_COLOURS: Final = 26


def selection_report(
    store: Store,
    reference: Reference,
    fields: SelectionFields,
    *,
    run: str = "default",
    n_examples: int = 8,
) -> str:
    """HTML of a run as it stands in the store; n_examples kept and as many refused views are shown.

    fields: the thresholds the run was judged with. Raises BadInput when there is no such run.
    """
    table = verdict_table(store, run)
    summary = summary_of(table, run, fields, reference)
    scored = table.filter(table["colour_score"].is_valid())
    colour, depth = (scored[k].to_numpy() for k in ("colour_score", "depth_score"))
    kept = scored["kept"].to_numpy(zero_copy_only=False).astype(bool)
    examples = _Examples(store, reference, fields)
    good, bad = _spread(scored.filter(scored["kept"]), n_examples), _refused(scored, n_examples)
    template = resources.files("pbrs_farm.curate").joinpath("selection_report.html")
    limits = fields.min_colour, fields.min_depth
    parts = {
        "RUN": escape(run),
        "INTRO": _intro(summary),
        "NUMBERS": _numbers(summary),
        "COLOUR": charts.distribution(colour, kept, limits[0], "colour score"),
        "DEPTH": charts.distribution(depth, kept, limits[1], "depth score"),
        "JOINT": charts.joint(colour, depth, limits),
        "YIELD": charts.yields(
            (
                ("colour and depth", "both", summary.yield_both),
                ("colour alone", "colour", yield_curve(colour)),
                ("depth alone", "depth", yield_curve(depth)),
            ),
            min(limits),
            (0.70, PAPER_KEPT / PAPER_VIEWS),
        ),
        "REASONS": _reasons(summary),
        "ROOMS": _tallies(summary.room_types),
        "HOUSES": _tallies(summary.houses),
        "KEPT": examples.cards(good),
        "REFUSED": examples.cards(bad),
        "REFERENCE": _reference(summary),
        "BINNINGS": _binnings(summary),
        "CREDITS": "<br>".join(escape(x) for x in _credits(store, good, bad)),
    }
    return filled(template.read_text("utf-8"), parts)


def _intro(summary: SelectionSummary) -> str:
    modes = ", ".join(f"{n:,} on {mode}" for mode, n in summary.modes.items()) or "none"
    f = summary.fields
    text = (
        f"Compared with {summary.reference.photographs:,} photographs of "
        f"“{summary.reference.source}”; thresholds {f.min_colour:g} for colour and "
        f"{f.min_depth:g} for depth; scored: {modes}."
    )
    return escape(text)


def _numbers(summary: SelectionSummary) -> str:
    paper = f"{PAPER_KEPT / PAPER_VIEWS:.1%}"
    share = summary.kept / summary.views if summary.views else 0.0
    rows = (
        (f"{summary.views:,}", f"views, houses: {len(summary.houses):,}"),
        (f"{summary.kept:,}", "kept"),
        (f"{share:.1%}", f"yield (the paper's own pictures: {paper})"),
        (_median(summary.colour_quartiles), "median colour score"),
        (_median(summary.depth_quartiles), "median depth score"),
        (f"{summary.views - summary.scored:,}", "views without a score"),
    )
    return "".join(f"<div><b>{n}</b><span>{escape(text)}</span></div>" for n, text in rows)


def _median(quartiles: Sequence[float]) -> str:
    return f"{quartiles[2]:.3f}" if quartiles else "–"


def _reasons(summary: SelectionSummary) -> str:
    if not summary.reasons:
        return '<p class="faint">No view is refused.</p>'
    most = max(summary.reasons.values())
    rows = "".join(
        f'<tr><td>{escape(name)}</td><td class="n">{n:,}</td><td class="n">'
        f'{n / summary.views:.1%}</td><td class="bar"><i style="--share:0%;'
        f'width:{100 * n / most:.1f}%"></i></td></tr>'
        for name, n in sorted(summary.reasons.items(), key=lambda pair: -pair[1])
    )
    head = (
        '<tr><th>first reason</th><th class="n">views</th><th class="n">of all</th><th></th></tr>'
    )
    return f"<table>{head}{rows}</table>"


def _tallies(tallies: Sequence[Tally]) -> str:
    most = max((t.views for t in tallies), default=1)
    ordered = sorted(tallies, key=lambda t: (-t.views, t.name))
    rows = "".join(
        f'<tr><td>{escape(t.name or "(unknown)")}</td><td class="n">{t.kept:,} / {t.views:,}</td>'
        f'<td class="n">{t.kept / t.views:.0%}</td><td class="bar"><i style="width:'
        f'{100 * t.views / most:.1f}%;--share:{100 * t.kept / t.views:.1f}%"></i></td></tr>'
        for t in ordered[:MAX_ROWS]
    )
    rest = ordered[MAX_ROWS:]
    if rest:
        kept, views = sum(t.kept for t in rest), sum(t.views for t in rest)
        rows += (
            f'<tr><td>{len(rest):,} more</td><td class="n">{kept:,} / {views:,}</td>'
            f'<td class="n">{kept / views:.0%}</td><td></td></tr>'
        )
    head = '<tr><th></th><th class="n">kept / views</th><th class="n">yield</th><th></th></tr>'
    return f"<table>{head}{rows}</table>"


def _reference(summary: SelectionSummary) -> str:
    r = summary.reference
    return escape(
        f"{r.photographs:,} photographs of “{r.source}” (sha256 {r.source_sha256[:16]}). Compared "
        f"at {_bins(r.binning)}: the finest binning at which at least 95 % of the photographs, "
        "each left out in turn, pass the threshold themselves; where none passes, the coarsest."
    )


def _bins(binning: Binning) -> str:
    colour = " x ".join(str(k) for k in binning.colour)
    return f"{colour} colour bins and {binning.depth} depth bins"


def _binnings(summary: SelectionSummary) -> str:
    chosen = summary.reference.binning
    rows = []
    for row in summary.reference.table:
        colour, depth = row.binning.colour, row.binning.depth
        marks = " ".join(
            name
            for name, used in (
                ("colour", colour == chosen.colour),
                ("depth", depth == chosen.depth),
            )
            if used
        )
        rows.append(
            f'<tr class="{"chosen" if marks else ""}"><td>{" x ".join(map(str, colour))}</td>'
            f'<td class="n">{row.colour_passing:.1%}</td><td class="n">{row.colour_median:.3f}</td>'
            f'<td class="n">{depth}</td><td class="n">{row.depth_passing:.1%}</td>'
            f'<td class="n">{row.depth_median:.3f}</td><td>{marks}</td></tr>'
        )
    head = (
        '<tr><th>colour bins</th><th class="n">pass</th><th class="n">median</th>'
        '<th class="n">depth bins</th><th class="n">pass</th><th class="n">median</th>'
        "<th>chosen for</th></tr>"
    )
    return f"<table>{head}{''.join(rows)}</table>"


def _credits(store: Store, *shown: Any) -> list[str]:
    """The attribution lines of the houses whose pictures are shown, each once."""
    lines: dict[str, None] = {}
    for house in dict.fromkeys(h for table in shown for h in table["house"].to_pylist()):
        try:
            facts = json.loads(store.get(keys.house_key(house, "house.json")))
            line = (facts.get("source") or {}).get("attribution")
        except (ObjectMissing, ValueError, AttributeError):
            continue
        if line:
            lines[str(line)] = None
    return list(lines)


def _worst(table: Any) -> NDArray[np.float64]:
    colour, depth = (table[k].to_numpy() for k in ("colour_score", "depth_score"))
    return np.asarray(np.minimum(colour, depth), np.float64)


def _spread(table: Any, n: int) -> Any:
    """n rows from the best to the worst, at equal steps of rank."""
    order = np.argsort(-_worst(table), kind="stable")
    picked = np.unique(np.linspace(0, max(len(order) - 1, 0), min(n, len(order))).round())
    return table.take(pa.array(order[picked.astype(np.intp)]))


def _refused(scored: Any, n: int) -> Any:
    """n refused rows, the reasons in turn, of each the views that came nearest first."""
    table = scored.filter(pa.array(~scored["kept"].to_numpy(zero_copy_only=False).astype(bool)))
    reasons = table["reason"].to_pylist()
    turns: dict[str, int] = {}
    ranked: list[tuple[int, int, int]] = []
    for row in np.argsort(-_worst(table), kind="stable"):
        turn = turns[reasons[row]] = turns.get(reasons[row], -1) + 1
        ranked.append((turn, len(ranked), int(row)))
    return table.take(pa.array([row for _turn, _rank, row in sorted(ranked)[:n]], pa.int64()))


class _Examples:
    """Cards of views with their histograms beside those of their nearest photographs."""

    def __init__(self, store: Store, reference: Reference, fields: SelectionFields) -> None:
        self._store = store
        self._mode = Mode(fields.score_mode)
        self._binning = reference.facts.binning
        self._places = {name: k for k, name in enumerate(reference.facts.ids)}
        self._colour, self._depth = reference.colour_shares(), reference.depth_shares()
        self._space = reference.facts.settings.colour_space

    def cards(self, table: Any) -> str:
        """A card for each row of a table of verdicts."""
        cards = [self._card(row) for row in table.to_pylist()]
        return "".join(cards) or '<p class="faint">None.</p>'

    def _card(self, row: dict[str, Any]) -> str:
        what = (
            f"colour {row['colour_score']:.3f}, depth {row['depth_score']:.3f}"
            f"{', ' + row['reasons'] if row['reasons'] else ''}"
        )
        pictures = self._picture(row, row["mode"]) + self._picture(row, "depth")
        return (
            f'<div class="card"><h4>{escape(row["room_type"] or row["room"])} <span>'
            f"{escape(row['house'])} {escape(row['view'])}: {escape(what)}</span></h4>"
            f"{pictures}{self._histograms(row)}</div>"
        )

    def _picture(self, row: dict[str, Any], layer: str) -> str:
        key = keys.view_key(row["house"], row["view"], LAYER[layer].file)
        try:
            stored = images.array_from_png(self._store.get(key), key)
        except (ObjectMissing, BadInput):
            return "<figure>picture missing</figure>"
        pixels = depth_colours(stored) if layer == "depth" else stored[..., :3].astype(np.uint8)
        data = small_jpeg(images.thumbnail(pixels, max_edge_px=320), 14_000)
        text = base64.b64encode(data).decode()
        return f'<figure><img alt="{escape(layer)}" src="data:image/jpeg;base64,{text}"></figure>'

    def _histograms(self, row: dict[str, Any]) -> str:
        try:
            pack = house_pack(self._store, row["house"], self._mode)
            place = pack.views.index(row["view"])
        except (BadInput, ObjectMissing, KeyError, ValueError):
            return "<figure>histogram missing</figure>" * 2
        colour = normalised(coarser_colour(pack.colour[place], self._binning.colour))
        depth = normalised(coarser_depth(pack.depth[place], self._binning.depth))
        other = self._colour[self._places[row["colour_reference"]]]
        fullest = np.sort(np.argsort(-np.maximum(colour, other), kind="stable")[:_SHOWN_COLOURS])
        shades = bin_colours(self._binning.colour, self._space)[fullest]
        tuples = [(int(r), int(g), int(b)) for r, g, b in shades]
        charts_ = (
            charts.mirrored(colour[fullest], other[fullest], "colour histograms", tuples),
            charts.mirrored(
                depth, self._depth[self._places[row["depth_reference"]]], "depth histograms"
            ),
        )
        names = row["colour_reference"], row["depth_reference"]
        return "".join(
            f"<figure>{svg}nearest: {escape(name)}</figure>"
            for svg, name in zip(charts_, names, strict=True)
        )


def bin_colours(bins: Iterable[int], space: str) -> NDArray[np.uint8]:
    """(a * b * c, 3) sRGB of the middle of each colour bin, in the order of the counts."""
    axes = [(np.arange(n) + 0.5) * 256 / n for n in bins]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    if space == "ycbcr":
        y, cb, cr = grid[:, 0], grid[:, 1] - 128, grid[:, 2] - 128
        grid = np.stack([y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb], -1)
    return np.clip(np.rint(grid), 0, 255).astype(np.uint8)
