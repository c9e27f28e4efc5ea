"""A killed process of a verb costs one line, which names the file and the step."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from pbrs_farm.cli import MODULES
from pbrs_farm.core.recipe import Recipe
from pbrs_farm.crash_notes import note_step
from pbrs_farm.run.processes.verb_process import run_watched

TARGET = "tests.run.dying_verbs:main"
# Takes the place of the real library, and dies like it did on open meshes.
DYING_LIBRARY = """
import os, signal
class Manifold:
    def reserve_ids(n):
        return 0
def Mesh64(*arrays, **more):
    os.kill(os.getpid(), signal.SIGSEGV)
"""
READING = """
import sys
sys.path.insert(0, {folder!r})
sys.argv[1:] = {words!r}
from pbrs_farm.cli import main
sys.exit(main())
"""


def test_exit_code_and_output_are_the_verbs(capfd: pytest.CaptureFixture[str]) -> None:
    lines: list[str] = []
    assert run_watched(TARGET, ["end", "0"], lines.append) == 0
    assert run_watched(TARGET, ["end", "130"], lines.append) == 130
    assert lines == []
    assert capfd.readouterr().out == "done\ndone\n"


@pytest.mark.parametrize("name", ["SIGSEGV", "SIGABRT", "SIGFPE"])
def test_a_verb_that_is_killed_costs_a_line_with_file_and_step(name: str) -> None:
    lines: list[str] = []
    assert run_watched(TARGET, ["die", name, "a.glb", "read", "repair"], lines.append) == 1
    assert lines == [f"a.glb: repair: its process was killed by {name}"]


def test_a_verb_that_is_killed_before_any_file_is_named_by_its_words() -> None:
    lines: list[str] = []
    assert run_watched(TARGET, ["die", "SIGSEGV"], lines.append) == 1
    assert lines == ["die SIGSEGV: its process was killed by SIGSEGV"]


def test_no_file_is_left_behind_and_a_full_disk_costs_only_the_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    lines: list[str] = []
    words = ["die", "SIGSEGV", "a.glb", "read"]
    assert run_watched(TARGET, words, lines.append) == 1
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    assert run_watched(TARGET, words, lines.append) == 1
    assert run_watched(TARGET, ["end", "0"], lines.append) == 0
    fault = "its process was killed by SIGSEGV"
    assert lines == [f"a.glb: read: {fault}", f"die SIGSEGV: {fault}"]


def test_a_file_name_of_many_lines_is_printed_as_one_short_line() -> None:
    lines: list[str] = []
    words = ["die", "SIGSEGV", "a\nCLEAN\n" + "b" * 5000, "read"]
    assert run_watched(TARGET, words, lines.append) == 1
    (line,) = lines
    assert line.startswith("a?CLEAN?bbb")
    assert "\n" not in line
    assert len(line) < 400


def test_nothing_is_printed_without_a_terminal() -> None:
    note_step("a.glb", "read")


def test_ctrl_c_keeps_its_handler_afterwards() -> None:
    before = signal.getsignal(signal.SIGINT)
    run_watched(TARGET, ["end", "0"], print)
    assert signal.getsignal(signal.SIGINT) is before


_COMMAND = """
import sys
from pbrs_farm import cli
from pbrs_farm.run.processes import verb_process
watched = verb_process.run_watched
words = ["tests.run.dying_verbs:main", ["end", "0"]]
verb_process.run_watched = lambda _target, _words, warn: watched(*words, warn)
sys.argv = ["pbrs-farm", "run"]
code = cli.main()
sys.stderr.write("ended\\n")
sys.exit(code)
"""


@pytest.mark.skipif(os.name != "posix", reason="the shell's >&-")
def test_a_command_may_be_started_without_standard_streams() -> None:
    command = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", sys.executable, "-c", _COMMAND]
    assert subprocess.run(command, check=False).returncode == 0


@pytest.mark.quick(1)
@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("repair builtin", "builtin: repair: "),
        ("cameras builtin", "builtin: repair: "),
        ("step house builtin", "builtin: repair: "),
        ("run builtin", " house: FAILED: "),  # the pool's line: its render process died
        ("demo --bare --home builtin", " house: FAILED: "),
    ],
)
def test_no_library_takes_a_verb_that_reads_files_with_it(
    tmp_path: Path, words: str, line: str
) -> None:
    library, out = tmp_path / "libraries", tmp_path / "out"
    library.mkdir()
    (library / "manifold3d.py").write_text(DYING_LIBRARY)
    out.mkdir()
    if words.startswith("step"):
        (out / "recipe.json").write_text(Recipe().model_dump_json())
    arguments = words.split() + (["--out", str(out)] if "cameras" not in words else [])
    done = subprocess.run(
        [sys.executable, "-c", READING.format(folder=str(library), words=arguments)],
        capture_output=True, text=True, check=False, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    lines = [x for x in done.stderr.splitlines() if "killed by SIGSEGV" in x]
    assert len(lines) == 1
    assert line in lines[0]


def test_the_table_of_watched_modules_names_modules() -> None:
    from pbrs_farm.cli import OF_STRANGERS

    assert set(OF_STRANGERS) < set(MODULES)
