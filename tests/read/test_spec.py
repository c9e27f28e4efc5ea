"""Every document and section that modules cite exists in docs/spec."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
_CITATION = re.compile(
    r"docs/spec/(\w+)\.md(?: sections? ([0-9.]*[0-9]))?|[Pp]aper section ([0-9.]*[0-9])"
)


def citations() -> set[tuple[str, str]]:
    """(document, section or "") of every citation in the packages."""
    cited = set()
    for package in ("pbrs_farm", "workers"):
        for path in (ROOT / package).rglob("*.py"):
            for document, section, of_paper in _CITATION.findall(path.read_text("utf-8")):
                cited.add((document or "paper", section or of_paper))
    return cited


def test_every_cited_section_is_in_its_document() -> None:
    cited = citations()
    assert {document for document, _ in cited} >= {"suncg", "paper"}
    for document, section in sorted(cited):
        text = (ROOT / f"docs/spec/{document}.md").read_text("utf-8")
        heads = re.findall(r"^(?:#+ |- \*\*)([0-9.]*[0-9])[.,]? ", text, re.MULTILINE)
        assert not section or section in heads, f"docs/spec/{document}.md section {section}"


def test_no_module_cites_a_section_without_its_document() -> None:
    for path in (ROOT / "pbrs_farm").rglob("*.py"):
        text = path.read_text("utf-8")
        assert not re.search(r"(?<!docs/)spec/\w+|\bsuncg sections?\b|\(section 2\)", text), path
