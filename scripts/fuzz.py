"""Coverage-guided fuzzing of the readers of binary files: `make fuzz`, or NAME=glb SECONDS=600 for one reader.

Each input is a sound file with changes that atheris chooses. A reader may answer with one of our errors; any other
exception, a crash or 25 s without an answer is a finding, and the input that did it lies in out/fuzz.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["pbrs_farm"]):
    import pbrs_farm as pf
    from pbrs_farm.core.recipe import ReadFields
    from pbrs_farm.prepare.formats import format_of_kind
    from pbrs_farm.read.common.format import GivenFile
    from pbrs_farm.read.sweethome3d.home_file.java_home import JavaStreamError, java_objects
    from tests.hostile import sound_inputs
    from tests.inputs import ifc_files, mjcf_files

OUT = Path("out/fuzz")


def _of_home(kind: str, suffix: str) -> Callable[[bytes], object]:
    """Reads a home of a format from bytes."""
    form, file = format_of_kind(kind), Path(tempfile.mkdtemp(prefix="fuzz-"), f"home{suffix}")

    def read(data: bytes) -> object:
        file.write_bytes(data)
        return form.read(GivenFile(file), ReadFields())

    return read


def _ply(data: bytes) -> object:
    file = Path(tempfile.gettempdir(), "fuzz.ply")
    file.write_bytes(data)
    return pf.model(file)


def _bytes_of(write: Callable[[Path], Path]) -> bytes:
    return write(Path(tempfile.mkdtemp(prefix="fuzz-"))).read_bytes()


PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY += (
    b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    + bytes(36)
    + b"\x03"
    + bytes(12)
)
READERS: dict[str, tuple[Callable[[bytes], object], Callable[[], bytes]]] = {
    "glb": (_of_home("gltf", ".glb"), sound_inputs.glb),
    "zip": (_of_home("sweethome3d", ".sh3d"), sound_inputs.archive),
    "java": (java_objects, lambda: b"\xac\xed\x00\x05" + bytes(64)),
    "ply": (_ply, lambda: PLY),
    "ifc": (
        _of_home("ifc", ".ifc"),
        lambda: _bytes_of(lambda f: ifc_files.realistic_house(f / "house.ifc", 200)),
    ),
    "mjcf": (_of_home("mjcf", ".xml"), lambda: _bytes_of(mjcf_files.write_model)),
}
"""Name -> (reader of bytes, sound bytes to begin with)."""


def main(name: str, seconds: str) -> None:
    """Fuzz a reader for some seconds; exits with another code than 0 after a finding."""
    read, sound = READERS[name]
    corpus = OUT / name
    corpus.mkdir(parents=True, exist_ok=True)
    (corpus / "sound").write_bytes(sound())
    # The reader imports its modules at the first use: with marks for coverage.
    with atheris.instrument_imports(include=["pbrs_farm"]), suppress(pf.PbrsError, JavaStreamError):
        read(sound())

    def attempt(data: bytes) -> None:
        try:
            read(data)
        except (pf.PbrsError, JavaStreamError):
            return

    options = [f"-max_total_time={seconds}", "-timeout=25", f"-artifact_prefix={OUT}/{name}-"]
    atheris.Setup([sys.argv[0], str(corpus), *options, "-rss_limit_mb=4096"], attempt)
    atheris.Fuzz()


if __name__ == "__main__":
    main(*sys.argv[1:3])
