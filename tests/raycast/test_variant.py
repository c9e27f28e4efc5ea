"""Which LLVM is taken, and that the chosen variant traces rays."""

from pathlib import Path

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


def test_the_newest_library_wins_over_an_old_one_named_by_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.so.1", "libLLVM.so.18.1", "libLLVM.so.19.1"):
        (tmp_path / name).touch()
    monkeypatch.setattr(variant, "_LIBRARY_PLACES", (str(tmp_path / "libLLVM*.so*"),))
    monkeypatch.setattr("sys.prefix", str(tmp_path / "none"))
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM-14.so.1"))
    assert variant.find_llvm() == tmp_path / "libLLVM.so.19.1"
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "libLLVM.so.18.1"))
    assert variant.find_llvm() == tmp_path / "libLLVM.so.18.1"


def test_versions_that_crash_are_never_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("libLLVM-14.so.1", "libLLVM-16.so.1"):
        (tmp_path / name).touch()
    monkeypatch.setattr(variant, "_LIBRARY_PLACES", (str(tmp_path / "libLLVM*.so*"),))
    monkeypatch.setattr("sys.prefix", str(tmp_path / "none"))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    assert variant.find_llvm() is None


def test_the_chosen_variant_is_one_that_traces_rays() -> None:
    name = variant.choose_variant()
    assert name in ("cuda_ad_rgb", "llvm_ad_rgb", "scalar_rgb")
    assert variant.mitsuba().variant() == name
