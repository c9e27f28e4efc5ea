"""The nine example homes of Debian's `sweethome3d` package: list, fetch, read their bytes.

Effects: runs `apt-get download` (no root, apt's signed index vouches for the file) and keeps the
package in a cache folder. Nothing of the package is committed or shipped.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import lzma
import os
import shutil
import subprocess
import tarfile
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.errors import BadInput, MachineFailed

PACKAGE: Final = "sweethome3d"
TESTED_VERSION: Final = "7.0.2+dfsg-3"
JAR: Final = "usr/share/sweethome3d/sweethome3d.jar"
EXAMPLES: Final = "com/eteks/sweethome3d/io/resources/examples"
APT_TIMEOUT_S: Final = 600


@dataclass(frozen=True, slots=True)
class ExampleHome:
    """A home drawn by E. and V. Puybaret / eTeks (CC-BY 3.0). name: to ask for it by."""

    name: str
    n_rooms: int
    n_levels: int


_HOMES: Final = (
    ExampleHome("Studio", 5, 1),
    ExampleHome("1BedroomApartmentWithRoundWall", 3, 1),
    ExampleHome("2BedroomApartment", 7, 1),
    ExampleHome("2BedroomApartmentWithBowWindow", 8, 1),
    ExampleHome("2BedroomHouseWithBasement", 13, 3),
    ExampleHome("3BedroomApartment", 9, 1),
    ExampleHome("3BedroomHouseWithAttic", 11, 4),
    ExampleHome("3BedroomHouseWithMezzanine", 23, 3),
    ExampleHome("4BedroomHouse", 11, 2),
)


def example_homes() -> tuple[ExampleHome, ...]:
    """The example homes by name; rooms and levels as drawn, hidden levels included."""
    return _HOMES


def cache_folder() -> Path:
    """$PBRS_CACHE, else ~/.cache/pbrs_farm."""
    given = os.environ.get("PBRS_CACHE", "")
    return Path(given) if given else Path.home() / ".cache" / "pbrs_farm"


@dataclass(frozen=True, slots=True)
class Package:
    """A fetched package. deb_sha256: of the .deb. note: what is odd about it, or ""."""

    version: str
    deb_sha256: str
    jar: Path
    note: str = ""

    @property
    def label(self) -> str:
        """For Source.package: name, version and hash."""
        return f"{PACKAGE} {self.version} (Debian, sha256 {self.deb_sha256})"

    def home(self, name: str) -> tuple[bytes, str]:
        """The XML of an example home and its file name; BadInput for an unknown name."""
        known = {h.name.lower(): h.name for h in _HOMES}
        exact = known.get(name.lower().removesuffix(".xml"))
        if exact is None:
            raise BadInput("example homes", "", f"no home {name!r}", hint=", ".join(known.values()))
        with zipfile.ZipFile(self.jar) as jar:
            try:
                return jar.read(f"{EXAMPLES}/{exact}.xml"), f"{exact}.xml"
            except KeyError:
                raise BadInput(self.jar, f"{EXAMPLES}/{exact}.xml", "not in this version") from None

    def resources(self) -> JarResources:
        """The program's own models and textures, for homes that refer to them."""
        return JarResources(self.jar)


class JarResources:
    """Contents of the program's jar by name; opened on the first read."""

    def __init__(self, jar: Path) -> None:
        self._jar = jar
        self._zip: zipfile.ZipFile | None = None

    def read(self, name: str) -> bytes | None:
        """The content's bytes, or None if there is none of that name."""
        if self._zip is None:
            self._zip = zipfile.ZipFile(self._jar)
        try:
            return self._zip.read(name)
        except KeyError:
            return None


def cached(cache: Path | None = None) -> Package | None:
    """The package if it was fetched before, else None; touches no network."""
    folder = cache or cache_folder()
    debs = sorted(folder.glob(f"{PACKAGE}_*.deb"))
    debs.sort(key=lambda p: _version_of(p) == TESTED_VERSION)
    return _unpacked(debs[-1]) if debs else None


def fetch(cache: Path | None = None) -> Package:
    """The package from the cache, else downloaded through apt.

    Raises MachineFailed, with the command to type, where apt cannot give it.
    """
    folder = cache or cache_folder()
    try:
        return cached(folder) or _fetched(folder)
    except OSError as error:
        raise MachineFailed(
            f"{folder}: {error.strerror or error}", hint="set PBRS_CACHE to a folder of yours"
        ) from None


