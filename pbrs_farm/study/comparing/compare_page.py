"""A comparison as a folder: compare.json, and a page of histograms and unlike views. Effects: files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from markupsafe import Markup

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.curate.charts import mirrored
from pbrs_farm.gallery.gallery_page import data_url, small_jpeg
from pbrs_farm.gallery.html_page import page
from pbrs_farm.study.comparing.comparison import Comparison, Unlike, mean_histogram
from pbrs_farm.study.comparing.picture_facts import PictureFacts, bands_of_height
from pbrs_farm.study.training.run_folder import write_report

_MOST_BYTES: Final = 14_000  # maximum size of a picture on the page
_MOST_CLASSES: Final = 12
_MOST_LINES: Final = 20  # maximum number of unreadable pictures on the page


def write_comparison(out: Path, comparison: Comparison) -> Path:
    """Write compare.json and index.html; the page's path. Raises BadInput if out is not writable."""
    return write_report(out, "compare.json", comparison.report, comparison_page(comparison))


def comparison_page(comparison: Comparison) -> str:
    """HTML without scripts, pictures included."""
    ours, photographs = comparison.ours, comparison.photographs
    left_out = [*ours.left_out, *photographs.left_out]
    return page(
        "pbrs_farm.study.comparing",
        "compare_page.html",
        report=comparison.report,
        charts=_charts(ours.pictures, photographs.pictures),
        classes=comparison.report["classes"][:_MOST_CLASSES],
        cards=[_card(unlike) for unlike in comparison.unlike],
        left_out=[shown(line, 3 * MAX_PLACE) for line in left_out[:_MOST_LINES]],
        n_left_out=len(left_out),
        credits=[*ours.credits, *photographs.credits],
    )


def _charts(a: Sequence[PictureFacts], b: Sequence[PictureFacts]) -> list[tuple[str, Markup]]:
    """(title, chart) of the histograms that both sets have."""
    charts = []
    for name, title in (
        ("luma", "Luma, from dark to bright"),
        ("depth", "Depth, 0 to 10 m"),
        ("normals", "Surfaces, from those that face down to those that face up"),
    ):
        ours, photographs = mean_histogram(a, name), mean_histogram(b, name)
        if ours is not None and photographs is not None:
            if name == "normals":
                ours, photographs = bands_of_height(ours), bands_of_height(photographs)
            charts.append((title, mirrored(ours, photographs, title)))
    return charts


def _card(unlike: Unlike) -> dict[str, Any]:
    return {
        "view": shown(unlike.view.id, MAX_PLACE),
        "photograph": shown(unlike.photograph.id, MAX_PLACE),
        "times": f"{unlike.times:.1f}",
        "reasons": unlike.reasons,
        "pictures": [_url(unlike.view.colour), _url(unlike.photograph.colour)],
    }


def _url(picture: Srgb8Image) -> str:
    return data_url(small_jpeg(picture, _MOST_BYTES), "jpeg")
