"""The notebooks are small, are stored without outputs, and run to their end in a kernel."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.anywhere.bare_machine import BareMachine, built_wheel, can_be_made

REPO = Path(__file__).parents[2]
NOTEBOOKS = sorted((REPO / "docs/notebooks").glob("*.ipynb"))
PIP = '%pip install -q "pbrs-farm[llvm]"'


def cells(notebook: Path) -> list[dict[str, Any]]:
    cell_list: list[dict[str, Any]] = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return cell_list


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_small_explains_itself_and_holds_no_output(notebook: Path) -> None:
    cell_list = cells(notebook)
    assert 8 <= len(cell_list) <= 16
    assert sum(cell["cell_type"] == "markdown" for cell in cell_list) >= 4
    assert "".join(cell_list[0]["source"]).startswith("# ")
    assert "".join(cell_list[1]["source"]) == PIP
    for cell in cell_list:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


def test_every_notebook_is_linked_from_the_page_and_the_site() -> None:
    names = [f"notebooks/{path.name}" for path in NOTEBOOKS]
    assert len(names) == 5
    page = (REPO / "docs/python.md").read_text(encoding="utf-8")
    assert re.findall(r"\]\((notebooks/\w+\.ipynb)\)", page) == names
    # The site shows each as a page, which scripts/docs_hooks.py makes.
    site = (REPO / "mkdocs.yml").read_text(encoding="utf-8")
    pages = re.findall(r": (notebooks/\w+)\.md$", site, re.MULTILINE)
    assert [f"{page}.ipynb" for page in pages] == names


@pytest.mark.notebooks
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_to_its_end(
    notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("PYTHONPATH", str(REPO))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    book = nbformat.read(notebook, as_version=4)
    # This environment has the package already.
    book.cells = [cell for cell in book.cells if cell.source != PIP]
    resources = {"metadata": {"path": str(tmp_path)}}
    client = NotebookClient(book, timeout=170, kernel_name="python3", resources=resources)
    client.on_cell_start = lambda cell_index, **_cell: sys.stderr.write(f"cell {cell_index}\n")
    client.execute()
    outputs = [output for cell in book.cells for output in cell.get("outputs", ())]
    assert not [o for o in outputs if o.get("name") == "stderr"]
    shown = [o["data"] for o in outputs if "data" in o]
    assert any("<svg" in d.get("text/html", "") or "image/png" in d for d in shown)


@pytest.mark.notebooks
def test_the_notebooks_run_after_pip_without_root_llvm_or_opengl(tmp_path: Path) -> None:
    if not can_be_made():
        pytest.skip("hiding the system's libraries needs unshare, and root or user namespaces")
    bare = BareMachine(tmp_path)
    variables = {"PIP_FIND_LINKS": str(built_wheel(tmp_path).parent)}
    python = bare.environment("env")
    bare.run([python, "-m", "pip", "install", "-q", "nbclient", "ipykernel"]).check_returncode()
    for notebook in NOTEBOOKS:
        sys.stderr.write(f"{notebook.stem}\n")
        # The first notebook's first cell installs the package.
        shown = bare.notebook(python, notebook, variables)
        assert not [line for line in shown if line.startswith("error")], notebook.stem
        assert {"image/png", "text/html"} & set(shown), notebook.stem
