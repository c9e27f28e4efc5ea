"""The command line: suggestions for misspelt names, free order of options, a grouped help, completion."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from pbrs_farm.cli import MODULES, build_parser, main
from pbrs_farm.commands.arguments import recipe_of
from pbrs_farm.commands.command_line import VERBS, verb_first
from pbrs_farm.commands.completion_scripts import SHELLS, completion_script
from pbrs_farm.core.recipe import RECIPE_NAMES, recipe_from_name
from pbrs_farm.formats.recipe_toml import recipe_from_toml, toml_from_recipe

EVERY_VERB = [verb for verbs in MODULES.values() for verb in verbs]


def refusal(capsys: pytest.CaptureFixture[str], *words: str, code: int) -> str:
    """Standard error of a command that ends with the code."""
    try:
        ended: object = main(list(words))
    except SystemExit as ending:
        ended = ending.code
    assert ended == code
    error = capsys.readouterr().err
    assert "Traceback" not in error
    return error


# A command line, its message, the exit code.
WRONG: list[tuple[list[str], str, int]] = [
    (words.split(), says, code)
    for words, says, code in (
        ("run", "no home given", 1),
        ("run nowhere.sh3d --out o", "nowhere.sh3d: no such file", 1),
        ("run builtin --out", "expected one argument", 2),
        ("run builtin --out file.txt", "file.txt: is not a folder", 1),
        ("run builtin --out s3://", "not a store", 1),
        ("run builtin --out o --recipe file.txt", "file.txt", 1),
        ("run builtin --out o --size 64", "--size: 64: expected a width and a height", 1),
        ("run builtin --out o --size 999999x999999", "1 to 16384 pixels", 1),
        ("run builtin --out o --jobs 0", "--jobs: 0: expected 1 or more", 1),
        ("run builtin --out o --views many", "--views: invalid int value: 'many'", 2),
        ("run builtin --out o --set light.spp", "expected group.field=value", 1),
        ("run builtin --out o --set light.spp=abc", "light.spp: expected a whole number", 1),
        ("run builtin --out o --fps 10", "--fps: is for walks only", 1),
        ("run builtin --out o --trajectory nofile", "nofile: no such file", 1),
        ("run builtin --out o --memory -1", "--memory: -1.0: expected 0 or more", 1),
        ("run made:3..1 --out o", "runs downwards", 1),
        ("run made:1,rooms=99 --out o", "99: is above 4", 1),
        ("dress builtin --out file.txt", "file.txt: is not a folder", 1),
        ("homes make 2 --out file.txt", "file.txt: is not a folder", 1),
        ("homes make 0 --out o", "0: expected 1 home or more", 1),
        ("export empty --to coco --out o", "it has no houses", 1),
        ("export nowhere --to coco --out o", "nowhere: no such folder", 1),
        ("export empty --to coco --out o --split 3/2", "--split: 3/2: expected train/val/test", 1),
        ("pack empty --out o", "no finished view", 1),
        ("make indoor-1k --out o --shard 5/4", "--shard: 5/4: expected K/N", 1),
        ("make indoor-1k --out file.txt", "file.txt: is not a folder", 1),
        ("make nope --out o", "nope: no such set", 1),
        ("estimate indoor-1k --cloud Mars", "Mars: no prices of this cloud", 1),
        ("verify empty", "empty: no houses here", 1),
        ("board nowhere", "nowhere: no such folder", 1),
        ("board empty --port 80x", "--port: invalid int value", 2),
        ("relight empty --indoor 2", "view.json: no such file", 1),
        ("sheet empty", "it has no houses", 1),
        ("scatter builtin --models empty --out o --count 0", "--count: 0: expected 1 or more", 1),
        ("scatter builtin --models nowhere --out o", "nowhere: no model found", 1),
        ("homes nope", "invalid choice: 'nope'", 2),
        ("help nopage", "no page has 'nopage'", 1),
        ("cache --clear nope", "no entry 'nope'", 1),
        ("evaluate", "give either a RUN or --task", 1),
        ("gc --store nowhere --keep 3x", "--keep: 3x: not a time", 1),
        ("films", "no command 'films'", 2),
    )
]


@pytest.mark.parametrize(
    ("words", "says", "code"),
    [
        (["rnu"], "no command 'rnu', did you mean run?", 2),
        (["zzzzz"], "no command 'zzzzz' (pbrs-farm --help lists them)", 2),
        (["layers", "--jsn"], "no such option --jsn", 2),
        (["doctor", "--jsn"], "no such option --jsn, did you mean --json?", 2),
        (["recipes", "fast", "paper"], "unexpected word 'paper'", 2),
        (
            ["train", "normals", "homes", "--out", "run", "--set", "steps=4", "rate=1e-4"],
            "`--set rate=1e-4`",
            2,
        ),
        (["cameras", "Studoi"], "did you mean Studio?", 1),
        (["cameras", "builtn"], "did you mean builtin?", 1),
        (["cameras", "builtin", "--recipe", "papr"], "did you mean paper?", 1),
        (["cameras", "builtin", "--set", "light.sp=4"], "did you mean light.spp?", 1),
        (["run", "builtin", "--out", "x", "--modes", "mltol"], "did you mean mlt_ol?", 1),
        (["step", "develp", "builtin", "--out", "x"], "did you mean develop?", 1),
        (["verify", "nowhere"], "nowhere: no such folder (give the output folder of a run)", 1),
        (["relight", "nowhere"], "no such file (OUT/houses/HOUSE/views/VIEW)", 1),
        (["dress", "builtin", "--out", "x", "--seed", "red"], "--seed: red: expected", 1),
        *WRONG,
    ],
)
def test_a_misspelling_is_answered_with_suggestions(
    words: list[str],
    says: str,
    code: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "file.txt").write_text("x")
    error = refusal(capsys, *words, code=code)
    assert says in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("verb", ["run builtin --out x", "demo", "submit x"])
def test_no_views_at_all_are_refused(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    error = refusal(capsys, *verb.split(), "--views", "0", code=1)
    assert "--views: 0: expected 1 or more" in error


def ordered(words: str) -> str:
    def parser_of(verb: str):
        return build_parser().verbs()[verb]

    return " ".join(verb_first(words.split(), EVERY_VERB, parser_of))


@pytest.mark.parametrize(
    ("words", "means"),
    [
        ("--debug run A --out o", "run --debug A --out o"),
        ("--recipe preview --out o run A", "run --recipe preview --out o A"),
        ("--out run run A", "run --out run A"),  # a folder with a verb's name
        ("--out=run run A", "run --out=run A"),
        ("--modes opengl_dl opengl_il run A --out o", "run --modes opengl_dl opengl_il A --out o"),
        ("--help run", "run --help"),
        ("run A --out o", "run A --out o"),
        ("--version", "--version"),
        ("--no-such run A", "--no-such run A"),
        ("-", "-"),
        ("", ""),
    ],
)
def test_options_are_valid_before_or_after_the_verb(words: str, means: str) -> None:
    assert ordered(words) == means


def test_an_option_before_the_verb_works_as_behind_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--json", "homes"]) == 0
    before = capsys.readouterr().out
    assert main(["homes", "--json"]) == 0
    assert capsys.readouterr().out == before


def test_the_help_lists_each_verb_once_in_its_group() -> None:
    text = build_parser().format_help()
    for title in {row.group for row in VERBS.values()}:
        assert f"\n{title}:" in text
    for verb in EVERY_VERB:
        assert len(re.findall(rf"^  {verb}\b", text, re.MULTILINE)) == 1, verb


def test_a_recipe_file_changes_only_its_fields(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('recipe = "preview"\nseed = 3\n\n[light]\nspp = 8\n')
    words = ["cameras", "x", "--recipe", str(file), "--set", "image.width_px=64"]
    recipe = recipe_of(build_parser().parse_args(words))
    expected = recipe_from_name("preview", {"seed": "3", "light.spp": "8", "image.width_px": "64"})
    assert recipe.digest() == expected.digest()
    assert recipe.name == "mine"


@pytest.mark.parametrize("name", RECIPE_NAMES)
def test_a_recipe_written_as_a_file_is_read_as_itself(name: str, tmp_path: Path) -> None:
    file = tmp_path / "r.toml"
    file.write_text(toml_from_recipe(recipe_from_name(name)))
    assert recipe_from_toml(file, {}).digest() == recipe_from_name(name).digest()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no such file"),
        ("[light", "is not valid TOML"),
        ("\xff\xff", "is not UTF-8 text"),
        (f"[light]\nspp = {'9' * 5000}", "is not valid TOML"),
        ('recipe = "fst"', "did you mean fast?"),
        ("recipe = 3", "no recipe 3"),
        ("[light]\nsp = 3", "light.sp: no such field, did you mean light.spp"),
        ("light = 3", "light:"),
        ("[light]\nspp = 2020-01-01", "light.spp"),
    ],
)
def test_a_bad_recipe_file_is_named_with_its_place(
    text: str | None, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bad.toml"
    if text is not None:
        file.write_bytes(text.encode("latin-1"))
    error = refusal(capsys, "cameras", "builtin", "--recipe", str(file), code=1)
    assert f"{file}: " in error
    assert says in error


def completed(words: Sequence[str]) -> set[str]:
    """Completions that bash offers for the last word."""
    script = completion_script("bash", build_parser().verbs())
    array = " ".join(f"'{word}'" for word in words)
    ask = f"{script}\nCOMP_WORDS=({array}); COMP_CWORD={len(words) - 1}; _pbrs_farm"
    ask += '\nprintf "%s\\n" "${COMPREPLY[@]}"'
    done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True)
    assert not done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize(
    ("words", "offers"),
    [
        ("pbrs-farm re", {"relight", "repair", "recipes", "reference"}),
        ("pbrs-farm run Stu", {"Studio"}),
        ("pbrs-farm run --recipe p", {"preview", "paper"}),
        ("pbrs-farm run x --modes opengl_d", {"opengl_dl"}),
        ("pbrs-farm export x --to c", {"coco"}),
        ("pbrs-farm --debug verify --al", {"--all"}),
    ],
)
def test_bash_completes_verbs_options_and_their_choices(words: str, offers: set[str]) -> None:
    completions = completed(words.split())
    assert offers <= completions
    assert all(word.startswith(words.split()[-1]) for word in completions)


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_gets_a_script_of_every_verb(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(verb in script for verb in EVERY_VERB)
    program = shutil.which(shell)
    if program:
        subprocess.run([program, "-n"], input=script, text=True, check=True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--trajectory", "rows.txt"], "rows.txt: line 2: x is not finite"),
        (["--trajectory", "none.txt"], "none.txt: no such file"),
        (["--camera-file", "rows.txt"], "rows.txt"),
        (
            ["--set", "lens.preset=fisheye180", "--size", "64x64", "--layers", "disparity"],
            "--layers: disparity: needs rows that correspond",
        ),
        (["--doors", "ajar"], "--doors"),
    ],
)
def test_an_impossible_request_is_refused_before_anything_is_stored(
    options: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rows.txt").write_text("0 1 1.5 1 0 0 0 1\n0.1 nan 1.5 1 0 0 0 1\n")
    code = 2 if "--doors" in options else 1
    assert words in refusal(capsys, "run", "builtin", "--out", "out", *options, code=code)
    assert not Path("out").exists()
