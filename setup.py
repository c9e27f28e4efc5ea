"""Builds sdist and wheel: equal trees give equal bytes, and each says what an installation needs.

The folder `workers` is installed as `pbrs_farm_workers`, and its imports with it; a checkout keeps the
folder's own name (an editable install maps nothing). Both archives have one date: SOURCE_DATE_EPOCH,
else 1980. All other settings are in pyproject.toml.
"""

from __future__ import annotations

import gzip
import os
import re
import sys
import tarfile
from pathlib import Path

from setuptools import find_namespace_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

FOLDER, INSTALLED = "workers", "pbrs_farm_workers"
HERE = Path(__file__).parent
_FIRST_OF_ZIP = "315532800"  # 1980-01-01: the first time that a wheel, which is a zip, can carry


def renamed(source: str, modules: list[str]) -> str:
    """Python source in which the folder's modules are called by their installed name.

    Both imports and dotted names in strings ("workers.queue.celery_app") name modules.
    """
    names = "|".join(sorted(modules))
    source = re.sub(rf"(?<![\w./\"'-]){FOLDER}\.(?=(?:{names})\b)", f"{INSTALLED}.", source)
    source = re.sub(rf"(?<=[\"']){FOLDER}\.(?=(?:{names})\b)", f"{INSTALLED}.", source)
    return re.sub(rf"\bfrom {FOLDER} import\b", f"from {INSTALLED} import", source)


class BuildPy(build_py):
    """Copies the packages, renames what they import, and adds the pages that `pbrs-farm help` shows."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        modules = [p.stem for p in (HERE / FOLDER).iterdir() if p.suffix in ("", ".py")]
        modules = [name for name in modules if not name.startswith("__")]
        for path in Path(self.build_lib).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            path.write_text(renamed(text, modules), encoding="utf-8")
        for page in (HERE / "docs").rglob("*.md"):
            target = Path(self.build_lib, "pbrs_farm/pages", page.relative_to(HERE / "docs"))
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(page.read_bytes())
        unmask(Path(self.build_lib))


def unmask(folder: Path) -> None:
    """Give all files of a folder the same permissions, so that a machine's umask does not change the archive."""
    for path in folder.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)


class Wheel(bdist_wheel):
    """Packs the wheel; its own description has no mask either."""

    def write_wheelfile(self, wheelfile_base: str, *words: object, **named: object) -> None:
        super().write_wheelfile(wheelfile_base, *words, **named)
        unmask(Path(wheelfile_base))


class SameBytes(sdist):
    """Packs the source: files by name, one time, nobody's owner, so that a second build is the first."""

    def make_archive(self, base_name, format, root_dir=None, base_dir=None, owner=None, group=None):  # type: ignore[no-untyped-def]
        """Write base_name.tar.gz of base_dir; its path."""
        folder, target = Path(base_dir), Path(f"{base_name}.tar.gz")
        time = int(os.environ["SOURCE_DATE_EPOCH"])
        with (
            target.open("wb") as file,
            gzip.GzipFile("", "wb", 9, file, mtime=time) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar,
        ):
            for path in sorted(p for p in folder.rglob("*") if p.is_file()):
                entry = tar.gettarinfo(path, arcname=path.relative_to(folder.parent).as_posix())
                entry.mtime, entry.mode = time, 0o755 if path.stat().st_mode & 0o100 else 0o644
                entry.uid = entry.gid = 0
                entry.uname = entry.gname = ""
                entry.type, entry.linkname = tarfile.REGTYPE, ""
                entry.size = path.stat().st_size
                with path.open("rb") as data:
                    tar.addfile(entry, data)
        return str(target)


packages = find_namespace_packages(str(HERE), include=["pbrs_farm*", f"{FOLDER}*"])
package_dir = {}
if "editable_wheel" not in sys.argv:
    folders = [name for name in packages if name.split(".")[0] == FOLDER]
    package_dir = {INSTALLED + f.removeprefix(FOLDER): f.replace(".", "/") for f in folders}
    packages = [*sorted(set(packages) - set(folders)), *package_dir]

if __name__ == "__main__":
    os.environ.setdefault("SOURCE_DATE_EPOCH", _FIRST_OF_ZIP)
    setup(
        packages=packages,
        package_dir=package_dir,
        cmdclass={"bdist_wheel": Wheel, "build_py": BuildPy, "sdist": SameBytes},
    )
