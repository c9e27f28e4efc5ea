"""`pbrs-farm select --report`: a run as one HTML page. Effects: reads the store.

The page needs no network and no script: charts are inline SVG, examples are small pictures in it.
"""

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
from pbrs_farm.core.svg import element, svg_picture, svg_text
from pbrs_farm.curate.selection_run import (
    PAPER_KEPT,
    PAPER_VIEWS,
    KeptCount,
    SelectionSummary,
    good_scores,
    house_pack,
    summary_of,
    verdict_table,
    yield_curve,
)
from pbrs_farm.gallery.gallery_page import data_url, page, small_jpeg
from pbrs_farm.gallery.label_colours import depth_colours
from pbrs_farm.regular_files import read_regular
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.reference_set import Reference
from pbrs_farm.store.object_store import Store

# Charts as inline SVG, styled by the page's own CSS variables; pure functions.


Rgb = tuple[int, int, int]  # 0..255

_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 14, 14, 40  # pixels around the plot area
_TENTHS: Final = ("0", "0.2", "0.4", "0.6", "0.8", "1")
_PERCENT: Final = ("0 %", "20 %", "40 %", "60 %", "80 %", "100 %")


class SvgPicture:
    """An SVG picture of width x height pixels; the label is for readers that cannot see it."""

    def __init__(self, width: float, height: float, label: str) -> None:
        self.width, self.height = width, height
        self._svg = svg_picture(viewBox=f"0 0 {width} {height}", role="img", aria_label=label)

    def add(self, tag: str, content: str = "", **attributes: object) -> None:
        """Draw an element above what is there, as core.svg.element does."""
        element(self._svg, tag, content, **attributes)

    def svg(self) -> Markup:
        """The picture as text, its words escaped."""
        return Markup(svg_text(self._svg))


class PlotArea(SvgPicture):
    """A drawing with a plot area whose positions are shares 0..1 of both axes, upwards."""

    def x(self, share: float) -> float:
        """Horizontal pixel of a share 0..1 of the plot area."""
        return round(_LEFT + share * (self.width - _LEFT - _RIGHT), 2)

    def y(self, share: float) -> float:
        """Vertical pixel of a share 0..1, upwards."""
        return round(self.height - _BOTTOM - share * (self.height - _TOP - _BOTTOM), 2)

    def box(self, at: tuple[float, float, float, float], css: str, style: str = "") -> None:
        """A rectangle from (x0, y0) to (x1, y1), shares."""
        x0, y0, x1, y1 = at
        width = f"{max(self.x(x1) - self.x(x0), 0):.2f}"
        height = f"{max(self.y(y0) - self.y(y1), 0):.2f}"
        self.add(
            "rect", css=css, x=self.x(x0), y=self.y(y1), width=width, height=height, style=style
        )

    def line(self, points: Sequence[tuple[float, float]], css: str) -> None:
        """A polyline through shares."""
        self.add(
            "polyline", css=css, points=" ".join(f"{self.x(x)},{self.y(y)}" for x, y in points)
        )

    def text(self, at: tuple[float, float], text: str, anchor: str = "start", dy: int = 0) -> None:
        """A label at a share, moved by dy pixels downwards."""
        self.add("text", text, x=self.x(at[0]), y=self.y(at[1]) + dy, text_anchor=anchor)

    def axes(self, x_title: str, x_ticks: Sequence[str], y_ticks: Sequence[str]) -> None:
        """Ticks at equal steps along both axes and the title of the lower one."""
        for k, tick in enumerate(x_ticks):
            self.text((k / (len(x_ticks) - 1), 0), tick, "middle", 16)
        for k, tick in enumerate(y_ticks):
            share = k / (len(y_ticks) - 1)
            self.line([(0, share), (1, share)], "grid")
            self.add("text", tick, x=_LEFT - 8, y=self.y(share) + 4, text_anchor="end")
        self.text((0.5, 0), x_title, "middle", 34)

    def threshold(self, value: float) -> None:
        """A vertical line at value and its number, on the side where there is room."""
        self.line([(value, 0), (value, 1)], "limit")
        before = value > 0.85
        at = (value + (-0.01 if before else 0.01), 1)
        self.text(at, f"{value:g}", "end" if before else "start", 10)


