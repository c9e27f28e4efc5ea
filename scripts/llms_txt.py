"""llms.txt of the site: each page of the navigation with a link to its Markdown and its first sentence. No effects.

Many users ask a language model first; https://llmstxt.org says where it looks. scripts/docs_hooks.py writes the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple


class Entry(NamedTuple):
    """A page of the navigation, or with an empty path the head of a section."""

    title: str
    path: str = ""
    text: str = ""  # its Markdown


def llms_txt(name: str, description: str, entries: Iterable[Entry]) -> str:
    """The text of the file; paths are relative to it."""
    lines = [f"# {name}", "", f"> {description}"]
    for entry in entries:
        if entry.path:
            said = first_sentence(entry.text)
            lines.append(f"- [{entry.title}]({entry.path})" + (f": {said}" if said else ""))
        else:
            lines += ["", f"## {entry.title}", ""]
    return "\n".join(lines) + "\n"


def first_sentence(markdown: str) -> str:
    """The first sentence of a page's prose, without links and comments; "" for a page without prose.

    >>> first_sentence("# Relight\\n\\nYou want to [change](a.md) lamps. Light is additive.")
    'You want to change lamps.'
    """
    text = re.sub(r"\A---\n.*?\n---\n|<!--.*?-->|^```.*?^```", "", markdown, flags=re.S | re.M)
    for paragraph in text.split("\n\n"):
        prose = " ".join(paragraph.split())
        if prose and not prose.startswith((*"#|!*<-", "[!", ":::", "This page is a notebook")):
            prose = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", prose)
            return re.split(r"(?<=[.?!])\s", prose, maxsplit=1)[0]
    return ""
