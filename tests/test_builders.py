"""Builders of tests are in tests/inputs, or in a helper module of a folder: no test module imports another."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parent


def test_no_module_imports_a_test_module() -> None:
    importers = [
        f"{path.relative_to(TESTS)}: {match[0]}"
        for path in TESTS.rglob("*.py")
        for match in re.finditer(
            r"^\s*(?:from|import) tests[\w.]*\.test_\w+", path.read_text(encoding="utf-8"), re.M
        )
    ]
    assert importers == []
