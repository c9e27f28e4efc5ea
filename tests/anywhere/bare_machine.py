"""Simulates a student's machine: no root, no system LLVM, OpenGL, libatomic or apt, one writable folder.

Effects: a command runs in a new mount namespace (unshare, of util-linux), where those files are hidden and
everything outside the folder is read-only. Making it needs root or user namespaces; the command has neither.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

REPO: Final = Path(__file__).parents[2]
HIDDEN: Final = (
    "/usr/lib/*/libLLVM*.so*", "/usr/lib/llvm-*/lib/libLLVM*.so*", "/usr/lib/*/libatomic.so*", "/usr/lib/*/libGL.so*",
    "/usr/lib/*/libEGL.so*", "/usr/lib/*/libOpenGL.so*", "/usr/lib/*/libGLX.so*", "/usr/lib/*/libOSMesa*",
    "/usr/bin/apt*", "/usr/bin/sudo", "/usr/bin/redis-server",
)  # fmt: skip
"""Files that a bare machine lacks."""

# $1: the writable folder; then the files to hide, --, and the command.
_ENTER: Final = """
set -e
mount --make-rprivate /
for kept in "$1" /dev /proc; do mount --rbind "$kept" "$kept"; done
cd "$1"
shift
while [ "$1" != -- ]; do mount --bind /dev/null "$1"; shift; done
shift
mount -o remount,bind,ro /
exec setpriv --bounding-set=-all --inh-caps=-all --no-new-privs "$@"
"""
_RUN_NOTEBOOK: Final = """
import sys
import nbformat
from nbclient import NotebookClient

book = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(book, timeout=600, kernel_name="python3", allow_errors=True).execute()
for cell in book.cells:
    for output in cell.get("outputs", ()):
        if output["output_type"] == "error":
            print("error:", output["ename"], output["evalue"][:300].replace(chr(10), " "))
        for kind in output.get("data", ()):
            print(kind)
"""
_KEPT: Final = ("PIP_", "SSL_", "REQUESTS_", "LANG", "HTTPS_PROXY", "HTTP_PROXY", "NO_PROXY")


@dataclass(frozen=True, slots=True)
class BareMachine:
    """A working folder for commands of a bare machine, with home, caches and environments below it."""

    folder: Path

    def run(
        self, words: Sequence[str | Path], variables: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run a command in the folder; its output is captured as text, and printed if it fails."""
        home = self.folder / "home"
        home.mkdir(exist_ok=True)
        environment = {k: v for k, v in os.environ.items() if k.upper().startswith(_KEPT)}
        environment |= {
            "HOME": str(home), "TMPDIR": str(home), "PATH": "/usr/local/bin:/usr/bin:/bin",
            "PIP_DISABLE_PIP_VERSION_CHECK": "1", **(variables or {}),
        }  # fmt: skip
        hidden = [str(p) for pattern in HIDDEN for p in Path("/").glob(pattern[1:]) if p.is_file()]
        hidden = sorted({str(Path(name).resolve()) for name in hidden})
        enter = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
        command = [
            *enter,
            "bash",
            "-c",
            _ENTER,
            "bare",
            str(self.folder),
            *hidden,
            "--",
            *map(str, words),
        ]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.stderr.write(done.stdout[-2000:] + done.stderr[-2000:])
        return done

    def environment(self, name: str) -> Path:
        """The Python of a new, empty virtual environment, of the running version."""
        base = Path(sys.base_prefix) / "bin" / f"python{sys.version_info[0]}.{sys.version_info[1]}"
        self.run([base, "-m", "venv", name]).check_returncode()
        return self.folder / name / "bin" / "python"

    def notebook(self, python: Path, book: Path, variables: Mapping[str, str]) -> list[str]:
        """Outputs of a notebook's cells in a fresh kernel of that Python: types of data, or "error: ...".

        python: one with nbclient and ipykernel.
        """
        shutil.copy2(book, self.folder)
        script = self.folder / "run_notebook.py"
        script.write_text(_RUN_NOTEBOOK)
        done = self.run([python, script, book.name], variables)
        return done.stdout.split("\n")[:-1] or [f"error: {done.stderr[-500:]}"]

    def seed_cache(self) -> dict[str, str]:
        """Environment variables with which a command finds this machine's fetched packages."""
        from pbrs_farm.assets.debian import cache_folder

        cache = self.folder / "cache"
        cache.mkdir(exist_ok=True)
        for name in ("*.deb*", "sweethome3d-*.jar", "sweethome3d-*/*", "skies/*"):
            for path in cache_folder().glob(name):
                target = cache / path.relative_to(cache_folder())
                target.parent.mkdir(exist_ok=True)
                if not target.exists():
                    shutil.copy2(path, target)
        return {"PBRS_CACHE": str(cache)}


def can_be_made() -> bool:
    """True on Linux with unshare, setpriv and the right to use them."""
    if not all(map(shutil.which, ("unshare", "setpriv", "bash"))):
        return False
    enter = ["unshare", "--mount", *([] if os.geteuid() == 0 else ["--map-root-user"])]
    return subprocess.run([*enter, "true"], capture_output=True, check=False).returncode == 0


def built_wheel(folder: Path) -> Path:
    """The wheel of this checkout, built from its tracked and untracked files."""
    source = folder / "source"
    listed = ["git", "-C", str(REPO), "ls-files", "-co", "--exclude-standard", "-z"]
    names = subprocess.run(listed, check=True, capture_output=True, text=True).stdout.split("\0")
    for name in filter(None, names):
        if (REPO / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPO / name, source / name)
    words = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w"]
    variables = {**os.environ, "SETUPTOOLS_SCM_PRETEND_VERSION": "0.1.0.dev1"}
    variables.pop("PYTHONPATH", None)
    done = [*words, str(folder / "dist"), "."]
    subprocess.run(done, check=True, cwd=source, env=variables, capture_output=True)
    return next((folder / "dist").glob("pbrs_farm-*.whl"))
