"""From an empty environment to labelled pictures by pip alone, as on a university machine (tests/anywhere/bare_machine.py).

Effects: builds the wheel, asks the package index, renders, and writes out/bench/anywhere.json.
`python -m benchmarks.anywhere PART` measures one part again and keeps the figures of the others.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from benchmarks import startup
from benchmarks.figures import FOLDER, write_report
from tests.anywhere.bare_machine import REPO, BareMachine, built_wheel, can_be_made
from tests.anywhere.without_posix import pbrs_farm

UNITS: Final = startup.UNITS | {
    "anywhere.pip_only": "1: the wheel with the extra llvm renders the demo, verifies it and runs a notebook on a bare machine",
    "anywhere.demo": "1: its demo, a dressed home of six views, ends with 0, and a sheet",
    "anywhere.verify": "1: its certificate is clean",
    "anywhere.notebook": "1: docs/notebooks/first_picture.ipynb, its pip cell among it, runs to its end there",
    "anywhere.llvm": "version of LLVM that rendered there",
    "anywhere.first_picture_s": "s from an empty environment to the first picture there: pip with a warm cache, then one view",
    "anywhere.first_picture_cpu_s": "CPU s of that",
    "anywhere.install_s": "s of that for pip",
    "anywhere.installed_mb": "MB of that environment",
    "anywhere.posix_free": "1: import, help, demo, a run and its resumption end well where our modules lack POSIX, a view with the same bytes",
}
NOTEBOOK: Final = REPO / "docs/notebooks/first_picture.ipynb"


class Bare:
    """A bare machine with the wheel, and an environment with the installed wheel."""

    def __init__(self, folder: Path) -> None:
        self.machine = BareMachine(folder)
        self.wheel = built_wheel(folder)
        self.installed_s = self.installed_cpu_s = 0.0

    @cached_property
    def variables(self) -> dict[str, str]:
        """Environment variables for the download cache and for pip, which must find the wheel by the package's name."""
        return self.machine.seed_cache() | {
            "PIP_FIND_LINKS": str(self.wheel.parent), "PIP_CACHE_DIR": str(self.machine.folder / "pip"),
        }  # fmt: skip

    @cached_property
    def python(self) -> Path:
        """Its Python, after two installations: one to fill pip's cache, one timed."""
        install = ["-m", "pip", "install", "--quiet", f"{self.wheel}[llvm]"]
        first_environment = self.machine.environment("apart")
        self.machine.run([first_environment, *install], self.variables).check_returncode()
        shutil.rmtree(first_environment.parents[1])
        began, before = time.monotonic(), startup.cpu_s()
        python = self.machine.environment("env")
        self.machine.run([python, *install], self.variables).check_returncode()
        self.installed_s = time.monotonic() - began
        self.installed_cpu_s = startup.cpu_s() - before
        return python

    def program(self, *words: str) -> bool:
        """Whether a command of pbrs-farm ends with 0."""
        command = [self.python.parent / "pbrs-farm", *words]
        return self.machine.run(command, self.variables).returncode == 0


def pip_only(bare: Bare) -> dict[str, Any]:
    """Demo, certificate and notebook without root, LLVM, OpenGL, libatomic or apt of the system."""
    folder = bare.machine.folder
    demo = bare.program("demo", "--out", "demo") and (folder / "demo/sheet.png").is_file()
    verify = demo and bare.program("verify", "demo")
    markers = folder.glob("demo/houses/*/done/light.*.json")
    compiled = {json.loads(p.read_text())["facts"].get("llvm", "") for p in markers}
    packages = ["-m", "pip", "install", "--quiet", "nbclient", "ipykernel"]
    bare.machine.run([bare.python, *packages], bare.variables).check_returncode()
    shown = bare.machine.notebook(bare.python, NOTEBOOK, bare.variables)
    notebook = "image/png" in shown and not [line for line in shown if line.startswith("error")]
    return {
        "anywhere.pip_only": int(demo and verify and notebook),
        "anywhere.demo": int(demo),
        "anywhere.verify": int(verify),
        "anywhere.notebook": int(notebook),
        "anywhere.llvm": ", ".join(sorted(compiled)),
    }


def first_picture(bare: Bare) -> dict[str, Any]:
    """Environment, then one view of the built-in home with an empty kernel cache."""
    python = bare.python
    files = [p for p in python.parents[1].rglob("*") if p.is_file() and not p.is_symlink()]
    n_bytes = sum(p.stat().st_size for p in files)
    began, before = time.monotonic(), startup.cpu_s()
    is_made = bare.program("demo", "--home", "builtin", "--bare", "--views", "1", "--out", "first")
    seconds = time.monotonic() - began + bare.installed_s
    cpu_s = startup.cpu_s() - before + bare.installed_cpu_s
    return {
        "anywhere.first_picture_s": round(seconds, 1) if is_made else -1.0,
        "anywhere.first_picture_cpu_s": round(cpu_s, 1),
        "anywhere.install_s": round(bare.installed_s, 1),
        "anywhere.installed_mb": round(n_bytes / 1e6),
    }


def posix_free(bare: Bare) -> dict[str, Any]:
    """Runs without POSIX-only names (tests/anywhere) give the same files as runs with them."""
    folder = bare.machine.folder
    words = ["run", "builtin", "--recipe", "preview", "--views", "1", "--out"]
    with_posix = [sys.executable, "-m", "pbrs_farm.cli", *words, str(folder / "with")]
    subprocess.run(with_posix, check=True, capture_output=True)
    demo = ["demo", "--home", "builtin", "--bare", "--views", "1", "--out", folder / "shown"]
    commands = [["--help"], demo, *[[*words, folder / "without"]] * 2]
    done = [pbrs_farm(*command) for command in commands]
    is_well = not any(d.returncode for d in done) and ": 0 steps done," in done[-1].stdout
    files = [_files_of_views(folder / name) for name in ("with", "without")]
    return {"anywhere.posix_free": int(is_well and bool(files[0]) and files[0] == files[1])}


def _files_of_views(root: Path) -> dict[str, bytes]:
    """Bytes by path of the files of every view below a root."""
    files = [p for p in root.glob("houses/*/views/**/*") if p.is_file()]
    return {str(p.relative_to(root)): p.read_bytes() for p in files}


def first_minute(_bare: Bare) -> dict[str, Any]:
    """The figures of startup.py, for this checkout."""
    return startup.startup_figures([sys.executable])


# first_picture is first because its kernels must not be compiled yet.
PARTS: Final[dict[str, Callable[[Bare], dict[str, Any]]]] = {
    "first_picture": first_picture, "pip_only": pip_only, "startup": first_minute,
    "posix_free": posix_free,
}  # fmt: skip
"""Name -> part; each returns figures of UNITS."""


def main(names: Sequence[str] = ()) -> None:
    """Measure the named parts, or all, and write out/bench/anywhere.json; other parts keep their figures."""
    if not can_be_made():
        raise SystemExit(
            "anywhere: a bare machine needs Linux, unshare and setpriv, and root or user namespaces"
        )
    former = FOLDER / "anywhere.json"
    figures = json.loads(former.read_text())["figures"] if names and former.is_file() else {}
    with tempfile.TemporaryDirectory(prefix="pbrs-farm-") as name:
        bare = Bare(Path(name))
        for part in names or PARTS:
            figures |= PARTS[part](bare)
    write_report("anywhere", figures, UNITS)


if __name__ == "__main__":
    main(sys.argv[1:])
