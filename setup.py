"""Builds the wheel: the folder `workers` is installed as `pbrs_farm_workers`, and its imports with it.

A checkout keeps the folder's own name (an editable install maps nothing). Everything else stands in
pyproject.toml.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from setuptools import find_namespace_packages, setup
from setuptools.command.build_py import build_py

FOLDER, INSTALLED = "workers", "pbrs_farm_workers"
HERE = Path(__file__).parent


def renamed(source: str, modules: list[str]) -> str:
    """Python source in which the folder's modules are called by their installed name.

    Both imports and dotted names in strings ("workers.queue.celery_app") name modules.
    """
    names = "|".join(sorted(modules))
    source = re.sub(rf"(?<![\w./\"'-]){FOLDER}\.(?=(?:{names})\b)", f"{INSTALLED}.", source)
    source = re.sub(rf"(?<=[\"']){FOLDER}\.(?=(?:{names})\b)", f"{INSTALLED}.", source)
    return re.sub(rf"\bfrom {FOLDER} import\b", f"from {INSTALLED} import", source)


class BuildPy(build_py):
    """Copies the packages, then renames what they import."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        modules = [p.stem for p in (HERE / FOLDER).iterdir() if p.suffix in ("", ".py")]
        modules = [name for name in modules if not name.startswith("__")]
        for path in Path(self.build_lib).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            path.write_text(renamed(text, modules), encoding="utf-8")


packages = find_namespace_packages(str(HERE), include=["pbrs_farm*", f"{FOLDER}*"])
package_dir = {}
if "editable_wheel" not in sys.argv:
    folders = [name for name in packages if name.split(".")[0] == FOLDER]
    package_dir = {INSTALLED + f.removeprefix(FOLDER): f.replace(".", "/") for f in folders}
    packages = [*sorted(set(packages) - set(folders)), *package_dir]

if __name__ == "__main__":
    setup(packages=packages, package_dir=package_dir, cmdclass={"build_py": BuildPy})
