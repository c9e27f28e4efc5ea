"""Distributions built from this tree: the index text, the installed names, archives of equal bytes."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tarfile
import zipfile
from email.parser import Parser
from pathlib import Path
from types import ModuleType

import pytest

REPO = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def build_script() -> ModuleType:
    """setup.py as a module: it builds only as a script."""
    spec = importlib.util.spec_from_file_location("build_script", REPO / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_text_for_an_index_needs_nothing_beside_it() -> None:
    text = (REPO / "README.pypi.md").read_text(encoding="utf-8")
    assert "![" not in text
    assert "pip install" in text
    targets = re.findall(r"\]\(([^)]*)\)", text)
    assert targets
    assert [target for target in targets if not target.startswith("https://")] == []
    pages = set(re.findall(r"pbrs-farm help ([\w/]+)", text))
    assert len(pages) > 5
    assert [page for page in pages if not (REPO / f"docs/{page}.md").is_file()] == []


def test_the_queues_code_is_called_by_its_installed_name(build_script: ModuleType) -> None:
    source = 'from workers.queue import a\nimport workers.ledger\nname = "workers.queue:app"\nmy_workers.queue'
    assert build_script.renamed(source, ["queue", "ledger"]) == (
        "from pbrs_farm_workers.queue import a\nimport pbrs_farm_workers.ledger\n"
        'name = "pbrs_farm_workers.queue:app"\nmy_workers.queue'
    )


@pytest.mark.pages
def test_two_builds_of_a_tree_are_the_same_bytes_and_an_index_takes_them(tmp_path: Path) -> None:
    pytest.importorskip("build")
    pytest.importorskip("twine")
    for k, mask in enumerate((0o022, 0o077)):
        # Another folder, other file times, another umask: none of them may matter.
        tree, out = tmp_path / f"tree{k}", tmp_path / f"dist{k}"
        subprocess.run(["git", "clone", "-q", str(REPO), str(tree)], check=True, umask=mask)
        words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(tree)]
        epoch = {"SOURCE_DATE_EPOCH": "1700000000"}
        subprocess.run(
            words, check=True, capture_output=True, env={**os.environ, **epoch}, umask=mask
        )
    first, second = sorted((tmp_path / "dist0").iterdir()), sorted((tmp_path / "dist1").iterdir())
    assert [p.name for p in first] == [p.name for p in second]
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]
    subprocess.run(
        [sys.executable, "-m", "twine", "check", "--strict", *map(str, first)], check=True
    )
    wheel = next(p for p in first if p.suffix == ".whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        metadata = next(n for n in names if n.endswith(".dist-info/METADATA"))
        fields = Parser().parsestr(archive.read(metadata).decode())
    assert "pbrs_farm_workers/queue/__init__.py" in names or any(
        n.startswith("pbrs_farm_workers/queue") for n in names
    )
    assert not [n for n in names if n.startswith(("workers/", "tests/"))]
    assert "![" not in fields.get_payload()
    sdist = next(p for p in first if p.name.endswith(".tar.gz"))
    with tarfile.open(sdist) as source:
        assert any(n.endswith("/tests/docs/test_package.py") for n in source.getnames())
