"""Files once read wrongly are read correctly."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cases.table import CASES


@pytest.mark.parametrize("name", CASES)
def test_a_case_is_read_rightly(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    case.ask(case.write(tmp_path))
