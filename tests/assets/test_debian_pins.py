"""Without apt a package is its pinned file: the right one, complete, or an error that explains what to do."""

from __future__ import annotations

import hashlib
import subprocess
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest

from pbrs_farm.assets import debian, furniture_package, homes_package, libatomic, skies
from pbrs_farm.assets.debian import fetched_deb, version_of
from pbrs_farm.assets.pinned_packages import PINS, Pin, download_pinned
from pbrs_farm.core.errors import MachineFailed

DATA = b"a Debian package" * 1000
PIN = Pin(
    package="sweethome3d",
    path="pool/main/s/x/sweethome3d_1.0_all.deb",
    n_bytes=len(DATA),
    sha256=hashlib.sha256(DATA).hexdigest(),
)


@pytest.fixture
def mirror(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, bytes]]:
    """A private mirror, path -> bytes, named in the environment; no apt on the PATH."""
    files: dict[str, bytes] = {}

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            data = files.get(self.path)
            self.send_response(200 if data is not None else 404)
            self.end_headers()
            self.wfile.write(data or b"")

        def log_message(self, *_words: object) -> None:
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    monkeypatch.setenv("PBRS_DEBIAN_MIRROR", f"http://127.0.0.1:{server.server_port}/debian/")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(PINS, PIN.package, PIN)
    yield files
    server.shutdown()
    thread.join()
    server.server_close()


def test_the_pinned_file_is_fetched_into_the_cache(
    mirror: dict[str, bytes], tmp_path: Path
) -> None:
    mirror[f"/debian/{PIN.path}"] = DATA
    deb = fetched_deb(PIN.package, "1.0", tmp_path)
    assert deb.path == tmp_path / PIN.file_name
    assert (deb.version, deb.sha256, deb.note) == ("1.0", PIN.sha256, "")
    # The second time nothing is requested.
    mirror.clear()
    assert fetched_deb(PIN.package, "1.0", tmp_path).sha256 == PIN.sha256


@pytest.mark.parametrize("data", [DATA[:-1], DATA + b"x", b"x" * len(DATA), b""])
def test_another_file_is_refused_and_not_kept(
    data: bytes, mirror: dict[str, bytes], tmp_path: Path
) -> None:
    mirror[f"/debian/{PIN.path}"] = data
    with pytest.raises(MachineFailed, match="has another checksum"):
        fetched_deb(PIN.package, "1.0", tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_mirror_without_the_file_explains_what_to_do(
    mirror: dict[str, bytes], tmp_path: Path
) -> None:
    assert mirror == {}
    with pytest.raises(MachineFailed, match=r"404.*put it into.*PBRS_DEBIAN_MIRROR"):
        download_pinned(PIN, tmp_path)


def test_where_apt_has_no_lists_the_pinned_file_is_fetched(
    mirror: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess([], 100, "", "E: Unable to locate package sweethome3d\n")

    monkeypatch.setattr("shutil.which", lambda _: "/usr/bin/apt-get")
    monkeypatch.setattr("subprocess.run", refuse)
    with pytest.raises(
        MachineFailed, match=r"Unable to locate.*apt-get update.*404.*PBRS_DEBIAN_MIRROR"
    ):
        fetched_deb(PIN.package, "1.0", tmp_path)
    mirror[f"/debian/{PIN.path}"] = DATA
    assert fetched_deb(PIN.package, "1.0", tmp_path).sha256 == PIN.sha256


def test_the_pinned_packages_are_the_tested_ones() -> None:
    modules = (homes_package, furniture_package, skies, libatomic)
    tested = {m.PACKAGE: m.TESTED_VERSION for m in modules}
    assert {name: version_of(Path(pin.file_name)) for name, pin in PINS.items()} == tested


def test_a_package_from_apt_is_the_pinned_one() -> None:
    for name, pin in PINS.items():
        path = debian.cache_folder() / pin.file_name
        if path.exists():
            assert debian.cached_sha256(path, 0, 0) == pin.sha256, name
            assert path.stat().st_size == pin.n_bytes


def test_a_package_is_hashed_again_only_if_it_has_changed(tmp_path: Path) -> None:
    deb = tmp_path / "some_1.0_all.deb"
    deb.write_bytes(b"one")
    digest = hashlib.sha256(b"one").hexdigest()
    assert debian.cached_sha256(deb, 3, 7) == digest
    debian.cached_sha256.cache_clear()  # another process
    deb.write_bytes(b"two")
    assert debian.cached_sha256(deb, 3, 7) == digest
    assert debian.cached_sha256(deb, 3, 8) == hashlib.sha256(b"two").hexdigest()
    # An empty note is rewritten.
    (note,) = tmp_path.glob("*.sha256")
    note.write_bytes(b"\xff\x00")
    debian.cached_sha256.cache_clear()
    assert debian.cached_sha256(deb, 3, 8) == hashlib.sha256(b"two").hexdigest()
