"""Packets of four floats, as buffers on the device hold them, as vectors; kernels, no effects."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi


def gather_packets(rows: Any, index: Any, n: int, active: Any = True) -> list[Any]:
    """n packets of four floats of each lane's row, by its index: a gather costs by the access."""
    return [dr.gather(mi.Vector4f, rows, index * n + k, active) for k in range(n)]


def point(packet: Any) -> Any:
    """Point3f of a packet's first three floats."""
    return mi.Point3f(packet[0], packet[1], packet[2])


def vector(packet: Any) -> Any:
    """Vector3f of a packet's first three floats."""
    return mi.Vector3f(packet[0], packet[1], packet[2])


def colour(packet: Any) -> Any:
    """Color3f of a packet's first three floats."""
    return mi.Color3f(packet[0], packet[1], packet[2])


def xyz(v: Any) -> tuple[Any, Any, Any]:
    """The components of a vector or point, to be written."""
    return v.x, v.y, v.z


def rgb(c: Any) -> tuple[Any, Any, Any]:
    """The components of a colour, to be written."""
    return c[0], c[1], c[2]
