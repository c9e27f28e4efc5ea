"""Parts that the files of simulators share: z-up axes, XML, names by content.

Effects: write_shut_remark writes a file.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import Z_UP_FROM_Y_UP
from pbrs_farm.export.form import REMARKS
from pbrs_farm.export.home_pieces import ExportedHome
from pbrs_farm.geometry.convex_parts import hull_faces

_OPEN: Final = 1e-3  # radians or metres
Z_UP: Final = Z_UP_FROM_Y_UP[:3, :3]


def z_up_points(points: NDArray[np.floating]) -> F64:
    """(N, 3) with y up -> (N, 3) with z up: (x, -z, y)."""
    return np.stack([points[:, 0], -points[:, 2], points[:, 1]], -1).astype(np.float64)


def z_up_pose(world_from_local: F64) -> tuple[F64, F64]:
    """The place (3,) and turn (3, 3) of a frame (4, 4) with y up, in a world with z up."""
    place = z_up_points(world_from_local[None, :3, 3])[0]
    return place, Z_UP @ world_from_local[:3, :3] @ Z_UP.T


def xml_bytes(root: ET.Element) -> bytes:
    """The document of a root, indented."""
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def convex_obj(points: F64) -> bytes:
    """A convex part (V, 3) as a Wavefront OBJ."""
    rows = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]
    rows += [f"f {a} {b} {c}" for a, b, c in hull_faces(points) + 1]
    return ("\n".join(rows) + "\n").encode()


def digest_name(data: bytes) -> str:
    """A name for a file by its content, so that equal meshes are written once.

    16 hex digits: enough for the pieces of one export, no proof of equality.
    """
    return keys.sha256(data)[:16]


def write_shut_remark(home: ExportedHome, folder: Path) -> None:
    """Write a remark if parts of a home are open; for forms without a state of joints."""
    joints = [body.joint for piece in home.pieces for body in piece.bodies if body.joint]
    n_open = sum(abs(joint.value) > _OPEN for joint in joints)
    if n_open:
        text = f"{home.house.id}: {n_open} open doors and drawers are shut: the form has no state of joints\n"
        (folder / REMARKS).write_text(text)
