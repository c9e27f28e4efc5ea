"""Dependencies that have wheels, by system, according to the package index: a table for docs/install.md.

Effects: queries the package index with pip, downloads nothing; writes the table into the page, if one is named.

python scripts/wheel_table.py docs/install.md
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement

REPO: Final = Path(__file__).parents[1]
PYTHON: Final = "3.12"
SYSTEMS: Final = {
    "Linux, x86-64": [f"manylinux_2_{n}_x86_64" for n in (36, 35, 34, 31, 28, 27, 26, 24, 17, 12, 5)] + ["manylinux2014_x86_64"],
    "Linux, ARM64": [f"manylinux_2_{n}_aarch64" for n in (36, 35, 34, 31, 28, 27, 26, 24, 17)] + ["manylinux2014_aarch64"],
    "macOS 14, Apple silicon": ["macosx_14_0_arm64"],
    "macOS 14, Intel": ["macosx_14_0_x86_64"],
    "Windows, x86-64": ["win_amd64"],
}  # fmt: skip
"""System -> the platforms whose wheels it takes, as pip names them; Linux with the C library of Debian 12."""
_OTHERS: Final = ("all", "study-peers", "notebooks", "bench", "docs", "release", "dev", "tensorboard", "wandb")  # fmt: skip
_BEGIN, _END = "<!-- wheels: scripts/wheel_table.py -->\n", "<!-- end of wheels -->\n"


def dependencies(pyproject: Mapping[str, object]) -> dict[str, list[str]]:
    """Requirements without markers, by extra; "" for those of every installation.

    Extras for developers only, and our own packages, are excluded.
    """
    project: dict = pyproject["project"]  # type: ignore[assignment, type-arg]
    groups = {"": project["dependencies"], **project["optional-dependencies"]}
    # An extra of a dependency does not matter: only the package is looked up.
    return {
        extra: [
            re.sub(r"\[.*?\]|;.*", "", text).strip()
            for text in requirements
            if not text.startswith("pbrs-farm-")  # our own, without compiled code
        ]
        for extra, requirements in groups.items()
        if extra not in _OTHERS
    }


def without_wheel(requirements: Iterable[str], platforms: Iterable[str]) -> list[str]:
    """Names of the requirements for which pip finds no recent enough wheel on a system."""
    options = [word for name in platforms for word in ("--platform", name)]
    command = [sys.executable, "-m", "pip", "index", "versions", "--pre", "--only-binary", ":all:"]
    command += ["--python-version", PYTHON, "--disable-pip-version-check", *options]
    lacking = []
    for requirement in dict.fromkeys(requirements):
        needed = Requirement(requirement)
        done = subprocess.run([*command, needed.name], capture_output=True, text=True, check=False)
        match = re.search(r"Available versions: (.*)", done.stdout)
        if not match and "No matching distribution" not in done.stderr:
            raise SystemExit(f"wheel_table: {needed.name}: {done.stderr.strip()[-500:]}")
        if not match or not any(needed.specifier.contains(v) for v in match[1].split(", ")):
            lacking.append(needed.name)
    return lacking


def table(groups: Mapping[str, list[str]], lacking: Mapping[str, set[str]]) -> str:
    """A row per extra, a column per system: "all", or the packages without a wheel there."""
    lines = ["| extra | " + " | ".join(lacking) + " |", "|---" * (len(lacking) + 1) + "|"]
    for extra, requirements in groups.items():
        names = [Requirement(text).name for text in requirements]
        cells = []
        for missing in lacking.values():
            lacking_here = [name for name in names if name in missing]
            cells.append(f"no {', '.join(lacking_here)}" if lacking_here else "all")
        lines.append(f"| {f'`{extra}`' if extra else 'none'} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main(page: Path | None) -> None:
    """Query every system and print the table, or write it between the marks of a page."""
    groups = dependencies(tomllib.loads((REPO / "pyproject.toml").read_text("utf-8")))
    requirements = [text for group in groups.values() for text in group]
    markdown = table(groups, {s: set(without_wheel(requirements, p)) for s, p in SYSTEMS.items()})
    if page is None:
        print(markdown, end="")
        return
    before, _, rest = page.read_text("utf-8").partition(_BEGIN)
    page.write_text(f"{before}{_BEGIN}{markdown}{_END}{rest.partition(_END)[2]}", "utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
