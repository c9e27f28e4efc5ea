"""Structure of the tests: builders are shared through tests/inputs, and no private name of the code is used."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).parent

# Public despite their underscore, and argparse's internals, which have no public equivalent.
ALLOWED = {"_asdict", "_exit", "_fields", "_getframe", "_replace", "_actions", "_SubParsersAction"}

_OURS = re.compile(r"(pbrs_farm|workers|benchmarks|scripts|tests)\b")


# Without this a source has no such name: parsing all tests takes seconds.
_MAYBE = re.compile(
    r"[.\"']_[A-Za-z]|\bfrom .*\b_[A-Za-z]|^\s+_[A-Za-z]\w*(?: as \w+)?,?\s*(?:#.*)?$", re.M
)


def private_names(source: str) -> Iterator[str]:
    """Private names that a test module imports, patches or reads from another object."""
    if not _MAYBE.search(source):
        return
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.ImportFrom(module=str(module), names=names) if _OURS.match(module):
                yield from (name.name for name in names if re.match(r"_[^_]", name.name))
            case ast.Attribute(value=ast.Name(id="self" | "cls")):
                continue
            case ast.Attribute(attr=name) if re.fullmatch(r"_\w*[^_]", name):
                yield name
            case ast.Call(func=ast.Attribute(attr="setattr" | "delattr"), args=arguments):
                texts = (a.value for a in arguments[:2] if isinstance(a, ast.Constant))
                yield from (t for t in texts if re.search(r"(?:^|\.)_[a-z]\w*$", str(t)))


@pytest.mark.parametrize(
    ("source", "n_names"),
    [
        ("from pbrs_farm.doctor import _extras", 1),
        ("from pbrs_farm.doctor import (\n    checks,\n    _extras,\n)", 1),
        ("from pbrs_farm.doctor import (  # noqa (both)\n    checks,\n    _extras,\n)", 1),
        ("from pbrs_farm.doctor import \\\n    _extras", 1),
        ("import os; from pbrs_farm.doctor import _extras", 1),
        ("doctor._extras()", 1),
        ("monkeypatch.setattr(doctor, '_extras', None)", 1),
        ("monkeypatch.setattr('pbrs_farm.doctor._extras', None)", 1),
        ("self._extras, home._repr_html_(), module.__file__", 0),
        ("from benchmarks import __main__", 0),
    ],
)
def test_private_names_are_found(source: str, n_names: int) -> None:
    assert len(list(private_names(source))) == n_names


def test_no_test_uses_a_private_name() -> None:
    users = [
        f"{path.relative_to(TESTS)}: {name}"
        for path in TESTS.rglob("*.py")
        for name in private_names(path.read_text(encoding="utf-8"))
        if name not in ALLOWED
    ]
    assert users == []


def test_no_module_imports_a_test_module() -> None:
    importers = [
        f"{path.relative_to(TESTS)}: {match[0]}"
        for path in TESTS.rglob("*.py")
        for match in re.finditer(
            r"^\s*(?:from|import) tests[\w.]*\.test_\w+", path.read_text(encoding="utf-8"), re.M
        )
    ]
    assert importers == []
