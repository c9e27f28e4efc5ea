"""Wheels and sdist built twice, and used in an empty environment of each Python: `make bench NAME=release`.

There the demo renders, `help` shows a page, and every form of export is written. Effects: builds in a
temporary folder, asks the package index for the dependencies, renders the built-in home, and writes
out/bench/release.json and the bill of materials, out/release/sbom.cdx.json.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
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
    "release.ok": "1: all of the below hold, on every Python of the list",
    "release.pythons": "versions that were tried, each in an empty environment",
    "release.absent": "versions of the list that this machine lacks",
    "release.same_bytes": "1: two builds of sdist and wheels are equal byte for byte",
    "release.twine": "1: `twine check --strict` passes",
    "release.wheel_mb": "MB of the wheel",
    "release.installed_mb": "MB of an environment with the wheel and what it needs",
    "release.sbom_parts": "parts of that environment's bill of materials: out/release/sbom.cdx.json",
    "release.wheel_demo": "1: `pbrs-farm demo` of the wheel in an empty environment ends with a sheet",
    "release.demo_s": "seconds that it takes on the oldest Python: the built-in home, one view",
    "release.help": "1: `pbrs-farm help install` shows the page there",
    "release.forms_failed": "Python and forms of export that end in an error there, with the extra all",
    "release.import_ms": "CPU ms of `import pbrs_farm` there, median of 15, the interpreter's start apart",
    "release.image_mb": "MB of the image cpu of docker/Dockerfile; -1 where it was not built here",
}
PYTHONS: Final = ("3.11", "3.13")
MOST_MB: Final = 4.0  # of the wheel
IMAGE: Final = "pbrs-farm"
BILL: Final = REPO / "out/release/sbom.cdx.json"
_IMPORT: Final = (
    "import time; t = time.process_time(); import pbrs_farm; print(1e3 * (time.process_time() - t))"
)


_FORMS: Final = """
import json
import pbrs_farm as pf
from pbrs_farm.cli import main
from pbrs_farm.export.form import all_forms

def root_of(form):
    if getattr(form, "lenses", ()) == ("equirect",):
        return "turn"
    return "pair" if "disparity" in getattr(form, "layers", ()) else "walk"

def code_of(words):
    try:
        return main(words)
    except BaseException as error:
        return repr(error)

if __name__ == "__main__":
    small = {"light.spp": 4, "image.width_px": 64, "image.height_px": 48}
    home = pf.load("builtin", recipe="preview").set(**small)
    home = home.place(pf.generate_model("cup"), on="table")  # bop exports placed models
    walk = home.set(**{"cameras.source": "walk", "cameras.walk_frames": 3})
    layers = ["albedo", "roughness", "metallic", "depth_z", "flow_forward", "occlusion_forward"]
    layers += ["depth_layers", "depth_layers_instance", "depth_layers_clear"]
    layers += ["depth_sensor_d455", "depth_hole_d455"]
    pf.render_homes(walk, "walk", layers=layers, tracks=True)
    turn = home.set(**{"image.height_px": 32, "lens.model": "equirect"})
    pf.render_homes(turn, "turn", views=1)
    pair = home.set(**{"cameras.stereo_m": 0.1})
    pf.render_homes(pair, "pair", views=1, layers=["depth_z", "disparity"])
    codes = {
        form.name: code_of(["export", root_of(form), "--to", form.name, "--out", f"forms/{form.name}"])
        for form in all_forms()
    }
    print(json.dumps([name for name, code in codes.items() if code]))