def distribution(scores: F64, kept: Bools, threshold: float, title: str) -> Markup:
    """Scores 0..1 in 50 bars, the kept part of each apart, and the threshold."""
    # Count all views and the kept ones by the same bars.
    edges = np.linspace(0, 1, 51)
    whole, _ = np.histogram(scores, edges)
    good, _ = np.histogram(scores[kept], edges)
    top = 4 * max(-(-int(whole.max(initial=0)) // 4), 1)  # four whole steps of the axis
    frame = PlotArea(460, 260, f"Distribution of the {title} of all scored views")
    frame.axes(title, _TENTHS, [f"{top * k // 4:,}" for k in range(5)])
    for k in range(50):
        # Stack the rejected part on the kept part, with a gap between bars.
        x0, x1 = edges[k] + 0.002, edges[k + 1] - 0.002
        frame.box((x0, 0, x1, good[k] / top), "kept")
        frame.box((x0, good[k] / top, x1, whole[k] / top), "rejected")
    frame.threshold(threshold)
    return frame.svg()


def joint(colour: F64, depth: F64, kept: Bools, limits: tuple[float, float]) -> Markup:
    """Colour score against depth score: a cell is darker the more views it holds (log scale).

    A cell that holds both is parted by their shares: a view refused for another reason than its
    scores is not drawn as a kept one.
    """
    n, bounds = 50, [[0, 1], [0, 1]]
    cells, _, _ = np.histogram2d(colour, depth, bins=n, range=bounds)
    good, _, _ = np.histogram2d(colour[kept], depth[kept], bins=n, range=bounds)
    frame = PlotArea(460, 400, "Colour score against depth score")
    frame.axes("colour score", _TENTHS, _TENTHS)
    top = np.log1p(cells.max(initial=0)) or 1.0
    frame.box((limits[0], limits[1], 1, 1), "zone")  # where views are kept
    for i, j in zip(*np.nonzero(cells), strict=True):
        # Darken by the logarithm: most cells hold few views.
        style = f"opacity:{0.15 + 0.85 * np.log1p(cells[i, j]) / top:.2f}"
        border = (i + good[i, j] / cells[i, j]) / n
        if border > i / n:
            frame.box((i / n, j / n, border, (j + 1) / n), "kept", style)
        if border < (i + 1) / n:
            frame.box((border, j / n, (i + 1) / n, (j + 1) / n), "rejected", style)
    for ends in ([(limits[0], 0), (limits[0], 1)], [(0, limits[1]), (1, limits[1])]):
        frame.line(ends, "limit")
    # Write the vertical axis's title upwards.
    y = frame.height / 2 - 20
    turned = f"rotate(-90 12 {y})"
    frame.add("text", "depth score", x=12, y=y, text_anchor="middle", transform=turned)
    return frame.svg()


def yields(
    curves: Sequence[tuple[str, str, Sequence[float]]], threshold: float, paper: tuple[float, float]
) -> Markup:
    """Share of views above each threshold 0..1: (name, css class, shares at equal steps).

    paper: (threshold, share) of the paper's own pictures, drawn as a ring.
    """
    frame = PlotArea(460, 400, "Yield as a function of the threshold")
    frame.axes("threshold for both scores", _TENTHS, _PERCENT)
    for _name, css, shares in curves:
        frame.line([(k / (len(shares) - 1), v) for k, v in enumerate(shares)], f"curve {css}")
    frame.threshold(threshold)
    # Key of the curves, lower left.
    for k, (name, css, _shares) in enumerate(curves):
        y = 0.30 - 0.07 * k
        frame.line([(0.03, y), (0.09, y)], f"curve {css}")
        frame.text((0.11, y), name, dy=4)
    frame.add("circle", css="paper", cx=frame.x(paper[0]), cy=frame.y(paper[1]), r=6)
    frame.text((0.03, 0.30 - 0.07 * len(curves)), f"ring: the paper's own, {paper[1]:.1%}", dy=4)
    return frame.svg()


def mirrored(
    above: NDArray[np.floating],
    below: NDArray[np.floating],
    label: str,
    colours: Sequence[Rgb] | None = None,
) -> Markup:
    """Two histograms on one axis: the view's upwards, its reference's downwards.

    colours: of each bin; the page's own where None.
    """
    width, half = 260, 44  # pixels; the axis lies at half
    # Scale both histograms alike, so that they can be compared.
    drawing = SvgPicture(width, 2 * half, label)
    top = max(float(above.max(initial=0)), float(below.max(initial=0)), 1e-9)
    step = width / max(len(above), 1)  # pixels from bar to bar
    bar = f"{max(step - 0.6, 0.6):.1f}"
    for k, (a, b) in enumerate(zip(above, below, strict=True)):
        fill = "" if colours is None else "fill:rgb({},{},{})".format(*colours[k])
        for value, css, up in ((a, "view", True), (b, "other", False)):
            # Leave out bars that would not be seen.
            height = float(value) / top * (half - 2)
            if height > 0.05:
                x, y = f"{k * step:.1f}", f"{half - height if up else half + 1:.1f}"
                drawing.add(
                    "rect", css=css, x=x, y=y, width=bar, height=f"{height:.1f}", style=fill
                )
    drawing.add("line", css="grid", x1=0, x2=width, y1=half + 0.5, y2=half + 0.5)
    return drawing.svg()


# `pbrs-farm select --report`.


MAX_ROWS: Final = 40  # of a table of houses or room types
_N_EXAMPLES: Final = 8  # views of either verdict
_SHOWN_COLOURS: Final = 26  # fullest colour bins of a histogram


def selection_report(
    store: Store,
    reference: Reference,
    fields: SelectionFields,
    *,
    run: str = "default",
    photographs: Mapping[str, Path] | None = None,
) -> str:
    """HTML of a run as it stands in the store; _N_EXAMPLES kept and as many rejected views are shown.

    fields: the thresholds the run was judged with. photographs: id -> picture of the reference's
    photographs, where the user has them: the nearest ones are shown beside each view. Raises
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
        numbers=_numbers(summary),
        charts=_charts(table, scored, summary, fields),
        reasons=sorted(summary.reasons.items(), key=lambda pair: -pair[1]),
        room_types=_tally_table(summary.room_types),
        houses=_tally_table(summary.houses),
        credits=_credits(store, *shown.values()),
        **{name: [examples.example(row) for row in t.to_pylist()] for name, t in shown.items()},
    )


def _numbers(summary: SelectionSummary) -> list[tuple[str, str]]:
    """The large numbers at the top of the page: (number, what it counts)."""
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
    kept, limits = _is_kept(scored), (fields.min_colour, fields.min_depth)
    # All curves count views of good quality, as a share of all views: as the card does.
    good = good_scores(table)
    # Curves: (label, CSS class, share of views kept at equal steps of the limit).
    curves = (
        ("colour and depth", "both", summary.yield_both),
        ("colour alone", "colour", yield_curve(good[0], summary.views)),
        ("depth alone", "depth", yield_curve(good[1], summary.views)),
    )
    return {
        "colour": distribution(colour, kept, limits[0], "colour score"),
        "depth": distribution(depth, kept, limits[1], "depth score"),
        "joint": joint(colour, depth, kept, limits),
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


def _credits(store: Store, *shown: Any) -> list[str]:
    """The attribution lines of the houses whose pictures are shown, each once."""
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
    """n rejected rows, the reasons in turn, of each the views that came nearest first."""
    table = scored.filter(pa.array(~_is_kept(scored)))
    reasons = table["reason"].to_pylist()
    # Number the views of each reason from the nearest: its turn.
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
            "row": row, "pictures": pictures, "histograms": self._histograms(row),
            "neighbours": neighbours,
        }  # fmt: skip

    def _neighbour(self, name: str) -> str:
        """A photograph's thumbnail as a data URL, "" where it is not here or cannot be read."""
        path = self._photographs.get(name)
        try:
            if path is None:
                return ""
            pixels = images.decode_photo(read_regular(path), str(path))
        except (BadInput, OSError):
            return ""
        return _thumbnail_url(pixels)

    def _picture(self, row: dict[str, Any], layer: str) -> str:
        """The layer's thumbnail as a data URL, "" where it cannot be read."""
        key = keys.view_key(row["house"], row["view"], LAYER[layer].file)
        try:
            stored = images.array_from_png(self._store.get(key), key)
        except (ObjectMissing, BadInput):
            return ""
        pixels = depth_colours(stored) if layer == "depth" else stored[..., :3].astype(np.uint8)
        return _thumbnail_url(pixels)

    def _histograms(self, row: dict[str, Any]) -> list[tuple[Markup | None, str]]:
        """(chart, nearest photograph) for colour and for depth; no chart where there are none."""
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
        # Of the colour bins, show only the fullest of either, in their own colours.
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
    """(a * b * c, 3) sRGB of the middle of each colour bin, in the order of the counts."""
    # Enumerate the middles, the first channel slowest.
    axes = [(np.arange(n) + 0.5) * 256 / n for n in bins]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    # Bring the middle of a YCbCr bin back to RGB (BT.601, full range).
    if space == "ycbcr":
        y, cb, cr = grid[:, 0], grid[:, 1] - 128, grid[:, 2] - 128
        grid = np.stack([y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb], -1)
    return np.clip(np.rint(grid), 0, 255).astype(np.uint8)
