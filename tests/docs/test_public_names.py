"""The stable names are listed once, and examples, plugins and pages use no others."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

import pbrs_farm as pf
from pbrs_farm import plugin
from tests.docs.fenced import PAGES, REPO, blocks_of

STABLE = ("pbrs_farm", "pbrs_farm.plugin")
LOADERS = "pbrs_farm.study."  # docs/data.md and a notebook name torch's loaders and metrics


def imported(text: str) -> set[str]:
    """Modules of ours that Python imports."""
    modules = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module:
            modules.add(node.module)
        elif isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
    ours = {name for name in modules if name.partition(".")[0] in ("pbrs_farm", "workers")}
    return {name for name in ours if not name.startswith(LOADERS)}


def code_of(path: Path) -> str:
    """The Python of a script, a page or a notebook."""
    if path.suffix == ".md":
        blocks = [b for b in blocks_of(path) if b.language == "python" and b.how() != "excerpt"]
        return "\n".join(block.text for block in blocks)
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = [c for c in json.loads(text)["cells"] if c["cell_type"] == "code"]
        code = "\n".join("".join(cell["source"]) for cell in cells)
        return re.sub(r"^%pip .*$", "", code, flags=re.MULTILINE)
    return text


SCRIPTS = [
    *sorted((REPO / "examples").rglob("*.py")), *sorted((REPO / "docs/notebooks").glob("*.ipynb")),
    *(page for page in PAGES if "```python" in page.read_text(encoding="utf-8")),
]  # fmt: skip


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: str(path.relative_to(REPO)))
def test_examples_import_only_stable_names(path: Path) -> None:
    assert imported(code_of(path)) <= {*STABLE}


def test_every_stable_name_exists_and_is_in_the_api_pages() -> None:
    for module in (pf, plugin):
        assert all(getattr(module, name) is not None for name in module.__all__)
    page = "".join(p.read_text(encoding="utf-8") for p in (REPO / "docs/api").glob("*.md"))
    lists = re.findall(r"members: \[([^\]]+)\]", page)
    listed = {name.strip() for names in lists for name in names.split(",")}
    assert listed == {*pf.__all__} - {"__version__"}
    assert {*re.findall(r"^        - (\w+)$", page, re.MULTILINE)} == {*plugin.__all__}
    assert {*re.findall(r"^::: ([\w.]+)$", page, re.MULTILINE)} == {*STABLE}


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(
        AttributeError, match=r"module 'pbrs_farm.plugin' has no attribute 'nothing'"
    ):
        plugin.nothing  # noqa: B018
