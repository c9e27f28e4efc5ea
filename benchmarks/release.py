"""Wheel and sdist built twice, installed into an empty environment, and the demo rendered there: `make bench NAME=release`.

Effects: builds in a temporary folder, asks the package index for the dependencies, renders the built-in
home, and writes out/bench/release.json and the bill of materials, out/release/sbom.cdx.json.
"""

from __future__ import annotations

import hashlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import write_report

REPO: Final = Path(__file__).parents[1]
UNITS: Final = {
    "release.same_bytes": "1: two builds of sdist and wheel are equal byte for byte",
    "release.twine": "1: `twine check --strict` passes",
    "release.wheel_mb": "MB of the wheel",
    "release.installed_mb": "MB of an environment with the wheel and what it needs",
    "release.sbom_parts": "parts of that environment's bill of materials: out/release/sbom.cdx.json",
    "release.wheel_demo": "1: `pbrs-farm demo` of the wheel in an empty environment ends with a sheet",
    "release.demo_s": "seconds that it takes: the built-in home, one view",
    "release.import_ms": "CPU ms of `import pbrs_farm` there, median of 15, the interpreter's start apart",
    "release.image_mb": "MB of the image cpu of docker/Dockerfile; -1 where it was not built here",
}
IMAGE: Final = "pbrs-farm"
BILL: Final = REPO / "out/release/sbom.cdx.json"
_IMPORT: Final = (
    "import time; t = time.process_time(); import pbrs_farm; print(1e3 * (time.process_time() - t))"
)


def main() -> None:
    """Measure and write out/bench/release.json."""
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first, second = (built(folder / f"dist{k}") for k in range(2))
        figures["release.same_bytes"] = int(digests(first) == digests(second))
        check = ["-m", "twine", "check", "--strict", *map(str, first)]
        figures["release.twine"] = int(told([sys.executable, *check], folder).returncode == 0)
        wheel = next(p for p in first if p.suffix == ".whl")
        figures["release.wheel_mb"] = round(wheel.stat().st_size / 1e6, 2)
        figures |= of_empty_environment(wheel, folder)
    figures["release.image_mb"] = image_mb()
    write_report("release", figures, UNITS)


def built(out: Path) -> list[Path]:
    """sdist and wheel of this tree, by name, dated as its last commit is."""
    git = ["git", "-C", str(REPO), "log", "-1", "--format=%ct"]
    epoch = subprocess.run(git, check=True, capture_output=True, text=True).stdout.strip()
    words = [sys.executable, "-m", "build", "--outdir", str(out), str(REPO)]
    environment = {**os.environ, "SOURCE_DATE_EPOCH": epoch}
    subprocess.run(words, check=True, capture_output=True, env=environment)
    return sorted(out.iterdir())


def digests(files: list[Path]) -> list[tuple[str, str]]:
    """(name, sha256) of each file."""
    return [(p.name, hashlib.sha256(p.read_bytes()).hexdigest()) for p in files]


def of_empty_environment(wheel: Path, folder: Path) -> dict[str, Any]:
    """The figures of an environment that holds the wheel alone."""
    home = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", str(home)], check=True)
    pip = [str(home / "bin/pip"), "install", "--quiet", "--disable-pip-version-check", str(wheel)]
    # Not beside the clone on PYTHONPATH, which pip would take for the installed package.
    told(pip, folder).check_returncode()
    parts = write_bill(Path(home / "bin/python"), BILL)
    size = sum(p.stat().st_size for p in home.rglob("*") if p.is_file() and not p.is_symlink())
    python = str(home / "bin/python")
    times = [float(told([python, "-c", _IMPORT], folder).stdout) for _ in range(15)]
    # The built-in home: an index brings no example homes.
    words = ["demo", "--home", "builtin", "--bare", "--views", "1", "--out", "demo"]
    began = time.monotonic()
    done = told([str(home / "bin/pbrs-farm"), *words], folder)
    return {
        "release.installed_mb": round(size / 1e6),
        "release.sbom_parts": parts,
        "release.import_ms": round(statistics.median(times), 2),
        "release.wheel_demo": int(
            done.returncode == 0 and (folder / "demo/sheet.png").stat().st_size > 10_000
        ),
        "release.demo_s": round(time.monotonic() - began, 1),
    }


def write_bill(python: Path, bill: Path) -> int:
    """Write the packages of that Python's environment as CycloneDX, the same bytes each time; returns their number.

    Needs cyclonedx-bom of the extra release. A part has name, version, licence and package URL.
    """
    bill.parent.mkdir(parents=True, exist_ok=True)
    words = [
        "-m",
        "cyclonedx_py",
        "environment",
        "--output-reproducible",
        "-o",
        str(bill),
        str(python),
    ]
    told([sys.executable, *words], bill.parent).check_returncode()
    return len(json.loads(bill.read_text(encoding="utf-8"))["components"])


def image_mb() -> float:
    """MB of the image as Docker counts them; -1 without Docker or the image."""
    words = ["docker", "image", "inspect", IMAGE, "--format", "{{.Size}}"]
    try:
        done = subprocess.run(words, capture_output=True, text=True)
    except OSError:
        return -1.0
    return round(int(done.stdout) / 1e6) if done.returncode == 0 else -1.0


def told(words: list[str], cwd: Path) -> subprocess.CompletedProcess[str]:
    """A command away from the clone, whatever PYTHONPATH says here."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True)
    if done.returncode:
        print(done.stdout[-2000:], done.stderr[-2000:])
    return done


if __name__ == "__main__":
    main()