def _fetched(folder: Path) -> Package:
    folder.mkdir(parents=True, exist_ok=True)
    if shutil.which("apt-get") is None:
        raise MachineFailed(
            "no apt-get here to fetch the example homes",
            hint=f"put Debian's {PACKAGE}_{TESTED_VERSION}_all.deb into {folder}, "
            "or give a home of your own with --home",
        )
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        _download(Path(scratch))
        debs = sorted(Path(scratch).glob(f"{PACKAGE}_*.deb"))
        if not debs:
            raise MachineFailed(f"apt-get download {PACKAGE} left no file", hint=_hint())
        target = folder / debs[0].name
        debs[0].replace(target)
    return _unpacked(target)


def _download(scratch: Path) -> None:
    try:
        done = subprocess.run(
            ["apt-get", "download", PACKAGE],
            cwd=scratch,
            capture_output=True,
            text=True,
            timeout=APT_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MachineFailed(f"apt-get download {PACKAGE}: {error}", hint=_hint()) from None
    if done.returncode != 0:
        lines = [x for x in (done.stderr + done.stdout).splitlines() if x.startswith("E:")]
        reason = lines[0] if lines else f"exit status {done.returncode}"
        raise MachineFailed(f"apt-get download {PACKAGE}: {reason}", hint=_hint())


def _hint() -> str:
    return "type `sudo apt-get update`, then try again; or give a home of your own with --home"


def _version_of(deb: Path) -> str:
    return deb.name.split("_")[1].replace("%3a", ":") if deb.name.count("_") >= 2 else ""


def _unpacked(deb: Path) -> Package:
    data = deb.read_bytes()
    sha = hashlib.sha256(data).hexdigest()
    jar = deb.parent / f"{PACKAGE}-{sha[:16]}.jar"
    if not jar.exists():
        content = _jar_from_deb(deb, data)
        with tempfile.NamedTemporaryFile(dir=deb.parent, delete=False) as scratch:
            scratch.write(content)
        Path(scratch.name).replace(jar)
    version = _version_of(deb)
    note = ""
    if version != TESTED_VERSION:
        note = f"{PACKAGE} {version} is not the tested version {TESTED_VERSION}"
    return Package(version, sha, jar, note)


def _jar_from_deb(deb: Path, data: bytes) -> bytes:
    try:
        for name, content in _ar_members(data):
            if name.startswith("data.tar"):
                tar = _plain_tar(name, content, deb)
                with tarfile.open(fileobj=io.BytesIO(tar)) as archive:
                    for member in archive:
                        if member.name.lstrip("./") == JAR and member.isfile():
                            stream = archive.extractfile(member)
                            if stream is not None:
                                return stream.read()
    except (tarfile.TarError, lzma.LZMAError, EOFError, OSError, ValueError) as error:
        raise _damaged(deb, str(error)) from None
    raise _damaged(deb, f"holds no {JAR}")


def _damaged(deb: Path, why: str) -> MachineFailed:
    return MachineFailed(f"{deb}: {why}", hint="delete the file and fetch it again")


def _ar_members(data: bytes) -> list[tuple[str, bytes]]:
    if not data.startswith(b"!<arch>\n"):
        raise ValueError("not a Debian package")
    members, at = [], 8
    while at + 60 <= len(data):
        name = data[at : at + 16].decode("ascii", "replace").strip().rstrip("/")
        size = int(data[at + 48 : at + 58])
        members.append((name, data[at + 60 : at + 60 + size]))
        at += 60 + size + size % 2
    return members


def _plain_tar(name: str, content: bytes, deb: Path) -> bytes:
    if name.endswith(".xz"):
        return lzma.decompress(content)
    if name.endswith((".tar", ".gz")):
        return gzip.decompress(content) if name.endswith(".gz") else content
    if shutil.which("dpkg-deb") is None:
        raise ValueError(f"{name}: dpkg-deb is needed to unpack it")
    done = subprocess.run(
        ["dpkg-deb", "--fsys-tarfile", str(deb)], capture_output=True, check=True, timeout=300
    )
    return done.stdout
