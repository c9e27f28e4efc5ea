"""CI cannot be green by skipping."""

from __future__ import annotations

import os
import re
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


@pytest.mark.parametrize("ci", ["true", ""])
def test_a_skip_fails_in_ci_and_only_there(tmp_path: Path, ci: str) -> None:
    bodies = BODIES | {"another": "def test_b(): pass\n"}
    for name, body in bodies.items():
        (tmp_path / f"test_{name.replace(' ', '_')}.py").write_text(body)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    words = ["-m", "pytest", "-rfE", "-p", "tests.no_skips", "-p", "no:cacheprovider"]
    words += ["--continue-on-collection-errors", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, *words], env=os.environ | {"CI": ci}, capture_output=True, text=True
    )
    assert (done.returncode != 0) is (ci == "true"), done.stdout
    failed = set(re.findall(r"^(?:FAILED|ERROR) \S*test_(\w+)\.py", done.stdout, re.M))
    assert failed == ({name.replace(" ", "_") for name in BODIES} if ci else set()), done.stdout
    assert ("CI=true forbids" in done.stdout) is (ci == "true")
