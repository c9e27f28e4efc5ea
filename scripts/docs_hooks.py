"""Lets pages of the site link to files at the top of the repository (../NOTICE). Effects: MkDocs'."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
SHOWN = (
    "NOTICE",
    "LICENSE",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "deploy/README.md",
)


def on_files(files: Files, config: Any) -> Files:
    """Add the repository's own files as plain texts."""
    for name in SHOWN:
        text = (ROOT / name).read_text(encoding="utf-8")
        files.append(File.generated(config, f"files/{plain(name)}", content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_rest: Any) -> str:
    """Point links that leave the docs at those texts."""
    up = "../" * page.file.src_uri.count("/")

    def moved(match: re.Match[str]) -> str:
        name = match[1]
        return f"]({up}files/{plain(name)})" if name in SHOWN else match[0]

    return re.sub(r"\]\((?:\.\./)+([A-Za-z/]+(?:\.md)?)\)", moved, markdown)


def plain(name: str) -> str:
    """A file's name on the site: a text, not a page."""
    return name.replace("/", "-").removesuffix(".md") + ".txt"
