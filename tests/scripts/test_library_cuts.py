"""Parts of libraries that scripts/gpu_wheels.py blanks, and parts that it keeps."""

from __future__ import annotations

import importlib
import os
import shutil
import struct
import subprocess
import sys
from itertools import accumulate
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pbrs_farm.transport.develop.denoiser import denoise_radiance

SCRIPTS = Path(__file__).parents[2] / "scripts"
HEADERS = 64 + 56
PROGBITS, STRTAB, DYNSYM = 1, 3, 11
ALLOC = 2


@pytest.fixture
def wheels(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(SCRIPTS)
    return importlib.import_module("gpu_wheels")


@pytest.fixture
def cuts(wheels: ModuleType) -> ModuleType:
    return importlib.import_module("library_cuts")


def elf(sections: list[tuple[int, int, bytes]], *, n_mapped: int, link: int = 0) -> bytes:
    """A library of (kind, flags, content); the loader maps the first n_mapped; the last holds names."""
    starts = [HEADERS, *accumulate((len(c) for _, _, c in sections), initial=HEADERS)][1:]
    mapped = starts[n_mapped] - HEADERS
    segment = struct.pack("<IIQQQQQQ", 1, 5, HEADERS, 0x1000, 0x1000, mapped, mapped, 1)
    rows = b"".join(
        struct.pack("<IIQQQQIIQQ", 0, kind, flags, 0, start, len(content), link, 0, 1, 0)
        for (kind, flags, content), start in zip(sections, starts, strict=False)
    )
    n = len(sections)
    head = struct.pack(
        "<16sHHIQQQIHHHHHH",
        b"\x7fELF\x02\x01\x01", 3, 62, 1, 0, 64, starts[-1], 0, 64, 56, 1, 64, n, n - 1,
    )  # fmt: skip
    return head + segment + b"".join(content for _, _, content in sections) + rows


def with_networks(first: bytes, second: bytes) -> bytes:
    """A library of two networks, one kept and one other, with their symbols."""
    strings = b"\0_ZN4oidn5blobs7weights4keptE\0_ZN4oidn5blobs7weights5otherE\0"
    next_address = 0x1000
    symbols = b"".join(
        struct.pack("<IBBHQQ", strings.index(name), 0x11, 0, 1, address, size)
        for name, address, size in (
            (b"_ZN4oidn5blobs7weights4kept", next_address, len(first)),
            (b"_ZN4oidn5blobs7weights5other", next_address + len(first), len(second)),
        )
    )
    return elf(
        [
            (PROGBITS, ALLOC, first + second),
            (STRTAB, ALLOC, strings),
            (DYNSYM, ALLOC, symbols),
            (STRTAB, 0, b"\0"),
        ],
        n_mapped=3,
        link=1,
    )


def test_only_unmapped_parts_are_blanked(cuts: ModuleType) -> None:
    library = elf(
        [
            (PROGBITS, ALLOC, b"code"),
            (PROGBITS, 0, b"mapped all the same"),
            (PROGBITS, 0, b"debug"),
            (STRTAB, 0, b"names"),
        ],
        n_mapped=2,
    )
    assert cuts.without_debug(library) == library.replace(b"debug", bytes(5))
    assert cuts.without_debug(b"\x7fELF, a text") == b"\x7fELF, a text"


def test_all_networks_but_one_are_blanked(cuts: ModuleType) -> None:
    library = with_networks(b"\xd7\x41one", b"\xd7\x41second")
    assert cuts.without_networks(library, "kept") == library.replace(b"\xd7\x41second", bytes(8))
    assert cuts.without_networks(library, "other") == library.replace(b"\xd7\x41one", bytes(5))


@pytest.mark.parametrize(
    ("library", "reason"),
    [
        (b"no library", "no ELF-64 file"),
        (elf([(PROGBITS, ALLOC, b"code"), (STRTAB, 0, b"\0")], n_mapped=1), "no network kept"),
        (with_networks(b"\xd7\x41one", b"other data"), "its symbol says other is"),
    ],
)
def test_a_library_without_found_networks_is_packed_whole(
    wheels: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    library: bytes,
    reason: str,
) -> None:
    monkeypatch.setattr(wheels, "picture", lambda _folder: "the same")
    monkeypatch.setattr(wheels, "NETWORK", "kept")
    core = tmp_path / "libOpenImageDenoise_core.so.3"
    core.write_bytes(library)
    wheels.cut_networks(tmp_path)
    assert core.read_bytes() == library
    assert not (tmp_path / "CUT.txt").exists()
    assert f"{core.name} is packed with all its networks: " in (output := capsys.readouterr().err)
    assert reason in output


def test_a_library_that_denoises_otherwise_when_cut_is_packed_whole(
    wheels: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    core = tmp_path / "libOpenImageDenoise_core.so.3"
    monkeypatch.setattr(wheels, "picture", lambda folder: (folder / core.name).read_bytes())
    monkeypatch.setattr(wheels, "NETWORK", "kept")
    core.write_bytes(library := with_networks(b"\xd7\x41one", b"\xd7\x41second"))
    wheels.cut_networks(tmp_path)
    assert core.read_bytes() == library


@pytest.mark.parametrize(("shown", "is_packed"), [("", True), ("as before", False)])
def test_nothing_is_packed_if_the_denoiser_no_longer_makes_a_picture(
    wheels: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    shown: str,
    is_packed: bool,
) -> None:
    # Without a first picture all networks are packed and nothing is compared. The folder holds no
    # library here.
    def fetch(site: Path, _python: str) -> None:
        (site / "a.py").write_text("1\n")

    monkeypatch.setattr(wheels, "fetch", fetch)
    monkeypatch.setattr(wheels, "cut_networks", lambda _folder: shown)
    monkeypatch.setattr(sys, "argv", ["gpu_wheels", str(tmp_path), "3.12"])
    if is_packed:
        wheels.main()
    else:
        with pytest.raises(SystemExit, match="1"):
            wheels.main()
        (line,) = capsys.readouterr().err.splitlines()
        message = "without debug data the denoiser makes another picture or none: OSError: "
        assert line.startswith(f"gpu_wheels: {message}")
    assert (tmp_path / "wheels-3.12.tar.xz").exists() == is_packed


def test_a_denoiser_that_does_not_load_is_reported_in_one_line(
    wheels: ModuleType, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=r"^OSError: .*libOpenImageDenoise\.so") as fault:
        wheels.picture(tmp_path)
    assert "\n" not in str(fault.value)
    assert wheels.picture_or_fault(tmp_path) == str(fault.value)


@pytest.mark.long
def test_the_reduced_denoiser_makes_the_same_bits_and_refuses_blanked_networks(
    wheels: ModuleType, tmp_path: Path
) -> None:
    pyoidn = pytest.importorskip("pyoidn")
    installed = Path(pyoidn.__file__).parent
    site = installed.parent
    files = sorted(
        path
        for file in installed.rglob("*")
        if file.is_file() and wheels.is_carried(path := file.relative_to(site).as_posix())
    )
    for path in files:
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(site / path, tmp_path / path)
    wheels.cut_networks(tmp_path / wheels.DENOISER)
    wheels.cut_debug(tmp_path, files)
    assert wheels.NETWORK in (tmp_path / wheels.DENOISER / "CUT.txt").read_text("utf-8")
    assert f"{wheels.DENOISER}/libtbb.so.12" in (tmp_path / "CUT.txt").read_text("utf-8")

    noise = np.random.default_rng(1).random((3, 48, 64, 3), np.float32)
    np.save(tmp_path / "noise.npy", noise)
    code = (
        "import numpy as np, pyoidn\n"
        "from pbrs_farm.transport.develop.denoiser import denoise_radiance\n"
        "noise = np.load('noise.npy')\n"
        "np.save('clean.npy', denoise_radiance(*noise))\n"
        f"assert pyoidn.__file__.startswith({str(tmp_path)!r})\n"
        "pyoidn.denoise(*noise, hdr=True, clean_aux=True, quality='fast')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": f"{tmp_path}:{SCRIPTS.parent}"},
    )  # fmt: skip
    assert "corrupted weights blob" in done.stderr
    np.testing.assert_array_equal(np.load(tmp_path / "clean.npy"), denoise_radiance(*noise))
