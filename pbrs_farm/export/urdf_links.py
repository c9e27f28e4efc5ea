"""Elements of a URDF: joints, masses, shapes; they change the tree that is given, and nothing else.

Pieces are y up; a document has an up of its own: `up` is (3, 3), from the piece's axes to the document's.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.home_links import Link, effort_of

_MOST_EFFORT, _MOST_SPEED = 100.0, 2.0  # N or N m; m/s or rad/s
_KINDS: Final = {JointKind.PRISMATIC: "prismatic", JointKind.REVOLUTE: "revolute"}


def add_joint(
    root: ET.Element, name: str, kind: str, parent: str, child: str, place: F64, turn: F64
) -> ET.Element:
    """The element of a joint. place: (3,) metres, turn: (3, 3), in the document's axes."""
    row = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(row, "parent", link=parent)
    ET.SubElement(row, "child", link=child)
    angles = Rotation.from_matrix(turn).as_euler("xyz")
    ET.SubElement(row, "origin", xyz=numbers(place), rpy=numbers(angles))
    return row


def add_moving_joint(root: ET.Element, name: str, parent: str, joint: Joint, up: F64) -> F64:
    """Hang the link of a name on its parent by a joint; (4, 4) from the piece's frame to the link's.

    The link's frame is the joint's: its meshes stand in it as they are when it is shut.
    """
    shut = joint.motion(0.0)
    shut[:3, 3] -= np.array(joint.point)
    place = up @ np.array(joint.point)
    row = add_joint(root, name, _KINDS[joint.kind], parent, name, place, np.eye(3))
    ET.SubElement(row, "axis", xyz=numbers(up @ np.array(joint.axis)))
    limit = {"lower": f"{joint.lower:.9g}", "upper": f"{joint.upper:.9g}"}
    limit |= {"effort": f"{_MOST_EFFORT:g}", "velocity": f"{_MOST_SPEED:g}"}
    ET.SubElement(row, "limit", limit)
    damping, friction = effort_of(joint)
    ET.SubElement(row, "dynamics", damping=f"{damping:.4g}", friction=f"{friction:.4g}")
    return shut


def add_inertial(element: ET.Element, link: Link, matrix: F64, up: F64) -> None:
    """A link's mass. matrix: (4, 4) from the piece's frame to the link's."""
    inertial = ET.SubElement(element, "inertial")
    middle = up @ transform_points(matrix, link.middle[None])[0]
    ET.SubElement(inertial, "origin", xyz=numbers(middle))
    ET.SubElement(inertial, "mass", value=f"{link.mass_kg:.6g}")
    turn = up @ matrix[:3, :3]
    tensor = turn @ np.diag(link.inertia) @ turn.T
    pairs = [(a, b) for a in range(3) for b in range(a, 3)]
    rows = {f"i{'xyz'[a]}{'xyz'[b]}": f"{tensor[a, b]:.6g}" for a, b in pairs}
    ET.SubElement(inertial, "inertia", rows)


def add_mesh(element: ET.Element, tag: str, name: str) -> None:
    """What is seen ("visual") or touched ("collision") of a link: a mesh by its file's name."""
    shape = ET.SubElement(element, tag)
    ET.SubElement(ET.SubElement(shape, "geometry"), "mesh", filename=name)


def numbers(values: Iterable[float]) -> str:
    """Numbers as an attribute has them."""
    return " ".join(f"{float(x):.9g}" for x in values)
