"""A finished folder becomes a sheet and a gallery with every view and notes of missing files."""

from __future__ import annotations

import base64
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from pbrs_farm import images
from pbrs_farm.commands.using import write_sheets
from pbrs_farm.core.classes import NYU40_COLOURS
from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.output_folder import views_of
from pbrs_farm.gallery import contact_sheet as sheet
from pbrs_farm.gallery import gallery_page, sheet_text, view_tiles
from pbrs_farm.gallery import label_colours as colours
from pbrs_farm.gallery.gallery_page import MAX_TILE_BYTES, gallery, small_jpeg
from pbrs_farm.gallery.view_tiles import TILES, Tile
from pbrs_farm.sample import camera_map
from tests.inputs.sheet_house import write_house, write_view


@pytest.fixture
def root(tmp_path: Path) -> Path:
    write_house(tmp_path, "a", ("0_0_1", "0_0_2", "0_1_0"), "Model by A. Person, CC BY 3.0")
    write_house(tmp_path, "b", ("0_0_4",))
    return tmp_path


def test_sheet_is_a_png_with_a_row_for_each_view(root: Path) -> None:
    first = images.array_from_png(sheet.contact_sheet(root, max_views=1))
    four = images.array_from_png(sheet.contact_sheet(root))
    assert first.shape[1] == four.shape[1]
    assert four.shape[0] > first.shape[0] + 3 * 60


def test_a_sheet_leaves_out_the_columns_that_no_view_has(tmp_path: Path) -> None:
    write_house(tmp_path, "a", ())
    views = tmp_path / "houses/a/views"
    write_view(views / "0_0_1", without=("opengl_dl", "opengl_il"))
    write_view(views / "0_0_2", without=("opengl_dl", "mlt_ol"))
    narrow = images.array_from_png(sheet.contact_sheet(tmp_path))
    write_view(views / "0_0_3")
    wide = images.array_from_png(sheet.contact_sheet(tmp_path))
    # OpenGL's indoor mode exists in one view, and in the other none: one column less.
    assert wide.shape[1] - narrow.shape[1] == sheet.TILE_PX + 6
    assert sheet.modes_text([t for t in TILES if t.name != "opengl_dl"]) == "three lighting modes, "
    assert sheet.modes_text(TILES[4:]) == ""


def test_sheet_shows_the_classes_colours(root: Path) -> None:
    pixels = images.array_from_png(sheet.contact_sheet(root)).reshape(-1, 3)
    for nyu40 in (1, 2):
        assert np.all(pixels == NYU40_COLOURS[nyu40], axis=1).sum() > 1000


def test_views_are_spread_over_houses_and_rooms(root: Path) -> None:
    chosen = sheet.spread_views(views_of(root), 3)
    assert [(v.house.id, v.id) for v in chosen] == [("a", "0_0_1"), ("a", "0_1_0"), ("b", "0_0_4")]


def test_a_missing_or_damaged_layer_is_an_empty_tile_with_a_text(tmp_path: Path) -> None:
    write_house(tmp_path, "a", ())
    view = tmp_path / "houses/a/views/0_0_1"
    write_view(view, without=("mlt_ol", "depth"))
    (view / "normal.png").write_bytes(b"\x89PNG\r\n\x1a\nno")
    html = gallery(tmp_path)
    assert html.count("not rendered") == 2
    assert html.count("cannot be read") == 1
    assert images.array_from_png(sheet.contact_sheet(tmp_path)).size


def test_gallery_names_houses_rooms_and_authors_and_escapes_them(root: Path) -> None:
    html = gallery(root)
    assert "Kitchen &amp; &lt;bar&gt;" in html
    assert "<bar>" not in html
    assert html.count("Model by A. Person, CC BY 3.0") == 1
    assert "Room 0_1" in html
    assert html.count("<article") == 4


def test_gallery_links_files_that_exist_and_nothing_outside(root: Path) -> None:
    html = gallery(root)
    links = re.findall(r'(?:data-file|href)="([^"]+)"', html)
    assert len(links) == 4 * (len(TILES) + 1)
    assert all((root / link).is_file() for link in links)
    assert not re.findall(r'(?:src|href)="(?:https?:)?//', html)
    assert "@import" not in html
    assert not re.findall("{{|{%|%}", html)


def test_a_page_of_the_gallery_stays_below_five_megabytes(tmp_path: Path) -> None:
    write_house(tmp_path, "a", ())
    for k in range(2):
        # Pure noise is the worst case.
        write_view(tmp_path / f"houses/a/views/0_0_{k}", size=(480, 640))
    of_a_view = len(gallery(tmp_path).encode()) / 2  # including half of the page's text
    assert of_a_view * gallery_page.PAGE_VIEWS <= gallery_page.MAX_PAGE_BYTES
    worst = gallery_page.PAGE_VIEWS * len(TILES) * (MAX_TILE_BYTES * 4 / 3 + 600)
    assert worst <= gallery_page.MAX_PAGE_BYTES


