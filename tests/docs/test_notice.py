"""NOTICE, the page of licences, the changelog and the citation name existing files."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]


def test_the_paths_that_notice_names_are_there() -> None:
    text = (ROOT / "NOTICE").read_text()
    paths = re.findall(r"^pbrs_farm/\S+", text, re.MULTILINE)
    assert len(paths) >= 4
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_the_page_of_licences_names_all_weights_and_all_that_is_vendored() -> None:
    text = (ROOT / "docs/licences.md").read_text(encoding="utf-8")
    weights = [
        p.parent.name for p in (ROOT / "deploy/weights/pbrs_farm_weights").glob("*/README.md")
    ]
    vendored = [p.name for p in (ROOT / "pbrs_farm/board/vendor").glob("*.js")]
    named_by_notice = re.findall(
        r"^pbrs_farm/\S+/([\w-]+\.\w+)", (ROOT / "NOTICE").read_text(), re.M
    )
    assert len(weights) >= 3
    assert len(vendored) >= 2
    assert len(named_by_notice) >= 3
    assert [n for n in [*weights, *vendored, *named_by_notice] if f"`{n}`" not in text] == []


def test_the_citation_has_the_version_of_the_changelogs_newest_heading() -> None:
    heading = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.M)
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert heading is not None
    assert str(citation["version"]) == heading[1]
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()  # required by CFF 1.2


def test_notice_credits_wordnet_and_the_photographs_of_the_repository() -> None:
    notice = (ROOT / "NOTICE").read_text()
    assert "Princeton University" in notice
    folder = "benchmarks/study/desk"
    licence = "https://creativecommons.org/licenses/by/4.0/"
    for text in (notice, (ROOT / folder / "README.md").read_text()):
        assert "J. Sturm, N. Engelhard, F. Endres, W. Burgard, D. Cremers" in text
        assert licence in text
    assert f"`{folder}`" in (ROOT / "docs/licences.md").read_text(encoding="utf-8")
    assert f"prune {folder}\n" in (ROOT / "MANIFEST.in").read_text()
