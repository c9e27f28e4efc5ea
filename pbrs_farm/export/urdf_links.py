"""Elements of a URDF: joints, masses, shapes. They extend the given tree and have no other effects.

Pieces are y up; `up` is (3, 3), from the piece's axes to the document's.
"""

from __future__ import annotations

from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.content import numbers
from pbrs_farm.export.home_bodies import Shape, effort_of

_MOST_EFFORT, _MOST_SPEED = 100.0, 2.0  # N or N m; m/s or rad/s
_KINDS: Final = {JointKind.PRISMATIC: "prismatic", JointKind.REVOLUTE: "revolute"}


def add_joint(
    root: ET.Element, name: str, kind: str, parent: str, child: str, place: F64, turn: F64
) -> ET.Element:
    """Add the element of a joint. place: (3,) metres, turn: (3, 3), in the document's axes."""
    row = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(row, "parent", link=parent)
    ET.SubElement(row, "child", link=child)
    angles = Rotation.from_matrix(turn).as_euler("xyz")
    ET.SubElement(row, "origin", xyz=numbers(place), rpy=numbers(angles))
    return row


def add_moving_joint(root: ET.Element, name: str, parent: str, joint: Joint, up: F64) -> F64:
    """Add the joint of a link with its parent; returns (4, 4) from the piece's frame to the link's.

    The link's frame is the joint's, and its meshes are closed in it.
    """
    link_from_piece = joint.motion(0.0)
    link_from_piece[:3, 3] -= np.array(joint.point)
    place = up @ np.array(joint.point)
    row = add_joint(root, name, _KINDS[joint.kind], parent, name, place, np.eye(3))
    ET.SubElement(row, "axis", xyz=numbers(up @ np.array(joint.axis)))
    limit = {"lower": f"{joint.lower:.9g}", "upper": f"{joint.upper:.9g}"}
    limit |= {"effort": f"{_MOST_EFFORT:g}", "velocity": f"{_MOST_SPEED:g}"}
    ET.SubElement(row, "limit", limit)
    damping, friction = effort_of(joint)
    ET.SubElement(row, "dynamics", damping=f"{damping:.4g}", friction=f"{friction:.4g}")
    return link_from_piece


def add_inertial(element: ET.Element, mass_kg: float, shape: Shape, up: F64) -> None:
    """Add the mass of a link whose shape is in the link's frame."""
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=numbers(up @ shape.middle))
    ET.SubElement(inertial, "mass", value=f"{mass_kg:.6g}")
    tensor = up @ shape.inertia @ up.T
    pairs = [(a, b) for a in range(3) for b in range(a, 3)]
    rows = {f"i{'xyz'[a]}{'xyz'[b]}": f"{tensor[a, b]:.6g}" for a, b in pairs}
    ET.SubElement(inertial, "inertia", rows)


def add_mesh(element: ET.Element, tag: str, name: str) -> None:
    """Add a mesh of a link by its file's name; tag: "visual" or "collision"."""
    shape = ET.SubElement(element, tag)
    ET.SubElement(ET.SubElement(shape, "geometry"), "mesh", filename=name)
