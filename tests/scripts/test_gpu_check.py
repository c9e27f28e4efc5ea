"""scripts/gpu_check.sh in two calls: each half separately, figures in $OUT, little output."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "scripts" / "gpu_check.sh"
PYTHON = """#!/bin/bash
case "$*" in
  *pytest*) for k in $(seq 500); do echo "PASSED test_$k"; done; echo "FAILED test_of_light - z 9"; echo "500 passed"; exit 1;;
  *benchmarks*) echo '{}' >out/bench/gpu.json; echo "gpu.variant cuda";;
esac
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout whose environment pretends to have a driver, and a Python that records its commands."""
    for name, text in {
        "env/bin/python": PYTHON,
        "env/bin/pip": "#!/bin/sh\n",
        "bin/nvidia-smi": "#!/bin/sh\necho H100\n",
    }.items():
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        file.chmod(0o755)
    (tmp_path / "scripts").mkdir()
    shutil.copy(SCRIPT, tmp_path / "scripts")
    return tmp_path


def checked(checkout: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The script, run there with $OUT set."""
    return subprocess.run(
        ["bash", str(checkout / "scripts" / SCRIPT.name), *words],
        env=os.environ
        | {
            "PATH": f"{checkout / 'bin'}:{os.environ['PATH']}",
            "VENV": str(checkout / "env"),
            "OUT": str(checkout / "given"),
        },
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("words", "files", "status"),
    [
        (["--only", "tests"], {"gpu_tests.txt"}, 1),
        (["--only", "views"], {"gpu.json"}, 0),
        ([], {"gpu_tests.txt", "gpu.json"}, 1),
    ],
)
def test_each_half_writes_its_figures_to_out_and_prints_a_screen_at_most(
    checkout: Path, words: list[str], files: set[str], status: int
) -> None:
    done = checked(checkout, *words)
    assert done.returncode == status, done.stderr
    assert {f.name for f in (checkout / "given").iterdir()} == files
    lines = done.stdout.splitlines()
    assert len(lines) < 30
    assert ("FAILED test_of_light - z 9" in lines) == ("gpu_tests.txt" in files)


def test_a_half_ends_before_its_call_and_its_figures_so_far_are_kept(checkout: Path) -> None:
    timeout = checkout / "bin" / "timeout"
    timeout.write_text('#!/bin/bash\necho "begun, to end within $1"\nexit 124\n')
    timeout.chmod(0o755)
    done = checked(checkout, "--only", "tests")
    assert done.returncode == 124
    assert "tests took more than" in done.stderr
    limit = (checkout / "given" / "gpu_tests.txt").read_text().split()[-1]
    assert 0 < int(limit) < 300


def test_an_unknown_half_is_refused(checkout: Path) -> None:
    done = checked(checkout, "--only", "speed")
    assert (done.returncode, done.stderr) == (2, "gpu_check: --only wants tests or views\n")


def test_without_a_gpu_the_check_ends_in_one_line(checkout: Path) -> None:
    (checkout / "bin/nvidia-smi").write_text("#!/bin/sh\necho no devices >&2\nexit 9\n")
    done = checked(checkout)
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("gpu_check: no NVIDIA GPU here")
