"""Pages of the site that the repository has in another form: its own files (../NOTICE), and notebooks.

Effects: MkDocs'. A notebook becomes a page with a link to its file; links to NAME.ipynb lead to the page.
"""

from __future__ import annotations

import json
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
    for notebook in sorted((ROOT / "docs/notebooks").glob("*.ipynb")):
        name = f"notebooks/{notebook.stem}.md"
        files.append(File.generated(config, name, content=page_of_notebook(notebook)))
    return files


def page_of_notebook(notebook: Path) -> str:
    """The cells of a notebook as Markdown: text unchanged, code in fences; a link to its file below the title."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    parts = []
    for cell in cells:
        text = "".join(cell["source"]).strip()
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    title, _, rest = "\n\n".join(parts).partition("\n")
    file = (
        f"This page is a notebook without its outputs: [download it]({notebook.name}){{download}}."
    )
    return f"{title}\n\n{file}\n{rest}\n"


def on_page_content(html: str, **_rest: Any) -> str:
    """Replace a poster that links to a film with the film, which plays in the page."""
    poster = r'<a href="([^"]+\.mp4)"><img alt="([^"]*)" src="([^"]+)" ?/?></a>'
    film = r'<video controls loop muted playsinline preload="none" src="\1" poster="\3" title="\2"></video>'
    return re.sub(poster, film, html)


def on_page_markdown(markdown: str, page: Any, **_rest: Any) -> str:
    """Point links that leave the docs at those texts."""
    up = "../" * page.file.src_uri.count("/")

    def moved(match: re.Match[str]) -> str:
        name = match[1]
        return f"]({up}files/{plain(name)})" if name in SHOWN else match[0]

    markdown = re.sub(r"(\]\([\w./]*\w+)\.ipynb\)(?!\{)", r"\1.md)", markdown)
    return re.sub(r"\]\((?:\.\./)+([A-Za-z/]+(?:\.md)?)\)", moved, markdown)


def plain(name: str) -> str:
    """A file's name on the site: a text, not a page."""
    return name.replace("/", "-").removesuffix(".md") + ".txt"
