"""Parts of the site besides its pages: files of the repository (../NOTICE), notebooks, llms.txt.

Effects: MkDocs'; writes llms.txt and the Markdown of each page into the site. A notebook becomes a page with a link
to its file and the pictures of scripts/notebook_pictures.py; links to NAME.ipynb lead to the page.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))
from llms_txt import Entry, llms_txt

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
    for notebook in sorted((ROOT / "docs/notebooks").glob("*.ipynb")):
        name = f"notebooks/{notebook.stem}.md"
        files.append(File.generated(config, name, content=page_of_notebook(notebook)))
    return files


def page_of_notebook(notebook: Path) -> str:
    """The cells of a notebook as Markdown: text unchanged, code in fences, below it the picture of the output."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    parts = []
    for number, cell in enumerate(cells):
        text = "".join(cell["source"]).strip()
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        picture = f"pictures/notebooks/{notebook.stem}-{number}.jpg"
        if (ROOT / "docs" / picture).exists():
            parts.append(f"![Output of the cell above](../{picture})")
    title, _, rest = "\n\n".join(parts).partition("\n")
    file = f"This page is a notebook: [download it]({notebook.name}){{download}}."
    return f"{title}\n\n{file}\n{rest}\n"


_ENTRIES: list[Entry] = []  # of the navigation, between two events of one build


def on_nav(nav: Any, **_rest: Any) -> None:
    """Keep the navigation's pages for llms.txt."""
    _ENTRIES[:] = entries_of(nav.items)


def entries_of(items: Any, above: str = "") -> Iterator[Entry]:
    """Sections and pages in order; a section inside another has both titles."""
    for item in items:
        if item.is_section:
            title = f"{above}{item.title}"
            yield Entry(title)
            yield from entries_of(item.children, f"{title}: ")
        elif item.is_page:
            yield Entry(
                item.title or item.file.src_uri, item.file.src_uri, item.file.content_string
            )


def on_post_build(config: Any, **_rest: Any) -> None:
    """Write llms.txt, and each page's Markdown beside its HTML."""
    site = Path(config["site_dir"])
    for entry in _ENTRIES:
        if entry.path:
            path = site / entry.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(entry.text, encoding="utf-8")
    text = llms_txt(config["site_name"], config["site_description"], _ENTRIES)
    (site / "llms.txt").write_text(text, encoding="utf-8")


def on_page_content(html: str, **_rest: Any) -> str:
    """Replace a poster that links to a film with the film, which plays in the page."""
    poster = r'<a href="([^"]+\.mp4)"><img alt="([^"]*)" src="([^"]+)" ?/?></a>'
    film = r'<video controls loop muted playsinline preload="none" src="\1" poster="\3" title="\2"></video>'
    return re.sub(poster, film, html)


def on_page_markdown(markdown: str, page: Any, **_rest: Any) -> str:
    """Point links that leave the docs at those texts; a page of the lab book comes late in a search."""
    if page.file.src_uri.startswith("lab/"):
        page.meta.setdefault("search", {"boost": 0.3})
    up = "../" * page.file.src_uri.count("/")

    def moved(match: re.Match[str]) -> str:
        name = match[1]
        return f"]({up}files/{plain(name)})" if name in SHOWN else match[0]

    markdown = re.sub(r"(\]\([\w./]*\w+)\.ipynb\)(?!\{)", r"\1.md)", markdown)
    return re.sub(r"\]\((?:\.\./)+([A-Za-z/]+(?:\.md)?)\)", moved, markdown)


def plain(name: str) -> str:
    """A file's name on the site: a text, not a page."""
    return name.replace("/", "-").removesuffix(".md") + ".txt"
