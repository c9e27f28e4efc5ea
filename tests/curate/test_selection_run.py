"""Selection reads stored histograms once, adds houses at their own cost, and opens no picture."""

from __future__ import annotations

import io
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pbrs_farm import images
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Note
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.curate import selection_run as selecting
from pbrs_farm.formats.histogram_json import record_from_json
from pbrs_farm.run.develop_step import view_histogram
from pbrs_farm.store import MemoryStore
from tests.inputs.histogram_records import put_house
from tests.selection.histogram_sets import FIELDS, record, reference

LOW = SelectionFields(min_colour=0.2, min_depth=0.2)


@pytest.fixture
def store() -> MemoryStore:
    memory = MemoryStore()
    put_house(memory, "a", 4)
    put_house(memory, "b", 3)
    return memory


def rows(store: MemoryStore, run: str = "default") -> list[dict]:
    return [json.loads(x) for x in store.get(f"selection/{run}.jsonl").splitlines()]


def test_a_run_writes_a_row_per_view_in_three_files(store: MemoryStore) -> None:
    summary = selecting.select(store, reference(), LOW)
    table = pq.read_table(io.BytesIO(store.get("selection/default.parquet")))
    lines = rows(store)
    assert (summary.views, summary.scored, summary.n_scored_houses) == (7, 7, 2)
    assert table.num_rows == len(lines) == 7
    assert [x["view"] for x in lines][:4] == ["0_0_0", "0_0_1", "0_1_0", "0_1_1"]
    assert {"colour_score", "depth_score", "kept", "reason"} <= set(lines[0])
    stored = json.loads(store.get("selection.json"))
    assert stored["views"] == 7
    assert stored["kept"] == sum(x["kept"] for x in lines) == sum(table["kept"].to_pylist())
    assert stored["fields"]["min_colour"] == 0.2
    assert [(t["name"], t["views"]) for t in stored["houses"]] == [("a", 4), ("b", 3)]


def test_a_second_run_scores_nothing_and_changes_no_byte(store: MemoryStore) -> None:
    selecting.select(store, reference(), LOW)
    before = {k: store.get(k) for k in store.list("selection/")} | {
        "s": store.get("selection.json")
    }
    assert selecting.select(store, reference(), LOW).n_scored_houses == 0
    after = {k: store.get(k) for k in store.list("selection/")} | {"s": store.get("selection.json")}
    assert after == before


def test_a_new_house_costs_only_itself_and_equals_a_whole_run(store: MemoryStore) -> None:
    selecting.select(store, reference(), LOW)
    put_house(store, "0", 2)
    assert selecting.select(store, reference(), LOW).n_scored_houses == 1
    grown = rows(store)
    selecting.select(store, reference(), LOW, run="whole")
    assert rows(store, "whole") == grown


def test_a_house_rendered_again_is_scored_again(store: MemoryStore) -> None:
    selecting.select(store, reference(), LOW)
    old = rows(store)
    put_house(store, "a", 2, seed=9)
    for view in ("0_1_0", "0_1_1"):
        for file in ("histogram.json", "view.json"):
            store.delete(keys.view_key("a", view, file))
    summary = selecting.select(store, reference(), LOW)
    new = rows(store)
    assert summary.n_scored_houses == 1
    assert [x for x in new if x["house"] == "b"] == [x for x in old if x["house"] == "b"]
    assert len([x for x in new if x["house"] == "a"]) == 2
    assert new[0]["colour_score"] != old[0]["colour_score"]


def test_without_a_manifest_the_files_themselves_tell_of_changes() -> None:
    store = MemoryStore()
    put_house(store, "a", 2, manifest=False)
    selecting.select(store, reference(), LOW)
    put_house(store, "a", 2, seed=5, manifest=False)
    assert selecting.select(store, reference(), LOW).n_scored_houses == 1


def test_a_house_that_is_gone_leaves_the_table(store: MemoryStore) -> None:
    selecting.select(store, reference(), LOW)
    for key in list(store.list("houses/b/")):
        store.delete(key)
    assert {x["house"] for x in rows(store)} == {"a", "b"}
    selecting.select(store, reference(), LOW)
    assert {x["house"] for x in rows(store)} == {"a"}


def test_another_reference_is_scored_again(store: MemoryStore) -> None:
    selecting.select(store, reference(), LOW)
    assert selecting.select(store, reference(seed=3), LOW).n_scored_houses == 2


def test_a_damaged_or_missing_histogram_fails_its_view_and_no_other(store: MemoryStore) -> None:
    put_house(store, "c", 2, manifest=False)
    store.put(keys.view_key("c", "0_0_0", "histogram.json"), b"{}")
    store.delete(keys.view_key("c", "0_0_1", "histogram.json"))
    summary = selecting.select(store, reference(), LOW)
    failed = [x for x in rows(store) if x["house"] == "c"]
    assert [x["reason"] for x in failed] == ["failed", "failed"]
    assert "houses/c/views/0_0_0/histogram.json" in failed[0]["fault"]
    assert (summary.views, summary.scored, summary.reasons["failed"]) == (9, 7, 2)


def test_a_reference_of_other_settings_is_named(store: MemoryStore) -> None:
    other_reference = reference(
        fields=HistogramFields(colour_bins=4, depth_bins=16, depth_max_m=8.0)
    )
    with pytest.raises(BadInput, match=r"nyu\.npz.*depth_max_m: 8.0 there, 10.0 here"):
        selecting.select(store, other_reference, LOW, reference_name="nyu.npz")


