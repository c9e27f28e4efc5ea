"""llms.txt: the navigation's pages with their first sentences."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

REPO = Path(__file__).parents[2]


@pytest.fixture
def llms(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(REPO / "scripts")
    return importlib.import_module("llms_txt")


def test_a_section_is_a_heading_and_a_page_a_link_with_its_first_sentence(llms: ModuleType) -> None:
    entries = [
        llms.Entry("Light"),
        llms.Entry("Relight", "howto/relight.md", "# Relight\n\nYou want [lamps](a.md). And more."),
        llms.Entry("API", "api.md", "---\nsearch: 1\n---\n# API\n\n::: pbrs_farm\n"),
    ]
    assert llms.llms_txt("pbrs_farm", "Rooms", entries).splitlines() == [
        "# pbrs_farm", "", "> Rooms", "", "## Light", "",
        "- [Relight](howto/relight.md): You want lamps.", "- [API](api.md)",
    ]  # fmt: skip


def test_every_page_opens_with_a_sentence(llms: ModuleType) -> None:
    pages = sorted((REPO / "docs").rglob("*.md"))
    said = {page: llms.first_sentence(page.read_text(encoding="utf-8")) for page in pages}
    assert [page for page, text in said.items() if not 10 < len(text) < 400] == []
