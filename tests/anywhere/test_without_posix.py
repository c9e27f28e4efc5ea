"""The package without POSIX: names that differ between systems are only in operating_system.py."""

from __future__ import annotations

import errno
import os
import subprocess
import time
from pathlib import Path

import pytest

from pbrs_farm import operating_system
from pbrs_farm.operating_system import ending, has_crashed, has_drive, is_running, open_unwaiting
from pbrs_farm.store import store_from_url
from pbrs_farm.store.folder import FolderStore
from tests.anywhere.without_posix import pbrs_farm, python_without_posix

_ORPHAN = """
import os
from pathlib import Path
from pbrs_farm.run.processes.child_process import ChildProcess
child = ChildProcess("tests.run.test_render_process:make_handler", Path("log"))
while child.receive(60.0) is None:
    pass
print(child.process.pid, flush=True)
os._exit(0)
"""
_WATCHED = """
from pbrs_farm.run.processes.verb_process import run_watched
run_watched("tests.run.dying_verbs:main", ["die", "SIGSEGV", "a.glb", "read", "repair"], print)
"""
_NAMES = (
    "import pbrs_farm.operating_system as s; print(s._POSIX, hasattr(s.os, 'fork'), s._has_proc())"
)


def _message(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_our_modules_lack_the_names() -> None:
    assert _message(python_without_posix(["-c", _NAMES])) == "False False False\n"


def test_psutil_reports_memory_without_proc() -> None:
    code = "from pbrs_farm.operating_system import *; print(resident_mb(1), tree_mb(1), give_back_memory())"
    assert _message(python_without_posix(["-c", code], "proc")) == "100.0 100.0 None\n"


def test_no_process_starts_if_its_log_could_not_be_moved() -> None:
    code = (
        "from pbrs_farm import cli; from pbrs_farm.run.processes import early_start, limits; "
        "limits.is_room_for_two = lambda: True; cli._start_early(['demo']); print(early_start.STARTED)"
    )
    assert _message(python_without_posix(["-c", code])) == "{}\n"


def test_the_help_is_printed() -> None:
    assert "pbrs-farm COMMAND --help" in _message(pbrs_farm("--help"))


def test_a_run_makes_its_view_and_resumes(tmp_path: Path) -> None:
    words = ["run", "builtin", "--views", "1", "--jobs", "1", "--recipe", "preview"]
    words += ["--modes", "opengl_dl", "--out"]
    first, again = (_message(pbrs_farm(*words, tmp_path / "out")) for _run in range(2))
    assert ", 0 already there, 0 failed" in first
    assert ": 0 steps done," in again
    assert list((tmp_path / "out").rglob("depth.png"))


@pytest.mark.parametrize("lacks", ["posix", "proc"])
def test_a_render_process_ends_after_its_parent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lacks: str
) -> None:
    monkeypatch.chdir(tmp_path)
    pid = int(_message(python_without_posix(["-c", _ORPHAN], lacks)))
    until = time.monotonic() + 60.0
    while is_running(pid) and time.monotonic() < until:
        time.sleep(0.1)
    assert not is_running(pid)


def test_a_verb_that_is_killed_costs_a_line_with_file_and_step() -> None:
    lines = _message(python_without_posix(["-c", _WATCHED]))
    assert lines == "a.glb: repair: its process was killed by SIGSEGV\n"


def test_a_pipe_without_a_writer_is_no_file_even_if_opening_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").write_bytes(b"\r\n\x1a")
    monkeypatch.delattr(os, "O_NONBLOCK")
    with pytest.raises(OSError, match="is not a regular file") as caught:
        open_unwaiting(tmp_path / "pipe")
    assert caught.value.errno == errno.EINVAL
    with os.fdopen(open_unwaiting(tmp_path / "file"), "rb") as file:
        assert file.read() == b"\r\n\x1a"


def test_faults_that_windows_numbers_are_crashes() -> None:
    assert has_crashed(0xC0000005)
    assert ending(0xC0000005) == "its process died of fault 0xC0000005"
    assert not has_crashed(130)


def test_a_drive_is_no_scheme() -> None:
    store = store_from_url("C:\\homes\\out")
    assert isinstance(store, FolderStore)
    assert store.root.name.endswith("C:\\homes\\out")
    assert not any(map(has_drive, ("s3://bucket/x", "file:///x", "/x", "out/x", "memory:")))


def test_no_other_module_names_posix_functions() -> None:
    names = (
        "import resource", "import fcntl", "killpg", "os.fork", "register_at_fork", "os.sysconf", "O_NONBLOCK",
        "O_CLOEXEC", "O_DIRECTORY", "memfd_create", "pass_fds", "start_new_session", "select.select", "SIGKILL", "/proc/",
    )  # fmt: skip
    package = Path(operating_system.__file__).parent
    for file in package.rglob("*.py"):
        if file.name != "operating_system.py":
            text = file.read_text("utf-8")
            assert not [name for name in names if name in text], file
