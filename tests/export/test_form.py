"""The table of forms: one file per form, and no other list."""

from __future__ import annotations

from pathlib import Path

import pytest

import pbrs_farm as pf
from pbrs_farm.cli import build_parser, main
from pbrs_farm.commands.set_file import set_from_bytes
from pbrs_farm.core.errors import BadInput
from pbrs_farm.export import forms
from pbrs_farm.export.chosen_view import Choice
from pbrs_farm.export.export_homes import export_homes, export_house
from pbrs_farm.export.export_views import export
from pbrs_farm.export.form import conventions_table, form_names, form_of, forms_table
from pbrs_farm.formats.class_map import class_map
from pbrs_farm.formats.house_bundle import bundle_from_house
from tests.check.roots import make_root
from tests.export.homes import repaired_home

DOCS = Path(__file__).parents[2] / "docs/formats"
PAGES = {"views": DOCS / "export.md", "homes": DOCS / "simulators.md"}
READ_BACK = {
    "bop": "bop",
    "captions": "captions",
    "coco": "export",
    "colmap": "sequences",
    "cosmos": "trainer_forms",
    "cotracker": "tapvid",
    "fsd": "trainer_forms",
    "hdf5": "export",
    "hypersim": "hypersim",
    "interiorverse": "trainer_forms",
    "kitti": "sequences",
    "layered-depth": "trainer_forms",
    "layoutnet": "training_forms",
    "lerobot": "trainer_forms",
    "lidar": "lidar_form",
    "lingbot": "trainer_forms",
    "marigold": "training_forms",
    "moge": "trainer_forms",
    "nerfstudio": "sequences",
    "openspatial": "trainer_forms",
    "ply": "point_clouds",
    "questions": "questions",
    "released": "export",
    "tapvid": "tapvid",
    "tum": "sequences",
    "wai": "trainer_forms",
    "webdataset": "export",
    "yolo": "export",
    "yolo-depth": "training_forms",
    "yolo-seg": "export",
    "yolo-semantic": "training_forms",
}
"""Form of views -> tests/export/test_<name>.py, which reads it back by loaders written from its documentation."""


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


def test_the_docs_state_the_pixel_convention_of_each_form() -> None:
    table = conventions_table()
    assert table in PAGES["views"].read_text()
    views = [name for name in form_names() if form_of(name).of == "views"]
    assert [line.split("`")[1] for line in table.splitlines()[2:]] == views


def test_every_form_of_views_is_read_back_by_a_test() -> None:
    assert list(READ_BACK) == [name for name in form_names() if form_of(name).of == "views"]
    for name, file in READ_BACK.items():
        source = Path(__file__).with_name(f"test_{file}.py").read_text()
        assert f'"{name}"' in source, file
        assert "def test_" in source, file


def test_an_unknown_form_is_answered_with_those_there_are(root: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"no such form.*coco.*yolo-seg"):
        export(root, tmp_path / "x", "voc")
    with pytest.raises(BadInput, match="exports homes"):
        export(root, tmp_path / "x", "gltf")
    with pytest.raises(
        BadInput, match=r"no such format of homes.*gltf, habitat, mjcf, sdf, urdf, usd, usdz\)"
    ):
        export_homes(root, tmp_path / "x", "coco")


MINE = """
from pbrs_farm.plugin import Record, ViewForm, option


class LineOptions(Record):
    prefix: str = option("view", "the first word of a line", metavar="WORD")
    n_words: int = option(1, "words a line", metavar="N", least=1)


def write(views, out, choice):
    options = choice.of(LineOptions)
    words = " ".join(sorted(choice.class_names.values())[: options.n_words])
    lines = [f"{options.prefix} {view.id} {words}" for view in views]
    (out / "lines.txt").write_text("\\n".join(lines))


FORM = ViewForm(
    "my-lines", write, "`lines.txt`: a line a view", options=LineOptions, has_classes=True
)
"""


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user's form with options, as one file among the forms."""
    folder = tmp_path / "forms"
    folder.mkdir()
    (folder / "my_lines.py").write_text(MINE)
    monkeypatch.setattr(forms, "__path__", [*forms.__path__, str(folder)])


