"""`verify` of a set: a true one is CLEAN, every planted falsehood is found, every field has an owner."""

from __future__ import annotations

import json
import shutil
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from pbrs_farm import check
from pbrs_farm.check import verify
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.fields import FieldRow, fields_of, fields_of_set, row_and_names
from pbrs_farm.check.question_checks import fault_of_phrase
from pbrs_farm.check.stored_set import PACKED, stored_set
from pbrs_farm.check.verify import check_form, check_set
from pbrs_farm.cli import main
from pbrs_farm.core.record import read_csv
from pbrs_farm.export.form import FORMS as FORMS_OF_EXPORT
from pbrs_farm.export.form import form_of
from tests.check.set_falsehoods import FORMS, KINDS, planted
from tests.sets.small_sets import small_set


@pytest.fixture(scope="module")
def finished_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("h5py")
    out = tmp_path_factory.mktemp("made") / "small"
    file = small_set(tmp_path_factory.mktemp("set"), FORMS, "128x96")
    assert main(["make", str(file), "--out", str(out)]) == 0
    return out


def test_a_true_set_is_clean(finished_set: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(finished_set), "--all"]) == 0
    text = capsys.readouterr().out
    assert text.endswith("CLEAN\n")
    assert "3 houses, 5 views, every pixel" in text
    looked, _, omitted = text.partition("not looked at:")
    assert "coco/annotations.json: " in looked
    assert "done/*.json digest: a digest of inputs that only `make` reads" in omitted


@pytest.mark.long
def test_a_set_without_its_light_is_clean(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = small_set(tmp_path / "in"), tmp_path / "out"
    text = file.read_text().replace('["opengl_dl"]', '["mlt_il_ol"]')
    file.write_text(text.replace("set = [", 'set = [\n  "light.spp=2",', 1))
    assert main(["make", str(file), "--out", str(out)]) == 0
    assert list(out.rglob("mlt_il_ol.png"))
    assert not list(out.rglob("radiance.exr"))
    assert "radiance.exr" not in (out / "SHA256SUMS").read_text()
    capsys.readouterr()
    assert main(["verify", str(out)]) == 0
    assert "no radiance.exr to develop" in capsys.readouterr().out


FIRST = {check: kind for kind, (_plant, check) in reversed(KINDS.items())}


@pytest.mark.parametrize(
    "kind",
    [pytest.param(k, marks=[] if FIRST[KINDS[k][1]] == k else pytest.mark.slow) for k in KINDS],
)
def test_a_planted_falsehood_is_found(finished_set: Path, tmp_path: Path, kind: str) -> None:
    out = Path(shutil.copytree(finished_set, tmp_path / "small"))
    assert KINDS[kind][1] in planted(out, kind)


def test_each_field_of_a_set_has_a_check_or_a_reason(finished_set: Path) -> None:
    stored, tally = stored_set(finished_set), Tally()
    assert stored is not None
    check_set(stored, tally)
    counted = tally.certificate("", 0, 0, all_pixels=False).counts.keys()
    fields = fields_of_set(stored)
    assert len(fields) > 150
    for pair in fields:
        row, _names = row_and_names(*pair)
        assert row is not None, pair
        assert row.why or row.check in counted, pair


def test_each_form_of_views_has_rows() -> None:
    rows = read_csv(Path(check.__file__).with_name("set_fields.csv"), FieldRow)
    words = {row.file.partition("/")[0] for row in rows} - {"*"}  # of every form
    names = {name for name in FORMS_OF_EXPORT.own_names() if form_of(name).of == "views"}
    for name in names | set(PACKED):
        assert any(fnmatch(name, word) for word in words), name


def _changed(value: Any, path: str) -> Any:
    """The value with the first field of a path changed, in the words of fields_of."""
    first, _, rest = path.partition(".")
    if isinstance(value, list) and first == "[]":
        return [_changed(value[0], rest), *value[1:]]
    key = first.removesuffix("[]")
    if isinstance(value, dict) and key:
        of = value if key in value else {}
        if first.endswith("[]"):
            k = next((k for k, row in enumerate(of[key]) if _has(row, rest)), 0)
            rows = [_changed(row, rest) if n == k else row for n, row in enumerate(of[key])]
            return value | {key: rows}
        return value | {key: _changed(of[key], rest)}
    if isinstance(value, list):
        return [_changed(value[0], ""), *value[1:]] if value else [1]
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int | float) else f"{value or ''}1"


