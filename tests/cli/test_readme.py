"""README and reference agree with the code: the table of layers, and existing verbs."""

from __future__ import annotations

import re
from pathlib import Path

from pbrs_farm.cli import build_parser
from pbrs_farm.core.layers import layer_table

REPO = Path(__file__).parents[2]
README = (REPO / "README.md").read_text(encoding="utf-8")
COMMANDS = (REPO / "docs/commands.md").read_text(encoding="utf-8")


def test_the_layers_table_equals_layers_py() -> None:
    assert layer_table() in (REPO / "docs/formats/layers.md").read_text(encoding="utf-8")


def test_every_verb_shown_exists() -> None:
    help_text = build_parser().format_help()
    for verb in set(re.findall(r"pbrs-farm ([a-z]+)", README + COMMANDS)):
        assert re.search(rf"^\s+{verb}\b", help_text, re.MULTILINE), verb


def test_every_linked_file_exists() -> None:
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (REPO / link).exists(), link


def test_every_module_the_glossary_names_exists() -> None:
    text = (REPO / "docs/glossary.md").read_text(encoding="utf-8")
    for name in re.findall(r"`([a-z0-9_/]+/(?:[a-z0-9_]+\.py)?)`", text):
        assert (REPO / "pbrs_farm" / name).exists() or (REPO / name).exists(), name
