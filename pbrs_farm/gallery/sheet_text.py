"""Draw text of any script, each letter in the first font that has it. Effects: draws, opens fonts.

Pillow's own font has Latin letters; others come from the machine's fonts (`make setup`
installs two): DejaVu Sans (Latin, Greek, Cyrillic, Hebrew, Arabic, Armenian, Georgian and more)
and Droid Sans Fallback (Chinese, Japanese, Korean).
"""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

from PIL import ImageDraw, ImageFont

from pbrs_farm.core.shown_text import shown

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont
# fmt: off
_FILES: Final = (
    "DejaVuSans.ttf", "DroidSansFallbackFull.ttf", "DroidSansFallback.ttf",
    "NotoSans-Regular.ttf", "NotoSansCJK-Regular.ttc", "NotoSansThai-Regular.ttf",
    "NotoSansDevanagari-Regular.ttf", "NotoSansSymbols2-Regular.ttf", "NotoEmoji-Regular.ttf",
    "Loma.ttf", "FreeSans.ttf", "wqy-microhei.ttc", "unifont.otf", "unifont.ttf",
)
# fmt: on
"""Fonts to use if installed, in order of preference."""
_MOST_LETTERS: Final = 1000  # maximum length of a line
_ASCENT: Final = 0.78  # ascent of Pillow's own letters, as a share of the size
_UNKNOWN: Final = "\u0378"  # an unassigned code point, drawn as the font's box for missing letters


def draw_line(
    draw: ImageDraw.ImageDraw,
    at: tuple[float, float],
    text: str,
    *,
    fill: tuple[int, int, int],
    size: int,
) -> float:
    """Draw a line of text with its top left corner at `at`; returns its length in px.

    A letter in no font becomes "?"; joiners and variation selectors of pictographs are left out if the
    font before them lacks them.
    """
    x, y = at
    text = shown(text, _MOST_LETTERS)
    if text.isascii():
        draw.text(at, text, fill, _own(size))
        return float(draw.textlength(text, _own(size)))
    # Letters of several fonts share a baseline, not a top.
    base = y + _own_ascent(size)
    for name, part in runs_of_one_font(text):
        font = _font_of_script(name, size)
        draw.text((x, base), part, fill, font, anchor="ls")
        x += float(draw.textlength(part, font))
    return x - at[0]


def runs_of_one_font(text: str) -> Iterator[tuple[str, str]]:
    """(font file, "" for Pillow's own, and the letters to draw in it), from left to right."""
    name, part = "", ""
    for c in text:
        # Keep marks, joiners and spaces with the letter before, so that shaping sees the whole.
        follows = part and (c == " " or unicodedata.category(c) in ("Mn", "Mc", "Me", "Cf"))
        if follows and _has(name, c):
            part += c
            continue
        if follows and c != " ":
            continue
        file = next((f for f in ("", *_installed()) if _has(f, c)), None)
        file, c = (name, "?") if file is None else (file, c)
        if file != name and part:
            yield name, part
            part = ""
        name, part = file, part + c
    if part:
        yield name, part


@cache
def _has(file: str, c: str) -> bool:
    """True if a font has a glyph for c, other than its box for missing letters."""
    if c.isascii():
        return True
    font = _font_of_script(file, 16)
    letter, box = font.getmask(c), font.getmask(_UNKNOWN)
    return letter.size != box.size or bytes(letter) != bytes(box)


@cache
def _font_of_script(file: str, size: int) -> Font:
    return ImageFont.truetype(file, size) if file else _own(size)


@cache
def _own(size: int) -> Font:
    return ImageFont.load_default(size)


def _own_ascent(size: int) -> float:
    font = _own(size)
    if isinstance(font, ImageFont.FreeTypeFont):
        return float(font.getmetrics()[0])
    return _ASCENT * size


@cache
def _installed() -> tuple[str, ...]:
    """Paths of the installed fonts of _FILES, in the folders of fontconfig."""
    home = os.environ.get("XDG_DATA_HOME", str(Path.home() / ".local/share"))
    shared = os.environ.get("XDG_DATA_DIRS", "/usr/local/share:/usr/share").split(":")
    roots = [*(Path(s) / "fonts" for s in (home, *shared)), Path.home() / ".fonts"]
    paths: dict[str, str] = {}
    for root in roots:
        for folder, _folders, names in os.walk(root):
            for name in set(names).intersection(_FILES):
                paths.setdefault(name, str(Path(folder) / name))
    return tuple(paths[name] for name in _FILES if name in paths and _opens(paths[name]))


def _opens(file: str) -> bool:
    try:
        ImageFont.truetype(file, 16)
    except OSError:
        return False
    return True
