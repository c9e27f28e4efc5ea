"""A home as OBJ, with a group for each item, as a modelling program writes it. Effects: writes files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

BOXES = {
    "Floor": ("oak", (0, -0.1, 0), (5, 0, 4)),
    "Ceiling": ("paint", (0, 2.6, 0), (5, 2.7, 4)),
    "Wall_north": ("paint", (-0.1, 0, -0.1), (5.1, 2.6, 0)),
    "Wall_south": ("paint", (-0.1, 0, 4), (5.1, 2.6, 4.1)),
    "Wall_west": ("paint", (-0.1, 0, 0), (0, 2.6, 4)),
    "Wall_east": ("paint", (5, 0, 0), (5.1, 2.6, 4)),
    "Mesh12 sofa Model": ("linen", (0.1, 0, 1), (1.0, 0.8, 3)),
    "desk": ("oak", (3, 0, 3.2), (4.4, 0.75, 3.9)),
}
"""Group -> material, corners in metres, y up."""
_MTL = b"""newmtl oak
Kd 0.6 0.4 0.2
newmtl paint
Kd 0.9 0.9 0.9
newmtl linen
Kd 1 1 1
map_Kd cloth red.png
"""
_FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def write_obj_home(
    folder: Path, *, per_metre: float = 1.0, is_z_up: bool = False, comment: str = ""
) -> Path:
    """The .obj of a room with a sofa and a desk; its picture is for the caller to write."""
    lines, n = [f"# {comment}", "mtllib home.mtl", "vt 0 0"], 1
    for name, (material, low, high) in BOXES.items():
        corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, 8).T
        if is_z_up:
            corners = corners[:, [0, 2, 1]] * (1, -1, 1)
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners * per_metre]
        lines += [f"g {name}", f"usemtl {material}"]
        lines += ["f " + " ".join(f"{n + k}/1" for k in face) for face in _FACES]
        n += 8
    (folder / "home.mtl").write_bytes(_MTL)
    path = folder / "home.obj"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path
