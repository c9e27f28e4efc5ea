"""The pictures of the notebooks' pages: what their cells show, as docs/pictures/notebooks/NAME-CELL.jpg.

    python scripts/notebook_pictures.py [NAME ...]

Runs each notebook's cells in a temporary folder and keeps the last expression of a cell where that is a picture, or
HTML with one, which Chromium draws. scripts/docs_hooks.py shows them below the cells; the notebooks hold no output.
Effects: writes docs/pictures/notebooks. Needs playwright with Chromium (`make test-web` installs both).
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from PIL import Image

ROOT: Final = Path(__file__).resolve().parents[1]
PICTURES: Final = ROOT / "docs/pictures/notebooks"
WIDTH_PX: Final = 720


def main() -> None:
    """Draw the pictures of the named notebooks, or of all."""
    names = sys.argv[1:] or [p.stem for p in sorted((ROOT / "docs/notebooks").glob("*.ipynb"))]
    PICTURES.mkdir(exist_ok=True)
    for name in names:
        for number, value in shown_values(ROOT / "docs/notebooks" / f"{name}.ipynb"):
            picture = picture_of(value)
            if picture is not None:
                path = PICTURES / f"{name}-{number}.jpg"
                picture.convert("RGB").save(path, quality=85, optimize=True)
                print(path.relative_to(ROOT))


def shown_values(notebook: Path) -> Iterator[tuple[int, Any]]:
    """(number of the cell, value of its last expression) of each cell of code that ends with one."""
    names: dict[str, Any] = {}
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for number, cell in enumerate(cells):
            source = "".join(cell["source"])
            if cell["cell_type"] != "code" or source.startswith("%"):
                continue
            body = ast.parse(source).body
            last = body.pop() if isinstance(body[-1], ast.Expr) else None
            exec(compile(ast.Module(body, []), notebook.name, "exec"), names)
            if isinstance(last, ast.Expr):
                yield (
                    number,
                    eval(compile(ast.Expression(last.value), notebook.name, "eval"), names),
                )


def picture_of(value: Any) -> Image.Image | None:
    """The picture of a value; None if it shows no picture."""
    if isinstance(value, Image.Image):
        return value
    html = value._repr_html_() if hasattr(value, "_repr_html_") else ""
    html = html.replace(f"{Path.cwd()}/", "")  # the temporary folder means nothing to a reader
    if "<svg" not in html and "<img" not in html:
        return None
    from playwright.sync_api import sync_playwright

    with sync_playwright() as program:
        path = shutil.which("chromium")  # Debian's; else Playwright's own
        browser = program.chromium.launch(executable_path=path, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH_PX, "height": 200})
        page.set_content(f'<body style="margin: 8px; font: 14px sans-serif">{html}</body>')
        drawn = page.screenshot(full_page=True)
        browser.close()
    return Image.open(io.BytesIO(drawn))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
