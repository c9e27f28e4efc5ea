"""NOTICE names what is there."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_paths_that_notice_names_are_there() -> None:
    text = (ROOT / "NOTICE").read_text()
    paths = re.findall(r"^pbrs_farm/\S+", text, re.MULTILINE)
    assert len(paths) >= 4
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_notice_credits_wordnet() -> None:
    assert "Princeton University" in (ROOT / "NOTICE").read_text()
