"""The command line: wrong arguments and files end in one clear line and a non-zero exit."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from pbrs_farm.cli import build_parser, main
from pbrs_farm.commands.arguments import recipe_of
from pbrs_farm.core.layers import LAYERS, MOST_VARIANTS


def error_of(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    code = main(list(words))
    captured = capsys.readouterr()
    assert code == 1, captured
    assert "Traceback" not in captured.err + captured.out
    return captured.err


def zipped(path: Path, **entries: str) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in entries.items():
            archive.writestr(name.replace("__", "."), text)
    return path


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "x.sh3d", "--out", "{out}"], "x.sh3d: no such file"),
        (["run", "--out", "{out}"], "no home given"),
        (["run", "builtin", "--out", "{out}", "--recipe", "grand"], "no recipe 'grand'"),
        (["run", "builtin", "--out", "{out}", "--set", "light.spp=0"], "light.spp"),
        (["run", "builtin", "--out", "{out}", "--set", "spp"], "expected group.field=value"),
        (["run", "builtin", "--out", "{out}", "--modes", "mlt"], "no such lighting mode"),
        (["run", "builtin", "--out", "{out}", "--layers", "smell"], "no such layer"),
        (["run", "builtin", "--out", "{out}", "--size", "axb"], "expected a width and a height"),
        (["run", "builtin", "--out", "{out}", "--size", "640"], "e.g. 320x240"),
        (["run", "builtin", "--out", "{out}", "--size", "99999x9"], "each 1 to 16384 pixels"),
        (["run", "builtin", "--out", "{out}", "--fps", "10"], "--fps: is for walks only"),
        (["export", "{out}/none", "--to", "coco", "--out", "{out}"], "{out}/none: no such folder"),
        (["board", "/tmp", "--port", "99999"], "99999: cannot listen there: a port is a number"),
        (["submit", "builtin", "--dry-run", "--store", "ftp://a/b"], "'ftp://a/b': not a store"),
        (["run", "builtin", "--out", "{out}", "--noise", "low"], "light.noise"),
        (["run", "builtin", "--out", "{out}", "--time-budget", "-1"], "light.time_budget_s"),
        (
            ["run", "builtin", "--out", "{out}", "--recipe", "paper", "--groups", "lamps"],
            "add --set light.integrator=path",
        ),
        (["run", "builtin", "--out", "/proc/nowhere"], "/proc/nowhere"),
        (["verify", "{out}"], "no such folder"),
        (["sheet", "{out}"], "{out}"),
        (["select", "{out}", "--reference", "x"], "no such folder"),
        (["relight", "{out}"], "no such file"),
        (["step", "paint", "builtin", "--out", "{out}"], "no such step"),
    ],
)
def test_wrong_arguments_are_reported(
    words: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "out")
    assert says.replace("{out}", out) in error_of(capsys, *(w.replace("{out}", out) for w in words))


@pytest.mark.quick(1)
@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("text.sh3d", b"no zip at all", "text.sh3d"),
        ("cut.sh3d", b"PK\x03\x04\x14\x00", "cut.sh3d"),
        ("bad.xml", b"<home version='7200'><wall", "bad.xml"),
        ("bomb.xml", b"<!DOCTYPE h [<!ENTITY a 'x'>]><home>&a;</home>", "bomb.xml"),
        ("empty.xml", b"<home version='7200' name='e'></home>", "empty.xml"),
        ("cut.glb", b"glTF\x02\x00\x00\x00", "cut.glb"),
    ],
)
def test_a_bad_home_is_named_and_the_next_one_is_processed(
    name: str, content: bytes, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    home = tmp_path / name
    home.write_bytes(content)
    error = error_of(capsys, "run", str(home), "--out", str(tmp_path / "out"))
    assert says in error


def test_a_home_without_home_xml_explains_how_to_save_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    home = zipped(tmp_path / "old.sh3d", Home="java", ContentDigests="")
    assert "5.3" in error_of(capsys, "run", str(home), "--out", str(tmp_path / "out"))


def test_every_verb_has_a_help_line() -> None:
    text = build_parser().format_help()
    for verb in ("doctor", "homes", "run", "demo", "sheet", "verify", "select", "relight"):
        assert verb in text


def test_layers_prints_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["layers"]) == 0
    printed = capsys.readouterr().out
    hidden = {f"mlt_il_ol.{n}" for n in range(2, MOST_VARIANTS)}  # between the first and the last
    assert all(f"`{layer.file}`" in printed for layer in LAYERS if layer.name not in hidden)


def test_no_verb_prints_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "usage" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["run x --out o", "demo", "objects x --out o", "submit x"])
def test_noise_time_budget_and_groups_are_short_forms_of_the_recipes_fields(verb: str) -> None:
    words = [*verb.split(), "--noise", "0.05", "--time-budget", "30", "--groups", "lamps"]
    light = recipe_of(build_parser().parse_args(words)).light
    assert (light.noise, light.time_budget_s, light.groups) == (0.05, 30.0, "lamps")
    assert recipe_of(build_parser().parse_args(verb.split())).light.groups == "two"


@pytest.mark.parametrize("option", ["--silence", "--memory"])
def test_a_limit_below_nothing_is_rejected_by_its_name(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "builtin", "--out", str(tmp_path), option, "-1"]) != 0
    assert f"{option}: -1.0: expected 0 or more" in capsys.readouterr().err


def test_a_process_over_the_requested_memory_is_killed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "builtin", "--out", str(tmp_path), "--memory", "1"]) == 1
    assert "MB resident, limit 1; killed" in "".join(capsys.readouterr())
