"""Choice of the LLVM library, and that the chosen variant traces rays."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pbrs_farm.raycast import variant


@pytest.mark.parametrize(
    ("name", "version"),
    [
        ("libLLVM.so.19.1", (19, 1)),
        ("libLLVM-14.0.6.so.1", (14, 0, 6)),
        ("libLLVM-15.so.1", (15,)),
        ("libLLVM-17.so", (17,)),
        ("libLLVM.dylib", ()),
    ],
)
def test_a_librarys_version_is_read_from_its_real_name(
    name: str, version: tuple[int, ...], tmp_path: Path
) -> None:
    (tmp_path / name).touch()
    link = tmp_path / "libLLVM.so"
    link.symlink_to(tmp_path / name)
    assert variant.llvm_version(link) == version


def test_the_newest_library_is_preferred_to_an_old_one_of_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.so.1", "libLLVM.so.18.1", "libLLVM.so.19.1"):
        (tmp_path / name).touch()
    monkeypatch.setattr(variant, "LIBRARY_PLACES", (str(tmp_path / "libLLVM*.so*"),))
    monkeypatch.setattr("sys.prefix", str(tmp_path / "none"))
    monkeypatch.setattr("site.getuserbase", lambda: str(tmp_path / "none"))
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM-14.so.1"))
    assert variant.find_llvm() == tmp_path / "libLLVM.so.19.1"
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM.so.18.1"))
    assert variant.find_llvm() == tmp_path / "libLLVM.so.18.1"


def test_versions_that_crash_are_never_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.so.1", "libLLVM-16.so.1"):
        (tmp_path / name).touch()
    monkeypatch.setattr(variant, "LIBRARY_PLACES", (str(tmp_path / "libLLVM*.so*"),))
    monkeypatch.setattr("sys.prefix", str(tmp_path / "none"))
    monkeypatch.setattr("site.getuserbase", lambda: str(tmp_path / "none"))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert variant.find_llvm() is None


@pytest.mark.parametrize("place", ["sys.prefix", "site.getuserbase"])
def test_the_library_of_a_wheel_is_found_in_the_environment_and_in_the_users_packages(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/libLLVM.so.23.1").touch()
    monkeypatch.setattr(variant, "LIBRARY_PLACES", ())
    monkeypatch.setattr("sys.prefix", str(tmp_path / "none"))
    monkeypatch.setattr("site.getuserbase", lambda: str(tmp_path / "none"))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert variant.find_llvm() is None
    folder = str(tmp_path)
    monkeypatch.setattr(place, folder if place == "sys.prefix" else lambda: folder)
    assert variant.find_llvm() == tmp_path / "lib/libLLVM.so.23.1"


# Stop at the import of drjit, and print the library that it would load.
_AT_DRJIT = """
import os, sys
class Stop:
    def find_spec(self, name, *_):
        if name == "drjit":
            print(os.environ.get("DRJIT_LIBLLVM_PATH"))
            os._exit(0)
sys.meta_path.insert(0, Stop())
import {module}
"""


@pytest.mark.parametrize(
    "module", ["pbrs_farm.transport.kernels.outside", "pbrs_farm.transport.path_tracer"]
)
def test_llvm_is_named_before_any_module_of_ours_imports_drjit(module: str) -> None:
    # Dr.Jit loads LLVM at import: a module imported earlier would leave the scalar variant.
    environment = {k: v for k, v in os.environ.items() if k != "DRJIT_LIBLLVM_PATH"}
    command = [sys.executable, "-c", _AT_DRJIT.format(module=module)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(variant.find_llvm())


def test_the_compiled_version_is_reported_for_compiled_variants(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drjit = SimpleNamespace(detail=SimpleNamespace(llvm_version=lambda: (19, 1, 7)))
    monkeypatch.setattr(variant, "import_renderer", lambda _name: drjit)
    assert variant.llvm_of_variant("llvm_ad_rgb") == "19.1.7"
    assert variant.llvm_of_variant("scalar_rgb") == ""
    assert variant.llvm_of_variant("cuda_ad_rgb") == ""


def test_the_chosen_variant_traces_rays() -> None:
    name = variant.choose_variant()
    assert name in ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")
    assert variant.mitsuba().variant() == name