def _has(row: dict[str, Any], path: str) -> bool:
    return path in set(fields_of(row))


@pytest.mark.long
def test_a_change_of_any_field_fails(finished_set: Path, tmp_path: Path) -> None:
    """Every JSON field with a check, changed once in each form."""
    out = Path(shutil.copytree(finished_set, tmp_path / "small"))
    stored = stored_set(out)
    assert stored is not None
    unfound, n = [], 0
    for form in stored.forms():
        for file in sorted(form.folder.rglob("*.json*")):
            text = file.read_text()
            lines = text.splitlines() if file.suffix == ".jsonl" else [text]
            name = (
                f"{form.to}/h/{file.name}"
                if form.to in ("nerfstudio", "wai")
                else f"{form.to}/{file.name}"
            )
            document = json.loads(lines[0])
            for field in sorted(set(fields_of(document))):
                row, _names = row_and_names(name, field)
                if row is None or not row.check:
                    continue
                lines[0] = json.dumps(_changed(document, field))
                file.write_text("".join(f"{line}\n" for line in lines))
                tally, n = Tally(), n + 1
                check_form(stored, form, tally)
                if not tally.n_failed:
                    unfound.append(f"{name} {field}")
            file.write_text(text)
    assert n > 100
    assert not unfound


def test_a_part_that_is_not_at_hand_is_named(finished_set: Path, tmp_path: Path) -> None:
    out = Path(shutil.copytree(finished_set, tmp_path / "small"))
    shutil.rmtree(out / "parts/panoramas")
    certificate = verify(out, sample=10)
    assert certificate.is_clean, certificate.text()
    line = "forms/small/panoramas: parts/panoramas is not at hand: SHA256SUMS alone"
    assert line in certificate.not_looked_at


def test_a_set_without_checksums_is_not_finished(finished_set: Path, tmp_path: Path) -> None:
    out = Path(shutil.copytree(finished_set, tmp_path / "small"))
    (out / "SHA256SUMS").unlink()
    assert main(["verify", str(out), "--sample", "10"]) == 3


def test_a_damaged_set_s_file_is_named(
    finished_set: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = Path(shutil.copytree(finished_set, tmp_path / "small"))
    (out / "small.toml").write_text("[part")
    assert main(["verify", str(out)]) == 1
    assert "small.toml: is not a set's file, or damaged" in capsys.readouterr().err


def test_the_certificate_of_a_root_names_that_of_sets(finished_set: Path) -> None:
    certificate = verify(finished_set / "parts/panoramas", sample=10)
    assert any("`pbrs-farm verify SET`" in line for line in certificate.not_looked_at)


@pytest.mark.parametrize(
    ("phrase", "fault"),
    [
        ("the armchair on the left", ""), ("the armchair on the right", "fits instance 2"),
        ("the leftmost armchair", ""), ("the armchair nearest to the camera", "fits instance 2"),
        ("the armchair farthest from the camera", ""), ("the blue armchair", ""),
        ("the armchair", "fits several items"), ("the sofa on the left", "is of another noun"),
    ],
)  # fmt: skip
def test_a_phrase_is_judged_by_its_words(phrase: str, fault: str) -> None:
    rows = {
        k: {"class": "chair", "name": "Armchair", "kind": "object", "box2d": [x, 0, x + 9, 9]}
        for k, x in ((1, 0), (2, 40))
    }
    scene = SimpleNamespace(rows=rows, namesakes=lambda _k: [1, 2], depth=lambda k: 9000 - k)
    assert fault_of_phrase(scene, 1, phrase) == fault
