"""Packs the libraries of scripts/gpu_check.sh for a machine without a network.

Effects: fetches wheels with pip, denoises a picture twice, writes FOLDER/wheels-VERSION.tar.xz.

The archive holds the files of the published wheels, unpacked side by side, without those that
gpu_wheels.txt excludes because the check opens none of them. Libraries are reduced copies, for this
check only: parts that the loader does not map are blanked (debug data, symbol tables), and so are the
networks of Open Image Denoise that pbrs_farm does not use, 42 of its 51 MB. That library is reduced
only if a picture has the same bits before and after; else it is packed whole.
CUT.txt, packed with them, names every changed library.
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

from library_cuts import without_debug, without_networks

HERE: Final = Path(__file__).resolve().parent
EXTRAS: Final = ("workers",)
TEST_PACKAGES: Final = ("pytest", "hypothesis")
# Required below Python 3.11.3 only: pip would decide by the Python that runs this script.
_FOR_OLDER_PYTHON: Final = ("async-timeout",)
# Dependencies that the check never imports: tables, the board's pages, a coordinator's metrics.
NOT_CARRIED: Final = ("pyarrow", "jinja2", "prometheus-client")
DENOISER: Final = "pyoidn/oidn/lib"
# Network for color, albedo and normal with hdr and cleanAux, at high quality.
NETWORK: Final = "rt_hdr_calb_cnrm_large"
NOTICE_OF_DEBUG: Final = """\
Cut copies, for scripts/gpu_check.sh of pbrs_farm only: in the libraries named here, everything that
the loader does not map (debug data, symbol tables) was overwritten with zeros. Take the libraries
themselves from the published wheels, whose versions the folders *.dist-info name.

"""
NOTICE_OF_NETWORKS: Final = f"""\
A cut copy, for scripts/gpu_check.sh of pbrs_farm only: in libOpenImageDenoise_core all networks but
{NETWORK} were overwritten with zeros; a filter that asks for another one fails.
Take Open Image Denoise itself from https://www.openimagedenoise.org. It is distributed under the
licence below.

"""
_PATIENCE_S: Final = 300  # for a picture of 64x48
# pip needs each by its exact name.
_ABIS: Final = "_2_28 _2_27 _2_24 _2_17 2014 _2_12 2010 _2_5 1"


def main() -> None:
    """Fetch, select, reduce and pack the files; print the size of the archive."""
    parser = argparse.ArgumentParser(description="pack the libraries of the GPU check")
    parser.add_argument("folder", type=Path)
    parser.add_argument("python", nargs="?", default="{}.{}".format(*sys.version_info[:2]))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        site = Path(scratch)
        fetch(site, args.python)
        shown = cut_networks(site / DENOISER)
        cut_debug(site, carried(site))
        if shown and shown != (now := picture_or_fault(site / DENOISER)):
            reason = f"the denoiser makes another picture or none: {now}"
            parser.exit(1, f"gpu_wheels: without debug data {reason}\n")
        files = carried(site)
        archive = args.folder / f"wheels-{args.python}.tar.xz"
        pack(site, files, archive)
        n_bytes = archive.stat().st_size
        size = f"{n_bytes / 1e6:.1f} MB ({n_bytes / 2**20:.1f} MiB)"
        sys.stdout.write(f"{archive}: {size}, {len(files)} files\n")


def requirements() -> list[str]:
    """The requirements of pyproject.toml without NOT_CARRIED, plus those of the tests."""
    text = (HERE.parent / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    texts = list(project["dependencies"])
    for extra in EXTRAS:
        texts += project["optional-dependencies"][extra]
    return [
        *(r for r in texts if not r.startswith(NOT_CARRIED)),
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
    """(packed, pattern) for each line of gpu_wheels.txt."""
    lines = (HERE / "gpu_wheels.txt").read_text(encoding="utf-8").splitlines()
    return [(line[0] == "+", line[2:]) for line in lines if line[:1] in ("+", "-")]


def is_carried(path: str) -> bool:
    """Whether the file is packed. path: below site-packages, with slashes."""
    return next((packed for packed, pattern in rules() if fnmatchcase(path, pattern)), True)


def carried(site: Path) -> list[str]:
    """Files to pack, below site: texts first, then code, each kind by name, so that similar files are adjacent."""
    files = [p.relative_to(site).as_posix() for p in site.rglob("*") if p.is_file()]
    by_kind = sorted(files, key=lambda path: (".so" in path, path.rpartition("/")[2], path))
    return [path for path in by_kind if is_carried(path)]


def cut_networks(denoiser: Path) -> str:
    """Blank the networks of Open Image Denoise that pbrs_farm never uses, and record it in CUT.txt.

    denoiser: the folder of its libraries. Returns the hash of a picture that they make, "" if this
    machine cannot compute it. The networks stay whole, with a printed reason, in that case and if they
    are not found or the picture changes.
    """
    core = next(denoiser.glob("libOpenImageDenoise_core.so.*"))
    whole, before = core.read_bytes(), ""
    try:
        before = picture(denoiser)
        core.write_bytes(without_networks(whole, NETWORK))
        if picture(denoiser) != before:
            raise ValueError("a picture comes out otherwise")
    except ValueError as error:
        core.write_bytes(whole)
        sys.stderr.write(f"gpu_wheels: {core.name} is packed with all its networks: {error}\n")
        return before
    licence = (HERE.parent / "LICENSE").read_text(encoding="utf-8")
    (denoiser / "CUT.txt").write_text(NOTICE_OF_NETWORKS + licence, "utf-8")
    return before


def cut_debug(site: Path, files: list[str]) -> None:
    """Blank unmapped parts of the libraries among the files; CUT.txt names them."""
    changed = []
    for path in (p for p in files if ".so" in p):
        whole = (site / path).read_bytes()
        cut = without_debug(whole)
        if cut != whole:
            (site / path).write_bytes(cut)
            changed.append(f"{path}\n")
    (site / "CUT.txt").write_text(NOTICE_OF_DEBUG + "".join(changed), "utf-8")


def picture(denoiser: Path) -> str:
    """Hash of a picture denoised by the libraries of that folder; raises ValueError with the denoiser's error.

    A separate process loads them, so that each call uses the folder's current libraries.
    """
    library = denoiser / "libOpenImageDenoise.so"
    command = [sys.executable, str(HERE / "denoise_once.py"), str(library)]
    try:
        done = subprocess.run(
            command, check=False, capture_output=True, text=True, timeout=_PATIENCE_S
        )
    except subprocess.TimeoutExpired as late:
        raise ValueError(f"no picture within {_PATIENCE_S} s") from late
    if done.returncode:
        message = done.stderr.strip().rpartition("\n")[2]
        raise ValueError(message or f"its process ended with {done.returncode}")
    return done.stdout


def picture_or_fault(denoiser: Path) -> str:
    """picture(), or the text of its error."""
    try:
        return picture(denoiser)
    except ValueError as error:
        return str(error)


def pack(site: Path, files: list[str], archive: Path) -> None:
    """Write one compressed stream without owners and clocks, so that equal wheels give equal bytes."""
    preset = {"preset": 9 | lzma.PRESET_EXTREME, "dict_size": 1 << 27}
    filters = [{"id": lzma.FILTER_X86}, {"id": lzma.FILTER_LZMA2, **preset}]
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
