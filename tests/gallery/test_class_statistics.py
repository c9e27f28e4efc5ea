import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.classes import NYU40_COLOURS, NYU40_NAMES
from pbrs_farm.core.errors import BadInput
from pbrs_farm.formats.output_folder import views_of
from pbrs_farm.gallery.class_statistics import class_statistics
from pbrs_farm.gallery.label_sheet import label_sheet, legend
from pbrs_farm.images import png_from_array


def finished(root: Path, semantics: list[np.ndarray]) -> Path:
    """A folder with a view per semantic picture; instance ids equal class ids."""
    house = root / "houses/h"
    for k, ids in enumerate(semantics):
        view = house / f"views/v{k}"
        view.mkdir(parents=True)
        rows = [{"id": int(i), "nyu40": int(i)} for i in np.unique(ids) if i]
        (view / "view.json").write_text(json.dumps({"instances": rows}))
        (view / "semantic.png").write_bytes(png_from_array(ids.astype(np.uint8)))
        edges = np.zeros(ids.shape, np.uint8)
        edges[8:10, 8:10] = 255
        (view / "boundary.png").write_bytes(png_from_array(edges))
        (view / "opengl_dl.png").write_bytes(
            png_from_array(np.full((*ids.shape, 3), 100, np.uint8))
        )
    items = [
        {"id": "a", "source_class": "eTeks#spaceship", "tags": ["unmapped"]},
        {"id": "b", "source_class": "eTeks#spaceship", "tags": ["unmapped"]},
        {"id": "c", "source_class": "chair", "tags": []},
        {"id": "d", "name": "Sofa", "nyu40": 6, "tags": ["class:name"]},
        {"id": "e", "name": "Tray | x", "nyu40": 40, "tags": ["class:size", "unmapped"]},
    ]
    (house / "house.json").write_text(json.dumps({"items": items}))
    return root


def half(a: int, b: int) -> np.ndarray:
    ids = np.full((16, 24), a)
    ids[:, 12:] = b
    return ids


def test_shares_and_counts_are_over_all_pixels_and_images(tmp_path):
    stats = class_statistics(finished(tmp_path, [half(1, 5), half(1, 0)]))
    rows = {r.name: r for r in stats.rows}
    assert rows["wall"].pixel_share == 0.5
    assert (rows["wall"].n_images, rows["wall"].n_instances) == (2, 2)
    assert (rows["chair"].pixel_share, rows["chair"].n_images) == (0.25, 1)
    assert rows["none"].pixel_share == 0.25
    assert stats.classes_per_image == 1.5
    assert sum(r.pixel_share for r in stats.rows) == 1
    assert stats.rows[0].name == "wall"


def test_items_without_a_class_are_listed_with_their_number(tmp_path):
    stats = class_statistics(finished(tmp_path, [half(1, 5)]))
    assert stats.unmapped == ("h: Tray | x (1)", "h: eTeks#spaceship (2)")
    assert "- h: eTeks#spaceship (2)" in stats.text()


def test_each_class_is_listed_with_the_rule_that_decided_it(tmp_path):
    stats = class_statistics(finished(tmp_path, [half(1, 5)]))
    decided = {d.item or d.source_class: (d.rule, d.n_items) for d in stats.decisions}
    assert decided["Sofa"] == ("name", 1)
    assert decided["eTeks#spaceship"] == ("none", 2)
    assert decided["chair"] == ("source", 1)
    assert "| size | otherprop | 1 | Tray   x |  |" in stats.text()
    assert "5 items: 2 by none" in stats.text()


def test_the_classes_of_a_home_are_listed_without_rendering_it(tmp_path, capsys):
    assert main(["classes", "builtin"]) == 0
    assert "by source" in capsys.readouterr().out


def test_a_folder_without_labels_and_an_impossible_class_are_refused(tmp_path):
    (tmp_path / "a/houses").mkdir(parents=True)
    with pytest.raises(BadInput, match="no finished view"):
        class_statistics(tmp_path / "a")
    with pytest.raises(BadInput, match="class 41"):
        class_statistics(finished(tmp_path / "b", [half(1, 41)]))


def test_the_label_sheet_shows_picture_overlay_and_the_edge_magnified(tmp_path):
    sheet = label_sheet(views_of(finished(tmp_path, [half(1, 5)]))[0])
    assert sheet.shape[1] == 48
    assert (sheet[0, 0] == 100).all()
    assert (sheet[0, 24] == (100 + NYU40_COLOURS[1].astype(int)) // 2).all()
    assert (sheet[8, 24 + 8] == 255).all()
    # The window is 2 x 3 pixels, eight times as large, and holds the 2 x 2 edge.
    magnified = sheet[16:32, 24:48]
    assert (magnified == 255).all(axis=2).sum() == 4 * 64


def test_the_legend_names_each_class_with_its_colour():
    picture = legend(half(1, 5), 400)
    colours = {tuple(c) for c in picture.reshape(-1, 3)}
    assert tuple(NYU40_COLOURS[1]) in colours
    assert tuple(NYU40_COLOURS[5]) in colours
    assert tuple(NYU40_COLOURS[7]) not in colours
    assert len(NYU40_NAMES) == len(NYU40_COLOURS)


def test_a_view_without_a_picture_has_no_label_sheet(tmp_path):
    root = finished(tmp_path, [half(1, 5)])
    (root / "houses/h/views/v0/opengl_dl.png").unlink()
    with pytest.raises(BadInput, match="no picture"):
        label_sheet(views_of(root)[0])


def test_a_name_without_a_class_is_one_short_line(tmp_path):
    root = finished(tmp_path, [half(1, 5)])
    item = {"id": "a", "source_class": "vase\n| forged |" + "x" * 9000, "tags": ["unmapped"]}
    (root / "houses/h/house.json").write_text(json.dumps({"items": [item]}))
    lines = class_statistics(root).text().splitlines()
    assert all(len(line) < 200 for line in lines)
    assert not any(line.startswith("| forged") for line in lines)