"""


def main() -> None:
    """Measure and write out/bench/release.json."""
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first, second = (built(folder / f"dist{k}") for k in range(2))
        figures["release.same_bytes"] = int(digests(first) == digests(second))
        check = ["-m", "twine", "check", "--strict", *map(str, first)]
        figures["release.twine"] = int(told([sys.executable, *check], folder).returncode == 0)
        wheel = next(p for p in first if p.match("pbrs_farm-*.whl"))
        figures["release.wheel_mb"] = round(wheel.stat().st_size / 1e6, 2)
        pythons = {version: interpreter(version) for version in PYTHONS}
        tried = {version: path for version, path in pythons.items() if path}
        figures["release.pythons"] = list(tried)
        figures["release.absent"] = [version for version in PYTHONS if version not in tried]
        results = {
            version: of_empty_environment(path, wheel, folder / version)
            for version, path in tried.items()
        }
        figures |= next(iter(results.values()), {})
        for name in ("release.help", "release.wheel_demo"):
            figures[name] = int(all(result[name] for result in results.values()))
        figures["release.forms_failed"] = [
            f"{version}: {form}"
            for version, result in results.items()
            for form in result["release.forms_failed"]
        ]
    ones = ("same_bytes", "twine", "help", "wheel_demo")
    figures["release.ok"] = int(
        all(figures[f"release.{name}"] for name in ones)
        and not figures["release.absent"]
        and not figures["release.forms_failed"]
        and figures["release.wheel_mb"] <= MOST_MB
    )
    figures["release.image_mb"] = image_mb()
    write_report("release", figures, UNITS)


def interpreter(version: str) -> str | None:
    """A Python of that version that can make environments: of the PATH, else one that uv knows; None without."""
    words = [
        "-c",
        f"import ensurepip, sys; sys.exit(not sys.version.startswith({version + '.'!r}))",
    ]
    finders = [[f"python{version}"], ["python3"]]
    if shutil.which("uv"):
        found = subprocess.run(["uv", "python", "find", version], capture_output=True, text=True)
        finders += [[found.stdout.strip()]] if found.returncode == 0 else []
    for (path,) in finders:
        if (
            shutil.which(path)
            and not subprocess.run([path, *words], capture_output=True).returncode
        ):
            return path
    return None


def built(out: Path) -> list[Path]:
    """sdists and wheels of this tree and of the weights, by name, dated as its last commit is."""
    git = ["git", "-C", str(REPO), "log", "-1", "--format=%ct"]
    epoch = subprocess.run(git, check=True, capture_output=True, text=True).stdout.strip()
    environment = {**os.environ, "SOURCE_DATE_EPOCH": epoch}
    for source in (REPO, REPO / "deploy/weights"):
        words = [sys.executable, "-m", "build", "--outdir", str(out), str(source)]
        subprocess.run(words, check=True, capture_output=True, env=environment)
    return sorted(out.iterdir())


def digests(files: list[Path]) -> list[tuple[str, str]]:
    """(name, sha256) of each file."""
    return [(p.name, hashlib.sha256(p.read_bytes()).hexdigest()) for p in files]


def of_empty_environment(base: str, wheel: Path, folder: Path) -> dict[str, Any]:
    """The figures of an environment of a Python: with the wheel alone, the forms with the extra all."""
    home = folder / "environment"
    folder.mkdir()
    subprocess.run([base, "-m", "venv", str(home)], check=True)
    pip = [str(home / "bin/pip"), "install", "--quiet", "--disable-pip-version-check"]
    # Not beside the clone on PYTHONPATH, which pip would take for the installed package.
    told([*pip, str(wheel)], folder).check_returncode()
    parts = write_bill(Path(home / "bin/python"), BILL)
    size = sum(p.stat().st_size for p in home.rglob("*") if p.is_file() and not p.is_symlink())
    python, program = str(home / "bin/python"), str(home / "bin/pbrs-farm")
    times = [float(told([python, "-c", _IMPORT], folder).stdout) for _ in range(15)]
    # The built-in home: an index brings no example homes.
    words = ["demo", "--home", "builtin", "--bare", "--views", "1", "--out", "demo"]
    began = time.monotonic()
    demo = told([program, *words], folder)
    demo_s = time.monotonic() - began
    sheet = folder / "demo/sheet.png"
    page = told([program, "help", "install"], folder)
    told([*pip, f"{wheel}[all]"], folder).check_returncode()
    (folder / "forms.py").write_text(_FORMS)
    forms = told([python, "forms.py"], folder)
    failed = json.loads(forms.stdout.splitlines()[-1]) if not forms.returncode else ["all"]
    return {
        "release.installed_mb": round(size / 1e6),
        "release.sbom_parts": parts,
        "release.import_ms": round(statistics.median(times), 2),
        "release.wheel_demo": int(
            demo.returncode == 0 and sheet.is_file() and sheet.stat().st_size > 10_000
        ),
        "release.demo_s": round(demo_s, 1),
        "release.help": int(page.returncode == 0 and "uninstall" in page.stdout),
        "release.forms_failed": failed,
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
