import json
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.cli import build_parser
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import png_from_array
from tests.check.roots import SIZE, make_root


def run(*words: str) -> int:
    args = build_parser("labelling", words).parse_args(words)
    return int(args.handler(args) or 0)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    house = make_root(folder)
    picture = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    (house / "views/v0/opengl_dl.png").write_bytes(png_from_array(picture))
    return folder


def test_export_names_the_folder_after_the_form(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("export", str(root), "--to", "coco") == 0
    assert (tmp_path / f"{root.name}_coco/annotations.json").is_file()
    assert "2 views" in capsys.readouterr().out


def test_classes_prints_a_table_or_json(root, capsys):
    assert run("classes", str(root)) == 0
    assert "| wall | 1 |" in capsys.readouterr().out
    assert run("classes", str(root), "--json") == 0
    assert json.loads(capsys.readouterr().out)["n_views"] == 2


def test_a_label_sheet_of_a_view_and_of_something_else(root, tmp_path):
    view = next((root / "houses").iterdir()) / "views/v0"
    assert run("label-sheet", str(view), "--out", str(tmp_path / "sheet.png")) == 0
    assert (tmp_path / "sheet.png").read_bytes()[:4] == b"\x89PNG"
    with pytest.raises(BadInput):
        run("label-sheet", str(tmp_path))
