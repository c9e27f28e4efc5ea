"""Packs the libraries of scripts/gpu_check.sh for a machine without a network.

Effects: fetches wheels with pip, writes FOLDER/wheels-VERSION.tar.xz and FOLDER/denoiser-VERSION.tar.xz.

The archives hold files of the published wheels, unchanged, unpacked side by side, less those that
gpu_wheels.txt leaves out because the check opens none of them. All are compressed as one stream,
with the filter for x86 code. The denoiser stands apart: the networks in its library are 44 MB that
no compressor makes smaller.
"""

from __future__ import annotations

import argparse
import lzma
import subprocess
import sys
import tarfile
import tomllib
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

HERE: Final = Path(__file__).resolve().parent
EXTRAS: Final = ("gl", "transport", "workers")
TEST_PACKAGES: Final = ("pytest", "hypothesis")
# What a requirement asks for below Python 3.11.3 only: pip judges that by the Python that packs.
_FOR_OLDER_PYTHON: Final = ("async-timeout",)
# Dependencies that nothing in the check imports: tables, the board's pages, a coordinator's figures.
NOT_CARRIED: Final = ("pyarrow", "jinja2", "prometheus-client")
# pip takes each by its exact name.
_ABIS: Final = "_2_28 _2_27 _2_24 _2_17 2014 _2_12 2010 _2_5 1"


def main() -> None:
    """Fetch, leave out, pack; say how large the archives are."""
    parser = argparse.ArgumentParser(description="pack the libraries of the GPU check")
    parser.add_argument("folder", type=Path)
    parser.add_argument("python", nargs="?", default="{}.{}".format(*sys.version_info[:2]))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        site = Path(scratch)
        fetch(site, args.python)
        for name, files in archives(carried(site)).items():
            archive = args.folder / f"{name}-{args.python}.tar.xz"
            pack(site, files, archive)
            n_bytes = archive.stat().st_size
            sys.stdout.write(f"{archive}: {n_bytes / 1e6:.1f} MB, {len(files)} files\n")


def requirements() -> list[str]:
    """What pyproject.toml asks for, less NOT_CARRIED, and what runs the tests."""
    text = (HERE.parent / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    asked = list(project["dependencies"])
    for extra in EXTRAS:
        asked += project["optional-dependencies"][extra]
    return [
        *(r for r in asked if not r.startswith(NOT_CARRIED)),
        *TEST_PACKAGES,
        *_FOR_OLDER_PYTHON,
    ]


def fetch(site: Path, python: str) -> None:
    """Unpack the wheels of all requirements into site, for x86-64 Linux and that version of Python."""
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-compile", "--target", str(site)]
    wheels = ["--only-binary=:all:", "--implementation", "cp", "--python-version", python]
    platforms = [f"--platform=manylinux{abi}_x86_64" for abi in _ABIS.split()]
    subprocess.run([*pip, *wheels, *platforms, *requirements()], check=True)


def rules() -> list[tuple[bool, str]]:
    """(packed, pattern) of each line of gpu_wheels.txt."""
    lines = (HERE / "gpu_wheels.txt").read_text(encoding="utf-8").splitlines()
    return [(line[0] == "+", line[2:]) for line in lines if line[:1] in ("+", "-")]


def is_carried(path: str) -> bool:
    """Whether the file is packed. path: below site-packages, with slashes."""
    return next((packed for packed, pattern in rules() if fnmatchcase(path, pattern)), True)


def carried(site: Path) -> list[str]:
    """Files to pack, below site: texts first, then code, each kind by name, so that like is near like."""
    files = [p.relative_to(site).as_posix() for p in site.rglob("*") if p.is_file()]
    by_kind = sorted(files, key=lambda path: (".so" in path, path.rpartition("/")[2], path))
    return [path for path in by_kind if is_carried(path)]


def archives(files: list[str]) -> dict[str, list[str]]:
    """Name of an archive -> its files."""
    denoiser = [path for path in files if path.startswith("pyoidn")]
    return {"wheels": [p for p in files if not p.startswith("pyoidn")], "denoiser": denoiser}


def pack(site: Path, files: list[str], archive: Path) -> None:
    """Write one compressed stream; without owners and clocks, so that equal wheels give equal bytes."""
    # Weights of half precision come in pairs of bytes; code and text do not.
    pairs = {"lc": 0, "lp": 1, "pb": 1} if archive.name.startswith("denoiser") else {}
    preset = {"preset": 9 | lzma.PRESET_EXTREME, "dict_size": 1 << 27}
    filters = [{"id": lzma.FILTER_X86}, {"id": lzma.FILTER_LZMA2, **preset, **pairs}]
    with (
        lzma.open(archive, "wb", filters=filters) as stream,
        tarfile.open(fileobj=stream, mode="w") as tar,
    ):
        for path in files:
            entry = tar.gettarinfo(site / path, path)
            entry.uid = entry.gid = entry.mtime = 0
            entry.uname = entry.gname = ""
            with (site / path).open("rb") as content:
                tar.addfile(entry, content)


if __name__ == "__main__":
    main()
