"""libatomic: the system's if there is one, else that of Debian's package, by its usual name."""

from __future__ import annotations

import ctypes
import io
import tarfile
from pathlib import Path

import pytest

from pbrs_farm.assets import libatomic
from pbrs_farm.assets.debian import Deb
from pbrs_farm.core.errors import MachineFailed


def deb_of(folder: Path, name: str, data: bytes) -> Deb:
    """A package with one file."""
    tar = io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w") as archive:
        entry = tarfile.TarInfo(f"./usr/lib/x86_64-linux-gnu/{name}")
        entry.size = len(data)
        archive.addfile(entry, io.BytesIO(data))
    content = tar.getvalue()
    path = folder / "libatomic1_1.0_amd64.deb"
    head = f"{'data.tar/':<16}{0:<12}{0:<6}{0:<6}{100644:<8}{len(content):<10}`\n"
    path.write_bytes(b"!<arch>\n" + head.encode() + content)
    return Deb("libatomic1", "1.0", path, "0123456789abcdef0123")


def test_the_library_is_unpacked_next_to_its_package(tmp_path: Path) -> None:
    deb = deb_of(tmp_path, "libatomic.so.1.2.0", b"code")
    library = libatomic.unpacked_library(deb)
    assert library == tmp_path / "libatomic1-0123456789abcdef" / "libatomic.so.1"
    assert library.read_bytes() == b"code"
    deb.path.unlink()
    assert libatomic.unpacked_library(deb) == library


def test_a_package_without_the_library_is_damaged(tmp_path: Path) -> None:
    with pytest.raises(MachineFailed, match=r"has no libatomic\.so\.1"):
        libatomic.unpacked_library(deb_of(tmp_path, "README", b""))


def test_the_systems_library_is_used_and_nothing_fetched(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = []
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", loaded.append)
    monkeypatch.setattr("pbrs_farm.assets.debian.fetched_deb", lambda *_: pytest.fail("fetched"))
    libatomic.load_libatomic()
    assert loaded == ["libatomic.so.1"]


def test_a_system_without_it_loads_that_of_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = []

    def load(name: str) -> None:
        if name == libatomic.NAME:
            raise OSError("no such file")
        loaded.append(name)

    deb = deb_of(tmp_path, "libatomic.so.1.2.0", b"code")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", load)
    monkeypatch.setattr("pbrs_farm.assets.debian.fetched_deb", lambda *_: deb)
    libatomic.load_libatomic()
    assert loaded == [str(libatomic.unpacked_library(deb))]


def test_a_file_for_another_processor_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_name: str) -> None:
        raise OSError("wrong ELF class")

    deb = deb_of(tmp_path, "libatomic.so.1.2.0", b"code")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", refuse)
    monkeypatch.setattr("pbrs_farm.assets.debian.fetched_deb", lambda *_: deb)
    with pytest.raises(MachineFailed, match=r"wrong ELF class.*libatomic"):
        libatomic.load_libatomic()


def test_without_the_library_or_a_network_the_error_has_both_remedies(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from pbrs_farm.raycast import variant

    def refuse(name: str) -> None:
        raise OSError("no such file")

    def offline(*_words: object) -> None:
        raise MachineFailed("https://mirror/x.deb: no route", hint="put x.deb into the cache")

    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setattr(ctypes, "CDLL", refuse)
    monkeypatch.setattr("pbrs_farm.assets.debian.fetched_deb", offline)
    # A failed import has the same message instead of the library's.
    expected = r"no libatomic, which Dr\.Jit needs: https://mirror.*libatomic.*; or put x\.deb into"
    for call in (libatomic.load_libatomic, lambda: variant.import_renderer("no_such_drjit")):
        with pytest.raises(MachineFailed, match=expected):
            call()