def test_views_without_the_mode_are_scored_on_request_and_marked_otherwise(
    store: MemoryStore,
) -> None:
    rng = np.random.default_rng(0)
    only_gl = record("d", "0_0_0", rng, modes=(Mode.OPENGL_DL, Mode.MLT_OL))
    store.put(keys.view_key("d", "0_0_0", "histogram.json"), only_gl.json_bytes())
    selecting.select(store, reference(), LOW)
    assert [x["reason"] for x in rows(store) if x["house"] == "d"] == ["unscored"]
    fields = SelectionFields(min_colour=0.2, min_depth=0.2, score_mode="mlt_ol")
    summary = selecting.select(store, reference(), fields)
    assert [x["mode"] for x in rows(store) if x["house"] == "d"] == ["mlt_ol"]
    assert summary.modes == {"mlt_il_ol": 7, "mlt_ol": 1}


def test_an_empty_root_gives_an_empty_run() -> None:
    store = MemoryStore()
    summary = selecting.select(store, reference(), LOW)
    assert (summary.views, summary.kept) == (0, 0)
    assert rows(store) == []


def test_a_run_name_that_is_no_file_name_is_rejected(store: MemoryStore) -> None:
    for run in ("../x", "", "a/b", ".hidden"):
        with pytest.raises(BadInput, match="--run"):
            selecting.select(store, reference(), LOW, run=run)


def test_a_damaged_run_is_named(store: MemoryStore) -> None:
    store.put("selection/default.parquet", b"PAR1 no")
    with pytest.raises(BadInput, match=r"default\.parquet"):
        selecting.select(store, reference(), LOW)


def test_a_damaged_pack_is_made_again(store: MemoryStore) -> None:
    selecting.select(store, reference(), LOW)
    good = store.get(keys.histogram_pack_key("a"))
    store.put(keys.histogram_pack_key("a"), good[:-20])
    selecting.select(store, reference(), LOW, run="again")
    assert store.get(keys.histogram_pack_key("a")) == good


def test_yield_falls_with_the_threshold_and_counts_both_scores(store: MemoryStore) -> None:
    summary = selecting.select(store, reference(), LOW)
    scores = ("unlike-colour", "unlike-depth", "")
    good = [x for x in rows(store) if all(r in scores for r in x["reasons"].split(","))]
    lower_scores = np.array([min(x["colour_score"], x["depth_score"]) for x in good])
    assert list(summary.yield_both) == sorted(summary.yield_both, reverse=True)
    assert summary.yield_both[50] == pytest.approx(
        np.sum(lower_scores > 0.5) / summary.views, abs=1e-6
    )


def test_the_yields_curve_agrees_with_the_card(store: MemoryStore) -> None:
    for threshold in (0.2, 0.5, 0.7):
        fields = LOW.model_copy(update={"min_colour": threshold, "min_depth": threshold})
        summary = selecting.select(
            store, reference(), fields, run=f"t{threshold:g}".replace(".", "")
        )
        share = summary.kept / summary.views
        assert summary.yield_both[round(100 * threshold)] == pytest.approx(share, abs=1e-6)


def test_selection_reads_the_output_of_the_view_step() -> None:
    store, fields = MemoryStore(), HistogramFields()
    picture = np.full((6, 8, 3), 90, np.uint8)
    depth = np.full((6, 8), 1500, np.uint16)
    key = "houses/h/views/0_0_1/"
    for mode in Mode:
        shade = 0 if mode is Mode.MLT_OL else 1
        store.put(f"{key}{mode}.png", images.png_from_array(shade * picture))
    store.put(f"{key}depth.png", images.png_from_array(depth))
    place = {"house": "h", "view": "0_0_1", "room": "0_0", "room_type": "Kitchen"}
    facts = {
        "instances": [{"kind": "object", "fraction": 0.5}],
        "modes": {"light": {"noise": {"outdoor": 1.0, "sum": 0.125}}},
    }
    notes = [Note("missing-texture", "chair", "wood.jpg"), Note("unmapped", "x", "y")]
    data = view_histogram(store, place, tuple(Mode), facts, notes, fields)
    read = record_from_json(data, "x")
    assert (read.room_type, read.scene.noise, read.scene.missing_textures) == ("Kitchen", 0.125, 1)
    assert set(read.colour) == {Mode.MLT_IL_OL}
    assert read.colour[Mode.MLT_IL_OL].counts == (48,)
    assert {m for m, quality in read.picture.items() if quality.brightness == 0} == {Mode.MLT_OL}
    assert read.depth.dense()[1500 * 128 // 10000] == 48
    assert fields != FIELDS


def test_json_lines_are_the_rows_of_the_table() -> None:
    values = {
        "text": ['quote " and \\', None, "é"],
        "number": [0.5, None, 1 / 3],
        "small": [1e-6, 2.0, -0.25],
        "kept": [True, False, True],
    }
    table = pa.table(values)
    lines = [json.loads(x) for x in selecting.json_lines(table).splitlines()]
    assert [x["text"] for x in lines] == values["text"]
    assert [x["kept"] for x in lines] == values["kept"]
    assert [x["number"] for x in lines] == [0.5, None, 0.333333]
    assert [x["small"] for x in lines] == values["small"]
