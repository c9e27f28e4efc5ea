"""Packets of four floats, as buffers on the device hold them, as vectors; kernels, no effects."""

from __future__ import annotations

from typing import Any

import mitsuba as mi


def point(packet: Any) -> Any:
    """Point3f of a packet's first three floats."""
    return mi.Point3f(packet[0], packet[1], packet[2])


def vector(packet: Any) -> Any:
    """Vector3f of a packet's first three floats."""
    return mi.Vector3f(packet[0], packet[1], packet[2])


def colour(packet: Any) -> Any:
    """Color3f of a packet's first three floats."""
    return mi.Color3f(packet[0], packet[1], packet[2])