def test_the_gallery_has_as_many_pages_as_it_needs_and_links_them(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gallery_page, "PAGE_VIEWS", 2)
    (root / "index-9.html").write_text("of an earlier, larger gallery")
    write_sheets(root, 4)
    pages = sorted(path.name for path in root.glob("index*.html"))
    assert pages == ["index-2.html", "index.html"]
    first, second = ((root / name).read_text() for name in ("index.html", "index-2.html"))
    assert [html.count("<article") for html in (first, second)] == [2, 2]
    assert 'href="index-2.html"' in first
    assert 'href="index.html"' in second
    assert "4 views of 2 houses" in second
    # All views together, each once.
    links = re.findall(r'href="([^"]+)/view.json"', first + second)
    assert len(set(links)) == len(links) == 4


def test_a_gallery_of_one_page_has_no_page_links(root: Path) -> None:
    assert "<nav" not in gallery(root)


def test_gallery_embeds_thumbnails_no_larger_than_320(tmp_path: Path) -> None:
    write_house(tmp_path, "a", ())
    write_view(tmp_path / "houses/a/views/0_0_1", size=(480, 640))
    thumbnails = re.findall(r'src="data:image/\w+;base64,([^"]+)"', gallery(tmp_path))
    pictures = [base64.b64decode(text) for text in thumbnails]
    assert len(pictures) == len(TILES)
    for data in pictures:
        # Pure noise is the worst case: it too stays within the budget.
        assert len(data) <= MAX_TILE_BYTES
        assert max(Image.open(io.BytesIO(data)).size) <= 320


def test_small_labels_keep_their_colours_exactly(root: Path) -> None:
    view = gallery(root).split('data-layer="semantic"><')[1]
    data = base64.b64decode(re.search(r'base64,([^"]+)"', view)[1])
    pixels = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
    assert np.array_equal(pixels[0, 0], NYU40_COLOURS[1])
    assert np.array_equal(pixels[-1, 0], NYU40_COLOURS[2])


def test_noise_is_made_small_enough() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (240, 320, 3), np.uint8)
    assert len(small_jpeg(noise, 5000)) <= 5000


def test_a_home_or_room_called_script_is_escaped_everywhere(tmp_path: Path) -> None:
    evil = "<script>alert('\"&')</script>"
    folder = write_house(tmp_path, "<script>", ("0_0_1",), attribution=evil)
    facts = json.loads((folder / "house.json").read_text())
    facts["name"] = facts["rooms"][0]["name"] = evil
    (folder / "house.json").write_text(json.dumps(facts))
    html = gallery(tmp_path)
    assert html.count("<script") == 1  # the page's own
    assert "alert('" not in html
    assert html.count("&lt;script&gt;alert(&#39;&#34;&amp;&#39;)&lt;/script&gt;") > 5


def test_nyu40_colours_are_distinct() -> None:
    table = NYU40_COLOURS.astype(int)
    distances = np.abs(table[:, None] - table[None]).sum(2) + 999 * np.eye(41, dtype=int)
    assert table.shape == (41, 3)
    assert distances.min() >= 48


def test_a_black_picture_is_labelled_as_unlit(root: Path) -> None:
    folder = root / "houses/a/views/0_0_1"
    black = images.png_from_array(np.zeros((60, 80, 3), np.uint8))
    for mode in ("mlt_ol", "mlt_il_ol"):
        (folder / f"{mode}.png").write_bytes(black)
    black_tiles, bright = (view_tiles.tiles_of(view) for view in views_of(root)[:2])
    notes = [
        {t.kind.name: t.note for t in tiles if t.kind.is_photo} for tiles in (black_tiles, bright)
    ]
    dark = {"mlt_ol": "no daylight", "mlt_il_ol": "no light"}
    assert notes == [dict.fromkeys(notes[1], "") | dark, dict.fromkeys(notes[1], "")]


def test_first_200_instances_have_200_colours() -> None:
    colour = colours.instance_colours(np.arange(201)[None])[0]
    assert len(np.unique(colour, axis=0)) == 201


def test_depth_runs_from_pale_near_to_dark_far_and_marks_nothing() -> None:
    depth = np.array([[1000, 2000, 4000, 0]], np.uint16)
    shown = colours.depth_colours(depth, 1.0, 4.0).astype(int)[0]
    assert shown[0].sum() > shown[1].sum() > shown[2].sum()
    assert len(set(shown[3])) <= 2
    assert not np.array_equal(shown[3], shown[2])


