"""The table of wheels: requirements of pyproject.toml, and their rows in docs/install.md."""

from __future__ import annotations

import importlib
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

REPO = Path(__file__).parents[2]
PYPROJECT = tomllib.loads((REPO / "pyproject.toml").read_text("utf-8"))


@pytest.fixture
def wheels(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(REPO / "scripts")
    return importlib.import_module("wheel_table")


def test_requirements_are_without_markers_and_extras(wheels: ModuleType) -> None:
    groups = wheels.dependencies(
        {
            "project": {
                "dependencies": ["a>=1; sys_platform == 'linux'"],
                "optional-dependencies": {"x": ["b[more]>=2,<3"], "dev": ["c"]},
            }
        }
    )
    assert groups == {"": ["a>=1"], "x": ["b>=2,<3"]}


def test_a_cell_names_packages_without_a_wheel(wheels: ModuleType) -> None:
    text = wheels.table({"": ["a>=1", "b"], "x": ["c"]}, {"one": set(), "two": {"a", "c"}})
    assert text.splitlines()[2:] == ["| none | all | no a |", "| `x` | all | no c |"]


def test_the_page_has_a_row_for_each_extra_and_a_column_for_each_system(wheels: ModuleType) -> None:
    page = (REPO / "docs/install.md").read_text("utf-8")
    lines = page.partition("<!-- wheels")[2].partition("<!-- end")[0].splitlines()[1:]
    assert lines[0] == "| extra | " + " | ".join(wheels.SYSTEMS) + " |"
    extras = [line.split("|")[1].strip().strip("`") for line in lines[2:]]
    assert extras == [extra or "none" for extra in wheels.dependencies(PYPROJECT)]