@pytest.mark.kinds("form")
@pytest.mark.usefixtures("mine")
def test_a_file_is_all_that_a_new_form_takes(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # It is offered, written with custom classes, named where another form has none, and documented.
    assert (
        build_parser("labelling").parse_args(["export", "r", "--to", "my-lines"]).to == "my-lines"
    )
    (tmp_path / "mine.csv").write_text("from,id,name\nchair,1,seat\n")
    words = ["--to", "my-lines", "--classes", str(tmp_path / "mine.csv"), "--out"]
    assert main(["export", str(root), *words, str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'out'}: 2 views, 1 file\n"
    lines = (tmp_path / "out/lines.txt").read_text().splitlines()
    assert lines == ["view v0 seat", "view v1 seat"]
    choice = Choice(classes=class_map(tmp_path / "mine.csv"))
    with pytest.raises(BadInput, match=r"my-lines"):
        export(root, tmp_path / "x", "bop", choice=choice)
    assert "| `my-lines` | `lines.txt`: a line a view |" in forms_table("views")


def _lines(out: Path) -> list[str]:
    return (out / "lines.txt").read_text().splitlines()


@pytest.mark.kinds("form")
@pytest.mark.usefixtures("mine")
def test_its_options_are_those_of_the_command_of_python_and_of_a_set(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", str(root), "--to", "my-lines", "--prefix", "shot", "--n-words", "2"]
    assert main([*words, "--out", str(tmp_path / "a")]) == 0
    pf.open(root).export(tmp_path / "b", to="my-lines", prefix="shot", n_words=2)
    assert (
        _lines(tmp_path / "a")
        == _lines(tmp_path / "b")
        == ["shot v0 bag bathtub", "shot v1 bag bathtub"]
    )
    table = '[part.views]\nhomes = ["builtin"]\n[form.mine]\nto = "my-lines"\nprefix = "shot"'
    (form,) = set_from_bytes(table.encode(), "mine.toml").forms
    assert repr(form.choice.options) == "LineOptions(prefix='shot', n_words=1)"
    with pytest.raises(SystemExit):
        main(["export", "--to", "my-lines", "--help"])
    text = capsys.readouterr().out
    assert "--prefix WORD" in text
    assert "--scanner" not in text


OF_HOMES = """
from pbrs_farm.plugin import HomeForm, Record, option


class CountOptions(Record):
    unit: str = option("rooms", "what is counted", choices=("rooms", "items"))


def write(home, folder):
    (folder / "count.txt").write_text(str(len(getattr(home.house, home.of(CountOptions).unit))))


FORM = HomeForm("my-count", write, "`count.txt`", options=CountOptions)
"""


@pytest.mark.kinds("form")
def test_a_form_of_homes_has_options_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "forms").mkdir()
    (tmp_path / "forms/my_count.py").write_text(OF_HOMES)
    monkeypatch.setattr(forms, "__path__", [*forms.__path__, str(tmp_path / "forms")])
    house = repaired_home()
    files = zip(("house.glb", "house.json"), bundle_from_house(house), strict=True)
    for name, data in files:
        (tmp_path / name).write_bytes(data)
    words = ["export", str(tmp_path), "--to", "my-count", "--unit", "items", "--out"]
    assert main([*words, str(tmp_path / "out")]) == 0
    assert (tmp_path / f"out/{house.id}/count.txt").read_text() == str(len(house.items))
    export_house(house, tmp_path / "rooms", "my-count")
    assert (tmp_path / "rooms/count.txt").read_text() == str(len(house.rooms))
    with pytest.raises(BadInput, match=r"--unit: gltf has no such option \(--to my-count"):
        export_house(house, tmp_path / "x", "gltf", unit="items")


@pytest.mark.usefixtures("mine")
def test_an_option_of_another_form_is_answered_with_the_forms_that_have_it(
    root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["export", str(root), "--to", "coco", "--prefix", "shot"])
    assert "--prefix: coco has no such option (--to my-lines)" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["export", str(root), "--to", "gltf", "--scanner=vlp16"])
    assert "--scanner: gltf has no such option (--to lidar)" in capsys.readouterr().err
    with pytest.raises(BadInput, match=r"^prefix: coco has no such option \(to my-lines\)"):
        pf.open(root).export(tmp_path / "x", prefix="shot")
    with pytest.raises(
        BadInput, match=r"^prefx: my-lines has no such option \(did you mean prefix"
    ):
        pf.open(root).export(tmp_path / "x", to="my-lines", prefx="shot")
    with pytest.raises(BadInput, match=r"^n_words: 0: expected 1 or more"):
        pf.export_views(root, tmp_path / "x", "my-lines", n_words=0)
    with pytest.raises(BadInput, match=r"^n_words: expected a whole number"):
        pf.export_views(root, tmp_path / "x", "my-lines", n_words="few")
    table = '[part.views]\nhomes = ["builtin"]\n[form.coco]\nscanner = "vlp16"'
    with pytest.raises(
        BadInput, match=r"form\.coco: --scanner: coco has no such option \(--to lidar"
    ):
        set_from_bytes(table.encode(), "mine.toml")