def test_a_folder_that_is_no_output_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="has no houses"):
        sheet.contact_sheet(tmp_path)
    (tmp_path / "houses").mkdir()
    with pytest.raises(BadInput, match="no view yet"):
        sheet.contact_sheet(tmp_path)


def test_a_damaged_view_json_is_named(root: Path) -> None:
    (root / "houses/a/views/0_0_1/view.json").write_text("{")
    with pytest.raises(BadInput, match=r"0_0_1/view\.json"):
        gallery(root)


HOSTILE = "Hall\n[   0.1 s] forged\r\u202eabc\u2028" + "x" * 100_000


def test_names_that_strangers_give_do_not_stop_the_sheet(tmp_path: Path) -> None:
    write_house(tmp_path, "a", ("0_0_1",), HOSTILE)
    assert sheet.contact_sheet(tmp_path)
    html = gallery(tmp_path)
    assert "\u202e" not in html
    assert "x" * 700 not in html


def test_a_line_end_in_any_text_of_a_sheet_is_a_space() -> None:
    draw = ImageDraw.Draw(Image.new("RGB", (200, 40)))
    lengths = [
        sheet_text.draw_line(draw, (0, 0), text, fill=(0, 0, 0), size=12)
        for text in ("one\ntwo", "one two", "é\r\nb")
    ]
    assert lengths[0] == lengths[1]
    assert camera_map.text_mark(0, 0, "Level 1\n2").text == "Level 1 2"


def test_names_are_drawn_in_the_script_they_are_written_in(tmp_path: Path) -> None:
    write_house(tmp_path, "a", ("0_0_1",), "Modèle d’Élise – Спальня")
    assert sheet.contact_sheet(tmp_path)
    assert "Modèle d’Élise – Спальня" in gallery(tmp_path)
    assert not any("?" in part for _font, part in sheet_text.runs_of_one_font("Modèle d’Élise –"))


def test_a_letter_that_no_font_has_is_a_question_mark() -> None:
    assert "".join(part for _font, part in sheet_text.runs_of_one_font("a\u0378b\ufe0f")) == "a?b"


def test_gallery_shows_kept_and_rejected_views(root: Path) -> None:
    assert 'id="verdict"' not in gallery(root)
    (root / "selection").mkdir()
    (root / "selection.json").write_text('{"run": "nyu"}')
    rows = [
        {"house": "a", "view": "0_0_1", "reason": ""},
        {"house": "a", "view": "0_0_2", "reason": "unlike-depth"},
    ]
    (root / "selection/nyu.jsonl").write_text("\n".join(json.dumps(r) for r in rows))
    html = gallery(root)
    assert 'id="verdict"' in html
    assert html.count('data-verdict="kept"') == html.count('data-verdict="rejected"') == 1
    assert '<b class="rejected">unlike-depth</b>' in html
    assert html.count('data-verdict=""') == 2
    (root / "selection/nyu.jsonl").write_text("{")
    with pytest.raises(BadInput, match=r"nyu\.jsonl"):
        gallery(root)


def test_the_frame_of_a_missing_tile_stays_in_its_row():
    small = Tile(TILES[0], np.zeros((60, 80, 3), np.uint8))
    assert sheet.row_height([small]) < sheet.row_height([small, Tile(TILES[1], None, "gone")])
    assert sheet.row_height([Tile(TILES[1], None)]) == sheet.row_height(
        [small, Tile(TILES[1], None)]
    )


def test_the_best_room_is_first_and_one_without_daylight_last(tmp_path: Path) -> None:
    marks = {
        "0_0_1": {"room": "0_0", "score": 1.2, "modes": {"light": {"floor_lux": {"outdoor": 0.0}}}},
        "0_1_0": {"room": "0_1", "score": 0.4},
        "0_2_0": {"room": "0_2", "score": 0.3},
        "0_2_5": {"room": "0_2", "score": 0.9},
    }
    write_house(tmp_path, "a", tuple(marks))
    for view, facts in marks.items():
        (tmp_path / f"houses/a/views/{view}/view.json").write_text(json.dumps(facts))
    ordered = [v.id for v in gallery_page.best_first(views_of(tmp_path))]
    assert ordered == ["0_2_5", "0_2_0", "0_1_0", "0_0_1"]
    # Frames of a walk stay in order.
    for k, view in enumerate(marks):
        facts = {"room": "walk", "frame": k, "score": k}
        (tmp_path / f"houses/a/views/{view}/view.json").write_text(json.dumps(facts))
    assert [v.id for v in gallery_page.best_first(views_of(tmp_path))] == list(marks)
