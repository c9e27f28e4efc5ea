"""The table of forms: one file a form, and nothing else lists them."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.sets import READ_BACK
from pbrs_farm.cli import build_parser, main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export import forms
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_homes import export_homes
from pbrs_farm.export.export_views import export
from pbrs_farm.export.form import conventions_table, form_names, form_of, forms_table
from pbrs_farm.formats.class_map import class_map
from tests.check.roots import make_root

DOCS = Path(__file__).parents[2] / "docs/formats"
PAGES = {"views": DOCS / "export.md", "homes": DOCS / "simulators.md"}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    make_root(folder)
    return folder


@pytest.mark.parametrize("name", form_names())
def test_a_form_is_called_as_its_file(name: str) -> None:
    form = form_of(name)
    assert form.name == name
    assert form.help


@pytest.mark.parametrize("of", ["views", "homes"])
def test_the_docs_have_the_table(of: str) -> None:
    assert forms_table(of) in PAGES[of].read_text()


def test_the_docs_say_how_each_form_of_views_counts_pixels() -> None:
    table = conventions_table()
    assert table in PAGES["views"].read_text()
    views = [name for name in form_names() if form_of(name).of == "views"]
    assert [line.split("`")[1] for line in table.splitlines()[2:]] == views


def test_the_bench_of_sets_reads_every_form_of_views_back() -> None:
    assert list(READ_BACK) == [name for name in form_names() if form_of(name).of == "views"]


def test_an_unknown_form_is_answered_with_those_there_are(root: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"no such form.*coco.*yolo-seg"):
        export(root, tmp_path / "x", "voc")
    with pytest.raises(BadInput, match="is a form of homes"):
        export(root, tmp_path / "x", "gltf")
    with pytest.raises(
        BadInput, match=r"no such form of a home.*gltf, habitat, mjcf, sdf, urdf, usd, usdz\)"
    ):
        export_homes(root, tmp_path / "x", "coco")


MINE = """
from pbrs_farm.export.form import ViewForm


def write(views, out, choice):
    lines = [f"{view.house.id}/{view.id} {sorted(choice.class_names.values())[0]}" for view in views]
    (out / "lines.txt").write_text("\\n".join(lines))
    return 1


FORM = ViewForm("my-lines", write, "`lines.txt`: a line a view", has_classes=True)
"""


@pytest.mark.kinds("form")
def test_a_file_is_all_that_a_new_form_takes(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "forms"
    folder.mkdir()
    (folder / "my_lines.py").write_text(MINE)
    monkeypatch.setattr(forms, "__path__", [*forms.__path__, str(folder)])
    # It is offered, written with classes of one's own, named where another form has none, and documented.
    assert (
        build_parser("labelling").parse_args(["export", "r", "--to", "my-lines"]).to == "my-lines"
    )
    (tmp_path / "mine.csv").write_text("from,id,name\nchair,1,seat\n")
    words = ["--to", "my-lines", "--classes", str(tmp_path / "mine.csv"), "--out"]
    assert main(["export", str(root), *words, str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'out'}: 2 views, 1 file\n"
    lines = (tmp_path / "out/lines.txt").read_text().splitlines()
    assert [line.split()[1] for line in lines] == ["seat", "seat"]
    choice = Choice(classes=class_map(tmp_path / "mine.csv"))
    with pytest.raises(BadInput, match=r"my-lines"):
        export(root, tmp_path / "x", "bop", choice=choice)
    assert "| `my-lines` | `lines.txt`: a line a view |" in forms_table("views")
