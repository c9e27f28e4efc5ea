"""The report agrees with the run, is self-contained in one file, and tolerates missing pictures."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from pbrs_farm import images
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import SelectionFields
from pbrs_farm.curate import selection_run as selecting
from pbrs_farm.curate.charts import distribution, joint, yields
from pbrs_farm.curate.selection_report import bin_colours, selection_report
from pbrs_farm.curate.selection_summary import with_types
from pbrs_farm.store import MemoryStore
from tests.selection.histogram_sets import record, reference

FIELDS = SelectionFields(min_colour=0.45, min_depth=0.5)


@pytest.fixture
def store() -> MemoryStore:
    memory = MemoryStore()
    rng = np.random.default_rng(4)
    for k in range(8):
        view = f"0_0_{k}"
        memory.put(keys.view_key("a", view, "histogram.json"), record("a", view, rng).json_bytes())
    facts = {"source": {"attribution": "Model by A. & Co"}}
    memory.put(keys.house_key("a", "house.json"), json.dumps(facts).encode())
    picture = np.full((24, 32, 3), 120, np.uint8)
    memory.put(keys.view_key("a", "0_0_0", "mlt_il_ol.png"), images.png_from_array(picture))
    memory.put(keys.view_key("a", "0_0_0", "depth.png"), images.png_from_array(picture[..., 0] * 9))
    return memory


def page(store: MemoryStore) -> str:
    selecting.select(store, reference(), FIELDS)
    return selection_report(store, reference(), FIELDS)


def test_the_page_holds_every_part_and_no_script_or_link(store: MemoryStore) -> None:
    html = page(store)
    for text in ("Per room type and per house", "Kitchen", "73.0%", "Model by A. &amp; Co"):
        assert text in html
    assert not re.findall("{{|{%|%}", html)
    assert "<script" not in html
    assert "http" not in html


def test_every_chart_is_well_formed(store: MemoryStore) -> None:
    drawings = re.findall(r"<svg.*?</svg>", page(store), re.DOTALL)
    assert len(drawings) >= 4
    for drawing in drawings:
        ET.fromstring(drawing)
    assert not any("nan" in drawing for drawing in drawings)


def test_the_numbers_are_those_of_the_run(store: MemoryStore) -> None:
    html = page(store)
    summary = json.loads(store.get("selection.json"))
    assert 0 < summary["kept"] < summary["views"] == 8
    assert f"<b>{summary['kept']}</b><span>kept" in html
    assert html.count('<div class="card"><h4>') == 8


def test_a_home_a_room_or_a_photograph_called_script_is_escaped() -> None:
    memory, evil = MemoryStore(), "<script>alert(1)</script>"
    of_evil = record("a", "0_0_0", np.random.default_rng(4)).model_copy(update={"room_type": evil})
    memory.put(keys.view_key("a", "0_0_0", "histogram.json"), of_evil.json_bytes())
    facts = {"source": {"attribution": evil}}
    memory.put(keys.house_key("a", "house.json"), json.dumps(facts).encode())
    photographs = reference()
    names = {"ids": (evil,) * len(photographs.facts.ids), "source": evil}
    photographs = replace(photographs, facts=photographs.facts.model_copy(update=names))
    selecting.select(memory, photographs, FIELDS)
    html = selection_report(memory, photographs, FIELDS)
    assert "<script" not in html
    assert html.count("&lt;script&gt;") >= 5


def test_words_in_a_chart_are_escaped() -> None:
    chart = yields([("<b> & co", "both", [1.0, 0.0])], 0.5, (0.7, 0.7))
    assert "&lt;b&gt; &amp; co" in chart
    assert "<b>" not in chart


def test_a_missing_picture_is_noted(store: MemoryStore) -> None:
    html = page(store)
    assert html.count("picture missing") == 2 * 7
    assert html.count("data:image/jpeg") == 2


def test_an_empty_run_has_a_page_too() -> None:
    html = page(MemoryStore())
    assert "No view is rejected" in html
    assert not re.search(r"\bnan\b", html)


def test_no_run_is_an_error(store: MemoryStore) -> None:
    with pytest.raises(BadInput, match="no such run"):
        selection_report(store, reference(), FIELDS)


def test_bars_of_a_distribution_add_up_to_the_views() -> None:
    scores = np.array([0.1, 0.1, 0.9, 1.0])
    svg = ET.fromstring(distribution(scores, scores > 0.5, 0.5, "score"))
    heights = {"kept": 0.0, "rejected": 0.0}
    for box in svg.iter("rect"):
        heights[box.get("class", "")] += float(box.get("height", "0"))
    assert heights["kept"] == pytest.approx(heights["rejected"])


def test_bin_colours_are_inside_their_bins() -> None:
    middle = bin_colours((4, 4, 2), "rgb").reshape(4, 4, 2, 3)
    assert middle[3, 0, 1].tolist() == [224, 32, 192]
    grey = bin_colours((2, 2, 2), "ycbcr").reshape(2, 2, 2, 3)
    assert grey[1].mean() > grey[0].mean()


def test_refused_views_are_not_drawn_in_the_colour_of_kept_ones() -> None:
    scores = np.array(
        [0.9, 0.9, 0.9, 0.2]
    )  # three in one cell above both limits, one of them refused
    is_kept = np.array([True, True, False, False])
    drawn = str(joint(scores, scores, is_kept, (0.7, 0.7)))
    assert drawn.count('class="kept"') == 1
    assert drawn.count('class="rejected"') == 2
    none = str(joint(scores, scores, np.zeros(4, bool), (0.7, 0.7)))
    assert 'class="kept"' not in none


def test_room_types_do_not_depend_on_room_names() -> None:
    names = ["Bedroom 2", "Chambre", "Kitchen", "Room 7", None]
    table = with_types(pa.table({"room_type": pa.array(names, pa.string())}))
    assert table["room_type"].to_pylist() == ["bedroom", "bedroom", "kitchen", "", ""]
