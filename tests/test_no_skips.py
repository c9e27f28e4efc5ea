"""CI cannot be green by skipping."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

BODIES = {
    "a test": "import pytest\ndef test_a():\n    pytest.skip('no LLVM')\n",
    "a mark": "import pytest\n@pytest.mark.skipif(True, reason='no LLVM')\ndef test_a(): pass\n",
    "a fixture": "import pytest\n@pytest.fixture\ndef f():\n    pytest.skip('no LLVM')\n"
    "def test_a(f): pass\n",
    "a module": "import pytest\npytest.importorskip('no_such_module_at_all')\ndef test_a(): pass\n",
}


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("ci", ["true", ""])
def test_a_skip_fails_in_ci_and_only_there(tmp_path: Path, body: str, ci: str) -> None:
    (tmp_path / "test_it.py").write_text(BODIES[body])
    (tmp_path / "test_other.py").write_text("def test_b(): pass\n")
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    words = ["-m", "pytest", "-q", "-p", "tests.no_skips", "-p", "no:cacheprovider", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, *words], env=os.environ | {"CI": ci}, capture_output=True, text=True
    )
    assert (done.returncode != 0) is (ci == "true"), done.stdout
    if ci:
        assert "CI=true forbids" in done.stdout
