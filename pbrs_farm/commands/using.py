"""Verbs that use what was made: sheet. Effects: read and write an output folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from pbrs_farm.commands.words import Verb, say


def add_verbs(verb: Verb) -> None:
    """Add sheet."""
    p = verb(
        "sheet", _sheet, "contact sheet (sheet.png) and gallery (index.html) of an output folder"
    )
    p.add_argument("folder", type=Path)
    p.add_argument("--views", type=int, default=24, help="rows of the contact sheet (default 24)")


def _sheet(args: argparse.Namespace) -> int:
    write_sheets(args.folder, args.views)
    return 0


def write_sheets(folder: Path, max_views: int) -> None:
    from pbrs_farm.farm.sheet import contact_sheet, gallery
    from pbrs_farm.store.folder import FolderStore

    store = FolderStore(folder)
    store.put("sheet.png", contact_sheet(folder, max_views=max_views))
    store.put("index.html", gallery(folder).encode())
    say(f"{folder / 'sheet.png'}\n{folder / 'index.html'}")
