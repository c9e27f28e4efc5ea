"""A set of two small homes, written as files, and the contents of a set's folder."""

from __future__ import annotations

import hashlib
from pathlib import Path

from tests.read.gltf.gltf_scenes import two_rooms

TEXT = """
split = "50/25/25"
[card]
title = "Small"
licence = "CC0"
[render]
recipe = "preview"
modes = ["opengl_dl"]
set = [
  "cameras.preset=paper", "cameras.min_objects=0", "cameras.cell_m=1.0",
  "cameras.score_width_px=160", "cameras.score_height_px=120",
]
[part.views]
homes = {homes}
size = "64x48"
views = 2
select = ["twins", "black"]
[part.panoramas]
homes = {first}
views = 1
size = "64x32"
layers = ["depth_z"]
set = ["lens.model=equirect"]
[form.coco]
parts = ["views"]
[form.small]
to = "webdataset"
[form.shards]
parts = ["views"]
layers = ["colour", "depth"]
"""


def small_set(folder: Path, forms: str = "", size: str = "64x48") -> Path:
    """A set's file of two homes of two rooms; forms: further tables of it. size: of its views."""
    folder.mkdir(parents=True, exist_ok=True)
    homes = []
    for k in range(2):
        scene = two_rooms()
        scene.node("Table", mesh=scene.box([1.0 + k, 0, 1.0], [2.0 + k, 0.7, 1.8]))
        scene.node("Cabinet", mesh=scene.box([5.0, 0, 0.1], [5.9, 1.5, 0.6 + 0.2 * k]))
        homes.append(folder / f"home{k}.glb")
        homes[-1].write_bytes(scene.glb())
    names = [str(home) for home in homes]
    text = (
        (TEXT + forms)
        .replace("64x48", size)
        .replace("{homes}", str(names))
        .replace("{first}", str(names[:1]))
    )
    (folder / "small.toml").write_text(text)
    return folder / "small.toml"


def digests(out: Path) -> dict[str, str]:
    """SHA-256 of every file of a set's folder except markers, which have clocks."""
    return {
        path.relative_to(out).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(out.rglob("*"))
        if path.is_file() and not {"done", ".incomplete"} & set(path.relative_to(out).parts[:-1])
    }


def sums(out: Path) -> dict[str, str]:
    """The lines of SHA256SUMS in coreutils' format."""
    rows = [line.split("  ", 1) for line in (out / "SHA256SUMS").read_text().splitlines()]
    return {name: digest for digest, name in rows}
