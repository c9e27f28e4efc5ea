"""Java property files: the catalogues of Sweet Home 3D's libraries. No effects."""

from __future__ import annotations

import re
from typing import Final

from pbrs_farm.regular_files import text_from_bytes

_ESCAPE: Final = re.compile(r"\\(u[0-9a-fA-F]{4}|.)", re.DOTALL)
_LETTERS: Final = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}
_ENTRY: Final = re.compile(r"((?:\\.|[^\s\\:=])+)\s*[:=]?\s*(.*)", re.DOTALL)


def parse_properties(data: bytes) -> dict[str, str]:
    """Parse a Java properties file, UTF-8 or Latin-1; later lines first, malformed lines ignored."""
    try:
        text = text_from_bytes(data)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    properties = {}
    whole = ""
    for raw in text.splitlines():
        line = raw.lstrip()
        if not whole and (not line or line[0] in "#!"):
            continue
        # Join continued lines: an odd number of backslashes ends them.
        n_slashes = len(line) - len(line.rstrip("\\"))
        whole += line[:-1] if n_slashes % 2 else line
        if n_slashes % 2:
            continue
        match = _ENTRY.fullmatch(whole)
        whole = ""
        if match is not None:
            properties[_unescape(match[1])] = _unescape(match[2]).strip()
    return properties


def numbered_entries(properties: dict[str, str]) -> list[dict[str, str]]:
    """The entries `key#1`, `key#2`, ... (at most six digits) of a catalogue, by their numbers."""
    rows: dict[int, dict[str, str]] = {}
    for key, value in properties.items():
        name, mark, number = key.partition("#")
        if mark and number.isascii() and number.isdigit() and len(number) < 7:
            rows.setdefault(int(number), {})[name] = value
    return [rows[k] for k in sorted(rows)]


def numbers(text: str) -> list[float]:
    """The numbers in a value, separated by spaces; ValueError for any other word."""
    return [float(word) for word in text.split()]


def _unescape(text: str) -> str:
    def letter(match: re.Match[str]) -> str:
        code = match[1]
        if len(code) == 5:
            return chr(int(code[1:], 16))
        return _LETTERS.get(code, code)

    return _ESCAPE.sub(letter, text)
