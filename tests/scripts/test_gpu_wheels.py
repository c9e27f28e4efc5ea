"""Libraries that the GPU check carries to a machine without a network, and its errors there."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tarfile
from pathlib import Path
from types import ModuleType

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"


@pytest.fixture
def wheels(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(SCRIPTS)
    return importlib.import_module("gpu_wheels")


@pytest.mark.parametrize(
    ("path", "carried"),
    [
        ("mitsuba/cuda_ad_rgb.cpython-312-x86_64-linux-gnu.so", True),
        ("mitsuba/cuda_ad_mono.cpython-312-x86_64-linux-gnu.so", False),
        ("mitsuba/plugins/sunsky.so", True),
        ("mitsuba/plugins/volpath.so", False),
        ("pyoidn/oidn/lib/libOpenImageDenoise_core.so.2.5.1", True),
        ("pyoidn/oidn/lib/libOpenImageDenoise_device_cpu.so.2.5.1", True),
        ("pyoidn/oidn/lib/libOpenImageDenoise_device_cuda.so.2.5.1", False),
        ("pyoidn/oidn/lib/libOpenImageDenoise_device_hip.so.2.5.1", False),
        ("pyoidn/oidn/lib/libtbb.so.12", True),
        ("pyoidn/oidn/lib/CUT.txt", True),
        ("numpy/_core/tests/test_umath.py", False),
        ("trimesh/base.py", True),
        # Posters of generated homes have text: FreeType, and its dependencies.
        ("PIL/_imagingft.cpython-312-x86_64-linux-gnu.so", True),
        ("pillow.libs/libfreetype-57f805ba.so.6.20.6", True),
        ("pillow.libs/libharfbuzz-fb49c9fc.so.0.61450.0", True),
        ("pillow.libs/libbrotlidec-7e5462ba.so.1.2.0", True),
        ("pillow.libs/libavif-1.so", False),
    ],
)
def test_only_files_that_the_check_cannot_use_stay_behind(
    wheels: ModuleType, path: str, carried: bool
) -> None:
    assert wheels.is_carried(path) == carried


def test_packed_files_are_restored_and_pack_to_the_same_bytes(
    wheels: ModuleType, tmp_path: Path
) -> None:
    site = tmp_path / "site"
    contents = {
        "a/b.so": b"\x7fELF" * 99,
        "a/x.py": b"1\n",
        "a/tests/x.py": b"2\n",
        "pyoidn/y": b"3",
    }
    for path, content in contents.items():
        (site / path).parent.mkdir(parents=True, exist_ok=True)
        (site / path).write_bytes(content)
    carried = wheels.carried(site)
    assert carried == ["a/x.py", "pyoidn/y", "a/b.so"]
    for name in ("one", "two"):
        wheels.pack(site, carried, tmp_path / f"{name}.tar.xz")
        os.utime(site / "a/x.py", (1, 1))
    assert (tmp_path / "one.tar.xz").read_bytes() == (tmp_path / "two.tar.xz").read_bytes()
    with tarfile.open(tmp_path / "one.tar.xz") as tar:
        unpacked = {m.name: tar.extractfile(m) for m in tar}
        assert {k: f.read() for k, f in unpacked.items() if f} == {
            path: contents[path] for path in carried
        }


def test_every_requirement_is_fetched_except_unimported_ones(wheels: ModuleType) -> None:
    names = wheels.requirements()
    assert any(r.startswith("mitsuba") for r in names)
    assert any(r.startswith("celery") for r in names)
    assert not any(r.startswith("pyarrow") for r in names)


def test_a_folder_for_another_python_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "wheels-2.7.tar.xz").touch()
    done = subprocess.run(
        ["bash", str(SCRIPTS / "gpu_check.sh"), str(tmp_path)],
        env=os.environ | {"PYTHON": sys.executable}, capture_output=True, text=True,
    )  # fmt: skip
    (line,) = done.stderr.splitlines()
    this_python = "{}.{}".format(*sys.version_info[:2])
    assert done.returncode == 1
    assert "holds wheels-2.7.tar.xz" in line
    assert f"here is Python {this_python}" in line
